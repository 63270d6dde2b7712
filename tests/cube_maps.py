"""Readers of the cube maps that exports write, for their tests: halves, levels largest first."""

import base64
import re
import struct
from pathlib import Path

import numpy as np


def read_ktx2_cube(path: Path) -> list[np.ndarray]:
    """The levels (6, N, N, 4) float16 of a KTX2 cube map of RGBA16F."""
    data = path.read_bytes()
    vk_format, _, side, rows, depth, layers, faces, count, packed = struct.unpack_from("<9I", data, 12)
    assert (vk_format, rows, depth, layers, faces, packed) == (97, side, 0, 0, 6, 0)
    starts = [struct.unpack_from("<Q", data, 80 + 24 * k)[0] for k in range(count)]
    return [_level(data, start, side >> k) for k, start in enumerate(starts)]


def read_dds_cube(path: Path) -> list[np.ndarray]:
    """The levels (6, N, N, 4) float16 of a DDS cube map of R16G16B16A16_FLOAT, whose faces have their own levels."""
    data = path.read_bytes()
    (side,), (count,) = struct.unpack_from("<I", data, 12), struct.unpack_from("<I", data, 28)
    assert struct.unpack_from("<5I", data, 128) == (10, 3, 4, 1, 0)
    sides = [side >> k for k in range(count)]
    sizes = [own * own * 8 for own in sides]
    assert len(data) == 148 + 6 * sum(sizes)
    at = [148 + sum(sizes[:k]) for k in range(count)]
    faces = [[data[at[k] + f * sum(sizes) :][: sizes[k]] for f in range(6)] for k in range(count)]
    return [_level(b"".join(each), 0, own) for each, own in zip(faces, sides, strict=True)]


def _level(data: bytes, start: int, side: int) -> np.ndarray:
    values = np.frombuffer(data, "<f2", 24 * side * side, start)
    return values.reshape(6, side, side, 4).astype(np.float16)


def ktx2_key_values(path: Path) -> dict[str, str]:
    """The key/value data of a KTX2."""
    data = path.read_bytes()
    at, length = struct.unpack_from("<2I", data, 56)
    found, end = {}, at + length
    while at < end:
        (size,) = struct.unpack_from("<I", data, at)
        key, _, value = data[at + 4 : at + 4 + size].partition(b"\0")
        found[key.decode()] = value.removesuffix(b"\0").decode()
        at += 4 + size + -size % 4
    return found


def read_godot_cubemap(text: str) -> list[np.ndarray]:
    """The levels (6, N, N, 4) float16 of a Cubemap of Godot, all down to one texel where it has mipmaps."""
    assert text.startswith('[gd_resource type="Cubemap" load_steps=7 format=4]\n')
    assert text.endswith("[resource]\n_images = [" + ", ".join(f'SubResource("{k}")' for k in range(6)) + "]\n")
    image = re.compile(
        r'\[sub_resource type="Image" id="(\d)"\]\ndata = \{\n"data": PackedByteArray\("([^"]*)"\),\n'
        r'"format": "RGBAHalf",\n"height": (\d+),\n"mipmaps": (true|false),\n"width": (\d+)\n\}\n'
    )
    images = image.findall(text)
    assert [face for face, *_ in images] == list("012345")
    levels: list[list[np.ndarray]] = []
    for _, texels, rows, mipmaps, columns in images:
        assert rows == columns
        data, side, faces = base64.b64decode(texels, validate=True), int(rows), []
        while side:
            faces.append(np.frombuffer(data[: 8 * side * side], "<f2").reshape(side, side, 4))
            data, side = data[8 * side * side :], side // 2 if mipmaps == "true" else 0
        assert data == b""
        levels.append(faces)
    return [np.stack(each) for each in zip(*levels, strict=True)]
