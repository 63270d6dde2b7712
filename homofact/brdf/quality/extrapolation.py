"""Extrapolate a measurement, so that a fit neither diverges nor goes dark outside the measured directions.

A goniometer cannot reach all directions; most of the missing ones are at grazing angles. A product of textures has
values there too, but texels with few samples are poorly determined, and their exponential can become arbitrarily large.
Therefore pairs of directions are drawn everywhere (the scheme lobe). Pairs that graze more than every sample, or that
are farther from all samples than `FAR` times the usual distance between neighbours, get a value:

* the value of `brdf.scattered`, which follows a fitted GGX model, if there are at least `LEAST_FOLLOWED` isotropic
  samples (and, if fewer than `MANY`, they end before `GRAZING`). Together these pairs have `FOLLOWED_SHARE` of the
  weight of all samples. Highlights grow towards grazing angles, which a goniometer does not reach. Without these pairs,
  textures lost two thirds of the light beyond the measured angles (`scripts/accuracy/beyond_the_samples.py`);
* otherwise the value of the nearest sample, with the share `SHARE` of the weight. This determines texels without
  samples and is negligible elsewhere.

The finished fit is then checked at a denser set of pairs, where it may reach `EXCESS` times a bound. Within the
measured range the bound is the largest of all samples. Outside it, the bound is the largest of the `NEIGHBOURS` nearest
samples and of the value of the GGX model. Pairs above the bound are added as samples with the bound as their value, and
the fit is solved again. (With the nearest samples as the bound between rings too, the highlight lost 60% at measured
directions.)

The measured range is the range of the smaller and of the larger of θi and θo and, for isotropic pairs, of |Δφ|. It
extends through the normal and through the plane of incidence if samples lie within `_GAP` of them, since symmetry gives
the values on the other side.

Distances are measured in `brdf.places`, except for the `NEIGHBOURS` nearest samples of the bound: these are nearest in
the parabolic discs of both directions. For anisotropic samples, as many nearest samples in `brdf.places` are added,
since between two azimuths of the light no neighbour in the discs has the highlight. (Without them, the highlight of a
brushed steel lost 60% at the largest angle of incidence.)
"""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.pair_density import draw_lobe, scheme_of
from homofact.brdf.places import half_places
from homofact.brdf.samples import Samples
from homofact.brdf.scattered import Scattered, surface_of
from homofact.brdf.symmetry import angles_of_pairs
from homofact.geometry.coordinates import coordinate_system
from homofact.geometry.nearest import tree_of

if TYPE_CHECKING:
    from scipy.spatial import KDTree

COUNT, SHARE, FOLLOWED_SHARE = 6000, 0.003, 0.1
# Fewer samples say too little of a model. Of fewer than MANY, none is followed if they reach the grazing angle: there
# is little beyond them to gain.
LEAST_FOLLOWED, MANY, GRAZING = 150, 500, math.radians(86.0)
_CHECKED = 60_000  # pairs at which a fit is held against what it may not exceed
FAR, LEAST_FAR = 3.0, 0.08
EXCESS, MOST = 1.2, 0.05  # what a fit may be of the largest sample that bounds it; the weight that holds it there
NEIGHBOURS = 16  # two or three samples each way
_OVER_CLIPPED = 20.0  # times the largest sample: the bound where that is only known not to be less
_LEAST_BOUND = 1e-2  # of the mean: what is darker is noise, under ε of the logarithms
_GAP = math.radians(15.0)
_SEED = 20261122
_MARGIN = 1e-3


