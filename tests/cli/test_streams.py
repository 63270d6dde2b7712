"""Streams that are closed, full or interrupted: exit codes and one line, never a traceback."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

RUN = "import sys; from homofact.cli.entry import run; sys.exit(run())"
INFO = [sys.executable, "-c", RUN, "info", "material:phong-10", "--count", "50"]


def test_a_closed_stdout_is_none_of_the_commands_concern(tmp_path: Path) -> None:
    script = tmp_path / "run.sh"
    script.write_text('exec "$@" >&- <&-\n')
    target = tmp_path / "a.csv"
    convert = [sys.executable, "-c", RUN, "convert", "material:phong-10", str(target), "--count", "50"]
    for command in (INFO, convert):
        ran = subprocess.run(["sh", str(script), *command], stderr=subprocess.PIPE, text=True)
        assert (ran.returncode, ran.stderr) == (0, "")
    assert target.read_text().startswith("# isotropic")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full")
def test_a_full_stdout_is_said_in_one_line() -> None:
    with open("/dev/full", "w") as full:
        ran = subprocess.run(INFO, stdout=full, stderr=subprocess.PIPE, text=True)
    assert ran.returncode == 2
    assert ran.stderr == "homofact: what is printed: No space left on device\n"


def test_an_interrupt_while_the_commands_are_loaded_is_no_fault() -> None:
    program = """
import builtins, sys
honest = builtins.__import__
def interrupted(name, *more):
    if name == "typer":
        raise KeyboardInterrupt
    return honest(name, *more)
builtins.__import__ = interrupted
from homofact.cli.entry import run
sys.exit(run())
"""
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (ran.returncode, ran.stdout) == (130, "")
    assert ran.stderr == "homofact: interrupted, nothing was written\n"
