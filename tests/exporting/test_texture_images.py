"""Texture images: EXR to the bit, PNG with its marks, one-dimensional and spectral textures."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from PIL import Image

from homofact.containers.exr import read_exr
from homofact.errors import BadInput
from homofact.exporting.images import (
    HATCH,
    OUTSIDE,
    exr_channel_names,
    texture_picture,
    write_exr,
    write_texture_exr,
    write_texture_png,
)
from homofact.factor.fitted import Texture


def term(rows, columns, channels, seed=0):
    texture = torch.randn(rows, columns, channels, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))
    return Texture("texture_0", "h", "log", texture, torch.ones(rows, columns, dtype=torch.bool))


@pytest.mark.parametrize("channels", [("R", "G", "B"), ("G",), tuple(f"{400 + 10 * k}nm" for k in range(31))])
@pytest.mark.parametrize("shape", [(16, 16), (1, 8), (5, 3)])
def test_exr_holds_the_factor_to_the_bit(tmp_path, channels, shape):
    one = term(shape[0], shape[1], len(channels))
    write_texture_exr(tmp_path / "t.exr", one, channels)
    planes = read_exr(tmp_path / "t.exr")
    assert set(planes) == ({"Y"} if len(channels) == 1 else set(channels))
    for c, name in enumerate(exr_channel_names(channels)):
        expected = one.texels[..., c].astype(np.float32)
        assert planes[name].dtype == np.float32
        np.testing.assert_array_equal(planes[name].view(np.uint32), expected.view(np.uint32))


def test_exr_keeps_extremes_and_its_channels_apart(tmp_path):
    values = np.array([[[0.0, -0.0, 1e-45], [3.4e38, -3.4e38, 1.17e-38]]], np.float32)
    write_exr(tmp_path / "x.exr", values, ("R", "G", "B"))
    planes = read_exr(tmp_path / "x.exr")
    for c, name in enumerate("RGB"):
        np.testing.assert_array_equal(planes[name].view(np.uint32), values[..., c].view(np.uint32))


def test_a_full_stop_in_a_name_makes_no_layer():
    assert exr_channel_names(("400.5nm", "410nm")) == ("400,5nm", "410nm")


def test_png_marks_the_texels_outside_the_mask_and_only_them(tmp_path):
    one = term(4, 4, 3)
    one.mask[0, 1] = False
    one.mask[3, 2] = False
    write_texture_png(tmp_path / "t.png", one, ("R", "G", "B"))
    picture = Image.open(tmp_path / "t.png")
    assert picture.size == (256, 256)
    cells = np.asarray(picture).reshape(4, 64, 4, 64, 3).transpose(0, 2, 1, 3, 4).reshape(4, 4, -1, 3)
    for row in range(4):
        for column in range(4):
            colours = {tuple(colour) for colour in cells[row, column].tolist()}
            assert (colours == {OUTSIDE, HATCH}) == (not bool(one.mask[row, column]))
            assert len(colours) == (1 if one.mask[row, column] else 2)
    # Row 0 is on top: its marked texel lies in the top quarter.
    assert tuple(np.asarray(picture)[10, 100].tolist()) in {OUTSIDE, HATCH}


def test_png_grey_follows_its_words(tmp_path):
    one = term(3, 5, 1)
    one.texels[0, 0] = 100.0
    one.mask[0, 0] = False
    write_texture_png(tmp_path / "t.png", one, ("Y",))
    picture = Image.open(tmp_path / "t.png")
    words = picture.info["Description"]
    low, high = (float(words.split(f"{name} = ")[1].split(";")[0].split(",")[0]) for name in ("low", "high"))
    inside = one.texels[one.mask]
    assert (low, high) == (
        pytest.approx(float(inside.min()), rel=1e-5),
        pytest.approx(float(inside.max()), rel=1e-5),
    )
    wide, tall = picture.size[0] // 5, picture.size[1] // 3
    shown = np.asarray(picture)[tall // 2 :: tall, wide // 2 :: wide]
    expected = np.round(255 * (one.texels[..., 0] - low) / (high - low))
    difference = np.abs(shown[..., 0].astype(float) - expected)[one.mask]
    assert difference.max() <= 1
    assert min(picture.size) >= 256


def test_flat_texture_looks_flat():
    one = term(4, 4, 3)
    flat = replace(one, texels=one.texels * 1e-3)
    pixels, _ = texture_picture(flat, ("R", "G", "B"))
    assert pixels.min() > 120
    assert pixels.max() < 135
    constant = replace(one, texels=np.zeros_like(one.texels), mask=np.zeros_like(one.mask))
    pixels, _ = texture_picture(constant, ("R", "G", "B"))
    assert set(map(tuple, pixels.reshape(-1, 3).tolist())) == {OUTSIDE, HATCH}


def test_one_row_fills_the_square_and_spectra_become_three():
    pixels, _ = texture_picture(term(1, 8, 3), ("R", "G", "B"))
    assert pixels.shape == (256, 256, 3)
    assert (pixels == pixels[:1]).all()
    one = term(2, 2, 6)
    one.texels[...] = [0.0, 0, 1, 1, 3, 3]
    pixels, words = texture_picture(one, tuple("abcdef"))
    assert pixels[0, 0].tolist() == [255, 85, 0]
    assert "third of 6 channels" in words


def test_bad_input(tmp_path):
    pixels = np.ones((2, 2, 3))
    with pytest.raises(BadInput, match="different names"):
        write_exr(tmp_path / "x.exr", pixels, ("R", "G"))
    with pytest.raises(BadInput, match="different names"):
        write_exr(tmp_path / "x.exr", pixels, ("R", "G", "G"))
    pixels[1, 0, 2] = 1e60
    with pytest.raises(BadInput, match="row 1, column 0 is not finite"):
        write_exr(tmp_path / "x.exr", pixels, ("R", "G", "B"))
    with pytest.raises(BadInput, match="cannot be written"):
        write_exr(tmp_path / "none" / "x.exr", np.ones((2, 2, 3)), ("R", "G", "B"))
    with pytest.raises(BadInput, match="no such file, expected an EXR file"):
        read_exr(tmp_path / "x.exr")
    (tmp_path / "y.exr").write_bytes(b"nothing")
    with pytest.raises(BadInput, match="not a readable OpenEXR"):
        read_exr(tmp_path / "y.exr")
    assert [entry.name for entry in tmp_path.iterdir()] == ["y.exr"]