class Extrapolation:
    """The unmeasured pairs of `samples`: none for samples drawn by a scheme, which cover all directions."""

    def __init__(self, samples: Samples) -> None:
        """Measure how far the samples reach."""
        self._samples = samples
        self._known: KDTree | None = None
        if scheme_of(samples) is None:
            self._known = tree_of(_place(samples))
            usual = self._known.query(self._known.data[:: max(1, self._known.n // 2000)], k=2)[0][:, 1]
            self._far = max(LEAST_FAR, FAR * float(np.median(usual)))
            self._grazing = float(_least_cosine(samples).min()) - 1e-3
            extent = _extent(samples)
            margin = extent.new_tensor([_MARGIN, _MARGIN, _GAP][: extent.shape[1]])
            self._range = extent.amin(0) - _GAP, extent.amax(0) + margin

    def measured(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return whether pairs of directions (N, 3) were measured (N,): always true for drawn samples."""
        if self._known is None:
            return torch.ones(len(wi), dtype=torch.bool, device=wi.device)
        return ~self._far_from(self._known, self._at(wi.to(self._samples.wi), wo.to(self._samples.wo)))[0].to(wi.device)

    def carried_on(self) -> Samples | None:
        """Return unmeasured pairs with the values described in the module docstring; None if there are none."""
        if self._known is None:
            return None
        drawn = self._drawn(COUNT, _SEED)
        far, nearest = self._far_from(self._known, drawn)
        values, share = self._samples.values[nearest], SHARE
        if self._surface is not None:
            share = FOLLOWED_SHARE
            values[far] = self._surface.evaluate(drawn.wi[far], drawn.wo[far])
        weight = share * self._samples.weights.sum() / COUNT
        return self._made(drawn, far, values, weight.expand(COUNT))

    def outside(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return whether pairs of directions (N, 3) lie outside the measured range (N,): never for drawn samples."""
        if self._known is None:
            return torch.zeros(len(wi), dtype=torch.bool, device=wi.device)
        pairs = self._at(wi.to(self._samples.wi), wo.to(self._samples.wo))
        return self._outside(pairs).to(wi.device)

    def exceeding(self, evaluate: Callable[[Tensor, Tensor], Tensor], attempt: int) -> Samples | None:
        """Return pairs where any channel of a fit exceeds `EXCESS` times its bound; None if there are none.

        The values of these pairs are the fit's, but at most the bound. Each pair has the mean weight of a sample, but
        all pairs together have at most `MOST` of the samples' weight. `attempt` counts the calls; each call draws other
        pairs.
        """
        if self._known is None:
            return None
        drawn = self._drawn(_CHECKED, _SEED + 1 + attempt)
        weights = self._samples.weights
        values = evaluate(drawn.wi, drawn.wo).to(self._samples.values)
        bound = self._bound(drawn)
        runaway = ((values > EXCESS * bound) & (self._samples.values.amax(0) > 0)).any(1)
        weight = min(float(weights.mean()), MOST * float(weights.sum()) / max(int(runaway.sum()), 1))
        return self._made(drawn, runaway, torch.minimum(values, bound), torch.full_like(values[:, 0], weight))

    def _bound(self, pairs: Samples) -> Tensor:
        """The largest sample, beyond the measured range the largest of the nearest, at `pairs` (N, C)."""
        values = self._samples.values
        largest = values.amax(0)
        if self._samples.clipped is not None:
            largest = torch.where(self._samples.clipped.any(0), _OVER_CLIPPED * largest, largest)
        bound = largest.expand(len(pairs), -1).clone()
        outside = self._outside(pairs)
        if bool(outside.any()):
            count = min(NEIGHBOURS, len(values))
            chosen = pairs.select(outside)
            near = _largest_of(values, self._discs, _on_discs(chosen), count)
            if not chosen.isotropic and self._known is not None:
                near = torch.maximum(near, _largest_of(values, self._known, _place(chosen), count))
            if self._surface is not None:
                near = torch.maximum(near, self._surface.modelled(chosen.wi, chosen.wo))
            # Noise has zeros, of which no logarithm can be asked.
            bound[outside] = torch.maximum(near, _LEAST_BOUND * values.mean(0))
        return bound

    @cached_property
    def _surface(self) -> Scattered | None:
        """What follows a model of the samples; None without one."""
        surface = _surface_of(self._samples)
        return surface if surface is not None and surface.follows_model else None

    @cached_property
    def _discs(self) -> "KDTree":
        return tree_of(_on_discs(self._samples))

    def _outside(self, pairs: Samples) -> Tensor:
        extent, (low, high) = _extent(pairs), self._range
        return ((extent < low) | (extent > high)).any(1)

    def _drawn(self, count: int, seed: int) -> Samples:
        """Pairs drawn everywhere, of weight 1; their values are not theirs yet."""
        return self._at(*(w.to(self._samples.wi) for w in draw_lobe(count, torch.Generator().manual_seed(seed))))

    def _at(self, wi: Tensor, wo: Tensor) -> Samples:
        values = self._samples.values[:1].expand(len(wi), -1)
        return replace(self._samples, wi=wi, wo=wo, values=values, weights=torch.ones_like(wi[:, 0]), clipped=None)

    def _far_from(self, known: "KDTree", pairs: Samples) -> tuple[Tensor, Tensor]:
        """(whether each of `pairs` is not measured, the number of the sample nearest to it), (N,) each."""
        distance, nearest = (np.asarray(numbers) for numbers in known.query(_place(pairs)))
        grazing = _least_cosine(pairs) < self._grazing
        far = grazing | torch.from_numpy(distance > self._far).to(grazing.device)
        return far, torch.from_numpy(nearest).to(grazing.device)

    def _made(self, drawn: Samples, chosen: Tensor, values: Tensor, weights: Tensor) -> Samples | None:
        if not bool(chosen.any()):
            return None
        pairs = drawn.select(chosen.nonzero()[:, 0])
        return replace(pairs, values=values[chosen], weights=weights[chosen], all_azimuths=True)


def _surface_of(samples: Samples) -> Scattered | None:
    """The interpolation of the samples; None of too few, and of clipped ones, whose highlight it would not know."""
    if samples.clipped is not None or len(samples) < LEAST_FOLLOWED:
        return None
    reach_grazing = float(_least_cosine(samples).min()) < math.cos(GRAZING)
    return None if len(samples) < MANY and reach_grazing else surface_of(samples)


def _largest_of(values: Tensor, tree: "KDTree", place: np.ndarray, count: int) -> Tensor:
    """The largest of the `count` values that are nearest to each place in the tree (N, C)."""
    _, nearest = tree.query(place, k=count)
    return values[torch.from_numpy(np.reshape(nearest, (-1, count))).to(values.device)].amax(1)


def _least_cosine(samples: Samples) -> Tensor:
    return torch.minimum(samples.wi[:, 2], samples.wo[:, 2])


def _extent(samples: Samples) -> Tensor:
    """The smaller and the larger of θi and θo, and |Δφ| where that tells all: (N, 2) or (N, 3) in radians."""
    angles = angles_of_pairs(samples.wi, samples.wo)
    return torch.cat((angles[:, :2].sort(1).values, angles[:, 2 : 3 if samples.isotropic else 2]), 1)


def _on_discs(samples: Samples) -> np.ndarray:
    """Return coordinates of pairs for a search of neighbours in both parabolic discs, (N, 3) or (N, 4).

    For isotropic pairs the coordinates come from half the sum and half the difference of the two points in the discs:
    their lengths, and the angle between them (at most a right angle) times the shorter length. Distances in these
    coordinates equal the distance in the discs within a factor of √2, minimised over rotations about the normal, mirror
    images and exchange of the two directions.
    """
    discs = coordinate_system("in-out").evaluate(samples.wi, samples.wo).cpu().numpy()
    if not samples.isotropic:
        return discs
    half, difference = (discs[:, :2] + discs[:, 2:]) / 2, (discs[:, :2] - discs[:, 2:]) / 2
    lengths = [np.linalg.norm(points, axis=1) for points in (half, difference)]
    along, across = (
        np.abs((half * difference).sum(1)),
        np.abs(half[:, 0] * difference[:, 1] - half[:, 1] * difference[:, 0]),
    )
    return np.stack((*lengths, np.minimum(*lengths) * np.arctan2(across, along)), 1)


def _place(samples: Samples) -> np.ndarray:
    return half_places(samples.wi, samples.wo, samples.isotropic).cpu().numpy()
