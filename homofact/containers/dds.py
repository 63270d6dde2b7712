"""DDS files with the DX10 header: RGBA16F and BC6H textures and texture arrays, one 2D level; RGBA16F cube maps.

The layout follows Microsoft's "Programming Guide for DDS", all little-endian: the magic "DDS ", DDS_HEADER (124 bytes,
of which DDS_PIXELFORMAT 32), DDS_HEADER_DXT10 (20 bytes), then the rows without padding, top row first. The layers of
an array follow each other, and height and pitch are those of one layer. The format is the DXGI_FORMAT of the DX10
header, which the four-character code DX10 announces. Its miscFlags2 stays 0, since D3DX refuses any alpha mode; the
alpha of a texture here is no transparency. A cube map has its faces +x, −x, +y, −y, +z, −z one after another, each with
all its levels, largest first.
"""

import os
import struct
from collections.abc import Sequence

import numpy as np

from homofact.containers.bc6h import decode_bc6h, encode_bc6h
from homofact.containers.pixels import finite_levels, finite_pixels, layer_rows, whole_shape
from homofact.errors import BadInput
from homofact.files.atomic import write_bytes
from homofact.files.reading import read_bytes

DXGI_FORMAT_R16G16B16A16_FLOAT = 10
DXGI_FORMAT_BC6H_SF16 = 96

# DDSD_CAPS, HEIGHT, WIDTH and PIXELFORMAT, which every file needs; DDSD_MIPMAPCOUNT only where there are mipmaps.
_FLAGS = 0x1 | 0x2 | 0x4 | 0x1000
_PITCH, _LINEAR_SIZE = 0x8, 0x80000
_DDPF_FOURCC, _DDSCAPS_TEXTURE, _TEXTURE_2D = 0x4, 0x1000, 3
# Of a cube map: DDSD_MIPMAPCOUNT; DDSCAPS_COMPLEX and MIPMAP; DDSCAPS2_CUBEMAP with all faces; the DX10 header's flag.
_MIPMAP_COUNT, _COMPLEX, _CUBE, _TEXTURECUBE, _FACES = 0x20000, 0x8 | 0x400000, 0x200 | 0xFC00, 0x4, 6
# Magic; size, flags, height, width, pitch, depth, mipmaps, 11 reserved; pixel format: size, flags, code, bits and
# 4 masks; 4 caps, 1 reserved; DX10: format, dimension, flags, array size, flags 2.
_HEADER = struct.Struct("<4s 7I 44x 2I 4s 20x 5I 5I")


def write_dds(path: str | os.PathLike[str], pixels: np.ndarray, layers: int = 1) -> None:
    """Write floating pixels (rows, columns, 4) as DXGI_FORMAT_R16G16B16A16_FLOAT, rounded to float16.

    `pixels` contains the `layers` of a texture array, stacked vertically; 1 means a plain texture. Raises BadInput for
    another shape, values not finite in float16, and an unwritable place.
    """
    whole_shape(path, pixels, (4,))
    stored = finite_pixels(path, pixels, np.float16)
    rows, columns = layer_rows(path, len(stored), layers), stored.shape[1]
    header = _header(rows, columns, layers, _PITCH, columns * 8, DXGI_FORMAT_R16G16B16A16_FLOAT)
    write_bytes(path, header + stored.tobytes())


def write_dds_bc6h(path: str | os.PathLike[str], pixels: np.ndarray, layers: int = 1) -> None:
    """Write floating pixels (rows, columns, 3) as DXGI_FORMAT_BC6H_SF16 blocks, with the loss that `bc6h` states.

    `layers` as `write_dds`. Raises BadInput for another shape, sides of a layer that are no multiples of 4, values
    not finite in float16, and an unwritable place.
    """
    whole_shape(path, pixels, (3,))
    rows, columns = layer_rows(path, len(pixels), layers), pixels.shape[1]
    parts = finite_pixels(path, pixels, np.float16).reshape(layers, rows, columns, 3)
    blocks = [encode_bc6h(part, str(path)) for part in parts]
    header = _header(rows, columns, layers, _LINEAR_SIZE, len(blocks[0]), DXGI_FORMAT_BC6H_SF16)
    write_bytes(path, header + b"".join(blocks))


