"""Read text whose earlier lines define the content of later ones, with errors that name the line."""

import numpy as np

from homofact.brdf.formats.reading import line_fault
from homofact.errors import BadInput
from homofact.files.text import number_table, short

_MOST = 100_000


class LineReader:
    """Reads the lines (number, text) of the file `path` one after the other."""

    def __init__(self, path: object, lines: list[tuple[int, str]]) -> None:
        self.path = path
        self._lines = lines
        self._next = 0

    @property
    def left(self) -> int:
        """The number of lines not read yet."""
        return len(self._lines) - self._next

    def line(self, what: str) -> str:
        """Return the next line without surrounding blanks. Raises BadInput where the file ends before it."""
        if not self.left:
            last = self._lines[-1][0] if self._lines else 0
            raise BadInput(f"the file ends after line {last}", where=self.path, expected=what)
        self._next += 1
        return self._lines[self._next - 1][1].strip()

    def fault(self, problem: str, expected: object) -> BadInput:
        """Return an error about the line that was read last."""
        return line_fault(self.path, self._lines[max(0, self._next - 1)][0], problem, expected)

    def whole(self, word: str, what: str, most: int = _MOST) -> int:
        """Return a word of the last line as a whole number from 1 to `most`. Raises BadInput naming the line."""
        if not (word.isascii() and word.isdecimal() and len(word) < 10 and 1 <= int(word) <= most):
            raise self.fault(f"{what} is {short(word)}", f"a whole number from 1 to {most}")
        return int(word)

    def wholes(self, count: int, what: str) -> list[int]:
        """Return the next line's `count` whole numbers from 1. Raises BadInput naming the line."""
        words = self.line(what).split()
        if len(words) != count:
            raise self.fault(f"{len(words)} numbers", f"{count}: {what}")
        return [self.whole(word, what) for word in words]

    def flags(self, count: int, what: str) -> list[bool]:
        """Return the next line's `count` numbers that are 0 or 1. Raises BadInput naming the line."""
        words = self.line(what).split()
        if len(words) != count or any(word not in ("0", "1") for word in words):
            raise self.fault(f"{short(' '.join(words))}", f"{count} of 0 and 1: {what}")
        return [word == "1" for word in words]

    def numbers(self, count: int, what: str) -> np.ndarray:
        """Return `count` numbers from the next lines, wrapped in any way. Raises BadInput naming the line."""
        found: list[float] = []
        while len(found) < count:
            words = self.line(f"{count} numbers: {what}").split()
            if len(found) + len(words) > count or not words:
                raise self.fault(f"{len(found) + len(words)} numbers", f"{count}: {what}")
            found += number_table(self.path, [(self._lines[self._next - 1][0], " ".join(words))], len(words), what)[0][
                0
            ].tolist()
        return np.array(found)

    def table(self, rows: int, columns: int, what: str) -> np.ndarray:
        """Return the next `rows` lines of `columns` numbers each. Raises BadInput naming the line."""
        if rows > self.left:
            raise BadInput(
                f"the file ends {rows - self.left} lines early", where=self.path, expected=f"{rows} rows of {what}"
            )
        self._next += rows
        return number_table(self.path, self._lines[self._next - rows : self._next], columns, what)[0]
