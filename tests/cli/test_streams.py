"""Streams that are closed, full or interrupted: exit codes and one line, never a traceback."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch

import homofact
from homofact.cli.main import main

UP = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64)
RUN = "import sys; from homofact.cli.entry import run; sys.exit(run())"
INFO = [sys.executable, "-c", RUN, "info", "material:phong-10", "--count", "50"]


@pytest.mark.slow
def test_a_closed_stdout_is_none_of_the_commands_concern(tmp_path: Path) -> None:
    script = tmp_path / "run.sh"
    script.write_text('exec "$@" >&- <&-\n')
    target = tmp_path / "a.csv"
    convert = [sys.executable, "-c", RUN, "convert", "material:phong-10", str(target), "--count", "50"]
    for command in (INFO, convert):
        ran = subprocess.run(["sh", str(script), *command], stderr=subprocess.PIPE, text=True)
        assert (ran.returncode, ran.stderr) == (0, "")
    assert target.read_text().startswith("# isotropic")


@pytest.mark.slow
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


@pytest.mark.slow
def test_names_that_are_no_utf_8(tmp_path: Path) -> None:
    place = tmp_path / os.fsdecode(b"na\xffme")
    try:
        place.mkdir()
    except OSError:
        pytest.skip("the file system takes UTF-8 only")
    table, fit, engine = place / "a.csv", place / "fit", place / "engine"
    source = ["material:phong-10", "--count", "300"]
    commands = (
        ["convert", *source, str(table)],
        ["info", str(table)],
        ["factorize", str(table), "--method", "mccool", "--size", "4", "--out", str(fit), "-q"],
        ["export", str(fit), "--out", str(engine), "-q"],
        ["export", str(fit), "--out", f"{engine}-2", "--format", "ktx2", "-q"],
        ["view", str(fit), "--out", str(place / "page.html"), "-q"],
        ["render", str(fit), "--out", str(place / "sphere.png"), "--size", "16", "-q"],
    )
    for command in commands:
        assert main(command) == 0, command
    assert homofact.load(str(fit)).evaluate(UP, UP).isfinite().all()
    missing = subprocess.run([*INFO[:3], "info", str(place / "b.csv")], capture_output=True)
    assert missing.returncode == 2
    assert missing.stderr.decode("ascii").count("\n") == 1
    assert b"na\\udcffme" in missing.stderr
