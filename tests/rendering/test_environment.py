"""Radiance .hdr and EXR: hand-made files with known pixels, real light probes, and damaged files."""

import numpy as np
import OpenEXR
import pytest

from homofact.containers.hdr import decode_hdr
from homofact.errors import BadInput
from homofact.rendering.environment import read_environment

HEAD = b"#?RADIANCE\n# made here\nFORMAT=32-bit_rle_rgbe\n\n"


def pixels(rows, columns, seed=0):
    rgbe = np.random.default_rng(seed).integers(2, 256, (rows, columns, 4)).astype(np.uint8)
    rgbe[..., 3] = 120 + rgbe[..., 3] % 16
    return rgbe


def decoded(rgbe):
    """The pixel by its definition, one at a time."""
    return np.array([[[m * 2.0 ** (int(e) - 136) for m in (r, g, b)] for r, g, b, e in row] for row in rgbe.tolist()])


def new_runs(rgbe):
    """Scanlines in new run lengths: equal neighbours of three and more as runs, the rest as dumps."""
    out = b""
    for row in rgbe:
        out += bytes((2, 2, len(row) >> 8, len(row) & 255))
        for line in row.T.tolist():
            k = 0
            while k < len(line):
                run = 1
                while k + run < len(line) and run < 127 and line[k + run] == line[k]:
                    run += 1
                if run > 2:
                    out += bytes((128 + run, line[k]))
                    k += run
                else:
                    piece = line[k : k + 2]
                    out += bytes((len(piece), *piece))
                    k += len(piece)
    return out


def test_flat_pixels():
    rgbe = pixels(3, 5)
    data = HEAD + b"-Y 3 +X 5\n" + rgbe.tobytes()
    np.testing.assert_array_equal(decode_hdr(data, "x"), decoded(rgbe))


def test_new_runs_and_dumps():
    rgbe = pixels(4, 300, 1)
    rgbe[1:, 20:200] = rgbe[1:, 20:21]
    data = HEAD + b"-Y 4 +X 300\n" + new_runs(rgbe)
    assert len(data) < rgbe.size
    np.testing.assert_array_equal(decode_hdr(data, "x"), decoded(rgbe))


def test_old_runs_repeat_the_pixel_before():
    stored = bytes((10, 20, 30, 130, 1, 1, 1, 3, 7, 7, 7, 129, 1, 1, 1, 44, 1, 1, 1, 1))
    image = decode_hdr(HEAD + b"-Y 5 +X 61\n" + stored, "x").reshape(-1, 3)
    np.testing.assert_array_equal(image[:4], [[10 / 64, 20 / 64, 30 / 64]] * 4)
    np.testing.assert_array_equal(image[4:], [[7 / 128] * 3] * (1 + 44 + 256))


def test_zero_exponent_is_black_and_exposure_divides():
    head = b"#?RGBE\nEXPOSURE=2\nEXPOSURE= 4.0\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n"
    image = decode_hdr(head + bytes((255, 255, 255, 0, 128, 64, 0, 129)), "x")
    np.testing.assert_array_equal(image, [[[0, 0, 0], [1 / 8, 1 / 16, 0]]])


@pytest.mark.parametrize("name", ["grace_probe_latlong.hdr", "stpeters_probe_latlong.hdr", "studio_small_03_1k.hdr"])
def test_real_probes(real_data, name):
    sky = read_environment(real_data / "envmaps" / name)
    assert tuple(sky.radiance.shape) == (512, 1024, 3)
    assert float(sky.radiance.max()) > 20 * float(sky.radiance.mean())
    # The lamps are above: more light comes from the upper half.
    assert sky.radiance[:256].mean() > sky.radiance[256:].mean()


