"""Metrics of pictures: perfection, hand-computed values, order, and what is said where a library is missing."""

import math
import sys

import pytest
import torch
from torch import Tensor

from homofact.brdf.analytic import Lambert
from homofact.errors import BadInput, MissingDependency
from homofact.evaluation.judging import chosen_metrics
from homofact.evaluation.metric_table import METRICS
from homofact.rendering.sphere import render_sphere
from homofact.rendering.tonemap import choose_exposure, displayed, tonemap

PICTURE = {name: metric.formula for name, metric in METRICS.items() if metric.computed_from == "picture"}
BEST = {"psnr": math.inf, "ssim": 1.0, "ciede2000": 0.0, "delta_e_itp": 0.0, "flip": 0.0}


def sphere(*albedo: float) -> tuple[Tensor, Tensor]:
    image = render_sphere(Lambert(albedo), size=48)
    return displayed(image, 0.8), image.coverage > 0


def flat(level: float, *rest: float) -> Tensor:
    return torch.tensor((level, *(rest or (level, level))), dtype=torch.float64).expand(16, 16, 3).contiguous()


EVERYWHERE = torch.ones(16, 16, dtype=torch.bool)


@pytest.mark.parametrize("name", PICTURE)
def test_a_picture_is_its_own_best(name: str) -> None:
    picture, mask = sphere(0.8, 0.5, 0.2)
    assert PICTURE[name](picture, picture.clone(), mask) == pytest.approx(BEST[name], abs=1e-9)
    black = flat(0.0)
    assert PICTURE[name](black, black.clone(), EVERYWHERE) == pytest.approx(BEST[name], abs=1e-9)


@pytest.mark.parametrize("name", PICTURE)
def test_more_noise_is_worse(name: str) -> None:
    picture, mask = sphere(0.8, 0.5, 0.2)
    noise = torch.randn(picture.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    found = [PICTURE[name](picture, (picture + a * noise).clamp(0, 1), mask) for a in (0.01, 0.05, 0.2)]
    assert found == sorted(found, reverse=name in ("psnr", "ssim"))
    assert len(set(found)) == 3


def test_values_by_hand() -> None:
    # MSE 0.01 is 20 dB; SSIM of flat pictures is its luminance part; L* of linear greys is CIE's.
    one, two = flat(0.5), flat(0.6)
    assert PICTURE["psnr"](one, two, EVERYWHERE) == pytest.approx(20.0, abs=1e-6)
    luminance = (2 * 0.5 * 0.6 + 0.01**2) / (0.5**2 + 0.6**2 + 0.01**2)
    assert PICTURE["ssim"](one, two, EVERYWHERE) == pytest.approx(luminance, rel=1e-6)

    def lightness(encoded: float) -> float:
        return 116 * (((encoded + 0.055) / 1.055) ** 2.4) ** (1 / 3) - 16

    low, high = lightness(0.5), lightness(0.6)
    middle = (low + high) / 2 - 50
    weight = 1 + 0.015 * middle**2 / math.sqrt(20 + middle**2)
    assert PICTURE["ciede2000"](one, two, EVERYWHERE) == pytest.approx((high - low) / weight, rel=1e-3)


def test_delta_e_itp_of_greys_is_720_times_the_pq_step() -> None:
    # BT.2124: a grey has no T and P, and I is the PQ code (SMPTE ST 2084) of its luminance.
    def pq(encoded: float) -> float:
        y = (100 * ((encoded + 0.055) / 1.055) ** 2.4 / 10_000) ** 0.1593017578125
        return ((0.8359375 + 18.8515625 * y) / (1 + 18.6875 * y)) ** 78.84375

    expected = 720 * (pq(0.6) - pq(0.5))
    assert PICTURE["delta_e_itp"](flat(0.5), flat(0.6), EVERYWHERE) == pytest.approx(expected, rel=2e-3)


def test_only_the_masks_pixels_count() -> None:
    one, two = flat(0.5), flat(0.5)
    two[:8] = 0.9
    below = torch.zeros(16, 16, dtype=torch.bool)
    below[8:] = True
    for name in ("psnr", "ciede2000", "delta_e_itp"):
        assert PICTURE[name](one, two, below) == pytest.approx(BEST[name], abs=1e-9)
        assert PICTURE[name](one, two, EVERYWHERE) != pytest.approx(BEST[name], abs=1e-3)


def test_flip_of_black_and_white_is_nearly_1() -> None:
    black, white = torch.zeros(64, 64, 3).double(), torch.ones(64, 64, 3).double()
    inner = torch.zeros(64, 64, dtype=torch.bool)
    inner[24:40, 24:40] = True
    # Andersson et al. map black against white to the end of the scale; colour alone, away from the border.
    assert 0.9 < PICTURE["flip"](black, white, inner) <= 1.0


@pytest.mark.parametrize("name", PICTURE)
def test_pictures_that_cannot_be_compared(name: str) -> None:
    metric = PICTURE[name]
    with pytest.raises(BadInput, match="fit picture: shape"):
        metric(flat(0.5), flat(0.5)[:8], EVERYWHERE)
    with pytest.raises(BadInput, match=r"fit picture: values outside \[0, 1\]"):
        metric(flat(0.5), flat(1.5), EVERYWHERE)
    with pytest.raises(BadInput, match="mask: found no pixels"):
        metric(flat(0.5), flat(0.5), ~EVERYWHERE)


def test_ssim_wants_room_for_its_window() -> None:
    small = flat(0.5)[:10]
    with pytest.raises(BadInput, match="at least 11 × 11"):
        PICTURE["ssim"](small, small, EVERYWHERE[:10])


@pytest.mark.parametrize(("name", "module"), [("ssim", "skimage.metrics"), ("flip", "flip_evaluator")])
def test_a_missing_library_is_named_with_its_extra(name: str, module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingDependency, match=r"pip install 'homofact\[metrics\]'"):
        PICTURE[name](flat(0.5), flat(0.5), EVERYWHERE)
    with pytest.raises(MissingDependency, match="is not installed"):
        chosen_metrics(("ciede2000", name))
    assert chosen_metrics(("delta_e_itp", "max", "ciede2000", "max")) == ("delta_e_itp", "max", "ciede2000")


def test_displayed_is_the_picture_before_rounding() -> None:
    image = render_sphere(Lambert((0.9, 0.5, 0.1)), size=32)
    exposure = 2 * choose_exposure(image)
    exact = displayed(image, exposure)
    assert torch.equal((exact * 255).round().to(torch.uint8), tonemap(image, exposure).pixels)
    assert float(exact.max()) == pytest.approx(1.0, abs=1e-12)
    with pytest.raises(BadInput, match="exposure"):
        displayed(image, 0.0)
