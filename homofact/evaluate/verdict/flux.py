"""Figures of samples and fits by the light that they carry.

A pair of directions stands for the flux f cosθi cosθo times its solid angle (`brdf.pair_density.solid_angles`), so what
is dark or grazing counts for as little here as it does in a picture.
"""

import math

import numpy as np
import torch
from scipy.spatial import KDTree
from torch import Tensor

from homofact.brdf.beyond import Beyond
from homofact.brdf.pair_density import solid_angles
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.scatter import places_of
from homofact.brdf.symmetry import angles_of_pairs, light_azimuths, ring_numbers
from homofact.geometry.coordinates import rusinkiewicz_angles
from homofact.geometry.directions import from_spherical, to_spherical
from homofact.geometry.quadrature import disc_nodes, hemisphere_nodes
from homofact.linear.robust import scale_of

ALBEDO_DEGREES = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0, 88.0)
BANDS = {"θi": (0, 15, 30, 45, 60, 75, 90), "θh": (0, 2, 5, 10, 20, 40, 90)}
LEAST_IN_A_BAND, LEAST_OF_THE_LIGHT = 30, 0.02
SURE = 2.0  # standard errors by which a band has to be off
BRIGHTEST = 0.1  # of the samples' light: what is called their highlight
BESIDE = 6
LEAST_TIED = 3
OUTLIER, FEW_OUTLIERS = 6.0, 0.05
NEAR, MOST_SAMPLES = 1.0, 20_000
_SAME = 1e-6  # directions this near are one
_LEVELS, _RINGS, _SPOKES = 6, 32, 24


def flux_of(samples: Samples) -> Tensor:
    """cosθi cosθo times solid angle (N,): what f is multiplied by to be light, up to a common factor."""
    return solid_angles(samples) * samples.wi[:, 2] * samples.wo[:, 2]


def misplaced(flux: Tensor, expected: Tensor, found: Tensor) -> float:
    """Σ|f̂ − f| over Σ f of the light, all channels together, each in units of its own light."""
    own = (flux[:, None] * expected).sum(0)
    missed = (flux[:, None] * (found - expected).abs()).sum(0)
    return float((missed[own > 0] / own[own > 0]).mean()) if bool((own > 0).any()) else 0.0


def worst_band(samples: Samples, flux: Tensor, found: Tensor) -> tuple[float, str] | None:
    """(light of the fit over that of the samples, where) in the band of θi or θh that is farthest off; None for none.

    Channel by channel, in bands of `LEAST_IN_A_BAND` samples and `LEAST_OF_THE_LIGHT`. What chance may do to so many
    samples, `SURE` standard errors of the difference, is taken off.
    """
    theta_h, _, _ = rusinkiewicz_angles(samples.wi, samples.wo)
    angles = {"θi": to_spherical(samples.wi)[0], "θh": theta_h}
    own = flux[:, None] * samples.values
    missed = flux[:, None] * (found - samples.values)
    total = own.sum(0)
    best: tuple[float, str] | None = None
    for name, angle in angles.items():
        degrees = torch.rad2deg(angle)
        for low, high in zip(BANDS[name], BANDS[name][1:], strict=False):
            inside = (degrees >= low) & (degrees < high)
            if int(inside.sum()) < LEAST_IN_A_BAND:
                continue
            light = own[inside].sum(0)
            chance = SURE * (missed[inside] - missed[inside].mean(0)).square().sum(0).sqrt() / light.clamp_min(1e-300)
            off = missed[inside].sum(0) / light.clamp_min(1e-300)
            sure = torch.sign(off) * (off.abs() - chance).clamp_min(0)
            sure = torch.where(light > LEAST_OF_THE_LIGHT * total, sure, torch.zeros_like(sure))
            worst = int(sure.abs().argmax())
            ratio = 1 + float(sure[worst])
            if best is None or abs(ratio - 1) > abs(best[0] - 1):
                best = ratio, f"{samples.channels[worst]} at {name} from {low} to {high}°"
    return best


def brightest(samples: Samples, flux: Tensor, found: Tensor) -> float | None:
    """Light of the fit over that of the samples, where they are brightest and hold `BRIGHTEST` of it; None for too few.

    How bright a place is, is said by the samples around it: of noisy ones the brightest would be those whose noise is.
    """
    if len(samples) < 4 * BESIDE:
        return None
    place = places_of(samples).numpy()
    near = torch.from_numpy(np.asarray(KDTree(place).query(place, k=BESIDE + 1)[1]))
    order = samples.values.mean(1)[near].mean(1).sort(descending=True, stable=True).indices
    own = (flux * samples.values.mean(1))[order]
    count = int((own.cumsum(0) < BRIGHTEST * own.sum()).sum()) + 1
    if count < LEAST_IN_A_BAND:
        return None
    return float((flux * found.mean(1))[order[:count]].sum() / own[:count].sum())


