"""Write tables and numbers for a LaTeX paper: cells, booktabs tables, and macros of numbers."""

import re
from collections.abc import Iterable, Sequence

NONE = "--"
_SPECIAL = {"_": r"\_", "%": r"\%", "&": r"\&", "#": r"\#", "×": r"$\times$", "²": "$^2$", "–": "--"}


def words(text: str) -> str:
    """Text as LaTeX sets it: special characters escaped. Raises ValueError for a letter that it does not know."""
    escaped = "".join(_SPECIAL.get(letter, letter) for letter in text)
    if not escaped.isascii():
        raise ValueError(f"no LaTeX for {[letter for letter in escaped if not letter.isascii()]} in {text!r}")
    return escaped


def figure(value: float | None) -> str:
    """Three digits, as mathematics where the number is negative or has an exponent; a dash for None."""
    if value is None:
        return NONE
    if value == 0 or 1e-4 <= abs(value) < 1e4:
        text = f"{value:.3g}"
        return f"${text}$" if value < 0 else text
    mantissa, exponent = f"{value:.2e}".split("e")
    return rf"${mantissa}\cdot 10^{{{int(exponent)}}}$"


def fixed(value: float | None, digits: int, sign: bool = False) -> str:
    """A number with so many decimals; a dash for None."""
    if value is None:
        return NONE
    return f"${value:+.{digits}f}$" if sign or value < 0 else f"{value:.{digits}f}"


def percent(share: float, digits: int = 1) -> str:
    """A share in percent."""
    return rf"{fixed(100 * share, digits)}\%"


def capitalized(head: str) -> str:
    """A head of a column with its first letter in upper case, unless that begins a unit such as dB."""
    return head if head[1:2].isupper() else head[:1].upper() + head[1:]


def booktabs(head: Sequence[str], rows: Iterable[Sequence[str] | None], text_columns: int = 1) -> str:
    """A tabular for the package booktabs; columns after the first `text_columns` are flush right, None is a rule.

    The cells are LaTeX already; those of the head are capitalized. Raises ValueError for a row of another length than
    the head.
    """
    columns = "l" * text_columns + "r" * (len(head) - text_columns)
    heads = " & ".join(map(capitalized, head)) + r" \\"
    lines = [rf"\begin{{tabular}}{{@{{}}{columns}@{{}}}}", r"\toprule", heads, r"\midrule"]
    for row in rows:
        if row is not None and len(row) != len(head):
            raise ValueError(f"a row of {len(row)} cells under a head of {len(head)}: {row}")
        lines.append(r"\midrule" if row is None else " & ".join(row) + r" \\")
    return "\n".join((*lines, r"\bottomrule", r"\end{tabular}", ""))


class Macros:
    """Numbers of the running text by name, each a command without arguments: \\newcommand{\\name}{value}."""

    def __init__(self) -> None:
        """None so far."""
        self._values: dict[str, str] = {}

    def add(self, name: str, value: object) -> None:
        """Name a number. Raises ValueError for a name that is taken, or is no LaTeX command's (letters alone)."""
        if not re.fullmatch(r"[A-Za-z]+", name) or name in self._values:
            raise ValueError(f"the macro {name!r} is taken, or has more than letters")
        self._values[name] = str(value)

    def __getitem__(self, name: str) -> str:
        """The value of a name."""
        return self._values[name]

    def text(self) -> str:
        """The file of all macros, in the order in which they were named."""
        return "".join(rf"\newcommand{{\{name}}}{{{value}}}" + "\n" for name, value in self._values.items())
