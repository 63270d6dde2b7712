"""All faults of measurements by name: faults of coverage, of directions, and of values.

Each fault names the part of the calibration that draws it. Similar kinds of faults belong to the same part.
"""

import math
from dataclasses import replace

import torch
from torch import Tensor

from homofact.brdf.samples import Samples
from homofact.geometry.coordinates import rusinkiewicz_angles
from homofact.geometry.directions import from_spherical, normalize, to_spherical
from homofact.stability.fault import CasePart, Fault, Plant, generator_of, joined, normal, of_values, struck, uniform

_LEAST_COSINE = 0.02  # of directions that a fault has turned: what is lower is gone


def degrees(direction: Tensor) -> Tensor:
    """Return θ in degrees."""
    return to_spherical(direction)[0] * (180 / math.pi)


def _few(samples: Samples, strength: float, seed: int) -> Samples:
    return samples.subset(int(strength), seed)


def _sparse_cells(samples: Samples, strength: float, seed: int) -> Samples:
    """Only every `strength`-th sample in the order of θi: as few as `few`, but evenly over the light."""
    order = samples.wi[:, 2].argsort(stable=True)
    return samples.select(order[:: int(strength)].sort().values)


def _few_lights(samples: Samples, strength: float, seed: int) -> Samples:
    """Light from `strength` bands of θi alone, each a third as wide as it is far to the next."""
    step = 90 / strength
    return samples.select((degrees(samples.wi) + step / 6) % step < step / 3)


def _hole(samples: Samples, strength: float, seed: int) -> Samples:
    return samples.select((degrees(samples.wo) - 45).abs() >= strength)


def _no_highlight(samples: Samples, strength: float, seed: int) -> Samples:
    return samples.select(degrees(normalize(samples.wi + samples.wo)) >= strength)


def _not_grazing(samples: Samples, strength: float, seed: int) -> Samples:
    limit = math.cos(math.radians(strength))
    return samples.select((samples.wi[:, 2] > limit) & (samples.wo[:, 2] > limit))


def _tilted(samples: Samples, strength: float, seed: int) -> Samples:
    """Directions in a frame whose normal is `strength` degrees off the surface's."""
    angle = torch.deg2rad(torch.tensor(strength, dtype=torch.float64))
    cos, sin = torch.cos(angle), torch.sin(angle)

    def turned(w: Tensor) -> Tensor:
        return normalize(torch.stack((cos * w[:, 0] + sin * w[:, 2], w[:, 1], cos * w[:, 2] - sin * w[:, 0]), 1))

    wi, wo = turned(samples.wi), turned(samples.wo)
    above = (wi[:, 2] > 0) & (wo[:, 2] > 0)
    return replace(samples.select(above), wi=wi[above], wo=wo[above])


def _shifted(samples: Samples, strength: float, seed: int) -> Samples:
    """The detector's arm is `strength` degrees off: the highlight is beside the mirror direction."""
    theta, phi = to_spherical(samples.wo)
    return _above(samples, samples.wi, from_spherical(theta + math.radians(strength), phi))


def _from_the_surface(w: Tensor) -> Tensor:
    theta, phi = to_spherical(w)
    return from_spherical(math.pi / 2 - theta, phi)


def _above(samples: Samples, wi: Tensor, wo: Tensor) -> Samples:
    above = (wi[:, 2] > _LEAST_COSINE) & (wo[:, 2] > _LEAST_COSINE)
    return replace(samples.select(above), wi=wi[above], wo=wo[above])


def _elevation(samples: Samples, strength: float, seed: int) -> Samples:
    """θ counted from the surface: of both directions (0), of ωi (1) or of ωo (2)."""
    wi = samples.wi if strength == 2 else _from_the_surface(samples.wi)
    wo = samples.wo if strength == 1 else _from_the_surface(samples.wo)
    return _above(samples, wi, wo)


def _azimuth(samples: Samples, strength: float, seed: int) -> Samples:
    theta, phi = to_spherical(samples.wo)
    return replace(samples, wo=from_spherical(theta, phi + math.radians(strength)))


def precision(samples: Samples, strength: float, seed: int) -> Samples:
    """Round directions and values to `strength` bits of mantissa (52: float64, 23: float32, 10: float16).

    The directions are normalised again, as a careful reader does.
    """

    def rounded(x: Tensor) -> Tensor:
        fraction, exponent = torch.frexp(x)
        steps = 2.0 ** (int(strength) + 1)
        return torch.ldexp(torch.round(fraction * steps) / steps, exponent)

    wi, wo = (normalize(rounded(directions)) for directions in (samples.wi, samples.wo))
    return replace(samples, wi=wi, wo=wo, values=rounded(samples.values))


