"""Kills at system calls of a write: a few of them; `make nightly` takes every one."""

import importlib
import shutil
import subprocess
from pathlib import Path
from types import ModuleType

import pytest


@pytest.fixture
def killer(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    return importlib.import_module("scripts.checks.kill_writes")


def may_trace() -> bool:
    return (
        shutil.which("strace") is not None
        and subprocess.run(["strace", "-qq", "-o", "/dev/null", "true"]).returncode == 0
    )


@pytest.mark.skipif(not may_trace(), reason="no strace, or none allowed")
@pytest.mark.parametrize(("what", "every"), [("file", 9), ("folder", 40)])
def test_a_few_kills_leave_the_old_or_the_new_and_the_next_run_mends(killer: ModuleType, what: str, every: int) -> None:
    table = killer.kill_everywhere(what, every)
    assert table.wrong == ()
    assert table.kills > 2
    assert table.older > 0


def test_what_is_half_written_or_lost_is_seen(killer: ModuleType, tmp_path: Path) -> None:
    for damage, expected in (
        (lambda out: (out / "manifest.json").write_text("half"), "two results"),
        (lambda out: (out / "manifest.json").unlink(), "files"),
        (lambda out: (out / killer.STRANGER).unlink(), "is lost"),
        (lambda out: shutil.rmtree(out), "is lost"),
        (lambda out: (out.parent / "litter").touch(), "litter"),
    ):
        place = tmp_path / "here"
        shutil.rmtree(place, ignore_errors=True)
        killer.write("folder", place, killer.OLD)
        (place / "out" / killer.STRANGER).write_text("years of work")
        damage(place / "out")
        with pytest.raises(AssertionError, match=expected):
            killer.check("folder", place)
