"""KTX2 files, not compressed as files: RGBA16F and BC6H textures and arrays, one level; RGBA16F cube maps with levels.

Laid out as the Khronos KTX File Format Specification 2.0 has it, all little-endian:

| bytes | what |
|---|---|
| 12 | identifier |
| 36 | vkFormat, typeSize, pixelWidth, pixelHeight, pixelDepth, layerCount, faceCount, levelCount, supercompression |
| 32 | offset and length of the data format descriptor, the key/value data, the (absent) global data |
| 24 a level | level index, largest first: offset, length, uncompressed length |
| 92 or 44 | data format descriptor: its total size and one basic block of version 2 with 4 samples or 1 |
| … | key/value data sorted by key, each entry padded to 4 bytes |
| … | level by level, smallest first: zeros up to a multiple of lcm(texel block size, 4), then the rows, top one first |

The descriptor (Khronos Data Format Specification, chapter 5) says what a loader without a table of formats needs: per
channel the bit offset and length − 1, the channel's number with the float and signed bits, and as lower and upper the
floats −1 and 1. The transfer function is linear and the colour primaries unspecified: a logarithm is no colour, and a
loader must neither decode nor convert it. `pixelDepth` is 0, `faceCount` and `levelCount` 1; `layerCount` is 0 of a
texture and the number of layers of an array, which follow each other. A one-dimensional texture is a 2D texture of
one row. A cube map has 6 faces, in every level +x, −x, +y, −y, +z, −z (laid out as `rendering.cube` has it), and as
many levels as are given, each of half the side of the one before.
"""

import os
import re
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from homofact.containers.bc6h import decode_bc6h, encode_bc6h
from homofact.containers.pixels import finite_levels, finite_pixels, layer_rows, whole_shape
from homofact.errors import BadInput
from homofact.files.atomic import write_bytes
from homofact.files.reading import read_bytes

IDENTIFIER = b"\xabKTX 20\xbb\r\n\x1a\n"
VK_FORMAT_R16G16B16A16_SFLOAT = 97
VK_FORMAT_BC6H_SFLOAT_BLOCK = 144

# Identifier; 9 header fields; 4 index fields and 2 long ones. And of every level.
_HEADER, _LEVEL = struct.Struct("<12s 9I 4I 2Q"), struct.Struct("<3Q")
_FACES = 6
_MODEL_RGBSDA, _MODEL_BC6H, _TRANSFER_LINEAR, _PRIMARIES_UNSPECIFIED = 1, 133, 1, 0
_FLOAT, _SIGNED, _ALPHA = 0x80, 0x40, 15
# Keys that begin with KTX are reserved; these two have a meaning for a plain 2D texture.
_RESERVED = {"KTXorientation": re.compile("[rl][du]"), "KTXwriter": re.compile(".+", re.DOTALL)}


