"""Archives of arrays (.npz): a strict reader, a writer, and the file format of saved fits.

numpy's own reader trusts the header of a member, and allocates memory accordingly. This reader accepts only the plain
headers that numpy writes. The bytes of an array must equal the unpacked size that the zip's directory states. The size
of the archive limits the total unpacked size. Every size is checked against the file before memory is allocated.

A saved fit is an .npz of plain arrays, one of them a JSON header with format and version. A fit with a verdict has
another array with a JSON record of its provenance and verdict.
"""

import io
import json
import lzma
import math
import os
import re
import struct
import zipfile
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from homofact.errors import BadInput
from homofact.files.atomic import replace_file
from homofact.files.kinds import FACTORIZATION
from homofact.files.private import clean
from homofact.files.reading import parsed_json, read_bytes

_FIT = "the .npz of a fit"
_RECORD = "record"

# Deflate can shrink zeros a thousandfold: more than this beside the file itself is refused.
_SLACK = 64 * 2**20
# More than numpy's header of a plain array takes.
_HEADER_ROOM = 2**16
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
    """Return the names of the archive's .npy members, without .npy. Raises BadInput for a damaged archive."""
    try:
        with zipfile.ZipFile(io.BytesIO(raw)) as archive:
            return [name.removesuffix(".npy") for name in archive.namelist() if name.endswith(".npy")]
    except _DAMAGE as error:
        raise _damaged(path, error, expected) from error


def read_arrays(path: object, raw: bytes, wanted: Iterable[str], expected: str) -> dict[str, np.ndarray]:
    """Return the arrays named in `wanted` from the archive `raw`, without the missing ones.

    `expected` describes the expected archive in messages ("a whole .npz of samples"). Raises BadInput for a damaged
    archive, pickled or structured arrays, and sizes that contradict the file.
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


def read_header(path: object, arrays: dict[str, np.ndarray], expected: str) -> dict[str, Any]:
    """Return the JSON object in the array "header". Raises BadInput if it is missing or different."""
    text = arrays.get("header")
    if text is None or text.shape != () or text.dtype.kind != "U":
        raise BadInput("holds no header", where=path, expected=expected)
    try:
        found = parsed_json(str(text))
    except ValueError as error:
        raise BadInput(f"header is not JSON ({error})", where=path, expected="a JSON object") from error
    if not isinstance(found, dict):
        raise BadInput(f"header is a JSON {type(found).__name__}", where=path, expected="an object")
    return found


def write_arrays(path: str | os.PathLike[str], arrays: dict[str, np.ndarray]) -> None:
    """Write an uncompressed .npz, whole or not at all, piece by piece; the same arrays give the same bytes.

    Raises BadInput where the place cannot be written.
    """

    def write(place: Path) -> None:
        with zipfile.ZipFile(place, "w", zipfile.ZIP_STORED) as archive:
            for name, array in arrays.items():
                # A fixed date and creator, or the same arrays would give another file elsewhere.
                info = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
                info.create_system = 3
                # A member of unknown size could not grow past 2 GB; what it says is put right when it is closed.
                info.file_size = array.nbytes + _HEADER_ROOM
                with archive.open(info, "w") as member:
                    np.lib.format.write_array(member, array, version=(1, 0), allow_pickle=False)

    replace_file(path, write)


def saved_file(place: str | os.PathLike[str], *others: str) -> Path:
    """Return the path of a folder's saved fit, or of its first existing file in `others`, or of the given file.

    A result that a killed run moved aside is restored first. Raises BadInput for a folder without such a file.
    """
    target = Path(place)
    if not target.exists():
        clean(target.absolute().parent)
    if not target.is_dir():
        return target
    for name in (FACTORIZATION, *others):
        if (target / name).is_file():
            return target / name
    raise BadInput(where=target, found=f"no {FACTORIZATION} in the folder", expected="a result of a fit")


def write_archive(path: str | os.PathLike[str], header: dict[str, Any], arrays: dict[str, np.ndarray]) -> None:
    """Write a fit's arrays and JSON-able header. Raises BadInput for an unwritable place."""
    write_arrays(path, arrays | {"header": np.array(json.dumps(header))})


def add_record(path: str | os.PathLike[str], record: dict[str, Any]) -> None:
    """Add a JSON-able record to the file of a saved fit, or replace its record."""
    raw = read_bytes(path, _FIT)
    arrays = read_arrays(path, raw, member_names(path, raw, _FIT), _FIT)
    write_arrays(path, arrays | {_RECORD: np.array(json.dumps(record))})


def read_added_record(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the record that `add_record` put into a file; empty where none can be read."""
    try:
        text = read_arrays(path, read_bytes(path, _FIT), [_RECORD], _FIT).get(_RECORD)
        found = None if text is None or text.shape != () or text.dtype.kind != "U" else parsed_json(str(text))
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def read_archive(path: str | os.PathLike[str]) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Return (arrays, header) of a saved fit of any kind. Raises BadInput for any other file."""
    raw = read_bytes(path, "a saved factorization")
    try:
        arrays = read_arrays(path, raw, member_names(path, raw, _FIT), _FIT)
        return arrays, read_header(path, arrays, _FIT)
    except BadInput as error:
        raise error.moved_to(f"{path}: not a saved factorization") from error


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
    # A copy: torch wants memory that may be written.
    return np.frombuffer(data, dtype=dtype, offset=start).reshape(shape, order=order).copy()


def _damaged(path: object, error: Exception, expected: str) -> BadInput:
    return BadInput(f"a damaged archive ({' '.join(str(error).split())})", where=path, expected=expected)
