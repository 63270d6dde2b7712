"""Read the scores of Lavoué et al. 2021, fit the law of opinions to them, and validate it by leaving parts out.

A score is DISTANCE = (5 − mean grade)/4 of about 30 people. The law and its form are `homofact.evaluation.opinion`'s.
What is left out, materials, families or methods, takes no part in the fit, in the choice of the index of ABC, and in
the quantiles of the interval.
"""

import csv
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import spearmanr

from homofact.errors import BadInput
from homofact.evaluation.opinion import OpinionLaw
from homofact.files.reading import read_bytes

PEOPLE = 30  # who graded a picture: the denominators of the scores are four times 28 to 32
COVERED = 0.9
_DRAWS = 1000
_COLUMNS = ["METHOD", "BRDF", "DISTANCE"]
# Families by words of the materials' names, the first that fits.
FAMILIES = (
    ("phenolics", ("phenolic",)),
    ("fabrics", ("fabric", "felt", "foam")),
    ("metallic paints", ("metallic-paint", "color-changing", "gold-paint", "silver-paint", "pearl")),
    ("paints", ("paint", "latex")),
    ("plastics and rubbers", (
        "plastic", "acrylic", "rubber", "pvc", "nylon", "delrin", "teflon", "polyethylene", "bball", "aventurnine",
    )),
    ("woods", ("cherry", "maple", "fruitwood", "pine", "natural", "oak", "walnut")),
    ("metals", ("alum", "brass", "chrome", "steel", "ss440", "nickel", "tungsten", "hematite", "two-layer")),
)  # fmt: skip


@dataclass(frozen=True)
class Judged:
    """Scores beside differences: one row for each approximation of a material.

    Attributes
    ----------
    material, family, method : (N,) names.
    distance : (N,) the study's scores.
    differences : (N, K) ΔE under K readings of what the study showed; rows of methods without variants have K equal.
    """

    material: np.ndarray
    family: np.ndarray
    method: np.ndarray
    distance: np.ndarray
    differences: np.ndarray

    def part(self, which: np.ndarray) -> "Judged":
        """The rows of a mask or of indices."""
        return Judged(*(getattr(self, name)[which] for name in self.__dataclass_fields__))

    def variant(self) -> int:
        """The reading whose differences rank most like the scores, over the rows in which readings differ."""
        varied = (self.differences != self.differences[:, :1]).any(1)
        if not varied.any():
            return 0
        ranks = [rank_correlation(column, self.distance[varied]) for column in self.differences[varied].T]
        return int(np.argmax(ranks))


@dataclass(frozen=True)
class Foretold:
    """The scores that laws foretold for rows that were left out, and the ends of the intervals, (N,) each."""

    distance: np.ndarray
    low: np.ndarray
    high: np.ndarray


def plain(name: str) -> str:
    """A material's name by letters and digits alone."""
    return "".join(c for c in name.lower() if c.isalnum())


def family_of(name: str) -> str:
    """The family of a material by its name."""
    spelt = name.lower().replace("_", "-")
    return next((family for family, words in FAMILIES if any(word in spelt for word in words)), "others")


def read_distances(path: Path) -> dict[tuple[str, str], float]:
    """The scores by method and `plain` material. Raises BadInput for a file of another form."""
    rows = list(csv.reader(read_bytes(path, "the scores as CSV").decode("utf-8").splitlines(), delimiter=";"))
    if not rows or rows[0] != _COLUMNS:
        raise BadInput(where=path, found=";".join(rows[0]) if rows else "nothing", expected=";".join(_COLUMNS))
    found: dict[tuple[str, str], float] = {}
    for number, row in enumerate(rows[1:], 2):
        try:
            method, material, score = row
            found[method, plain(material)] = distance = float(score)
        except ValueError:
            raise BadInput(where=f"{path}, line {number}", found=";".join(row), expected="three cells") from None
        if not 0 <= distance <= 1:
            raise BadInput(where=f"{path}, line {number}", found=score, expected="a distance from 0 to 1")
    return found


