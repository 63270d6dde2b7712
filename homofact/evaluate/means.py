"""Methods over several sources and seeds in one table, for a paper: means and standard deviations, as CSV and LaTeX.

Fits are gathered by method and bytes, since an error is only to be compared at equal bytes: a method whose fits to some
sources take fewer bytes has several rows. The standard deviation is that of a sample (n − 1), over all fits of a row.
"""

import csv
import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal

from homofact.evaluate.spread import Spread
from homofact.evaluate.units import LATEX, unit_of
from homofact.evaluate.wording import counted
from homofact.version import __version__

_SPECIAL = {
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    **{each: f"\\{each}" for each in "&%$#_{}"}, **{each: f"${each}$" for each in "<>|"},
}  # fmt: skip
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


def mean_rows(fits: Sequence[MeasuredFit], source: str = "") -> list[MeanRow]:
    """The rows over all fits, or over those of one source, in the order in which methods first come."""
    own = [each for each in fits if source in ("", each.source)]
    found = []
    for method in dict.fromkeys(each.method for each in own):
        for nbytes in sorted({each.nbytes for each in own if each.method == method}):
            some = [each for each in own if (each.method, each.nbytes) == (method, nbytes)]
            spreads = {name: _spread([each.values[name] for each in some]) for name in some[0].values}
            sources, fetches = len({each.source for each in some}), max(each.fetches for each in some)
            found.append(MeanRow(source, method, nbytes, fetches, sources, len(some), spreads))
    return found


def csv_of(fits: Sequence[MeasuredFit]) -> str:
    """A line a source ("all" first), method, bytes and metric: unit, mean, standard deviation, least and greatest."""
    names = list(dict.fromkeys(each.source for each in fits))
    rows = mean_rows(fits) + [row for name in names for row in mean_rows(fits, name)]
    file = io.StringIO()
    lines = csv.writer(file, lineterminator="\n")
    lines.writerow(_COLUMNS)
    for row in rows:
        for name, spread in row.spreads.items():
            numbers = ["", "", "", ""]
            if spread is not None:
                numbers = [_plain(x) for x in (spread.mean, spread.deviation, spread.low, spread.high)]
            about = (row.nbytes, row.fetches, row.sources, row.fits)
            lines.writerow((row.source or "all", row.method, *about, name, unit_of(name), *numbers))
    return file.getvalue()


def latex_of(fits: Sequence[MeasuredFit]) -> str:
    """A tabular for booktabs over all fits: a line a method and bytes, a column a metric, its unit in the head."""
    rows = mean_rows(fits)
    metrics = list(rows[0].spreads)
    heads = [_headed(name) for name in metrics]
    sources = list(dict.fromkeys(each.source for each in fits))
    seeds = sorted({each.seed for each in fits})
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
    cells = [escaped(row.method), str(row.nbytes), str(row.fits), *map(_cell, row.spreads.values())]
    return " & ".join(cells) + r" \\"


def escaped(text: str) -> str:
    """A name as text of LaTeX: nothing in it is a command; what does not print is a space."""
    return "".join(_SPECIAL.get(each, each if each.isprintable() else " ") for each in text)


def rounded(mean: float, deviation: float | None) -> tuple[str, str, int]:
    """(mean, standard deviation, n) in as many digits as the deviation deserves, both to be taken times 10ⁿ.

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
    found = scaled.quantize(Decimal(1).scaleb(-digits))
    return f"{found:f}" if digits >= 0 else f"{int(found)}"


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
    unit = unit_of(metric)
    return escaped(metric.replace("_", " ")) + (f" ({LATEX[unit]})" if unit else "")


def _comment(text: str) -> str:
    return re.sub(r"[^ -~\u00a0-\uffff]", " ", text)


def _plain(value: float | None) -> str:
    return "" if value is None else repr(value)


def _spread(values: Sequence[float | None]) -> Spread | None:
    numbers = [each for each in values if each is not None]
    return Spread.of(numbers) if len(numbers) == len(values) else None
