"""The shadow of an arm is told from values that were rounded or cut at zero."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from homofact.brdf.materials import MATERIALS
from homofact.brdf.quality.suspicion.evidence import Evidence
from homofact.brdf.quality.suspicion.shadow import censored_median, resolution, shadow
from homofact.brdf.quality.suspicion.suspects import suspicions
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from scripts.verdict.planting import FAULTS

_SHADOW, _QUANTISED = (next(f.plant for f in FAULTS if f.name == name) for name in ("shadow of the arm", "quantised"))


def glossy(count: int = 2000) -> Samples:
    return sample_model(MATERIALS["blinn-phong-50"].model, count, "discs", 3)


def names(samples: Samples) -> set[str]:
    return {each.name for each in suspicions(samples)}


@pytest.mark.parametrize("levels", [15, 63, 255])
@pytest.mark.parametrize("brighter", [1, 30])
def test_rounded_values_are_no_shadow(levels: int, brighter: int) -> None:
    """Highlights far above the base: most values are then zero or one step."""
    samples = glossy()
    base = samples.values.min()
    clean = replace(samples, values=(base + brighter * (samples.values - base)) / brighter)
    assert names(_QUANTISED(clean, levels, 0)) <= {"quantised", "zeros"}


def test_a_shadow_in_rounded_values_is_found_where_the_steps_resolve_it() -> None:
    found = [names(_QUANTISED(_SHADOW(glossy(), 0.95, 0), levels, 0)) for levels in (255, 3)]
    assert ["shadow" in each for each in found] == [True, False]


def cut_by_chance(samples: Samples, share: float, inside: float) -> Samples:
    """Zeros at `share` of the samples, at `inside` of those within 12° of the light."""
    near = (samples.wi * samples.wo).sum(1) > math.cos(math.radians(12))
    chance = torch.rand(len(samples), generator=torch.Generator().manual_seed(5))
    zero = chance < torch.where(near, inside, share)
    return replace(samples, values=torch.where(zero[:, None], 0.0, samples.values))


def test_zeros_around_the_light_explain_zeros_near_it() -> None:
    samples = glossy()
    assert "shadow" not in names(cut_by_chance(samples, 0.65, 0.65))
    assert "shadow" in names(cut_by_chance(samples, 0.0, 0.65))


def test_the_step_of_rounded_values_is_measured() -> None:
    chance = np.random.default_rng(0)
    values = chance.uniform(0, 1, (2000, 2))
    assert resolution(values).max() < 1e-3
    even = np.round(values * 50) / 50
    assert np.allclose(resolution(even)[even.min(1) > 0.04], 0.02)
    digits = np.array([[0.0012], [0.0013], [0.012], [0.013], [0.5], [7.0]])
    assert np.allclose(resolution(digits), [1e-4, 1e-4, 1e-3, 1e-3, 0.5, 7.0])
    assert np.allclose(resolution(np.array([[0.0], [0.3], [0.4]])), 0.1)
    assert (resolution(np.zeros((5, 1))) == 0).all()


def test_medians_of_values_that_are_cut_follow_the_line_above_the_cut() -> None:
    """Half of the target is below the floor at the left end: a plain median over what is lit would be too high."""
    chance = np.random.default_rng(1)
    x = np.linspace(-1, 1, 4000)
    columns, target = np.column_stack((np.ones_like(x), x)), 2 * x + chance.normal(0, 0.3, len(x))
    found = censored_median(columns, np.maximum(target, 0), np.ones_like(x), 0.0)
    assert np.abs(found - np.maximum(2 * x, 0)).max() < 0.15
    few = np.where(chance.uniform(size=len(x)) < 0.3, 50.0, 2 * x)
    assert np.abs(censored_median(columns, few, np.ones_like(x), -9.0) - 2 * x).max() < 0.1


def test_a_fall_of_less_than_a_step_is_no_shadow() -> None:
    """A grey that falls by a tenth, from 0.55 to 0.495 of a step, is rounded from one step to zero."""
    samples = glossy()
    near = (samples.wi * samples.wo).sum(1) > math.cos(math.radians(12))
    for steps, fell, expected in ((0.55, 0.9, 0.0), (20.0, 0.1, math.log(20 / 3))):
        values = (steps * torch.where(near, fell, 1.0)[:, None].expand_as(samples.values)).round()
        found = shadow(Evidence.of(replace(samples, values=values)))
        assert found is not None
        # Two of twenty steps remain. With no third level, the step could be as large as the value, two.
        assert found[0] == pytest.approx(expected, abs=0.6)
