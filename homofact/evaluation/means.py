"""Methods over several sources and seeds in one table, for a paper: means and standard deviations, as CSV and LaTeX.

Fits are gathered by method and bytes, since an error is only to be compared at equal bytes: a method whose fits to some
sources take fewer bytes has several rows. The standard deviation is that of a sample (n − 1), over all fits of a row.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from statistics import fmean
from typing import Any

from homofact.evaluation.appearance import mean_figures
from homofact.evaluation.metric_table import METRICS
from homofact.evaluation.opinion import opinion_table
from homofact.evaluation.spread import Spread
from homofact.evaluation.wording import counted
from homofact.files.tables import csv_text
from homofact.version import __version__

_SPECIAL = {
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    **{letter: f"\\{letter}" for letter in "&%$#_{}"}, **{letter: f"${letter}$" for letter in "<>|"},
}  # fmt: skip
# Methods as papers write them; others keep their names.
_METHODS = {
    "search": "Search", "cole": "Cole", "mccool": "McCool", "svd": "SVD", "nmf": "NMF", "ggx": "GGX",
    "gaussians": "Gaussians", "npf": "NPF", "nbrdf": "NBRDF",
}  # fmt: skip
# Units as LaTeX sets them.
_LATEX = {"sr⁻²": r"$\mathrm{sr}^{-2}$", "sr⁻¹": r"$\mathrm{sr}^{-1}$", "sr⁻¹ᐟ³": r"$\mathrm{sr}^{-1/3}$", "dB": "dB"}
_COLUMNS = (
    "source", "method", "bytes", "fetches", "sources", "fits", "metric", "unit", "mean", "standard_deviation", "min",
    "max", "epsilon",
)  # fmt: skip
# Metrics of the log transform, whose values depend on its ε.
OF_EPSILON = ("log_mse", "log_mae", "log_max")


@dataclass(frozen=True)
class MeasuredFit:
    """One fit: what it is of and by, its bytes and fetches, and its metrics' numbers by name, None for no number.

    `epsilon` is that of its log transform, `samples` how many the source has, `held_out` how many of them the numbers
    are from.
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


@dataclass(frozen=True)
class MeanRow:
    """All fits by one method in so many bytes: of a source, or of all ("").

    `spreads` are by metric; None where some fit has no number. `epsilon` is None where fits have different ones.
    """

    source: str
    method: str
    nbytes: int
    fetches: int
    sources: int
    fits: int
    epsilon: float | None
    spreads: dict[str, Spread | None]


