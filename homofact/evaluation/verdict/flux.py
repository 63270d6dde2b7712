"""Figures of samples and fits, weighted by light.

A pair of directions is weighted by its flux, f cosθi cosθo times its solid angle (`brdf.pair_density.solid_angles`),
so dark and grazing pairs have little weight, as in a picture.
"""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.pair_density import solid_angles
from homofact.brdf.quality.extrapolation import Extrapolation
from homofact.brdf.quality.lit_rings import lit_rings
from homofact.brdf.quality.scatter import places_of
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.symmetry import light_azimuths, ring_numbers, swapped_neighbours
from homofact.geometry.coordinates import rusinkiewicz_angles
from homofact.geometry.directions import from_spherical, to_spherical
from homofact.geometry.nearest import tree_of
from homofact.geometry.quadrature import disc_nodes, hemisphere_nodes
from homofact.linear.robust import scale_of

ALBEDO_DEGREES = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0, 88.0)
STEADY_DEGREES = 45.0
BANDS = {"θi": (0, 15, 30, 45, 60, 75, 90), "θh": (0, 2, 5, 10, 20, 40, 90)}
LEAST_IN_A_BAND, LEAST_OF_THE_LIGHT = 30, 0.02
MOST_ANGLES = 12  # of incidence that have rows of their own
SURE = 2.0  # standard errors by which a band has to be off
BRIGHTEST = 0.1  # of the samples' light: what is called their highlight
BESIDE = 6
INNERMOST, LEAST_GRAZING = 8, 70.0
BASE_DEGREES = 20.0, 30.0
LEAST_HIDDEN, STEEPEST = 0.005, 1.9
_LEAST_ANGLE = 1e-4
LEAST_TIED = 3
OUTLIER, FEW_OUTLIERS = 6.0, 0.05
_SAME = 1e-6  # directions this near are one
_LEVELS, _RINGS, _SPOKES = 6, 32, 24


def flux_of(samples: Samples) -> Tensor:
    """Return cosθi cosθo times solid angle (N,), which turns f into flux, up to a common factor."""
    return solid_angles(samples) * samples.wi[:, 2] * samples.wo[:, 2]


def misplaced(flux: Tensor, expected: Tensor, found: Tensor) -> float:
    """Return the misplaced light Σ|f̂ − f|/Σ f, weighted by `flux`, as the mean of the channels' ratios."""
    own = (flux[:, None] * expected).sum(0)
    missed = (flux[:, None] * (found - expected).abs()).sum(0)
    return float((missed[own > 0] / own[own > 0]).mean()) if bool((own > 0).any()) else 0.0


def by_incidence(samples: Samples, flux: Tensor, found: Tensor) -> tuple[tuple[float, float, float], ...]:
    """Return rows (from, to, light of the fit / light of the samples), with θi in degrees, over all channels.

    If the samples of an angle of incidence lie on dense rings (`brdf.quality.lit_rings`), the angle has one row, over
    all azimuths of the light. If the samples have at most `MOST_ANGLES` angles with `LEAST_IN_A_BAND` samples each, and
    some of these angles have no dense rings, each angle has a row from its samples. Otherwise, without dense rings, the
    rows are bands of θi.
    """
    rows = []
    rings = lit_rings(samples)
    for degrees in sorted({round(ring.degrees, 1) for ring in rings}):
        own = light = 0.0
        for ring in rings:
            if round(ring.degrees, 1) == degrees:
                own += float(ring.weights @ samples.values[ring.index].mean(1))
                light += float(ring.weights @ found[ring.index].mean(1).to(ring.weights))
        if own > 0:
            rows.append((degrees, degrees, light / own))
    degrees = torch.rad2deg(to_spherical(samples.wi)[0]).round(decimals=3)
    own, fits = flux * samples.values.mean(1), flux * found.mean(1)
    angles, counts = degrees.unique(return_counts=True)
    each = len(angles) <= MOST_ANGLES and int(counts.min()) >= LEAST_IN_A_BAND
    # Rings know the light between their samples, but not all angles may have one.
    if len(rows) >= (len(angles) if each else 1):
        return tuple(rows)
    rows, bands = [], [(angle, angle) for angle in angles.tolist()] if each else list(pairwise(BANDS["θi"]))
    for low, high in bands:
        inside = (degrees >= low) & (degrees < high) | (degrees == low)
        light = float(own[inside].sum())
        if int(inside.sum()) >= LEAST_IN_A_BAND and light > 0:
            rows.append((float(low), float(high), float(fits[inside].sum()) / light))
    return tuple(rows)


