"""Add faults to clean samples, to test the checks of units and conventions.

Each takes samples, a strength and a seed. Of conventions the strength is a choice among few; of the instrument's faults
it is a share of the value.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import torch

from homofact.brdf.quality.suspicion.undo import undone
from homofact.brdf.samples import Samples
from homofact.brdf.symmetry import ring_numbers
from homofact.geometry.directions import from_spherical, to_spherical

Plant = Callable[[Samples, float, int], Samples]


@dataclass(frozen=True)
class Planted:
    """A fault: `name`, the checks that name it rightly, and strengths at which it should be, the mildest first."""

    name: str
    found_as: tuple[str, ...]
    plant: Plant
    strengths: tuple[float, ...] = (1.0,)


def _undo(name: str) -> Plant:
    """What `undo` of the opposite name does is the fault itself."""
    return lambda samples, strength, seed: undone(samples, [name])


def _values(change: Callable[[torch.Tensor], torch.Tensor]) -> Plant:
    return lambda samples, strength, seed: replace(samples, values=change(samples.values))


def _cosines(power_i: int, power_o: int) -> Plant:
    def plant(samples: Samples, strength: float, seed: int) -> Samples:
        return replace(samples, values=samples.values * samples.wi[:, 2:] ** power_i * samples.wo[:, 2:] ** power_o)

    return plant


def _radians(samples: Samples, strength: float, seed: int) -> Samples:
    (theta_i, phi_i), (theta_o, phi_o) = to_spherical(samples.wi), to_spherical(samples.wo)
    small = math.pi / 180
    return replace(
        samples, wi=from_spherical(theta_i * small, phi_i * small), wo=from_spherical(theta_o * small, phi_o * small)
    )


def _quantised(samples: Samples, strength: float, seed: int) -> Samples:
    step = samples.values.max() / strength
    return replace(samples, values=(samples.values / step).round() * step)


def _clipped(samples: Samples, strength: float, seed: int) -> Samples:
    """All above the quantile 1 − strength of the brightness is cut to it."""
    return replace(samples, values=samples.values.clamp_max(float(samples.values.reshape(-1).quantile(1 - strength))))


def _over_subtracted(samples: Samples, strength: float, seed: int) -> Samples:
    """The quantile `strength` of all values is taken off, what falls below zero cut."""
    dark = samples.values.reshape(-1).quantile(strength)
    return replace(samples, values=(samples.values - dark).clamp_min(0))


def _drift_in_time(samples: Samples, strength: float, seed: int) -> Samples:
    """The lamp loses `strength` of its light from the first row to the last, on a slow wave."""
    t = torch.linspace(0, 1, len(samples), dtype=torch.float64)
    wave = torch.cos(2 * math.pi * (0.7 * t + 0.37 * (seed % 7)))
    return replace(samples, values=samples.values * (1 - strength * t + 0.2 * strength * wave)[:, None].clamp_min(0.02))


def _drift_with_angle(samples: Samples, strength: float, seed: int) -> Samples:
    """The lamp gives `strength` less at θi = 90° than at the normal."""
    theta = to_spherical(samples.wi)[0] / (math.pi / 2)
    return replace(samples, values=samples.values * (1 - strength * theta)[:, None].clamp_min(0.02))


def _bad_ring(samples: Samples, strength: float, seed: int) -> Samples:
    """One ring of θi is `strength` too dark; of samples that lie on no rings, those in a tenth of all angles."""
    theta = to_spherical(samples.wi)[0]
    if ring_numbers(samples.wi) is None:
        low, high = (theta.quantile(q) for q in (0.3 + 0.05 * (seed % 7), 0.4 + 0.05 * (seed % 7)))
    else:
        low = high = theta.quantile(0.35 + 0.05 * (seed % 7))
    inside = (theta >= low - 1e-6) & (theta <= high + 1e-6)
    return replace(samples, values=samples.values * torch.where(inside, 1 - strength, 1.0)[:, None])


def _shadow(samples: Samples, strength: float, seed: int) -> Samples:
    """Within 8° of the light the arm takes `strength` of what is seen."""
    near = (samples.wi * samples.wo).sum(1) > math.cos(math.radians(8.0))
    return replace(samples, values=samples.values * torch.where(near, 1 - strength, 1.0)[:, None])


def _channels_of_some(samples: Samples, strength: float, seed: int) -> Samples:
    """A share of the rows has its first and last channel exchanged."""
    struck = torch.rand(len(samples), generator=torch.Generator().manual_seed(seed)) < strength
    return replace(samples, values=torch.where(struck[:, None], samples.values.flip(1), samples.values))


def _channel_shifted(samples: Samples, strength: float, seed: int) -> Samples:
    """The first channel is a row late."""
    values = samples.values.clone()
    values[:, 0] = values[:, 0].roll(1)
    return replace(samples, values=values)


FAULTS = (
    Planted("cosine of ωo in", ("cosine-o",), _cosines(0, 1)),
    Planted("cosine of ωi in", ("cosine-i",), _cosines(1, 0)),
    Planted("both cosines in", ("cosines",), _cosines(1, 1)),
    Planted("cosine of ωo squared", ("cosine-o-squared",), _cosines(0, 2)),
    Planted("divided by the cosine of ωo", ("per-cosine-o",), _cosines(0, -1)),
    Planted("divided by the cosine of ωi", ("per-cosine-i",), _cosines(-1, 0)),
    Planted("divided by both cosines", ("per-cosines",), _cosines(-1, -1)),
    Planted("times π", ("pi",), _values(lambda v: v * math.pi)),
    Planted("elevation for zenith", ("elevation",), _undo("elevation")),
    Planted("elevation of ωi", ("elevation-i",), _undo("elevation-i")),
    Planted("elevation of ωo", ("elevation-o",), _undo("elevation-o")),
    Planted("azimuth off by 180°", ("azimuth",), _undo("azimuth")),
    Planted("radians read as degrees", ("radians",), _radians),
    Planted("quantised", ("quantised",), _quantised, (15, 63, 1023)),
    Planted("clipped", ("clipped",), _clipped, (0.005, 0.03, 0.2)),
    Planted("dark frame over-subtracted", ("zeros",), _over_subtracted, (0.03, 0.1, 0.2)),
    Planted("drift in time", ("drift-in-time",), _drift_in_time, (0.15, 0.3, 0.6)),
    Planted("drift with angle", ("drift-with-angle", "gains"), _drift_with_angle, (0.4, 0.5, 0.8)),
    Planted("a bad ring", ("ring", "gains"), _bad_ring, (0.15, 0.3, 0.8)),
    Planted("shadow of the arm", ("shadow",), _shadow, (0.4, 0.7, 0.95)),
    Planted("channels swapped in some rows", ("channels",), _channels_of_some, (0.05,)),
    Planted("a channel a row late", ("channel-late",), _channel_shifted),
)  # fmt: skip
