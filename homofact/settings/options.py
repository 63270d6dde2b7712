"""One declaration per setting: a dataclass field with its help, unit, choices and range, from which all else follows.

The fields that `option` makes define the checks of a dataclass's values, the options of the command line with their
help and defaults, the keys of a TOML file (`settings.tables`), and the entries of a saved JSON file (`files.fields`).
Every fact about a setting is therefore declared once. The module imports neither torch nor numpy, so that help and
error messages appear without delay.
"""

import re
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from dataclasses import Field, dataclass, field, fields
from difflib import get_close_matches
from functools import cache
from typing import Any

from homofact.errors import BadInput

MOST_SEED = 2**62  # every generator takes it, and a few more


@dataclass(frozen=True)
class Option:
    """The declaration of a setting in a dataclass field.

    `help` is a sentence without its full stop. `choices` are the allowed words (for a list, of each item). `least`,
    `above`, `below` and `most` limit a number, and `unit` is its unit. `none` describes the meaning of None.
    `expected_instead(value)` is an additional check: it returns what is expected if the value is invalid, otherwise
    None. A text is split into a list at `separators`. On the command line, `flag` replaces the field's name if that
    name is unsuitable, `argument` makes a positional argument, `metavar` is the placeholder, and `panel` is the heading
    of the group. A long help shows only the `everyday` options of the source and the fit.
    """

    help: str
    unit: str = ""
    choices: tuple[str, ...] = ()
    least: float | None = None
    above: float | None = None
    below: float | None = None
    most: float | None = None
    none: str = ""
    expected_instead: Callable[[Any], str | None] | None = None
    separators: str = ","
    flag: str = ""
    argument: bool = False
    metavar: str | None = None
    panel: str | None = None
    everyday: bool = False


def nearest(found: str, names: Iterable[str]) -> str:
    """Return the name that a word misspells, as a hint: "nearest: mccool"; "" where it is near none."""
    near = get_close_matches(found, tuple(names), n=1, cutoff=0.6)
    return f"nearest: {near[0]}" if near else ""


def option(default: Any, help: str, **more: Any) -> Any:
    """Return the dataclass field of an `Option`; `more` are the option's other attributes."""
    return field(default=default, metadata={"option": Option(help, **more)})


def required(help: str, **more: Any) -> Any:
    """Return the dataclass field of an `Option` that has no default."""
    return field(metadata={"option": Option(help, **more)})


def none_twice(value: tuple[Any, ...]) -> str | None:
    """Check for `Option.expected_instead`: a list without repetitions."""
    return None if len(set(value)) == len(value) else "no repeats"


def a_name(value: str) -> str | None:
    """Check for `Option.expected_instead`: a name that is more than spaces."""
    return None if value.strip() else "a name"


_PLAIN = Option("")


