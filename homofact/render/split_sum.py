"""What a material reflects, as engines split it: a table over the viewer's angle, and lobes round one direction.

    ∫ f cosθi L dωi ≈ D(θo) E(n)/π + S(θo) P(m, θo),    m = norm(r + t(θo) n),    r = 2 (n·ωo) n − ωo,

per channel: E is the irradiance, P the light averaged over a lobe round m, whose shape the channels share (Karis 2013
has one lobe, that at normal incidence, round r). D is π times a low quantile of f over the hemisphere, weighted by
cosθi: what stands under the lobe. S takes all the rest, so that the albedo of every θo and channel is kept: where light
is the same from everywhere, the sum is exact. m is the mean direction of the rest, weighted by its square so that tails
do not pull it off a peak. The lobe is the rest's flux in rings round m, channels added, of some
θo = acos(k/(levels − 1)).

What is lost: lobes that are not round, as all are at grazing angles, those of brushed metals most; differences between
the channels' lobes; the horizon, which cuts the true lobe and not a ring.
"""

import math
from typing import NamedTuple

import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.symmetry import find_symmetry
from homofact.geometry.directions import from_spherical
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.render.surface import ToRgb, shader

LEVELS, COLUMNS, RINGS = 8, 64, 40
GRAZING = math.radians(89.0)  # what stands for θo = 90°, where nothing is seen
_QUANTILE = 0.3
_NODES = (64, 32)
_AZIMUTHS = 8


class Response(NamedTuple):
    """A material split: `diffuse` D and `scale` S (COLUMNS, C), `tilt` t (COLUMNS,) at even steps of cosθo from 0 to 1.

    `lobes` (levels, RINGS) are the shares of flux, of sum 1, in the rings of `ring_edges` at even steps of cosθo.
    """

    diffuse: Tensor
    scale: Tensor
    tilt: Tensor
    lobes: Tensor


def ring_edges(rings: int = RINGS) -> Tensor:
    """Angles (rings + 1,) in radians from 0 to π, fine at 0."""
    return math.pi * (torch.arange(rings + 1, dtype=torch.float64) / rings) ** 3


def response_of(
    reflectance: Reflectance, to_rgb: ToRgb | None = None, levels: int = LEVELS, columns: int = COLUMNS
) -> Response:
    """A material split; of an anisotropic one, the mean over the viewer's azimuths.

    Raises BadInput for channels that do not fit and values that are not finite.
    """
    shade = shader(reflectance, to_rgb)
    turns = 1 if find_symmetry(reflectance).isotropic else _AZIMUTHS
    steps = sorted({k / (columns - 1) for k in range(columns)} | {k / max(levels - 1, 1) for k in range(levels)})
    found = {step: _at(shade, min(math.acos(step), GRAZING), turns) for step in steps}
    table = [found[k / (columns - 1)] for k in range(columns)]
    lobes = [found[k / (levels - 1)][3] for k in range(levels)] if levels > 1 else [found[1.0][3]]
    diffuse, scale, tilt = (torch.stack([each[k] for each in table]) for k in range(3))
    return Response(diffuse, scale, tilt, torch.stack(lobes))


def _at(shade, theta: float, turns: int) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """(D (C,), S (C,), t (), shares (RINGS,)) for viewers at θo."""
    turn = torch.arange(turns, dtype=torch.float64) * (2 * math.pi / turns)
    wo = from_spherical(torch.full_like(turn, theta), turn)
    wi, angles = hemisphere_nodes(wo, *_NODES)
    seen = wo[:, None].expand_as(wi)
    f = shade(wi.reshape(-1, 3), seen.reshape(-1, 3)).reshape(*angles.shape, -1)
    # Side by side in one frame, the viewer at azimuth 0.
    cos, sin = turn.cos()[:, None], turn.sin()[:, None]
    wi = torch.stack((cos * wi[..., 0] + sin * wi[..., 1], cos * wi[..., 1] - sin * wi[..., 0], wi[..., 2]), -1)
    wi, f = wi.reshape(-1, 3), f.reshape(-1, f.shape[-1])
    weight = angles.reshape(-1) * wi[:, 2].clamp_min(0) / turns
    low = _quantile(f, weight)
    albedo = (f * weight[:, None]).sum(0)
    scale = (albedo - math.pi * low).clamp_min(0)
    diffuse = albedo - scale
    rest = ((f - low).mean(1).clamp_min(0)) * weight
    mirror = from_spherical(torch.tensor(theta), torch.tensor(math.pi)).to(wi)
    tilt = _tilt(wi, rest * (f - low).mean(1).clamp_min(0), mirror)
    towards = mirror + wi.new_tensor((0, 0, 1)) * tilt
    gamma = torch.acos((wi @ (towards / towards.norm())).clamp(-1, 1))
    ring = torch.bucketize(gamma, ring_edges()[1:-1])
    flux = torch.zeros(RINGS, dtype=torch.float64).index_add(0, ring, rest)
    total = float(flux.sum())
    if not total > 0:
        flux, total = torch.eye(RINGS, dtype=torch.float64)[0], 1.0
    return diffuse, scale, tilt, flux / total


def _quantile(f: Tensor, weight: Tensor) -> Tensor:
    """The quantile (C,) of values (N, C) by weights (N,), never negative."""
    found = []
    for channel in f.T:
        order = channel.argsort()
        running = weight[order].cumsum(0)
        found.append(channel[order][int(torch.searchsorted(running, _QUANTILE * running[-1]))])
    return torch.stack(found).clamp_min(0)


def _tilt(wi: Tensor, weight: Tensor, mirror: Tensor) -> Tensor:
    """t of the direction mirror + t n, in the plane of incidence, that is the mean of `wi` by `weight`."""
    mean = (wi * weight[:, None]).sum(0)
    if not float(mean.norm()) > 0 or not float(-mirror[0]) > 1e-3:
        return wi.new_zeros(())
    # Along the mirror's own horizontal part: (x, z) of the mean scaled to its x.
    across = float(mean[0] / mirror[0])
    return (
        wi.new_tensor(min(max(float(mean[2]) / across - float(mirror[2]), -0.5), 2.0))
        if across > 0
        else wi.new_zeros(())
    )
