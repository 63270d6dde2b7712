"""Known mixes: kept and read back whole, tried first and alone, and left out where the table cannot be used."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from slow_cases import slow_among
from torch import Tensor

from homofact.brdf.samples import Samples
from homofact.factor.projection import Warp, fixed_projection
from homofact.factor.search.gradient import Gradient
from homofact.factor.textures import LogSamples
from homofact.geometry.coordinates import rusinkiewicz_angles
from homofact.geometry.directions import draw_in_discs
from homofact.methods import known_mixes as module
from homofact.methods.effort import FitBudget
from homofact.methods.kinds import ANISOTROPIC_CANDIDATES, ISOTROPIC_CANDIDATES, make, takes_warp
from homofact.methods.known_mixes import NONE, TABLE, VERSION, KnownMixes, known_mixes, mix_of_record, mix_record
from homofact.methods.materials import Materials, TrainingMaterial
from homofact.methods.mix import Mix
from homofact.methods.search import Search
from homofact.methods.search_fit import find_mixes
from homofact.methods.structure_search import StructureSearch
from homofact.methods.trials import StructureSettings
from homofact.methods.validation import Partition, random_folds

SETTINGS = StructureSettings(8, True, "disc", 2, Gradient(), None, 0)
COUNT = 1200
PARTITIONS = (Partition(random_folds(COUNT, 4, 0), 1.0),)


def _slanted(wi: Tensor, wo: Tensor) -> Tensor:
    """Logs (N, 1) of a factor on a slanted line through (θh, φd), which no pair of axes is, and another of θd."""
    theta_h, theta_d, phi_d = rusinkiewicz_angles(wi, wo)
    return (torch.sin(1.6 * theta_h + 1.2 * phi_d) + torch.exp(-4 * theta_h) * theta_d)[:, None]


def _materials() -> Materials:
    wi, wo = draw_in_discs(COUNT, torch.Generator().manual_seed(0), 0.98)
    samples = LogSamples(wi, wo, _slanted(wi, wo), torch.ones(COUNT, dtype=torch.float64))
    return Materials((TrainingMaterial(samples, PARTITIONS),))


def _mix(*kinds: str, warp: Warp | None = None, seed: int = 3) -> Mix:
    generator = torch.Generator().manual_seed(seed)
    projections = tuple(make(kind, True, warp, generator, "disc") for kind in kinds)
    return Mix(kinds, projections, tuple(10.0 ** -(2 + place) for place in range(len(kinds))))


def _table(*mixes: Mix, note: str = "") -> KnownMixes:
    most = max(len(mix.kinds) for mix in mixes)
    return KnownMixes(
        tuple(tuple(mix_record(mix) for mix in mixes if len(mix.kinds) == count) for count in range(1, most + 1)), note
    )


@pytest.mark.parametrize("warp", [None, Warp(0.03)])
def test_a_record_is_the_whole_mix(warp: Warp | None) -> None:
    """Through JSON and back: kinds, matrices, warp and λ; reciprocal or not as it is asked for."""
    mix = _mix("theta_h-theta_d", "isotropic-angles", "in-out", "theta_i", warp=warp)
    record = json.loads(json.dumps(mix_record(mix)))
    again = mix_of_record(record, True, "disc")
    assert again.kinds == mix.kinds
    assert again.smoothing == mix.smoothing
    for mine, theirs in zip(again.projections, mix.projections, strict=True):
        np.testing.assert_allclose(mine.matrix, theirs.matrix, atol=1e-12)
        assert mine.warp == theirs.warp
        assert mine.coordinates == theirs.coordinates
        assert mine.reciprocal
    assert not any(projection.reciprocal for projection in mix_of_record(record, False, "disc").projections)


def test_the_table_of_the_package_has_mixes_of_one_to_three_textures() -> None:
    table = known_mixes()
    assert table.note == ""
    stored = json.loads(TABLE.read_text(encoding="utf-8"))
    assert stored["version"] == VERSION
    assert set(stored["made_from"]) >= {"cases", "seed", "found"}
    for candidates in (ISOTROPIC_CANDIDATES, ANISOTROPIC_CANDIDATES):
        for count in (1, 2, 3):
            mixes = table.of(count, candidates, True, "disc")
            assert len(mixes) >= 8
            assert all(len(mix.kinds) == count and set(mix.kinds) <= set(candidates) for mix in mixes)
            assert all(value > 0 for mix in mixes for value in mix.smoothing)
            assert len({json.dumps(mix_record(mix)) for mix in mixes}) == len(mixes)
    assert table.of(0, ISOTROPIC_CANDIDATES, True, "disc") == table.of(4, ISOTROPIC_CANDIDATES, True, "disc") == []


def test_only_mixes_of_the_candidates_are_known() -> None:
    table = _table(_mix("theta_i"), _mix("theta_d"), _mix("wi"))
    assert [mix.kinds for mix in table.of(1, ISOTROPIC_CANDIDATES, True, "disc")] == [("theta_i",), ("theta_d",)]
    assert [mix.kinds for mix in table.of(1, ("wi",), True, "disc")] == [("wi",)]


@pytest.mark.slow
def test_the_best_known_mix_is_found_moved_into_place_and_cheaper_than_all() -> None:
    """Among fixed pairs that cannot follow the slanted line one mix is searched, and a little off."""
    right = _mix("isotropic-angles", "theta_h-theta_d")
    wrong = [_mix("theta_i", "theta_d"), _mix("theta_i-theta_o", "theta_h-theta_d"), _mix("theta_d", "theta_h-tilt")]
    settings = replace(SETTINGS, known=_table(_mix("theta_d"), wrong[0], right, *wrong[1:]))
    little, much = FitBudget(), FitBudget(200)
    found = StructureSearch(_materials(), settings, little).run(2, (ISOTROPIC_CANDIDATES,))
    every = StructureSearch(_materials(), SETTINGS, much).run(2, (ISOTROPIC_CANDIDATES,))
    assert found.known
    assert not every.known
    assert sorted(found.mix.kinds) == sorted(right.kinds)
    assert not np.allclose(found.mix.projections[0].matrix, right.projections[0].matrix, atol=1e-3)
    without = StructureSearch(_materials(), replace(SETTINGS, known=_table(*wrong)), FitBudget())
    assert found.mix.error < 0.5 * without.run(2, (ISOTROPIC_CANDIDATES,)).mix.error
    assert little.spent < 0.5 * much.spent


def test_of_more_textures_than_any_known_mix_has_the_search_goes_on_from_these() -> None:
    settings = replace(SETTINGS, known=_table(_mix("theta_h-theta_d"), _mix("theta_h-theta_d", "isotropic-angles")))
    outcome = StructureSearch(_materials(), settings, FitBudget(100)).run(3, (ISOTROPIC_CANDIDATES,))
    assert [len(level.kinds) for level in outcome.levels] == [1, 2, 3]
    assert not outcome.known
    assert outcome.mix.error <= outcome.levels[1].error


def test_the_number_of_textures_still_has_to_be_earned() -> None:
    """Logs of θi θo and noise: the fixed texture of both is enough, though no known mix has it alone."""
    wi, wo = draw_in_discs(COUNT, torch.Generator().manual_seed(0), 0.98)
    noise = 0.1 * torch.randn(COUNT, 1, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    logs = torch.acos(wi[:, 2:]) * torch.acos(wo[:, 2:]) + noise
    samples = LogSamples(wi, wo, logs, torch.ones(COUNT, dtype=torch.float64))
    settings = replace(SETTINGS, known=_table(_mix("theta_d"), _mix("theta_i-theta_o", "theta_d")))
    search = StructureSearch(Materials((TrainingMaterial(samples, PARTITIONS),)), settings, FitBudget())
    outcome = search.run(2, (ISOTROPIC_CANDIDATES,))
    assert outcome.mix.kinds == ("theta_i-theta_o",)
    assert len(outcome.notes) == 1


def _measured() -> Samples:
    wi, wo = draw_in_discs(COUNT, torch.Generator().manual_seed(0), 0.98)
    return Samples(wi, wo, torch.exp(_slanted(wi, wo)), channels=("Y",), isotropic=True, all_azimuths=True)


@pytest.mark.parametrize(("effort", "known"), [("quick", True), ("normal", True), (30.0, False)])
def test_efforts_by_name_try_known_mixes_and_numbers_all(effort: str | float, known: bool) -> None:
    outcome = find_mixes(_measured(), Search(textures=2, size=6, effort=effort))
    assert outcome.known is known
    assert not any("known" in note for note in outcome.notes)


@pytest.mark.parametrize("content", slow_among([None, "{", '{"version": 0, "mixes": []}', "[]"], "{", "[]"))
def test_without_a_table_that_can_be_used_every_mix_is_tried_and_that_is_said_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: str | None
) -> None:
    path = tmp_path / "mixes.json"
    if content is not None:
        path.write_text(content)
    table = known_mixes(path)
    assert table.by_count == NONE.by_count
    assert "mixes.json" in table.note
    monkeypatch.setattr(module, "TABLE", path)
    monkeypatch.setattr("homofact.methods.search_task.known_mixes", lambda: table)
    outcome = find_mixes(_measured(), Search(textures=2, size=6, effort="quick"))
    alike = find_mixes(_measured(), Search(textures=2, size=6, effort=4 * 12.0))
    assert [note for note in outcome.notes if "mixes.json" in note] == [table.note]
    assert outcome.mix.kinds == alike.mix.kinds
    assert outcome.mix.error == alike.mix.error


def test_every_kind_that_reads_the_half_vector_shares_the_warp() -> None:
    mix = mix_of_record(mix_record(_mix("theta_h-theta_d", "theta_i", warp=Warp(0.1))), True, "disc")
    assert [projection.warp is not None for projection in mix.projections] == list(map(takes_warp, mix.kinds))
    assert mix.warp == Warp(0.1)
    assert fixed_projection("theta_i", True).warp is None
