"""A choice can meet its tolerance and still look wrong: the plan says so next to the choice."""

from types import SimpleNamespace
from typing import Any

from homofact.cli.plan import doubt_lines, grade_lines
from homofact.cli.tables import identical_grade
from homofact.evaluation.opinion import opinion_table


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
    assert closest.startswith("What was found is only the closest. Read also the verdict on gold below")
    assert "ship" not in closest
    (only,) = doubt_lines({"gold": verdict(False)}, ["gold"])
    assert only == closest


def test_grades_name_what_could_not_be_graded() -> None:
    good = opinion_table().law.opinion(0.5)
    assert grade_lines([]) == []
    (only,) = grade_lines([("paint", good)])
    assert only.startswith("Grades that people are expected to give, from 1 to 5 (")
    assert only.endswith(f" Identical pictures get {identical_grade()}.")
    low, high = opinion_table().law.interval(opinion_table().law.opinion(0).score)
    assert identical_grade().endswith(f"({low:.1f} to {high:.1f})")
    assert "paint" in only
    grades, without = grade_lines([("gonio", None), ("paint", good), ("flake", None)])
    assert grades == only
    assert without.startswith("Not graded: gonio and flake, known only at their samples.")
    (alone,) = grade_lines([("gonio", None)])
    assert alone.startswith("Not graded: gonio, known only at its samples.")
