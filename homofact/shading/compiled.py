"""Compile the shading program for the CPU, to evaluate many pairs of directions at once in float32.

The program that is printed as shaders becomes loops over blocks of pairs (`kernel_source`), which numba compiles into
vector instructions. The blocks are distributed over all threads.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit, prange

from homofact.errors import BadInput
from homofact.shading import float_functions
from homofact.shading.kernel_source import BLOCK, kernel_source, texel_width
from homofact.shading.program import Program, program_of
from homofact.shading.vector_code import VECTOR_CODE

if TYPE_CHECKING:
    from torch import Tensor

    from homofact.factor.fitted import Fitted


@dataclass(frozen=True)
class Compiled:
    """A `Reflectance` that compiled code evaluates, always in float32.

    `source` is the Python source of the kernel.
    """

    channels: tuple[str, ...]
    source: str
    _kernel: Any
    _texels: tuple[np.ndarray, ...]

    def evaluate(self, wi: "Tensor", wo: "Tensor") -> "Tensor":
        """Return BRDF values (N, C) in sr⁻¹, without the cosine, 0 below the horizon; the type is that of wi."""
        import torch

        values = self.evaluate_array(*(w.detach().cpu().to(torch.float32).numpy() for w in (wi, wo)))
        return torch.from_numpy(values).to(wi)

    def evaluate_array(self, wi: np.ndarray, wo: np.ndarray, out: np.ndarray | None = None) -> np.ndarray:
        """Return the same values for float32 arrays (N, 3); `out` (N, C) is an optional C-contiguous result.

        Raises BadInput for other shapes or types.
        """
        for name, w in (("wi", wi), ("wo", wo)):
            if w.dtype != np.float32 or w.ndim != 2 or w.shape[1] != 3 or len(w) != len(wi):
                raise BadInput(
                    where=name, found=f"{w.dtype} of shape {w.shape}", expected="float32 of shape (N, 3), N alike"
                )
        shape = (len(wi), len(self.channels))
        values = np.empty(shape, np.float32) if out is None else out
        if values.dtype != np.float32 or values.shape != shape:
            raise BadInput(
                where="out", found=f"{values.dtype} of shape {values.shape}", expected=f"float32 of shape {shape}"
            )
        if not values.flags.c_contiguous:
            raise BadInput(where="out", found="rows that are not one behind the other in memory", expected="them so")
        # `ravel` copies what is not in order.
        self._kernel(wi.ravel(), wo.ravel(), values.reshape(-1), *self._texels)
        return values


def compiled(fitted: "Fitted") -> Compiled:
    """Return a fit ready for fast evaluation; the first evaluation takes seconds, since it compiles the code.

    Raises BadInput for more than four channels.
    """
    from homofact.shading.encoding import as_floats

    plain = [as_floats(texture.texels) for texture in fitted.textures]
    return compiled_program(program_of(fitted, plain), [texture.stored for texture in plain])


def compiled_program(program: Program, textures: Sequence[np.ndarray]) -> Compiled:
    """Return a reflectance that evaluates a program with decoded float32 texels (rows, columns, C)."""
    source, constants = kernel_source(program)
    functions = {name: getattr(float_functions, name) for name in ("exp", "log", "asinh", "atan2")}
    calls = {
        call: VECTOR_CODE[call.partition("_")[0]](*map(int, call.split("_")[1:]))
        for call in re.findall(rf"\b(?:{'|'.join(VECTOR_CODE)})[_\d]+", source)
    }
    space: dict[str, Any] = {"np": np, "prange": prange, "BLOCK": BLOCK, **constants, **functions, **calls}
    exec(compile(source, "<shading program>", "exec"), space)
    space["evaluate_block"] = njit(fastmath=True, error_model="numpy")(space["evaluate_block"])
    kernel = njit(parallel=True)(space["kernel"])
    return Compiled(program.channels, source, kernel, tuple(map(_stored, textures)))


def _stored(texels: np.ndarray) -> np.ndarray:
    """Texels (rows, columns, C) one behind the other, each of as many numbers as a vector has."""
    more = texel_width(texels.shape[2]) - texels.shape[2]
    return np.pad(texels, ((0, 0), (0, 0), (0, more))).reshape(-1)
