"""Write the means of a comparison as a LaTeX table: a tabular for booktabs with comments on sources and methods.

Means have at least three digits, and deviations are rounded to the same decimal place. If a column has a number below
0.001 or from 100,000 on, the whole column is scaled by one power of ten, which its heading states. A column whose
numbers differ too much in size is not scaled.
"""

import math
import re
from collections.abc import Mapping, Sequence
from decimal import Decimal

from homofact.evaluation.means import MeanRow, MeasuredFit, mean_rows, mixed_epsilons, same_fits
from homofact.evaluation.metric_table import METRICS
from homofact.evaluation.spread import Spread
from homofact.evaluation.wording import counted, listed_seeds, repeated_by
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
_MARK = r"$\dagger$"  # of a method with fits that are not reciprocal
# Decades of a column's numbers that one power of ten serves.
_DECADES = 4


def latex_of(fits: Sequence[MeasuredFit], by_source: bool = False, notes: Sequence[str] = ()) -> str:
    """Return a tabular for booktabs over all fits: a line per method and bytes with its fetches, a column per metric
    with its unit.

    With `by_source`, the lines of each source come first, below its name, and the lines over all sources come last. A
    column with very small or very large numbers is scaled by one power of ten, which its heading states, if one power
    suits all of its numbers. A line below the table explains the mark of methods with fits that are not reciprocal.
    Comments in the file list the settings of each method and the `notes`.
    """
    rows = mean_rows(fits)
    metrics = list(rows[0].spreads)
    groups = _groups(fits) if by_source else []
    every = [*rows, *(row for _, some in groups for row in some)]
    powers = _powers(every)
    heads = [_headed(name, powers[name]) for name in metrics]
    sources = {fit.source for fit in fits}
    seeds = sorted({fit.seed for fit in fits})
    splits = {fit.split_seed for fit in fits}
    of = f"{counted(len(sources), 'source')} with method {listed_seeds(seeds)}"
    of += f" and {counted(len(splits), 'split')} (choices of the held-out samples)" if len(splits) > 1 else ""
    repeats = repeated_by(len(seeds), len(splits))
    own = f"; in the rows of one source: over its {repeats}" if groups else ""
    within = f"over the sources; in parentheses: over the {repeats} of a source{own}"
    two = any(value is not None for row in rows for value in row.within_source.values())
    lines = [
        f"% homofact {__version__}: mean and standard deviation over the fits to {of}, on held-out samples.",
        *(
            f"% {_comment(line)}"
            for line in (*sources_in_words(fits), *methods_in_words(fits), same_fits(fits), *notes)
            if line
        ),
        r"% \usepackage{booktabs}",
        rf"\begin{{tabular}}{{l{'r' * (len(metrics) + 3)}}}",
        r"\toprule",
        " & ".join(["Method", "Bytes", "Fetches", "Fits", *heads]) + r" \\",
        r"\midrule",
        *_grouped(groups, rows[0], powers),
        *(_line(row, powers) for row in rows),
        r"\bottomrule",
        *([_note(rf"$\pm$: {within}.", rows[0])] if two else []),
        *_marked(fits, rows[0]),
        r"\end{tabular}",
    ]
    return "\n".join(lines) + "\n"


def _groups(fits: Sequence[MeasuredFit]) -> list[tuple[str, list[MeanRow]]]:
    """Each source with its rows; none where there is one source alone."""
    names = list(dict.fromkeys(fit.source for fit in fits))
    return [] if len(names) == 1 else [(name, mean_rows(fits, name)) for name in names]


def _grouped(groups: Sequence[tuple[str, list[MeanRow]]], row: MeanRow, powers: Mapping[str, int | None]) -> list[str]:
    """The lines of each source below its name, and the head of those over all."""
    lines = []
    for name, rows in groups:
        lines += [_across(escaped(name), row), *(_line(one, powers) for one in rows), r"\midrule"]
    return [*lines, _across("All sources", row)] if groups else []


def _note(words: str, row: MeanRow) -> str:
    """A line under a table, over all its columns."""
    return _across(rf"\footnotesize {words}", row)


def _marked(fits: Sequence[MeasuredFit], row: MeanRow) -> list[str]:
    """The line under a table that says what marks its methods; none where no fit is marked."""
    marked = [fit for fit in fits if not fit.is_reciprocal]
    if not marked:
        return []
    most = max(fit.swapped for fit in marked)
    share = f"{most:.0%}".replace("%", r"\%")
    return [_note(f"{_MARK} Not reciprocal: swapping light and viewer changes up to {share} of the light.", row)]


def _across(words: str, row: MeanRow) -> str:
    return rf"\multicolumn{{{len(row.spreads) + 4}}}{{l}}{{{words}}} \\"


def methods_in_words(fits: Sequence[MeasuredFit]) -> list[str]:
    """Return a line per method with its settings and the number of its fits that are not reciprocal.

    Examples
    --------
    >>> methods_in_words([MeasuredFit("paint", "search", 0, 12, 3, {}, 0.01, 90, 9, 0.04, "textures 2, effort normal")])
    ['search: textures 2, effort normal; 1 of 1 fit not reciprocal']
    """
    lines = []
    for name in dict.fromkeys(fit.method for fit in fits):
        own = [fit for fit in fits if fit.method == name]
        several = dict.fromkeys(fit.settings for fit in own if fit.settings)
        one_way = sum(not fit.is_reciprocal for fit in own)
        parts = [*several, *([f"{one_way} of {counted(len(own), 'fit')} not reciprocal"] if one_way else [])]
        if parts:
            lines.append(f"{name}: {'; '.join(parts)}")
    return lines


