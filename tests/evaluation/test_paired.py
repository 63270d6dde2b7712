"""Two fits, or two methods split by split: ratios by hand, their intervals, and what cannot be compared."""

from dataclasses import replace
from typing import Any

import pytest
import torch

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.samples import Samples
from homofact.brdf.source import open_source
from homofact.evaluation.compare import ComparisonRow, fit_and_measure
from homofact.evaluation.paired import ErrorRatio, MethodPair, error_ratios, split_by_split
from homofact.evaluation.repeats import RepeatedRows
from homofact.factor.factorization import Factorization
from homofact.methods.mccool import McCool

pytestmark = pytest.mark.usefixtures("unseen")


@pytest.fixture(scope="module")
def row() -> ComparisonRow:
    return fit_and_measure(open_source("material:phong-10", count=200), McCool(size=4))


def rows_of(row: ComparisonRow, errors: dict[int, list[tuple[float, float]]]) -> RepeatedRows:
    """Rows with these (log_mse, mse), by the seed of the split; the fits of a split differ in their own seeds."""
    made = []
    for split, several in errors.items():
        for seed, (log_mse, mse) in enumerate(several):
            held_out = replace(row.held_out, log_mse=log_mse, mse=mse)
            settings = replace(row.settings, seed=seed)
            made.append(replace(row, held_out=held_out, split=replace(row.split, seed=split), settings=settings))
    return RepeatedRows(tuple(made))


def test_each_split_gives_one_ratio(row: ComparisonRow) -> None:
    # The means of the two, 5.5 and 5, say that "b" is better; their spread hides that "a" is, on two splits of three.
    a = rows_of(row, {0: [(0.5, 6.0)], 1: [(1.0, 6.0)], 2: [(15.0, 6.0)]})
    b = rows_of(row, {0: [(1.0, 3.0)], 1: [(2.0, 12.0)], 2: [(12.0, 6.0)]})
    (pair,) = split_by_split({"a": a, "b": b})
    assert (pair.method, pair.other) == ("b", "a")
    assert pair.ratios == {"log_mse": (2.0, 2.0, 0.8), "mse": (0.5, 2.0, 1.0)}
    # Equal is not lower.
    assert (pair.lower("log_mse"), pair.lower("mse")) == (1, 1)
    assert (pair.spread("log_mse").low, pair.spread("log_mse").high) == (0.8, 2.0)
    assert "log_mse lower on 1 of 3 splits, 0.8 to 2 times" in pair.words
    # A ratio just above 1 is not written as 1.
    assert "0.38 to 1.02 times" in MethodPair("a", "b", {"mse": (0.38, 1.017)}).words
    record = pair.record()
    assert record["errors"]["log_mse"] == {"ratios": [2.0, 2.0, 0.8], "lower_on": 1, "splits": 3}


def test_seeds_of_a_split_count_once(row: ComparisonRow) -> None:
    a = rows_of(row, {0: [(1.0, 1.0), (3.0, 1.0)], 1: [(1.0, 1.0), (1.0, 3.0)]})
    b = rows_of(row, {0: [(8.0, 8.0), (8.0, 8.0)], 1: [(4.0, 4.0), (4.0, 4.0)]})
    (pair,) = split_by_split({"b": b, "a": a})
    assert pair.ratios == {"log_mse": (0.25, 0.25), "mse": (0.125, 0.5)}


def test_what_cannot_be_compared_is_left_out(row: ComparisonRow) -> None:
    a = rows_of(row, {0: [(1.0, 1.0)], 1: [(1.0, 1.0)], 2: [(1.0, 1.0)]})
    assert split_by_split({"a": a}) == []
    # One split is no repeat, and neither is one common split: Ctrl-C may have ended the other method's fits.
    assert split_by_split({"a": a.of_split(0), "b": rows_of(row, {0: [(2.0, 2.0)]})}) == []
    assert split_by_split({"a": a, "b": rows_of(row, {0: [(2.0, 2.0)]})}) == []
    nothing = rows_of(row, {0: [(2.0, 0.0)], 1: [(2.0, 2.0)], 2: [(4.0, 4.0)]})
    (pair,) = split_by_split({"a": a, "b": nothing})
    assert pair.ratios["log_mse"] == (0.5, 0.25)
    fit = row.factorization
    assert isinstance(fit, Factorization)
    other = replace(fit, transform=replace(fit.transform, epsilon=0.5))
    by_another = RepeatedRows(tuple(replace(each, factorization=other) for each in rows_of(row, {
        0: [(2.0, 2.0)], 1: [(2.0, 2.0)],
    }).rows))  # fmt: skip
    assert split_by_split({"a": a, "b": by_another}) == []


def test_every_pair_has_the_lower_mean_first(row: ComparisonRow) -> None:
    given = {
        name: rows_of(row, {0: [(error, 1.0)], 1: [(error, 1.0)]}) for name, error in (("c", 4), ("a", 1), ("b", 2))
    }
    pairs = [(pair.method, pair.other, pair.ratios["log_mse"]) for pair in split_by_split(given)]
    assert pairs == [("a", "b", (0.5, 0.5)), ("a", "c", (0.25, 0.25)), ("b", "c", (0.5, 0.5))]


class _Off:
    """Values that are those of the samples times exp(an error per sample)."""

    def __init__(self, samples: Samples, logs: torch.Tensor, transform: LogTransform) -> None:
        self.transform, self._values = transform, samples.values * logs.exp()[:, None]

    def evaluate(self, wi: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
        return self._values


def test_the_ratio_of_two_fits_has_the_interval_of_their_samples() -> None:
    drawn = open_source("material:phong-10", count=500).samples
    samples = Samples(wi=drawn.wi, wo=drawn.wo, values=drawn.values, channels=drawn.channels, isotropic=True)
    transform = LogTransform.of(samples, 1e-9)
    order = torch.randperm(500, generator=torch.Generator().manual_seed(1))
    noise = torch.linspace(-0.3, 0.3, 500, dtype=torch.float64)[order]

    def ratio(first: torch.Tensor, second: torch.Tensor) -> ErrorRatio:
        fits: Any = [_Off(samples, logs, transform) for logs in (first, second)]
        return error_ratios(fits[0], fits[1], samples)["log_mse"]

    # Half the error at every sample is certain; the spread of the samples does not matter.
    found = ratio(noise / 2, noise)
    assert (found.ratio, found.low, found.high) == (pytest.approx(0.25), pytest.approx(0.25), pytest.approx(0.25))
    assert (found.clear, found.count) == (True, 500)
    # One sample that decides is no evidence: without it the other fit is better.
    one = torch.zeros(500, dtype=torch.float64)
    one[7] = 4.0
    found = ratio(noise * 1.05, noise + one)
    assert found.ratio < 0.9
    assert not found.clear
    assert found.low < found.ratio < 1 < found.high
    # Errors that are the same but for chance: expected ± is that of a mean of 500 squares.
    found = ratio(noise, noise.flip(0))
    assert not found.clear
    assert (1 - found.low, found.high - 1) == (pytest.approx(0.11, abs=0.03), pytest.approx(0.12, abs=0.04))
    assert found == ratio(noise, noise.flip(0))
    assert found.record()["interval"] == [found.low, found.high]
