"""Fits too large for dense systems: they end where the dense ones do, or are refused before they begin."""

from typing import Any

import pytest
import torch
from slow_cases import slow_among

import homofact
from homofact.errors import BadInput, Status
from homofact.geometry.directions import draw_cosine_weighted
from homofact.linear import least_squares, size, sparse_solve
from homofact.methods import search_fit, shapes

PAIRS = draw_cosine_weighted(300, torch.Generator().manual_seed(1))
PINNED = ("theta_h-theta_d", "theta_i-theta_o")
METHODS = {
    "mccool": homofact.McCool(size=12, copies=2),
    "cole": homofact.Cole(size=10, textures=1, restarts=1, search_size=4, search_samples=200, copies=2),
    "search": homofact.Search(size=12, projections=PINNED, smoothing=1e-3, effort=1, objective="log"),
    "light": homofact.Search(size=12, projections=PINNED, smoothing=1e-3, effort=1),
}


def paint(method: Any) -> Any:
    return homofact.fit(homofact.read("material:lafortune-blue-paint", count=1500, seed=1), method)


@pytest.mark.parametrize("name", slow_among(METHODS, "mccool", "search", "light"))
def test_a_sparse_fit_is_the_dense_one(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    dense = paint(METHODS[name])
    monkeypatch.setattr(size, "MOST_DENSE", 70)
    monkeypatch.setattr(sparse_solve, "COARSE", 60)
    sparse = paint(METHODS[name])
    assert sparse.report.details["condition"] > 1
    if name == "light":
        # Its steps end where they bring little more, which other steps do elsewhere.
        assert sparse.report.details["light"]["after"] == pytest.approx(
            dense.report.details["light"]["after"], rel=0.02
        )
        return
    one, other = dense.evaluate(*PAIRS), sparse.evaluate(*PAIRS)
    assert float(((one - other).abs() / (one + 1e-3)).max()) < 5e-3
    assert sparse.report.residual == pytest.approx(dense.report.residual, rel=1e-3)


@pytest.mark.slow
def test_a_large_search_makes_no_dense_system(monkeypatch: pytest.MonkeyPatch) -> None:
    method = homofact.Search(size=20, textures=2, effort=3, search_size=6, search_samples=300)
    monkeypatch.setattr(size, "MOST_DENSE", 500)
    largest = []
    whole = least_squares.accumulate

    def seen(x, lookups, targets, weights, unknowns: int):
        largest.append(unknowns)
        return whole(x, lookups, targets, weights, unknowns)

    monkeypatch.setattr("homofact.linear.least_squares.accumulate", seen)
    fit = paint(method)
    assert max(largest) <= 500
    assert all(texture.size == (20, 20) for texture in fit.factorization.textures)
    error = fit.report.residual
    assert (
        error
        < 2 * paint(homofact.Search(size=12, textures=2, effort=3, search_size=6, search_samples=300)).report.residual
    )


@pytest.mark.slow
def test_layouts_of_many_bytes_are_judged_with_fewer(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    judged = shapes._Judge.error

    def seen(judge, mix, own):
        asked.append(sum(rows * columns for rows, columns in own))
        return judged(judge, mix, own)

    monkeypatch.setattr(shapes._Judge, "error", seen)
    monkeypatch.setattr(shapes, "MOST_DENSE", 150)
    monkeypatch.setattr(size, "MOST_DENSE", 150)
    fit = paint(homofact.Search(bytes=12 * 600, effort=3, search_size=6, search_samples=300))
    assert asked
    assert max(asked) <= 150
    assert 500 < sum(rows * columns for rows, columns in fit.report.details["shapes"]) <= 600


@pytest.mark.slow
def test_steps_that_run_out_are_noted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(size, "MOST_DENSE", 70)
    monkeypatch.setattr(sparse_solve, "MOST_STEPS", 2)
    assert paint(METHODS["search"]).report.notes == (
        "the textures' own system was left after 2 steps, short of its tolerance",
    )
    assert paint(METHODS["mccool"]).report.status is Status.BUDGET


REFUSED = [
    (homofact.Search(size=128), "size: found 2 textures, the largest 128 texels wide: solving them needs about "),
    (homofact.McCool(size=200), "size: found 2 textures, the largest 200 texels wide: solving them needs about "),
    (homofact.Cole(size=200), "size: found 2 textures, the largest 200 texels wide: solving them needs about "),
    (homofact.Search(size=80, search_size=0), "search_size: a search on 14400 texels needs about 16.0 GB of memory, "),
    (homofact.McCool(size=100, solver="qr"), "solver: found qr and 2 textures, the largest 100 texels wide: it needs"),
    (homofact.McCool(size=60, confidence=True), "confidence: found 2 textures, the largest 60 texels wide: every te"),
    (homofact.Search(size=60, quantize="png8"), "quantize: found 2 textures, the largest 60 texels wide: whole num"),
    (homofact.Search(bytes=2**20), "size: found 3 textures, the largest 170 texels wide: solving them needs about "),
]


@pytest.mark.parametrize(("method", "message"), REFUSED, ids=lambda each: getattr(each, "name", ""))
def test_what_the_machine_cannot_hold_is_refused_before_the_search(method, message: str, monkeypatch) -> None:
    def never(*_: object) -> None:
        raise AssertionError("searched")

    monkeypatch.setattr(search_fit, "StructureSearch", never)
    monkeypatch.setattr(size, "memory_of_machine", lambda: 1.1 * 2**30)
    with pytest.raises(BadInput) as caught:
        paint(method)
    assert str(caught.value).startswith(message)
    assert "1.1 GB are there; expected" in str(caught.value)
