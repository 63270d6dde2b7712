"""The printed sampling functions made callable: a C library, and entry points for the software GPU."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor
from webgpu import GLSL_BUFFERS, glsl_main, hlsl_main, wgsl_main

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
WGSL_MAIN = wgsl_main(
    "let wi = fit_sample(lights[id.x].xyz, viewers[id.x].xyz);",
    "values[id.x] = vec4<f32>(wi, fit_density(wi, lights[id.x].xyz));",
)
HLSL_MAIN = hlsl_main(
    "float3 wi = fit_sample(lights[id.x].xyz, viewers[id.x].xyz);",
    "values[id.x] = float4(wi, fit_density(wi, lights[id.x].xyz));",
)
GLSL_HEAD = f"#version 450\n{GLSL_BUFFERS}"
GLSL_MAIN = glsl_main(
    "vec3 wi = fit_sample(lights[k].xyz, viewers[k].xyz);",
    "values[k] = vec4(wi, fit_density(wi, lights[k].xyz));",
)


def points(count: int, seed: int = 0) -> Tensor:
    """Of the unit cube, as float32 holds them."""
    return torch.rand(count, 3, generator=torch.Generator().manual_seed(seed)).double()


def compiled_c(source: str, folder: Path, layer: str = "") -> ctypes.CDLL:
    """The functions of the C text, each of many triples of numbers; "2, " is the argument of layer 2."""
    if COMPILER is None:
        pytest.skip("no C compiler (cc, gcc or clang) on the PATH")
    many = """
void many_sample(int n, const float *wo, const float *u, float *out)
{
    for (int k = 0; k < n; k++)
        homofact_sample(wo + 3 * k, u + 3 * k, LAYER out + 3 * k);
}
void many_density(int n, const float *wi, const float *wo, float *out)
{
    for (int k = 0; k < n; k++)
        out[k] = homofact_density(wi + 3 * k, wo + 3 * k LAST);
}
"""
    last = f", {layer.rstrip(', ')}" if layer else ""
    source += many.replace("LAYER ", layer).replace(" LAST", last)
    (folder / "mixture.c").write_text(source, encoding="utf-8")
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1", "-shared", "-fPIC"]
    subprocess.run([COMPILER, *strict, "-o", folder / "m.so", folder / "mixture.c", "-lm"], check=True)
    return ctypes.CDLL(str(folder / "m.so"))


def called(function, a: Tensor, b: Tensor, width: int) -> Tensor:
    """(N, width) of a compiled function of pairs."""
    one, two = (each.float().contiguous().numpy().copy() for each in (a, b))
    out = np.empty((len(one), width), np.float32)
    pointer = ctypes.POINTER(ctypes.c_float)
    function(len(one), *(array.ctypes.data_as(pointer) for array in (one, two, out)))
    return torch.from_numpy(out).double()
