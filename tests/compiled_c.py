"""Shading programs printed as C, compiled and run."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import torch

from homofact.factor.fitted import Fitted
from homofact.shading.c_code import c_source
from homofact.shading.encoding import Encoded
from homofact.shading.program import program_of

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")


def run_c(source: str, channels: int, folder: Path, wi: torch.Tensor, wo: torch.Tensor) -> np.ndarray:
    """What the compiled function gives at the pairs, (N, C)."""
    if COMPILER is None:
        pytest.skip("no C compiler (cc, gcc or clang) on the PATH")
    source += (
        "\nvoid every(int n, const float *wi, const float *wo, float *f)\n{\n    for (int k = 0; k < n; k++)\n"
        f"        homofact_evaluate(wi + 3 * k, wo + 3 * k, f + {channels} * k);\n}}\n"
    )
    code, library = folder / "brdf.c", folder / "brdf.so"
    code.write_text(source, encoding="utf-8")
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1", "-shared", "-fPIC"]
    subprocess.run([COMPILER, *strict, "-o", library, code, "-lm"], check=True)
    a, b = wi.float().numpy().copy(), wo.float().numpy().copy()
    values = np.empty((len(a), channels), np.float32)
    pointer = ctypes.POINTER(ctypes.c_float)
    function = ctypes.CDLL(str(library)).every
    function(len(a), *(array.ctypes.data_as(pointer) for array in (a, b, values)))
    return values


def c_of(fitted: Fitted, textures: list[Encoded]) -> str:
    """C that reads the textures as decoded floats."""
    plain = [Encoded("float32", t.decoded().numpy(), np.ones_like(t.scale), np.zeros_like(t.bias)) for t in textures]
    return c_source(program_of(fitted, plain), [texture.stored for texture in plain])
