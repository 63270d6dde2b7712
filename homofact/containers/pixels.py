"""What every container shares: the check that pixels are whole and finite as stored."""

import os

import numpy as np

from homofact.errors import BadInput


def whole_shape(path: str | os.PathLike[str], pixels: np.ndarray, channels: tuple[int, ...]) -> None:
    """Raise BadInput unless pixels are (rows, columns, C), none of it empty, with C one of `channels`."""
    if pixels.ndim != 3 or pixels.shape[2] not in channels or 0 in pixels.shape:
        wanted = " or ".join(map(str, channels))
        raise BadInput(f"{path}: found pixels of shape {pixels.shape}, expected (rows, columns, {wanted}), not empty")


def finite_pixels(path: str | os.PathLike[str], pixels: np.ndarray, dtype: type[np.floating]) -> np.ndarray:
    """Floating pixels (rows, columns, C) rounded to `dtype`, contiguous and little-endian.

    Raises BadInput where they are not floating-point numbers, and where one is not finite in that type:
    float16 ends at 65504.
    """
    if not np.issubdtype(pixels.dtype, np.floating):
        raise BadInput(f"{path}: found pixels of type {pixels.dtype}, expected floating-point numbers")
    with np.errstate(over="ignore", under="ignore"):
        stored = np.ascontiguousarray(pixels, np.dtype(dtype).newbyteorder("<"))
    bad = np.argwhere(~np.isfinite(stored))
    if len(bad):
        row, column, channel = (int(place) for place in bad[0])
        most = float(np.finfo(dtype).max)
        where = f"row {row}, column {column}, channel {channel} is {pixels[row, column, channel]:g}"
        raise BadInput(f"{path}: {where}, expected finite values of at most {most:g} ({np.dtype(dtype).name})")
    return stored


def layer_rows(path: str | os.PathLike[str], rows: int, layers: int) -> int:
    """Rows of each of `layers` that stand one under another. Raises BadInput where they are not alike."""
    if layers < 1 or rows % layers:
        raise BadInput(f"{path}: found {rows} rows, expected as many in each of {layers} layers")
    return rows // layers
