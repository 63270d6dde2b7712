"""TOML tables into dataclasses: everything that can be wrong is named with its place, what was found and expected."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import pytest

from homofact.errors import BadInput
from homofact.settings.kinds import CONFIGURATION, EDITING, PLANNING, RELIGHTING, SWEEP, check_kind, kinds_of
from homofact.settings.options import option, required
from homofact.settings.tables import keys_of, read_table


@dataclass(frozen=True)
class Lamp:
    direction: tuple[float, float, float]
    level: float | tuple[float, ...] = 1.0

    def __post_init__(self) -> None:
        if self.direction == (0, 0, 0):
            raise BadInput(where="direction", found="zeros", expected="some direction")
        if self.level == 0:
            raise BadInput("dark lamp", expected="light")


@dataclass(frozen=True)
class Bounds:
    count: int | None = option(None, "How many", least=1, most=9)
    share: float = option(0.5, "Of all", above=0, most=1)


@dataclass(frozen=True)
class Free:
    kind: str = required("Which", choices=("round", "square"))
    others: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if "seed" in self.others:
            raise BadInput(where="seed", found=self.others["seed"], expected="none")


@dataclass(frozen=True)
class Run:
    name: str
    lamp: tuple[Lamp, ...] = ()
    limits: Bounds = Bounds()
    names: tuple[str, ...] = ()
    fast: bool = False
    free: Free | None = None

    def __post_init__(self) -> None:
        if self.fast and self.lamp:
            raise BadInput(where="fast", found="lamps", expected="none of a fast run")


def read(text: str) -> Run:
    return read_table(Run, tomllib.loads(text), "run.toml: ")


def refusal(text: str) -> BadInput:
    with pytest.raises(BadInput) as caught:
        read(text)
    assert "\n" not in str(caught.value)
    assert caught.value.where.startswith("run.toml: ")
    return caught.value


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
    [free]
    kind = "round"
    radius = 2
    """
    run = read(text)
    assert run == Run(
        "a", (Lamp((0, 0.5, 1)), Lamp((1, 0, 0), (1, 2.5))), Bounds(3, 1.0), ("x", "y"),
        free=Free("round", {"radius": 2}),
    )  # fmt: skip
    assert isinstance(run.limits.share, float)
    assert isinstance(run.lamp[0].direction[0], float)
    assert read("name = 'a'") == Run("a")


LAMP = "[[lamp]]\ndirection = [0, 0, 1]\n"


