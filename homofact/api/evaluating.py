"""Evaluating: the errors of a fit against its source, on samples that it has not seen where there are any."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from homofact.api.progress import Progress, ProgressSteps
from homofact.api.subjects import given_fit, given_source, open_given

if TYPE_CHECKING:
    from homofact.evaluation.appearance import Appearance
    from homofact.evaluation.metrics import SixErrors


@dataclass(frozen=True)
class EvaluateResult:
    """The errors of a fit.

    Attributes
    ----------
    source : str
        What it was compared with.
    known : bool
        Whether the training samples are those that the fit was made from.
    train, test : SixErrors
        On the training samples, and on those held out (all of them where nothing was); at random azimuths where the
        source is isotropic. `test.log_mse` is the Cole error.
    part : str
        What the test samples are: "held_out", or "source" where the fit may have seen them.
    metrics : dict
        The chosen metrics on the test samples; None where one is not defined.
    appearance : Appearance or None
        Albedo, highlight and pictures beside the source's; None if the source consists only of samples.
    conditions : list of str
        Under which conditions the metrics hold.
    """

    source: str
    known: bool
    train: "SixErrors"
    test: "SixErrors"
    part: str
    metrics: dict[str, float | None]
    appearance: "Appearance | None"
    conditions: list[str]

    @property
    def held_out(self) -> bool:
        """Whether the test samples are samples that the fit has not seen."""
        return self.part == "held_out"

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "source": self.source,
            "split_known": self.known,
            "error": {"train": self.train.record(), self.part: self.test.record()},
            "metrics": self.metrics,
            "appearance": None if self.appearance is None else self.appearance.record(),
            "metric_conditions": self.conditions,
        }


def evaluate(
    fit: Any, source: Any = None, *, metrics: Sequence[str] = ("six",), progress: Progress | None = None
) -> EvaluateResult:
    """Measure a fit against its source.

    A fit knows which samples were held out of it. A fit of all samples, as `fit` makes it, is measured on samples that
    it has seen; `factorize` and `compare` hold some out.

    Parameters
    ----------
    fit : Fit or path
        A fit, a result's folder, or a saved .npz file.
    source : source or path, optional
        What to compare with. The fit's own source is found by itself where it can be.
    metrics : sequence of str, optional
        "six", "all", or names of metrics.
    progress : callable, optional
        Called with a `ProgressStep` on the way.

    Returns
    -------
    EvaluateResult
        Errors on training and test samples, the metrics, and how it looks.

    Raises
    ------
    BadInput
        For a fit or source that cannot be read or found, other channels, and unknown metrics.

    Examples
    --------
    >>> fit = homofact.fit("material:phong-30", homofact.McCool(size=8))
    >>> found = homofact.evaluate(fit)
    >>> found.part, found.test.log_mse < 1
    ('source', True)
    """
    given = given_fit(fit)
    if source is not None:
        source = given_source(source)

    from homofact.evaluation.appearance import appearance
    from homofact.evaluation.judging import FitEvaluator, chosen_metrics
    from homofact.evaluation.metrics import measure
    from homofact.evaluation.reopening import reopen

    names = chosen_metrics(metrics)
    steps = ProgressSteps(progress)
    steps.stage("reading")
    fitted = given.open()
    opened = source if source is None or isinstance(source, str) else open_given(source)
    found = reopen(fitted, opened, given.near)
    steps.stage("measuring")
    parts = {part: measure(fitted, samples, fitted.transform) for part, samples in found.parts.items()}
    judge = FitEvaluator(found.source, names)
    return EvaluateResult(
        found.source.name,
        found.known,
        parts["train"],
        parts[found.part],
        found.part,
        judge.measure(fitted, found.split),
        appearance(fitted, found.source),
        judge.conditions(),
    )
