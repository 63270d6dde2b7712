"""One cell of the atlas: a method on a stressed problem, and whether the program reports the failure.

The fit gets the stressed samples as a command would pass them, with its own held-out part, and reports its status and
verdict. Then it is judged on clean samples without stress, in log space with one ε for all, and its error is compared
with that of the same method without stress. The fit is bad if the error of its reflected light, as a picture shows it,
exceeds `BAD_LIGHT` in a band of angles, or if it explains less than `LEAST_EXPLAINED` of the variance of the clean
logarithms.

The error bar of total reflected light is compared with the clean light in bands of incidence within the range of the
bar: it is correct if it contains the true error of the worst band.

Notes ("the time was up") and findings do not count as a warning. A warning that the unstressed fit also gets does not
degrade a cell, but a fit with a warning is not silent.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any, ClassVar

import torch
from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.samples import Samples
from homofact.brdf.source import Source
from homofact.brdf.source_names import HELD_OUT
from homofact.errors import BadInput, SolverFailure, Status
from homofact.evaluation.compare import ComparisonRow, fit_and_measure
from homofact.evaluation.metrics import measure
from homofact.evaluation.verdict.flux import flux_of, misplaced, worst_band
from homofact.geometry.directions import to_spherical
from homofact.methods.method import Method
from homofact.methods.table import METHODS, method_class, settings_of_class
from homofact.stability.problem import Problem
from homofact.stability.real import MissingMeasurement

# Of the judgement, whatever the fit's own ε is: values under a hundredth of the mean count alike.
JUDGING_EPSILON = 1e-2
DEGRADED = 2.0
WRONG = 10.0
# Log MSE under which an error is no concern (an RMS of 5%): a factor over less would measure what nobody sees.
WORTH_AN_ERROR = 2.5e-3
BAD_LIGHT, LEAST_EXPLAINED = 0.15, 0.9


class CellOutcome(Enum):
    """What became of a cell; the value is the word in the CSV."""

    OK = "ok"
    DEGRADED = "degraded"
    REFUSED = "refused"
    SILENT = "silently wrong"
    CRASHED = "crashed"
    NONE = "not applicable"
    ABSENT = "skipped"


@dataclass(frozen=True)
class Cell:
    """One cell: `factor` is `error` / max(`reference`, WORTH_AN_ERROR), clean log MSE each; None without a fit.

    `stated` is the error bar of total reflected light as a fraction, or None if there is no bar. `true` is the true
    error, measured on the clean samples. `light` is the misplaced light as a share of the clean light. `off` is the
    fit's light divided by the clean light in the worst band of angles. `bad` is whether the fit is bad, as defined at
    the start of this module. `said` are the warnings of the fit's verdict and status. `new` is the number of them that
    the unstressed fit does not have. `message` is the error if the fit was refused or crashed. `condition` and
    `determined` are the verdict's figures, `train` and `held_out` the fit's own log MSE.
    """

    method: str
    stressor: str
    strength: float
    label: str
    outcome: CellOutcome
    factor: float | None = None
    error: float | None = None
    reference: float | None = None
    light: float | None = None
    off: float | None = None
    bad: bool = False
    stated: float | None = None
    true: float | None = None
    said: tuple[str, ...] = ()
    new: int = 0
    message: str = ""
    condition: float | None = None
    determined: float | None = None
    train: float | None = None
    held_out: float | None = None
    seconds: float = 0.0

    @property
    def held(self) -> bool | None:
        """Whether the true error lies within the stated bar; None where there is no bar, or no true error."""
        return None if self.stated is None or self.true is None else self.true <= self.stated


@dataclass(frozen=True)
class CellErrors:
    """A finished fit: its errors on the clean samples, and its warnings `said`, by name."""

    error: float
    explained: float
    light: float
    off: float
    stated: float | None
    true: float | None
    said: dict[str, str]
    row: ComparisonRow


Fitter = Callable[[Source, Method], ComparisonRow]


def fit_row(source: Source, settings: Method) -> ComparisonRow:
    """Fit the source, and return the fit with its verdict, as the commands do."""
    return fit_and_measure(source, settings, HELD_OUT)


def said_of(row: ComparisonRow) -> dict[str, str]:
    """Return the warnings of a fit, by name: the warning of its verdict, and that of its status.

    A search that has used its whole effort does not warn, because every search with a small effort ends in this way.
    """
    said = {} if row.verdict.trusted else {"warning": row.verdict.summary}
    if row.report.status in (Status.FALLBACK, Status.INTERRUPTED):
        said.setdefault("status", row.report.status.remedy)
    return said


def classify(factor: float, said: int, new: int) -> CellOutcome:
    """Classify a finished fit by its factor (crashed if not finite), its number of warnings, and the new ones."""
    if not math.isfinite(factor):
        return CellOutcome.CRASHED
    if factor > WRONG and said == 0:
        return CellOutcome.SILENT
    return CellOutcome.DEGRADED if factor > DEGRADED or new > 0 else CellOutcome.OK


def method_for(name: str, problem: Problem, base: Mapping[str, Any]) -> Method | None:
    """Return the method with its settings of `base`, and the first of the problem's alternatives that it supports.

    Returns None if the method supports no alternative.
    """
    own = settings_of_class(method_class(name))
    for choice in problem.settings:
        if set(choice) <= set(own):
            try:
                return METHODS[name](**({setting: value for setting, value in base.items() if setting in own} | choice))
            except BadInput:
                continue
    return None


def judge_fit(problem: Problem, settings: Method, fitter: Fitter) -> CellErrors:
    """Fit the problem and judge the fit on its clean samples. Raises what the fit raises."""
    samples = replace(problem.samples, all_azimuths=problem.kind != "measurement")
    source = Source("atlas", problem.kind, samples, NeverEvaluated(samples.channels), 0.0, 0.0)
    row = fitter(source, settings)
    clean = problem.clean
    transform = LogTransform.of(clean, JUDGING_EPSILON)
    error = measure(row.factorization, clean, transform).log_mse
    logs = transform.forward(clean.values)
    explained = 1 - error / max(float((logs - logs.mean(0)).square().mean()), 1e-6)
    light, values = flux_of(clean), row.factorization.evaluate(clean.wi, clean.wo).to(clean.values)
    band = worst_band(clean, light, values)
    off = 1.0 if band is None else band[0]
    bar = row.verdict.bars.of("albedo")
    true = _albedo_error(clean, light, values, bar.degrees)
    return CellErrors(error, explained, misplaced(light, clean.values, values), off, bar.error, true, said_of(row), row)


def _albedo_error(clean: Samples, light: Tensor, values: Tensor, degrees: tuple[float, float]) -> float | None:
    """The error of total reflected light as a share, in the worst band of incidence of the range; None for too few."""
    theta = torch.rad2deg(to_spherical(clean.wi)[0])
    inside = (theta >= degrees[0]) & (theta <= degrees[1])
    if not bool(inside.any()):
        return None
    band = worst_band(clean.select(inside), light[inside], values[inside], ("θi",))
    if band is None:
        return None
    return max(band[0], 1 / band[0]) - 1 if band[0] > 0 else math.inf


def run_cell(empty: Cell, make: Callable[[], Problem], references: "References", fitter: Fitter = fit_row) -> Cell:
    """Fill in a cell: make the problem, fit it and its reference, and classify.

    Only `MissingMeasurement` and interrupts pass through.
    """
    try:
        problem = make()
        settings = method_for(empty.method, problem, references.base)
        if settings is None:
            return replace(empty, outcome=CellOutcome.NONE)
        judged = judge_fit(problem, settings, fitter)
    except MissingMeasurement:
        raise
    except (BadInput, SolverFailure) as error:
        return replace(empty, outcome=CellOutcome.REFUSED, message=f"{type(error).__name__}: {error}")
    except Exception as error:
        message = f"{type(error).__name__}: {' '.join(str(error).split())}"
        return replace(empty, outcome=CellOutcome.CRASHED, message=message)
    reference = references.of(empty.method, problem, fitter)
    new = len(judged.said.keys() - reference.said.keys())
    factor = judged.error / max(reference.error, WORTH_AN_ERROR)
    verdict = judged.row.verdict
    return replace(
        empty,
        outcome=classify(factor, len(judged.said), new),
        factor=factor,
        error=judged.error,
        reference=reference.error,
        light=judged.light,
        off=judged.off,
        stated=judged.stated,
        true=judged.true,
        bad=not (abs(judged.off - 1) <= BAD_LIGHT and judged.explained >= LEAST_EXPLAINED),
        said=tuple(judged.said.values()),
        new=new,
        message="" if math.isfinite(factor) else f"the error is {judged.error}",
        condition=verdict.figures.system.condition,
        determined=verdict.figures.system.determined,
        train=judged.row.train.log_mse,
        held_out=judged.row.held_out.log_mse,
        seconds=judged.row.seconds_total,
    )


class References:
    """The unstressed fits, each made once; problems without a `reference` of their own use `common`."""

    def __init__(self, common: Problem, base: Mapping[str, Any]) -> None:
        """Nothing is fitted yet."""
        self.base = base
        self._common = common
        self._fitted: dict[tuple[str, str], CellErrors] = {}

    def common(self, name: str, fitter: Fitter = fit_row) -> CellErrors:
        """Return the fit of the common unstressed problem by the method `name`."""
        return self.of(name, self._common, fitter)

    def of(self, name: str, problem: Problem, fitter: Fitter) -> CellErrors:
        """Return the unstressed fit by the method `name`, with which a problem's fit is compared.

        The method gets the first of the reference's alternative settings that it supports.
        """
        unstressed = problem.reference or self._common
        key = (name, unstressed.key)
        if key not in self._fitted:
            settings = method_for(name, unstressed, self.base)
            assert settings is not None  # it asks for nothing of its own
            self._fitted[key] = judge_fit(unstressed, settings, fitter)
        return self._fitted[key]


@dataclass(frozen=True)
class NeverEvaluated:
    """A placeholder for the reflectance of a source that is never rendered."""

    channels: tuple[str, ...]
    nbytes: int = 0
    fetches: int = 0
    of_samples: ClassVar[bool] = True

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Raise AssertionError, because the errors of a cell are measured on samples."""
        raise AssertionError("a stressed problem is judged on its own samples")
