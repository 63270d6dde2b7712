"""Any reflectance as a material of Mitsuba 3, evaluated outside its kernels.

A fit has a program that Mitsuba traces (`mitsuba_bsdf`). An analytic model, a network or a table is evaluated by
`Reflectance.evaluate` instead, with the directions in memory. Mitsuba draws directions from the same mixture of cosine
and lobe. Dr.Jit cannot record such a call, so virtual function calls must not be symbolic while it runs; use
`evaluated_calls` for this. The module is for reference renderings, not for speed.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np
import torch

from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.rendering.mitsuba_bsdf import SAMPLINGS, bsdf_class

_RGB = ("R", "G", "B")


def reflectance_bsdf(reflectance: Reflectance) -> Any:
    """The material (a `mitsuba.BSDF`, front side only) in the variant of the moment; R, G, B or one grey channel.

    A reflectance without a true `isotropic` attribute is treated as anisotropic. Raises MissingDependency without
    Mitsuba, BadInput for another number of channels; evaluation raises BadInput for values that are not finite.
    """
    count = len(reflectance.channels)
    if count not in (1, 3):
        raise BadInput(where="reflectance", found=f"{count} channels", expected="R, G, B or one alone")
    base = bsdf_class()
    return _class_of(base)(reflectance)


@contextmanager
def evaluated_calls() -> Iterator[None]:
    """Make Mitsuba call materials on arrays in memory within this context, as `reflectance_bsdf` needs.

    The loop over a path's segments is evaluated in memory as well.
    """
    dr = import_module("drjit")
    with dr.scoped_set_flag(dr.JitFlag.SymbolicCalls, False), dr.scoped_set_flag(dr.JitFlag.SymbolicLoops, False):
        yield


@cache
def _class_of(base: Any) -> Any:
    mi = import_module("mitsuba")
    from homofact.rendering.mitsuba_spectra import spectra_of

    class ReflectanceBSDF(base):
        """`mitsuba.BSDF` of a `Reflectance`; arguments and results are Mitsuba's."""

        def __init__(self, reflectance: Reflectance) -> None:
            mi.BSDF.__init__(self, mi.Properties("homofact_reflectance"))
            self.values = _Values(reflectance, mi)
            # Three channels are linear sRGB whatever their names.
            self.spectra = spectra_of(mi, reflectance.channels if len(reflectance.channels) == 1 else _RGB)
            self.name = type(reflectance).__name__
            self._draw_from(SAMPLINGS[0], reflectance, bool(getattr(reflectance, "isotropic", False)))

        def to_string(self) -> str:
            """Return what reflects."""
            return f"homofact[{self.name}]"

    return ReflectanceBSDF


class _Values:
    """`evaluate` of Mitsuba's arrays through memory; no textures to differentiate."""

    textures: tuple[Any, ...] = ()

    def __init__(self, reflectance: Reflectance, mi: Any) -> None:
        self._reflectance, self._mi = reflectance, mi

    def evaluate(self, wi: Any, wo: Any, active: Any) -> list[Any]:
        """C arrays in sr⁻¹, 0 where not `active`."""
        arrays = np.broadcast_arrays(np.array(wi), np.array(wo), np.array(active)[None])
        rows = np.nonzero(arrays[2][0])[0]
        pair = [torch.from_numpy(array[:, rows].T.astype(np.float64)) for array in arrays[:2]]
        # Float32's lengths are off by 1e-7, which a narrow lobe's half vector feels.
        values = self._reflectance.evaluate(*(directions / directions.norm(dim=1, keepdim=True) for directions in pair))
        if not bool(torch.isfinite(values).all()):
            raise BadInput(where="reflectance", found="values that are not finite", expected="finite ones")
        whole = np.zeros((values.shape[1], arrays[0].shape[1]), np.float32)
        whole[:, rows] = values.T.numpy()
        return [self._mi.Float(channel) for channel in whole]
