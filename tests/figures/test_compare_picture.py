"""Comparison pictures: what the numbers in them mean, that text stays inside, and that files are whole."""

import numpy as np
import pytest
import torch
from PIL import Image

from homofact.errors import BadInput
from homofact.figures.compare_picture import compare_picture, relative_difference, sphere_picture
from homofact.files.atomic import replace_file
from homofact.render.sphere import SphereImage, render_sphere


class Grey:
    channels = ("R", "G", "B")
    nbytes = 12
    fetches = 0

    def __init__(self, albedo):
        self.albedo = albedo

    def evaluate(self, wi, wo):
        return torch.full((wi.shape[0], 3), self.albedo / torch.pi, dtype=torch.float64)


def test_difference_is_relative_with_one_percent_of_white():
    source = SphereImage(torch.full((1, 2, 3), 0.5).double(), torch.ones(1, 2).double())
    fit = SphereImage(torch.full((1, 2, 3), 0.6).double(), torch.ones(1, 2).double())
    source.radiance[0, 1], fit.radiance[0, 1] = 0, 0
    difference = relative_difference(fit, source, 2.0)
    # White is 1/2, its hundredth 0.005.
    assert float(difference[0, 0]) == pytest.approx(0.1 / 0.505)
    assert bool(difference[0, 1].isnan())


def test_picture_shows_every_sphere_pixel_for_pixel(tmp_path):
    path = tmp_path / "compare.png"
    fits = [("too bright", Grey(0.55), ["a caption", "another"]), ("the same", Grey(0.5), [])]
    report = compare_picture(path, ("source", Grey(0.5)), fits, size=64)
    assert report.difference_range == 0.1
    assert report.clipped[0] == 0
    assert len(report.clipped) == 3
    page = np.asarray(Image.open(path).convert("RGB")).astype(int)
    # Panels are at least 250 wide with 24 between; the page holds three.
    assert page.shape[1] == 3 * 274 + 24
    # The title is one line and the first sphere starts 12 + 19 pixels from the top.
    centre = page[31 + 32, 24 + 32], page[31 + 32, 24 + 2 * 274 + 32]
    np.testing.assert_array_equal(centre[0], centre[1])
    brighter = page[31 + 32, 24 + 274 + 32]
    assert (brighter > centre[0]).all()
    # Below: red for too bright, near white for no difference.
    red, white = page[31 + 74 + 32, 24 + 274 + 32], page[31 + 74 + 32, 24 + 2 * 274 + 32]
    assert red[0] > red[2] + 60
    assert white.min() > 235
    assert [entry.name for entry in tmp_path.iterdir()] == ["compare.png"]


def test_long_words_stay_on_the_page(tmp_path):
    path = tmp_path / "compare.png"
    long = "a-title-without-any-space-" * 6
    compare_picture(path, (long, Grey(0.5)), [(long, Grey(0.4), [long, "$x_1$ many words " * 20])], size=32)
    page = np.asarray(Image.open(path).convert("RGB"))
    border = np.concatenate(
        (
            page[:3].reshape(-1, 3),
            page[-3:].reshape(-1, 3),
            page[:, :3].reshape(-1, 3),
            page[:, -3:].reshape(-1, 3),
        )
    )
    assert (border == 255).all()


def test_the_exposure_is_the_sources_or_the_given(tmp_path):
    first = compare_picture(tmp_path / "a.png", ("s", Grey(0.5)), [("f", Grey(0.1), [])], size=32)
    other = compare_picture(tmp_path / "b.png", ("s", Grey(0.5)), [("f", Grey(0.9), [])], size=32)
    assert first.exposure == other.exposure
    assert other.clipped[1] > 0.3
    given = compare_picture(tmp_path / "c.png", ("s", Grey(0.5)), [("f", Grey(0.1), [])], size=32, exposure=0.25)
    assert given.exposure == 0.25


def test_sphere_picture_is_the_tone_mapped_render_and_says_how(tmp_path):
    report = sphere_picture(tmp_path / "ball.png", Grey(0.5), size=40, exposure=1.0)
    picture = Image.open(tmp_path / "ball.png")
    radiance = render_sphere(Grey(0.5), size=40).radiance[20, 20, 0]
    code = round(255 * (1.055 * float(radiance) ** (1 / 2.4) - 0.055))
    assert np.asarray(picture)[20, 20].tolist() == [code] * 3
    words = picture.info["Description"]
    for part in ("Exposure 1", "D65", "directional light"):
        assert part in words
    assert report.difference_range is None


def test_no_fits_and_no_place(tmp_path):
    with pytest.raises(BadInput, match="found no fits"):
        compare_picture(tmp_path / "x.png", ("s", Grey(0.5)), [])
    with pytest.raises(BadInput, match="cannot be written"):
        sphere_picture(tmp_path / "missing" / "x.png", Grey(0.5), size=16)
    assert not list(tmp_path.iterdir())


def test_a_failed_write_keeps_the_old_file(tmp_path):
    target = tmp_path / "x.png"
    target.write_text("old")

    def fail(beside):
        beside.write_text("half")
        raise RuntimeError("full")

    with pytest.raises(RuntimeError, match="full"):
        replace_file(target, fail)
    assert target.read_text() == "old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["x.png"]
