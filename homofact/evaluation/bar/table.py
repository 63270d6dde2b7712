"""The models of the error bars and of the warning. A generated file, `table.json`, contains their constants.

`scripts/verdict/calibrate.py` writes this file from simulated fits and records their number, seed and hash. Every model
is linear in features (`bar.features`), and each feature is clipped to its range in the calibration. A bar is exp(m + q
s). Here m is a model of the log error, s is a model of the size of its residual, and q is the `RATE` quantile of
residual/s on fits that were used for neither model (conformal prediction with normalised residuals). The warning is a
logistic function of a linear model.
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
    """offset + Σ weight · (feature − mean), features clipped to [low, high]."""

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
    """A model of the log error of a quantity, one of its residual, and the `RATE` quantile of their ratio."""

    model: LinearModel
    spread: LinearModel
    quantile: float

    def bound(self, features: Mapping[str, float]) -> float:
        """Return the bound of |log(fit/source)|, or of a picture's error as a share of its light."""
        spread = max(self.spread.value(features), LEAST_SPREAD)
        return math.exp(self.model.value(features) + self.quantile * spread)


@dataclass(frozen=True)
class Table:
    """All models: of the bars of `QUANTITIES` and of the albedo by angle, for correct and for faulty data.

    `bars[kind][quantity]` is a model; `angles[kind]` has one model for each of `energy.ALBEDO_DEGREES`. `kind` is
    "right" or "fault". `warning` gives the log odds that a fit is bad, and `threshold` the probability at which the
    verdict warns. `made` records how the table was made: script, seed, fits, hash, version.
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