def worst_band(
    samples: Samples, flux: Tensor, found: Tensor, names: Sequence[str] = tuple(BANDS)
) -> tuple[float, str] | None:
    """Return (light of the fit / light of the samples, place as text) of the worst band; None without a band.

    `names` selects bands of θi or θh. The ratio is computed for each channel, in bands with at least `LEAST_IN_A_BAND`
    samples and a share of at least `LEAST_OF_THE_LIGHT` of the light. `SURE` standard errors are subtracted from the
    difference, since it may be random.
    """
    theta_h, _, _ = rusinkiewicz_angles(samples.wi, samples.wo)
    angles = {"θi": to_spherical(samples.wi)[0], "θh": theta_h}
    own = flux[:, None] * samples.values
    missed = flux[:, None] * (found - samples.values)
    total = own.sum(0)
    best: tuple[float, str] | None = None
    for name in names:
        degrees = torch.rad2deg(angles[name])
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
    """Return fit/samples for the light of the brightest samples, which carry the share `BRIGHTEST`; None if too few.

    Samples are ranked by the mean of their neighbourhood, since a ranking by single values would select samples with
    large noise.
    """
    if len(samples) < 4 * BESIDE:
        return None
    place = places_of(samples).numpy()
    near = torch.from_numpy(np.asarray(tree_of(place).query(place, k=BESIDE + 1)[1]))
    order = samples.values.mean(1)[near].mean(1).sort(descending=True, stable=True).indices
    own = (flux * samples.values.mean(1))[order]
    count = int((own.cumsum(0) < BRIGHTEST * own.sum()).sum()) + 1
    if count < LEAST_IN_A_BAND:
        return None
    return float((flux * found.mean(1))[order[:count]].sum() / own[:count].sum())


def between_samples(samples: Samples, flux: Tensor) -> float:
    """Return the median relative excess of the brightest samples over their neighbours.

    The brightest samples are those that carry the share `BRIGHTEST` of the light. Each is compared with the mean of its
    `BESIDE` nearest neighbours. For an isotropic material, distances are in (√θh, θd), since samples at other angles of
    incidence also show the highlight. If the value of a bright sample is mostly gone at its neighbours, the highlight
    is narrower than the sampling, and its measured light is random.
    """
    if len(samples) < 4 * BESIDE:
        return 0.0
    values = samples.values.mean(1)
    order = values.sort(descending=True, stable=True).indices
    own = (flux * values)[order]
    count = int((own.cumsum(0) < BRIGHTEST * own.sum()).sum()) + 1
    place = places_of(samples).numpy()
    if samples.isotropic:
        theta_h, theta_d, _ = rusinkiewicz_angles(samples.wi, samples.wo)
        place = torch.stack((theta_h.clamp_min(0).sqrt(), theta_d), 1).numpy()
    _, near = tree_of(place).query(place[order[:count].numpy()], k=BESIDE + 1)
    beside = values[torch.from_numpy(np.asarray(near)[:, 1:])].mean(1)
    return float((1 - beside / values[order[:count]].clamp_min(1e-300)).clamp_min(0).median())


def rising(samples: Samples, flux: Tensor) -> float:
    """Return the exponent of the rise towards the mirror direction at the innermost samples, f ~ θh^(−exponent).

    The function compares the mean of the `INNERMOST` samples with the smallest θh with the mean at two to three times
    their θh, for θd below `LEAST_GRAZING`. One standard error is subtracted from the exponent. If the top of a
    highlight was measured, the values are flat there. If they still rise, the peak lies beyond the samples and its
    height is unknown. Returns 0 if there are too few samples, or if the rise, extrapolated to θh = 0, contains less
    than `LEAST_HIDDEN` of the light.
    """
    theta_h, theta_d, _ = rusinkiewicz_angles(samples.wi, samples.wo)
    upright = theta_d < math.radians(LEAST_GRAZING)
    order = theta_h[upright].argsort(stable=True)
    angle, values, flux = (
        values[upright][order] for values in (theta_h.clamp_min(_LEAST_ANGLE), samples.values.mean(1), flux)
    )
    if len(angle) < INNERMOST:
        return 0.0
    edge = float(angle[INNERMOST - 1])
    beside = (angle > 2 * edge) & (angle < 3 * edge)
    parts = values[:INNERMOST], values[beside]
    if min(len(part) for part in parts) < 4 or min(float(part.mean()) for part in parts) <= 0:
        return 0.0
    gap = float(angle[beside].log().mean() - angle[:INNERMOST].log().mean())
    inner, outer = (float(part.mean()) for part in parts)
    exponent = math.log(inner / outer) / gap
    chance = math.hypot(*(float(part.std() / part.mean()) / math.sqrt(len(part)) for part in parts)) / gap
    light = flux * values
    # ∫ θ^(1 − p) dθ over that of a constant: what a power of θh under 2 holds up to the edge.
    hidden = float(light[:INNERMOST].sum() / light.sum()) * 2 / (2 - min(exponent, STEEPEST))
    return exponent - chance if hidden > LEAST_HIDDEN else 0.0