def between_samples(samples: Samples, flux: Tensor) -> float:
    """By how much the brightest samples exceed their neighbours, as a share of their value: the median of them.

    Those that hold `BRIGHTEST` of the light, each beside the mean of its `BESIDE` nearest. Where most of a bright
    sample is gone at the next, the highlight is narrower than the sampling, and its light a matter of chance.
    """
    if len(samples) < 4 * BESIDE:
        return 0.0
    values = samples.values.mean(1)
    order = values.sort(descending=True, stable=True).indices
    own = (flux * values)[order]
    count = int((own.cumsum(0) < BRIGHTEST * own.sum()).sum()) + 1
    place = places_of(samples).numpy()
    _, near = KDTree(place).query(place[order[:count].numpy()], k=BESIDE + 1)
    beside = values[torch.from_numpy(np.asarray(near)[:, 1:])].mean(1)
    return float((1 - beside / values[order[:count]].clamp_min(1e-300)).clamp_min(0).median())


def cut_light(flux: Tensor, expected: Tensor, is_cut: Tensor) -> float:
    """Share of the light of the worst channel where the fit `is_cut` (N, C) at zero."""
    light = flux[:, None] * expected
    return float(((light * is_cut).sum(0) / light.sum(0).clamp_min(1e-300)).max())


def standing_out(samples: Samples, flux: Tensor, found: Tensor, misses: Tensor) -> float:
    """Light by which few samples miss the fit by `OUTLIER` robust deviations; 0 where they are many."""
    far = misses > OUTLIER * scale_of(misses)
    if float(far.double().mean()) > FEW_OUTLIERS:
        return 0.0
    light = flux * samples.values.mean(1)
    missed = flux * (found - samples.values).mean(1).abs()
    return float(missed[far].sum() / light.sum().clamp_min(1e-300))


def dark_light(samples: Samples, flux: Tensor) -> tuple[float, float]:
    """(share of the samples that are zero in a channel, share of the light that is missing there), worst channels.

    What is missing is what the nearest sample that is not zero would have there.
    """
    zero = samples.values == 0
    share, missing = float(zero.double().mean(0).max()), 0.0
    if share == 0:
        return 0.0, 0.0
    place = places_of(samples).numpy()
    for channel in range(zero.shape[1]):
        gone = zero[:, channel]
        if not bool(gone.any()) or bool(gone.all()):
            continue
        there = ~gone
        _, near = KDTree(place[there.numpy()]).query(place[gone.numpy()])
        values = samples.values[there, channel]
        lost = float((flux[gone] * values[torch.from_numpy(np.asarray(near))]).sum())
        missing = max(missing, lost / (lost + float((flux[there] * values).sum())))
    return share, missing


def clipped_light(samples: Samples, flux: Tensor) -> float:
    """Share of the light of the worst channel at samples that share its largest value: `LEAST_TIED` or more of them.

    Not where most samples do, as those of a constant BRDF.
    """
    found = 0.0
    for values in samples.values.T:
        tied = (values == values.max()) & (values > 0)
        if LEAST_TIED <= int(tied.sum()) < len(values) / 2:
            found = max(found, float((flux * values)[tied].sum() / (flux * values).sum().clamp_min(1e-300)))
    return found


def differing_light(samples: Samples, flux: Tensor) -> float:
    """Light by which samples of the same two directions differ from their mean."""
    keys = (torch.cat((samples.wi, samples.wo), 1) / _SAME).round()
    _, group, counts = torch.unique(keys, dim=0, return_inverse=True, return_counts=True)
    if int(counts.max()) < 2:
        return 0.0
    values = samples.values.mean(1)
    mean = torch.zeros(len(counts), dtype=values.dtype).index_add_(0, group, values) / counts
    return float((flux * (values - mean[group]).abs()).sum() / (flux * values).sum().clamp_min(1e-300))


