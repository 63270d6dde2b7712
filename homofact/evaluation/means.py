"""Average the results of methods over sources, seeds and splits in a table for a paper, as CSV or LaTeX.

Fits are grouped by method and byte budget, since errors are comparable only at equal size. A fit may use fewer bytes; a
row states the largest number of bytes and fetches of its fits. Standard deviations are those of a sample (n − 1).
Sources differ far more than several fits to one source, so a row over several sources has two deviations. One is the
deviation of the sources' means. The other is the deviation within a source, over seeds or splits: √(mean of the
sources' variances).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import fmean
from typing import Any

from homofact.evaluation.appearance import mean_figures
from homofact.evaluation.metric_table import LIGHT, METRICS
from homofact.evaluation.opinion import opinion_table
from homofact.evaluation.spread import Spread
from homofact.files.tables import csv_text
from homofact.methods.known_mixes import DESCENDING

_COLUMNS = (
    "source", "method", "bytes", "fetches", "sources", "fits", "metric", "unit", "mean", "standard_deviation",
    "within_source", "min", "max", "epsilon",
)  # fmt: skip
# Metrics of the log transform, whose values depend on its ε.
OF_EPSILON = ("log_mse", "log_mae", "log_max")
_ROUNDING = 1e-3  # of the light: so much may change where light and viewer are swapped
# Settings that decide how well a method does, as the comments of a table name them.
_SETTINGS = ("textures", "size", "bytes", "effort", "budget", "restarts", "joint_terms", "reciprocal", "lobes", "steps")


@dataclass(frozen=True)
class MeasuredFit:
    """One fit: its source and method, bytes and fetches, and `values`, its metrics by name (None if undefined).

    `seed` is the seed of the fit, and `split_seed` that of its split. `epsilon` is the ε of its log transform.
    `samples` is the number of samples of the source, and `held_out` the number of held-out samples on which the metrics
    were measured. `swapped` is the share of the fit's light that changes if light and viewer are swapped. `settings` is
    a text with the settings of the method, and `asked` is the byte budget. `sampling` describes how the samples were
    drawn and split.
    """

    source: str
    method: str
    seed: int
    nbytes: int
    fetches: int
    values: dict[str, float | None]
    epsilon: float
    samples: int
    held_out: int
    swapped: float = 0.0
    settings: str = ""
    asked: int | None = None
    sampling: str = ""
    split_seed: int = 0

    @property
    def group(self) -> tuple[str, int]:
        """The method and the bytes by which fits are grouped."""
        return self.method, self.nbytes if self.asked is None else self.asked

    @property
    def is_reciprocal(self) -> bool:
        """Whether light and viewer may be swapped, up to rounding."""
        return self.swapped <= _ROUNDING


@dataclass(frozen=True)
class MeanRow:
    """All fits of one method and byte budget, to one source or to all sources (`source` is "").

    `spreads` has the spread of each metric, None if a fit has no value of it. Over several sources, its deviation is
    that of the sources' means. `within_source` has the deviation of the fits to one source for each metric, None if no
    source has two fits. `epsilon` is None if the fits have different ε. `not_reciprocal` is the number of fits that are
    not reciprocal.
    """

    source: str
    method: str
    nbytes: int
    fetches: int
    sources: int
    fits: int
    epsilon: float | None
    spreads: dict[str, Spread | None]
    within_source: dict[str, float | None]
    not_reciprocal: int = 0


def mean_record(records: Sequence[Mapping[str, Any]], seeds: Sequence[int], splits: Sequence[int]) -> dict[str, Any]:
    """Return one record for fits that differ only in seed and split, in a comparison or a chart.

    Errors, seconds, evaluations and the figures of the appearance are means. "spread" has the mean, minimum, maximum
    and standard deviation of each. "seeds" are the seeds of the fits, and "splits" those of their splits. Bytes and
    textures are those of the largest fit, and fetches are the maximum. All other entries are those of the first fit.
    """
    own, largest = records[0], max(records, key=lambda record: (record["bytes"], record["fetches"]))

    def spreads(several: Sequence[Mapping[str, float]]) -> dict[str, dict[str, float | None]]:
        return {name: Spread.of(numbers[name] for numbers in several).record() for name in several[0]}

    error = {part: spreads([record["error"][part] for record in records]) for part in own["error"]}
    seconds = spreads([record["seconds"] for record in records])
    evaluations = Spread.of(record["evaluations"] for record in records)
    figures = [record["appearance"] for record in records if record["appearance"] is not None]
    light = {name: [each[name] for each in figures] for name in (LIGHT if figures else ())}
    appearance = {name: spread.record() for name, values in light.items() if (spread := _spread(values)) is not None}
    return {
        **own,
        **{name: largest[name] for name in ("bytes", "textures", "shapes") if name in own},
        "fetches": max(record["fetches"] for record in records),
        "status": ", ".join(dict.fromkeys(record["status"] for record in records)),
        "evaluations": evaluations.mean,
        "seconds": {name: spread["mean"] for name, spread in seconds.items()},
        "error": {part: {name: spread["mean"] for name, spread in some.items()} for part, some in error.items()},
        "appearance": figures[0] | mean_figures(figures) | _mean_opinion(figures) if figures else None,
        "seeds": list(seeds),
        "splits": list(splits),
        "spread": {
            "error": error,
            "seconds": seconds,
            "evaluations": evaluations.record(),
            "appearance": appearance,
        },
    }


def _mean_opinion(figures: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """The grade of the mean difference of several fits, with its interval; nothing where one has none."""
    differences = [each.get("delta_e_study") for each in figures]
    known = [each for each in differences if each is not None]
    return opinion_table().law.opinion(fmean(known)).record() if len(known) == len(figures) else {}


def mean_rows(fits: Sequence[MeasuredFit], source: str = "") -> list[MeanRow]:
    """Return the rows over all fits, or over those of one source, in the order in which methods first come."""
    own = [fit for fit in fits if source in ("", fit.source)]
    rows = []
    for method in dict.fromkeys(fit.method for fit in own):
        for group in sorted({fit.group for fit in own if fit.method == method}):
            some = [fit for fit in own if fit.group == group]
            nbytes, fetches = max(fit.nbytes for fit in some), max(fit.fetches for fit in some)
            both = {name: _spreads([(fit.source, fit.values[name]) for fit in some]) for name in some[0].values}
            spreads = {name: spread for name, (spread, _) in both.items()}
            within_source = {name: deviation for name, (_, deviation) in both.items()}
            sources = len({fit.source for fit in some})
            epsilons = {fit.epsilon for fit in some}
            epsilon = epsilons.pop() if len(epsilons) == 1 else None
            one_way = sum(not fit.is_reciprocal for fit in some)
            rows.append(
                MeanRow(source, method, nbytes, fetches, sources, len(some), epsilon, spreads, within_source, one_way)
            )
    return rows


def mixed_epsilons(fits: Sequence[MeasuredFit]) -> str:
    """Return a warning if means are over log errors with different ε, which cannot be compared; else "".

    Examples
    --------
    >>> fits = [MeasuredFit(name, "mccool", 0, 12, 3, {"log_mse": 0.1}, e, 9, 2) for name, e in (("a", 1), ("b", 2))]
    >>> mixed_epsilons(fits)
    'log_mse: the mean is over different ε (a 1, b 2); for one ε give `epsilon=2`'
    """
    names = [name for name in (fits[0].values if fits else ()) if name in OF_EPSILON]
    by_source = {fit.source: fit.epsilon for fit in fits}
    if not names or len({fit.epsilon for fit in fits}) == 1:
        return ""
    listed = ", ".join(f"{name} {epsilon:g}" for name, epsilon in by_source.items())
    what = "the mean is" if len(names) == 1 else "the means are"
    return (
        f"{', '.join(names)}: {what} over different ε ({listed}); for one ε give `epsilon={max(by_source.values()):g}`"
    )


def without_numbers(fits: Sequence[MeasuredFit]) -> str:
    """Return a note on metrics whose mean is missing because some sources have no value; else "".

    Examples
    --------
    >>> fits = [MeasuredFit(name, "mccool", 0, 12, 3, {"rms": rms}, 1, 9, 2) for name, rms in (("a", 0.1), ("b", None))]
    >>> without_numbers(fits)
    'no mean of rms: b has none'
    """
    missing: dict[tuple[str, ...], list[str]] = {}
    for name in fits[0].values if fits else ():
        lacking = tuple(dict.fromkeys(fit.source for fit in fits if fit.values[name] is None))
        if lacking:
            missing.setdefault(lacking, []).append(name)
    parts = (f"{', '.join(names)}: {' and '.join(lacking)} {'has' if len(lacking) == 1 else 'have'} none"
             for lacking, names in missing.items())  # fmt: skip
    return "; ".join(f"no mean of {part}" for part in parts)


def same_fits(fits: Sequence[MeasuredFit]) -> str:
    """Return a warning if a method gave the same fit for all its seeds on every split; else "".

    Examples
    --------
    >>> same_fits([MeasuredFit("a", "search", seed, 12, 3, {"log_mse": 0.1}, 1, 9, 2) for seed in (0, 1)])
    'search: all seeds gave the same fit, so ± 0 tells nothing of how such fits scatter; for that give `splits=5`'
    """
    numbers: dict[tuple[str, str], dict[int, list[tuple[float | None, ...]]]] = {}
    for fit in fits:
        own = numbers.setdefault((fit.method, fit.source), {}).setdefault(fit.split_seed, [])
        own.append((fit.nbytes, *fit.values.values()))
    alike: dict[str, list[str]] = {}
    several = len({fit.split_seed for fit in fits}) > 1
    for (method, source), by_split in numbers.items():
        alone = all(len(own) > 1 and len(set(own)) == 1 for own in by_split.values())
        if alone and (len(by_split) > 1) is several:
            alike.setdefault(method, []).append(source)
    sources = len({fit.source for fit in fits})
    named = [method + (f" on {', '.join(own)}" if len(own) < sources else "") for method, own in alike.items()]
    same = "all seeds gave the same fit, so ± 0 tells nothing of how such fits scatter; for that give `splits=5`"
    if several:
        same = "all seeds gave the same fits, so their deviation is that of the splits alone"
    return f"{'; '.join(named)}: {same}" if named else ""


def csv_of(fits: Sequence[MeasuredFit]) -> str:
    """Return CSV text with a line per source ("all" first), method, bytes and metric: unit, mean, deviations, range."""
    names = list(dict.fromkeys(fit.source for fit in fits))
    rows = mean_rows(fits) + [row for name in names for row in mean_rows(fits, name)]
    lines: list[Sequence[Any]] = [_COLUMNS]
    for row in rows:
        for name, spread in row.spreads.items():
            numbers = [""] * 5
            if spread is not None:
                found = (spread.mean, spread.deviation, row.within_source[name], spread.low, spread.high)
                numbers = [_plain(x) for x in found]
            about = (row.nbytes, row.fetches, row.sources, row.fits)
            of_epsilon = _plain(row.epsilon) if name in OF_EPSILON else ""
            lines.append((row.source or "all", row.method, *about, name, METRICS[name].unit, *numbers, of_epsilon))
    return csv_text(lines)


def settings_in_words(settings: Any) -> str:
    """Return the settings of a method that affect its error, as text: "textures 2, size 16, effort normal".

    The number of random starts is omitted for a quick or normal search, which starts from the projections of known
    mixes.
    """
    own = vars(settings)
    given = {name: own[name] for name in _SETTINGS if own.get(name) is not None}
    if "bytes" in given:
        given.pop("size", None)
        given["textures"] = f"up to {settings.most_textures}"
    if settings.name in ("mccool", "cole") and "size" in given:
        # Their textures have at most so many texels, in the shape that fits the source best.
        given["size"] = f"up to {given['size']}²"
    if given.get("effort") in DESCENDING and own.get("projections") is None:
        given.pop("restarts", None)
    if settings.name in ("svd", "nmf"):
        # Each has two textures, unless they are the same.
        given = {"terms" if name == "textures" else name: value for name, value in given.items()}
    return ", ".join(name if value is True else f"{name} {value}" for name, value in given.items())


def _plain(value: float | None) -> str:
    return "" if value is None else repr(value)


def _spreads(values: Sequence[tuple[str, float | None]]) -> tuple[Spread | None, float | None]:
    """The spread of (source, number) pairs and the deviation of the fits to a source, as `MeanRow` has them."""
    every = _spread([value for _, value in values])
    if every is None:
        return None, None
    by_source: dict[str, list[float]] = {}
    for source, value in values:
        by_source.setdefault(source, []).append(float(value or 0.0))
    several = [Spread.of(own) for own in by_source.values()]
    variances = [each.deviation**2 for each in several if each.deviation is not None]
    if len(several) == 1:
        return every, None
    means = Spread.of(each.mean for each in several)
    within_source = math.sqrt(fmean(variances)) if variances else None
    return replace(every, mean=means.mean, deviation=means.deviation), within_source


def _spread(values: Sequence[float | None]) -> Spread | None:
    numbers = [value for value in values if value is not None]
    return Spread.of(numbers) if len(numbers) == len(values) else None
