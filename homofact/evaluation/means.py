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
    "max",
)  # fmt: skip


@dataclass(frozen=True)
class MeasuredFit:
    """One fit: what it is of and by, its bytes and fetches, and its metrics' numbers by name, None for no number."""

    source: str
    method: str
    seed: int
    nbytes: int
    fetches: int
    values: dict[str, float | None]


@dataclass(frozen=True)
class MeanRow:
    """All fits by one method in so many bytes: of a source, or of all ("").

    `spreads` are by metric; None where some fit has no number.
    """

    source: str
    method: str
    nbytes: int
    fetches: int
    sources: int
    fits: int
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
            rows.append(MeanRow(source, method, nbytes, fetches, sources, len(some), spreads))
    return rows


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
            lines.append((row.source or "all", row.method, *about, name, METRICS[name].unit, *numbers))
    return csv_text(lines)


def latex_of(fits: Sequence[MeasuredFit]) -> str:
    """A tabular for booktabs over all fits: a line a method and bytes, a column a metric, its unit in the head."""
    rows = mean_rows(fits)
    metrics = list(rows[0].spreads)
    heads = [_headed(name) for name in metrics]
    sources = list(dict.fromkeys(fit.source for fit in fits))
    seeds = sorted({fit.seed for fit in fits})
    of = f"{counted(len(sources), 'source')} and {counted(len(seeds), 'seed')} ({', '.join(map(str, seeds))})"
    lines = [
        f"% homofact {__version__}: mean and standard deviation over the fits to {of}, on held-out samples.",
        *(f"% {_comment(name)}" for name in sources),
        r"% \usepackage{booktabs}",
        rf"\begin{{tabular}}{{l{'r' * (len(metrics) + 2)}}}",
        r"\toprule",
        " & ".join(["Method", "Bytes", "Fits", *heads]) + r" \\",
        r"\midrule",
        *map(_line, rows),
        r"\bottomrule",
        r"\end{tabular}",
    ]
    return "\n".join(lines) + "\n"


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
