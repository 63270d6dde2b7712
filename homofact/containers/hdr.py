"""Reader of Radiance pictures (.hdr, RGBE): four bytes per pixel, three mantissas and a common exponent.

Layout (Ward 1991, "Real Pixels", Graphics Gems II; the Radiance file formats note): `#?RADIANCE` or
`#?RGBE`, header lines `NAME=value`, an empty line, the size `-Y rows +X columns`, then scanlines from
the top. A scanline is

* new run lengths, for 8 to 32767 columns: bytes 2, 2, columns ≫ 8, columns & 255, then each of the four
  components by itself, a count above 128 repeating the next byte count − 128 times, any other count
  followed by as many bytes;
* or flat pixels, among which (1, 1, 1, n) repeats the pixel before it n times (the old run lengths;
  repeats in a row shift n by 8 more bits each).

A pixel is mantissa · 2^(e − 136), 0 where e = 0, divided by the product of the EXPOSURE lines.

The reader compares the header with the number of bytes before it allocates memory; `web/hdr.js` has the same limits.
"""

import re

import numpy as np

from homofact.errors import BadInput
from homofact.files.text import short

# A damaged size must not ask for all the memory there is: beyond so many pixels each byte has to stand for no more than
# run lengths can say, 127 pixels in 8 bytes.
_MOST_PIXELS, _FREE_PIXELS, _PIXELS_A_BYTE = 1 << 27, 1 << 22, 16
_SIZE = re.compile(rb"-Y {1,9}(\d{1,9}) {1,9}\+X {1,9}(\d{1,9})\s{0,9}")
# Bits that a repeat's count is shifted by: more would repeat a pixel more often than there are pixels.
_MOST_SHIFT = 24


def decode_hdr(data: bytes, name: str) -> np.ndarray:
    """Return linear radiance (rows, columns, 3) float64, row 0 on top, of a file's bytes; `name` is for messages.

    Raises BadInput for bytes that are no Radiance picture, another colour format (XYZE) or orientation,
    truncated or left-over scanline data, and run lengths that leave their scanline.
    """
    rows, columns, exposure, at = _header(data, name)
    most = min(_MOST_PIXELS, max(_FREE_PIXELS, _PIXELS_A_BYTE * (len(data) - at)))
    if rows * columns > most:
        found = f"the picture is {rows} x {columns} in {len(data) - at} bytes"
        raise BadInput(found, where=name, expected=f"at most {most} pixels")
    pixels = np.empty((rows, columns, 4), np.uint8)
    for row in range(rows):
        marker = data[at : at + 4]
        if marker == bytes((2, 2, columns >> 8, columns & 255)) and 8 <= columns < 32768:
            at = _new_runs(data, at + 4, pixels[row], name, row)
        else:
            at = _flat(data, at, pixels[row:], name)
            break
    if at != len(data):
        raise BadInput(f"{len(data) - at} bytes after the last scanline", where=name, expected="the end of file")
    exponent = pixels[..., 3].astype(np.int32)
    # What the exposure takes beyond any number is infinite or none, which no light is.
    with np.errstate(over="ignore", invalid="ignore"):
        scale = np.where(exponent > 0, np.ldexp(1.0, exponent - 136), 0.0) / exposure
        return pixels[..., :3] * scale[..., None]


