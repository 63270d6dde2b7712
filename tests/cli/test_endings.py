"""How commands end that are interrupted, refused or at fault: exit code, one line, nothing half-written."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from ran import Ran

import homofact
import homofact.evaluation.compare
import homofact.evaluation.seeds
from homofact.errors import SolverFailure, Status

# A source and a fit of well under a second.
SMALL = ["material:blinn-phong-50", "--count", "600"]
SIZE = ["--size", "6"]


def test_an_interrupt_ends_with_130_and_leaves_nothing(
    run: Callable[..., Ran], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(homofact.evaluation.compare, "fit_and_measure", interrupted)
    ran = run("factorize", *SMALL, "--out", tmp_path / "o")
    assert ran == (130, "", "homofact: interrupted, nothing was written\n")
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_fit_that_kept_its_best_is_written_and_said(
    run: Callable[..., Ran], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    measure = homofact.evaluation.compare.fit_and_measure

    def cut_short(*arguments: Any) -> Any:
        row = measure(*arguments)
        return replace(row, report=replace(row.report, status=Status.INTERRUPTED, notes=("cut short",)))

    monkeypatch.setattr(homofact.evaluation.compare, "fit_and_measure", cut_short)
    ran = run("factorize", *SMALL, *SIZE, "--method", "mccool", "--out", tmp_path / "o", "--json")
    assert ran.code == 0
    assert ran.err.splitlines() == [f"homofact: {Status.INTERRUPTED.remedy}", "homofact: cut short"]
    assert json.loads(ran.out)["status"] == "interrupted"


@pytest.mark.parametrize("kept", [True, False])
def test_an_interrupt_ends_a_comparison_with_what_there_is(
    kept: bool, run: Callable[..., Ran], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whether the interrupted fit has something to show or not, it is the last."""
    fitted: list[str] = []
    measure = homofact.evaluation.seeds.fit_and_measure

    def second_cut_short(source: Any, settings: Any, *more: Any) -> Any:
        fitted.append(settings.name)
        if len(fitted) == 2 and not kept:
            raise KeyboardInterrupt
        row = measure(source, settings, *more)
        return row if len(fitted) < 2 else replace(row, report=replace(row.report, status=Status.INTERRUPTED))

    monkeypatch.setattr(homofact.evaluation.seeds, "fit_and_measure", second_cut_short)
    ran = run("compare", *SMALL, *SIZE, "--methods", "mccool,mccool:h+wi,svd", "--json")
    assert ran.code == 130
    labels = ["mccool", "mccool:h+wi"] if kept else ["mccool"]
    assert [row["label"] for row in json.loads(ran.out)["rows"]] == labels
    assert ran.err.splitlines()[-1] == f"homofact: interrupted, {len(labels)} of 3 methods are compared"
    assert fitted == ["mccool", "mccool"]


def test_an_interrupt_of_the_first_method_leaves_nothing(
    run: Callable[..., Ran], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(homofact.evaluation.seeds, "fit_and_measure", interrupted)
    ran = run("compare", *SMALL, *SIZE, "--methods", "mccool,svd")
    assert ran == (130, "", "homofact: interrupted, nothing was written\n")


def test_a_system_that_cannot_be_solved_is_refused_in_one_line(
    run: Callable[..., Ran], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise SolverFailure("no solution")

    monkeypatch.setattr(homofact.evaluation.compare, "fit_and_measure", fail)
    ran = run("factorize", *SMALL, "--out", tmp_path / "o")
    assert (ran.code, ran.out, ran.err) == (2, "", "homofact: no solution\n")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("error", [RuntimeError("no"), ValueError("no")])
def test_a_fault_of_ours_ends_with_1_its_traceback_and_a_request(
    run: Callable[..., Ran], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr(homofact.evaluation.compare, "fit_and_measure", fail)
    ran = run("factorize", *SMALL, "--out", tmp_path / "o")
    assert (ran.code, ran.out) == (1, "")
    assert "Traceback" in ran.err
    assert type(error).__name__ in ran.err
    assert "please report it" in ran.err.splitlines()[-1]
    assert list(tmp_path.iterdir()) == []
