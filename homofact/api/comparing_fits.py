"""Compare saved fits on the samples of their source or of another source: which error is smaller, and by how much."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.api.places import check_file
from homofact.api.progress import Progress, ProgressSteps
from homofact.api.result import Fit
from homofact.api.subjects import GivenFit, Place, given_fit, given_source, open_given
from homofact.errors import BadInput

if TYPE_CHECKING:
    from homofact.brdf.samples import Samples
    from homofact.brdf.source import Source
    from homofact.evaluation.paired import ErrorRatio
    from homofact.evaluation.reopening import Reopened
    from homofact.evaluation.split import Split

# Of an opening: settings that change the samples.
_READ_WITH = ("channels", "count", "scheme", "seed", "calibrate", "clipped")


@dataclass(frozen=True)
class FitsComparison:
    """The comparison of saved fits.

    Attributes
    ----------
    source : str
        The common source of the fits, or the other source that they were measured on.
    part : str
        The samples of the errors: "held_out" (samples that no fit has seen) or "source" (all samples).
    fits : dict of Fit
        The fits by label. A label is the name of the fit's folder, or its path if two names are equal.
    records : dict
        Facts of each fit, by label: bytes (for an export, as stored), fetches, shapes of the textures, errors, metrics,
        appearance, and the verdict saved with the fit.
    plot : Path or None
        The picture; None without one.
    conditions : list of str
        The conditions under which the metrics were measured, in sentences.
    best : str
        The label of the fit with the lowest Cole error.
    ratios : dict of dict of ErrorRatio
        The errors of the best fit divided by those of each other fit with the same ε, by label and by error ("log_mse",
        "mse"), with their intervals.
    unlike : tuple of str
        The labels of the fits whose held-out samples differ from those of the first fit or are unknown.
    """

    source: str
    part: str
    fits: dict[str, Fit]
    records: dict[str, dict[str, Any]]
    plot: Path | None
    conditions: list[str] = field(default_factory=list)
    best: str = ""
    ratios: "dict[str, dict[str, ErrorRatio]]" = field(default_factory=dict)
    unlike: tuple[str, ...] = ()

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        rows = [{"label": label, **record} for label, record in self.records.items()]
        plot = None if self.plot is None else str(self.plot)
        facts = {"source": self.source, "part": self.part, "rows": rows, "plot": plot}
        ratios = {
            label: {name: one.record() for name, one in several.items()} for label, several in self.ratios.items()
        }
        return facts | {"metric_conditions": self.conditions, "best": self.best, "error_ratios": ratios}


def compare_fits(
    fits: Sequence[Place],
    *,
    on: Any = None,
    metrics: Sequence[str] = ("six",),
    plot: Place | None = None,
    progress: Progress | None = None,
) -> FitsComparison:
    """Measure saved fits on the same samples and compare them.

    Parameters
    ----------
    fits : sequence of paths
        Two or more results' folders or exports.
    on : source or path, optional
        Another measurement to measure the fits on, for example a second measurement of the material. The fits may then
        have different sources. A corrected copy of a file favours the fit to this copy. Default: the common source of
        the fits.
    metrics : sequence of str, optional
        "six", "all", or names of metrics, measured on the same samples.
    plot : path, optional
        A PNG with the source, each fit and its differences under three lights.
    progress : callable, optional
        Called with a `ProgressStep` on the way.

    Returns
    -------
    FitsComparison
        The errors on the held-out samples if all fits share a split, otherwise on all samples. With `on`, the errors on
        all samples of that measurement.

    Raises
    ------
    BadInput
        For fewer than two fits, an unknown metric, fits that cannot be read, or fits with other channels than `on`.
        Without `on`, also for fits of different sources, or if the source cannot be found.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> place, source = pathlib.Path(tempfile.mkdtemp()), homofact.read("material:phong-10", count=500)
    >>> for size in (4, 8):
    ...     _ = homofact.factorize(source, place / str(size), homofact.McCool(size=size))
    >>> found = homofact.compare_fits([place / "4", place / "8"])
    >>> found.part, list(found.records)
    ('held_out', ['4', '8'])
    """
    if len(fits) < 2:
        raise BadInput(where="fits", found=len(fits), expected="two or more")
    for place in fits:
        if [Path(each).absolute() for each in fits].count(Path(place).absolute()) > 1:
            raise BadInput(where="fits", found=f"{place} twice", expected="each once")
    given = {label: given_fit(place) for label, place in zip(_labels(fits), fits, strict=True)}
    picture = None if plot is None else Path(plot)
    if picture is not None:
        check_file(picture, ".png")

    from homofact.api.factorizing import draw_fits
    from homofact.api.loading import load
    from homofact.evaluation.appearance import appearance
    from homofact.evaluation.judging import FitEvaluator, chosen_metrics
    from homofact.evaluation.metrics import measure
    from homofact.evaluation.paired import error_ratios

    names = chosen_metrics(metrics)
    steps = ProgressSteps(progress)
    steps.stage("reading")
    opened = {label: load(place) for label, place in zip(given, fits, strict=True)}
    unlike: tuple[str, ...] = ()
    if on is None:
        source, split, parts, unlike = _own_parts(given, opened)
    else:
        source, split, parts = _parts_of(on, opened)
    judge = FitEvaluator(source, names)
    records = {}
    for label, one in opened.items():
        steps.stage(f"measuring {label}")
        fitted, seen = one.factorization, appearance(one.factorization, source)
        records[label] = {
            "textures": len(fitted.terms),
            "bytes": given[label].stored_bytes or fitted.nbytes,
            "fetches": fitted.fetches,
            "shapes": [list(texture.size) for texture in fitted.textures],
            "epsilon": fitted.transform.epsilon,
            "error": {part: measure(fitted, each, fitted.transform).record() for part, each in parts.items()},
            "metrics": judge.measure(fitted, split),
            "appearance": None if seen is None else seen.record(),
            "verdict": given[label].verdict,
        }
    if picture is not None:
        steps.stage("drawing")
        picture.parent.mkdir(parents=True, exist_ok=True)
        draw_fits(picture, source, opened, records)
    part = "held_out" if "held_out" in parts else "source"
    best = min(records, key=lambda label: records[label]["error"][part]["log_mse"])
    ratios = {
        label: error_ratios(opened[best].factorization, one.factorization, parts[part])
        for label, one in opened.items()
        if label != best and records[label]["epsilon"] == records[best]["epsilon"]
    }
    return FitsComparison(source.name, part, opened, records, picture, judge.conditions(), best, ratios, unlike)


def _own_parts(
    given: "Mapping[str, GivenFit]", opened: Mapping[str, Fit]
) -> "tuple[Source, Split, dict[str, Samples], tuple[str, ...]]":
    """Return the fits' source, its split, the samples for errors, and the fits with other held-out samples.

    Raises BadInput for several sources.
    """
    from homofact.evaluation.reopening import reopen

    found: dict[str, Reopened] = {}
    folders: list[Path] = []
    # An export knows the name of its source alone: it is looked for beside those of the other fits too.
    for label in sorted(opened, key=lambda label: given[label].exported):
        try:
            found[label] = reopen(opened[label].factorization, None, (*given[label].near, *folders))
        except BadInput as error:
            raise error.at(label) from error
        folders += _folder_of(found[label].source)
    found = {label: found[label] for label in opened}
    first = _one_source(found)
    # Where the file was when each was fitted does not matter.
    split = replace(first.split, opening=None)
    own = {label for label, one in found.items() if replace(one.split, opening=None) == split and one.held_out}
    if own == found.keys():
        return first.source, first.split, first.parts, ()
    parts = {"source": first.source.samples.rotated_at_random(first.split.seed)}
    unlike = tuple(label for label in found if label not in own)
    return first.source, replace(first.split, held_out=0.0), parts, unlike


def _folder_of(source: "Source") -> list[Path]:
    """Return the folder of the source's file in a list; empty without a file."""
    path = None if source.opening is None else Path(source.opening.folder) / source.opening.path
    return [] if path is None or not path.is_file() else [path.parent]


