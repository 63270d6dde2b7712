"""Evaluating: measure the errors of a fit against its source, on held-out samples if there are any."""

from collections.abc import Sequence
from dataclasses import dataclass, field
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
        The source that the fit was compared with.
    known : bool
        Whether the training samples are those that the fit was made from.
    train, test : SixErrors
        Errors on the training samples and on the held-out samples (on all samples if none were held out). For an
        isotropic source, the samples are rotated to random azimuths. `test.log_mse` is the Cole error.
    part : str
        What the test samples are: "held_out", or "source" where the fit may have seen them.
    metrics : dict
        The chosen metrics on the test samples; None where one is not defined.
    appearance : Appearance or None
        Albedo, highlight and pictures beside the source's; None if the source consists only of samples.
    conditions : list of str
        The conditions under which the metrics were measured, in sentences.
    """

    source: str
    known: bool
    train: "SixErrors"
    test: "SixErrors"
    part: str
    metrics: dict[str, float | None]
    appearance: "Appearance | None" = field(repr=False)
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

    A fit records which samples were held out. `fit` uses all samples, so its result is measured on samples that it has
    seen. `factorize` and `compare` hold out a part of the samples.

    Parameters
    ----------
    fit : Fit or path
        A fit, a result's folder, or a saved .npz file.
    source : source or path, optional
        The source to compare with. By default, homofact tries to find the fit's own source.
    metrics : sequence of str, optional
        "six", "all", or names of metrics.
    progress : callable, optional
        Called with a `ProgressStep` on the way.

    Returns
    -------
    EvaluateResult
        Errors on training and test samples, the metrics, and the appearance.

    Raises
    ------
    BadInput
        For a fit or source that cannot be read or found, a source with other channels, and unknown metrics.

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
