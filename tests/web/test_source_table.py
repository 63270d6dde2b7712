"""The source's table: symmetries are found, nodes hold the reflectance, and its stated error is its error."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.channels import LuminanceOf
from homofact.brdf.materials import MATERIALS, material
from homofact.brdf.symmetry import Symmetry, find_symmetry
from homofact.errors import BadInput
from homofact.geometry.directions import draw_cosine_weighted
from homofact.shading.languages import number
from homofact.web.packing import pack
from homofact.web.source_table import FLOOR, STEP, source_table

BEST = Symmetry(isotropic=True, reciprocal=True, mirrored=True, half_turn=True)


@dataclass(frozen=True)
class Formula:
    """A reflectance of one formula, of one channel or more."""

    formula: Any
    channels: tuple[str, ...] = ("Y",)
    nbytes: int = 0
    fetches: int = 0

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        return self.formula(wi, wo)[:, None].expand(-1, len(self.channels))


FORMULAS = {
    "constant": (lambda i, o: torch.ones_like(i[:, 0]), BEST),
    "not reciprocal": (lambda i, o: i[:, 2] + 0.1, replace(BEST, reciprocal=False)),
    "not mirrored": (
        lambda i, o: 2 + i[:, 0] * o[:, 1] - i[:, 1] * o[:, 0], replace(BEST, mirrored=False, reciprocal=False),
    ),
    "brushed along x": (lambda i, o: 3 + i[:, 0] * o[:, 0], replace(BEST, isotropic=False)),
    "brushed askew": (
        lambda i, o: 3 + i[:, 0] * o[:, 1] + i[:, 1] * o[:, 0], replace(BEST, isotropic=False, mirrored=False),
    ),
    "of no symmetry": (lambda i, o: 3 + i[:, 0] + 0.5 * o[:, 1], Symmetry(False, False, False, False)),
    "mirrored alone": (lambda i, o: 3 + i[:, 0], Symmetry(False, False, True, False)),
}  # fmt: skip


def pairs(count: int = 3000) -> tuple[Tensor, Tensor]:
    return draw_cosine_weighted(count, torch.Generator().manual_seed(77))


@pytest.mark.parametrize("name", FORMULAS)
def test_symmetries_are_found_and_made_use_of(name: str) -> None:
    formula, expected = FORMULAS[name]
    reflectance = Formula(formula)
    assert find_symmetry(reflectance) == expected
    table = source_table(reflectance, pairs=1500)
    assert table.symmetry == expected
    assert (table.steps.shape[0] == 1) is expected.isotropic
    wi, wo = pairs()
    relative = (table.evaluate(wi, wo) / reflectance.evaluate(wi, wo) - 1).abs()
    assert float(relative.median()) < 0.003
    assert float(torch.quantile(relative, 0.99)) < 0.08


@pytest.mark.parametrize("name", MATERIALS)
def test_symmetries_of_the_models_are_those_that_they_declare(name: str) -> None:
    model = material(name).model
    found = find_symmetry(model)
    assert found.isotropic == model.isotropic
    assert found.mirrored


@pytest.mark.parametrize("name", ["lafortune-blue-paint", "blinn-phong-50", "cook-torrance-plastic", "ward-brushed"])
def test_the_error_that_is_stated_is_the_error(name: str) -> None:
    model = material(name).model
    table = source_table(model)
    wi, wo = pairs(6000)
    found, truth = table.evaluate(wi, wo), model.evaluate(wi, wo)
    relative = (found - truth).abs() / torch.maximum(truth, truth.mean(0) / 1000)
    assert float(relative.median()) == pytest.approx(table.error.median, rel=0.2)
    assert float(torch.quantile(relative, 0.95)) == pytest.approx(table.error.percentile_95, rel=0.4)
    assert table.error.median < (0.01 if name == "ward-brushed" else 0.004)
    assert table.error.count == 4096


def share_at(x: float, crowded: float) -> float:
    """The share u of an axis with x = (1 − e) u + e (1 − √(1 − u)), by bisection."""
    low, high = 0.0, 1.0
    for _ in range(60):
        u = (low + high) / 2
        low, high = (u, high) if (1 - crowded) * u + crowded * (1 - math.sqrt(1 - u)) < x else (low, u)
    return (low + high) / 2


def test_nodes_hold_the_logarithm_to_half_a_step() -> None:
    model = material("blinn-phong-50").model
    table = source_table(model, pairs=500)
    _, theta_h, theta_d, phi_d = table.steps.shape[:4]
    # φd is folded to [0, π/2]; node (a, b, c) by the module's own words. The last two have t > 1.
    for a, b, c in ((0, 0, 0), (3, 5, 2), (theta_h // 2, theta_d // 2, 3), (40, theta_d - 8, 7), (30, 20, phi_d - 1)):
        x, y, around = a / (theta_h - 1), b / (theta_d - 1), c / (phi_d - 1)
        th = math.pi / 2 * table.width * math.sinh(share_at(x, 0.3) * math.asinh(1 / table.width))
        td = math.pi / 2 * share_at(y, 0.5)
        pd = math.acos(math.cos(around * math.pi / 2) / max(1, math.tan(th) * math.tan(td)))
        h = torch.tensor([math.sin(th), 0, math.cos(th)])
        off = math.cos(pd) * torch.tensor([math.cos(th), 0, -math.sin(th)]) + math.sin(pd) * torch.tensor(
            [0.0, 1.0, 0.0]
        )
        wi, wo = ((math.cos(td) * h + s * math.sin(td) * off)[None].double() for s in (1, -1))
        assert min(float(wi[0, 2]), float(wo[0, 2])) > 0.009, (a, b, c)
        value = model.evaluate(wi, wo)[0].numpy()
        steps = np.log(value / table.mean + FLOOR) / STEP
        assert np.abs(table.steps[0, a, b, c] - steps).max() < 0.51


def upper_half(steps: int) -> tuple[Tensor, Tensor]:
    """Directions (N, 3) over half of the hemisphere, the other half mirrored, and their solid angles; finer below."""
    edge = torch.cat((torch.linspace(0, 0.1, steps), torch.linspace(0.1, 1, steps)[1:])).double()
    z, dz = (edge[1:] + edge[:-1]) / 2, edge.diff()
    phi = (torch.arange(90).double() + 0.5) * math.pi / 90
    height, azimuth = torch.meshgrid(z, phi, indexing="ij")
    sine = (1 - height**2).sqrt()
    directions = torch.stack((sine * torch.cos(azimuth), sine * torch.sin(azimuth), height), -1).reshape(-1, 3)
    return directions, (dz[:, None] * (2 * math.pi / 90)).expand(-1, 90).reshape(-1)


@pytest.mark.parametrize(
    "model",
    [
        GgxBrdf((0.1,) * 3, (GgxLobe((1.0,) * 3, 0.3, 0.05),)),
        GgxBrdf((0.1,) * 3, (GgxLobe((1.0,) * 3, 0.1, 0.05),)),
        material("cook-torrance-plastic").model,
        material("lafortune-clay").model,
    ],
    ids=["rough", "smooth", "cook-torrance", "lafortune"],
)
def test_the_rim_of_a_sphere_is_the_source_s(model: Any) -> None:
    """Reflected light at grazing views, in total and away from the mirror direction, where a low sun adds a fringe."""
    table = source_table(model, pairs=1000)
    wi, solid = upper_half(60)
    for degrees in (80.0, 85.0, 88.0, 89.0):
        theta = math.radians(degrees)
        wo = torch.tensor([[math.sin(theta), 0, math.cos(theta)]], dtype=torch.float64).expand(len(wi), 3)
        found, truth = ((f.evaluate(wi, wo) * wi[:, 2:]).mean(1) for f in (table, model))
        albedo = float((truth * solid).sum())
        assert float((found * solid).sum()) == pytest.approx(albedo, rel=0.04), degrees
        aside = wi[:, 0] > -0.3
        assert float((found - truth)[aside].abs().max()) < 0.008 * albedo, degrees


def test_one_channel_is_three_equal_ones_in_the_page() -> None:
    table = source_table(LuminanceOf(material("phong-10").model), pairs=500)
    green, red, blue = table.differences()
    assert not red.any()
    assert not blue.any()
    steps = np.cumsum(np.cumsum(green, 2, dtype=np.int16), 1, dtype=np.int16)
    assert (steps == table.steps.reshape(-1, *table.steps.shape[2:])[..., 0]).all()
    mean = number(table.mean[0])
    assert f"vec3({mean}, {mean}, {mean})" in table.glsl("source")


def test_directions_under_the_horizon_reflect_nothing() -> None:
    table = source_table(material("phong-10").model, pairs=500)
    up = torch.tensor([[0.0, 0.6, 0.8]], dtype=torch.float64)
    down = up * torch.tensor([1.0, 1.0, -1.0])
    assert bool((table.evaluate(up, up) > 0).all())
    for wi, wo in ((up, down), (down, up), (down, down)):
        assert not bool(table.evaluate(wi, wo).any())


def test_a_table_grows_only_within_its_budget() -> None:
    model = material("ashikhmin-shirley-wang").model
    small, large = (source_table(model, pairs=500, budget=budget) for budget in (0, 150_000))
    assert small.steps.size <= large.steps.size
    assert large.steps.size == small.steps.size or len(pack(large.differences())["data"]) <= 150_000


def test_the_same_seed_gives_the_same_table() -> None:
    model = material("phong-30").model
    one, other, third = (source_table(model, pairs=300, seed=seed) for seed in (0, 0, 1))
    assert (one.steps == other.steps).all()
    assert one.error == other.error != third.error


def test_black_and_negative_values_are_shown_as_black() -> None:
    wi, wo = pairs(50)
    for value in (0.0, -1.0):
        table = source_table(Formula(lambda i, o, v=value: torch.full_like(i[:, 0], v)), pairs=200)
        assert float(table.evaluate(wi, wo).abs().max()) < 1e-12


@pytest.mark.parametrize(
    ("reflectance", "expected"),
    [
        (Formula(lambda i, o: i[:, 2], tuple("abcd")), "source: found 4 channels, expected 1 or 3 to show"),
        (
            Formula(lambda i, o: torch.where(i[:, 0] > 0, i[:, 2], math.nan)),
            "source: a value is not finite, expected finite values at all directions above the horizon",
        ),
    ],
)
def test_what_cannot_be_shown_is_refused(reflectance: Formula, expected: str) -> None:
    with pytest.raises(BadInput, match=f"^{expected}$"):
        source_table(reflectance)