def _parts_of(on: Any, opened: Mapping[str, Fit]) -> "tuple[Source, Split, dict[str, Samples]]":
    """Return the source `on`, a split without held-out samples, and its samples. Raises BadInput for other channels."""
    from homofact.evaluation.split import Split

    source = open_given(given_source(on), 0)
    for label, one in opened.items():
        own, expected = one.factorization.channels, source.samples.channels
        if tuple(own) != tuple(expected):
            found = f"a fit of the channels {', '.join(own)}"
            raise BadInput(where=label, found=found, expected=f"{', '.join(expected)}, as {source.name}")
    return source, Split.of(source, 0.0, 0), {"source": source.samples.rotated_at_random(0)}


def _labels(places: Sequence[Place]) -> list[str]:
    """Return the names of the folders, or their full paths if two names are equal."""
    names = [Path(place).absolute().name for place in places]
    return names if len(set(names)) == len(names) else [os.fspath(place) for place in places]


def _one_source(found: "dict[str, Reopened]") -> "Reopened":
    """Return the first source. Raises BadInput if another source has different samples."""
    (first_label, first), *others = found.items()
    for label, one in others:
        if one.split.digest != first.split.digest:
            raise BadInput(
                where=label,
                found=f"a fit of {one.source.name}{_read_with(one, first)}",
                expected=f"one of the samples of {first.source.name}{_read_with(first, one)}, as {first_label},"
                " or one measurement for all (`on='FILE'`)",
            )
    return first


def _read_with(one: "Reopened", other: "Reopened") -> str:
    """Return in words how the options of one source differ from another's, e.g. " read with calibrate tilt"."""
    first, second = one.source.opening, other.source.opening
    if first is None or second is None:
        return ""
    own, others = asdict(first), asdict(second)
    words = [f"{name} {_in_words(own[name])}" for name in _READ_WITH if own[name] != others[name]]
    return f" read with {' and '.join(words)}" if words else ""


def _in_words(value: Any) -> str:
    return "+".join(map(str, value)) or "none" if isinstance(value, tuple | list) else str(value)
