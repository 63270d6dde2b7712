"""A choice can meet its tolerance and still look wrong: the plan says so next to the choice."""

from types import SimpleNamespace
from typing import Any

from homofact.cli.plan import doubt_lines


def verdict(trusted: bool) -> Any:
    return SimpleNamespace(trusted=trusted)


def test_choices_that_verdicts_warn_of_are_named() -> None:
    assert doubt_lines({}) == []
    assert doubt_lines({"paint": verdict(True), "gold": None}) == []
    (line,) = doubt_lines({"paint": verdict(False), "gold": verdict(True), "flake": verdict(False), "lead": None})
    assert "paint; flake" in line
    assert "gold" not in line
    assert "lead" not in line


def test_a_choice_that_misses_the_tolerance_is_not_called_ready_to_ship() -> None:
    met, closest = doubt_lines(
        {"paint": verdict(False), "gold": verdict(False), "lead": verdict(True)}, ["gold", "lead"]
    )
    assert met.startswith("Before you ship, read the verdict on paint below")
    assert closest.startswith("The tolerance is missed. Read also the verdict on gold below")
    assert "ship" not in closest
    (only,) = doubt_lines({"gold": verdict(False)}, ["gold"])
    assert only == closest
