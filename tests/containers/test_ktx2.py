"""KTX2: numbers of the Khronos specification, an independent reader (ktx-parse), bits that survive, bad files."""

import json
import re
import shutil
import struct
import subprocess
from pathlib import Path

import numpy as np
import pytest
from cube_maps import ktx2_key_values
from refusals import refused

from homofact.containers.ktx2 import read_ktx2, write_ktx2
from homofact.errors import BadInput

NODE = Path(__file__).parent / "node"
KEY_VALUES = {"KTXwriter": "homofact 1.2", "KTXorientation": "rd", "channels": "red, grün"}
FLOAT_MINUS_1, FLOAT_1 = 0xBF800000, 0x3F800000


def halves(rows, columns, seed=0):
    """Every kind of half: normal, subnormal, zeros of both signs, the largest."""
    values = np.random.default_rng(seed).normal(0, 4, (rows, columns, 4)).astype(np.float16)
    special = np.array([0.0, -0.0, 65504, -65504, 2**-24, -(2**-24), 2**-14, 1], np.float16)
    flat = values.reshape(-1)
    flat[: min(8, flat.size)] = special[: min(8, flat.size)]
    return values


@pytest.fixture
def parsed():
    """What ktx-parse finds in a file."""
    node = shutil.which("node")
    if node is None or not (NODE / "node_modules" / "ktx-parse").is_dir():
        pytest.skip("node or its package ktx-parse is missing: npm ci --prefix tests/containers/node")

    def parse(path):
        command = [node, str(NODE / "read_ktx2.mjs"), str(path)]
        return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)

    return parse


@pytest.mark.parametrize("shape", [(16, 16), (1, 8), (8, 1), (1, 1), (5, 3)])
@pytest.mark.parametrize("key_values", [{}, KEY_VALUES])
def test_halves_come_back_to_the_bit(tmp_path, shape, key_values):
    pixels = halves(*shape)
    write_ktx2(tmp_path / "t.ktx2", pixels, key_values)
    found = read_ktx2(tmp_path / "t.ktx2")
    assert found.dtype == np.float16
    np.testing.assert_array_equal(found.view(np.uint16), pixels.view(np.uint16))
    assert ktx2_key_values(tmp_path / "t.ktx2") == key_values


def test_header_numbers_are_those_of_the_specification(tmp_path):
    pixels = halves(3, 5)
    write_ktx2(tmp_path / "t.ktx2", pixels, KEY_VALUES)
    data = (tmp_path / "t.ktx2").read_bytes()
    assert data[:12] == bytes([0xAB, 0x4B, 0x54, 0x58, 0x20, 0x32, 0x30, 0xBB, 0x0D, 0x0A, 0x1A, 0x0A])
    # vkFormat, typeSize, width, height, depth, layers, faces, levels, supercompression.
    assert struct.unpack_from("<9I", data, 12) == (97, 2, 5, 3, 0, 0, 1, 1, 0)
    dfd, dfd_size, kvd, kvd_size = struct.unpack_from("<4I", data, 48)
    sgd, sgd_size, start, length, uncompressed = struct.unpack_from("<5Q", data, 64)
    # 80 bytes of header and 24 of the one level come before; the descriptor has 4 + 24 + 4 samples of 16.
    assert (dfd, dfd_size, kvd, sgd, sgd_size) == (104, 92, 196, 0, 0)
    assert length == uncompressed == 3 * 5 * 8 == len(data) - start
    assert start % 8 == 0
    assert 0 <= start - kvd - kvd_size < 8
    assert data[kvd + kvd_size : start] == bytes(start - kvd - kvd_size)
    assert data[start:] == pixels.tobytes()
    # Total size; vendor and type; version 2, block size; RGBSDA, unspecified, linear, straight; 1 x 1; 8 bytes.
    assert struct.unpack_from("<I 4H 4B 4B 8B", data, dfd) == (
        92, 0, 0, 2, 88, 1, 0, 1, 0, 0, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 0,
    )  # fmt: skip
    samples = [struct.unpack_from("<H 2B I 2I", data, dfd + 28 + 16 * k) for k in range(4)]
    # Bit offset, length - 1, channel with float and signed bits, position, lower, upper.
    assert samples == [
        (16 * k, 15, 0xC0 | channel, 0, FLOAT_MINUS_1, FLOAT_1) for k, channel in enumerate((0, 1, 2, 15))
    ]
    # Keys sorted, values NUL-terminated, every entry padded to 4 bytes.
    entries, at = [], kvd
    while at < kvd + kvd_size:
        (size,) = struct.unpack_from("<I", data, at)
        entries.append(data[at + 4 : at + 4 + size])
        at += 4 + (size + 3) // 4 * 4
    assert at == kvd + kvd_size
    assert entries == [
        b"KTXorientation\0rd\0", b"KTXwriter\0homofact 1.2\0", "channels\0red, grün\0".encode(),
    ]  # fmt: skip


