"""Tabulate any reflectance in the adaptive parameterization of Dupuy and Jakob (2018), as an `AdaptiveTable`.

A microfacet model has f cosθo = F G D(m)/(4σ(ωi)), where F G varies little; the table M of `brdf.rgl` then holds F G.
The paper derives D from retroreflection, which few measurements cover and few fits reproduce. This module derives D
from all directions. The share of the reflected light that the microfacet normal m reflects is

    t(m | ωi) = 4 f(ωi, ωo) cosθo / a(ωi),    a(ωi) = ∫ f cosθo dωo,

D(m) is the mean of t over the incidences whose mirror direction at m is above the horizon, scaled to ∫ D cosθm dm = 1.
D concentrates the table's nodes near the highlight. M corrects the errors of D, since M equals f cosθo · 4σ/D exactly
at each node. σ(ωi) = ∫ D(m) max(0, m·ωi) dm. Visible normals have the density D(m) max(0, m·ωi)/σ where the mirror
direction is above the horizon, and 0 elsewhere, so only the last cell has nodes that are never visible.

Half of the nodes follow the visible normals. The other half are spread evenly over ωo, so that a diffuse base under a
sharp highlight gets nodes too. D, σ and the densities are computed from the mean of the channels.
"""

import math
from dataclasses import replace

import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.rgl import AdaptiveTable
from homofact.brdf.warp import MarginalConditional, bilinear
from homofact.errors import BadInput
from homofact.geometry.directions import draw_cosine_weighted, from_spherical

# M's nodes along a slice's sides and its incidences, isotropic and not: files of 7 MB and, in a quarter turn, 21 MB.
SIDE, THETAS = {True: 96, False: 64}, {True: 32, False: 16}
# Incidences go evenly in θ to just above the horizon, where values are held; azimuths are those of a whole turn.
_FLATTEST, _AZIMUTHS = math.radians(89), 32
# Columns of D; rows of D and σ; sides of the visible normals' density.
_FACETS, _ROUND, _NORMALS = 256, 64, 128
# The share of the nodes that are spread evenly over ωo.
_EVEN = 0.5
# Of a slice's mean importance.
_DIMMEST = 0.01
# Of D over its largest value: normals that reflect nothing still have a density.
_LEAST = 1e-9
_BATCH = 1 << 17
_TURNS = 500


def tabulated(
    reflectance: Reflectance,
    isotropic: bool,
    *,
    side: int | None = None,
    thetas: int | None = None,
    whole_turn: bool = False,
) -> AdaptiveTable:
    """Return the table of a reflectance, with `thetas` slices over θi of `side`² nodes each.

    The defaults are in `THETAS` and `SIDE`. An anisotropic table has slices at 32 azimuths over the whole turn. If
    values are equal after half a turn, or also after mirroring, it has only the slices in a half or a quarter turn,
    unless `whole_turn` is set. Raises BadInput for sides or slices below 2.
    """
    side, thetas = side or SIDE[isotropic], thetas or THETAS[isotropic]
    if min(side, thetas) < 2:
        raise BadInput(where="adaptive table", found=f"{thetas} slices of {side} nodes a side", expected="at least 2")
    phi = torch.zeros(1, dtype=torch.float64) if isotropic else azimuths(reflectance, whole_turn)
    theta = torch.linspace(0, _FLATTEST, thetas, dtype=torch.float64)
    ndf = _facets(reflectance, isotropic)
    sigma = _areas(ndf, isotropic)
    slices = [(f, t) for f in phi.tolist() for t in theta.tolist()]
    vndf = torch.stack([_visible(ndf, sigma, t, f, isotropic) for f, t in slices])
    shape = (len(phi), len(theta))
    empty = torch.zeros(*shape, side, side, len(reflectance.channels))
    vndf = vndf.reshape(*shape, *vndf.shape[1:])
    table = AdaptiveTable(theta, phi, ndf, sigma, vndf, empty, True, reflectance.channels)
    # Filled at the nodes of full precision, then stored in single.
    return replace(
        table,
        theta_i=theta.float(),
        phi_i=phi.float(),
        ndf=ndf.float(),
        sigma=sigma.float(),
        vndf=vndf.float(),
        table=_filled(table, reflectance).float(),
    )