def _powers(rows: Sequence[MeanRow]) -> dict[str, int | None]:
    """The power of ten of each metric's column; None where its numbers are too far apart for one.

    Column by column: 0 where all its numbers are readable without.
    """
    found: dict[str, int | None] = {}
    for name in rows[0].spreads:
        spreads = [row.spreads[name] for row in rows]
        sizes = [max(abs(each.mean), each.deviation or 0.0) for each in spreads if each is not None]
        places = [math.floor(math.log10(size)) for size in sizes if 0 < size < math.inf]
        low, high = min(places, default=0), max(places, default=0)
        plain = low >= -3 and high < 5
        found[name] = 0 if plain else max(low, high - 2) if high - low <= _DECADES else None
    return found


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
        lines.append("; ".join(filter(None, (f"{name}: epsilon {epsilons}", part, one.sampling))))
    warning = mixed_epsilons(fits)
    return [*lines, *([f"Beware: {warning}"] if warning else [])]


def _line(row: MeanRow, powers: Mapping[str, int | None]) -> str:
    mark = f"$^{{{_MARK.strip('$')}}}$" if row.not_reciprocal else ""
    numbers = (_cell(spread, row.within_source[name], powers[name]) for name, spread in row.spreads.items())
    cells = [escaped(_method(row.method)) + mark, str(row.nbytes), str(row.fetches), str(row.fits), *numbers]
    return " & ".join(cells) + r" \\"


def _method(label: str) -> str:
    """A label as papers write it: "GGX (2 lobes)" for "ggx:2", "SVD (half-diff)" for "svd:half-diff"."""
    name, _, listed = label.partition(":")
    method = _METHODS.get(name, name)
    if listed.isdecimal():
        listed = counted(int(listed), "lobe")
    return f"{method} ({listed})" if listed else method


def escaped(text: str) -> str:
    """Return a name with LaTeX commands escaped and unprintable characters replaced by spaces."""
    return "".join(_SPECIAL.get(letter, letter if letter.isprintable() else " ") for letter in text)


def rounded(mean: float, deviation: float | None, power: int | None = None) -> tuple[str, str, int]:
    """Return (mean, standard deviation, n) as rounded text; both numbers must be multiplied by 10ⁿ.

    The mean has three significant digits. It has more if the first digit of the deviation (the first two, if the first
    is 1) is at a lower decimal place, and fewer if three digits would end more than two places after that digit. n is
    `power`. If `power` is None, n is chosen, and is 0 if the mean is readable without a power of ten.
    """
    if power is None:
        power = _own_power(mean, deviation)
        power = 0 if -3 <= power < 5 else power
    digits = 2 - (math.floor(math.log10(abs(mean))) if mean else 0)
    if not deviation:
        return _fixed(mean, digits + power, power), "" if deviation is None else "0", power
    digits = min(max(digits, _digits(deviation)), _digits(deviation) + 2)
    return _fixed(mean, digits + power, power), _fixed(deviation, digits + power, power), power


def _digits(deviation: float) -> int:
    """How many digits behind the point a deviation deserves."""
    # Its first digit as it is rounded: that of 0.0996 is a 1.
    kept = Decimal(f"{deviation:.1e}")
    return (1 if kept.as_tuple().digits[0] == 1 else 0) - kept.adjusted()


def _own_power(mean: float, deviation: float | None) -> int:
    """The power of ten of the first digit of the larger one."""
    largest = max(abs(mean), deviation or 0.0)
    return math.floor(math.log10(largest)) if largest > 0 else 0


def _fixed(value: float, digits: int, power: int) -> str:
    """A number over 10^power with so many digits behind the point; whole ones rounded to tens for fewer than none."""
    scaled = Decimal(repr(value)).scaleb(-power)
    digits_kept = scaled.quantize(Decimal(1).scaleb(-digits))
    return f"{digits_kept:f}" if digits >= 0 else f"{int(digits_kept)}"


def _cell(spread: Spread | None, within_source: float | None, power: int | None) -> str:
    """A cell of a column whose head has the `power` of ten; of None each cell has its own.

    The deviation `within_source` stands behind it in parentheses.
    """
    if spread is None or math.isnan(spread.mean):
        return "--"
    if math.isinf(spread.mean):
        return r"$\infty$" if spread.mean > 0 else r"$-\infty$"
    own = _own_power(spread.mean, spread.deviation) if power is None else power
    mean, deviation, _ = rounded(spread.mean, spread.deviation, own)
    both = rf"{mean} \pm {deviation}" if deviation else mean
    if within_source is not None:
        both += rf"\;({_fixed(within_source, _digits(within_source) + own, own) if within_source else '0'})"
    if power is not None:
        return f"${both}$"
    return rf"$({both}) \times 10^{{{own}}}$" if deviation else rf"${both} \times 10^{{{own}}}$"


def _headed(metric: str, power: int | None) -> str:
    """A metric in words, capitalized, with its column's power of ten and its unit; its name if words are no ASCII."""
    unit, words = METRICS[metric].unit, METRICS[metric].label
    words = words if words.isascii() else metric.replace("_", " ")
    parts = [f"$10^{{{power}}}$"] if power else []
    parts += [_LATEX[unit]] if unit else []
    return escaped(words[:1].upper() + words[1:]) + (f" ({' '.join(parts)})" if parts else "")


def _comment(text: str) -> str:
    return re.sub(r"[^ -~\u00a0-\uffff]", " ", text)
