"""Comparison pictures: what the numbers in them mean, that text stays inside, and that files are whole."""

from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from refusals import refused

from homofact.brdf.channels import display_of
from homofact.brdf.quality.extrapolation import Extrapolation
from homofact.brdf.scattered import interpolated_samples
from homofact.brdf.source import open_source
from homofact.errors import BadInput
from homofact.figures.compare_picture import (
    LIGHTS,
    FitPanel,
    _bar,
    _coloured,
    _row,
    compare_picture,
    relative_difference,
)
from homofact.figures.lit_picture import drawn_sphere
from homofact.files.atomic import replace_file
from homofact.rendering.sphere import SphereImage, render_sphere
from homofact.rendering.tonemap import automatic_exposure, tonemap

SYNTHETIC = Path(__file__).parents[2] / "data_synthetic" / "synthetic_cornell.brdf"


class Wrong:
    """A source that runs away beyond its measurement."""

    nbytes = 12
    fetches = 0

    def __init__(self, source):
        self.source, self.channels = source, source.channels
        samples = interpolated_samples(source)
        assert samples is not None
        self.beyond = Extrapolation(samples)

    def evaluate(self, wi, wo):
        values = self.source.evaluate(wi, wo)
        return torch.where(self.beyond.measured(wi, wo)[:, None], values, values + 1000.0)


class Grey:
    channels = ("R", "G", "B")
    nbytes = 12
    fetches = 0

    def __init__(self, albedo):
        self.albedo = albedo

    def evaluate(self, wi, wo):
        return torch.full((wi.shape[0], 3), self.albedo / torch.pi, dtype=torch.float64)


def test_difference_is_relative_with_a_twentieth_of_white():
    source = SphereImage(torch.full((1, 3, 3), 0.5).double(), torch.ones(1, 3).double())
    fit = SphereImage(torch.full((1, 3, 3), 0.6).double(), torch.ones(1, 3).double())
    source.radiance[0, 1], fit.radiance[0, 1] = 0, 0
    source.radiance[0, 2], fit.radiance[0, 2] = 1e-5, 4e-5
    difference = relative_difference(fit, source, 2.0)
    # White is 1/2, its twentieth 0.025.
    assert float(difference[0, 0]) == pytest.approx(0.1 / 0.525)
    # Nothing is left in the picture of the others.
    assert difference[0, 1:].isnan().all()


def test_picture_shows_every_sphere_pixel_for_pixel_and_no_panel_is_empty(tmp_path):
    path = tmp_path / "compare.png"
    fits = [FitPanel("too bright", Grey(0.55), ["a caption", "another"]), FitPanel("the same", Grey(0.5))]
    reports = compare_picture(path, ("source", Grey(0.5)), fits, size=64)
    assert [report.light for report in reports] == list(LIGHTS)
    assert {report.curve for report in reports} == {"filmic"}
    # A tenth too bright is at most 9.5% of source and floor.
    for report in reports:
        assert 0.08 < report.ranges[0] <= 0.1 / 1.05
        assert report.ranges[1] == 0
    assert [len(report.clipped) for report in reports] == [3] * 3
    assert reports[0].clipped[0] == 0
    page = np.asarray(Image.open(path).convert("RGB")).astype(int)
    # Panels are at least 150 wide with 16 between: source, and twice a fit and its difference.
    assert page.shape[1] == 5 * 166 + 16
    # A title, then for each light a line of words, the spheres, a bar, a line with its ends, a line with the range.
    top = 8 + 18
    for _ in LIGHTS:
        top += 6 + 18 + 4
        source, bright, red, same, white = (page[top : top + 64, 16 + k * 166 : 16 + k * 166 + 64] for k in range(5))
        np.testing.assert_array_equal(source, same)
        if top == 8 + 18 + 6 + 18 + 4:
            image = render_sphere(Grey(0.5), size=64)
            assert reports[0].exposure == pytest.approx(automatic_exposure(image))
            np.testing.assert_array_equal(source, tonemap(image, reports[0].exposure, curve="filmic").pixels.numpy())
        assert (bright[24, 40] > source[24, 40]).all()
        assert red[24, 40, 0] > red[24, 40, 2] + 60
        assert white[24, 40].min() > 235
        for panel in (source, bright, red, same, white):
            assert len(np.unique(panel.reshape(-1, 3), axis=0)) > 1
        bar = page[top + 64 + 4 + 2, 16 + 2 * 166 : 16 + 2 * 166 + 64]
        assert bar[0, 2] > bar[0, 0]
        assert bar[-1, 0] > bar[-1, 2]
        top += 64 + 4 + 8 + 1 + 18 + 18
    assert [entry.name for entry in tmp_path.iterdir()] == ["compare.png"]


def test_all_differences_share_one_scale_on_which_small_errors_are_seen():
    values = np.array([[-5.0, -1.0, -0.1, -0.01, 0.0, 0.01, 0.1, 1.0, 5.0, np.nan]])
    drawn = _coloured(values)[0]
    red, blue = drawn[:9, 0] - drawn[:9, 2], drawn[:9, 2] - drawn[:9, 0]
    # The ends hold all beyond; between them each error has its own colour, the opposite one the opposite.
    np.testing.assert_array_equal(drawn[0], drawn[1])
    np.testing.assert_array_equal(drawn[7], drawn[8])
    assert red[5] > 0.02 > red[4]
    assert red[6] > 3 * red[5]
    assert blue[3] > 0.02
    assert blue[2] > 3 * blue[3]
    assert drawn[4].min() > 0.95
    assert len(set(drawn[9])) == 1
    bar = _bar(201)
    marks = np.flatnonzero((np.abs(bar[0] - 0.2) < 1e-9).all(1))
    # asinh(0.01/0.02)/asinh(1/0.02) of half of the width, and asinh(0.1/0.02)/asinh(1/0.02).
    np.testing.assert_array_equal(marks, [50, 90, 110, 150])
    for mark, value in zip(marks + 1, (-0.1, -0.01, 0.01, 0.1), strict=True):
        np.testing.assert_allclose(bar[0, mark], _coloured(np.array([[value]]))[0, 0], atol=0.04)


