"""A separable fit's textures as images, and its manifest.

An EXR holds one factor's texels in float32 as they are, linear and of both signs: a renderer interpolates, multiplies
and adds. A PNG shows the absolute values, as Wang, Tran and Luebke 2004 (figure 4) do, in red, green and blue where
there are three channels, over the texture's largest one and through the gamma 2.2; texels that no direction reads
are hatched yellow. Row 0 (v = −1) is the first scanline of both.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import torch
from PIL import Image, PngImagePlugin
from torch import Tensor

from homofact.containers.exr import exr_channel_names, write_exr
from homofact.errors import BadInput
from homofact.export.images import enlarged_and_hatched, three_channels
from homofact.export.manifest import CONVENTIONS, bits
from homofact.files.atomic import replace_file
from homofact.separable.separable import Separable
from homofact.version import __version__

FORMAT = "homofact separable manifest"
FORMAT_VERSION = 1

MAPS = {
    "parabolic": "(u, v) = (w.x, w.y) / (1 + w.z)",
    "orthographic": "(u, v) = (w.x, w.y)",
    "polar": "u = atan2(w.y, w.x) / pi, v = 2 sqrt(1 - w.z) - 1",
}
EVALUATION = (
    "f = max(0, sum over terms of sign * first(place of a) * second(place of b)), per channel; (a, b) = (wi, wo) for"
    " in-out, (h, d) for half-diff; a term without second reads first at both"
)


def write_separable_textures(folder: Path, fitted: Separable) -> list[dict[str, dict[str, str]]]:
    """term_0_first.exr, .png and so on into `folder`; of each term, each texture's files. Raises BadInput."""
    entries = []
    for number, term in enumerate(fitted.terms):
        entry = {}
        for side, texture in zip(("first", "second"), term.textures, strict=False):
            names = {kind: f"term_{number}_{side}.{kind}" for kind in ("exr", "png")}
            comment = f"factor {side} of term {number}, linear; first scanline is row 0, v = -1; see manifest.json"
            write_exr(folder / names["exr"], texture.cpu().numpy(), exr_channel_names(fitted.channels), comment)
            _write_png(folder / names["png"], texture.cpu(), fitted)
            entry[side] = names
        entries.append(entry)
    return entries


def separable_manifest(fitted: Separable, files: Sequence[Mapping[str, Mapping[str, str]]]) -> dict[str, Any]:
    """The JSON-able description, `files` as `write_separable_textures` returns them. Raises BadInput for others."""
    if [len(entry) for entry in files] != [len(term.textures) for term in fitted.terms]:
        raise BadInput(f"manifest: files of {len(files)} terms that are not the fit's, expected {len(fitted.terms)}")
    rows, columns = fitted.read.shape
    kept = ("frame", "directions", "value", "half_difference", "texels")
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "homofact_version": __version__,
        "channels": list(fitted.channels),
        "exr_channels": list(exr_channel_names(fitted.channels)),
        "epsilon": fitted.transform.epsilon,
        "A": {
            "values": fitted.transform.mean.tolist(),
            "unit": "1/sr",
            "meaning": "mean of the training samples, per channel; of the error's log transform, not of the evaluation",
        },
        "bytes": fitted.nbytes,
        "fetches": fitted.fetches,
        "map": fitted.map,
        "parameterization": fitted.parameterization,
        "rows": int(rows),
        "columns": int(columns),
        "read": bits(fitted.read),
        "terms": [
            {"files": {side: dict(names) for side, names in entry.items()}, "signs": term.signs.tolist()}
            for term, entry in zip(fitted.terms, files, strict=True)
        ],
        "seed": fitted.provenance.get("seed"),
        "provenance": fitted.provenance,
        "conventions": {name: CONVENTIONS[name] for name in kept}
        | {
            "map": MAPS[fitted.map],
            "evaluation": EVALUATION,
            "images": "EXR: the factor, linear, first scanline row 0 (v = -1), first pixel column 0 (u = -1); PNG:"
            " its absolute value for the eye, same way round, not for evaluation",
            "read": "one string a row, row 0 first; 1: some direction's bilinear stencil reads the texel",
        },
    }


def _write_png(path: Path, texture: Tensor, fitted: Separable) -> None:
    shown, words = three_channels(texture.abs(), fitted.channels)
    high = float(shown.max())
    grey = (shown / high if high > 0 else shown) ** (1 / 2.2) * 255
    pixels = enlarged_and_hatched(grey.round().to(torch.uint8), fitted.read.cpu())
    text = PngImagePlugin.PngInfo()
    text.add_text(
        "Description",
        f"8 bit = 255 (|g|/high)^(1/2.2), high = {high:.6g}; {words}; row 0 (v = -1) on top, column 0 (u = -1) at the"
        " left; yellow hatching: no direction reads the texel",
    )
    picture = Image.fromarray(pixels)
    replace_file(path, lambda beside: picture.save(beside, format="PNG", pnginfo=text))
