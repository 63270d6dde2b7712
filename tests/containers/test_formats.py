"""The table of formats, PNG and EXR: round trips to the bit, what a sampler sees, what cannot be held."""

import struct
import zlib

import numpy as np
import OpenEXR
import pytest
from cube_maps import ktx2_key_values
from PIL import Image
from refusals import refused

from homofact.containers.exr import write_half_exr
from homofact.containers.formats import FORMATS, format_named
from homofact.containers.png import read_png, write_png
from homofact.errors import BadInput
from homofact.version import __version__

FLOATS = ("exr", "exr16", "ktx2", "dds")


def texture(name, rows, columns, channels, seed=0):
    generator = np.random.default_rng(seed)
    dtype = np.dtype(FORMATS[name].dtype)
    if dtype.kind == "u":
        return generator.integers(0, 256**dtype.itemsize, (rows, columns, channels)).astype(dtype)
    return generator.normal(0, 4, (rows, columns, channels)).astype(dtype)


def test_the_names():
    assert list(FORMATS) == ["exr", "exr16", "png8", "png16", "ktx2", "dds", "bc6h"]
    for name, form in FORMATS.items():
        assert format_named(name) is form
        assert form.name == name
    with refused(r"'jpeg', expected one of exr, exr16, png8, png16, ktx2, dds, bc6h$"):
        format_named("jpeg")


@pytest.mark.parametrize("name", ["ktx2", "dds"])
def test_fewer_channels_are_grey_and_opaque_in_rgba(tmp_path, name):
    form = FORMATS[name]
    grey, colour = texture(name, 2, 3, 1), texture(name, 2, 3, 3)
    form.write(tmp_path / "t", grey)
    np.testing.assert_array_equal(form.read(tmp_path / "t"), np.concatenate([grey, grey, grey, np.ones_like(grey)], 2))
    form.write(tmp_path / "t", colour)
    np.testing.assert_array_equal(form.read(tmp_path / "t"), np.concatenate([colour, np.ones_like(grey)], 2))
    np.testing.assert_array_equal(form.read(tmp_path / "t", 1), colour[..., :1])


def test_an_exr_keeps_its_names_and_many_channels(tmp_path):
    stored = texture("exr16", 2, 3, 31)
    names = [f"{400 + 20 * k}nm" for k in range(31)]
    for name in ("exr", "exr16"):
        form = FORMATS[name]
        form.write(tmp_path / "t.exr", stored, names=names)
        np.testing.assert_array_equal(form.read(tmp_path / "t.exr", 31, names), stored)
        with refused(where="t.exr"):
            form.read(tmp_path / "t.exr", names=("R", "G", "B"))
        # Numbers sort as they count.
        form.write(tmp_path / "t.exr", stored)
        np.testing.assert_array_equal(form.read(tmp_path / "t.exr"), stored)


def test_exr16_channels_are_halves_for_any_reader(tmp_path):
    stored = texture("exr16", 4, 5, 3)
    stored[0, 0] = [65504, -(2**-24), -0.0]
    write_half_exr(tmp_path / "t.exr", stored, ("R", "G", "B"), "a comment")
    file = OpenEXR.File(str(tmp_path / "t.exr"), separate_channels=True)
    assert file.header()["comments"] == "a comment"
    for c, name in enumerate("RGB"):
        plane = file.channels()[name]
        assert plane.type() == OpenEXR.HALF
        np.testing.assert_array_equal(plane.pixels.view(np.uint16), stored[..., c].view(np.uint16))


def chunks(path):
    data = path.read_bytes()
    at, found = 8, []
    while at < len(data):
        size, kind = struct.unpack_from(">I 4s", data, at)
        assert zlib.crc32(data[at + 4 : at + 8 + size]) == struct.unpack_from(">I", data, at + 8 + size)[0]
        found.append((kind, data[at + 8 : at + 8 + size]))
        at += 12 + size
    return found


def restore_checksums(data):
    """Make the checks of a damaged PNG's chunks right again, as far as its lengths lead."""
    at = 8
    while at + 12 <= len(data):
        (size,) = struct.unpack_from(">I", data, at)
        if at + 12 + size > len(data):
            return
        struct.pack_into(">I", data, at + 8 + size, zlib.crc32(bytes(data[at + 4 : at + 8 + size])))
        at += 12 + size


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize(("channels", "colour_type"), [(1, 0), (3, 2), (4, 6)])
def test_png_has_no_chunk_that_bends_its_numbers(tmp_path, dtype, channels, colour_type):
    stored = np.random.default_rng(3).integers(0, np.iinfo(dtype).max, (3, 5, channels), dtype, endpoint=True)
    write_png(tmp_path / "t.png", stored)
    found = chunks(tmp_path / "t.png")
    assert {kind for kind, _ in found} == {b"IHDR", b"IDAT", b"IEND"}
    # Width, height, bits, colour type, deflate, adaptive filters, not interlaced.
    header = (5, 3, 8 * np.dtype(dtype).itemsize, colour_type, 0, 0, 0)
    assert struct.unpack(">2I 5B", found[0][1]) == header
    with Image.open(tmp_path / "t.png") as picture:
        shown = np.asarray(picture).reshape(3, 5, channels)
    # Pillow keeps the high bytes of 16-bit colour, and 16-bit grey whole.
    expected = stored >> 8 if dtype == np.uint16 and channels > 1 else stored
    np.testing.assert_array_equal(shown, expected)


