"""The label map of a spatially varying material: the number of the source of every texel."""

from pathlib import Path

import numpy as np

from homofact.containers.png import MOST_PIXELS, read_png
from homofact.errors import BadInput
from homofact.factor.layered import MOST_LAYERS
from homofact.files.reading import read_bytes

_EXPECTED = "a label map: a grey PNG of 8 or 16 bits, or whole numbers in .npy"


def read_labels(path: Path, clusters: int) -> np.ndarray:
    """Return the labels (rows, columns) uint8 of a .png or .npy file, whole numbers from 0 to `clusters` − 1.

    Raises BadInput that names the file if it is missing or not a label map, if a label has no cluster, if a cluster has
    no texels, and if there are more clusters than a texture array can have layers.
    """
    if clusters > MOST_LAYERS:
        wanted = f"at most {MOST_LAYERS}, the layers of an array"
        raise BadInput(where=path, found=f"{clusters} clusters", expected=wanted)
    labels = _png(path) if path.suffix.lower() == ".png" else _npy(path)
    low, high = int(labels.min()), int(labels.max())
    if low < 0 or high >= clusters:
        wrong = low if low < 0 else high
        row, column = (int(k[0]) for k in np.nonzero(labels == wrong))
        place = f"in row {row}, column {column}"
        raise BadInput(where=path, found=f"the label {wrong} {place}", expected=f"0 to {clusters - 1}, one a source")
    missing = sorted(set(range(clusters)) - set(np.unique(labels).tolist()))
    if missing:
        found = f"no texel of the label {missing[0]}"
        raise BadInput(where=path, found=found, expected=f"each of the {clusters} sources'")
    return labels.astype(np.uint8)


def _png(path: Path) -> np.ndarray:
    texels = read_png(path)
    if texels.shape[2] != 1:
        raise BadInput(where=path, found=f"{texels.shape[2]} channels", expected=_EXPECTED)
    return texels[..., 0]


def _npy(path: Path) -> np.ndarray:
    read_bytes(path, _EXPECTED)
    try:
        labels = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise BadInput("cannot be read", where=path, expected=_EXPECTED) from error
    if not isinstance(labels, np.ndarray) or labels.ndim != 2 or 0 in labels.shape:
        shape = getattr(labels, "shape", "an archive")
        raise BadInput(where=path, found=f"the shape {shape}", expected="(rows, columns)")
    if labels.size > MOST_PIXELS:
        raise BadInput(where=path, found=f"{labels.size} labels", expected=f"at most {MOST_PIXELS}")
    if labels.dtype.kind not in "iu":
        raise BadInput(where=path, found=f"values of type {labels.dtype}", expected="whole numbers")
    return np.array(labels)
