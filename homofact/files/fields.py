"""Read JSON that a person may have edited: every entry is checked when it is read.

A `Fields` is one object of the file. It stores its own path, so that messages contain the file and the path:
`manifest.json: textures[0].rows: found "many", expected a whole number from 1 to 16384`. Values are checked in the same
way as settings (`settings.options`).
"""

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from homofact.errors import BadInput
from homofact.files.reading import read_json, short_json
from homofact.settings.options import Declared, Option


@dataclass(frozen=True)
class Fields:
    """An object of a JSON file: its entries `found`, and its `place` in words, for messages."""

    place: str
    found: dict[str, Any]

    @classmethod
    def read(cls, path: Path, what: str) -> "Fields":
        """Return the object in a file. Raises BadInput if the file is missing or contains no JSON object."""
        return cls(f"{path}: ", read_json(path, what))

    def refuse(self, name: str, expected: str) -> NoReturn:
        """Raise BadInput with the value of the entry `name`, and what is expected."""
        found = short_json(self.found[name]) if name in self.found else "nothing"
        raise BadInput(where=f"{self.place}{name}", found=found, expected=expected)

    def value(self, name: str, kind: Any, expected: str = "", **allowed: Any) -> Any:
        """Return an entry of the type `kind`, checked like a setting with these attributes of `Option`."""
        declared = Declared(name, (kind,), False, None, Option("", **allowed))
        try:
            return declared.read(self.found[name])
        except (KeyError, BadInput):
            self.refuse(name, expected or declared.expected)

    def text(self, name: str, among: Collection[str] = ()) -> str:
        """Return a text, one of `among` where that is given."""
        return self.value(name, str, "" if among else "a text", choices=tuple(among))

    def whole(self, name: str, least: int, most: int) -> int:
        """Return a whole number in a range."""
        return self.value(name, int, least=least, most=most)

    def version(self, name: str, newest: int) -> None:
        """Check that an entry is a version from 1 to `newest`. Raises BadInput for any other."""
        value = self.found.get(name)
        if isinstance(value, int) and value > newest:
            raise BadInput(f"{self.place}format version {value}", expected=f"at most {newest}", hint="update homofact")
        self.whole(name, 1, newest)

    def flag(self, name: str) -> bool:
        """Return a boolean."""
        return self.value(name, bool)

    def numbers(self, name: str, count: int, above: float | None = None) -> list[float]:
        """Return `count` finite numbers, each greater than `above`."""
        more = "" if above is None else f" above {above:g}"
        return list(self.value(name, tuple[(float,) * count], f"{count} finite numbers{more}", above=above))

    def number(self, name: str, above: float | None = None) -> float:
        """Return a finite number greater than `above`."""
        more = "" if above is None else f" above {above:g}"
        return self.value(name, float, f"a finite number{more}", above=above)

    def rows(self, name: str, count: int, width: int) -> list[list[float]]:
        """Return a matrix of finite numbers, `count` rows of `width`."""
        rows = self._list(name, count, count, f"{count} rows of {width} finite numbers", lambda row: _row(row, width))
        return [[float(each) for each in row] for row in rows]

    def texts(self, name: str, most: int) -> list[str]:
        """Return one to `most` different texts."""
        expected = f"1 to {most} different texts"
        value = self._list(name, 1, most, expected, lambda each: isinstance(each, str))
        if len(set(value)) < len(value):
            self.refuse(name, expected)
        return value

    def bits(self, name: str, count: int, width: int) -> list[list[bool]]:
        """Return `count` texts of `width` characters 0 and 1."""

        def right(row: Any) -> bool:
            return isinstance(row, str) and len(row) == width and set(row) <= {"0", "1"}

        rows = self._list(name, count, count, f"{count} texts of {width} characters 0 and 1", right)
        return [[character == "1" for character in row] for row in rows]

    def inner(self, name: str) -> "Fields":
        """Return an object within this one."""
        value = self.found.get(name)
        if not isinstance(value, dict):
            self.refuse(name, "an object")
        return Fields(f"{self.place}{name}.", value)

    def inners(self, name: str, most: int) -> "list[Fields]":
        """Return one to `most` objects."""
        value = self._list(name, 1, most, f"1 to {most} objects", lambda each: isinstance(each, dict))
        return [Fields(f"{self.place}{name}[{k}].", each) for k, each in enumerate(value)]

    def _list(self, name: str, least: int, most: int, expected: str, right: Callable[[Any], bool]) -> list[Any]:
        """A list of so many entries, each of them right."""
        value = self.found.get(name)
        if not isinstance(value, list) or not least <= len(value) <= most or not all(map(right, value)):
            self.refuse(name, expected)
        return value


def _row(value: Any, width: int) -> bool:
    return (
        isinstance(value, list)
        and len(value) == width
        and all(
            isinstance(each, int | float) and not isinstance(each, bool) and -math.inf < each < math.inf
            for each in value
        )
    )
