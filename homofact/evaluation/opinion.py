"""Predict the grade that people would give a picture of a fit beside its source, with a law fitted to a study.

Lavoué, Bonneel, Farrugia and Soler 2021 had 1,005 people grade pictures of approximations of the MERL materials beside
their references, from 1, very poor, to 5, excellent; about 30 people graded each pair. Their distance d is (5 − mean
grade)/4. `scripts/verdict/opinions.py` fitted

    d(ΔE) = d0 + (1 − d0) r/(1 + r),   r = (ΔE/m)^k,

to the scores of three approximations whose parameters are public. ΔE is the mean CIEDE2000 of two spheres under the
light of the study (`evaluation.fixed_pictures`). d0 is the distance for identical pictures, which people do not always
grade with 5. 90% of the study's distances lie between d + q √(d (1 − d)) for the 5% and the 95% quantile q of the
residuals.

The table `opinion.json` contains these constants and the light, but no data of the study.
"""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from homofact.errors import BadInput
from homofact.files.reading import read_bytes

VERSION = 1  # of the table's form
TABLE = Path(__file__).with_name("opinion.json")
BEST, WORST = 5.0, 1.0
# By how much less than identical pictures a fit may be graded that counts as alike: thirty people's mean scatters so.
UNSEEN = 0.2


@dataclass(frozen=True)
class Opinion:
    """The expected mean grade of a fit, from 1 to 5, with a 90% interval for the mean grade of thirty people.

    Attributes
    ----------
    delta_e : mean CIEDE2000 under the study's light.
    score, low, high : the expected mean grade, and the ends of its interval.
    best : the expected grade of identical pictures.
    """

    delta_e: float
    score: float
    low: float
    high: float
    best: float

    def record(self) -> dict[str, float]:
        """Return the JSON form."""
        return {
            "delta_e_study": self.delta_e,
            "opinion": self.score,
            "opinion_low": self.low,
            "opinion_high": self.high,
            "opinion_best": self.best,
        }


@dataclass(frozen=True)
class OpinionLaw:
    """The law that the module docstring defines.

    Attributes
    ----------
    floor, middle, power : d0, m and k.
    below, above : the quantiles q of the residuals over √(d (1 − d)), 5% and 95%.
    """

    floor: float
    middle: float
    power: float
    below: float
    above: float

    def __post_init__(self) -> None:
        """Refuse numbers by which a larger difference would not be graded worse. Raises BadInput."""
        numbers = (self.floor, self.middle, self.power, self.below, self.above)
        fine = all(map(math.isfinite, numbers)) and 0 <= self.floor < 1 and self.middle > 0 and self.power > 0
        if not (fine and self.below <= 0 <= self.above):
            raise BadInput(where="law of opinions", found=str(numbers), expected="a law that rises, and an interval")

    def distance(self, delta_e: float) -> float:
        """Return d for a difference ΔE ≥ 0. Raises BadInput for other numbers."""
        if not delta_e >= 0:
            raise BadInput(where="ΔE", found=delta_e, expected="at least 0")
        if math.isinf(delta_e):
            return 1.0
        ratio = (delta_e / self.middle) ** self.power
        return self.floor + (1 - self.floor) * ratio / (1 + ratio)

    def opinion(self, delta_e: float) -> Opinion:
        """Return the grade of a difference, with its interval. Raises BadInput as `distance`."""
        score = grade(self.distance(delta_e))
        return Opinion(delta_e, score, *self.interval(score), grade(self.floor))

    def interval(self, score: float) -> tuple[float, float]:
        """Return the 90% interval of a study's mean grade whose expected value is `score`, both from 1 to 5."""
        expected = (BEST - score) / (BEST - WORST)
        scatter = math.sqrt(max(expected * (1 - expected), 0.0))
        near, far = (min(max(expected + q * scatter, 0.0), 1.0) for q in (self.below, self.above))
        return grade(far), grade(near)

    @property
    def unseen(self) -> float:
        """The ΔE up to which the expected grade is within `UNSEEN` of that of identical pictures."""
        share = UNSEEN / (BEST - WORST) / (1 - self.floor)
        return self.middle * (share / (1 - share)) ** (1 / self.power)


def grade(distance: float) -> float:
    """Return the mean grade from 1 to 5 of a distance d."""
    return BEST - (BEST - WORST) * distance


@dataclass(frozen=True)
class StudyLight:
    """A smooth light that replaces the Grace probe: a constant part and lobes a exp(κ (cos − 1)) for its lamps.

    Attributes
    ----------
    even : (3,) constant radiance from all directions.
    lamps : (L, 7), unit direction (y up), sharpness κ, and radiance R, G, B of each.
    white : the linear display value of the median of a white diffuse sphere.
    """

    even: Tensor
    lamps: Tensor
    white: float

    def radiance(self, directions: Tensor) -> Tensor:
        """Return radiance (..., 3) from unit world directions (..., 3)."""
        place, sharpness, colour = self.lamps[:, :3], self.lamps[:, 3], self.lamps[:, 4:]
        return self.even + torch.exp(sharpness * (directions @ place.T - 1)) @ colour


@dataclass(frozen=True)
class OpinionTable:
    """The content of the package's table: the law, the light, and their origin."""

    law: OpinionLaw
    light: StudyLight
    made_from: Mapping[str, Any]


def digest(content: Mapping[str, Any]) -> str:
    """Return the SHA-256 of a table's law, light and origin, which the table states as "sha256"."""
    kept = {name: content[name] for name in ("law", "light", "made_from")}
    return hashlib.sha256(json.dumps(kept, sort_keys=True).encode()).hexdigest()


@lru_cache(maxsize=2)
def opinion_table(path: Path = TABLE) -> OpinionTable:
    """Return the table in the package.

    Raises BadInput where it is missing, damaged, changed by hand, or of another version.
    """
    expected = f"the table of version {VERSION} that homofact installs: install homofact again"
    try:
        stored = json.loads(read_bytes(path, "the table of opinions").decode("utf-8"))
        version = stored["version"]
        if version != VERSION:
            raise BadInput(f"is of version {version}", where=path, expected=expected)
        if stored["sha256"] != digest(stored):
            raise BadInput("does not match its own SHA-256", where=path, expected=expected)
        light = stored["light"]
        return OpinionTable(
            OpinionLaw(**stored["law"]),
            StudyLight(
                torch.tensor(light["even"], dtype=torch.float64),
                torch.tensor(light["lamps"], dtype=torch.float64).reshape(-1, 7),
                float(light["white"]),
            ),
            stored["made_from"],
        )
    except BadInput:
        raise
    except (ValueError, TypeError, KeyError) as error:
        raise BadInput("cannot be read as the table of opinions", where=path, expected=expected) from error