def write_dds_cube(path: str | os.PathLike[str], levels: Sequence[np.ndarray]) -> None:
    """Write floating levels (6, N, N, 4), largest first, as a cube map of DXGI_FORMAT_R16G16B16A16_FLOAT.

    Raises BadInput as `write_dds`, and if a level does not have half the side of the previous level.
    """
    parts = finite_levels(path, levels)
    texels = b"".join(part[face].tobytes() for face in range(_FACES) for part in parts)
    side = parts[0].shape[1]
    header = _header(side, side, 1, _PITCH, side * 8, DXGI_FORMAT_R16G16B16A16_FLOAT, len(parts))
    write_bytes(path, header + texels)


def read_dds(path: str | os.PathLike[str], layers: int = 1) -> np.ndarray:
    """Return the texels float16 of a file that this module wrote: (rows, columns, 4), or (rows, columns, 3) for BC6H.

    The layers of an array of `layers` are stacked vertically. Raises BadInput for a file that cannot be read, is no
    such DDS, has another number of layers, or is truncated or padded.
    """
    data = read_bytes(path, "a DDS texture")
    if data[:4] != b"DDS ":
        raise BadInput(f"starts with {data[:4]!r}", where=path, expected="a DDS texture (b'DDS ')")
    if len(data) < _HEADER.size:
        raise BadInput(f"ends after {len(data)} bytes", where=path, expected=f"a header of {_HEADER.size}")
    fields = _HEADER.unpack_from(data)
    rows, columns, code, dxgi = fields[3], fields[4], fields[10], fields[16]
    if code != b"DX10":
        raise BadInput(f"four-character code {code!r}", where=path, expected="b'DX10'")
    if dxgi not in (DXGI_FORMAT_R16G16B16A16_FLOAT, DXGI_FORMAT_BC6H_SF16):
        wanted = f"{DXGI_FORMAT_R16G16B16A16_FLOAT} (R16G16B16A16_FLOAT) or {DXGI_FORMAT_BC6H_SF16} (BC6H_SF16)"
        raise BadInput(f"DXGI format {dxgi}", where=path, expected=wanted)
    blocks = dxgi == DXGI_FORMAT_BC6H_SF16
    size = -(-rows // 4) * -(-columns // 4) * 16 if blocks else rows * columns * 8
    kind, pitch = (_LINEAR_SIZE, size) if blocks else (_PITCH, columns * 8)
    size *= layers
    found = f"{len(data) - _HEADER.size} bytes of texels for {columns} x {rows}"
    wrong_size = BadInput(where=path, found=found, expected=size)
    if len(data) < _HEADER.size + size:
        raise wrong_size
    if 0 in (rows, columns) or data[: _HEADER.size] != _header(rows, columns, layers, kind, pitch, dxgi):
        what = f"a header of {columns} x {rows} texels that is not of one plain 2D level"
        wanted = "a texture without mipmaps, layers" if layers == 1 else f"{layers} layers without mipmaps"
        raise BadInput(where=path, found=what, expected=f"{wanted} or faces")
    if len(data) != _HEADER.size + size:
        raise wrong_size
    if blocks:
        return decode_bc6h(data[_HEADER.size :], layers * rows, columns, str(path))
    return np.frombuffer(data, "<f2", offset=_HEADER.size).reshape(layers * rows, columns, 4).astype(np.float16)


def _header(rows: int, columns: int, layers: int, pitch_kind: int, pitch: int, dxgi: int, levels: int = 0) -> bytes:
    """Of textures of one level, or of a cube map with so many levels."""
    more, caps, cube, flag = (_MIPMAP_COUNT, _COMPLEX, _CUBE, _TEXTURECUBE) if levels else (0, 0, 0, 0)
    surface = (124, _FLAGS | pitch_kind | more, rows, columns, pitch, 0, levels or 1)
    pixel_format = (32, _DDPF_FOURCC, b"DX10")
    last = (dxgi, _TEXTURE_2D, flag, layers, 0)
    return _HEADER.pack(b"DDS ", *surface, *pixel_format, _DDSCAPS_TEXTURE | caps, cube, 0, 0, 0, *last)