def test_png_of_other_kinds_is_refused(tmp_path):
    for mode in ("P", "LA", "1"):
        Image.new(mode, (4, 4)).save(tmp_path / "t.png")
        with refused(where="t.png"):
            read_png(tmp_path / "t.png")
    write_png(tmp_path / "t.png", np.zeros((4, 4, 3), np.uint8))
    with refused(where="t.png", found="uint8 texels"):
        FORMATS["png16"].read(tmp_path / "t.png")
    with refused(where="t.png", found="values of type float64"):
        write_png(tmp_path / "t.png", np.zeros((4, 4, 3)))


@pytest.mark.parametrize("name", [name for name in FORMATS if not name.startswith("exr")])
def test_any_damage_is_a_line_or_still_a_texture(tmp_path, name):
    form = FORMATS[name]
    path = tmp_path / f"t{form.suffix}"
    form.write(path, texture(name, 8, 8, 3))
    whole = path.read_bytes()
    generator = np.random.default_rng(7)
    refused = []
    for attempt in range(300):
        data = bytearray(whole)
        for at in generator.integers(0, min(len(data), 200), 3):
            data[at] = generator.integers(0, 256)
        if name.startswith("png") and attempt % 2:
            restore_checksums(data)
        path.write_bytes(data)
        try:
            form.read(path)
        except BadInput as error:
            refused.append(str(error))
    assert len(refused) > 100
    assert not any("\n" in line for line in refused)


def test_a_png_of_fewer_rows_than_its_header_says(tmp_path):
    write_png(tmp_path / "t.png", np.zeros((2, 2, 3), np.uint8))
    data = bytearray((tmp_path / "t.png").read_bytes())
    struct.pack_into(">I", data, 20, 1000)
    restore_checksums(data)
    (tmp_path / "t.png").write_bytes(data)
    with refused(where="t.png", found="2 rows of pixels"):
        read_png(tmp_path / "t.png")


def test_a_format_reads_only_its_own_storage(tmp_path):
    FORMATS["bc6h"].write(tmp_path / "b.dds", np.ones((4, 4, 3)))
    FORMATS["dds"].write(tmp_path / "t.dds", np.ones((4, 4, 3)))
    FORMATS["exr"].write(tmp_path / "t.exr", np.ones((4, 4, 3)))
    with refused(where="b.dds", found="3 channels"):
        FORMATS["dds"].read(tmp_path / "b.dds")
    with refused(where="t.dds", found="4 channels"):
        FORMATS["bc6h"].read(tmp_path / "t.dds")
    with refused(where="t.exr", found="float32 texels"):
        FORMATS["exr16"].read(tmp_path / "t.exr")
    with refused(where="t.exr", found="3 channels"):
        FORMATS["exr"].read(tmp_path / "t.exr", 1)
    with refused(where="t.dds", found="4 channels"):
        FORMATS["dds"].read(tmp_path / "t.dds", 2)


@pytest.mark.parametrize(
    ("name", "channels", "expected"),
    [
        ("exr", 1, 4), ("exr", 3, 16), ("exr", 31, 8 * 16), ("exr16", 1, 2), ("exr16", 3, 8), ("exr16", 6, 12),
        ("png8", 1, 1), ("png8", 3, 4), ("png16", 1, 2), ("png16", 4, 8), ("ktx2", 1, 8), ("ktx2", 3, 8),
        ("dds", 4, 8), ("bc6h", 3, 1), ("bc6h", 1, 1),
    ],
)  # fmt: skip
def test_bytes_on_the_gpu(name, channels, expected):
    assert FORMATS[name].bytes_of(16, 32, channels) == 16 * 32 * expected


def test_a_block_that_is_not_full_takes_its_bytes():
    assert FORMATS["bc6h"].bytes_of(5, 9, 3) == 2 * 3 * 16


def test_key_values_reach_the_ktx2(tmp_path):
    stored = texture("ktx2", 4, 4, 3)
    FORMATS["ktx2"].write(tmp_path / "t.ktx2", stored, key_values={"KTXorientation": "rd"})
    written = {"KTXwriter": f"homofact {__version__}", "KTXorientation": "rd"}
    assert ktx2_key_values(tmp_path / "t.ktx2") == written
    FORMATS["ktx2"].write(tmp_path / "t.ktx2", stored, key_values={"KTXwriter": "another"})
    assert ktx2_key_values(tmp_path / "t.ktx2") == {"KTXwriter": "another"}
