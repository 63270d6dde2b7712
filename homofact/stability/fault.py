"""What a fault of a measurement is: a change of samples, whatever their material.

The atlas plants faults on one material to see where methods fail (`stability.problem`); the calibration of the error
bars plants them on drawn ones (`scripts/verdict/calibrate.py`). Both take them from one catalogue (`stability.faults`).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

import torch
from torch import Tensor

from homofact.brdf.samples import Samples


class CasePart(Enum):
    """What a kind of fault, or a material, is for in the calibration: no two parts share one.

    The table of the error bars is made from the first two; the third is reported on, and sets nothing.
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
    plant : (samples, strength, seed) to the samples as they are then measured; never of values below zero.
    strengths : those that the calibration draws, the mildest first.
    part : which part of the calibration draws it.
    right : whether the samples are right for all that: fewer, or noisy, but of this material.
    knowable : whether samples can show it. What changes the values alone, all directions alike, is another material.
    """

    name: str
    plant: Plant
    strengths: tuple[float, ...]
    part: CasePart
    right: bool = False
    knowable: bool = True


def generator_of(seed: int) -> torch.Generator:
    """Return the generator of a fault's own chance."""
    return torch.Generator().manual_seed(seed + 1000)


def uniform(count: int, generator: torch.Generator) -> Tensor:
    """Return (count,) numbers in [0, 1)."""
    return torch.rand(count, dtype=torch.float64, generator=generator)


def normal(like: Tensor, seed: int) -> Tensor:
    """Standard normal numbers in the shape of `like`."""
    return torch.randn(like.shape, dtype=torch.float64, generator=generator_of(seed))


def struck(samples: Samples, share: float, seed: int) -> Tensor:
    """Return which samples (N, 1) a fault hits that hits a share of them by chance."""
    return (uniform(len(samples), generator_of(seed)) < share)[:, None]


def joined(one: Samples, two: Samples) -> Samples:
    """Return the samples of both, one after the other."""
    parts = {name: torch.cat((getattr(one, name), getattr(two, name))) for name in ("wi", "wo", "values", "weights")}
    return replace(one, **parts)


def of_values(change: Callable[[Samples, Tensor, float, int], Tensor]) -> Plant:
    """A fault of the values: `change(samples, values, strength, seed)`, what falls below zero cut as readers do."""

    def plant(samples: Samples, strength: float, seed: int) -> Samples:
        return replace(samples, values=change(samples, samples.values, strength, seed).clamp_min(0))

    return plant
