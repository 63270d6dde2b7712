"""Format numbers for tables, captions and pages."""

from collections.abc import Sequence


def shapes(sizes: Sequence[Sequence[int]]) -> str:
    """Return texture sizes (rows, columns) as text: "2 × 16²", "2 × 17×15", or each size if they differ.

    A texture of a single row is written like a square of the same length. Returns a dash if there are no textures.
    """
    if not sizes:
        return "–"
    sides = {max(size) for size in sizes if min(size) in (1, max(size))}
    if len(sides) == 1 and all(min(size) in (1, max(size)) for size in sizes):
        return f"{len(sizes)} × {sides.pop()}²"
    if len(sizes) > 1 and all(tuple(size) == tuple(sizes[0]) for size in sizes):
        return f"{len(sizes)} × {sizes[0][0]}×{sizes[0][1]}"
    return " + ".join(f"{rows}×{columns}" for rows, columns in sizes)


def figure(value: float | None) -> str:
    """Return three significant digits in at most eight characters."""
    if value is None:
        return "–"
    return f"{value:.3g}" if value == 0 or 1e-4 <= abs(value) < 1e5 else f"{value:.1e}"


def brief_figure(value: float) -> str:
    """Return two significant digits in at most seven characters; numbers from 100 to 99,999 keep all whole digits.

    Examples
    --------
    >>> [brief_figure(value) for value in (0.0, 0.000394, 9.14e-5, 199.2)]
    ['0', '0.00039', '9.1e-05', '199']
    """
    if 100 <= abs(value) < 1e5:
        return f"{value:.0f}"
    return f"{value:.2g}" if value == 0 or 1e-4 <= abs(value) < 100 else f"{value:.1e}"


def ratio_figure(value: float) -> str:
    """Return a ratio with two significant digits, or with three decimals near 1 so that 1.003 does not become 1.

    Examples
    --------
    >>> [ratio_figure(value) for value in (0.0169, 0.996, 1.0, 1.0034, 1.27)]
    ['0.017', '0.996', '1', '1.003', '1.3']
    """
    return f"{value:.3f}" if value != 1 and abs(value - 1) < 0.05 else brief_figure(value)


def used_of_limit(ratio: float) -> str:
    """Return the part of a limit that an error uses, as words.

    Examples
    --------
    >>> used_of_limit(0.32), used_of_limit(10.0)
    ('32% of the limit', '10 × the limit')
    """
    words = part_of_limit(ratio)
    return f"{words} the limit" if words.endswith("×") else f"{words} of the limit"


def part_of_limit(ratio: float) -> str:
    """Return the ratio of an error to its limit in percent, or from 10 on as a multiple: "87%", "173 ×".

    Examples
    --------
    >>> [part_of_limit(ratio) for ratio in (0.874, 1.0, 1.002, 9.99, 10.0, 173.46, 2.5e6)]
    ['87%', '100%', 'over 100%', '999%', '10 ×', '173 ×', '2.5e+06 ×']
    """
    percent = f"{ratio:.0%}"
    if ratio > 1 and percent == "100%":
        return "over 100%"
    if len(percent) < len("1000%"):
        return percent
    return f"{ratio:.0f} ×" if ratio < 1e5 else f"{figure(ratio)} ×"


def trust_in_words(trusted: bool, said: str = "", wide: bool = False) -> str:
    """Prefix the sentence of a verdict with whether the fit is trusted, unless it already starts with that.

    `wide` is True if the error bars exceed the largest errors of a good fit.

    Examples
    --------
    >>> trust_in_words(True, "measured against the source: highlight within 2%")
    'trusted; measured against the source: highlight within 2%'
    >>> trust_in_words(True, wide=True), trust_in_words(False, wide=True)
    ('trusted, with wide limits', 'not trusted')
    """
    word = ("trusted, with wide limits" if wide else "trusted") if trusted else "not trusted"
    if not said:
        return word
    return said if said.startswith("trusted" if trusted else "not trusted") else f"{word}; {said}"


def light_by_incidence(rows: Sequence[Sequence[float]]) -> str:
    """Return rows (from, to, ratio) of θi in degrees as "5° 101%, 15–30° 98%"; a single angle if from equals to.

    Examples
    --------
    >>> light_by_incidence([(5, 5, 1.01), (15, 30, 0.984)])
    '5° 101%, 15–30° 98%'
    """
    return ", ".join(
        (f"{low:.0f}–{high:.0f}°" if high > low else f"{low:g}°") + f" {ratio:.0%}" for low, high, ratio in rows
    )


def findings_named(names: Sequence[str]) -> str:
    """Return the names of findings as a suffix of the verdict: " (findings: coverage, light)"; "" without findings.

    A name that several findings share appears once.
    """
    return f" (findings: {', '.join(dict.fromkeys(names))})" if names else ""


def listed(words: Sequence[str]) -> str:
    """Return words with commas and an "and" before the last.

    Examples
    --------
    >>> listed(["one"]), listed(["one", "two"]), listed(["one", "two", "three"])
    ('one', 'one and two', 'one, two and three')
    """
    return " and ".join(filter(None, (", ".join(words[:-1]), *words[-1:])))


def counted(number: int, noun: str) -> str:
    """Return the number with its noun, in the plural where it is not 1."""
    plural = f"{noun}es" if noun.endswith("ch") else f"{noun}s"
    return f"{number} {noun if number == 1 else plural}"


def repeated_by(seeds: int, splits: int) -> str:
    """Return what several fits of a method differ in: "seeds", "splits", or "fits" for both.

    Examples
    --------
    >>> repeated_by(3, 1), repeated_by(1, 5), repeated_by(3, 5)
    ('seeds', 'splits', 'fits')
    """
    return "seeds" if splits == 1 else "splits" if seeds == 1 else "fits"


def of_repeats(seeds: int, splits: int) -> str:
    """Return the number of fits of a method as text, with the seeds or splits in which they differ.

    Examples
    --------
    >>> of_repeats(3, 1), of_repeats(1, 5), of_repeats(3, 5)
    ('3 fits by different seeds', '5 fits on different splits', '15 fits by 3 seeds on 5 splits')
    """
    if seeds > 1 and splits > 1:
        return f"{seeds * splits} fits by {seeds} seeds on {splits} splits"
    return f"{splits} fits on different splits" if splits > 1 else f"{seeds} fits by different seeds"


def listed_seeds(seeds: Sequence[int]) -> str:
    """Return seeds in words.

    Examples
    --------
    >>> listed_seeds([4]), listed_seeds([4, 7]), listed_seeds([4, 5, 6])
    ('seed 4', 'seeds 4 and 7', 'seeds 4 to 6')
    """
    if len(seeds) > 2 and list(seeds) == list(range(seeds[0], seeds[-1] + 1)):
        return f"seeds {seeds[0]} to {seeds[-1]}"
    return f"seed{'s' * (len(seeds) > 1)} {listed(list(map(str, seeds)))}"
