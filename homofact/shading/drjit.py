"""A fit evaluated and drawn from in Dr.Jit, for Mitsuba: its programs, interpreted on Dr.Jit's arrays.

Every number of the program is a constant of the traced kernel. It is the program that the shaders print, so that it
holds in float32 where they do.

Import this module only where Mitsuba is (`mitsuba_bsdf.register` sees to that).
"""

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from homofact.factor.fitted import Fitted, Texture
from homofact.geometry.interpret import interpret, value_of
from homofact.shading.encoding import as_floats
from homofact.shading.lobe_mixture import LobeMixture
from homofact.shading.lobe_statements import density_statements, sample_statements
from homofact.shading.program import program_of

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
        """C values in sr⁻¹, without the cosine, for light `wi` and viewer `wo`; 0 where not `active`.

        Both directions are Mitsuba's vectors, unit, and above the surface wherever `active`.
        """
        up = self._mi.Vector3f(0, 0, 1)
        wi, wo = dr.select(active, wi, up), dr.select(active, wo, up)
        values = {"wi": [wi.x, wi.y, wi.z], "wo": [wo.x, wo.y, wo.z]}

        def fetch(number: int, uv: list[Any]) -> list[Any]:
            return list(self.textures[number].eval(self._mi.Point2f(*uv), active))

        interpret(self._program.statements, values, _FUNCTIONS, fetch)
        return [dr.select(active, value, 0) for value in value_of(self._program.result, values, _FUNCTIONS)]


class DrJitMixture:
    """The density that the shaders print, and directions drawn from it."""

    def __init__(self, mixture: LobeMixture, mi: Any) -> None:
        """Keep the statements; `mi` is the mitsuba module with a variant set."""
        self._mi, grained = mi, mixture.grained
        self._sample, self._density = sample_statements(grained), density_statements(grained)
        self._constants = mixture.constants()

    def direction(self, wo: Any, u: list[Any]) -> Any:
        """ωi for the viewers `wo`, from three numbers that are uniform in [0, 1)."""
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
