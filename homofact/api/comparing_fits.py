"""Saved fits of one source side by side: which of them is nearer to it, and by how much."""

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.api.places import check_file
from homofact.api.progress import Progress, ProgressSteps
from homofact.api.result import Fit
from homofact.api.subjects import Place, given_fit
from homofact.errors import BadInput

if TYPE_CHECKING:
    from homofact.evaluation.reopening import Reopened

# Of an opening: settings that change the samples.
_READ_WITH = ("channels", "count", "scheme", "seed", "calibrate", "clipped")


@dataclass(frozen=True)
class FitsComparison:
    """Saved fits beside each other.

    Attributes
    ----------
    source : str
        The source of all of them.
    part : str
        What their errors are on: "held_out", samples that none of them has seen, or "source", all samples.
    fits : dict of Fit
        The fits by label: the names of their folders.
    records : dict
        By label: bytes, fetches, shapes of the textures, errors, metrics and appearance, and the verdict that the fit
        was saved with.
    plot : Path or None
        The picture; None without one.
    conditions : list of str
        Under which conditions the metrics hold, in sentences.
    """

    source: str
    part: str
    fits: dict[str, Fit]
    records: dict[str, dict[str, Any]]
    plot: Path | None
    conditions: list[str] = field(default_factory=list)

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        rows = [{"label": label, **record} for label, record in self.records.items()]
        plot = None if self.plot is None else str(self.plot)
        facts = {"source": self.source, "part": self.part, "rows": rows, "plot": plot}
        return facts | {"metric_conditions": self.conditions}


def compare_fits(
    fits: Sequence[Place],
    *,
    metrics: Sequence[str] = ("six",),
    plot: Place | None = None,
    progress: Progress | None = None,
) -> FitsComparison:
    """Measure saved fits of one source on the same samples, beside each other.

    Parameters
    ----------
    fits : sequence of paths
        Two or more results' folders or exports.
    metrics : sequence of str, optional
        "six", "all", or names of metrics, measured on the same samples.
    plot : path, optional
        A PNG with the source, each fit and its differences under three lights.
    progress : callable, optional
        Called with a `ProgressStep` on the way.

    Returns
    -------
    FitsComparison
        The errors on the samples that were held out of all of them, if they share their split, else on all samples.

    Raises
    ------
    BadInput
        For fewer than two fits, an unknown metric, fits that cannot be read, or are of different sources or of one that
        is gone.

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
    given = {label: given_fit(place) for label, place in zip(_labels(fits), fits, strict=True)}
    picture = None if plot is None else Path(plot)
    if picture is not None:
        check_file(picture, ".png")

    from homofact.api.factorizing import draw_fits
    from homofact.api.loading import load
    from homofact.evaluation.appearance import appearance
    from homofact.evaluation.judging import FitEvaluator, chosen_metrics
    from homofact.evaluation.metrics import measure
    from homofact.evaluation.reopening import reopen

    names = chosen_metrics(metrics)
    steps = ProgressSteps(progress)
    steps.stage("reading")
    opened = {label: load(place) for label, place in zip(given, fits, strict=True)}
    found = {}
    for label, one in opened.items():
        try:
            found[label] = reopen(one.factorization, None, given[label].near)
        except BadInput as error:
            raise error.at(label) from error
    first = _one_source(found)
    parts = {"source": first.source.samples.rotated_at_random(first.split.seed)}
    if all(one.split == first.split and one.held_out for one in found.values()):
        parts = first.parts
    split = first.split if "held_out" in parts else replace(first.split, held_out=0.0)
    judge = FitEvaluator(first.source, names)
    records = {}
    for label, one in opened.items():
        steps.stage(f"measuring {label}")
        fitted, seen = one.factorization, appearance(one.factorization, first.source)
        records[label] = {
            "textures": len(fitted.terms),
            "bytes": fitted.nbytes,
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
        draw_fits(picture, first.source, opened, records)
    part = "held_out" if "held_out" in parts else "source"
    return FitsComparison(first.source.name, part, opened, records, picture, judge.conditions())


def _labels(places: Sequence[Place]) -> list[str]:
    """The names of the folders; where two are equal, the places."""
    names = [Path(place).absolute().name for place in places]
    return names if len(set(names)) == len(names) else [os.fspath(place) for place in places]


def _one_source(found: "dict[str, Reopened]") -> "Reopened":
    """The first of the sources. Raises BadInput where another has other samples."""
    (first_label, first), *others = found.items()
    for label, one in others:
        if one.split.digest != first.split.digest:
            raise BadInput(
                where=label,
                found=f"a fit of {one.source.name}{_read_with(one, first)}",
                expected=f"one of the samples of {first.source.name}{_read_with(first, one)}, as {first_label}",
            )
    return first


def _read_with(one: "Reopened", other: "Reopened") -> str:
    """How one source was opened where another was opened in another way: " read with calibrate tilt"."""
    first, second = one.source.opening, other.source.opening
    if first is None or second is None:
        return ""
    own, others = asdict(first), asdict(second)
    words = [f"{name} {_in_words(own[name])}" for name in _READ_WITH if own[name] != others[name]]
    return f" read with {' and '.join(words)}" if words else ""


def _in_words(value: Any) -> str:
    return "+".join(map(str, value)) or "none" if isinstance(value, tuple | list) else str(value)