def fit_law(delta_e: np.ndarray, distance: np.ndarray) -> OpinionLaw:
    """The law by least squares with a soft L1 loss, its interval by the quantiles of its residuals."""

    def law(p: np.ndarray) -> OpinionLaw:
        return OpinionLaw(1 / (1 + math.exp(-p[0])), math.exp(p[1]), math.exp(p[2]), 0.0, 0.0)

    def residuals(p: np.ndarray) -> np.ndarray:
        return distances(law(p), delta_e) - distance

    start = np.array([-2.0, math.log(max(float(np.median(delta_e)), 1e-6)), 0.0])
    bounds = ([-8, -10, math.log(0.3)], [3, 10, math.log(6)])
    found = law(least_squares(residuals, start, bounds=bounds, loss="soft_l1", f_scale=0.1).x)
    expected = distances(found, delta_e)
    scaled = (distance - expected) / np.sqrt(expected * (1 - expected))
    below, above = np.quantile(scaled, [(1 - COVERED) / 2, (1 + COVERED) / 2])
    return OpinionLaw(found.floor, found.middle, found.power, min(float(below), 0.0), max(float(above), 0.0))


def distances(law: OpinionLaw, delta_e: np.ndarray) -> np.ndarray:
    """`OpinionLaw.distance` of an array."""
    ratio = (delta_e / law.middle) ** law.power
    return law.floor + (1 - law.floor) * ratio / (1 + ratio)


def left_out(rows: Judged, groups: np.ndarray) -> Foretold:
    """What is foretold for each group (N,) by a law of all the others, which also choose the variant."""
    made = Foretold(*(np.empty(len(groups)) for _ in range(3)))
    for group in np.unique(groups):
        out = groups == group
        rest = rows.part(~out)
        # What nobody but the group itself can tell is taken from all rows.
        chosen = (rest if (rest.differences != rest.differences[:, :1]).any() else rows).variant()
        law = fit_law(rest.differences[:, chosen], rest.distance)
        expected = distances(law, rows.differences[out, chosen])
        scatter = np.sqrt(expected * (1 - expected))
        made.distance[out] = expected
        made.low[out] = (expected + law.below * scatter).clip(0, 1)
        made.high[out] = (expected + law.above * scatter).clip(0, 1)
    return made


def rank_correlation(first: np.ndarray, second: np.ndarray) -> float:
    """Spearman's ρ."""
    return float(np.asarray(spearmanr(first, second).statistic))  # pyright: ignore[reportAttributeAccessIssue]


def resampled(measure: Callable[[np.ndarray], float], materials: np.ndarray, seed: int) -> tuple[float, float]:
    """The 95% bootstrap interval of a measure of row indices, drawn by whole materials."""
    dice = np.random.default_rng(seed)
    rows = [np.flatnonzero(materials == name) for name in np.unique(materials)]
    draws = [np.concatenate([rows[k] for k in dice.integers(len(rows), size=len(rows))]) for _ in range(_DRAWS)]
    low, high = np.quantile([measure(draw) for draw in draws], [0.025, 0.975])
    return float(low), float(high)


def noise_bound(distance: np.ndarray, seed: int) -> float:
    """Spearman's ρ of a study with another by `PEOPLE` others, if grades were all 1 or 5: the most they can scatter."""
    dice = np.random.default_rng(seed)
    again = [dice.binomial(PEOPLE, distance) / PEOPLE for _ in range(_DRAWS)]
    return float(np.mean([rank_correlation(distance, each) for each in again]))


def validated(rows: Judged, groups: np.ndarray, seed: int) -> Sequence[str]:
    """ρ with its interval, how many intervals cover, their mean width and the RMS error, as cells; in grades."""
    found = left_out(rows, groups)
    rho = rank_correlation(found.distance, rows.distance)
    low, high = resampled(lambda draw: rank_correlation(found.distance[draw], rows.distance[draw]), rows.material, seed)
    covered = ((rows.distance >= found.low) & (rows.distance <= found.high)).mean()
    width = 4 * (found.high - found.low).mean()
    error = 4 * math.sqrt(((found.distance - rows.distance) ** 2).mean())
    return f"{rho:.2f}", f"{low:.2f} to {high:.2f}", f"{covered:.0%}", f"{width:.2f}", f"{error:.2f}"
