"""DDS: numbers of Microsoft's guide, independent readers (nvddsinfo, imagecodecs, Pillow), bits, bad files."""

import re
import shutil
import struct
import subprocess

import numpy as np
import pytest
from PIL import Image
from refusals import refused

from homofact.containers.bc6h import decode_bc6h, encode_bc6h
from homofact.containers.dds import read_dds, write_dds, write_dds_bc6h
from homofact.errors import BadInput


def halves(rows, columns):
    return np.random.default_rng(rows).normal(0, 4, (rows, columns, 4)).astype(np.float16)


@pytest.mark.parametrize("shape", [(16, 16), (1, 8), (8, 1), (1, 1), (5, 3)])
def test_halves_come_back_to_the_bit(tmp_path, shape):
    pixels = halves(*shape)
    pixels.reshape(-1)[:4] = [-0.0, 65504, -(2**-24), -65504]
    write_dds(tmp_path / "t.dds", pixels)
    found = read_dds(tmp_path / "t.dds")
    assert found.dtype == np.float16
    np.testing.assert_array_equal(found.view(np.uint16), pixels.view(np.uint16))


@pytest.mark.parametrize(("blocks", "dxgi", "pitch", "pitch_flag"), [(False, 10, 96, 0x8), (True, 96, 96, 0x80000)])
def test_header_numbers_are_those_of_the_guide(tmp_path, blocks, dxgi, pitch, pitch_flag):
    pixels = halves(8, 12)
    if blocks:
        write_dds_bc6h(tmp_path / "t.dds", pixels[..., :3])
    else:
        write_dds(tmp_path / "t.dds", pixels)
    data = (tmp_path / "t.dds").read_bytes()
    assert data[:4] == b"DDS "
    # Size 124; flags caps, height, width, pixel format and a pitch or linear size; height; width; pitch; depth.
    assert struct.unpack_from("<6I", data, 4) == (124, 0x1007 | pitch_flag, 8, 12, pitch, 0)
    assert struct.unpack_from("<12I", data, 28) == (1, *[0] * 11)
    # DDS_PIXELFORMAT: 32 bytes, a four-character code, no masks; then the one surface capability, texture.
    assert struct.unpack_from("<2I 4s 5I", data, 76) == (32, 4, b"DX10", 0, 0, 0, 0, 0)
    assert struct.unpack_from("<5I", data, 108) == (0x1000, 0, 0, 0, 0)
    # DX10: format, 2D texture, no flags, array of 1, alpha unknown.
    assert struct.unpack_from("<5I", data, 128) == (dxgi, 3, 0, 1, 0)
    assert data[148:] == (encode_bc6h(pixels[..., :3]) if blocks else pixels.tobytes())


@pytest.mark.parametrize("blocks", [False, True])
def test_an_array_s_header_is_of_one_layer_and_the_layers_follow_each_other(tmp_path, blocks):
    path, pixels = tmp_path / "t.dds", halves(24, 12)
    if blocks:
        write_dds_bc6h(path, pixels[..., :3], layers=3)
    else:
        write_dds(path, pixels, layers=3)
    data = path.read_bytes()
    # Height, width, and the pitch of a row or the bytes of one layer's blocks.
    assert struct.unpack_from("<3I", data, 12) == (8, 12, 96)
    assert struct.unpack_from("<5I", data, 128) == (96 if blocks else 10, 3, 0, 3, 0)
    parts = np.split(pixels, 3)
    assert data[148:] == b"".join(encode_bc6h(each[..., :3]) if blocks else each.tobytes() for each in parts)
    found = read_dds(path, 3)
    assert found.shape == (24, 12, 3 if blocks else 4)
    assert blocks or found.tobytes() == pixels.tobytes()
    with refused(where="t.dds", found="a header of 12 x 8 texels that is not of one plain 2D level"):
        read_dds(path)
    with refused(where="t.dds", found="a header of 12 x 8 texels that is not of one plain 2D level"):
        read_dds(path, 2)


@pytest.mark.parametrize(("blocks", "named"), [(False, "10 (R16G16B16A16_FLOAT)"), (True, "96 (")])
def test_nvidia_texture_tools_read_the_same_header(tmp_path, blocks, named):
    tool = shutil.which("nvddsinfo")
    if tool is None:
        pytest.skip("nvddsinfo is missing: Debian's package libnvtt-bin")
    if blocks:
        write_dds_bc6h(tmp_path / "t.dds", halves(8, 12)[..., :3])
    else:
        write_dds(tmp_path / "t.dds", halves(8, 12))
    found = subprocess.run([tool, str(tmp_path / "t.dds")], check=True, capture_output=True, text=True).stdout
    lines = {name.strip(): value.strip() for name, _, value in (line.partition(":") for line in found.splitlines())}
    assert (lines["Width"], lines["Height"], lines["Mipmap count"]) == ("12", "8", "1")
    assert lines["FourCC"] == "'DX10'"
    assert lines["DXGI Format"].startswith(named)
    assert lines["Resource dimension"] == "3 (TEXTURE2D)"
    assert lines["Array size"] == "1"
    assert (lines["Linear size"] if blocks else lines["Pitch"]) == "96"


