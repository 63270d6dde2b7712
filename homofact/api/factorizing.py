"""Factorizing: fit a source, judge the fit on held-out samples, and write a result folder."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.api.places import check_folder
from homofact.api.progress import Progress, ProgressSteps
from homofact.api.refusing import Refusal
from homofact.api.subjects import Place, given_method, given_source, open_given, subset_of
from homofact.brdf.source_names import DISMISSED, HELD_OUT
from homofact.errors import BadInput
from homofact.evaluation.wording import counted, figure
from homofact.files import extras
from homofact.files.lock import claimed
from homofact.files.plain import plain
from homofact.methods.search import Search
from homofact.methods.table import made, mccool_like
from homofact.sections import SourceSettings

if TYPE_CHECKING:
    from homofact.api.result import Fit
    from homofact.brdf.source import Source
    from homofact.evaluation.compare import ComparisonRow, FitWithErrors
    from homofact.evaluation.verdict.verdict import Verdict
    from homofact.factor.fitted import Fitted
    from homofact.methods.method import Method

# Two lobes are named only if their log error is at most this part of that of one. The mean squared error of a model may
# be at most so many times that of the textures.
_CLEARLY_LESS, _MOST_MSE = 0.9, 1.25


@dataclass(frozen=True, repr=False)
class FactorizeResult:
    """A fit, a fit with McCool's projections of the same size for comparison, and their folder.

    Attributes
    ----------
    folder : Path
        The result's folder, which `load` opens.
    source : Source
        What was fitted.
    rows : dict of ComparisonRow
        The fit under the name of its method, and the fit with McCool's projections as "McCool", unless they are the
        same.
    report : dict
        The JSON form, as in the folder's report.json.
    picture : Path or None
        Source and fits on a lit sphere; None without matplotlib.
    left_out : str
        What was not written because a library is missing; otherwise empty.
    model : FitWithErrors or None
        A GGX model that is as good as the fit on the held-out samples or better, usually with far fewer bytes; None if
        homofact tried none or its errors are larger.
    """

    folder: Path
    source: "Source"
    rows: "dict[str, ComparisonRow]"
    report: dict[str, Any]
    picture: Path | None
    left_out: str
    model: "FitWithErrors | None" = None

    def __repr__(self) -> str:
        """Name the folder, the fit and its verdict."""
        return f"<FactorizeResult in {self.folder}: {self.fit!r}: {self.verdict.summary}>"

    def __str__(self) -> str:
        """Return the verdict with its findings in lines, and the model that is as good, if there is one."""
        bars = self.verdict.bars
        sentences = [self.verdict.summary, bars.by_angle_sentence(), bars.extrapolated_sentence()]
        lines = [f"{self.fit!r} in {self.folder}", *filter(None, sentences)]
        lines += [f"{each.name}: {each.found}" for each in self.verdict.findings]
        if self.model is not None:
            lines.append(f"as good on the held-out samples, or better: {self.model.factorization!r}")
        return "\n".join(lines)

    @property
    def verdict(self) -> "Verdict":
        """The verdict on the fit."""
        return self.row.verdict

    @property
    def row(self) -> "ComparisonRow":
        """The fit with its errors and verdict."""
        return next(iter(self.rows.values()))

    @property
    def fit(self) -> "Fitted":
        """The fit."""
        return self.row.factorization

    def records(self) -> dict[str, dict[str, Any]]:
        """Return the JSON form of each fit, by label."""
        return {label: row.record() for label, row in self.rows.items()}

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        return self.report


def factorize(
    source: Any,
    to: Place,
    method: "Method | str | None" = None,
    *,
    held_out: float = HELD_OUT,
    seed: int = 0,
    strict: bool | float = False,
    refuse: tuple[str, ...] = (),
    force: bool = False,
    progress: Progress | None = None,
    **settings: Any,
) -> FactorizeResult:
    """Fit a source, judge the fit on held-out samples, and write a folder with textures, pictures and figures.

    Parameters
    ----------
    source : source or path
        What is fitted, as for `fit`.
    to : path
        The folder: factorization.npz, manifest.json, report.json, every texture as EXR and PNG, compare.png.
    method : Method or str, optional
        The method, or its name. Default: `Search`.
    held_out : float, optional
        The part of the samples that is held out of the fit; 0 fits all samples, and every error is then on samples
        that the fit has seen.
    seed : int, optional
        Seed of a model's samples, and of a method that you give by name.
    strict : bool or float, optional
        Raise an error if the verdict warns; a number is the largest accepted probability of a bad fit.
    refuse : tuple of str, optional
        Refuse a fit with any of these findings.
    force : bool, optional
        Replace a result that is in the folder.
    progress : callable, optional
        Called with a `ProgressStep` on the way.
    **settings
        Settings of the method that you give by name, or of `Search` without one, such as `textures=2`.

    Returns
    -------
    FactorizeResult
        The fit with its errors, verdict and folder.

    Raises
    ------
    BadInput
        For a source or settings that cannot be used, a folder that already contains files, and a fit that is refused.

    Examples
    --------
    >>> found = homofact.factorize("material:phong-30", "phong", homofact.McCool(size=8))
    >>> found.row.held_out.log_mse < 1, homofact.load("phong").nbytes == found.fit.nbytes
    (True, True)
    """
    refusal = Refusal.of(strict, refuse)
    source = given_source(source)
    if method is None or isinstance(method, str):
        chosen = made(method or Search.name, settings | {"seed": seed})
    else:
        chosen = given_method(method, settings)
    folder = Path(to)
    drawn = extras.installed("matplotlib")
    check_folder(folder, force)

    from homofact.brdf.source import with_tilt_looked_at
    from homofact.evaluation.compare import fit_and_measure
    from homofact.evaluation.estimate import TimeEstimate, fit_seconds, training_count
    from homofact.exporting.images import LIBRARIES
    from homofact.exporting.result import write_result

    steps = ProgressSteps(progress)
    with claimed(folder):
        steps.stage("reading")
        subject, subset = with_tilt_looked_at(open_given(source, seed)), subset_of(source)
        steps.warm_up()
        baseline = mccool_like(chosen)
        fits = [chosen] if baseline == chosen else [chosen, baseline]
        jobs = [(fit.name, fit_seconds(fit, training_count(subject, fit, held_out, subset))) for fit in fits]
        steps.estimate(TimeEstimate(jobs))
        steps.stage(chosen.name)
        rows = {chosen.name: fit_and_measure(subject, chosen, held_out, steps, subset)}
        refusal.check(rows[chosen.name].verdict, chosen.name)
        if baseline != chosen:
            steps.stage("McCool's projections")
            rows["McCool"] = fit_and_measure(subject, baseline, held_out, subset=subset)
        model = _model_as_good(subject, rows[chosen.name])
        records = {label: row.record() for label, row in rows.items()}
        report = _report(subject, source, records, folder) | {"model": None if model is None else _model_record(model)}
        steps.stage("drawing and writing")

        def draw(place: Path) -> None:
            draw_fits(place / "compare.png", subject, rows, records)

        write_result(
            folder,
            factorization=rows[chosen.name].factorization,
            report=plain(report),
            pictures=draw if drawn else None,
            force=force,
        )
    without = extras.left_out({**LIBRARIES, "pictures": "matplotlib"})
    return FactorizeResult(folder, subject, rows, report, folder / "compare.png" if drawn else None, without, model)


def _model_as_good(subject: "Source", row: "ComparisonRow") -> "FitWithErrors | None":
    """Return a GGX model of one or two lobes, fitted on the same split, that is as good as the textures; else None.

    Its log error is smaller, and its error of values at most `_MOST_MSE` times as large. Two lobes are returned only if
    their log error is clearly smaller than that of one. Returns None for fits without textures or without held-out
    samples. Sources that do not consist of samples are skipped, because there a model takes seconds.
    """
    from homofact.brdf.scattered import made_of_samples
    from homofact.evaluation.compare import fit_baseline
    from homofact.methods.models import Ggx

    if not (row.factorization.textures and row.split.held_out and made_of_samples(subject.reflectance)):
        return None
    epsilon = row.factorization.transform.epsilon
    try:
        one, two = (fit_baseline(subject, row.split, Ggx(lobes=lobes, epsilon=epsilon)) for lobes in (1, 2))
    except BadInput:
        return None
    found = two if two.held_out.log_mse < _CLEARLY_LESS * one.held_out.log_mse else one
    own, other = row.held_out, found.held_out
    return found if other.log_mse < own.log_mse and other.mse <= _MOST_MSE * own.mse else None


def _model_record(model: "FitWithErrors") -> dict[str, Any]:
    from homofact.brdf.analytic.ggx import GgxBrdf
    from homofact.parametric.model_fit import ModelFit

    fit = model.factorization
    assert isinstance(fit, ModelFit)
    assert isinstance(fit.model, GgxBrdf)
    lobes = len(fit.model.lobes)
    return {"method": "ggx", "lobes": lobes, "bytes": model.factorization.nbytes, "held_out": model.held_out.record()}


def caption(record: dict[str, Any]) -> list[str]:
    """Return the lines under a fit's sphere: its errors on the held-out samples and what it costs to evaluate."""
    errors = record["error"]
    if "source" in errors:
        tested, words, beside = errors["source"], "on all samples", ""
    else:
        tested, words, beside = errors["held_out"], "held out", f", {figure(errors['train']['log_mse'])} training"
    return [
        f"log MSE {figure(tested['log_mse'])} {words}{beside}",
        f"log MAE {figure(tested['log_mae'])}, MAE {figure(tested['mae'])} sr⁻¹ {words}",
        f"{counted(record['textures'], 'texture')}, {record['bytes']} bytes, {counted(record['fetches'], 'fetch')}",
    ]


