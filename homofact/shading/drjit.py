"""Evaluate fits and sample from them in Dr.Jit, for Mitsuba, by interpreting its shading programs on Dr.Jit arrays.

Every number of the program is a constant of the traced kernel. The program is the one that is printed as shaders, so it
is as accurate in float32 as the shaders.

Import this module only if Mitsuba is installed; `mitsuba_bsdf.register` does so.
"""

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from homofact.brdf.source_names import MOST
from homofact.factor.evaluation import evaluation_of
from homofact.factor.fitted import Fitted, Texture
from homofact.factor.spectral_fit import SpectralFit
from homofact.geometry.interpret import interpret, value_of
from homofact.shading.encoding import as_floats
from homofact.shading.lobe_mixture import LobeMixture
from homofact.shading.lobe_statements import density_statements, sample_statements
from homofact.shading.program import Program, program_of, sum_program

# Their types depend on the variant that is set when they run, so that no checker can know them.
dr: Any = import_module("drjit")

_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sqrt": dr.sqrt,
    "abs": dr.abs,
    "exp": dr.exp,
    "log": dr.log,
    "asinh": dr.asinh,
    "cos": dr.cos,
    "sin": dr.sin,
    "atan2": dr.atan2,
    "floor": dr.floor,
    "fract": lambda x: x - dr.floor(x),
    "max": dr.maximum,
    "min": dr.minimum,
    "step": lambda edge, x: dr.select(x >= edge, 1.0, 0.0),
}


class DrJitFit:
    """The textures of a fit on the device of Mitsuba's variant, and their evaluation.

    `textures` are Mitsuba's `Texture2f` of (rows, columns, C) texels in the variant's precision.
    """

    def __init__(self, fitted: Fitted, mi: Any) -> None:
        """Copy the texels to textures of `mi`, the mitsuba module with a variant set."""
        self._mi = mi
        # The texels may change: logarithms are cut whatever they are now.
        self._program = program_of(fitted, [as_floats(texture.texels) for texture in fitted.textures], cut=True)
        self.textures = [_texture(texture, mi) for texture in fitted.textures]

    def evaluate(self, wi: Any, wo: Any, active: Any) -> list[Any]:
        """Return C values in sr⁻¹, without the cosine, for light `wi` and viewer `wo`; 0 where not `active`.

        Both directions are Mitsuba's vectors, unit, and above the surface wherever `active`.
        """
        values = _interpreted(self._program, self.textures, self._mi, (wi, wo), active)
        return [dr.select(active, value, 0) for value in values]


class DrJitBands:
    """The textures of a fit of any number of channels, for instance all bands of a spectrum, and their evaluation.

    `textures` as in `DrJitFit`; those of a fit with a spectral basis hold its coordinates.
    """

    def __init__(self, fitted: Fitted, mi: Any) -> None:
        """Copy the texels to textures of `mi`, the mitsuba module with a variant set."""
        self._mi = mi
        self._program = sum_program(fitted, [as_floats(texture.texels) for texture in fitted.textures])
        self._transform = evaluation_of(fitted).transform
        self._basis = fitted.basis if isinstance(fitted, SpectralFit) else None
        self.textures = [_texture(texture, mi) for texture in fitted.textures]

    def evaluate(self, wi: Any, wo: Any, active: Any) -> list[Any]:
        """As `DrJitFit.evaluate`."""
        total = _interpreted(self._program, self.textures, self._mi, (wi, wo), active)
        if self._basis is not None:
            rows = zip(self._basis.vectors.T.tolist(), self._basis.offset.tolist(), strict=True)
            total = [sum((s * b for s, b in zip(total, row, strict=True)), offset) for row, offset in rows]
        transform = self._transform
        if transform is not None:
            total = [
                mean * (dr.exp(dr.minimum(log, MOST)) - transform.epsilon)
                for log, mean in zip(total, transform.mean.tolist(), strict=True)
            ]
        return [dr.select(active, dr.maximum(value, 0), 0) for value in total]


def _interpreted(program: Program, textures: list[Any], mi: Any, directions: tuple[Any, Any], active: Any) -> list[Any]:
    """The components of a program's result for light and viewer, whatever they are where not `active`."""
    up = mi.Vector3f(0, 0, 1)
    wi, wo = (dr.select(active, each, up) for each in directions)
    values = {"wi": [wi.x, wi.y, wi.z], "wo": [wo.x, wo.y, wo.z]}

    def fetch(number: int, uv: list[Any]) -> list[Any]:
        return list(textures[number].eval(mi.Point2f(*uv), active))

    interpret(program.statements, values, _FUNCTIONS, fetch)
    return value_of(program.result, values, _FUNCTIONS)


class DrJitMixture:
    """The sampling density of a fit, as in the exported shaders, and sampling of directions."""

    def __init__(self, mixture: LobeMixture, mi: Any) -> None:
        """Keep the statements; `mi` is the mitsuba module with a variant set."""
        self._mi, grained = mi, mixture.grained
        self._sample, self._density = sample_statements(grained), density_statements(grained)
        self._constants = mixture.constants()

    def direction(self, wo: Any, u: list[Any]) -> Any:
        """Sample ωi for the viewers `wo` from three uniform random numbers in [0, 1)."""
        values = {"wo": [wo.x, wo.y, wo.z], "u": u, **self._constants}
        return self._mi.Vector3f(*interpret(self._sample, values, _FUNCTIONS)["wi"])

    def density(self, wi: Any, wo: Any) -> Any:
        """p(ωi | ωo) in sr⁻¹; 0 where either is under the horizon."""
        values = {"wi": [wi.x, wi.y, wi.z], "wo": [wo.x, wo.y, wo.z], **self._constants}
        return interpret(self._density, values, _FUNCTIONS)["density"][0]


def _texture(texture: Texture, mi: Any) -> Any:
    precision = np.float64 if "double" in mi.variant() else np.float32
    tensor = mi.TensorXf(np.ascontiguousarray(texture.texels, dtype=precision))
    # No hardware sampler: its weights have 8 bits.
    return mi.Texture2f(tensor, False, False, dr.FilterMode.Linear, dr.WrapMode.Clamp)
