"""What a command loads and how often the interpreter looks through all of it, in a process of its own."""

import json
import subprocess
import sys

import pytest

PROGRAM = """
import gc, json, os, sys

def told(code):
    loaded = [name for name in ("scipy.interpolate", "scipy.optimize", "matplotlib", "colour") if name in sys.modules]
    print(json.dumps({"code": code, "loaded": loaded, "looks": gc.get_stats()[2]["collections"]}))
    sys.stdout.flush()
    honest(code)

honest, os._exit = os._exit, told
from homofact.cli.entry import run
run()
"""


@pytest.fixture(scope="module")
def info() -> dict:
    """Exit code, slow modules and full searches for cycles of `homofact info`, with torch and numba loaded."""
    command = [sys.executable, "-c", PROGRAM, "info", "material:phong-10", "--count", "50"]
    ran = subprocess.run(command, capture_output=True, text=True)
    return json.loads(ran.stdout.splitlines()[-1])


def test_a_command_ends_before_everything_is_searched_for_cycles(info: dict) -> None:
    assert (info["code"], info["looks"]) == (0, 0)


def test_what_info_does_not_need_is_not_loaded(info: dict) -> None:
    assert info["loaded"] == []
