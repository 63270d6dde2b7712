"""KTX2 files of RGBA16F without supercompression: textures and arrays of one level, cube maps with levels.

The layout follows the Khronos KTX File Format Specification 2.0, all little-endian:

| bytes | what |
|---|---|
| 12 | identifier |
| 36 | vkFormat, typeSize, pixelWidth, pixelHeight, pixelDepth, layerCount, faceCount, levelCount, supercompression |
| 32 | offset and length of the data format descriptor, the key/value data, the (absent) global data |
| 24 a level | level index, largest first: offset, length, uncompressed length |
| 92 | data format descriptor: its total size and one basic block of version 2 with 4 samples |
| … | key/value data sorted by key, each entry padded to 4 bytes |
| … | level by level, smallest first: zeros up to a multiple of 8, then the rows, top one first |

The descriptor (Khronos Data Format Specification, chapter 5) contains what a loader without a table of formats needs.
For each channel these are the bit offset and the length − 1, the channel's number with the float and signed bits, and
−1 and 1 as the lower and upper float. The transfer function is linear and the colour primaries unspecified: a logarithm
is no colour, and a loader must neither decode nor convert it. `pixelDepth` is 0, `faceCount` and `levelCount` 1;
`layerCount` is 0 for a texture, and the number of layers for an array. The layers follow each other. A one-dimensional
texture is a 2D texture of one row. A cube map has 6 faces, in every level +x, −x, +y, −y, +z, −z (laid out as
`rendering.cube` has it), and as many levels as are given, each of half the side of the one before.
"""

import os
import re
import struct
from collections.abc import Mapping, Sequence

import numpy as np

from homofact.containers.pixels import finite_levels, finite_pixels, layer_rows, whole_shape
from homofact.errors import BadInput
from homofact.files.atomic import write_bytes
from homofact.files.reading import read_bytes

IDENTIFIER = b"\xabKTX 20\xbb\r\n\x1a\n"
VK_FORMAT_R16G16B16A16_SFLOAT = 97

# Identifier; 9 header fields; 4 index fields and 2 long ones. And of every level.
_HEADER, _LEVEL = struct.Struct("<12s 9I 4I 2Q"), struct.Struct("<3Q")
_FACES = 6
_MODEL_RGBSDA, _TRANSFER_LINEAR, _PRIMARIES_UNSPECIFIED = 1, 1, 0
_FLOAT, _SIGNED, _ALPHA = 0x80, 0x40, 15
# Keys that begin with KTX are reserved; these two have a meaning for a plain 2D texture.
_RESERVED = {"KTXorientation": re.compile("[rl][du]"), "KTXwriter": re.compile(".+", re.DOTALL)}

# A texel's bytes; the data format descriptor, its total size first: texel blocks of 1 x 1, four samples of 16 bits.
_TEXEL = 8
_DESCRIPTOR = struct.pack("<I 4H", 92, 0, 0, 2, 88) + bytes(
    (_MODEL_RGBSDA, _PRIMARIES_UNSPECIFIED, _TRANSFER_LINEAR, 0, *(0, 0, 0, 0), _TEXEL, *(0, 0, 0, 0, 0, 0, 0))
)
_DESCRIPTOR += b"".join(
    struct.pack("<H 2B 4x 2f", 16 * place, 15, channel | _FLOAT | _SIGNED, -1.0, 1.0)
    for place, channel in enumerate((0, 1, 2, _ALPHA))
)


def write_ktx2(
    path: str | os.PathLike[str], pixels: np.ndarray, key_values: Mapping[str, str] | None = None, layers: int = 1
) -> None:
    """Write floating pixels (rows, columns, 4) as VK_FORMAT_R16G16B16A16_SFLOAT, rounded to float16.

    `pixels` contains the `layers` of a texture array, stacked vertically; 1 means a plain texture. `key_values` become
    the file's key/value data, such as KTXorientation "rd" (row 0 on top) and KTXwriter. Raises BadInput for another
    shape, values not finite in float16, keys that the specification forbids, and an unwritable place.
    """
    whole_shape(path, pixels, (4,))
    stored = finite_pixels(path, pixels, np.float16)
    rows, columns = layer_rows(path, len(pixels), layers), pixels.shape[1]
    _write(path, (columns, rows, 0, _layer_count(layers), 1), [stored.tobytes()], key_values or {})


def write_ktx2_cube(
    path: str | os.PathLike[str], levels: Sequence[np.ndarray], key_values: Mapping[str, str] | None = None
) -> None:
    """Write floating levels (6, N, N, 4), largest first, as a cube map of RGBA16F, rounded to float16.

    Raises BadInput as `write_ktx2`, and if a level does not have half the side of the previous level.
    """
    parts = [part.tobytes() for part in finite_levels(path, levels)]
    side = levels[0].shape[1]
    _write(path, (side, side, 0, 0, _FACES), parts, key_values or {})