def test_exr_of_three_and_of_one_channel(tmp_path):
    planes = np.random.default_rng(0).random((3, 4, 8)).astype(np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, dict(zip("RGB", planes, strict=True))).write(str(tmp_path / "a.exr"))
    np.testing.assert_array_equal(read_environment(tmp_path / "a.exr").radiance.numpy(), planes.transpose(1, 2, 0))
    OpenEXR.File(header, {"Y": planes[0].copy()}).write(str(tmp_path / "b.exr"))
    np.testing.assert_array_equal(read_environment(tmp_path / "b.exr").radiance.numpy()[..., 0], planes[0])
    OpenEXR.File(header, {"depth": planes[0].copy()}).write(str(tmp_path / "c.exr"))
    with pytest.raises(BadInput, match="channels are depth"):
        read_environment(tmp_path / "c.exr")
    planes[1, 2, 3] = np.nan
    OpenEXR.File(header, dict(zip("RGB", planes, strict=True))).write(str(tmp_path / "d.exr"))
    with pytest.raises(BadInput, match=r"d\.exr: pixel row 2, column 3 is not finite"):
        read_environment(tmp_path / "d.exr")
    data = (tmp_path / "a.exr").read_bytes()
    (tmp_path / "e.exr").write_bytes(data[: len(data) - 40])
    with pytest.raises(BadInput, match=r"e\.exr: not a readable OpenEXR file"):
        read_environment(tmp_path / "e.exr")


def test_another_file_is_shown_as_text(tmp_path):
    (tmp_path / "sky.hdr").write_bytes(b"# num wls\n3\n\x1b")
    with pytest.raises(BadInput, match=r"sky\.hdr: begins with '# num wls', expected a Radiance \.hdr or an OpenEXR"):
        read_environment(tmp_path / "sky.hdr")


GOOD = HEAD + b"-Y 2 +X 16\n" + new_runs(pixels(2, 16))


@pytest.mark.parametrize(
    ("words", "data"),
    [
        ("truncated", GOOD[:-1]),
        ("truncated", GOOD[: len(GOOD) // 2 + 30]),
        ("truncated", HEAD + b"-Y 2 +X 3\n" + bytes(20)),
        ("truncated", HEAD + b"-Y 2 +X 3\n" + bytes((9, 9, 9, 129, 1, 1, 1, 2))),
        ("3 bytes after the last scanline", GOOD + b"abc"),
        ("a run of 120", HEAD + b"-Y 1 +X 16\n" + bytes((2, 2, 0, 16, 248, 7)) + bytes(80)),
        ("a run of 0", HEAD + b"-Y 1 +X 16\n" + bytes((2, 2, 0, 16, 0, 7)) + bytes(80)),
        ("repeated", HEAD + b"-Y 2 +X 3\n" + bytes((9, 9, 9, 129, 1, 1, 1, 200))),
        ("FORMAT is '32-bit_rle_xyze'", GOOD.replace(b"rgbe", b"xyze")),
        ("EXPOSURE is 'bright'", GOOD.replace(b"# made here", b"EXPOSURE=bright")),
        ("EXPOSURE is '0'", GOOD.replace(b"# made here", b"EXPOSURE=0")),
        (r"size line is '\+Y 2 \+X 16'", GOOD.replace(b"-Y 2", b"+Y 2")),
        ("expected at least one pixel", GOOD.replace(b"-Y 2", b"-Y 0")),
        ("expected at most", GOOD.replace(b"-Y 2", b"-Y 999999999")),
        ("no end", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n"),
        ("expected a Radiance .hdr or an OpenEXR", b"P6 1 1 255 abc"),
        ("expected #.RADIANCE", b"#?SOMETHING\n\n"),
    ],
)
def test_damaged_hdr_is_one_line_naming_the_file(tmp_path, words, data):
    (tmp_path / "sky.hdr").write_bytes(data)
    with pytest.raises(BadInput, match=words) as caught:
        read_environment(tmp_path / "sky.hdr")
    assert "sky.hdr" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_file(tmp_path):
    with pytest.raises(BadInput, match=r"none\.hdr: no such file"):
        read_environment(tmp_path / "none.hdr")
