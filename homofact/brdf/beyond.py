"""What a fit is asked for beyond its measurement: the nearest samples carried on, so that it cannot blow up there.

A goniometer leaves out what it cannot reach, grazing angles above all. A product of textures says something there all
the same: texels that few samples hold swing freely, and their exponential may be any number. So pairs of directions are
drawn everywhere (the scheme lobe), and those that graze more than any sample does, or lie farther from all of them than
`FAR` times the usual distance between neighbours, are given the value of the nearest one. They weigh little: `SHARE` of
all samples' weight together, enough where nothing else is known and next to nothing elsewhere. A finished fit is held
against a denser draw; where it is more than `EXCESS` times the largest sample all the same, these pairs are added and
it is solved again. (Holding it to the nearest samples took the highlight from measured places too.)

Distance is in (√θh, θd, φd), each from 0 to 1, for isotropic samples (φd folded to a quarter turn; it counts by √θh
sinθd, since it means nothing where either is 0), else in the parabolic discs of both directions.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import torch
from scipy.spatial import KDTree
from torch import Tensor

from homofact.brdf.pair_density import draw_lobe, scheme_of
from homofact.brdf.samples import Samples
from homofact.geometry.coordinates import coordinate_system

COUNT, SHARE = 6000, 0.003
CHECKED = 60_000  # pairs at which a fit is held against what it may not exceed
FAR, LEAST_FAR = 3.0, 0.08
EXCESS, MOST = 1.2, 0.05  # what a fit may be of the largest sample; the weight that holds it there
_SEED = 20261122


class Beyond:
    """The unmeasured part of `samples`' domain: empty for samples that were drawn by a scheme, which lie everywhere."""

    def __init__(self, samples: Samples) -> None:
        """Measure how far the samples reach."""
        self._samples = samples
        self._known: KDTree | None = None
        if scheme_of(samples) is None:
            self._known = KDTree(_place(samples))
            usual = self._known.query(self._known.data[:: max(1, self._known.n // 2000)], k=2)[0][:, 1]
            self._far = max(LEAST_FAR, FAR * float(np.median(usual)))
            self._grazing = float(_least_cosine(samples).min()) - 1e-3

    def measured(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Whether pairs of directions (N, 3) lie within what was measured (N,): true everywhere for drawn samples."""
        if self._known is None:
            return torch.ones(len(wi), dtype=torch.bool, device=wi.device)
        return ~self._far_from(self._known, self._at(wi.to(self._samples.wi), wo.to(self._samples.wo)))[0].to(wi.device)

    def carried_on(self) -> Samples | None:
        """Pairs that are not measured, with the values of the nearest samples; None where there are none."""
        if self._known is None:
            return None
        drawn = self._drawn(COUNT, _SEED)
        far, nearest = self._far_from(self._known, drawn)
        values = self._samples.values[nearest]
        weight = SHARE * self._samples.weights.sum() / COUNT
        return self._made(drawn, far, values, weight.expand(COUNT))

    def exceeding(self, evaluate: Callable[[Tensor, Tensor], Tensor], attempt: int) -> Samples | None:
        """Where a fit is more than `EXCESS` times the largest sample, channel by channel; None where it is nowhere.

        With that largest value, each pair at the weight of a sample but all of them at no more than `MOST` of the
        samples' weight. `attempt` counts the calls: other pairs are drawn in each.
        """
        if self._known is None:
            return None
        drawn = self._drawn(CHECKED, _SEED + 1 + attempt)
        largest, weights = self._samples.values.amax(0), self._samples.weights
        found = evaluate(drawn.wi, drawn.wo).to(largest)
        runaway = ((found > EXCESS * largest) & (largest > 0)).any(1)
        each = min(float(weights.mean()), MOST * float(weights.sum()) / max(int(runaway.sum()), 1))
        return self._made(drawn, runaway, torch.minimum(found, largest), torch.full_like(found[:, 0], each))

    def _drawn(self, count: int, seed: int) -> Samples:
        """Pairs drawn everywhere, of weight 1; their values are not theirs yet."""
        return self._at(*(w.to(self._samples.wi) for w in draw_lobe(count, torch.Generator().manual_seed(seed))))

    def _at(self, wi: Tensor, wo: Tensor) -> Samples:
        values = self._samples.values[:1].expand(len(wi), -1)
        return replace(self._samples, wi=wi, wo=wo, values=values, weights=torch.ones_like(wi[:, 0]))

    def _far_from(self, known: KDTree, pairs: Samples) -> tuple[Tensor, Tensor]:
        """(whether each of `pairs` is not measured, the number of the sample nearest to it), (N,) each."""
        distance, nearest = (np.asarray(each) for each in known.query(_place(pairs)))
        grazing = _least_cosine(pairs) < self._grazing
        far = grazing | torch.from_numpy(distance > self._far).to(grazing.device)
        return far, torch.from_numpy(nearest).to(grazing.device)

    def _made(self, drawn: Samples, chosen: Tensor, values: Tensor, weights: Tensor) -> Samples | None:
        if not bool(chosen.any()):
            return None
        found = drawn.select(chosen.nonzero()[:, 0])
        return replace(found, values=values[chosen], weights=weights[chosen], all_azimuths=True)


def _least_cosine(samples: Samples) -> Tensor:
    return torch.minimum(samples.wi[:, 2], samples.wo[:, 2])


def _place(samples: Samples) -> np.ndarray:
    if not samples.isotropic:
        return coordinate_system("in-out").evaluate(samples.wi, samples.wo).cpu().numpy()
    place = (coordinate_system("isotropic-half-diff").evaluate(samples.wi, samples.wo).cpu().numpy() + 1) / 2
    place[:, 0] = np.sqrt(place[:, 0].clip(0))
    # An angle that means nothing at θh = 0 and at θd = 0 keeps nothing apart there.
    place[:, 2] *= place[:, 0].clip(0, 1) * np.sin(place[:, 1] * (math.pi / 2))
    return place