@dataclass(frozen=True)
class _Layout:
    """What one vkFormat asks of the file: bytes and side of a texel block, the size of a word, the descriptor."""

    vk_format: int
    type_size: int
    block_bytes: int
    block_side: int
    model: int
    # (bit offset, bits, channel) of every sample.
    samples: tuple[tuple[int, int, int], ...]

    def nbytes(self, rows: int, columns: int) -> int:
        """Bytes of the texels: whole blocks."""
        return -(-rows // self.block_side) * -(-columns // self.block_side) * self.block_bytes

    def descriptor(self) -> bytes:
        """The data format descriptor, its total size first."""
        block = 24 + 16 * len(self.samples)
        flags = (self.model, _PRIMARIES_UNSPECIFIED, _TRANSFER_LINEAR, 0)
        dimensions = (self.block_side - 1, self.block_side - 1, 0, 0)
        planes = (self.block_bytes, 0, 0, 0, 0, 0, 0, 0)
        head = struct.pack("<I 4H 4B 4B 8B", 4 + block, 0, 0, 2, block, *flags, *dimensions, *planes)
        return head + b"".join(
            struct.pack("<H 2B 4x 2f", offset, bits - 1, channel | _FLOAT | _SIGNED, -1.0, 1.0)
            for offset, bits, channel in self.samples
        )


_RGBA16F = _Layout(
    VK_FORMAT_R16G16B16A16_SFLOAT, 2, 8, 1, _MODEL_RGBSDA, ((0, 16, 0), (16, 16, 1), (32, 16, 2), (48, 16, _ALPHA))
)
_BC6H = _Layout(VK_FORMAT_BC6H_SFLOAT_BLOCK, 1, 16, 4, _MODEL_BC6H, ((0, 128, 0),))


def write_ktx2(
    path: str | os.PathLike[str], pixels: np.ndarray, key_values: Mapping[str, str] | None = None, layers: int = 1
) -> None:
    """Write floating pixels (rows, columns, 4) as VK_FORMAT_R16G16B16A16_SFLOAT, rounded to float16.

    `layers` of a texture array stand one under another in `pixels`; 1 is a texture. `key_values` become the file's
    key/value data, such as KTXorientation "rd" (row 0 on top) and KTXwriter. Raises BadInput for another shape,
    values not finite in float16, keys that the specification forbids, and an unwritable place.
    """
    whole_shape(path, pixels, (4,))
    stored = finite_pixels(path, pixels, np.float16)
    rows, columns = layer_rows(path, len(pixels), layers), pixels.shape[1]
    _write(path, _RGBA16F, (columns, rows, 0, _layer_count(layers), 1), [stored.tobytes()], key_values or {})


def write_ktx2_cube(
    path: str | os.PathLike[str], levels: Sequence[np.ndarray], key_values: Mapping[str, str] | None = None
) -> None:
    """Write floating levels (6, N, N, 4), largest first, as a cube map of RGBA16F, rounded to float16.

    Raises BadInput as `write_ktx2`, and where levels do not have half the side of the one before.
    """
    parts = [part.tobytes() for part in finite_levels(path, levels)]
    side = levels[0].shape[1]
    _write(path, _RGBA16F, (side, side, 0, 0, _FACES), parts, key_values or {})


def write_ktx2_bc6h(
    path: str | os.PathLike[str], pixels: np.ndarray, key_values: Mapping[str, str] | None = None
) -> None:
    """Write floating pixels (rows, columns, 3) as VK_FORMAT_BC6H_SFLOAT_BLOCK, with the loss that `bc6h` states.

    Raises BadInput as `write_ktx2`, and for sides that are no multiples of 4.
    """
    whole_shape(path, pixels, (3,))
    blocks = encode_bc6h(finite_pixels(path, pixels, np.float16), str(path))
    _write(path, _BC6H, (pixels.shape[1], len(pixels), 0, 0, 1), [blocks], key_values or {})


def read_ktx2(path: str | os.PathLike[str], layers: int = 1) -> np.ndarray:
    """The texels float16 of a file that this module wrote: (rows, columns, 4), or (rows, columns, 3) for BC6H.

    Those of an array of `layers` have them one under another. Raises BadInput for a file that cannot be read, is no
    such KTX2, has another number of layers, or is truncated or padded.
    """
    layout, rows, columns, _, (texels,) = _read(path, layers)
    if layout is _BC6H:
        return decode_bc6h(texels, rows, columns, str(path))
    return np.frombuffer(texels, "<f2").reshape(rows, columns, 4).astype(np.float16)


def read_ktx2_cube(path: str | os.PathLike[str]) -> list[np.ndarray]:
    """The levels (6, N, N, 4) float16, largest first, of a cube map that this module wrote.

    Raises BadInput as `read_ktx2`.
    """
    _, side, _, _, texels = _read(path, faces=_FACES)
    return [
        np.frombuffer(part, "<f2").reshape(_FACES, side >> k, side >> k, 4).astype(np.float16)
        for k, part in enumerate(texels)
    ]


def read_ktx2_key_values(path: str | os.PathLike[str]) -> dict[str, str]:
    """The key/value data of a file that this module wrote. Raises BadInput as `read_ktx2`."""
    return _read(path)[3]


def _write(
    path: str | os.PathLike[str],
    layout: _Layout,
    size: tuple[int, int, int, int, int],
    levels: Sequence[bytes],
    key_values: Mapping[str, str],
) -> None:
    """Of `size` (columns, rows, depth, layers, faces) the levels' texels, largest first."""
    descriptor = layout.descriptor()
    pairs = _packed(path, key_values)
    before = _HEADER.size + _LEVEL.size * len(levels)
    places, texels = _placed(layout, before + len(descriptor) + len(pairs), [len(each) for each in levels]), b""
    for k in reversed(range(len(levels))):
        padding = places[k] - before - len(descriptor) - len(pairs) - len(texels)
        texels += bytes(padding) + levels[k]
    index = (before, len(descriptor), before + len(descriptor) if pairs else 0, len(pairs), 0, 0)
    header = (layout.vk_format, layout.type_size, *size, len(levels), 0)
    data = _HEADER.pack(IDENTIFIER, *header, *index)
    data += b"".join(_LEVEL.pack(at, len(each), len(each)) for at, each in zip(places, levels, strict=True))
    write_bytes(path, data + descriptor + pairs + texels)


def _placed(layout: _Layout, start: int, lengths: Sequence[int]) -> list[int]:
    """Where each level begins: the last one first, behind `start`, each at a multiple of the block's size."""
    places = [0] * len(lengths)
    for k in reversed(range(len(lengths))):
        # Both block sizes are multiples of 4 already.
        places[k] = start + -start % layout.block_bytes
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


def _read(
    path: str | os.PathLike[str], layers: int = 1, faces: int = 1
) -> tuple[_Layout, int, int, dict[str, str], list[bytes]]:
    data = read_bytes(path, "a KTX2 texture")
    if data[:12] != IDENTIFIER:
        raise BadInput(f"starts with {data[:12]!r}", where=path, expected=f"a KTX2 texture ({IDENTIFIER!r})")
    if len(data) < _HEADER.size + _LEVEL.size:
        wanted = _HEADER.size + _LEVEL.size
        raise BadInput(f"ends after {len(data)} bytes", where=path, expected=f"a header of {wanted}")
    fields = _HEADER.unpack_from(data)
    vk_format, type_size, columns, rows, *plain = fields[1:10]
    d0, dn, k0, kn, g0, gn = fields[10:]
    layout = {each.vk_format: each for each in (_RGBA16F, _BC6H)}.get(vk_format)
    if layout is None:
        wanted = f"{_RGBA16F.vk_format} (R16G16B16A16_SFLOAT) or {_BC6H.vk_format} (BC6H_SFLOAT_BLOCK)"
        raise BadInput(f"vkFormat {vk_format}", where=path, expected=wanted)
    count = plain[3] if faces > 1 else 1
    expected = [0, _layer_count(layers), faces, count, 0]
    square = layout is _RGBA16F and rows == columns and 1 <= count <= columns.bit_length()
    if plain != expected or 0 in (rows, columns) or (faces > 1 and not square):
        found = f"{columns} x {rows} texels, depth, layers, faces, levels, supercompression {plain}"
        kind = "one plain 2D level" if faces == 1 else "a square cube map of halves and its levels"
        raise BadInput(found, where=path, expected=f"{kind} {expected}")
    before, descriptor = _HEADER.size + _LEVEL.size * count, layout.descriptor()
    if type_size != layout.type_size or (d0, dn) != (before, len(descriptor)) or data[d0 : d0 + dn] != descriptor:
        what = f"the data format descriptor is not that of vkFormat {vk_format}"
        raise BadInput(what, where=path, expected=f"it at byte {before}")
    after = d0 + dn
    sizes = [layers * faces * layout.nbytes(rows >> k, columns >> k) for k in range(count)]
    places = _placed(layout, after + kn, sizes)
    index = [_LEVEL.unpack_from(data, _HEADER.size + _LEVEL.size * k) for k in range(count)]
    if (k0, g0, gn) != (after if kn else 0, 0, 0) or [each[0] for each in index] != places:
        at = ", ".join(str(each[0]) for each in index)
        raise BadInput(f"key/value data at {k0}, texels at {at}", where=path, expected="them to follow the descriptor")
    for size, (start, length, whole) in zip(sizes, index, strict=True):
        if length != size or whole != size or (start == places[0] and len(data) != start + size):
            found = f"{max(0, len(data) - start)} bytes of texels for {columns} x {rows}, indexed as {length}"
            raise BadInput(where=path, found=found, expected=size)
    texels = [data[start : start + size] for start, size in zip(places, sizes, strict=True)]
    return layout, layers * rows, columns, _unpacked(path, data[after : after + kn]), texels


def _unpacked(path: str | os.PathLike[str], packed: bytes) -> dict[str, str]:
    found: dict[str, str] = {}
    at = 0
    while at < len(packed):
        length = int.from_bytes(packed[at : at + 4], "little")
        entry = packed[at + 4 : at + 4 + length]
        at += 4 + length + -length % 4
        key, nul, value = entry.partition(b"\0")
        try:
            name, text = key.decode(), value.removesuffix(b"\0").decode()
        except UnicodeDecodeError as error:
            raise BadInput(f"key/value data that is not UTF-8 ({key!r})", where=path, expected="text") from error
        if at > len(packed) or not key or not nul or name in found:
            raise BadInput(f"key/value data broken at {key!r}", where=path, expected="different NUL-terminated keys")
        found[name] = text
    return found
