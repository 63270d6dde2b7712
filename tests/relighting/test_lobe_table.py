"""A separate lobe from its material: both add up, the table holds f at its nodes, and a few terms hold the rest."""

import math

import numpy as np
import pytest
import torch
from relighting_cases import MATT

from homofact.brdf.analytic import AshikhminShirley, Phong
from homofact.brdf.function import FunctionReflectance
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.symmetry import find_symmetry
from homofact.errors import BadInput
from homofact.geometry.directions import draw_uniform
from homofact.relighting.factored_material import ERROR, MOST_SHARED, factored, separated
from homofact.relighting.lobe_table import (
    SIZE,
    STEEPEST,
    TURNED_SIZE,
    TURNS,
    LobeTable,
    Rest,
    half_width,
    lobe_table,
)

ROUND = Phong((0.3, 0.2, 0.1), (0.4,) * 3, 300)
GRAINED = AshikhminShirley((0.3, 0.2, 0.1), (0.5,) * 3, nu=10, nv=100)
GREY = Phong((0.3,), (0.4,), 300, channels=("Y",))


def pairs(count: int = 4000) -> tuple[torch.Tensor, torch.Tensor]:
    """Directions, half of them near the mirror direction."""
    generator = torch.Generator().manual_seed(3)
    wi, wo = draw_uniform(count, generator)
    near = wo * wo.new_tensor((-1, -1, 1)) + 0.1 * torch.randn(count, 3, dtype=torch.float64, generator=generator)
    near = near / near.norm(dim=1, keepdim=True)
    near[:, 2].abs_()
    return torch.where(torch.arange(count)[:, None] < count // 2, near, wi), wo


@pytest.mark.parametrize("material", [ROUND, GRAINED, GREY], ids=["round", "grained", "grey"])
def test_lobe_and_rest_add_up_to_the_material(material: Reflectance) -> None:
    lobe, (wi, wo) = lobe_table(material), pairs()
    whole = lobe.evaluate(wi, wo) + Rest(material, lobe).evaluate(wi, wo)
    assert torch.allclose(whole, material.evaluate(wi, wo).double().expand(-1, 3), rtol=1e-9, atol=1e-12)
    below = wi * wi.new_tensor((1, 1, -1))
    assert not lobe.evaluate(below, wo).any()
    assert not lobe.evaluate(wi, wo * wo.new_tensor((1, 1, -1))).any()


@pytest.mark.parametrize("material", [ROUND, GRAINED], ids=["round", "grained"])
def test_the_lobe_is_most_of_what_is_sharp(material: Reflectance) -> None:
    """Near the mirror direction the rest is a few percent of f, whatever the azimuths of the two."""
    lobe, (wi, wo) = lobe_table(material), pairs()
    bright = (wo[:, 2] > 0.3) & (wi[:, 2] > 0.3)
    f = material.evaluate(wi, wo).double()[bright]
    rest = Rest(material, lobe).evaluate(wi, wo)[bright]
    bright = f.mean(1) > 3 * float(f.mean(1).median())
    assert float(rest[bright].norm() / f[bright].norm()) < 0.06


def test_the_table_holds_f_over_its_least_at_the_nodes() -> None:
    """At the node of h = n: (f − b) cos²θo, b the least f, which of this material is its matt part."""
    lobe = lobe_table(ROUND)
    levels, along, around = SIZE
    assert lobe.values.shape == (levels, 1, along, around, 3)
    theta = STEEPEST * (1 - (1 - np.arange(levels) / (levels - 1)) ** 1.5)
    # Nothing lies below the least f, and under the horizon, where h leans away from the viewer, there is no light.
    assert lobe.values.min() >= -1e-6
    assert not lobe.values[50, 0, -1, -1].any()
    matt = np.array([0.3, 0.2, 0.1]) / math.pi
    for level in (0, 20, 50):
        wo = torch.tensor([[math.sin(theta[level]), 0.0, math.cos(theta[level])]], dtype=torch.float64)
        peak = ROUND.evaluate(wo * wo.new_tensor((-1, 1, 1)), wo)[0].numpy() - matt
        held = lobe.values[level, 0, 0]
        assert held == pytest.approx(np.tile(peak * math.cos(theta[level]) ** 2, (around, 1)), rel=1e-5)
        assert lobe.evaluate(wo * wo.new_tensor((-1, 1, 1)), wo)[0].numpy() == pytest.approx(peak, rel=5e-3)


def test_tails_over_decades_of_slopes_are_held() -> None:
    """Of a lobe that falls as |s|⁻⁴ down to slopes a hundred times its width, within a fiftieth at each."""
    alpha = 0.003

    def ggx(wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        h = wi + wo
        return ((1 + (h[:, 0] ** 2 + h[:, 1] ** 2) / h[:, 2] ** 2 / alpha**2) ** -2.0)[:, None].repeat(3, 1)

    sharp = FunctionReflectance(ggx)
    lobe = lobe_table(sharp)
    wo = torch.tensor([[math.sin(0.5), 0.0, math.cos(0.5)]], dtype=torch.float64)
    for slope in np.geomspace(0.3, 100, 60) * lobe.half_width:
        h = torch.tensor([[0.0, float(slope), 1.0]], dtype=torch.float64)
        h = h / h.norm()
        wi = 2 * (h * wo).sum() * h - wo
        exact = float(ggx(wi.numpy(), wo.numpy()).mean())
        assert float(lobe.evaluate(wi, wo)[0].mean()) == pytest.approx(exact, rel=0.02)


def test_an_isotropic_lobe_that_leans_aside_has_a_whole_circle() -> None:
    """It is brighter on one side of the plane of incidence: not at −hy what it is at hy."""

    def leaning(wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        h = wi + wo
        aside = (wi[:, 0] * wo[:, 1] - wi[:, 1] * wo[:, 0]) / h[:, 2]
        slope = (h[:, 0] ** 2 + h[:, 1] ** 2) / h[:, 2] ** 2
        return (np.exp(-slope / 0.02) * (1 + 0.8 * np.tanh(9 * aside)) + 0.1)[:, None].repeat(3, 1)

    material = FunctionReflectance(leaning)
    lobe, (wi, wo) = lobe_table(material), pairs()
    assert (lobe.whole, lobe.turns, lobe.values.shape[3]) == (True, 1, 2 * SIZE[2] - 1)
    f, near = material.evaluate(wi, wo).double(), (wi[:, 2] > 0.2) & (wo[:, 2] > 0.2)
    assert float((lobe.evaluate(wi, wo) + 0.1 - f)[near].norm() / f[near].norm()) < 0.01


def test_the_width_is_that_of_the_lobe() -> None:
    """Phong's cosⁿ of twice the angle in the plane is half at tan(acos(½^(1/n))/2); the grid is three times it."""
    wide, narrow = (half_width(Phong((0.2,) * 3, (0.4,) * 3, n)) for n in (100, 400))
    assert wide / narrow == pytest.approx(2, rel=0.02)
    along = math.tan(math.acos(0.5 ** (1 / 100)) / 2)
    # Across the plane of incidence it is wider by 1/cosθo: the narrowest counts.
    assert wide == pytest.approx(along, rel=0.03)
    assert lobe_table(Phong((0.2,) * 3, (0.4,) * 3, 100)).width == pytest.approx(3 * wide)
    assert half_width(MATT) == pytest.approx(1)


def test_an_isotropic_lobe_has_one_azimuth_and_a_grained_one_its_period() -> None:
    grained = lobe_table(GRAINED)
    assert (grained.turns, grained.period) == (TURNS, math.pi)
    assert lobe_table(ROUND).turns == 1
    assert (grained.whole, lobe_table(ROUND).whole) == (True, False)
    assert (grained.values[:, 0, ..., 0].shape, lobe_table(ROUND).values[:, 0, ..., 0].shape) == (TURNED_SIZE, SIZE)
    assert find_symmetry(lobe_table(ROUND)).isotropic
    turned = find_symmetry(grained)
    assert (turned.isotropic, turned.half_turn) == (False, True)
    for each, fetches in ((grained, 4), (lobe_table(ROUND), 2)):
        assert (each.fetches, each.nbytes) == (fetches, 4 * each.values.size)


def test_a_view_beyond_the_last_angle_is_raised_to_it() -> None:
    lobe, angles = lobe_table(ROUND), torch.linspace(1.3, 1.56, 20, dtype=torch.float64)
    wi = torch.stack((-angles.sin(), 0 * angles, angles.cos()), 1)
    for theta in (STEEPEST + 1e-4, math.pi / 2 - 1e-5):
        beyond, last = (
            torch.tensor([math.sin(each), 0.0, math.cos(each)], dtype=torch.float64).expand(len(wi), 3)
            for each in (theta, STEEPEST)
        )
        assert torch.allclose(lobe.evaluate(wi, beyond), lobe.evaluate(wi, last), rtol=1e-9, atol=0)
    assert lobe.evaluate(wi, last).max() > 1


@pytest.mark.slow
def test_a_few_terms_hold_the_rest() -> None:
    """Of a lobe that 256 terms do not hold within 5%, one holds the rest within 2%; errors are of the whole light."""
    shared = factored(ROUND, "factored", error=ERROR)
    beside = factored(ROUND, error=ERROR)
    assert shared.lobe is None
    assert shared.factors.terms > MOST_SHARED
    assert beside.lobe is not None
    assert beside.factors.terms <= 4
    assert beside.factors.expected_error <= ERROR
    # The energy is that of the material; the lobe's part of it and the terms' stand beside each other.
    assert beside.factors.energy == pytest.approx(shared.factors.energy, rel=0.02)
    assert 0 < beside.factors.beside < beside.factors.energy
    part = beside.part(ROUND)
    assert isinstance(part, Rest)
    assert shared.part(ROUND) is ROUND


@pytest.mark.slow
def test_when_a_lobe_stands_apart() -> None:
    assert factored(MATT).lobe is None
    assert factored(MATT, "separate").lobe is not None
    assert factored(ROUND, terms=40).lobe is None
    assert factored(ROUND, share=0.99).lobe is None
    assert factored(ROUND, "separate", terms=3).factors.terms == 3
    assert factored(ROUND).lobe is not None


@pytest.mark.slow
def test_the_rest_on_maps_of_several_sizes_is_the_same() -> None:
    small, large = separated(ROUND, (16, 32), terms=2)
    assert (small.factors.view.shape[1], large.factors.view.shape[1]) == (16, 32)
    assert small.lobe is large.lobe
    assert small.factors.first(1).beside == small.factors.beside


@pytest.mark.parametrize(
    ("given", "where"), [({"lobe": "away"}, "lobe"), ({"lobe": "separate", "share": 0.9}, "share")]
)
def test_what_no_rule_is_is_refused(given: dict[str, object], where: str) -> None:
    with pytest.raises(BadInput) as caught:
        factored(ROUND, **given)  # type: ignore[arg-type]
    assert caught.value.where == where


def test_channels_that_are_no_pictures_are_refused() -> None:
    two = Phong((0.3, 0.2), (0.4, 0.4), 300, channels=("A", "B"))
    with pytest.raises(BadInput):
        factored(two, "separate")
    with pytest.raises(BadInput):
        factored(two)


def test_a_table_is_a_reflectance() -> None:
    assert isinstance(lobe_table(ROUND), Reflectance)
    assert isinstance(lobe_table(ROUND), LobeTable)
    assert lobe_table(GREY).channels == GREY.channels * 3