def mean_record(records: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the records of fits that differ in their seed alone, as one: of a comparison or of a chart.

    Errors, seconds, evaluations and figures of light are means; "spread" has the mean, least, greatest and standard
    deviation of each, and "seeds" are the fits'. Bytes and fetches are those of the largest fit; all else is the
    first's.
    """
    own = records[0]

    def spreads(several: Sequence[Mapping[str, float]]) -> dict[str, dict[str, float | None]]:
        return {name: Spread.of(numbers[name] for numbers in several).record() for name in several[0]}

    error = {part: spreads([record["error"][part] for record in records]) for part in own["error"]}
    seconds = spreads([record["seconds"] for record in records])
    evaluations = Spread.of(record["evaluations"] for record in records)
    figures = [record["appearance"] for record in records if record["appearance"] is not None]
    return {
        **own,
        **{name: max(record[name] for record in records) for name in ("bytes", "fetches")},
        "status": ", ".join(dict.fromkeys(record["status"] for record in records)),
        "evaluations": evaluations.mean,
        "seconds": {name: spread["mean"] for name, spread in seconds.items()},
        "error": {part: {name: spread["mean"] for name, spread in some.items()} for part, some in error.items()},
        "appearance": figures[0] | mean_figures(figures) | _mean_opinion(figures) if figures else None,
        "seeds": [record["seed"] for record in records],
        "spread": {"error": error, "seconds": seconds, "evaluations": evaluations.record()},
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
        for nbytes in sorted({fit.nbytes for fit in own if fit.method == method}):
            some = [fit for fit in own if (fit.method, fit.nbytes) == (method, nbytes)]
            spreads = {name: _spread([fit.values[name] for fit in some]) for name in some[0].values}
            sources, fetches = len({fit.source for fit in some}), max(fit.fetches for fit in some)
            epsilons = {fit.epsilon for fit in some}
            epsilon = epsilons.pop() if len(epsilons) == 1 else None
            rows.append(MeanRow(source, method, nbytes, fetches, sources, len(some), epsilon, spreads))
    return rows


def mixed_epsilons(fits: Sequence[MeasuredFit]) -> str:
    """Return a warning if means are over Cole errors with different ε, which cannot be compared; else nothing.

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


def csv_of(fits: Sequence[MeasuredFit]) -> str:
    """A line a source ("all" first), method, bytes and metric: unit, mean, standard deviation, least and greatest."""
    names = list(dict.fromkeys(fit.source for fit in fits))
    rows = mean_rows(fits) + [row for name in names for row in mean_rows(fits, name)]
    lines: list[Sequence[Any]] = [_COLUMNS]
    for row in rows:
        for name, spread in row.spreads.items():
            numbers = ["", "", "", ""]
            if spread is not None:
                numbers = [_plain(x) for x in (spread.mean, spread.deviation, spread.low, spread.high)]
            about = (row.nbytes, row.fetches, row.sources, row.fits)
            of_epsilon = _plain(row.epsilon) if name in OF_EPSILON else ""
            lines.append((row.source or "all", row.method, *about, name, METRICS[name].unit, *numbers, of_epsilon))
    return csv_text(lines)


def latex_of(fits: Sequence[MeasuredFit], by_source: bool = False) -> str:
    """Return a tabular for booktabs over all fits: a line per method and bytes, a column per metric with its unit.

    With `by_source`, the lines of each source come first, below its name, and those over all sources last.
    """
    rows = mean_rows(fits)
    metrics = list(rows[0].spreads)
    heads = [_headed(name) for name in metrics]
    sources = {fit.source for fit in fits}
    seeds = sorted({fit.seed for fit in fits})
    of = f"{counted(len(sources), 'source')} and {counted(len(seeds), 'seed')} ({', '.join(map(str, seeds))})"
    lines = [
        f"% homofact {__version__}: mean and standard deviation over the fits to {of}, on held-out samples.",
        *(f"% {_comment(line)}" for line in sources_in_words(fits)),
        r"% \usepackage{booktabs}",
        rf"\begin{{tabular}}{{l{'r' * (len(metrics) + 2)}}}",
        r"\toprule",
        " & ".join(["Method", "Bytes", "Fits", *heads]) + r" \\",
        r"\midrule",
        *(_groups(fits) if by_source else []),
        *map(_line, rows),
        r"\bottomrule",
        r"\end{tabular}",
    ]
    return "\n".join(lines) + "\n"


def _groups(fits: Sequence[MeasuredFit]) -> list[str]:
    """The lines of each source below its name, and the head of those over all."""
    names = list(dict.fromkeys(fit.source for fit in fits))
    if len(names) == 1:
        return []
    lines = []
    for name in names:
        rows = mean_rows(fits, name)
        lines += [_across(escaped(name), rows[0]), *map(_line, rows), r"\midrule"]
    return [*lines, _across("All sources", mean_rows(fits)[0])]


def _across(words: str, row: MeanRow) -> str:
    return rf"\multicolumn{{{len(row.spreads) + 3}}}{{l}}{{{words}}} \\"


def sources_in_words(fits: Sequence[MeasuredFit]) -> list[str]:
    """Return a line per source with the ε of its fits and how many samples were held out, and a warning if ε differs.

    Examples
    --------
    >>> sources_in_words([MeasuredFit("paint", "mccool", 0, 12, 3, {"log_mse": 0.1}, 0.01, 1830, 366)])
    ['paint: epsilon 0.01; 366 of 1830 samples held out']
    """
    first = {fit.source: fit for fit in reversed(fits)}
    names = dict.fromkeys(fit.source for fit in fits)
    lines = []
    for name in names:
        epsilons = " to ".join(f"{e:g}" for e in sorted({fit.epsilon for fit in fits if fit.source == name}))
        one = first[name]
        part = (
            f"{one.held_out} of {one.samples} samples held out"
            if one.held_out
            else f"no sample of {one.samples} held out"
        )
        lines.append(f"{name}: epsilon {epsilons}; {part}")
    warning = mixed_epsilons(fits)
    return [*lines, *([f"Beware: {warning}"] if warning else [])]


def _line(row: MeanRow) -> str:
    cells = [escaped(_method(row.method)), str(row.nbytes), str(row.fits), *map(_cell, row.spreads.values())]
    return " & ".join(cells) + r" \\"


def _method(label: str) -> str:
    """A label with its method as papers write it: "GGX:2" for "ggx:2"."""
    name, colon, listed = label.partition(":")
    return _METHODS.get(name, name) + colon + listed


def escaped(text: str) -> str:
    """Return a name as text of LaTeX: nothing in it is a command; what does not print is a space."""
    return "".join(_SPECIAL.get(letter, letter if letter.isprintable() else " ") for letter in text)


def rounded(mean: float, deviation: float | None) -> tuple[str, str, int]:
    """Return (mean, standard deviation, n) in as many digits as the deviation deserves, both to be taken times 10ⁿ.

    The deviation has one digit, two where the first is 1; without one, or where it is 0, the mean has three. n is 0
    where the mean is readable without.
    """
    largest = max(abs(mean), deviation or 0.0)
    power = math.floor(math.log10(largest)) if largest > 0 else 0
    power = 0 if -3 <= power < 5 else power
    if not deviation:
        digits = 2 - (math.floor(math.log10(abs(mean))) if mean else 0)
        return _fixed(mean, digits + power, power), "" if deviation is None else "0", power
    # Its first digit as it is rounded: that of 0.0996 is a 1.
    kept = Decimal(f"{deviation:.1e}")
    digits = (1 if kept.as_tuple().digits[0] == 1 else 0) - kept.adjusted()
    return _fixed(mean, digits + power, power), _fixed(deviation, digits + power, power), power


def _fixed(value: float, digits: int, power: int) -> str:
    """A number over 10^power with so many digits behind the point; whole ones rounded to tens for fewer than none."""
    scaled = Decimal(repr(value)).scaleb(-power)
    digits_kept = scaled.quantize(Decimal(1).scaleb(-digits))
    return f"{digits_kept:f}" if digits >= 0 else f"{int(digits_kept)}"


def _cell(spread: Spread | None) -> str:
    if spread is None or math.isnan(spread.mean):
        return "--"
    if math.isinf(spread.mean):
        return r"$\infty$" if spread.mean > 0 else r"$-\infty$"
    mean, deviation, power = rounded(spread.mean, spread.deviation)
    both = rf"{mean} \pm {deviation}" if deviation else mean
    if power == 0:
        return f"${both}$"
    return rf"$({both}) \times 10^{{{power}}}$" if deviation else rf"${both} \times 10^{{{power}}}$"


def _headed(metric: str) -> str:
    """A metric in words and its unit, capitalized; its name where the words need more than ASCII."""
    unit, words = METRICS[metric].unit, METRICS[metric].label
    words = words if words.isascii() else metric.replace("_", " ")
    return escaped(words[:1].upper() + words[1:]) + (f" ({_LATEX[unit]})" if unit else "")


def _comment(text: str) -> str:
    return re.sub(r"[^ -~\u00a0-\uffff]", " ", text)


def _plain(value: float | None) -> str:
    return "" if value is None else repr(value)


def _spread(values: Sequence[float | None]) -> Spread | None:
    numbers = [value for value in values if value is not None]
    return Spread.of(numbers) if len(numbers) == len(values) else None