def test_imagecodecs_reads_the_same_texels_of_the_blocks(tmp_path):
    imagecodecs = pytest.importorskip("imagecodecs", reason="imagecodecs is missing: pip install homofact[textures]")
    pixels = np.random.default_rng(5).normal(0, 3, (12, 8, 3))
    write_dds_bc6h(tmp_path / "t.dds", pixels)
    found = imagecodecs.dds_decode((tmp_path / "t.dds").read_bytes())
    assert found.dtype == np.float16
    np.testing.assert_array_equal(found.view(np.uint16), read_dds(tmp_path / "t.dds").view(np.uint16))


def test_pillow_reads_the_blocks(tmp_path):
    # Pillow shows BC6H clipped to 0 to 1 in 8 bits, rounded down.
    pixels = np.random.default_rng(6).uniform(-0.5, 1.5, (8, 16, 3))
    write_dds_bc6h(tmp_path / "t.dds", pixels)
    with Image.open(tmp_path / "t.dds") as picture:
        assert picture.size == (16, 8)
        shown = np.asarray(picture) / 255
    assert np.abs(shown - np.clip(read_dds(tmp_path / "t.dds").astype(np.float64), 0, 1)).max() <= 1.5 / 255


def test_pixels_that_cannot_be_stored(tmp_path):
    path = tmp_path / "t.dds"
    with refused(re.escape("(4, 4, 3), expected (rows, columns, 4)")):
        write_dds(path, np.zeros((4, 4, 3)))
    with refused(where="t.dds"):
        write_dds(path, np.full((1, 1, 4), -1e6))
    with refused(where="t.dds"):
        write_dds_bc6h(path, np.full((4, 4, 3), np.inf))
    with refused(where="t.dds"):
        write_dds_bc6h(path, np.zeros((1, 4, 3)))
    with refused(where="t.dds", found="4 rows"):
        write_dds(path, halves(4, 4), layers=3)
    with refused(where="t.dds"):
        write_dds_bc6h(path, np.zeros((4, 4, 3)), layers=2)
    with pytest.raises(BadInput, match="cannot be written"):
        write_dds(tmp_path / "nowhere" / "t.dds", halves(2, 2))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("at", "form", "value", "message"),
    [
        (0, "<B", 0x64, "expected a DDS texture"),
        (84, "<4s", b"DXT5", "four-character code b'DXT5'"),
        (128, "<I", 2, "DXGI format 2, expected 10"),
        (128, "<I", 95, "DXGI format 95, expected 10"),
        (16, "<I", 0, "that is not of one plain 2D level"),
        (16, "<I", 2**32 - 1, "bytes of texels for 4294967295 x 8"),
        (16, "<I", 9, "512 bytes of texels for 9 x 8, expected 576"),
        (28, "<I", 2, "that is not of one plain 2D level"),
        (112, "<I", 0x200, "that is not of one plain 2D level"),
        (140, "<I", 6, "that is not of one plain 2D level"),
    ],
)
def test_a_header_edited_into_nonsense(tmp_path, at, form, value, message):
    path = tmp_path / "t.dds"
    write_dds(path, halves(8, 8))
    data = bytearray(path.read_bytes())
    struct.pack_into(form, data, at, value)
    path.write_bytes(bytes(data))
    with refused(message) as caught:
        read_dds(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_every_truncation_and_any_padding_is_refused(tmp_path):
    path = tmp_path / "t.dds"
    write_dds_bc6h(path, halves(4, 8)[..., :3])
    whole = path.read_bytes()
    np.testing.assert_array_equal(read_dds(path), decode_bc6h(whole[148:], 4, 8))
    for size in range(len(whole)):
        path.write_bytes(whole[:size])
        with pytest.raises(BadInput):
            read_dds(path)
    path.write_bytes(whole + b"\0")
    with refused(where="t.dds", found="33 bytes of texels for 8 x 4"):
        read_dds(path)
    with refused(where="absent.dds"):
        read_dds(tmp_path / "absent.dds")
