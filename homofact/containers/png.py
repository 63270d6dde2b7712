"""PNG textures of 8 or 16 bits: plain numbers, with no gamma, sRGB or colour profile chunk.

A loader that finds none of these chunks and asks for a linear (UNORM, not sRGB) texture gets the stored
integers over 255 or 65535. Pillow cannot write 16-bit RGB, so the files go through pypng.
"""

import os
import struct
import zlib

import numpy as np

from homofact.containers.pixels import whole_shape
from homofact.errors import BadInput
from homofact.files import extras
from homofact.files.atomic import replace_file
from homofact.files.reading import read_bytes

_CHANNELS = (1, 3, 4)
# As many as a square of the largest side of a texture has. A header of more is not unpacked: a thousandth of its bytes
# is enough of a file for it.
MOST_PIXELS = 1 << 28
# What pypng lets through of damaged files beside its own error: AttributeError where the header is missing.
_BROKEN = (zlib.error, struct.error, ValueError, EOFError, AttributeError)


def write_png(path: str | os.PathLike[str], stored: np.ndarray) -> None:
    """Write uint8 or uint16 (rows, columns, C) as grey, RGB or RGBA for C of 1, 3 or 4, row 0 on top.

    Raises BadInput for another type or shape, and an unwritable place.
    """
    whole_shape(path, stored, _CHANNELS)
    if stored.dtype not in (np.uint8, np.uint16):
        raise BadInput(where=path, found=f"values of type {stored.dtype}", expected="uint8 or uint16")
    png = extras.library("png", f"{path}")
    rows, columns, channels = stored.shape
    bits = 8 * stored.dtype.itemsize
    writer = png.Writer(columns, rows, greyscale=channels == 1, alpha=channels == 4, bitdepth=bits, compression=9)
    flat = stored.reshape(rows, columns * channels)

    def write(beside: os.PathLike[str]) -> None:
        with open(beside, "wb") as file:
            writer.write(file, flat)

    replace_file(path, write)


def read_png(path: str | os.PathLike[str]) -> np.ndarray:
    """Read a grey, RGB or RGBA file of 8 or 16 bits as uint8 or uint16 (rows, columns, C), C of 1, 3 or 4.

    Raises BadInput for a file that cannot be read or is no such PNG.
    """
    data = read_bytes(path, "a PNG file")
    png = extras.library("png", f"{path}")
    try:
        reader = png.Reader(bytes=data)
        reader.preamble()
        if reader.width * reader.height > MOST_PIXELS:
            found = f"{reader.width} x {reader.height} pixels"
            raise BadInput(where=path, found=found, expected=f"at most {MOST_PIXELS}")
        columns, rows, lines, facts = reader.read()
        values = [np.asarray(line) for line in lines]
    except BadInput:
        raise
    except (png.Error, *_BROKEN) as error:
        what = f"not a readable PNG ({' '.join(str(error).split())})"
        raise BadInput(what, where=path, expected="a whole one") from error
    bits, channels = facts["bitdepth"], facts["planes"]
    if bits not in (8, 16) or channels not in _CHANNELS or "palette" in facts:
        wanted = "8 or 16 bits in 1, 3 or 4 channels without a palette"
        raise BadInput(where=path, found=f"{bits} bits in {channels} channels", expected=wanted)
    if len(values) != rows:
        raise BadInput(where=path, found=f"{len(values)} rows of pixels", expected=f"the {rows} of the header")
    return np.stack(values).reshape(rows, columns, channels).astype(np.uint8 if bits == 8 else np.uint16)
