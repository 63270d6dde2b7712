"""The tolerance of a plan: kinds of error, limits on them, and the margins for other views.

* `cole`: mean squared error of logarithms on held-out samples; the lighting does not matter to it;
* `delta_e`, `delta_e_p95`, `delta_e_peak`: CIEDE2000 of a lit sphere's pixels in one view, their mean, 95th percentile
  and greatest, each in the evaluated view where it is largest;
* `reflected`: √(Σ |B − B̂|²/Σ |B|²) of the radiance, over the pixels and channels of a view, then RMS over the views.
  All views have the same weight; otherwise a view with light at grazing angles would dominate;
* `delta_e_study`: mean CIEDE2000 of a sphere under the light of the study of opinions (`evaluation.opinion`), which
  predicts the grade that people would give; the scene's lighting does not affect it.

The planner evaluates only some views, and coarsely. A limit is met if the error times `MARGINS` is within it. The
margins are set so that 95% of the plans that meet their limits also meet them in unseen views
(`scripts/planning/planner_blind.py`).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from homofact.errors import BadInput

KINDS = ("cole", "delta_e", "delta_e_p95", "delta_e_peak", "reflected", "delta_e_study")
# Of the fit alone, whatever the scene's lighting.
UNLIT = ("cole", "delta_e_study")
SEEN = KINDS[1:4]
MARGINS: Mapping[str, float] = {
    "cole": 1.0,
    "delta_e": 1.15,
    "delta_e_p95": 1.15,
    "delta_e_peak": 1.7,
    "reflected": 1.8,
    # Measured in the one picture that the law of opinions was fitted to.
    "delta_e_study": 1.0,
}
# As people read them.
WORDS: Mapping[str, str] = {
    "cole": "Cole error",
    "delta_e": "mean ΔE",
    "delta_e_p95": "95% quantile of ΔE",
    "delta_e_peak": "largest ΔE",
    "reflected": "error of reflected light",
    "delta_e_study": "mean ΔE of the study's picture",
}
# By `--tolerance`: "visible" keeps what people would grade within `evaluation.opinion.UNSEEN` of identical pictures.
NAMED = ("visible",)


@dataclass(frozen=True)
class Errors:
    """The errors of one representation under one lighting, by kind (`delta_e*`: CIEDE2000); NaN if unmeasured."""

    cole: float = math.nan
    delta_e: float = math.nan
    delta_e_p95: float = math.nan
    delta_e_peak: float = math.nan
    reflected: float = math.nan
    delta_e_study: float = math.nan

    def of(self, kind: str) -> float:
        """Return the error of this kind."""
        return float(getattr(self, kind))


@dataclass(frozen=True)
class Used:
    """The used share of a limit: `ratio` is margin · error/limit; the limit is met if it is at most 1."""

    ratio: float
    kind: str
    error: float


@dataclass(frozen=True)
class Tolerance:
    """(kind, limit) pairs, one or more, all to be met; `trusted` if the verdict must trust the choice too."""

    limits: tuple[tuple[str, float], ...]
    trusted: bool = False

    @classmethod
    def named(cls, name: str) -> "Tolerance":
        """Return the tolerance called `name`, one of `NAMED`. Raises BadInput for another name."""
        if name not in NAMED:
            raise BadInput(where="tolerance", found=repr(name), expected=f"one of {', '.join(NAMED)}")
        # It loads torch, and the commands read this module before they show any progress.
        from homofact.evaluation.opinion import opinion_table

        return cls.of(delta_e_study=float(f"{opinion_table().law.unseen:.3g}"))

    @classmethod
    def of(cls, *, trusted: bool = False, **limits: float) -> "Tolerance":
        """Make a tolerance from limits by kind: Tolerance.of(delta_e=1, delta_e_peak=10)."""
        return cls(tuple(limits.items()), trusted)

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds that are limited."""
        return tuple(kind for kind, _ in self.limits)

    @property
    def of_light(self) -> bool:
        """Return whether a limit is on light of the scene; one colour is then fitted to the light."""
        return any(kind not in UNLIT for kind in self.kinds)

    def uses(self, errors: Errors) -> tuple[Used, ...]:
        """Return how much of each limit the errors use, in the order of the limits."""
        return tuple(
            Used(MARGINS[kind] * errors.of(kind) / limit, kind, errors.of(kind)) for kind, limit in self.limits
        )

    def used(self, errors: Errors) -> Used:
        """Return the limit with the largest used share."""
        return max(self.uses(errors), key=lambda part: part.ratio)

    def describe(self) -> str:
        """In words: "mean ΔE at most 1 and largest ΔE at most 10"."""
        limits = [f"{WORDS[kind]} at most {limit:g}" for kind, limit in self.limits]
        return " and ".join([*limits, *(["a trusted verdict"] if self.trusted else [])])

    def record(self) -> dict[str, float | bool]:
        """Return the JSON form, which `of` takes."""
        return dict(self.limits) | ({"trusted": True} if self.trusted else {})
