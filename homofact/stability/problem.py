"""The test problem of a stressor: measured samples to fit, clean samples to measure errors, and settings.

The unstressed problem is an isotropic Blinn-Phong material of two channels, sampled at all azimuths. A fit never sees
the clean samples; they are drawn from the material itself, without the stress.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, Literal

import torch
from torch import Tensor

from homofact.brdf.analytic import BlinnPhong
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.geometry.directions import from_cosine, from_half_difference, from_spherical
from homofact.stability.fault import Fault, uniform

CHANNELS = ("R", "G")
# Broad enough that a fit of any method with textures of 8² is worth stressing.
BASE = BlinnPhong((0.35, 0.15), (0.4, 0.4), exponent=6, channels=CHANNELS)
# Below the cut of the thesis's sampling both directions graze, which is a stress of its own.
RADIUS_SQUARED = 0.9
# Seeds of the clean samples lie apart from those of the measured ones.
CLEAN_SEED = 7_000_003


@dataclass(frozen=True)
class Scale:
    """How large the problems of an atlas are: measured and clean samples of each."""

    samples: int = 3000
    clean: int = 1500


@dataclass(frozen=True)
class Problem:
    """Samples as measured, clean held-out ones, and settings.

    `settings` are alternative sets of changed settings. A method uses the first set that it supports completely; a
    method that supports no set skips the problem. `kind` is the kind of a `Source`. The error of a fit is compared with
    that of `reference`, the unstressed problem (None: the one described at the start of this module). `key` identifies
    the problem, so that a reference is fitted only once.
    """

    samples: Samples
    clean: Samples
    settings: tuple[dict[str, Any], ...] = ({},)
    kind: Literal["material", "measurement", "drawn"] = "drawn"
    reference: "Problem | None" = None
    key: str = "base"

    def measuring(self, samples: Samples) -> "Problem":
        """Return the same problem with other measured samples."""
        return replace(self, samples=samples, key="stressed")

    def both(self, change: Callable[[Samples], Samples]) -> "Problem":
        """Return the same problem with measured and clean samples changed alike."""
        return replace(self.measuring(change(self.samples)), clean=change(self.clean))

    def with_values(self, values: Tensor) -> "Problem":
        """Return the same problem with other measured values (N, C); negative ones become 0, as in the readers."""
        return self.measuring(replace(self.samples, values=values.clamp_min(0)))


Stress = Callable[[float, int, Scale], Problem]


@dataclass(frozen=True)
class Stressor:
    """One way to go wrong, swept over `strengths` from harmless to fatal.

    `name` is the name on the command line. `title`, `description` (one sentence), `mechanism` and `remedy` are the
    texts of the document. `unit` is the unit of the strengths. `labels` are words for the strengths, if numbers are not
    descriptive. `stress(strength, seed, scale)` makes the problem; it may raise a BadInput that a user would also get.
    """

    name: str
    title: str
    description: str
    mechanism: str
    remedy: str
    unit: str
    strengths: tuple[float, ...]
    stress: Stress
    labels: tuple[str, ...] = field(default=())

    def label(self, strength: float) -> str:
        """Return the strength in words."""
        return self.labels[self.strengths.index(strength)] if self.labels else f"{strength:g}"


@lru_cache(maxsize=16)
def unstressed(seed: int, scale: Scale) -> Problem:
    """Return the problem without any stress."""
    return drawn_from(BASE, seed, scale)


def drawn_from(model: Any, seed: int, scale: Scale, key: str = "base") -> Problem:
    """Return a problem of measured and clean samples of one model, uniform in the parabolic discs."""
    return Problem(
        sample_model(model, scale.samples, seed=seed, radius_squared=RADIUS_SQUARED),
        sample_model(model, scale.clean, seed=seed + CLEAN_SEED, radius_squared=RADIUS_SQUARED),
        key=key,
    )


def faulted(fault: Fault) -> Stress:
    """Return a function that applies a fault of the catalogue (`stability.faults`) to the unstressed problem."""

    def stress(strength: float, seed: int, scale: Scale) -> Problem:
        problem = unstressed(seed, scale)
        return problem.measuring(fault.plant(problem.samples, strength, seed))

    return stress


def samples_at(reflectance: Reflectance, wi: Tensor, wo: Tensor) -> Samples:
    """Return samples of an isotropic reflectance at given pairs of directions."""
    return Samples(wi, wo, reflectance.evaluate(wi, wo), channels=reflectance.channels, isotropic=True)


def pairs_about_half_vectors(
    count: int, generator: torch.Generator, theta_h: Callable[[Tensor], Tensor]
) -> tuple[Tensor, Tensor]:
    """Return `count` pairs whose half vectors have θh = theta_h(u), u uniform in [0, 1); θd under 75°, all azimuths.

    Pairs with a direction under the horizon are drawn again.
    """
    pairs: list[tuple[Tensor, Tensor]] = []
    have = 0
    while have < count:
        n = 2 * count
        u, v, w, x = (uniform(n, generator) for _ in range(4))
        h = from_spherical(theta_h(u), v * (2 * torch.pi))
        d = from_cosine(1 - w * (1 - 0.26), x * (2 * torch.pi))
        wi, wo = from_half_difference(h, d)
        wi, wo = (directions / directions.norm(dim=1, keepdim=True) for directions in (wi, wo))
        above = (wi[:, 2] > 0.02) & (wo[:, 2] > 0.02)
        pairs.append((wi[above], wo[above]))
        have += int(above.sum())
    return torch.cat([pair[0] for pair in pairs])[:count], torch.cat([pair[1] for pair in pairs])[:count]
