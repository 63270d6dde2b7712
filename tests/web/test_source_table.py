"""The source's table: symmetries are found, nodes hold the reflectance, and its stated error is its error."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

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


def test_nodes_hold_the_logarithm_to_half_a_step() -> None:
    model = material("blinn-phong-50").model
    table = source_table(model, pairs=500)
    _, theta_h, theta_d, phi_d = table.steps.shape[:4]
    # φd is folded to [0, π/2]; node (a, b, c) by the module's own words.
    for a, b, c in ((0, 0, 0), (3, 5, 2), (theta_h // 2, theta_d // 2, 3), (10, theta_d - 1, phi_d - 1)):
        x, share, around = a / (theta_h - 1), b / (theta_d - 1), c / (phi_d - 1)
        th = (math.pi / 2 - 1e-4) * table.width * math.sinh(x * math.asinh(1 / table.width))
        pd = around * math.pi / 2
        td = 0.99 * share * math.atan2(math.cos(th), math.sin(th) * abs(math.cos(pd)))
        h = torch.tensor([math.sin(th), 0, math.cos(th)])
        off = math.cos(pd) * torch.tensor([math.cos(th), 0, -math.sin(th)]) + math.sin(pd) * torch.tensor(
            [0.0, 1.0, 0.0]
        )
        wi, wo = ((math.cos(td) * h + s * math.sin(td) * off)[None].double() for s in (1, -1))
        value = model.evaluate(wi, wo)[0].numpy()
        steps = np.log(value / table.mean + FLOOR) / STEP
        assert np.abs(table.steps[0, a, b, c] - steps).max() < 0.51


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
