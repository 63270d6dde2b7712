"""How commands end that are interrupted, refused or at fault: exit code, one line, nothing half-written."""

import contextlib
import errno
import json
import os
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from ran import Ran

import homofact
import homofact.evaluation.compare
import homofact.evaluation.repeats
from homofact.cli.main import main
from homofact.cli.screen import Screen
from homofact.errors import SolverFailure, Status
from homofact.sweeps.local import Local, TaskEnding
from homofact.sweeps.task import Task

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


@pytest.mark.slow
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
    measure = homofact.evaluation.repeats.fit_and_measure

    def second_cut_short(source: Any, settings: Any, *more: Any) -> Any:
        fitted.append(settings.name)
        if len(fitted) == 2 and not kept:
            raise KeyboardInterrupt
        row = measure(source, settings, *more)
        return row if len(fitted) < 2 else replace(row, report=replace(row.report, status=Status.INTERRUPTED))

    monkeypatch.setattr(homofact.evaluation.repeats, "fit_and_measure", second_cut_short)
    ran = run("compare", *SMALL, *SIZE, "--methods", "mccool,mccool:h+wi,svd", "--json")
    assert ran.code == 130
    labels = ["mccool", "mccool:h+wi"] if kept else ["mccool"]
    assert [row["label"] for row in json.loads(ran.out)["rows"]] == labels
    assert ran.err.splitlines()[-1] == f"homofact: interrupted, {len(labels)} of 3 methods are compared"
    assert fitted == ["mccool", "mccool"]


def test_an_interrupt_that_a_library_swallows_is_not_lost(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Raised in a callback, it ends nothing: the command is done, and says that it was asked to stop."""

    def swallowing(*_: object, **__: object) -> None:
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(Screen, "answer", swallowing)
    # A library that another test has loaded may have left a handler of its own.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        assert main(["info", "--json"]) == 130
        assert "homofact: interrupted, but the work is done\n" in capsys.readouterr().err
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before or signal.default_int_handler)


def test_an_interrupted_sweep_says_what_is_kept(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "sweep.toml").write_text(
        'sources = ["material:phong-10", "material:phong-30", "material:blinn-phong-50"]\n'
        '[source]\ncount = 400\n[[method]]\nmethod = "mccool"\nsize = 4\n'
    )

    def one_and_an_interrupt(self: Local, tasks: list[Task], ended: Callable[[TaskEnding], bool]) -> None:
        ended(TaskEnding(tasks[0], 0.1))
        raise KeyboardInterrupt

    monkeypatch.setattr(Local, "run", one_and_an_interrupt)
    out = tmp_path / "out"
    assert main(["sweep", str(tmp_path / "sweep.toml"), "--out", str(out)]) == 130
    words = f"homofact: interrupted, 1 of 3 results are kept in {out}: the same command goes on there\n"
    assert capsys.readouterr().err.endswith(words)


@pytest.mark.parametrize("command", ["factorize", "compare", "sweep", "info"])
def test_a_full_disk_names_what_was_asked_for(
    command: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("sweep.toml").write_text('sources = ["material:phong-10"]\n[[method]]\nmethod = "mccool"\n')

    def full(handle: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    source = "sweep.toml" if command == "sweep" else "material:phong-10"
    to = {"info": ["--plot", "asked.png"], "compare": ["--chart", "asked"]}.get(command, ["--out", "asked"])
    assert main([command, source, *to]) == 2
    words = f"homofact: {to[1]}: cannot be written (No space left on device), expected a writable place\n"
    assert capsys.readouterr().err == words


def test_an_interrupt_of_the_first_method_leaves_nothing(
    run: Callable[..., Ran], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(homofact.evaluation.repeats, "fit_and_measure", interrupted)
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
