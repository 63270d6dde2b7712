"""Cube maps with levels in KTX2 and DDS: numbers of the specifications, ktx-parse, bits that survive."""

import json
import shutil
import struct
import subprocess
from pathlib import Path

import numpy as np
import pytest
from cube_maps import ktx2_key_values, read_dds_cube, read_ktx2_cube
from refusals import refused

from homofact.containers.dds import read_dds, write_dds_cube
from homofact.containers.ktx2 import read_ktx2, write_ktx2_cube

NODE = Path(__file__).parent / "node"
WRITERS = {"ktx2": (write_ktx2_cube, read_ktx2_cube), "dds": (write_dds_cube, read_dds_cube)}


def chain(side=8, levels=3):
    """Every texel is another half."""
    sizes = [6 * (side >> k) ** 2 * 4 for k in range(levels)]
    starts = np.cumsum([1000, *sizes])
    bits = [np.arange(start, start + size, dtype=np.uint16) for start, size in zip(starts, sizes, strict=False)]
    return [each.view(np.float16).reshape(6, side >> k, side >> k, 4) for k, each in enumerate(bits)]


@pytest.mark.parametrize("form", WRITERS)
@pytest.mark.parametrize(("side", "levels"), [(8, 3), (8, 4), (1, 1), (4, 1)])
def test_levels_come_back_to_the_bit(tmp_path, form, side, levels):
    write, read = WRITERS[form]
    write(tmp_path / "sky", chain(side, levels))
    found = read(tmp_path / "sky")
    assert len(found) == levels
    for one, two in zip(found, chain(side, levels), strict=True):
        assert one.dtype == np.float16
        np.testing.assert_array_equal(one.view(np.uint16), two.view(np.uint16))


def test_a_ktx2_has_its_smallest_level_first_and_its_index_the_largest(tmp_path):
    write_ktx2_cube(tmp_path / "t.ktx2", chain(), {"KTXwriter": "a"})
    data = (tmp_path / "t.ktx2").read_bytes()
    # vkFormat, typeSize, width, height, depth, layers, faces, levels, supercompression.
    assert struct.unpack_from("<9I", data, 12) == (97, 2, 8, 8, 0, 0, 6, 3, 0)
    # The descriptor stands behind 80 bytes of header and 24 for each of the levels.
    assert struct.unpack_from("<3I", data, 48) == (152, 92, 244)
    index = [struct.unpack_from("<3Q", data, 80 + 24 * k) for k in range(3)]
    assert [each[1:] for each in index] == [(6 * 64 * 8,) * 2, (6 * 16 * 8,) * 2, (6 * 4 * 8,) * 2]
    starts = [each[0] for each in index]
    assert starts == sorted(starts, reverse=True)
    assert all(start % 8 == 0 for start in starts)
    for (start, length, _), level in zip(index, chain(), strict=True):
        assert data[start : start + length] == level.tobytes()
    assert len(data) == starts[0] + 6 * 64 * 8
    assert ktx2_key_values(tmp_path / "t.ktx2") == {"KTXwriter": "a"}


def test_ktx_parse_reads_the_same(tmp_path):
    node = shutil.which("node")
    if node is None or not (NODE / "node_modules" / "ktx-parse").is_dir():
        pytest.skip("node or its package ktx-parse is missing: npm ci --prefix tests/containers/node")
    write_ktx2_cube(tmp_path / "t.ktx2", chain(), {"KTXwriter": "a"})
    command = [node, str(NODE / "read_ktx2.mjs"), str(tmp_path / "t.ktx2")]
    found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    names = ("vkFormat", "pixelWidth", "pixelHeight", "pixelDepth", "layerCount", "faceCount", "levelCount")
    assert [found[name] for name in names] == [97, 8, 8, 0, 0, 6, 3]
    assert [bytes.fromhex(each["data"]) for each in found["levels"]] == [level.tobytes() for level in chain()]
    assert [each["uncompressedByteLength"] for each in found["levels"]] == [level.nbytes for level in chain()]


def test_a_dds_has_the_numbers_of_the_guide_and_face_after_face(tmp_path):
    write_dds_cube(tmp_path / "t.dds", chain())
    data = (tmp_path / "t.dds").read_bytes()
    # Flags: caps, height, width, pitch, pixel format, mipmaps; height, width, pitch, depth, mipmaps.
    assert struct.unpack_from("<7I", data, 4) == (124, 0x2100F, 8, 8, 64, 0, 3)
    # Complex, texture, mipmap; a cube map with all six faces.
    assert struct.unpack_from("<2I", data, 108) == (0x401008, 0xFE00)
    # Format, 2D texture, TEXTURECUBE, one cube.
    assert struct.unpack_from("<5I", data, 128) == (10, 3, 4, 1, 0)
    assert data[148:] == b"".join(level[face].tobytes() for face in range(6) for level in chain())


@pytest.mark.parametrize("form", WRITERS)
def test_what_is_no_cube_map_is_refused_and_nothing_written(tmp_path, form):
    write, _ = WRITERS[form]
    large, middle, small = chain()
    for levels, message in (
        ([], "found no levels"),
        ([large, small], r"found level 1 of shape \(6, 2, 2, 4\), expected \(6, N, N, 4\), N half"),
        ([large[:5], middle], r"level 0 of shape \(5, 8, 8, 4\)"),
        ([large[:, :4]], r"level 0 of shape \(6, 4, 8, 4\)"),
        ([large[..., :3]], r"level 0 of shape \(6, 8, 8, 3\)"),
        ([large[0]], r"level 0 of shape \(8, 8, 4\)"),
        ([chain(1, 1)[0], chain(1, 1)[0][:, :0, :0]], "level 1 of shape"),
        ([np.full((6, 2, 2, 4), np.inf)], "is inf, expected finite values"),
        ([np.zeros((6, 2, 2, 4), int)], "expected floating-point numbers"),
    ):
        with refused(message):
            write(tmp_path / "t", levels)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("form", "read"), [("ktx2", read_ktx2), ("dds", read_dds)])
def test_a_cube_map_is_no_plain_texture(tmp_path, form, read):
    write, _ = WRITERS[form]
    write(tmp_path / "t", chain(2, 2))
    with refused(where="t"):
        read(tmp_path / "t")