@dataclass(frozen=True)
class Declared:
    """An option with its context: its field's name, its type without None, its default, and its `Option`."""

    name: str
    kinds: tuple[Any, ...]
    optional: bool
    default: Any
    option: Option

    @property
    def is_list(self) -> bool:
        """Whether it holds several values."""
        return typing.get_origin(self.kinds[0]) is tuple

    @property
    def item(self) -> Any:
        """The type of a list's values."""
        return typing.get_args(self._list)[0]

    @property
    def flag(self) -> str:
        """The option's name on the command line, without dashes."""
        return self.option.flag or self.name.replace("_", "-")

    def checked(self, value: Any) -> Any:
        """Return the value in the form of the field, with lists as tuples.

        Raises BadInput naming the option, found and expected.
        """
        if value is None and self.optional:
            return None
        if self.is_list and isinstance(value, str):
            value = self.from_text(value)
        if self.is_list and isinstance(value, list):
            value = tuple(value)
        wrong = self._expected_instead(value)
        if wrong is not None:
            found = ", ".join(map(str, value)) or "none" if isinstance(value, tuple) else repr(value)
            odd = [item for item in value if self._outside(item)] if isinstance(value, tuple) else []
            word = odd[0] if odd else value
            hint = nearest(word, self.option.choices) if isinstance(word, str) else ""
            raise BadInput(where=self.name, found=repr(odd[0]) if odd else found, expected=wrong, hint=hint)
        return value

    def read(self, value: Any, where: str | None = None) -> Any:
        """Return a value from TOML or JSON in the form of the field: arrays as tuples, integers as floats.

        Raises BadInput, at `where` or the field's name.
        """
        where = self.name if where is None else where
        if self.is_list and isinstance(value, str) and "+" in self.option.separators:
            value = self.from_text(value)
        plain = self._plain(value)
        if not self._of_kind(plain):
            odd = self._odd_item(value)
            if odd is not None:
                place, item = odd
                raise BadInput(where=f"{where}[{place}]", found=described(item), expected=self._words_of(self.item))
            raise BadInput(where=where, found=described(value), expected=self.expected)
        try:
            return self.checked(plain)
        except BadInput as error:
            found = error.found if isinstance(plain, str | tuple) else described(value)
            raise BadInput(where=where, found=found, expected=error.expected, hint=error.hint) from error

    @property
    def expected(self) -> str:
        """What a file's value should be, in words."""
        return " or ".join(self._words_of(kind) for kind in self.kinds)

    def _plain(self, value: Any) -> Any:
        """A value of a file with arrays as tuples, and its whole numbers as floats where the field has no others."""
        if isinstance(value, list) and self._list is not None:
            return tuple(_as_float(each) if self.item is float else each for each in value)
        return _as_float(value) if float in self.kinds and int not in self.kinds else value

    @property
    def _list(self) -> Any:
        """The kind that holds several values, None where there is none."""
        return next((kind for kind in self.kinds if typing.get_origin(kind) is tuple), None)

    def _odd_item(self, value: Any) -> tuple[int, Any] | None:
        """Place and value of a list's first item of another kind."""
        if not isinstance(value, list) or self._list is None or self._length not in (None, len(value)):
            return None
        return next(((k, item) for k, item in enumerate(value) if not _is(item, self.item)), None)

    def _words_of(self, kind: Any) -> str:
        if typing.get_origin(kind) is tuple:
            of = "" if self._length is None else f" of {self._length}"
            return f"an array{of}, each {self._words_of(self.item)}"
        ranged = self._range() if kind in (int, float) or self.option.choices else ""
        return ranged or _WORDS[kind]

    def from_text(self, text: str) -> Any:
        """Return the value of a text from the command line. Raises BadInput for a text without a value."""
        if not self.is_list:
            return _number(text) if float in self.kinds else text
        parts = tuple(part.strip() for part in re.split(f"[{re.escape(self.option.separators)}]", text) if part.strip())
        if self.item is str:
            return parts
        try:
            found = tuple(self.item(part) for part in parts)
        except ValueError as error:
            number = "whole numbers" if self.item is int else "numbers"
            raise BadInput(where=self.flag, found=repr(text), expected=f"{number} with commas") from error
        length = self._length
        if length is not None and len(found) != length:
            raise BadInput(where=self.flag, found=repr(text), expected=f"{length} numbers with commas")
        return found

    @property
    def _length(self) -> int | None:
        items = typing.get_args(self._list)
        return None if items[-1] is Ellipsis else len(items)

    def _expected_instead(self, value: Any) -> str | None:
        if not self._of_kind(value):
            return self._words()
        if isinstance(value, tuple):
            if any(self._outside(item) for item in value):
                return self._range() or "finite numbers"
        elif self._outside(value):
            return self._range() or "a finite number"
        own = self.option.expected_instead
        return None if own is None else own(value)

    def _of_kind(self, value: Any) -> bool:
        for kind in self.kinds:
            if typing.get_origin(kind) is tuple:
                if isinstance(value, tuple) and all(_is(each, self.item) for each in value):
                    return self._length in (None, len(value))
            elif _is(value, kind):
                return True
        return False

    def _outside(self, value: Any) -> bool:
        given = self.option
        if isinstance(value, str):
            return bool(given.choices) and value not in given.choices
        if isinstance(value, bool) or not isinstance(value, int | float):
            return False
        inside = (
            (given.least is None or value >= given.least)
            and (given.above is None or value > given.above)
            and (given.below is None or value < given.below)
            and (given.most is None or value <= given.most)
        )
        # NaN is inside of nothing; what has no end of its own ends before infinity.
        # A whole number may be beyond every float.
        return not (inside and float("-inf") < value < float("inf") and (type(value) is float or abs(value) < 2**1023))

    def _words(self) -> str:
        """What a value of another type should have been."""
        if self.is_list:
            return self.expected
        return self._range() or self.expected

    def _range(self) -> str:
        given = self.option
        number = (
            "a whole number" if int in self.kinds or (self.is_list and self.item is int) else given.unit or "a number"
        )
        words = []
        if given.choices:
            words.append(f"one of {', '.join(given.choices)}")
        if given.above is not None and given.below is not None:
            words.append(f"between {given.above:g} and {given.below:g}")
        elif given.least is not None and given.below is not None:
            words.append(f"at least {given.least:g} and below {given.below:g}")
        elif given.least is not None and given.most is not None:
            whole = f"a whole number from {given.least} to {given.most}"
            unit = f" {given.unit}" if given.unit else ""
            words.append(whole if int in self.kinds else f"{given.least:g} to {given.most:g}{unit}")
        elif given.least is not None:
            words.append(f"{number} of at least {given.least:g}")
        elif given.above is not None and given.most is not None:
            words.append(f"{number} above {given.above:g} and at most {given.most:g}")
        elif given.above is not None:
            words.append(f"{number} above {given.above:g}")
        return ", or ".join(words)


def again(settings: type, name: str, default: Any) -> Any:
    """Return the field of an option that another dataclass declares, with another default."""
    return field(default=default, metadata={"option": options_of(settings)[name].option})


@cache
def options_of(settings: type) -> dict[str, Declared]:
    """Return the options that a dataclass declares, by name, in their order."""
    hints = typing.get_type_hints(settings)
    return {each.name: declared(each, hints[each.name]) for each in fields(settings) if "option" in each.metadata}


def check_options(settings: Any) -> None:
    """Check every option of a frozen dataclass when it is made; lists become tuples. Raises BadInput."""
    for name, each in options_of(type(settings)).items():
        object.__setattr__(settings, name, each.checked(getattr(settings, name)))


def declared(each: "Field[Any]", hint: Any) -> Declared:
    """Return the declaration of a dataclass field; a field without an `Option` declares only its type."""
    kinds = typing.get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
    rest = tuple(kind for kind in kinds if kind is not types.NoneType)
    return Declared(each.name, rest, len(rest) < len(kinds), each.default, each.metadata.get("option", _PLAIN))


def _is(value: Any, kind: Any) -> bool:
    """Whether a value is of a type: whole numbers are numbers, true and false are not."""
    if isinstance(value, bool):
        return kind is bool
    return isinstance(value, (int, float) if kind is float else kind)


def described(value: Any) -> str:
    """Return what was found in a file, in words."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f"the string {value!r}"
    if isinstance(value, list | tuple):
        return f"an array of {len(value)}"
    return "a section" if isinstance(value, Mapping) else f"{value!r}"


def _as_float(value: Any) -> Any:
    # Compared, since a whole number may be beyond every float.
    return float(value) if type(value) is int and abs(value) < 2**1023 else value


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


_WORDS = {int: "a whole number", float: "a number", str: "a string", bool: "true or false"}
