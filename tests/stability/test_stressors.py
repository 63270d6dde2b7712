"""Stressors of the atlas of failures: they grow, come again by their seed, and stay apart from clean samples."""

import math
from pathlib import Path

import pytest
import torch
from torch import Tensor

from homofact.brdf.samples import Samples
from homofact.errors import BadInput
from homofact.geometry.directions import normalize, to_spherical
from homofact.stability.atlas import Plan, run_atlas
from homofact.stability.cells import (
    CellOutcome,
)
from homofact.stability.problem import Problem, Scale, Stressor, unstressed
from homofact.stability.real import MissingMeasurement
from homofact.stability.stressors import STRESSORS

SCALE = Scale(samples=600, clean=300)
REAL = ("real-retroreflector", "real-non-reciprocal", "real-negative")
SYNTHETIC = [each for each in STRESSORS.values() if each.name not in REAL]
ids = [each.name for each in SYNTHETIC]


def make(each: Stressor, place: int) -> Problem | BadInput:
    try:
        return each.stress(each.strengths[place], 0, SCALE)
    except BadInput as error:
        return error


def distance(each: Stressor, place: int) -> float:
    """How far a strength is from no stress: of the samples' number, places, values and settings; inf where refused."""
    problem = make(each, place)
    if isinstance(problem, BadInput):
        return math.inf
    base = problem.reference if problem.reference is not None else unstressed(0, SCALE)
    count = abs(math.log(len(problem.samples) / len(base.samples)))
    share = problem.settings[0]
    settings = abs(math.log10(max(share["smoothing"], 1e-9) / 1e-3)) if "smoothing" in share else 0.0
    settings += share.get("textures", len(share.get("projections", ())) - 1 if "projections" in share else 0)
    settings += share.get("size", 8) / 8 - 1 + abs(math.log10(share.get("epsilon", 1e-2) / 1e-2)) / 10
    pairs = [(_marginals(problem.samples)[name], _marginals(base.samples)[name]) for name in _marginals(base.samples)]
    levels = torch.linspace(0, 1, 400, dtype=torch.float64)
    moved = sum(float((one.quantile(levels) - two.quantile(levels)).abs().mean()) for one, two in pairs)
    if len(problem.samples) == len(base.samples):
        moved += float((pairs[0][0] - pairs[0][1]).square().mean().sqrt())
        moved += float((problem.samples.wo[:, 2] - base.samples.wo[:, 2]).abs().mean())
    return count + settings + moved


def _marginals(samples: Samples) -> dict[str, Tensor]:
    """What a stress may move: brightness, light and viewer from the horizon (logarithms), half vector and azimuth."""
    half = normalize(samples.wi + samples.wo)
    return {
        "values": torch.log(samples.values.clamp_min(1e-320)).flatten(),
        "light": torch.log(samples.wi[:, 2].clamp_min(1e-9)),
        "viewer": torch.log(samples.wo[:, 2].clamp_min(1e-9)),
        "half": torch.log(to_spherical(half)[0].clamp_min(1e-6)),
        "azimuth": to_spherical(samples.wi)[1],
    }


@pytest.mark.parametrize("each", SYNTHETIC, ids=ids)
def test_a_stressor_grows_from_its_mildest_to_its_fatal_strength(each: Stressor) -> None:
    mild, fatal = distance(each, 0), distance(each, -1)
    assert fatal > mild
    assert fatal > 0.05
    assert isinstance(make(each, 0), Problem)


@pytest.mark.parametrize("each", SYNTHETIC, ids=ids)
def test_a_stressor_is_made_again_bit_by_bit_and_by_its_seed(each: Stressor) -> None:
    one, two, other = (each.stress(each.strengths[0], seed, SCALE) for seed in (1, 1, 2))
    assert torch.equal(one.samples.values, two.samples.values)
    assert torch.equal(one.clean.wi, two.clean.wi)
    assert not (one.samples.wi.shape == other.samples.wi.shape and torch.equal(one.samples.wi, other.samples.wi))


@pytest.mark.parametrize("each", SYNTHETIC, ids=ids)
def test_clean_samples_are_not_among_the_measured(each: Stressor) -> None:
    problem = each.stress(each.strengths[0], 0, SCALE)

    # Heights alone: a stream of chance begun again repeats them, whatever the azimuths.
    measured, clean = (set(each.wi[:, 2].tolist()) for each in (problem.samples, problem.clean))
    assert measured.isdisjoint(clean)
    assert float(problem.clean.values.min()) >= 0


def test_there_are_stressors_enough_and_each_is_explained() -> None:
    assert len(STRESSORS) >= 20
    for each in STRESSORS.values():
        assert len(each.strengths) >= 3, each.name
        assert each.labels == () or len(each.labels) == len(each.strengths)
        assert min(len(each.description), len(each.mechanism), len(each.remedy)) > 20
        assert each.description.endswith(".")
    assert len({each.title for each in STRESSORS.values()}) == len(STRESSORS)


@pytest.mark.parametrize("name", REAL)
def test_real_measurements_are_stressors(name: str, real_data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOMOFACT_DATA", str(real_data))
    each = STRESSORS[name]
    problem = each.stress(each.strengths[-1], 0, SCALE)
    assert len(problem.samples) > 20
    assert len(problem.clean) == SCALE.clean


def test_an_absent_measurement_is_skipped_with_a_note(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from homofact.stability import real

    real._opened.cache_clear()
    monkeypatch.setenv("HOMOFACT_DATA", str(tmp_path))
    with pytest.raises(MissingMeasurement, match="set HOMOFACT_DATA"):
        STRESSORS[REAL[0]].stress(1.0, 0, SCALE)
    atlas = run_atlas(Plan(("mccool",), (REAL[0],), short=True))
    assert {cell.outcome for cell in atlas.cells} == {CellOutcome.ABSENT}
    assert len(atlas.notes) == 1
    assert "retro-3M-jaune.dat not found" in atlas.notes[0]
