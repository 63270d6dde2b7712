"""Searches of the thesis's procedure known from an earlier fit: the same bits, and nothing else taken for them."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from slow_cases import slow_among

from homofact.brdf.samples import Samples
from homofact.factor.factorization import Factorization
from homofact.geometry.directions import draw_in_discs
from homofact.methods import cole_search
from homofact.methods.cole import Cole
from homofact.methods.cole_fit import fit_cole

SETTINGS = Cole(textures=1, size=6, search_size=5, restarts=2, search_samples=300, epsilon=1e-3, seed=4)


def _samples(seed: int = 0) -> Samples:
    wi, wo = draw_in_discs(400, torch.Generator().manual_seed(seed), 0.98)
    values = torch.exp(wi[:, :1] * wo[:, 1:2]) + 3 * (wi[:, 2:] * wo[:, 2:]) ** 2
    return Samples(wi, wo, values, channels=("Y",), isotropic=False)


@pytest.fixture(autouse=True)
def searches(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The number of each term that is searched, with nothing known at first."""
    cole_search._kept.clear()
    found: list[int] = []
    search = cole_search._search_term

    def counted(*all_: Any) -> Any:
        found.append(all_[5])
        return search(*all_)

    monkeypatch.setattr(cole_search, "_search_term", counted)
    return found


def _bits(fit: Any) -> list[np.ndarray]:
    assert isinstance(fit.factorization, Factorization)
    terms = fit.factorization.terms
    return [np.asarray(term.texture) for term in terms] + [np.asarray(term.projection.matrix) for term in terms]


def _same(one: Any, two: Any) -> bool:
    return all(np.array_equal(a, b) for a, b in zip(_bits(one), _bits(two), strict=True))


@pytest.mark.parametrize("joint", slow_among([0, 1, 2], 0, 2))
def test_a_fit_that_goes_on_has_the_bits_of_one_from_the_start(searches: list[int], joint: int) -> None:
    settings = replace(SETTINGS, joint_terms=joint)
    for textures in (1, 3, 2, 3):
        fit_cole(_samples(), replace(settings, textures=textures))
    assert searches == [1, 2, 3]
    known = fit_cole(_samples(), replace(settings, textures=3))
    cole_search._kept.clear()
    fresh = fit_cole(_samples(), replace(settings, textures=3))
    assert searches == [1, 2, 3, 1, 2, 3]
    assert _same(known, fresh)
    assert known.report.evaluations == fresh.report.evaluations
    assert known.report.status is fresh.report.status


def test_other_sizes_share_a_search_of_one_size(searches: list[int]) -> None:
    small, large = (fit_cole(_samples(), replace(SETTINGS, size=size)) for size in (6, 9))
    assert searches == [1]
    assert [fit.factorization.terms[0].texture.shape[0] for fit in (small, large)] == [6, 9]


@pytest.mark.parametrize(
    "changes",
    [
        {"seed": 5}, {"restarts": 1}, {"coordinates": "in-out"}, {"smoothing": 1e-2}, {"search_size": 4},
        {"search_samples": 200}, {"epsilon": 1e-2}, {"reciprocal": False}, {"bound": "cube"}, {"joint_terms": 1},
    ],
    ids=str,
)  # fmt: skip
def test_what_a_search_depends_on_makes_another_one(searches: list[int], changes: dict[str, Any]) -> None:
    fit_cole(_samples(), SETTINGS)
    fit_cole(_samples(), replace(SETTINGS, **changes))
    assert searches == [1, 1]


def test_other_samples_are_searched_anew_and_a_guard_takes_nothing_over(searches: list[int]) -> None:
    fit_cole(_samples(), SETTINGS)
    fit_cole(_samples(1), SETTINGS)
    for _ in range(2):
        fit_cole(_samples(), replace(SETTINGS, budget=60.0))
    assert searches == [1, 1, 1, 1]


def test_the_seconds_of_a_search_that_was_spared_count(searches: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    """By a clock on which every look takes 10 s."""
    clock = iter(range(0, 10_000_000, 10))
    monkeypatch.setattr(cole_search.time, "perf_counter", lambda: float(next(clock)))
    first = fit_cole(_samples(), SETTINGS).report.seconds
    again = fit_cole(_samples(), SETTINGS).report.seconds
    assert searches == [1]
    assert again > 0.9 * first


@pytest.mark.slow
def test_only_the_last_few_searches_are_kept(searches: list[int]) -> None:
    for seed in range(cole_search._MOST_KEPT + 2):
        fit_cole(_samples(), replace(SETTINGS, seed=seed, restarts=1, search_samples=60))
    assert len(cole_search._kept) == cole_search._MOST_KEPT
    fit_cole(_samples(), replace(SETTINGS, seed=0, restarts=1, search_samples=60))
    assert len(searches) == cole_search._MOST_KEPT + 3