def towards_the_mirror(samples: Samples) -> tuple[float, float]:
    """Return (θh in degrees of the outermost of the `INNERMOST` samples, their mean / the mean in `BASE_DEGREES`).

    Only samples with θd below `LEAST_GRAZING` count. The second number is 1 if one of the two sets is empty or dark, so
    no highlight was measured.
    """
    theta_h, theta_d, _ = (torch.rad2deg(angle) for angle in rusinkiewicz_angles(samples.wi, samples.wo))
    upright = theta_d < LEAST_GRAZING
    angle, values = theta_h[upright], samples.values.mean(1)[upright]
    if len(angle) < INNERMOST:
        return 90.0, 1.0
    order = angle.argsort(stable=True)[:INNERMOST]
    base = values[(angle >= BASE_DEGREES[0]) & (angle < BASE_DEGREES[1])]
    inner, outer = float(values[order].mean()), float(base.mean()) if len(base) else 0.0
    return float(angle[order[-1]]), inner / outer if min(inner, outer) > 0 else 1.0


def cut_light(flux: Tensor, expected: Tensor, is_cut: Tensor) -> float:
    """Return the share of the light at samples where the fit is clipped to zero (`is_cut`, (N, C)), worst channel."""
    light = flux[:, None] * expected
    return float(((light * is_cut).sum(0) / light.sum(0).clamp_min(1e-300)).max())


def standing_out(samples: Samples, flux: Tensor, found: Tensor, misses: Tensor) -> float:
    """Return the share of light by which outliers differ from the fit; 0 if they are more than `FEW_OUTLIERS`."""
    far = misses > OUTLIER * scale_of(misses)
    if float(far.double().mean()) > FEW_OUTLIERS:
        return 0.0
    light = flux * samples.values.mean(1)
    missed = flux * (found - samples.values).mean(1).abs()
    return float(missed[far].sum() / light.sum().clamp_min(1e-300))


def dark_light(samples: Samples, flux: Tensor) -> tuple[float, float, float]:
    """Return (share of samples that are zero in a channel, share of missing light, share of white light).

    The first two are for the worst channel. The missing light is what the zero samples would have with the value of the
    nearest nonzero sample. The third is the share of a white surface's light at the samples that are zero in all
    channels.
    """
    zero = samples.values == 0
    share, missing = float(zero.double().mean(0).max()), 0.0
    if share == 0:
        return 0.0, 0.0, 0.0
    white = float((flux * zero.all(1)).sum() / flux.sum().clamp_min(1e-300))
    place = places_of(samples).numpy()
    for channel in range(zero.shape[1]):
        gone = zero[:, channel]
        if not bool(gone.any()) or bool(gone.all()):
            continue
        there = ~gone
        _, near = tree_of(place[there.numpy()]).query(place[gone.numpy()])
        values = samples.values[there, channel]
        lost = float((flux[gone] * values[torch.from_numpy(np.asarray(near))]).sum())
        missing = max(missing, lost / (lost + float((flux[there] * values).sum())))
    return share, missing, white


def clipped_light(samples: Samples, flux: Tensor) -> float:
    """Return the share of light at samples with the largest value of their channel, for the worst channel.

    Only ties of at least `LEAST_TIED` samples count, and fewer than half of the samples: those of a constant BRDF do
    not.
    """
    largest = 0.0
    for values in samples.values.T:
        tied = (values == values.max()) & (values > 0)
        if LEAST_TIED <= int(tied.sum()) < len(values) / 2:
            largest = max(largest, float((flux * values)[tied].sum() / (flux * values).sum().clamp_min(1e-300)))
    return largest


def rounded_light(samples: Samples, flux: Tensor) -> float:
    """Return the mean error of rounding to equal steps, as a share of the light of the worst channel.

    The step is the smallest difference between two values, and the mean error is a quarter of it. It is negligible for
    values that are not rounded.
    """
    largest = 0.0
    for values in samples.values.T:
        levels = torch.unique(values)
        steps = levels.diff()
        steps = steps[steps > _SAME * levels[-1]]
        if len(levels) > 2 and len(steps) == len(levels) - 1:
            largest = max(largest, float(steps.min() / 4 * flux.sum() / (flux * values).sum().clamp_min(1e-300)))
    return largest


def differing_light(samples: Samples, flux: Tensor) -> float:
    """Return the share of light by which samples at the same two directions differ from their mean."""
    keys = (torch.cat((samples.wi, samples.wo), 1) / _SAME).round()
    _, group, counts = torch.unique(keys, dim=0, return_inverse=True, return_counts=True)
    if int(counts.max()) < 2:
        return 0.0
    values = samples.values.mean(1)
    mean = torch.zeros(len(counts), dtype=values.dtype).index_add_(0, group, values) / counts
    return float((flux * (values - mean[group]).abs()).sum() / (flux * values).sum().clamp_min(1e-300))


