"""Weights of neural BRDFs (Sztrajman et al. 2021): a numpy archive with one small network per material.

    NAME/w0 (6, 21)   NAME/b0 (21,)    NAME/w1 (21, 21)   NAME/b1 (21,)   NAME/w2 (21, 3)   NAME/b2 (3,)

float32, matrices with inputs as rows. One file holds many materials: FILE#NAME picks one. The value is f in
sr⁻¹ without the cosine, as in the MERL tables on which the networks were trained; a network is a surrogate of
its material's measurement, not the measurement.
"""

import os
import re
from dataclasses import replace
from difflib import get_close_matches

import numpy as np
import torch

from homofact.brdf.channels import check_channels
from homofact.brdf.formats.reading import Drawing, Reading
from homofact.brdf.neural import LAYERS, NeuralBrdf
from homofact.brdf.sampling import sample_model
from homofact.errors import BadInput
from homofact.files.archive import member_names, read_arrays
from homofact.files.reading import read_bytes, split_member

NAME = "nbrdf"
DESCRIPTION = "weights of neural BRDFs (NAME/w0 … NAME/b2; FILE#NAME picks a material)"
_PARTS = tuple(f"{kind}{k}" for k in range(len(LAYERS)) for kind in "wb")
_WHOLE = "a whole archive of NAME/w0, NAME/b0 … NAME/b2"
_FIRST_MEMBER = re.compile(rb"[^\0]/[wb][012]\.npy")


def sniff(head: bytes) -> bool:
    """Return whether a file that begins with `head` is a zip whose first member is one of a network's arrays."""
    return head.startswith(b"PK\x03\x04") and _FIRST_MEMBER.search(head[30:300]) is not None


def material_names(path: str | os.PathLike[str]) -> list[str]:
    """Return the materials of a file, sorted. Raises BadInput where it cannot be read or holds no network."""
    return _names(path, read_bytes(path, DESCRIPTION))


def load(path: str | os.PathLike[str]) -> NeuralBrdf:
    """Return the network of material FILE#NAME; NAME is optional if the file has only one material.

    Raises BadInput for a damaged file, an unknown name (the message suggests the nearest one), a missing name if there
    are several networks (the message lists some), and arrays of wrong sizes or types.
    """
    file, name = split_member(path)
    raw = read_bytes(file, DESCRIPTION)
    names = _names(file, raw)
    if name is None:
        if len(names) > 1:
            raise BadInput(
                f"holds {len(names)} materials ({', '.join(names[:4])}, …)",
                where=file,
                expected=f"one of them as {os.path.basename(file)}#{names[0]}",
            )
        name = names[0]
    if name not in names:
        near = get_close_matches(name, names, n=1, cutoff=0.3)
        nearest = f", nearest {near[0]}" if near else ""
        raise BadInput(where=file, found=f"no material {name!r}{nearest}", expected=f"one of its {len(names)}")
    arrays = read_arrays(file, raw, [f"{name}/{part}" for part in _PARTS], _WHOLE)
    tensors = {}
    for part in _PARTS:
        array = arrays.get(f"{name}/{part}")
        if array is None or array.dtype.kind != "f":
            stated = "missing" if array is None else f"of {array.dtype}"
            raise BadInput(f"{name}/{part} is {stated}", where=file, expected="an array of floats")
        # A number that float32 cannot hold becomes infinite, and the network refuses it.
        with np.errstate(all="ignore"):
            tensors[part] = torch.from_numpy(array.astype(np.float32))
    layers = range(len(LAYERS))
    try:
        return NeuralBrdf(
            weights=(tensors["w0"], tensors["w1"], tensors["w2"]), biases=tuple(tensors[f"b{k}"] for k in layers)
        )
    except BadInput as error:
        raise error.at(f"{file}: {name}") from error


def open_file(path: str | os.PathLike[str], channels: str = "rgb", drawing: Drawing | None = None) -> Reading:
    """Return the network of material FILE#NAME, with noise-free samples of it drawn according to `drawing`.

    Raises BadInput as `load` does, and for channels "spectral".
    """
    check_channels(channels)
    model = load(path)
    draw = drawing or Drawing()
    samples = sample_model(model, draw.count, draw.scheme, draw.seed)
    facts = {
        "format": NAME,
        "material": split_member(path)[1] or material_names(path)[0],
        "model": "NeuralBrdf",
        "noise_free": True,
        "comments": ["Sztrajman et al. 2021: a network's surrogate of a measurement, not the measurement"],
        "units": "1/sr, no cosine; exp(x) - 1 undone, below 0 cut to 0",
        "faults": {"exact_zeros": int((samples.values == 0).sum())},
    }
    return Reading.of(path, replace(samples, provenance=samples.provenance | facts), model, channels)


def _names(path: object, raw: bytes) -> list[str]:
    members = member_names(path, raw, _WHOLE)
    names = sorted({name.rpartition("/")[0] for name in members if name.rpartition("/")[2] in _PARTS} - {""})
    if not names:
        raise BadInput("holds no NAME/w0", where=path, expected=_WHOLE)
    return names