def _contradiction(samples: Samples, strength: float, seed: int) -> Samples:
    """Repeat half of the samples, with values multiplied or divided by `strength` at random."""
    again = samples.subset(len(samples) // 2, seed)
    up = uniform(len(again), generator_of(seed)) < 0.5
    again = replace(again, values=again.values * torch.where(up, strength, 1 / strength)[:, None])
    return joined(samples, again)


def _late_rows(samples: Samples, strength: float, seed: int) -> Samples:
    """The first channel of the last `strength` of the rows is a row late."""
    values = samples.values.clone()
    first = round((1 - strength) * len(values))
    values[first:, 0] = values[first:, 0].roll(1)
    return replace(samples, values=values)


def _by_theta(direction: str, gain: "object") -> Plant:
    """A gain over θ of one direction, in radians."""
    return of_values(lambda s, v, x, seed: v * gain(to_spherical(getattr(s, direction))[0], x)[:, None])  # type: ignore[operator]


def _near_the_light(samples: Samples, within: float) -> Tensor:
    return (samples.wi * samples.wo).sum(1, keepdim=True) > math.cos(math.radians(within))


def _patch(samples: Samples) -> Tensor:
    """A patch off the highlight (N, 1)."""
    theta_h, theta_d, _ = (torch.rad2deg(each)[:, None] for each in rusinkiewicz_angles(samples.wi, samples.wo))
    return ((theta_h - 30).abs() < 5) & ((theta_d - 30).abs() < 10)


def _cut(samples: Samples, values: Tensor, quantile: float, seed: int) -> Tensor:
    return values.minimum(values.quantile(quantile, 0))


_A, _B, _R = CasePart
_WHERE = (
    Fault("few", _few, (3000, 1200, 400), _A, right=True),
    Fault("few-lights", _few_lights, (12, 8, 5), _B, right=True),
    Fault("sparse", _sparse_cells, (2, 4, 10), _R, right=True),
    Fault("hole", _hole, (5, 12, 25), _A),
    Fault("no-highlight", _no_highlight, (2, 8, 25), _B),
    Fault("not-grazing", _not_grazing, (80, 65, 50), _R),
)
_DIRECTIONS = (
    Fault("tilted", _tilted, (0.3, 1.5, 5), _A),
    Fault("elevation", _elevation, (0, 1, 2), _B),
    Fault("highlight-shifted", _shifted, (0.3, 1.5, 5), _R),
    Fault("azimuth", _azimuth, (180, 90), _R),
)
_VALUES = (
    Fault("noise", of_values(lambda s, v, x, seed: v * torch.exp(x * normal(v, seed))), (0.02, 0.06, 0.15), _A,
          right=True),
    Fault("shot-noise", of_values(
        lambda s, v, x, seed: v + x * (v * v.mean(0)).clamp_min(0).sqrt() * normal(v, seed)), (0.02, 0.06, 0.15), _B,
        right=True),
    Fault("precision", precision, (23, 12, 10), _R, right=True),
    Fault("additive-noise", of_values(
        lambda s, v, x, seed: v + x * v.mean(0) * normal(v, seed)), (0.005, 0.05, 0.4), _B),
    Fault("outliers", of_values(
        lambda s, v, x, seed: v * torch.where(struck(s, x, seed), 1000.0, 1.0)), (0.001, 0.01, 0.05), _A),
    Fault("spikes", of_values(lambda s, v, x, seed: torch.where(_patch(s), x * v, v)), (1.5, 3, 30), _R),
    Fault("zeros", of_values(lambda s, v, x, seed: v * ~struck(s, x, seed)), (0.005, 0.05, 0.3), _A),
    Fault("saturated", of_values(_cut), (0.995, 0.97, 0.85), _A),
    Fault("levels", of_values(lambda s, v, x, seed: (v / v.max() * x).round() / x * v.max()), (4096, 400, 64), _B),
    Fault("contradiction", _contradiction, (1.2, 2, 4), _B),
    Fault("cosine", of_values(lambda s, v, x, seed: v * s.wo[:, 2:] ** x), (1, 2, -1), _A),
    Fault("cosine-of-light", of_values(lambda s, v, x, seed: v * s.wi[:, 2:] ** x), (1, 2), _R),
    Fault("drift", of_values(
        lambda s, v, x, seed: v * torch.linspace(1, 1 - x, len(v), dtype=torch.float64)[:, None]), (0.1, 0.3, 0.8), _B),
    Fault("drift-with-angle", _by_theta("wi", lambda t, x: 1 - x * t / (math.pi / 2)), (0.15, 0.4, 0.7), _R),
    Fault("vignetting", _by_theta("wo", lambda t, x: 1 - x * torch.sin(t) ** 2), (0.15, 0.4, 0.7), _A),
    Fault("ring", _by_theta(
        "wi", lambda t, x: torch.where((t - math.radians(40)).abs() < math.radians(4), x, 1.0)), (0.9, 0.6, 1.5), _B),
    Fault("shadow", of_values(
        lambda s, v, x, seed: torch.where(_near_the_light(s, 10.0), (1 - x) * v, v)), (0.3, 0.6, 0.95), _A),
    Fault("stray-light", of_values(
        lambda s, v, x, seed: v + x * v.median(0).values / s.wo[:, 2:].clamp_min(0.02)), (0.02, 0.08, 0.3), _R),
    Fault("late-rows", _late_rows, (0.3, 1.0), _R),
    Fault("scaled", of_values(lambda s, v, x, seed: v * x), (0.5, 1.5, math.pi), _R, knowable=False),
    Fault("offset", of_values(lambda s, v, x, seed: v + x * v.mean(0)), (0.02, 0.1, -0.1), _R, knowable=False),
    Fault("gamma", of_values(lambda s, v, x, seed: (v / v.max()) ** (1 / x)), (1.2, 2.2), _R, knowable=False),
)  # fmt: skip
FAULTS: dict[str, Fault] = {fault.name: fault for fault in (*_WHERE, *_DIRECTIONS, *_VALUES)}