def refilled(table: AdaptiveTable, reflectance: Reflectance) -> AdaptiveTable:
    """Return a table with the nodes, densities and channels of `table` and the values of another reflectance.

    Nodes whose viewer is below the horizon keep their old values, because interpolation blends these into values just
    above the horizon.
    """
    return replace(table, table=_filled(table, reflectance).to(table.table))


def _filled(table: AdaptiveTable, reflectance: Reflectance) -> Tensor:
    """M (F, T, R, C, channels) of a reflectance at the nodes of a table, float64."""
    rows, columns = table.table.shape[2:4]
    nodes = _grid(rows, columns)
    warp = MarginalConditional.of(table.vndf.flatten(0, 1))
    held, filled = table.table.flatten(0, 1), []
    slices = [(f, t) for f in table.phi_i.double().tolist() for t in table.theta_i.double().tolist()]
    for number, (f, t) in enumerate(slices):
        u = warp.sample(nodes, number)
        wi, wo = _pairs(u, t, f, table.isotropic)
        values = _with_cosine(reflectance, wi, wo)
        if table.jacobian:
            density = bilinear(table.ndf, u) / (4 * bilinear(table.sigma, _of_angles(t, f))[:1])
            values = values / density[:, None]
        filled.append(torch.where(wo[:, 2:] > 0, values, held[number].reshape(len(u), -1)))
    return torch.stack(filled).reshape(table.table.shape)


def importance(table: AdaptiveTable) -> Tensor:
    """Return the sampling weights (F, T, R, C) > 0 of the nodes: f cosθo dωo of each node's cell, scaled to mean 1.

    Equal steps of s contain equal shares of the density p of the visible normals in the unit square, so the weight is f
    cosθo · 4 m·ωi dm/du / p with dm/du = 2π² u sinθm. Weights are at least 1% of the mean of their slice, which bounds
    the weight of rarely drawn samples.
    """
    rows, columns = table.table.shape[2:4]
    # At the edges the density may vanish: what a node stands for lies within.
    inset = torch.tensor([1 / (columns - 1), 1 / (rows - 1)], dtype=torch.float64) / 4
    nodes = _grid(rows, columns).clamp(inset, 1 - inset)
    warp = MarginalConditional.of(table.vndf.flatten(0, 1))
    ratios = []
    slices = [(f, t) for f in table.phi_i.double().tolist() for t in table.theta_i.double().tolist()]
    for number, (f, t) in enumerate(slices):
        u = warp.sample(nodes, number)
        wi, wo = _pairs(u, t, f, table.isotropic)
        half = wi + wo
        towards = (wi * half).sum(1).clamp_min(0) / half.norm(dim=1).clamp_min(1e-12)
        area = 4 * towards * (2 * math.pi**2) * u[:, 0] * torch.sin(_angles(u)[0])
        density = bilinear(warp.density[number], u)
        value = table.table.flatten(0, 1)[number].double().mean(-1).reshape(-1)
        if table.jacobian:
            value = value * bilinear(table.ndf, u) / (4 * bilinear(table.sigma, _of_angles(t, f))).clamp_min(1e-12)
        ratios.append(torch.where(density > 0, value.clamp_min(0) * area / density.clamp_min(1e-300), 0.0))
    weights = torch.stack(ratios)
    mean = weights.mean(1, keepdim=True)
    weights = torch.where(mean > 0, weights.maximum(mean * _DIMMEST), 1.0)
    return (weights / weights.mean()).reshape(*table.table.shape[:4])


def relative_differences(source: Reflectance, table: Reflectance, pairs: int) -> tuple[float, float]:
    """Return (median, 99th percentile) of |table − source|/source of the channel means at cosine-weighted pairs.

    The divisor is at least a thousandth of the mean of the source, so values of zero cause no division by zero. Both
    results are 0 if the source reflects nothing.
    """
    wi, wo = draw_cosine_weighted(pairs, torch.Generator().manual_seed(0))
    wanted, tabled = (reflectance.evaluate(wi, wo).double().mean(1) for reflectance in (source, table))
    mean = float(wanted.mean())
    if mean <= 0:
        return 0.0, 0.0
    apart = (tabled - wanted).abs() / wanted.clamp_min(1e-3 * mean)
    return float(apart.median()), float(apart.quantile(0.99))


