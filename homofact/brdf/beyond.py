"""What a fit is asked for beyond its measurement: the nearest samples carried on, so that it cannot blow up there.

A goniometer leaves out what it cannot reach, grazing angles above all. A product of textures says something there all
the same: texels that few samples hold swing freely, and their exponential may be any number. So pairs of directions are
drawn everywhere (the scheme lobe), and those that lie farther from all samples than `FAR` times the usual distance
between neighbours are given the value of the nearest one. They weigh little: `SHARE` of all samples' weight together,
enough where nothing else is known and next to nothing elsewhere.

Distance is in (√θh, θd, φd), each from 0 to 1, for isotropic samples (φd folded to a quarter turn; it counts by sinθd,
since it means nothing where θd is 0), else in the parabolic discs of both directions.
"""

from dataclasses import replace

import numpy as np
import torch
from scipy.spatial import KDTree

from homofact.brdf.pair_density import draw_lobe, scheme_of
from homofact.brdf.samples import Samples
from homofact.geometry.coordinates import coordinate_system

COUNT, SHARE = 6000, 0.02
FAR, LEAST_FAR = 2.0, 0.05
_SEED = 20261122


def beyond(samples: Samples) -> Samples | None:
    """Pairs beyond what `samples` measure with the values of their nearest; None where everything is measured.

    Samples that were drawn from a reflectance by a scheme lie everywhere.
    """
    if scheme_of(samples) is not None:
        return None
    known = KDTree(_place(samples))
    usual = known.query(known.data[:: max(1, known.n // 2000)], k=2)[0][:, 1]
    wi, wo = draw_lobe(COUNT, torch.Generator().manual_seed(_SEED))
    drawn = replace(samples, wi=wi, wo=wo, values=samples.values[:1].expand(COUNT, -1), weights=torch.ones(COUNT))
    distance, nearest = known.query(_place(drawn))
    far = torch.from_numpy(distance > max(LEAST_FAR, FAR * float(np.median(usual))))
    if not bool(far.any()):
        return None
    values = samples.values[torch.from_numpy(nearest)[far].to(samples.values.device)]
    weight = SHARE * float(samples.weights.sum()) / COUNT
    weights = torch.full_like(values[:, 0], weight)
    return replace(
        samples, wi=wi[far].to(values), wo=wo[far].to(values), values=values, weights=weights, all_azimuths=True
    )


def _place(samples: Samples) -> np.ndarray:
    if not samples.isotropic:
        return coordinate_system("in-out").evaluate(samples.wi, samples.wo).cpu().numpy()
    place = (coordinate_system("isotropic-half-diff").evaluate(samples.wi, samples.wo).cpu().numpy() + 1) / 2
    place[:, 0] = np.sqrt(place[:, 0].clip(0))
    place[:, 2] *= np.sin(place[:, 1] * (np.pi / 2))
    return place