def test_without_key_values_their_offset_is_zero(tmp_path):
    write_ktx2(tmp_path / "t.ktx2", halves(1, 1))
    assert struct.unpack_from("<4I", (tmp_path / "t.ktx2").read_bytes(), 48) == (104, 92, 0, 0)


@pytest.mark.parametrize("key_values", [{}, KEY_VALUES])
def test_ktx_parse_reads_the_same(tmp_path, parsed, key_values):
    pixels = halves(6, 7)
    write_ktx2(tmp_path / "t.ktx2", pixels, key_values)
    found = parsed(tmp_path / "t.ktx2")
    header = {"vkFormat": 97, "typeSize": 2, "pixelWidth": 7, "pixelHeight": 6, "pixelDepth": 0, "layerCount": 0}
    assert {name: found[name] for name in header} == header
    assert (found["faceCount"], found["levelCount"], found["supercompressionScheme"]) == (1, 1, 0)
    assert len(found["levels"]) == 1
    assert bytes.fromhex(found["levels"][0]["data"]) == pixels.tobytes()
    assert found["levels"][0]["uncompressedByteLength"] == pixels.nbytes
    (block,) = found["dataFormatDescriptor"]
    assert (block["colorModel"], block["transferFunction"], block["bytesPlane"][0]) == (1, 1, 8)
    assert block["texelBlockDimension"] in ({"x": 1, "y": 1, "z": 1, "w": 1}, [0, 0, 0, 0])
    channels = [sample.get("channelType", sample.get("channelID")) for sample in block["samples"]]
    assert channels == [0xC0, 0xC1, 0xC2, 0xCF]
    assert [sample["bitOffset"] for sample in block["samples"]] == [0, 16, 32, 48]
    values = found["keyValue"]
    assert set(values) == set(key_values)
    for name in values:
        if name.startswith("KTX"):
            assert values[name].rstrip("\0") == key_values[name]


def test_ktx_parse_reads_the_layers_of_an_array(tmp_path, parsed):
    pixels = halves(12, 7)
    write_ktx2(tmp_path / "t.ktx2", pixels, KEY_VALUES, layers=3)
    found = parsed(tmp_path / "t.ktx2")
    assert (found["pixelHeight"], found["layerCount"], found["faceCount"], found["levelCount"]) == (4, 3, 1, 1)
    assert bytes.fromhex(found["levels"][0]["data"]) == pixels.tobytes()


def test_layers_come_back_one_under_another_and_only_as_many(tmp_path):
    path = tmp_path / "t.ktx2"
    write_ktx2(path, halves(6, 5), layers=2)
    # Height and layers of the header.
    assert struct.unpack_from("<3I", path.read_bytes(), 24) == (3, 0, 2)
    np.testing.assert_array_equal(read_ktx2(path, 2).view(np.uint16), halves(6, 5).view(np.uint16))
    for layers in (1, 3):
        with refused(where="t.ktx2"):
            read_ktx2(path, layers)
    with refused(where="t.ktx2", found="6 rows"):
        write_ktx2(path, halves(6, 5), layers=4)
    np.testing.assert_array_equal(read_ktx2(path, 2).view(np.uint16), halves(6, 5).view(np.uint16))


