"""Checks for all containers: the shape of pixels, and that their stored values are finite."""

import os
from collections.abc import Sequence

import numpy as np

from homofact.errors import BadInput


def whole_shape(path: str | os.PathLike[str], pixels: np.ndarray, channels: tuple[int, ...]) -> None:
    """Raise BadInput unless pixels have the shape (rows, columns, C), are not empty, and C is in `channels`."""
    if pixels.ndim != 3 or pixels.shape[2] not in channels or 0 in pixels.shape:
        wanted = " or ".join(map(str, channels))
        found = f"pixels of shape {pixels.shape}"
        raise BadInput(where=path, found=found, expected=f"(rows, columns, {wanted}), not empty")


def finite_pixels(path: str | os.PathLike[str], pixels: np.ndarray, dtype: type[np.floating]) -> np.ndarray:
    """Return floating pixels (rows, columns, C) rounded to `dtype`, contiguous and little-endian.

    Raises BadInput where they are not floating-point numbers, and where one is not finite in that type:
    float16 ends at 65504.
    """
    if not np.issubdtype(pixels.dtype, np.floating):
        raise BadInput(where=path, found=f"pixels of type {pixels.dtype}", expected="floating-point numbers")
    with np.errstate(over="ignore", under="ignore"):
        stored = np.ascontiguousarray(pixels, np.dtype(dtype).newbyteorder("<"))
    bad = np.argwhere(~np.isfinite(stored))
    if len(bad):
        row, column, channel = (int(place) for place in bad[0])
        most = float(np.finfo(dtype).max)
        where = f"row {row}, column {column}, channel {channel} is {pixels[row, column, channel]:g}"
        raise BadInput(where, where=path, expected=f"finite values of at most {most:g} ({np.dtype(dtype).name})")
    return stored


def layer_rows(path: str | os.PathLike[str], rows: int, layers: int) -> int:
    """Return the rows per layer of stacked `layers`. Raises BadInput if `rows` is not a multiple of `layers`."""
    if layers < 1 or rows % layers:
        raise BadInput(where=path, found=f"{rows} rows", expected=f"as many in each of {layers} layers")
    return rows // layers


def finite_levels(path: str | os.PathLike[str], levels: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return levels (6, N, N, 4) of a cube map, largest first, as float16.

    Raises BadInput as `finite_pixels`, and if a level does not consist of six squares, or does not have half the side
    of the previous level.
    """
    if not levels:
        raise BadInput(where=path, found="no levels of a cube map", expected="at least one")
    found = []
    for k, level in enumerate(levels):
        side = levels[0].shape[1] >> k if levels[0].ndim == 4 else 0
        if level.shape != (6, side, side, 4) or not side:
            wanted = "(6, N, N, 4), N half of that of the level before"
            raise BadInput(where=path, found=f"level {k} of shape {level.shape}", expected=wanted)
        stored = finite_pixels(path, level.reshape(6 * side, side, 4), np.float16)
        found.append(stored.reshape(6, side, side, 4))
    return found
