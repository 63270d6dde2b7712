"""In-out terms: the decomposition against the dense one and the theory, and the published counts."""

import math
from dataclasses import dataclass, replace

import pytest
import torch
from refusals import refused

from homofact.brdf.analytic import Lambert, Phong, TorranceSparrow, Ward
from homofact.brdf.source import open_source
from homofact.brdf.symmetry import Symmetry, find_symmetry
from homofact.geometry.directions import draw_uniform
from homofact.theory.half_curve import half_angle_curve
from homofact.theory.in_out import DirectionGrid, count_for_share, decompose
from homofact.theory.reflection import phong_filter
from homofact.theory.terms import (
    half_angle_terms,
    mirror_terms,
    phong_terms,
    predicted_terms,
    settled_decomposition,
)

EVEN = Symmetry(isotropic=True, reciprocal=True, mirrored=True, half_turn=True)
HORIZON = math.pi / 2


@dataclass(frozen=True)
class Kernel:
    """(s+1)/2π max(0, R·L)^s on the whole sphere, or turned by an angle so that it is not left-right symmetric."""

    exponent: float
    twist: float = 0.0
    channels: tuple[str, ...] = ("Y",)
    nbytes: int = 4
    fetches: int = 0

    def evaluate(self, wi: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
        cos, sin = math.cos(self.twist), math.sin(self.twist)
        turned = torch.stack((cos * wo[:, 0] - sin * wo[:, 1], sin * wo[:, 0] + cos * wo[:, 1], wo[:, 2]), 1)
        cosine = 2 * wi[:, 2:] * turned[:, 2:] - (wi * turned).sum(1, keepdim=True)
        return (self.exponent + 1) / (2 * math.pi) * cosine.clamp(0, 1) ** self.exponent


def torrance_sparrow(sigma: float) -> TorranceSparrow:
    return TorranceSparrow((0.0,), (1.0,), sigma, channels=("Y",))


@pytest.mark.parametrize("exponent", [1, 10, 30])
def test_on_the_sphere_the_values_are_phongs_spectrum(exponent: int) -> None:
    """Mahajan et al., eq. 9: F_l, 2l+1 times each; asked for within 1% for the leading 25."""
    found = decompose(Kernel(exponent), DirectionGrid(64, 96, math.pi), EVEN).values()[:25]
    degree = torch.arange(6)
    theory = phong_filter(5, exponent).abs().repeat_interleave(2 * degree + 1).sort(descending=True).values[:25]
    kept = theory > 1e-6
    # s = 1 has a kink at the edge of its lobe, that quadrature feels.
    bound = 1e-2 if exponent == 1 else 1e-10
    assert float((found / theory - 1)[kept].abs().max()) < bound


def test_a_kernel_that_is_turned_keeps_its_values_and_needs_the_whole_turn() -> None:
    straight = decompose(Kernel(8), DirectionGrid(24, 48, 1.2), EVEN)
    turned = decompose(Kernel(8, 0.6), DirectionGrid(24, 48, 1.2), replace(EVEN, mirrored=False))
    assert torch.allclose(straight.values()[:60], turned.values()[:60], atol=1e-12)
    wi, wo = near_the_normal(50, 1.2)
    assert torch.allclose(turned.truncated(10_000).signed(wi, wo), Kernel(8, 0.6).evaluate(wi, wo), atol=1e-5)


def near_the_normal(count: int, limit: float) -> tuple[torch.Tensor, torch.Tensor]:
    wi, wo = draw_uniform(8 * count, torch.Generator().manual_seed(0))
    inside = (wi[:, 2] > math.cos(limit)) & (wo[:, 2] > math.cos(limit))
    return wi[inside][:count], wo[inside][:count]


def test_the_blocks_are_the_dense_matrix() -> None:
    """The same grid, the same values: isotropy is exploited, not assumed away."""
    model, grid = torrance_sparrow(0.4), DirectionGrid(10, 21, 1.3)
    blocks = decompose(model, grid, EVEN)
    dense = decompose(model, grid, replace(EVEN, isotropic=False))
    assert not dense.isotropic
    assert blocks.isotropic
    assert torch.allclose(blocks.values(), dense.values(), atol=1e-12)
    wi, wo = near_the_normal(40, 1.3)
    for terms in (1, 3, 8):
        assert torch.allclose(blocks.truncated(terms).signed(wi, wo), dense.truncated(terms).signed(wi, wo), atol=1e-9)


def test_the_error_of_a_truncation_is_the_energy_that_it_leaves_out() -> None:
    """Eckart and Young, on random directions that no node is at."""
    limit = math.radians(80)
    model = Ward((0.2,), (0.2,), 0.3, 0.5, channels=("Y",))
    for reflectance, grid in (
        (torrance_sparrow(0.3), DirectionGrid(36, 108, limit)),
        (model, DirectionGrid(14, 28, limit)),
    ):
        found = decompose(reflectance, grid)
        assert found.isotropic is (reflectance is not model)
        wi, wo = near_the_normal(4000, limit)
        exact = reflectance.evaluate(wi, wo)
        energy = found.values() ** 2
        for terms in (1, 4, 16):
            left_out = float(energy[terms:].sum() / energy.sum())
            error = float(((found.truncated(terms).signed(wi, wo) - exact) ** 2).sum() / (exact**2).sum())
            assert error == pytest.approx(left_out, rel=0.2)
    cut = decompose(torrance_sparrow(0.3), DirectionGrid(24, 72, limit)).truncated(5)
    assert (cut.fetches, cut.nbytes, cut.channels) == (10, 4 * 2 * 5 * 24 * 72, ("Y",))
    values = cut.evaluate(wi, wo)
    assert float(values.min()) == 0 > float(cut.signed(wi, wo).min())
    down = wo * torch.tensor([1.0, 1.0, -1.0], dtype=torch.float64)
    assert float(cut.evaluate(wi, down).abs().max()) == 0


def test_a_pair_that_would_be_split_is_left_out() -> None:
    found = decompose(torrance_sparrow(0.3), DirectionGrid(20, 60, 1.3))
    assert found.multiplicity[0, :2].tolist() == [1, 2]
    wi, wo = near_the_normal(20, 1.3)
    assert torch.equal(found.truncated(2).signed(wi, wo), found.truncated(1).signed(wi, wo))
    assert not torch.equal(found.truncated(3).signed(wi, wo), found.truncated(1).signed(wi, wo))


def test_channels_have_terms_of_their_own_and_one_mean() -> None:
    model = Phong((0.3, 0.2, 0.1), (0.4, 0.0, 0.4), 8.0)
    grid = DirectionGrid(20, 60, HORIZON)
    found, mean = decompose(model, grid), decompose(model, grid, mean=True)
    assert found.channels == ("R", "G", "B")
    assert found.count(0.99, 1) == 1 < found.count(0.99, 0)
    assert float(found.sigma[1, 0]) == pytest.approx(2 * 0.2, rel=1e-9)  # ρd/π times the solid angle 2π
    assert mean.channels == ("mean",)
    wi, wo = near_the_normal(10, HORIZON)
    whole = mean.truncated(10_000).signed(wi, wo)
    assert torch.allclose(whole, model.evaluate(wi, wo).mean(1, keepdim=True), atol=1e-3)


def test_slopes_of_phong() -> None:
    """5 s and 2.5 s in the paper, 4.6 s and 2.3 s in the limit; 2.5 s = 75 terms for s = 30, about 50 for 20."""
    exponents = (20, 40, 60, 80, 100)
    for limit, low, high in ((math.pi, 4.4, 5.6), (HORIZON, 2.2, 2.8)):
        counts = [decompose(Kernel(s), DirectionGrid(72, 96, limit), EVEN).count(0.99) for s in exponents]
        s, k = torch.tensor(exponents).double(), torch.tensor(counts).double()
        slope = float(((s - s.mean()) * (k - k.mean())).sum() / ((s - s.mean()) ** 2).sum())
        assert low < slope < high
        if limit == HORIZON:
            assert counts[0] == pytest.approx(50, abs=2)
    assert decompose(Kernel(30), DirectionGrid(56, 96, HORIZON), EVEN).count(0.99) == pytest.approx(75, abs=2)


def test_counts_from_the_spectrum() -> None:
    assert mirror_terms(phong_filter(80, 30)) == decompose(Kernel(30), DirectionGrid(64, 96, math.pi), EVEN).count(0.99)
    assert phong_terms(100) == pytest.approx(460.517, abs=1e-3)
    assert phong_terms(100, hemisphere=True) == pytest.approx(230.259, abs=1e-3)
    assert mirror_terms(phong_filter(400, 2000)) / 2000 == pytest.approx(math.log(100), rel=0.01)
    # l* = √(2 ln 100)/σ − 1 of a narrow Gaussian curve: 57.6 and 14.4 terms.
    for sigma, terms in ((0.2, 58), (0.4, 14)):
        assert half_angle_terms(math.sqrt(2 * math.log(100)) / sigma - 1) == terms
    assert half_angle_terms(0.0) == 1


def test_torrance_sparrow_as_the_paper_says() -> None:
    """Directions up to 85°: K near 60 for σ = .2, 10 to 20 for .4, a line in l*² with the slope beside 1/4."""
    found = {sigma: predicted_terms(torrance_sparrow(sigma)) for sigma in (0.15, 0.2, 0.25, 0.3, 0.4)}
    assert found[0.2].measured == pytest.approx(60, abs=5)
    assert 10 <= found[0.4].measured <= 20
    x = torch.tensor([each.l_star**2 for each in found.values()])
    y = torch.tensor([float(each.measured) for each in found.values()])
    assert float(torch.corrcoef(torch.stack((x, y)))[0, 1]) ** 2 > 0.98
    slope = float(((x - x.mean()) * (y - y.mean())).sum() / ((x - x.mean()) ** 2).sum())
    assert slope == pytest.approx(0.25, abs=0.04)
    assert all(each.settled for each in found.values())
    # Grazing directions have no end of terms.
    counts = [predicted_terms(torrance_sparrow(0.2), limit=math.radians(d)).measured for d in (60, 85, 90)]
    assert counts[0] < counts[1] < counts[2]


def test_the_curve_is_the_models_own_where_it_is_one_of_the_half_angle() -> None:
    curve = half_angle_curve(torrance_sparrow(0.3))
    inside = curve.theta_h < math.radians(85)
    exact = torch.exp(-((curve.theta_h / 0.3) ** 2)) / (4 * math.pi * 0.09)
    assert torch.allclose(curve.values[inside], exact[inside], atol=1e-12)
    assert float(curve.weights.sum()) == pytest.approx(1)
    energy = (curve.spectrum(60) ** 2).sum()
    # Parseval on the whole sphere, both halves alike.
    assert float(energy) == pytest.approx(float(4 * math.pi * (curve.weights * curve.values**2).sum()), rel=1e-6)
    assert curve.l_star() + 1 == pytest.approx(math.sqrt(2 * math.log(100)) / 0.3, rel=0.05)


def test_lambert_is_one_term() -> None:
    found = predicted_terms(Lambert((0.5, 0.4, 0.3)))
    assert (found.predicted, found.measured, found.settled) == (1, 1, True)
    assert found.l_star == 0


def test_symmetries_are_found() -> None:
    assert find_symmetry(torrance_sparrow(0.2)) == EVEN
    assert find_symmetry(Ward((0.2,), (0.2,), 0.1, 0.3, channels=("Y",))) == replace(EVEN, isotropic=False)
    kernel = find_symmetry(Kernel(5, 0.6))
    assert (kernel.isotropic, kernel.mirrored) == (True, False)


def test_a_lobe_too_sharp_for_the_grids_is_said_to_be() -> None:
    sharp = torrance_sparrow(0.03)
    _, settled = settled_decomposition(sharp, 0.99)
    assert not settled
    # The curve itself is known to be too sharp at its own highest order.
    curve = half_angle_curve(sharp)
    assert curve.l_star(0.99, 60) == 60
    assert curve.l_star(0.99) + 1 == pytest.approx(math.sqrt(2 * math.log(100)) / 0.03, rel=0.03)


@pytest.mark.slow
def test_a_paint_needs_fewer_terms_for_less_of_its_energy(real_data) -> None:
    reflectance = open_source(str(real_data / "rgl" / "vch_golden_yellow_rgb.bsdf"), count=100).reflectance
    high, low = (predicted_terms(reflectance, share, math.radians(60)) for share in (0.99, 0.9))
    assert low.measured < high.measured
    assert low.l_star < high.l_star


@pytest.mark.parametrize(
    ("call", "expected"),
    [
        (lambda: predicted_terms(Lambert((0.5,), channels=("Y",)), share=0.0), "share: found 0.0, expected between"),
        (lambda: predicted_terms(Lambert((0.5,), channels=("Y",)), limit=2.0), "limit: found 114.592 degrees"),
        (lambda: predicted_terms(Lambert((0.0,), channels=("Y",))), "no energy at any order"),
        (lambda: DirectionGrid(8, 16, 4.0), "limit: found 229.183 degrees, expected above 0 and at most 180"),
        (lambda: DirectionGrid(1, 16, 1.0), "grid: found 1 rings of 16, expected at least 2 of 4"),
        (lambda: count_for_share(torch.zeros(3), 0.5), "0 everywhere, expected some energy"),
        (lambda: decompose(Kernel(2), DirectionGrid(4, 8, 1.0)).truncated(0), "terms: found 0, expected at least 1"),
        (lambda: decompose(Kernel(math.nan), DirectionGrid(4, 8, 1.0), EVEN), "values that are not finite"),
    ],
)
def test_what_cannot_be_meant_is_refused(call, expected: str) -> None:
    with refused(expected):
        call()


@pytest.mark.parametrize(("hemisphere", "count"), [(True, 1 + 2 + 3), (False, 1 + 3 + 5)])
def test_a_degree_counts_as_often_as_it_has_orders(hemisphere: bool, count: int) -> None:
    assert mirror_terms(torch.ones(3, dtype=torch.float64), share=0.999, hemisphere=hemisphere) == count