def worst_ring(samples: Samples, flux: Tensor, found: Tensor) -> tuple[float, float, str]:
    """Return (ratio, share of the light, name) of the ring of θi or θo that differs most from its neighbours.

    The ratio is samples/fit on the ring, divided by the geometric mean of samples/fit on the two adjacent rings.
    Returns (1, 0, "") if the directions do not lie on rings.
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


def albedos(fit: Reflectance, isotropic: bool) -> Tensor:
    """Return albedos ∫ f cosθo dωo (angles, azimuths, C) at `ALBEDO_DEGREES`, with nodes concentrated at the lobe."""
    theta = torch.tensor(ALBEDO_DEGREES, dtype=torch.float64).deg2rad()
    rows = []
    for azimuth in light_azimuths(isotropic):
        wi = from_spherical(theta, torch.full_like(theta, azimuth))
        wo, solid = hemisphere_nodes(wi, _RINGS, _SPOKES)
        values = fit.evaluate(wi[:, None].expand_as(wo).reshape(-1, 3), wo.reshape(-1, 3)).double()
        rows.append((values.reshape(*solid.shape, -1) * (solid * wo[..., 2])[..., None]).sum(1))
    return torch.stack(rows, 1)


def largest_step(found: Tensor) -> tuple[float, str]:
    """Return (ratio, place as text) of the neighbouring angles whose ratio of albedos is farthest from 1.

    The ratio is the albedo at an angle divided by the albedo at the next larger angle. Only angles up to
    `STEADY_DEGREES`
    count, where the albedo of a material hardly depends on the angle.
    """
    worst = 1.0, ""
    last = ALBEDO_DEGREES.index(STEADY_DEGREES)
    for one, degrees in enumerate(ALBEDO_DEGREES[:last]):
        here, there = found[one].reshape(-1), found[one + 1].reshape(-1)
        lit = there > 0
        if not bool(lit.any()):
            continue
        ratios = (here[lit] / there[lit]).clamp_min(1e-6)
        ratio = float(ratios[int(ratios.log().abs().argmax())])
        if abs(math.log(ratio)) > abs(math.log(worst[0])):
            worst = ratio, f"θi = {degrees:g}° over {ALBEDO_DEGREES[one + 1]:g}°"
    return worst


def light_of(fit: Reflectance, isotropic: bool, extrapolation: Extrapolation) -> tuple[float, float]:
    """Return (asymmetry Σ|f(ωi, ωo) − f(ωo, ωi)|/Σ of both, share outside the measured range) of the fit's light."""
    theta, weight = disc_nodes(_LEVELS)
    apart = both = outside = whole = 0.0
    for azimuth in light_azimuths(isotropic):
        lit = from_spherical(theta, torch.full_like(theta, azimuth))
        views, solid = hemisphere_nodes(lit, _RINGS, _SPOKES)
        wo = views.reshape(-1, 3)
        wi = lit[:, None].expand_as(views).reshape(-1, 3)
        flux = (solid * views[..., 2] * weight[:, None]).reshape(-1)
        one, other = (fit.evaluate(*pair).double().mean(1) for pair in ((wi, wo), (wo, wi)))
        apart += float((flux * (one - other).abs()).sum())
        both += float((flux * (one + other)).sum())
        outside += float((flux * one)[~extrapolation.measured(wi, wo)].sum())
        whole += float((flux * one).sum())
    return (apart / both if both > 0 else 0.0), (outside / whole if whole > 0 else 0.0)


def asymmetry_of_samples(samples: Samples, flux: Tensor, seed: int) -> float | None:
    """Return the asymmetry Σ|f − f'|/Σ(f + f') of the samples, minus the usual difference of neighbours.

    f' is the value of the sample nearest to the swapped directions (`brdf.symmetry.swapped_neighbours`). The result is
    0 if swapped neighbours differ no more than ordinary neighbours, since a highlight between two samples is no lack of
    reciprocity. Returns None if fewer than `LEAST_IN_A_BAND` samples have a swapped neighbour.
    """
    swapped = swapped_neighbours(samples, seed)
    paired = swapped.paired
    if int(paired.sum()) < LEAST_IN_A_BAND:
        return None
    _, own = swapped.tree.query(swapped.here.numpy(), k=2)
    values, flux = samples.values[swapped.chosen].mean(1), flux[swapped.chosen][paired]

    def apart(other: Tensor) -> float:
        mine, theirs = values[paired], values[other[paired]]
        return float((flux * (mine - theirs).abs()).sum() / (flux * (mine + theirs)).sum().clamp_min(1e-300))

    return max(apart(swapped.nearest) - apart(torch.from_numpy(np.asarray(own)[:, 1])), 0.0)
