"""The sRGB curve by its published points, one exposure, coverage and the gamut."""

import pytest
import torch

from homofact.brdf.materials import material
from homofact.errors import BadInput
from homofact.rendering.sphere import SphereImage, render_sphere
from homofact.rendering.tonemap import (
    DEFAULT_CURVE,
    automatic_exposure,
    choose_exposure,
    choose_middle,
    displayed,
    encode_srgb,
    tonemap,
)


def flat(level, channels=3, side=10, coverage=1.0):
    radiance = torch.full((side, side, channels), float(level), dtype=torch.float64)
    return SphereImage(radiance, torch.full((side, side), coverage, dtype=torch.float64))


def test_curve_at_its_published_points():
    # IEC 61966-2-1: 0.0031308 is 12.92 times itself; 18% grey is 0.4613561, code 118.
    encoded = encode_srgb(torch.tensor([0.0, 0.0031308, 0.18, 1.0, 7.0, -1.0], dtype=torch.float64))
    expected = torch.tensor([0, 0.04044994, 0.46135613, 1, 1, 0], dtype=torch.float64)
    torch.testing.assert_close(encoded, expected, atol=1e-6, rtol=0)


def test_exposure_takes_the_brightest_hundredth_to_nine_tenths():
    image = flat(0)
    image.radiance[..., 1] = torch.arange(100).reshape(10, 10) / 10
    expected = 0.9 / float(torch.quantile(image.radiance[..., 1].flatten(), 0.99))
    assert choose_exposure(image) == pytest.approx(expected)
    assert choose_exposure(flat(0)) == 1
    # One lit pixel only: the percentile is 0, the maximum is not.
    image = flat(0, side=40)
    image.radiance[3, 3, 0] = 2
    assert choose_exposure(image) == pytest.approx(0.45)


def test_uncovered_pixels_do_not_count():
    image = flat(1)
    image.radiance[0] = 50
    image.coverage[0] = 0
    assert choose_exposure(image) == pytest.approx(0.9)
    shown = tonemap(image, 0.9, background=0.0)
    assert shown.clipped == 0
    assert shown.pixels[0].max() == 0


def test_clipped_share_counts_pixels_over_and_under():
    image = flat(0.5)
    image.radiance[0, :4, 2] = 1.5
    image.radiance[1, :3, 0] = -0.1
    assert tonemap(image, 1.0).clipped == pytest.approx(0.07)
    assert tonemap(image, 0.5).clipped == pytest.approx(0.03)


def test_coverage_blends_in_linear_light_after_the_clip():
    shown = tonemap(flat(40, coverage=0.5), 1.0, background=0.0)
    assert shown.pixels.unique().tolist() == [round(float(encode_srgb(torch.tensor(0.5))) * 255)]


def test_one_channel_is_grey():
    shown = tonemap(flat(0.18, 1), 1.0)
    assert tuple(shown.pixels.shape) == (10, 10, 3)
    assert shown.pixels.unique().tolist() == [118]


@pytest.mark.parametrize("exposure", [0.0, -1.0, float("nan"), float("inf")])
def test_bad_exposure(exposure):
    with pytest.raises(BadInput, match="exposure: found"):
        tonemap(flat(1), exposure)


def test_middle_exposure_ignores_highlights_and_shadows():
    image = flat(0.5)
    image.radiance[0] = 1e4
    image.radiance[1] = 0
    assert choose_middle(image) == pytest.approx(0.18 / 0.5)
    assert choose_exposure(image) < 1e-3
    assert choose_middle(flat(0)) == 1
    # Most of it unlit: what is lit decides.
    image.radiance[1:8] = 0
    assert choose_middle(image) == pytest.approx(0.18 / 0.5)


def test_filmic_curve():
    # Narkowicz's formula by hand at 0.18 and 1, and white from 7.24 on.
    for level, expected in ((0.18, 0.2671), (1.0, 2.54 / 3.16), (7.25, 1.0), (1e6, 1.0), (0.0, 0.0), (-1.0, 0.0)):
        shown = displayed(flat(level), 1.0, curve="filmic")
        assert float(shown[0, 0, 0]) == pytest.approx(float(encode_srgb(torch.tensor(expected))), abs=2e-3)
    assert tonemap(flat(7.0), 1.0, curve="filmic").clipped == 0
    assert tonemap(flat(7.5), 1.0, curve="filmic").clipped == 1
    assert tonemap(flat(-0.1), 1.0, curve="filmic").clipped == 1
    with pytest.raises(BadInput, match="tonemap: found 'aces', expected one of srgb, filmic"):
        tonemap(flat(1.0), 1.0, curve="aces")


def body_and_highlight(body, highlight):
    """A hundred pixels, five of them a highlight: the 99th percentile lies in it."""
    image = flat(body)
    image.radiance[0, :5] = highlight
    return image


@pytest.mark.parametrize("highlight", [0.5, 1.25, 5.0, 20.0, 1000.0])
def test_automatic_exposure_of_a_given_median_and_highlight(highlight):
    """The median goes to 0.18 (5/r)^0.3, whatever the unit of radiance."""
    image, ratio = body_and_highlight(0.5, highlight), highlight / 0.5
    found = automatic_exposure(image)
    assert 0.5 * found == pytest.approx(0.18 * (5 / ratio) ** 0.3)
    brighter = SphereImage(image.radiance * 64, image.coverage)
    assert automatic_exposure(brighter) == pytest.approx(found / 64)


def test_automatic_exposure_keeps_highlights_below_white_and_the_body_visible():
    image = body_and_highlight(0.01, 0.98)
    assert tonemap(image, automatic_exposure(image), curve=DEFAULT_CURVE).clipped == 0
    image = body_and_highlight(0.01, 1.02)
    assert tonemap(image, automatic_exposure(image), curve=DEFAULT_CURVE).clipped == pytest.approx(0.05)
    # The body beside a highlight 98 times as bright is a dark grey, where the exposure by the highlight blackens it.
    image = body_and_highlight(0.01, 0.98)
    assert tonemap(image, automatic_exposure(image), curve=DEFAULT_CURVE).pixels[5, 5, 0] > 70
    assert tonemap(image, choose_exposure(image)).pixels[5, 5, 0] < 30
    assert automatic_exposure(flat(0)) == 1


@pytest.mark.parametrize(
    ("name", "dullest", "most"), [("lafortune-blue-paint", 120, 0.0), ("cook-torrance-plastic", 90, 0.0)]
)
def test_a_diffuse_paint_is_not_dull_and_a_gloss_is_not_blown_out(name, dullest, most):
    image = render_sphere(material(name).model, size=64)
    shown = tonemap(image, automatic_exposure(image), curve=DEFAULT_CURVE)
    lit = image.radiance.mean(2) > 0
    assert float(shown.pixels.double().mean(2)[lit].median()) > dullest
    assert shown.clipped <= most
    assert shown.pixels.max() > 200
