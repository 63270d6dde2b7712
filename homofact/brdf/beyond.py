"""What a fit is asked for beyond its measurement: the nearest samples carried on, so that it cannot blow up there.

A goniometer leaves out what it cannot reach, grazing angles above all. A product of textures says something there all
the same: texels that few samples hold swing freely, and their exponential may be any number. So pairs of directions are
drawn everywhere (the scheme lobe), and those that graze more than any sample does, or lie farther from all of them than
`FAR` times the usual distance between neighbours, are given the value of the nearest one. They weigh little: `SHARE` of
all samples' weight together, enough where nothing else is known and next to nothing elsewhere. A finished fit is held
against a denser draw; where it is more than `EXCESS` times the largest of the nearest values all the same, these pairs
are added and it is solved again.

Distance is in (√θh, θd, φd), each from 0 to 1, for isotropic samples (φd folded to a quarter turn; it counts by sinθd,
since it means nothing where θd is 0), else in the parabolic discs of both directions.
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
NEIGHBOURS, EXCESS = 16, 1.2  # nearest samples, and what a fit may be of the largest of them where nothing is measured
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

    def carried_on(self) -> Samples | None:
        """Pairs that are not measured, with the values of the nearest samples; None where there are none."""
        if self._known is None:
            return None
        drawn, far, near = self._drawn(COUNT, _SEED, 1)
        values = self._samples.values[near[:, 0]]
        weight = SHARE * self._samples.weights.sum() / COUNT
        return self._made(drawn, far, values, weight.expand(COUNT))

    def exceeding(self, evaluate: Callable[[Tensor, Tensor], Tensor], attempt: int) -> Samples | None:
        """Where a fit is more than `EXCESS` times what it may be, with that value; None where it keeps to it.

        Where nothing is measured it may be the largest of the `NEIGHBOURS` nearest samples, elsewhere of all samples,
        channel by channel. They weigh `SHARE` of all samples together, those that are
        brighter than every sample as much as one. `attempt` counts the calls: other pairs are drawn in
        each.
        """
        if self._known is None:
            return None
        drawn, far, near = self._drawn(CHECKED, _SEED + 1 + attempt, min(NEIGHBOURS, len(self._samples)))
        values = self._samples.values
        most = torch.where(far[:, None], values[near].amax(1), values.amax(0))
        found = evaluate(drawn.wi, drawn.wo).to(most)
        wrong = ((found > EXCESS * most) & (most > 0)).any(1)
        weights = self._samples.weights
        least = min(float(weights.mean()), SHARE * float(weights.sum()) / max(int(wrong.sum()), 1))
        # What is brighter than all that was measured counts as much as a sample: nothing else stops a runaway texel.
        runaway = (found > EXCESS * values.amax(0)).any(1)
        return self._made(drawn, wrong, torch.minimum(found, most), torch.where(runaway, weights.mean(), least))

    def _drawn(self, count: int, seed: int, neighbours: int) -> tuple[Samples, Tensor, Tensor]:
        """(drawn pairs, which of them are not measured (N,), the nearest samples of each (N, K))."""
        assert self._known is not None
        wi, wo = (w.to(self._samples.wi) for w in draw_lobe(count, torch.Generator().manual_seed(seed)))
        values = self._samples.values[:1].expand(count, -1)
        drawn = replace(self._samples, wi=wi, wo=wo, values=values, weights=torch.ones_like(wi[:, 0]))
        distance, near = self._known.query(_place(drawn), k=neighbours)
        # One neighbour comes without an axis of its own.
        distance, near = (np.asarray(each).reshape(count, -1) for each in (distance, near))
        far = torch.from_numpy(distance[:, 0] > self._far).to(wi.device) | (_least_cosine(drawn) < self._grazing)
        return drawn, far, torch.from_numpy(near).to(wi.device)

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
    place[:, 2] *= np.sin(place[:, 1] * (math.pi / 2))
    return place
