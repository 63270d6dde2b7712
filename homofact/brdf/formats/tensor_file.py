"""Tensor files: named arrays in one file, the format of the RGL material database and of renderers that read it.

    12 bytes   "tensor_file\\0"
    2 bytes    version, 1 and 0
    uint32     number of fields
    then each  uint16 length of the name, name, uint16 rank, uint8 type, uint64 offset in the file,
               uint64 size along each axis

All numbers are little-endian. The numbers of a field start at its offset, with the last axis fastest. homofact writes
the fields in the given order, each at a multiple of 8 bytes.
"""

import math
import os
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np

from homofact.errors import BadInput
from homofact.files.reading import read_bytes

DESCRIPTION = "RGL tensor file (adaptive parameterization, RGB or spectral)"
MAGIC = b"tensor_file\0"
_VERSION = b"\1\0"
_TYPES = dict(enumerate(["u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f2", "f4", "f8"], 1))
# More axes than any field has; a rank is believed no further than this.
_MOST_AXES = 8
_ALIGNED = 8


def read_tensors(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    """Return all fields of a tensor file by name, as read-only views of its bytes.

    Raises BadInput naming file and field for another version, a header that ends early, more fields than fit,
    a name twice or not in UTF-8, an unknown type, and data that do not lie within the file.
    """
    raw = read_bytes(path, DESCRIPTION)
    place = len(MAGIC)
    if not raw.startswith(MAGIC):
        raise BadInput(f"begins with {raw[:12]!r}", where=path, expected=repr(MAGIC))

    def take(form: str, what: str) -> tuple[Any, ...]:
        nonlocal place
        size = struct.calcsize("<" + form)
        if place + size > len(raw):
            raise BadInput(f"the file ends at byte {len(raw)} within {what}", where=path, expected="a whole header")
        place += size
        return struct.unpack_from("<" + form, raw, place - size)

    major, minor = take("2B", "the version")
    if (major, minor) != (1, 0):
        raise BadInput(f"tensor file of version {major}.{minor}", where=path, expected="1.0")
    (count,) = take("I", "the number of fields")
    layouts: dict[str, tuple[str, int, tuple[int, ...]]] = {}
    for number in range(1, count + 1):
        what = f"field {number} of {count}"
        (length,) = take("H", what)
        (word,) = take(f"{length}s", what)
        try:
            name = word.decode()
        except UnicodeDecodeError as error:
            raise BadInput(f"the name of {what} is {word[:20]!r}", where=path, expected="UTF-8") from error
        if name in layouts:
            raise BadInput(f"field {short(name)} is there twice", where=path, expected="once")
        rank, code, offset = take("HBQ", f"field {short(name)}")
        if rank > _MOST_AXES:
            raise BadInput(f"field {short(name)} has {rank} axes", where=path, expected=f"at most {_MOST_AXES}")
        if code not in _TYPES:
            raise BadInput(f"field {short(name)} is of type {code}", where=path, expected=f"1 to {len(_TYPES)}")
        layouts[name] = (_TYPES[code], offset, take(f"{rank}Q", f"field {short(name)}"))
    # Python's integers: no product of sizes overflows.
    ends = [offset + math.prod(shape) * np.dtype(kind).itemsize for kind, offset, shape in layouts.values()]
    fields = {}
    for name, (kind, offset, shape) in layouts.items():
        dtype = np.dtype(kind).newbyteorder("<")
        size, numbers = math.prod(shape) * dtype.itemsize, math.prod(shape)
        if offset < place or offset + size > len(raw):
            cut = f"cut off: {len(raw)} bytes, its header asks for {max(ends)}; " if offset >= place else ""
            raise BadInput(
                f"{cut}field {short(name)} {shape} takes {size} bytes from byte {offset}",
                where=path,
                expected=f"it between the header's end, {place}, and the file's, {len(raw)}",
            )
        if numbers == 0:
            raise BadInput(f"field {short(name)} has shape {shape}", where=path, expected="at least one number")
        fields[name] = np.frombuffer(raw, dtype, numbers, offset).reshape(shape)
    return fields


def tensor_bytes(fields: Mapping[str, np.ndarray]) -> bytes:
    """Return the bytes of a tensor file with integer or float arrays, in the given order."""
    codes = {kind: code for code, kind in _TYPES.items()}
    head = len(MAGIC) + len(_VERSION) + 4 + sum(2 + len(name.encode()) + 11 + 8 * a.ndim for name, a in fields.items())
    described, data, place = [struct.pack("<I", len(fields))], [], head
    for name, array in fields.items():
        kind = array.dtype.str[1:]
        little = np.ascontiguousarray(array, np.dtype(kind).newbyteorder("<"))
        padding = -place % _ALIGNED
        place += padding
        word = name.encode()
        described.append(struct.pack(f"<H{len(word)}sHBQ", len(word), word, array.ndim, codes[kind], place))
        described.append(struct.pack(f"<{array.ndim}Q", *array.shape))
        data += [bytes(padding), little.tobytes()]
        place += little.nbytes
    return b"".join((MAGIC, _VERSION, *described, *data))


def short(name: str) -> str:
    """Return a field's name for a message."""
    return repr(name if len(name) <= 40 else name[:37] + "...")