@pytest.mark.parametrize(
    ("text", "where", "found", "expected"),
    [
        ("", "name", "nothing", "a string"),
        ("name = 1", "name", "1", "a string"),
        ("name = 'a'\nfast = 1", "fast", "1", "true or false"),
        ("name = 'a'\nnames = 'x'", "names", "the string 'x'", "an array, each a string"),
        ("name = 'a'\nnames = ['x', 1]", "names[1]", "1", "a string"),
        ("name = 'a'\nlimits = 3", "limits", "3", "a section [limits]"),
        ("name = 'a'\nlamp = 3", "lamp", "3", "sections [[lamp]]"),
        ("name = 'a'\nlamp = [3]", "lamp[0]", "3", "a table of direction, level"),
        ("name = 'a'\n[lamp]\nlevel = 1", "lamp", "a section", "sections [[lamp]]"),
        ("name = 'a'\n[[lamp]]\nlevel = 1", "lamp[0].direction", "nothing", "an array of 3, each a number"),
        (
            "name = 'a'\n[[lamp]]\ndirection = [1, 2]",
            "lamp[0].direction", "an array of 2", "an array of 3, each a number",
        ),
        (f"name = 'a'\n{LAMP}level = true", "lamp[0].level", "true", "a number or an array, each a number"),
        ("name = 'a'\n[[lamp]]\ndirection = [0, 0, 0]", "lamp[0].direction", "zeros", "some direction"),
        (f"name = 'a'\n{LAMP}level = 0", "lamp[0]", "dark lamp", "light"),
        (f"name = 'a'\nfast = true\n{LAMP}", "fast", "lamps", "none of a fast run"),
        ("name = 'a'\n[limits]\ncount = 0", "limits.count", "0", "a whole number from 1 to 9"),
        ("name = 'a'\n[limits]\ncount = 1.0", "limits.count", "1.0", "a whole number from 1 to 9"),
        ("name = 'a'\n[limits]\nshare = 0", "limits.share", "0", "a number above 0 and at most 1"),
        ("name = 'a'\n[limits]\nshare = nan", "limits.share", "nan", "a number above 0 and at most 1"),
        ("name = 'a'\n[limits]\nshare = inf", "limits.share", "inf", "a number above 0 and at most 1"),
        ("name = 'a'\n[limits]\nshare = 1.5", "limits.share", "1.5", "a number above 0 and at most 1"),
        ("name = 'a'\n[free]\nkind = 3", "free.kind", "3", "one of round, square"),
        ("name = 'a'\n[free]\nkind = 'rund'", "free.kind", "'rund'", "one of round, square"),
        ("name = 'a'\n[free]\nkind = 'round'\nseed = 3", "free.seed", "3", "none"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_with_its_place(text: str, where: str, found: str, expected: str) -> None:
    error = refusal(text)
    assert (error.where, error.found, error.expected) == (f"run.toml: {where}", found, expected)


@pytest.mark.parametrize(
    ("text", "where", "nearest"),
    [
        ("name = 'a'\nfst = true", "fst", "fast"),
        ("name = 'a'\n[limits]\ncont = 1", "limits.cont", "limits.count"),
        ("name = 'a'\n[limit]\ncount = 1", "limit", "limits"),
        ("name = 'a'\n[[lamp]]\nlevl = 1", "lamp[0].levl", "lamp.level"),
        # The same section's near one comes before the same name elsewhere, which comes before none.
        ("name = 'a'\ncount = 1", "count", "limits.count"),
        ("name = 'a'\n[[lamp]]\nshare = 1", "lamp[0].share", "limits.share"),
        ("name = 'a'\n[limits]\nlevel = 1", "limits.level", "lamp.level"),
    ],
)
def test_an_unknown_key_is_named_with_the_one_that_it_misspells(text: str, where: str, nearest: str) -> None:
    error = refusal(text)
    assert (error.where, error.hint, error.expected) == (f"run.toml: {where}", f"nearest: {nearest}", "")


def test_of_a_key_that_is_near_none_the_section_lists_its_own() -> None:
    error = refusal("name = 'a'\n[limits]\nde = 1")
    assert (error.where, error.hint, error.expected) == ("run.toml: limits.de", "", "one of count, share")


def test_a_choice_is_named_with_the_one_that_it_misspells() -> None:
    assert refusal("name = 'a'\n[free]\nkind = 'rund'").hint == "nearest: round"


def test_keys_are_those_of_all_sections() -> None:
    assert keys_of(Run) == [
        "name", "lamp", "lamp.direction", "lamp.level", "limits", "limits.count", "limits.share", "names", "fast",
        "free", "free.kind",
    ]  # fmt: skip


def test_a_whole_number_beyond_every_float_is_refused() -> None:
    for key in ("count", "share"):
        error = refusal(f"name = 'a'\n[limits]\n{key} = {'9' * 400}")
        assert error.where == f"run.toml: limits.{key}"


OBJECT = "[[object]]\nmesh = 'a'\n"


@pytest.mark.parametrize(
    ("text", "kinds"),
    [
        ("", set()),
        ("seed = 1", set()),
        ("[source]\ncount = 3", set()),
        ("[fit]\nsize = 3", {CONFIGURATION}),
        ("sources = []", {SWEEP}),
        ("[[method]]\nmethod = 'cole'", {SWEEP}),
        ("[[material]]\nshare = 1", {PLANNING}),
        (OBJECT, {RELIGHTING, EDITING}),
        (f"{OBJECT}terms = 3", {RELIGHTING}),
        (f"{OBJECT}[transport]\n", {RELIGHTING}),
        (f"{OBJECT}[tolerance]\n", {RELIGHTING}),
        (f"{OBJECT}bands = [32]", {EDITING}),
        (f"{OBJECT}[edit]\n", {EDITING}),
        (f"{OBJECT}[ground]\ncurves = 'HF'", {EDITING}),
    ],
)
def test_the_kind_of_a_file_is_recognised(text: str, kinds: set[str]) -> None:
    table = tomllib.loads(text)
    assert kinds_of(table) == kinds
    for kind in (CONFIGURATION, SWEEP, PLANNING, RELIGHTING, EDITING):
        if not kinds or kind in kinds:
            check_kind(table, kind, "a.toml")
            continue
        with pytest.raises(BadInput) as caught:
            check_kind(table, kind, "a.toml")
        assert (caught.value.where, caught.value.expected) == ("a.toml", kind)
        assert all(each in caught.value.found for each in kinds)
        assert "`homofact." in caught.value.hint
