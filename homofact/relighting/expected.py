"""How long stages of relighting are expected to take, for progress: before a stage begins, within about a factor of 2.

What a reflectance costs differs by a factor of ten between an analytic model and a measured table, so a few thousand
pairs of directions are timed. The number of pairs that a stage evaluates, and the time of its other work, were measured
with one thread of an AMD EPYC, on the materials of `configs/scenes` and on a measured paint.
"""

import time
from collections.abc import Sequence
from statistics import fmean

import numpy as np
import torch

from homofact.brdf.reflectance import Reflectance
from homofact.geometry.parabolic import from_disc
from homofact.meshes.mesh import Mesh

_PROBED, _LEAST = 4096, 0.05  # pairs at a time, and seconds of them
# (pairs of directions, seconds beside them)
_FACTORED, _PLANNED = (10e6, 1.0), (12e6, 3.0)
_PIXEL = 1e-4  # seconds of a pixel of a picture; with several suns and lamps of each
_SUMMED = 3e-7  # seconds of a pair in a dense sum, beside its evaluation
# What all stages of the error cost over the quick ones: the finer cube map alone has 16 times the directions.
_ALL_STAGES = 20


def evaluation_seconds(reflectance: Reflectance) -> float:
    """Return the seconds that one pair of directions takes: the mean over at least `_LEAST` seconds after a warm-up."""
    generator = torch.Generator().manual_seed(0)
    w = from_disc(torch.rand(2 * _PROBED, 2, generator=generator, dtype=torch.float64) * 1.4 - 0.7)
    reflectance.evaluate(w[:_PROBED], w[_PROBED:])
    begun, pairs, passed = time.perf_counter(), 0, 0.0
    while passed < _LEAST:
        reflectance.evaluate(w[:_PROBED], w[_PROBED:])
        pairs, passed = pairs + _PROBED, time.perf_counter() - begun
    return passed / pairs


def factoring_seconds(reflectance: Reflectance) -> float:
    """Return the expected seconds of the in-out factors of a material, with its separate lobe if it has one."""
    return _expected(_FACTORED, reflectance)


def planning_seconds(reflectance: Reflectance) -> float:
    """Return the expected seconds of choosing how the transport of an object is stored."""
    return _expected(_PLANNED, reflectance)


def picture_seconds(pixels: tuple[int, ...], lights: int) -> float:
    """Return the expected seconds of a picture, (width, height), of a scene with so many suns and lamps.

    Examples
    --------
    >>> round(picture_seconds((560, 420), 2))
    47
    """
    return _PIXEL * pixels[0] * pixels[1] * max(lights, 1)


def error_seconds(reflectance: Reflectance, points: int, cube: int, every_stage: bool) -> float:
    """Return the expected seconds of the error of an object at `points` vertices and as many pixels.

    Each is a sum over the texels of a cube map of `cube` texels along a face.
    """
    return _sum_seconds(reflectance, 2 * points * (_ALL_STAGES if every_stage else 1), cube)


def whole_picture_seconds(reflectances: Sequence[Reflectance], points: float, cube: int) -> float:
    """Return the expected seconds of the exact sum at so many pixels of a picture of all objects."""
    return fmean(_sum_seconds(reflectance, points, cube) for reflectance in reflectances)


def reference_seconds(objects: Sequence[tuple[Reflectance, Mesh]], eye: Sequence[float], cube: int) -> float:
    """Return the expected seconds of the exact sum at every vertex that faces the eye."""
    return sum(
        _sum_seconds(reflectance, int((((np.asarray(eye) - mesh.positions) * mesh.normals).sum(1) > 0).sum()), cube)
        for reflectance, mesh in objects
    )


def _sum_seconds(reflectance: Reflectance, points: float, cube: int) -> float:
    """Return the expected seconds of the sum over the texels of a cube map at so many points."""
    return points * 6 * cube**2 * (_SUMMED + evaluation_seconds(reflectance))


def _expected(cost: tuple[float, float], reflectance: Reflectance) -> float:
    pairs, beside = cost
    return pairs * evaluation_seconds(reflectance) + beside