def _report(subject: "Source", source: Any, records: dict[str, dict[str, Any]], folder: Path) -> dict[str, Any]:
    """Return the content of report.json: the records of the fit and of McCool's, and how the source was read.

    "measures" describes each error metric and appearance metric in words.
    """
    from homofact.evaluation.metric_table import LIGHT, METRICS, SIX

    first, *others = records.values()
    mended = {name: subject.samples.provenance.get(name) for name in ("gains", "clipped", "tilt", DISMISSED)}
    opened = source.path if isinstance(source, SourceSettings) else source if isinstance(source, str) else subject.name
    measures = {metric.name: metric.words for metric in METRICS.values() if metric.name in (*SIX, *LIGHT)}
    return {**first, **mended, "measures": measures, "opened": opened, "out": str(folder)} | (
        {"mccool": others[0]} if others else {}
    )


def draw_fits(
    picture: Path,
    subject: "Source",
    rows: "Mapping[str, ComparisonRow | Fit]",
    records: Mapping[str, dict[str, Any]],
) -> None:
    """Draw a source beside its fits, with the lines and error bars from `records` below each fit."""
    from homofact.brdf.channels import display_of
    from homofact.brdf.source_names import AUTOMATIC, NOTHING
    from homofact.figures.compare_picture import FitPanel, compare_picture

    panels = [
        FitPanel(label, row.factorization, caption(records[label]), None if row.verdict is None else row.verdict.bars)
        for label, row in rows.items()
    ]
    asked = () if subject.opening is None else subject.opening.calibrate
    undone = [name for name in asked if name not in (AUTOMATIC, NOTHING)]
    title = subject.name + (f", {' and '.join(undone)} undone" if undone else "")
    compare_picture(picture, (title, subject.reflectance), panels, to_rgb=display_of(subject.samples.channels))