def azimuths(reflectance: Reflectance, whole_turn: bool = False) -> Tensor:
    """Return the azimuths (F,) of slices from −π over a whole, half or quarter turn, by the values' symmetry."""
    generator = torch.Generator().manual_seed(0)
    u = torch.rand(2, _TURNS, 2, generator=generator, dtype=torch.float64)
    wi, wo = (from_spherical(part[:, 0] * (math.pi / 2), part[:, 1] * (2 * math.pi)) for part in u)

    def same(*signs: int) -> bool:
        change = torch.tensor([*signs, 1], dtype=torch.float64)
        values = [reflectance.evaluate(*pair) for pair in ((wi, wo), (wi * change, wo * change))]
        return bool(torch.allclose(*values, rtol=1e-5, atol=1e-9 * float(values[0].abs().max())))

    cover = 1
    if not whole_turn and same(-1, -1):
        cover = 4 if same(1, -1) else 2
    return torch.linspace(-math.pi, -math.pi + 2 * math.pi / cover, _AZIMUTHS // cover + 1, dtype=torch.float64)


def _angles(u: Tensor) -> tuple[Tensor, Tensor]:
    """θ and φ in radians of points (N, 2) of the unit square."""
    return u[:, 0] ** 2 * (math.pi / 2), (u[:, 1] - 0.5) * (2 * math.pi)


def _of_angles(theta: float, phi: float) -> Tensor:
    return torch.tensor([[math.sqrt(theta * 2 / math.pi), (phi / (2 * math.pi) + 0.5) % 1]], dtype=torch.float64)


def _grid(rows: int, columns: int) -> Tensor:
    """The nodes (rows · columns, 2) of a table over the unit square."""
    x, y = (torch.linspace(0, 1, n, dtype=torch.float64) for n in (columns, rows))
    return torch.stack(torch.meshgrid(x, y, indexing="xy"), -1).reshape(-1, 2)


def _pairs(u: Tensor, theta: float, phi: float, isotropic: bool) -> tuple[Tensor, Tensor]:
    """ωi and ωo (N, 3) for normals at u; ωo may lie under the horizon."""
    theta_m, phi_m = _angles(u)
    m = from_spherical(theta_m, phi_m + phi if isotropic else phi_m)
    at = torch.tensor([theta, phi], dtype=torch.float64)
    wi = from_spherical(at[:1], at[1:]).expand_as(m)
    return wi, 2 * (wi * m).sum(1, keepdim=True) * m - wi


def _with_cosine(reflectance: Reflectance, wi: Tensor, wo: Tensor) -> Tensor:
    """f cosθo (N, C), 0 where ωo is under the horizon."""
    values = torch.zeros(len(wi), len(reflectance.channels), dtype=torch.float64)
    above = (wo[:, 2] > 0).nonzero()[:, 0]
    for rows in above.split(_BATCH):
        values[rows] = reflectance.evaluate(wi[rows].contiguous(), wo[rows]).double() * wo[rows, 2:]
    return values


def _facets(reflectance: Reflectance, isotropic: bool) -> Tensor:
    """D (R, C) in sr⁻¹ of the module's head; two equal rows where isotropic."""
    rows = 16 if isotropic else _ROUND
    u = _grid(rows, _FACETS)
    # To the last slice: normals that are seen at grazing incidence alone would else have next to no density, and M,
    # which is divided by it, be so large beside them that nothing in between is right.
    thetas = [*torch.linspace(0.05, 1.45, 8 if isotropic else 6, dtype=torch.float64).tolist(), 1.5, _FLATTEST]
    around = [0.0] if isotropic else torch.linspace(-math.pi, math.pi, 13, dtype=torch.float64)[1:].tolist()
    total = torch.zeros(len(u), dtype=torch.float64)
    count = torch.zeros(len(u), dtype=torch.float64)
    size = _solid_angles(rows, _FACETS)
    for theta in thetas:
        for azimuth in around:
            wi, wo = _pairs(u, theta, azimuth, isotropic)
            seen = wo[:, 2] > 0
            share = _with_cosine(reflectance, wi, wo).mean(1) * 4
            towards = (wi * (wi + wo)).sum(1).clamp_min(0) / (wi + wo).norm(dim=1).clamp_min(1e-12)
            albedo = float((share * towards * size).sum())
            if albedo > 0:
                total += share / albedo
                count += seen
    total, count = (sums.reshape(rows, _FACETS) for sums in (total, count))
    if isotropic:
        weights = torch.ones(rows, 1, dtype=torch.float64)
        weights[[0, -1]] = 0.5
        total, count = ((sums * weights).sum(0).expand(2, -1) for sums in (total, count))
    mean = torch.where(count > 0, total / count.clamp_min(1e-9), 0.0)
    if not isotropic:
        # The first and the last row are one azimuth; at the normal all azimuths are one.
        mean[0] = mean[-1] = (mean[0] + mean[-1]) / 2
        mean[:, 0] = mean[:-1, 0].mean()
    # The mirror directions at the last columns are all under the horizon.
    visible = (count > 0).any(0).nonzero()
    last = int(visible.max()) if len(visible) else _FACETS - 1
    mean = torch.cat((mean[:, : last + 1], mean[:, [last]].expand(-1, _FACETS - last - 1)), 1)
    highest = float(mean.max())
    mean = mean.clamp_min(_LEAST * highest) if highest > 0 else torch.ones_like(mean)
    theta_m = _angles(_grid(*mean.shape))[0].reshape(mean.shape)
    return mean / (mean * torch.cos(theta_m) * _solid_angles(*mean.shape).reshape(mean.shape)).sum()


def _solid_angles(rows: int, columns: int) -> Tensor:
    """Return the solid angle of each node's cell in steradians, (rows · columns,), by the trapezoidal rule in u.

    dω = sinθ dθ dφ = 2π² u sinθ du dv.
    """
    u = _grid(rows, columns)
    theta = _angles(u)[0]
    ends = [torch.ones(n, dtype=torch.float64) for n in (rows, columns)]
    for line in ends:
        line[[0, -1]] = 0.5
    weights = (ends[0][:, None] * ends[1]).reshape(-1) / ((rows - 1) * (columns - 1))
    return weights * (2 * math.pi**2) * u[:, 0] * torch.sin(theta)


def _areas(ndf: Tensor, isotropic: bool) -> Tensor:
    """σ (R, C) = ∫ D(m) max(0, m·ωi) dm at the nodes of a table."""
    rows = 2 if isotropic else _ROUND
    fine = _grid(_ROUND + 1, _FACETS)
    theta, phi = _angles(fine)
    m = from_spherical(theta, phi)
    weights = bilinear(ndf, fine) * _solid_angles(_ROUND + 1, _FACETS)
    wi = from_spherical(*_angles(_grid(rows, _NORMALS)))
    return torch.cat([(part @ m.T).clamp_min(0) @ weights for part in wi.split(256)]).reshape(rows, _NORMALS)


def _visible(ndf: Tensor, sigma: Tensor, theta: float, phi: float, isotropic: bool) -> Tensor:
    """The visible normals' density (R, C) over the unit square, seen from one incidence."""
    u = _grid(_NORMALS, _NORMALS)
    wi, wo = _pairs(u, theta, phi, isotropic)
    theta_m = _angles(u)[0]
    half = wi + wo
    towards = (wi * half).sum(1) / half.norm(dim=1).clamp_min(1e-12)
    density = (1 - _EVEN) * bilinear(ndf, u) / bilinear(sigma, _of_angles(theta, phi)) + _EVEN * 4 / (2 * math.pi)
    density = density * torch.where(wo[:, 2] > 0, towards, 0.0)
    return (density * (2 * math.pi**2) * u[:, 0] * torch.sin(theta_m)).reshape(_NORMALS, _NORMALS)
