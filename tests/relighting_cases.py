"""Small relighting problems that several test files share."""

from functools import cache

import numpy as np
import pytest

from homofact.brdf.analytic import Lambert, Phong
from homofact.brdf.reflectance import Reflectance
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.shapes import ground, sphere, torus_knot
from homofact.relighting.factored_material import AUTO, FactoredMaterial, factored
from homofact.relighting.factoring import factor
from homofact.relighting.factors import InOutFactors
from homofact.relighting.precompute import TransportSettings, WaveletTransport, transport
from homofact.rendering.light import EnvironmentMap

pytest.importorskip("embreex", reason="embreex is not installed: pip install 'homofact[relight]'")

SHINY = Phong((0.1, 0.2, 0.4), (0.4,) * 3, exponent=6)
MATT = Lambert((0.6, 0.3, 0.1))
EYE = (0.5, 0.8, 3.0)


def factored_once(
    reflectance: Reflectance,
    lobe: str = AUTO,
    terms: int | None = None,
    share: float | None = None,
    error: float | None = None,
    *,
    light: EnvironmentMap | None = None,
) -> FactoredMaterial:
    """`factored`, made once for each analytic material, light and rule: for tests that are about something else."""
    assert isinstance(reflectance, Phong | Lambert)
    sky = None if light is None else (light.radiance.numpy().tobytes(), light.turn)
    key = (repr(reflectance), lobe, terms, share, error, sky)
    if key not in _FACTORED:
        _FACTORED[key] = factored(reflectance, lobe, terms, share, error, light=light)
    return _FACTORED[key]


_FACTORED: dict[tuple[object, ...], FactoredMaterial] = {}


@cache
def knot() -> Mesh:
    return torus_knot(24, 8)


@cache
def ball() -> Mesh:
    return sphere(8)


@cache
def occluder() -> Occluder:
    return Occluder(knot().positions, knot().triangles)


@cache
def shiny(terms: int = 6) -> InOutFactors:
    return factor(SHINY, terms, map_size=32)


@cache
def matt() -> InOutFactors:
    return factor(MATT, map_size=16)


@cache
def whole(cube: int = 8) -> WaveletTransport:
    """The shiny knot with every coefficient kept."""
    return transport(knot(), shiny(), TransportSettings(cube, kept=6 * cube**2), occluder())


def light(size: int, seed: int = 0) -> np.ndarray:
    """Radiance (6, n, n, 3) of a made-up sky: a gradient, a lamp and noise."""
    rng = np.random.default_rng(seed)
    found = rng.uniform(0, 0.2, (6, size, size, 3)) + np.linspace(0, 1, size)[:, None]
    found[2, size // 3, size // 2] = (60, 40, 20)
    return found


__all__ = [
    "EYE", "MATT", "SHINY", "ball", "factored_once", "ground", "knot", "light", "matt", "occluder", "shiny", "whole",
]  # fmt: skip
