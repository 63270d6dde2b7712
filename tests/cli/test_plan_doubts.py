"""A choice can meet its tolerance and still look wrong: the plan says so next to the choice."""

from types import SimpleNamespace
from typing import Any

from homofact.cli.plan import doubt_line


def verdict(trusted: bool) -> Any:
    return SimpleNamespace(trusted=trusted)


def test_choices_that_verdicts_warn_of_are_named() -> None:
    assert doubt_line({}) == ""
    assert doubt_line({"paint": verdict(True), "gold": None}) == ""
    line = doubt_line({"paint": verdict(False), "gold": verdict(True), "flake": verdict(False), "lead": None})
    assert "paint, flake" in line
    assert "gold" not in line
    assert "lead" not in line
