"""TOML tables into dataclasses: everything that can be wrong is said with its place, what was found and expected."""

import math
import tomllib
from dataclasses import dataclass, field

import pytest

from homofact.errors import BadInput
from homofact.files.tables import Limits, keys_of, limits, nearest_key, plain_value, read_table


@dataclass(frozen=True)
class Lamp:
    direction: tuple[float, float, float]
    level: float | tuple[float, ...] = 1.0

    def __post_init__(self) -> None:
        if self.direction == (0, 0, 0):
            raise BadInput("direction: found zeros, expected some direction")
        if self.level == 0:
            raise BadInput("dark lamp, expected light")


@dataclass(frozen=True)
class Bounds:
    count: int | None = field(default=None, metadata=limits(least=1, most=9))
    share: float = field(default=0.5, metadata=limits(above=0, most=1))


@dataclass(frozen=True)
class Run:
    name: str
    lamp: tuple[Lamp, ...] = ()
    limits: Bounds = Bounds()
    names: tuple[str, ...] = ()
    fast: bool = False

    def __post_init__(self) -> None:
        if self.fast and self.lamp:
            raise BadInput("fast: found lamps, expected none of a fast run")


def read(text: str) -> Run:
    return read_table(Run, tomllib.loads(text), "run.toml: ")


def test_a_table_is_read() -> None:
    text = """
    name = "a"
    names = ["x", "y"]
    [[lamp]]
    direction = [0, 0.5, 1]
    [[lamp]]
    direction = [1, 0, 0]
    level = [1, 2.5]
    [limits]
    count = 3
    share = 1
    """
    found = read(text)
    assert found == Run("a", (Lamp((0, 0.5, 1)), Lamp((1, 0, 0), (1, 2.5))), Bounds(3, 1.0), ("x", "y"))
    assert isinstance(found.limits.share, float)
    assert read("name = 'a'") == Run("a")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "name: found nothing, expected a string"),
        ("name = 1", "name: found 1, expected a string"),
        ("name = 'a'\nfst = true", "unknown key fst, the nearest known one is fast"),
        ("name = 'a'\ncount = 1", "unknown key count, the nearest known one is limits.count"),
        ("name = 'a'\n[limits]\ncont = 1", "unknown key limits.cont, the nearest known one is limits.count"),
        ("name = 'a'\n[limit]\ncount = 1", "unknown section [limit], the nearest known one is [limits]"),
        ("name = 'a'\nfast = 1", "fast: found 1, expected true or false"),
        ("name = 'a'\nnames = 'x'", "names: found the string 'x', expected an array, each a string"),
        ("name = 'a'\nnames = ['x', 1]", "names[1]: found 1, expected a string"),
        ("name = 'a'\nlimits = 3", "limits: found 3, expected a section [limits]"),
        ("name = 'a'\nlamp = 3", "lamp: found 3, expected sections [[lamp]]"),
        ("name = 'a'\nlamp = [3]", "lamp[0]: found 3, expected a table of direction, level"),
        ("name = 'a'\n[lamp]\nlevel = 1", "lamp: found a section, expected sections [[lamp]]"),
        ("name = 'a'\n[[lamp]]\nlevel = 1", "lamp[0].direction: found nothing, expected an array of 3, each a number"),
        ("name = 'a'\n[[lamp]]\nlevl = 1", "unknown key lamp[0].levl, the nearest known one is lamp.level"),
        (
            "name = 'a'\n[[lamp]]\ndirection = [1, 2]",
            "lamp[0].direction: found an array of 2, expected an array of 3, each a number",
        ),
        (
            "name = 'a'\n[[lamp]]\ndirection = [1, 2, 3]\nlevel = true",
            "lamp[0].level: found true, expected a number or an array, each a number",
        ),
        (
            "name = 'a'\n[[lamp]]\ndirection = [0, 0, 0]",
            "lamp[0].direction: found zeros, expected some direction",
        ),
        ("name = 'a'\n[[lamp]]\ndirection = [0, 0, 1]\nlevel = 0", "lamp[0]: dark lamp, expected light"),
        (
            "name = 'a'\nfast = true\n[[lamp]]\ndirection = [0, 0, 1]",
            "fast: found lamps, expected none of a fast run",
        ),
        (
            "name = 'a'\n[limits]\ncount = 0",
            "limits.count: found 0, expected a whole number of at least 1 and at most 9",
        ),
        ("name = 'a'\n[limits]\ncount = 1.0", "limits.count: found 1.0, expected a whole number of at least 1"),
        ("name = 'a'\n[limits]\nshare = 0", "limits.share: found 0, expected a number above 0 and at most 1"),
        ("name = 'a'\n[limits]\nshare = nan", "limits.share: found nan, expected a number above 0"),
        ("name = 'a'\n[limits]\nshare = inf", "limits.share: found inf, expected a number above 0"),
        ("name = 'a'\n[limits]\nshare = 1.5", "limits.share: found 1.5, expected a number above 0"),
    ],
)
def test_what_is_wrong_is_named_in_one_line(text: str, message: str) -> None:
    with pytest.raises(BadInput) as caught:
        read(text)
    assert str(caught.value).startswith(f"run.toml: {message}")
    assert "\n" not in str(caught.value)


def test_a_plain_value_is_what_the_first_kind_that_fits_makes_of_it() -> None:
    kinds = (int, float, tuple[float, ...])
    for value, found in ((1, 1), (1.5, 1.5), ([1, 2], (1.0, 2.0)), ([], ())):
        assert plain_value(value, kinds, "x") == found
    with pytest.raises(BadInput, match=r"^x\[1\]: found true, expected a number$"):
        plain_value([1, True], kinds, "x")
    with pytest.raises(BadInput, match=r"^x: found the string 'a', expected a whole number or a number or"):
        plain_value("a", kinds, "x")


def test_numbers_within_limits_are_finite() -> None:
    for allowed in (Limits(above=0), Limits(least=0)):
        assert allowed.allow(1e300)
        assert not allowed.allow(math.inf)


def test_keys_and_the_nearest_of_them() -> None:
    assert keys_of(Run) == [
        "name", "lamp", "lamp.direction", "lamp.level", "limits", "limits.count", "limits.share", "names", "fast",
    ]  # fmt: skip
    # The same name elsewhere comes before a likeness at home; of equals the one at home.
    assert nearest_key("lamp[3].share", keys_of(Run)) == "limits.share"
    assert nearest_key("b.ab", ["b.abc", "a.ab"]) == "a.ab"
    assert nearest_key("b.abcd", ["b.abc", "a.abcde"]) == "a.abcde"
    assert nearest_key("b.x", ["a.x", "b.x", "c.x"]) == "b.x"


def test_a_whole_number_beyond_every_float_is_refused() -> None:
    for kind in (int, float):
        with pytest.raises(BadInput, match=r"a: found 9999.*, expected a .*number"):
            plain_value(int("9" * 400), (kind,), "a", Limits(least=0, most=5))
    with pytest.raises(BadInput, match=r"a: found 9999.*, expected a number"):
        plain_value(int("9" * 400), (float,), "a")