def test_the_range_below_holds_all_but_a_few_pixels():
    source = SphereImage(torch.full((20, 20, 3), 0.5).double(), torch.ones(20, 20).double())
    fit = SphereImage(torch.full((20, 20, 3), 0.55).double(), torch.ones(20, 20).double())
    fit.radiance[0, :6] = 5.0
    row = _row("sky", [source, fit], None)
    (known,) = row.report.ranges
    assert 0.08 < known < 0.1
    # With three times as many it holds no longer.
    fit.radiance[0] = 5.0
    assert _row("sky", [source, fit], None).report.ranges[0] > 1


@pytest.mark.slow
def test_long_words_stay_on_the_page(tmp_path):
    path = tmp_path / "compare.png"
    long = "a-title-without-any-space-" * 6
    compare_picture(path, (long, Grey(0.5)), [FitPanel(long, Grey(0.4), [long, "$x_1$ many words " * 20])], size=32)
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


def test_the_exposure_is_the_sources(tmp_path):
    first = compare_picture(tmp_path / "a.png", ("s", Grey(0.5)), [FitPanel("f", Grey(0.1))], size=32)
    other = compare_picture(tmp_path / "b.png", ("s", Grey(0.5)), [FitPanel("f", Grey(30.0))], size=32)
    assert [each.exposure for each in first] == [each.exposure for each in other]
    assert other[0].clipped[1] > 0.3


def test_the_hatching_is_the_same_in_source_fit_and_difference():
    source, fit = (render_sphere(Grey(albedo), size=48) for albedo in (0.5, 0.9))
    counted, drawn = torch.zeros(48, 48, dtype=torch.bool), torch.zeros(48, 48, dtype=torch.bool)
    drawn[10:40, 10:40] = True
    row, plain = _row("sky", [source, fit], (counted, drawn)), _row("sky", [source, fit], None)
    assert (row.report.ranges, row.report.beyond) == (plain.report.ranges, 0.0)
    lines = [(picture == 0.85).all(2) for picture in (*row.shown, *row.differences)]
    assert lines[0].sum() > 200
    assert len(lines) == 3
    for each in lines:
        np.testing.assert_array_equal(each, lines[0])
    for picture, bare in zip((*row.shown, *row.differences), (*plain.shown, *plain.differences), strict=True):
        # Where nothing was hatched the picture is as it was, and under the veil it can still be seen.
        np.testing.assert_array_equal(picture[~drawn.numpy()], bare[~drawn.numpy()])
        under = drawn.numpy() & ~lines[0]
        assert np.corrcoef(picture[under].ravel(), bare[under].ravel())[0, 1] > 0.99


@pytest.mark.slow
@pytest.mark.parametrize("channels", ["rgb", "luminance", "spectral"])
def test_what_was_not_measured_is_hatched_and_counts_in_no_range(tmp_path, channels):
    samples = open_source(str(SYNTHETIC), channels=channels)
    fit, size = Wrong(samples.reflectance), 48
    reports = compare_picture(
        tmp_path / "c.png",
        ("paint", samples.reflectance),
        [FitPanel("fit", fit)],
        size=size,
        to_rgb=display_of(samples.reflectance.channels),
    )
    assert all(report.beyond is not None and 0.01 < report.beyond < 0.5 for report in reports)
    # The fit is wrong by thousands where nothing was measured, and there alone.
    assert reports[0].ranges[0] <= 0.005
    page = np.asarray(Image.open(tmp_path / "c.png").convert("RGB")).astype(int)
    # Lines of the hatching in source, fit, and difference.
    lines = (page == round(255 * 0.85)).all(2)
    assert min(lines[:, left : left + size].sum() for left in (16, 182, 348)) > 15
    model = compare_picture(tmp_path / "d.png", ("model", Grey(0.5)), [FitPanel("fit", Grey(0.5))], size=32)
    assert [report.beyond for report in model] == [None] * 3


def test_sphere_picture_is_the_tone_mapped_render_and_says_how(tmp_path):
    drawn = drawn_sphere(Grey(0.5), size=40, exposure=1.0)
    drawn.write(tmp_path / "ball.png")
    picture = Image.open(tmp_path / "ball.png")
    x = float(render_sphere(Grey(0.5), size=40).radiance[20, 20, 0])
    bent = x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)
    code = round(255 * (1.055 * bent ** (1 / 2.4) - 0.055))
    assert np.asarray(picture)[20, 20].tolist() == [code] * 3
    words = picture.info["Description"]
    for part in ("Exposure 1", "D65", "directional light", "filmic curve"):
        assert part in words
    assert drawn.report.clipped == 0
    image = render_sphere(Grey(0.5), size=40)
    assert drawn_sphere(Grey(0.5), size=40, stops=1.0).report.exposure == pytest.approx(2 * automatic_exposure(image))


def test_no_fits_and_no_place(tmp_path):
    with refused(where="comparison picture", found="no fits"):
        compare_picture(tmp_path / "x.png", ("s", Grey(0.5)), [])
    with pytest.raises(BadInput, match="cannot be written"):
        drawn_sphere(Grey(0.5), size=16).write(tmp_path / "missing" / "x.png")
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