def read_ktx2(path: str | os.PathLike[str], layers: int = 1) -> np.ndarray:
    """Return the texels float16 (rows, columns, 4) of a texture that this module wrote.

    The layers of an array of `layers` are stacked vertically. Raises BadInput for a file that cannot be read, is no
    such KTX2, has another number of layers, or is truncated or padded.
    """
    data = read_bytes(path, "a KTX2 texture")
    if data[:12] != IDENTIFIER:
        raise BadInput(f"starts with {data[:12]!r}", where=path, expected=f"a KTX2 texture ({IDENTIFIER!r})")
    begin = _HEADER.size + _LEVEL.size
    if len(data) < begin:
        raise BadInput(f"ends after {len(data)} bytes", where=path, expected=f"a header of {begin}")
    fields = _HEADER.unpack_from(data)
    vk_format, type_size, columns, rows, *plain = fields[1:10]
    d0, dn, k0, kn, g0, gn = fields[10:]
    if vk_format != VK_FORMAT_R16G16B16A16_SFLOAT:
        wanted = f"{VK_FORMAT_R16G16B16A16_SFLOAT} (R16G16B16A16_SFLOAT)"
        raise BadInput(f"vkFormat {vk_format}", where=path, expected=wanted)
    expected = [0, _layer_count(layers), 1, 1, 0]
    if plain != expected or 0 in (rows, columns):
        found = f"{columns} x {rows} texels, depth, layers, faces, levels, supercompression {plain}"
        raise BadInput(found, where=path, expected=f"one plain 2D level {expected}")
    if type_size != 2 or (d0, dn) != (begin, len(_DESCRIPTOR)) or data[d0 : d0 + dn] != _DESCRIPTOR:
        what = f"the data format descriptor is not that of vkFormat {vk_format}"
        raise BadInput(what, where=path, expected=f"it at byte {begin}")
    (place,), after, size = _placed(d0 + dn + kn, [0]), d0 + dn, layers * rows * columns * _TEXEL
    start, length, whole = _LEVEL.unpack_from(data, _HEADER.size)
    if (k0, g0, gn) != (after if kn else 0, 0, 0) or start != place:
        what = f"key/value data at {k0}, texels at {start}"
        raise BadInput(what, where=path, expected="them to follow the descriptor")
    if length != size or whole != size or len(data) != start + size:
        found = f"{max(0, len(data) - start)} bytes of texels for {columns} x {rows}, indexed as {length}"
        raise BadInput(where=path, found=found, expected=size)
    _check_pairs(path, data[after : after + kn])
    return np.frombuffer(data, "<f2", offset=start).reshape(layers * rows, columns, 4).astype(np.float16)


def _write(
    path: str | os.PathLike[str], size: tuple[int, ...], levels: Sequence[bytes], key_values: Mapping[str, str]
) -> None:
    """Of `size` (columns, rows, depth, layers, faces) the levels' texels, largest first."""
    pairs = _packed(path, key_values)
    before = _HEADER.size + _LEVEL.size * len(levels)
    after = before + len(_DESCRIPTOR)
    places, texels = _placed(after + len(pairs), [len(each) for each in levels]), b""
    for k in reversed(range(len(levels))):
        texels += bytes(places[k] - after - len(pairs) - len(texels)) + levels[k]
    index = (before, len(_DESCRIPTOR), after if pairs else 0, len(pairs), 0, 0)
    header = (VK_FORMAT_R16G16B16A16_SFLOAT, 2, *size, len(levels), 0)
    data = _HEADER.pack(IDENTIFIER, *header, *index)
    data += b"".join(_LEVEL.pack(at, len(each), len(each)) for at, each in zip(places, levels, strict=True))
    write_bytes(path, data + _DESCRIPTOR + pairs + texels)


def _placed(start: int, lengths: Sequence[int]) -> list[int]:
    """Where each level begins: the last one first, behind `start`, each at a multiple of a texel's size."""
    places = [0] * len(lengths)
    for k in reversed(range(len(lengths))):
        places[k] = start + -start % _TEXEL
        start = places[k] + lengths[k]
    return places


def _packed(path: str | os.PathLike[str], key_values: Mapping[str, str]) -> bytes:
    """Sorted by the code points of the keys, as the specification asks; values are NUL-terminated UTF-8."""
    packed = b""
    for key, value in sorted(key_values.items()):
        if not key or "\0" in key or "\0" in value:
            raise BadInput(f"key {key!r} with value {value!r}", where=path, expected="text without NUL under a name")
        if key[:3] in ("KTX", "ktx") and (key not in _RESERVED or not _RESERVED[key].fullmatch(value)):
            wanted = "KTXwriter, KTXorientation of r or l with d or u, or a key without KTX in front"
            raise BadInput(f"key {key!r} with value {value!r}", where=path, expected=wanted)
        entry = key.encode() + b"\0" + value.encode() + b"\0"
        packed += struct.pack("<I", len(entry)) + entry + bytes(-len(entry) % 4)
    return packed


def _layer_count(layers: int) -> int:
    """The header's: 0 says that the texture is no array."""
    return layers if layers > 1 else 0


def _check_pairs(path: str | os.PathLike[str], packed: bytes) -> None:
    """Raise BadInput for key/value data that is broken."""
    names: set[str] = set()
    at = 0
    while at < len(packed):
        length = int.from_bytes(packed[at : at + 4], "little")
        key, nul, value = packed[at + 4 : at + 4 + length].partition(b"\0")
        at += 4 + length + -length % 4
        try:
            name, _ = key.decode(), value.decode()
        except UnicodeDecodeError as error:
            raise BadInput(f"key/value data that is not UTF-8 ({key!r})", where=path, expected="text") from error
        if at > len(packed) or not key or not nul or name in names:
            raise BadInput(f"key/value data broken at {key!r}", where=path, expected="different NUL-terminated keys")
        names.add(name)
