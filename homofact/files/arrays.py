"""Arrays out of a zip of .npy members, every size checked against the file before anything is allocated.

numpy's own reader believes a member's header and allocates what it says. Here the header must be the plain
form that numpy writes, its shape must fill exactly what the zip's directory says the member unpacks to, and
what is unpacked is bounded by the archive's own size.
"""

import io
import lzma
import math
import re
import struct
import zipfile
import zlib
from collections.abc import Iterable

import numpy as np

from homofact.errors import BadInput

# Deflate can shrink zeros a thousandfold: more than this beside the file itself is refused.
_SLACK = 64 * 2**20
_HEADER = re.compile(
    rb"\{'descr': '([<>|=]?[bifuUS]\d+)', 'fortran_order': (True|False), 'shape': \(((?:\d+, ?)*\d*)\), \} *\n"
)
_DAMAGE = (
    OSError,
    ValueError,
    EOFError,
    KeyError,
    IndexError,
    RuntimeError,
    OverflowError,
    struct.error,
    zlib.error,
    lzma.LZMAError,
    zipfile.BadZipFile,
)


def member_names(path: object, raw: bytes, expected: str) -> list[str]:
    """Names of the archive's .npy members without their ending, in its order. Raises BadInput where damaged."""
    try:
        with zipfile.ZipFile(io.BytesIO(raw)) as archive:
            return [name.removesuffix(".npy") for name in archive.namelist() if name.endswith(".npy")]
    except _DAMAGE as error:
        raise _damaged(path, error, expected) from error


def read_arrays(path: object, raw: bytes, wanted: Iterable[str], expected: str) -> dict[str, np.ndarray]:
    """The arrays called `wanted` that the archive `raw` holds; one that it lacks is left out.

    `expected` says what the archive should have been ("a whole .npz of samples"). Raises BadInput for a
    damaged archive, pickled or structured arrays, and sizes that the file cannot bear out.
    """
    allowance = 3 * len(raw) + _SLACK
    found: dict[str, np.ndarray] = {}
    try:
        with zipfile.ZipFile(io.BytesIO(raw)) as archive:
            names = set(archive.namelist())
            for name in wanted:
                if f"{name}.npy" not in names:
                    continue
                info = archive.getinfo(f"{name}.npy")
                if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) or info.flag_bits & 1:
                    raise ValueError(f"{name} is encrypted or packed in an unusual way")
                allowance -= info.file_size
                if allowance < 0:
                    raise ValueError(f"{name} unpacks to {info.file_size} bytes, too many for a file of {len(raw)}")
                found[name] = _array(name, archive.read(info))
    except _DAMAGE as error:
        raise _damaged(path, error, expected) from error
    return found


def _array(name: str, data: bytes) -> np.ndarray:
    version, width = data[6:7], 2 if data[6:7] == b"\1" else 4
    if not data.startswith(b"\x93NUMPY") or version not in (b"\1", b"\2", b"\3") or len(data) < 8 + width:
        raise ValueError(f"{name} is no numpy array")
    start = 8 + width + int.from_bytes(data[8 : 8 + width], "little")
    header = _HEADER.fullmatch(data[8 + width : min(start, 4096)])
    if header is None:
        raise ValueError(f"{name} is no plain array")
    dtype = np.dtype(header[1].decode())
    shape = tuple(int(word) for word in header[3].decode().split(",") if word.strip())
    if math.prod(shape) * dtype.itemsize != len(data) - start:
        raise ValueError(f"{name} has {len(data) - start} bytes, expected {shape} of {dtype}")
    order = "F" if header[2] == b"True" else "C"
    if dtype.kind == "U":
        # A code point above Unicode's end would make every later use of the string raise.
        points = np.frombuffer(data, dtype=dtype.str[0] + "u4", offset=start)
        if points.size and int(points.max()) > 0x10FFFF:
            raise ValueError(f"{name} holds what is no text")
    if dtype.itemsize == 0:
        return np.empty(shape, dtype)
    return np.frombuffer(data, dtype=dtype, offset=start).reshape(shape, order=order)


def _damaged(path: object, error: Exception, expected: str) -> BadInput:
    return BadInput(f"{path}: a damaged archive ({' '.join(str(error).split())}), expected {expected}")
