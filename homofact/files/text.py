"""What the text formats share: lines with their numbers, tables of numbers, and errors that name the line."""

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from homofact.errors import BadInput
from homofact.files.words import harmless

_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_SHOWN = 24


def text_of(raw: bytes) -> str:
    """Decode a text file as latin-1, which accepts every byte, without the byte order mark of UTF-8."""
    return raw.removeprefix(_BYTE_ORDER_MARK).decode("latin-1")


def beginning(raw: bytes) -> str:
    """Return the first non-blank line of a file for messages: in quotes, `harmless`, shortened if long."""
    text = raw[:4096].removeprefix(_BYTE_ORDER_MARK).decode("utf-8", "replace")
    line = next((line.strip() for line in text.split("\n") if line.strip()), "")
    return f"'{harmless(line if len(line) <= _SHOWN else line[:_SHOWN] + '…')}'"


def numbered_lines(raw: bytes) -> Iterator[tuple[int, str]]:
    """Yield (line number from 1, text without surrounding blanks) of every line that is not blank."""
    for number, line in enumerate(text_of(raw).split("\n"), 1):
        stripped = line.strip()
        if stripped:
            yield number, stripped


def check_last_line(path: object, raw: bytes, number: int) -> None:
    """Raise BadInput if the last line, `number`, has no line end, because its last value may be cut off."""
    if not raw.endswith((b"\n", b"\r")):
        what = f"line {number} has no line end, so its last number may be cut"
        raise BadInput(what, where=path, expected="a whole file", hint="or add the line end")


def number_table(
    path: object,
    lines: Iterable[tuple[int, str]],
    columns: int,
    what: str,
    separator: str | None = None,
    names: Sequence[str] = (),
) -> tuple[np.ndarray, list[int]]:
    """Return the numbers (rows, columns) of `lines` in float64, and the line of each row.

    In messages, `what` describes the columns, and `names` are their names, if any. A `separator` of None means white
    space. Raises BadInput that names the line for a wrong number of columns, and for a value that is not a finite
    number.
    """
    values: list[float] = []
    numbers: list[int] = []
    for number, line in lines:
        words = line.split(separator)
        if len(words) != columns:
            hint = "commas between columns, points in numbers" if separator == "," and ";" in line else ""
            raise BadInput(
                f"{len(words)} columns", where=f"{path}: line {number}", expected=f"{columns} ({what})", hint=hint
            )
        try:
            row = [float(word) for word in words]
        except ValueError:
            row = [math.nan]
        # float() takes "1_0" too, which no measurement means.
        if not all(map(math.isfinite, row)) or "_" in line:
            column = next(k for k, word in enumerate(words) if not _is_finite(word))
            bad = words[column].strip()
            where = f" in column {names[column] if names else column + 1}"
            found = short(bad) if bad else f"an empty cell{where}"
            raise BadInput(where=f"{path}: line {number}", found=found, expected="a finite number")
        values += row
        numbers.append(number)
    return np.array(values, dtype=np.float64).reshape(-1, columns), numbers


def short(word: str) -> str:
    """Return a word in quotes, cut where it is long."""
    return repr(word if len(word) <= 40 else word[:37] + "...")


def _is_finite(word: str) -> bool:
    try:
        return math.isfinite(float(word)) and "_" not in word
    except ValueError:
        return False