def worst_ring(samples: Samples, flux: Tensor, found: Tensor) -> tuple[float, float, str]:
    """(light of a ring of θi or θo over what the fit and the rings beside it say, its share of the light, which).

    Farthest from 1; (1, 0, "") where directions lie on no rings.
    """
    worst = 1.0, 0.0, ""
    for name, direction in (("θi", samples.wi), ("θo", samples.wo)):
        rings = ring_numbers(direction)
        if rings is None:
            continue
        rank, count = rings
        own, mine = (
            torch.zeros(count, dtype=torch.float64).index_add_(0, rank, flux * values.mean(1))
            for values in (samples.values, found)
        )
        ratio = own / mine.clamp_min(1e-300)
        for ring in range(1, count - 1):
            beside = float(ratio[ring - 1] * ratio[ring + 1]) ** 0.5
            alone = max(float(ratio[ring]), 1e-6 * beside) / beside if beside > 0 else 1.0
            if abs(math.log(alone)) > abs(math.log(worst[0])):
                angle = float(torch.rad2deg(to_spherical(direction)[0][rank == ring].mean()))
                worst = alone, float(own[ring] / own.sum()), f"{name} = {angle:.3g}°"
    return worst


def largest_albedo(fit: Reflectance, isotropic: bool) -> float:
    """The largest ∫ f cosθo dωo over channels, `ALBEDO_DEGREES` and azimuths, by nodes that follow the lobe."""
    theta = torch.tensor(ALBEDO_DEGREES, dtype=torch.float64).deg2rad()
    found = 0.0
    for azimuth in light_azimuths(isotropic):
        wi = from_spherical(theta, torch.full_like(theta, azimuth))
        wo, solid = hemisphere_nodes(wi, _RINGS, _SPOKES)
        values = fit.evaluate(wi[:, None].expand_as(wo).reshape(-1, 3), wo.reshape(-1, 3)).double()
        albedos = (values.reshape(*solid.shape, -1) * (solid * wo[..., 2])[..., None]).sum(1)
        found = max(found, float(albedos.max()))
    return found


def light_of(fit: Reflectance, train: Samples) -> tuple[float, float]:
    """(asymmetry Σ|f(ωi, ωo) − f(ωo, ωi)| over the sum of both, share beyond the measurement) of the fit's light."""
    theta, weight = disc_nodes(_LEVELS)
    beyond = Beyond(train)
    apart = both = outside = whole = 0.0
    for azimuth in light_azimuths(train.isotropic):
        lit = from_spherical(theta, torch.full_like(theta, azimuth))
        found, solid = hemisphere_nodes(lit, _RINGS, _SPOKES)
        wo = found.reshape(-1, 3)
        wi = lit[:, None].expand_as(found).reshape(-1, 3)
        flux = (solid * found[..., 2] * weight[:, None]).reshape(-1)
        one, other = (fit.evaluate(*pair).double().mean(1) for pair in ((wi, wo), (wo, wi)))
        apart += float((flux * (one - other).abs()).sum())
        both += float((flux * (one + other)).sum())
        outside += float((flux * one)[~beyond.measured(wi, wo)].sum())
        whole += float((flux * one).sum())
    return (apart / both if both > 0 else 0.0), (outside / whole if whole > 0 else 0.0)


def asymmetry_of_samples(samples: Samples, flux: Tensor, seed: int) -> float | None:
    """Σ|f − f'| over Σ(f + f') of samples and those nearest to their swapped places, beyond what neighbours differ by.

    Within `NEAR` degrees; pairs whose swapped place is their own say nothing. Where the nearest sample of the swapped
    place is no farther off in value than the nearest of the sample's own place, that is 0: a highlight between two
    samples is no lack of reciprocity. None where fewer than `LEAST_IN_A_BAND` samples have a neighbour there.
    """
    chosen = torch.randperm(len(samples), generator=torch.Generator().manual_seed(seed))[:MOST_SAMPLES]
    some, flux = samples.select(chosen), flux[chosen]
    if samples.isotropic:
        here = angles_of_pairs(some.wi, some.wo)
        there = here[:, [1, 0, 2]]
    else:
        here, there = torch.cat((some.wi, some.wo), 1), torch.cat((some.wo, some.wi), 1)
    near = math.radians(NEAR)
    tree = KDTree(here.numpy())
    distance, swapped = tree.query(there.numpy(), distance_upper_bound=near)
    _, own = tree.query(here.numpy(), k=2)
    found = torch.from_numpy(np.isfinite(distance)) & ((here - there).norm(dim=1) > 2 * near)
    if int(found.sum()) < LEAST_IN_A_BAND:
        return None
    values, flux = some.values.mean(1), flux[found]

    def apart(other: np.ndarray) -> float:
        mine, theirs = values[found], values[torch.from_numpy(other)[found]]
        return float((flux * (mine - theirs).abs()).sum() / (flux * (mine + theirs)).sum().clamp_min(1e-300))

    return max(apart(np.asarray(swapped)) - apart(np.asarray(own)[:, 1]), 0.0)
