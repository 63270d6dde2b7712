"""The constants of the error bars and of the warning: one generated file, `table.json`, and the models in it.

Made by `scripts/verdict/calibrate.py` from simulated fits, whose number, seed and hash it states. Every model is
linear in features (`bar.features`), each clipped to the range that was seen. A bar is exp of a model of the log error,
plus a model of how far that misses times the `RATE` quantile of this ratio on fits that neither had seen (conformal
prediction with normalised residuals); the warning is a logistic.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from typing import Any

RATE = 0.9
LEAST_SPREAD = 0.25  # of logs: no model knows an error better
QUANTITIES = ("albedo", "highlight", "sky")


@dataclass(frozen=True)
class LinearModel:
    """offset + Σ weight · (feature − mean), features clipped to [low, high]; `columns` holds the last four by name."""

    offset: float
    columns: Mapping[str, tuple[float, float, float, float]]

    def value(self, features: Mapping[str, float]) -> float:
        """Return the model's value."""
        return self.offset + sum(
            weight * (min(max(features[name], low), high) - mean)
            for name, (weight, mean, low, high) in self.columns.items()
        )


@dataclass(frozen=True)
class BarModel:
    """A model of the log error of a quantity, one of how far it misses, and by how many times that nine of ten do."""

    model: LinearModel
    spread: LinearModel
    quantile: float

    def bound(self, features: Mapping[str, float]) -> float:
        """Return the bound of |log(fit/source)|, or of the share of a picture's light."""
        spread = max(self.spread.value(features), LEAST_SPREAD)
        return math.exp(self.model.value(features) + self.quantile * spread)


@dataclass(frozen=True)
class Table:
    """All models: bars of `QUANTITIES` and of the albedo by angle, if the data are right and if anything may be wrong.

    `bars[kind][quantity]` and `angles[kind]`, a model for each of `energy.ALBEDO_DEGREES`; `kind` is "right" or
    "fault". `warning` gives the log odds that a fit is bad, `threshold` the probability at which the verdict warns.
    `made` says by what the table was made: script, seed, fits, hash, version.
    """

    bars: Mapping[str, Mapping[str, BarModel]]
    angles: Mapping[str, tuple[BarModel, ...]]
    warning: LinearModel
    threshold: float
    made: Mapping[str, Any]

    def score(self, features: Mapping[str, float]) -> float:
        """Return the probability that a fit is bad."""
        return 1 / (1 + math.exp(-min(max(self.warning.value(features), -30), 30)))

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> "Table":
        """Return the table of a JSON record."""
        bars = {kind: {name: _bar(model) for name, model in models.items()} for kind, models in record["bars"].items()}
        angles = {kind: tuple(map(_bar, models)) for kind, models in record["angles"].items()}
        return cls(bars, angles, _linear(record["warning"]), record["threshold"], record["made"])


@lru_cache(maxsize=1)
def table() -> Table:
    """Return the table of this version."""
    text = resources.files("homofact.evaluation.bar").joinpath("table.json").read_text(encoding="utf-8")
    return Table.of(json.loads(text))


def _linear(record: Mapping[str, Any]) -> LinearModel:
    return LinearModel(record["offset"], {name: tuple(column) for name, column in record["columns"].items()})


def _bar(record: Mapping[str, Any]) -> BarModel:
    return BarModel(_linear(record["model"]), _linear(record["spread"]), record["quantile"])