@pytest.mark.parametrize(
    ("key_values", "message"),
    [
        ({"": "x"}, "expected text without NUL under a name"),
        ({"a": "x\0y"}, "expected text without NUL"),
        ({"KTXorientation": "up"}, "expected KTXwriter, KTXorientation of r or l with d or u"),
        ({"ktxmine": "x"}, "a key without KTX in front"),
    ],
)
def test_key_values_that_the_specification_forbids(tmp_path, key_values, message):
    with refused(message):
        write_ktx2(tmp_path / "t.ktx2", halves(2, 2), key_values)
    assert list(tmp_path.iterdir()) == []


def test_pixels_that_cannot_be_stored(tmp_path):
    path = tmp_path / "t.ktx2"
    with refused(re.escape("(4, 4, 3), expected (rows, columns, 4)")):
        write_ktx2(path, np.zeros((4, 4, 3)))
    with refused(where="t.ktx2", found="pixels of shape (0, 4, 4)"):
        write_ktx2(path, np.zeros((0, 4, 4)))
    with refused(where="t.ktx2", found="pixels of type int64"):
        write_ktx2(path, np.zeros((4, 4, 4), np.int64))
    far = np.zeros((4, 4, 4))
    far[2, 1, 3] = 65520
    with refused(where="t.ktx2"):
        write_ktx2(path, far)
    far[2, 1, 3] = np.nan
    with refused(where="t.ktx2"):
        write_ktx2(path, far)
    with pytest.raises(BadInput, match="cannot be written"):
        write_ktx2(tmp_path / "nowhere" / "t.ktx2", halves(2, 2))
    assert list(tmp_path.iterdir()) == []


def patched(path, at, form, value):
    data = bytearray(path.read_bytes())
    struct.pack_into(form, data, at, value)
    path.write_bytes(bytes(data))


@pytest.mark.parametrize(
    ("at", "form", "value", "message"),
    [
        (5, "<B", 0x31, "expected a KTX2 texture"),
        (12, "<I", 109, "vkFormat 109, expected 97"),
        (16, "<I", 4, "data format descriptor"),
        (20, "<I", 0, "expected one plain 2D level"),
        (20, "<I", 9, "expected 576"),
        (20, "<I", 2**32 - 1, "bytes of texels"),
        (32, "<I", 3, "expected one plain 2D level"),
        (40, "<I", 5, "expected one plain 2D level"),
        (44, "<I", 2, "expected one plain 2D level"),
        (48, "<I", 200, "data format descriptor"),
        (56, "<I", 200, "expected them to follow"),
        (60, "<I", 2**31, "expected them to follow"),
        (72, "<Q", 8, "expected them to follow"),
        (80, "<Q", 2**63, "expected them to follow"),
        (88, "<Q", 64, "indexed as 64, expected 512"),
        (96, "<Q", 64, "expected 512"),
        (116, "<B", 3, "data format descriptor"),
        (196, "<I", 2**31, "key/value data broken"),
        (200, "<B", 0xFF, "not UTF-8"),
        (200, "<B", 0, "key/value data broken"),
    ],
)
def test_a_header_edited_into_nonsense(tmp_path, at, form, value, message):
    path = tmp_path / "t.ktx2"
    write_ktx2(path, halves(8, 8), KEY_VALUES)
    patched(path, at, form, value)
    with pytest.raises(BadInput, match=message) as caught:
        read_ktx2(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_every_truncation_and_any_padding_is_refused(tmp_path):
    path = tmp_path / "t.ktx2"
    write_ktx2(path, halves(2, 3), KEY_VALUES)
    whole = path.read_bytes()
    for size in range(len(whole)):
        path.write_bytes(whole[:size])
        with pytest.raises(BadInput):
            read_ktx2(path)
    path.write_bytes(whole + b"\0")
    with refused(where="t.ktx2", found="49 bytes of texels for 3 x 2, indexed as 48"):
        read_ktx2(path)
    with refused(where="absent.ktx2"):
        read_ktx2(tmp_path / "absent.ktx2")