def _header(data: bytes, name: str) -> tuple[int, int, float, int]:
    """(rows, columns, exposure, offset of the first scanline)."""
    if not data.startswith((b"#?RADIANCE", b"#?RGBE")):
        raise BadInput(f"starts with {data[:10]!r}", where=name, expected="#?RADIANCE")
    end = data.find(b"\n\n")
    size_end = data.find(b"\n", end + 2)
    if end < 0 or size_end < 0:
        raise BadInput("the header has no end", where=name, expected="an empty line and the picture's size")
    exposure = 1.0
    for line in data[:end].split(b"\n")[1:]:
        key, _, value = line.partition(b"=")
        if key == b"FORMAT" and value.strip() != b"32-bit_rle_rgbe":
            raise BadInput(f"FORMAT is {_said(value)}", where=name, expected="32-bit_rle_rgbe")
        if key == b"EXPOSURE":
            exposure = _exposure(exposure, value, name)
    size = _SIZE.fullmatch(data[end + 2 : size_end])
    if size is None:
        raise BadInput(f"size line is {_said(data[end + 2 : size_end])}", where=name, expected="'-Y rows +X columns'")
    rows, columns = int(size[1]), int(size[2])
    if rows < 1 or columns < 1:
        raise BadInput(f"the picture is {rows} x {columns}", where=name, expected="at least one pixel")
    return rows, columns, exposure, size_end + 1


def _exposure(before: float, value: bytes, name: str) -> float:
    """The product of the EXPOSURE lines up to this one."""
    try:
        exposure = before * float(value)
    except ValueError:
        exposure = float("nan")
    if not 0 < exposure < float("inf"):
        raise BadInput(f"EXPOSURE is {_said(value)}", where=name, expected="above 0")
    return exposure


def _said(value: bytes) -> str:
    """What a header says, in quotes and cut where it is long."""
    return short(value.strip().decode(errors="replace"))


def _new_runs(data: bytes, at: int, scanline: np.ndarray, name: str, row: int) -> int:
    """Fill one scanline (columns, 4) from offset `at`; the offset after it."""
    columns = scanline.shape[0]
    for component in range(4):
        line, filled = bytearray(columns), 0
        while filled < columns:
            if at >= len(data):
                raise BadInput(f"ends within scanline {row}", where=name, expected=f"{columns} pixels: truncated")
            count, at = data[at], at + 1
            run = count > 128
            count = count - 128 if run else count
            piece = data[at : at + 1] * count if run else data[at : at + count]
            if count == 0 or filled + count > columns:
                found = f"a run of {count} in scanline {row} at pixel {filled}"
                raise BadInput(found, where=name, expected=f"at least 1 and to end by {columns}")
            if len(piece) != count:
                raise BadInput(f"ends within scanline {row}", where=name, expected=f"{columns} pixels: truncated")
            line[filled : filled + count] = piece
            filled, at = filled + count, at + (1 if run else count)
        scanline[:, component] = np.frombuffer(bytes(line), np.uint8)
    return at


def _flat(data: bytes, at: int, scanlines: np.ndarray, name: str) -> int:
    """Fill all remaining scanlines (rows, columns, 4) with flat or old-run pixels; the offset after them."""
    total = scanlines.shape[0] * scanlines.shape[1]
    stored = np.frombuffer(data, np.uint8, (len(data) - at) // 4 * 4, at).reshape(-1, 4)
    repeats = (stored[:, :3] == 1).all(1)
    if not repeats[:total].any():
        if len(stored) < total:
            raise BadInput(f"{len(stored)} flat pixels left", where=name, expected=f"{total}: truncated")
        scanlines[...] = stored[:total].reshape(scanlines.shape)
        return at + 4 * total
    out, filled, k, shift = np.empty((total, 4), np.uint8), 0, 0, 0
    while filled < total:
        if k >= len(stored):
            raise BadInput(f"{filled} of {total} pixels are there", where=name, expected="all: truncated")
        if repeats[k]:
            if shift > _MOST_SHIFT:
                raise BadInput(f"repeats without end at pixel {filled}", where=name, expected=f"{total} pixels")
            count = int(stored[k, 3]) << shift
            if filled == 0 or filled + count > total:
                raise BadInput(f"pixel {filled} repeated {count} times", where=name, expected=f"{total} pixels")
            out[filled : filled + count] = out[filled - 1]
            filled, shift = filled + count, shift + 8
        else:
            out[filled] = stored[k]
            filled, shift = filled + 1, 0
        k += 1
    scanlines[...] = out.reshape(scanlines.shape)
    return at + 4 * k
