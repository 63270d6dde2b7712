"""Folds of samples for cross-validation, drawn at random or by the rings of a goniometer.

Azimuth copies of one measurement must be in the same fold. Otherwise the fit would see copies of the left-out samples.

A goniometer measures on rings: few incident angles, few exitant ones, many azimuths, and each ring has
faults of its own. With random folds, left-out samples always have neighbours on their own rings. Random folds therefore
favour a fit that is accurate on the rings but not between them, which shows as bands on a sphere. For such data, whole
rings are left out instead; rings of θi and rings of θo each count for half of the error. The outermost rings are never
left out, since beyond them is extrapolation. Random folds are for samples that do not lie on rings, or on request.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.brdf.samples import Samples
from homofact.brdf.symmetry import ring_numbers

_RING_FOLDS = 3
BEYOND = -2  # the fold of what no sample measures


def random_folds(count: int, folds: int, seed: int) -> Tensor:
    """Return a fold number (count,) for every sample, sizes as equal as can be, drawn by `seed`."""
    order = torch.randperm(count, generator=torch.Generator().manual_seed(seed))
    result = torch.empty(count, dtype=torch.int64)
    result[order] = torch.arange(count) % folds
    return result


@dataclass(frozen=True)
class Partition:
    """A partition of samples: fold numbers (N,) int64, negative if never left out, and its share of the error."""

    folds: Tensor
    share: float

    def select(self, index: Tensor) -> "Partition":
        """Return the partition of the samples at `index`."""
        return Partition(self.folds[index], self.share)

    def with_more(self, count: int) -> "Partition":
        """Return the partition with `count` more samples that are beyond the measurement: never left out."""
        return Partition(torch.cat((self.folds, self.folds.new_full((count,), BEYOND))), self.share)

    def repeated(self, times: int) -> "Partition":
        """Return the partition of `times` copies of all samples, one after another."""
        return Partition(self.folds.repeat(times), self.share)


def partitions_of(samples: Samples, folds: int, seed: int, *, rings: bool) -> tuple[Partition, ...]:
    """Return the partitions of `samples`: by rings if `rings` is set and they lie on rings, else at random."""
    folds_by_ring = [_rings(direction) for direction in (samples.wi, samples.wo)] if rings else []
    folds_by_ring = [ring for ring in folds_by_ring if ring is not None]
    if not folds_by_ring:
        return (Partition(random_folds(len(samples), folds, seed), 1.0),)
    return tuple(Partition(ring, 1 / len(folds_by_ring)) for ring in folds_by_ring)


def _rings(direction: Tensor) -> Tensor | None:
    """Return fold numbers (N,) of the inner rings of a direction's θ; neighbouring rings get different folds.

    Samples on the first and last rings get −1. Returns None if θ does not lie on rings.
    """
    numbers = ring_numbers(direction)
    if numbers is None:
        return None
    rank, count = numbers
    inner = (rank > 0) & (rank < count - 1)
    # A look at one fold takes the first: four rings have to have it too.
    return torch.where(inner, (rank - 1) % _RING_FOLDS, torch.full_like(rank, -1))
