"""How long stages of relighting are expected to take, for progress: before a stage begins, within about a factor of 2.

What a reflectance costs differs by a factor of ten between an analytic model and a measured table, so a few thousand
pairs of directions are timed. The number of pairs that a stage evaluates, and the time of its other work, were measured
with one thread of an AMD EPYC, on the materials of `configs/scenes` and on a measured paint.
"""

import time

import torch

from homofact.brdf.reflectance import Reflectance
from homofact.geometry.parabolic import from_disc

_PROBED = 4096
# (pairs of directions, seconds beside them)
_FACTORED, _PLANNED = (7e6, 1.0), (12e6, 3.0)
_PIXEL = 1e-4  # seconds of a pixel of a picture; with several suns and lamps of each
_SUMMED = 3e-7  # seconds of a pair in a dense sum, beside its evaluation
# What all stages of the error cost over the quick ones: the finer cube map alone has 16 times the directions.
_ALL_STAGES = 20


def evaluation_seconds(reflectance: Reflectance) -> float:
    """Return the seconds that one pair of directions takes, measured on `_PROBED` pairs after as many to warm up."""
    generator = torch.Generator().manual_seed(0)
    w = from_disc(torch.rand(2 * _PROBED, 2, generator=generator, dtype=torch.float64) * 1.4 - 0.7)
    taken = 0.0
    for _ in range(2):
        begun = time.perf_counter()
        reflectance.evaluate(w[:_PROBED], w[_PROBED:])
        taken = time.perf_counter() - begun
    return taken / _PROBED


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
    pairs = 2 * points * 6 * cube**2 * (_ALL_STAGES if every_stage else 1)
    return pairs * (_SUMMED + evaluation_seconds(reflectance))


def _expected(cost: tuple[float, float], reflectance: Reflectance) -> float:
    pairs, beside = cost
    return pairs * evaluation_seconds(reflectance) + beside
