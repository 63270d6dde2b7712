"""Faults of measurements: changes of the samples of any material.

The atlas plants faults on one material to see where methods fail (`stability.problem`); the calibration of the error
bars plants them on randomly drawn materials (`scripts/verdict/calibrate.py`). Both use the catalogue
`stability.faults`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

import torch
from torch import Tensor

from homofact.brdf.samples import Samples


class CasePart(Enum):
    """The part of the calibration that a kind of fault, or a material, belongs to; it belongs to only one.

    The table of the error bars is computed from the first two parts. The third part is only used to report its
    accuracy.
    """

    FIRST = "first"
    SECOND = "second"
    REPORT = "report"


Plant = Callable[[Samples, float, int], Samples]


@dataclass(frozen=True)
class Fault:
    """One thing that goes wrong with a measurement.

    Attributes
    ----------
    name : for tables.
    plant : a function of (samples, strength, seed) that returns the faulty samples, without values below zero.
    strengths : the strengths that the calibration uses, the mildest first.
    part : which part of the calibration draws it.
    right : whether the faulty samples are still correct samples of the material, for example fewer or noisier.
    knowable : whether samples can reveal the fault. If all directions change alike, samples cannot distinguish the
        fault from another material.
    """

    name: str
    plant: Plant
    strengths: tuple[float, ...]
    part: CasePart
    right: bool = False
    knowable: bool = True


def generator_of(seed: int) -> torch.Generator:
    """Return the random generator of a fault for this seed."""
    return torch.Generator().manual_seed(seed + 1000)


def uniform(count: int, generator: torch.Generator) -> Tensor:
    """Return (count,) numbers in [0, 1)."""
    return torch.rand(count, dtype=torch.float64, generator=generator)


def normal(like: Tensor, seed: int) -> Tensor:
    """Return standard normal numbers in the shape of `like`."""
    return torch.randn(like.shape, dtype=torch.float64, generator=generator_of(seed))


def struck(samples: Samples, share: float, seed: int) -> Tensor:
    """Return a random mask (N, 1) of the samples that a fault changes, each with the probability `share`."""
    return (uniform(len(samples), generator_of(seed)) < share)[:, None]


def joined(one: Samples, two: Samples) -> Samples:
    """Return the samples of both, one after the other."""
    parts = {name: torch.cat((getattr(one, name), getattr(two, name))) for name in ("wi", "wo", "values", "weights")}
    return replace(one, **parts)


def of_values(change: Callable[[Samples, Tensor, float, int], Tensor]) -> Plant:
    """Make a fault from `change(samples, values, strength, seed)`, which returns values; negative ones become 0."""

    def plant(samples: Samples, strength: float, seed: int) -> Samples:
        return replace(samples, values=change(samples, samples.values, strength, seed).clamp_min(0))

    return plant
