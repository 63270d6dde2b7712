"""Microsoft's shader compiler DXC for tests: HLSL to DXIL or SPIR-V.

Taken is the library that .ci/packages unpacks (`containers/dxc/install.py`), in a process that lives as long as the
tests, else a `dxc` on the PATH.
"""

import base64
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import pytest

HERE = Path(__file__).parent / "containers" / "dxc"
STRICT = ("-WX", "-Wall", "-Wextra", "-Wconversion", "-Wshadow")
MISSING = "DXC is missing: python tests/containers/dxc/install.py, or a dxc on the PATH"
# Told of every shader: DXC signs on Windows alone.
_UNSIGNED = "warning: DXIL.dll not found.  Resulting DXIL will not be signed for use in release environments."


def dxc(code: str, profile: str, *options: str) -> bytes:
    """DXIL of the entry point `main`, for instance for ps_6_0, or SPIR-V where "-spirv" is among the options.

    A warning is an error, and fails with the compiler's messages.
    """
    arguments = ("-T", profile, "-E", "main", *STRICT, *options)
    if (HERE / "libdxcompiler.so").is_file():
        done, compiled, told = _by_library(code, arguments)
    elif tool := shutil.which("dxc"):
        done, compiled, told = _by_program(tool, code, arguments)
    else:
        pytest.skip(MISSING)
    told = told.replace(_UNSIGNED, "").strip()
    assert done, f"{told}\n{code}"
    assert not told, told
    return compiled


def _by_program(tool: str, code: str, arguments: Sequence[str]) -> tuple[bool, bytes, str]:
    with tempfile.TemporaryDirectory() as folder:
        source, result = Path(folder) / "shader.hlsl", Path(folder) / "shader.out"
        source.write_text(code, encoding="utf-8")
        done = subprocess.run([tool, *arguments, "-Fo", str(result), str(source)], capture_output=True, text=True)
        compiled = result.read_bytes() if result.is_file() else b""
        return done.returncode == 0, compiled, done.stdout + done.stderr


def _by_library(code: str, arguments: Sequence[str]) -> tuple[bool, bytes, str]:
    process = _process()
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        process.stdin.write(json.dumps({"code": code, "arguments": arguments}) + "\n")
        process.stdin.flush()
        line = process.stdout.readline()
    except BrokenPipeError:
        line = ""
    if not line:
        _process.cache_clear()
        pytest.fail(f"DXC's process ended with {process.wait()} over\n{code}")
    answer = json.loads(line)
    return answer["done"], base64.b64decode(answer["compiled"]), answer["told"]


@cache
def _process() -> "subprocess.Popen[str]":
    """One that compiles, until its input ends."""
    command = [sys.executable, str(HERE / "compile.py")]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, encoding="utf-8")
