"""The terms of a material's in-out factors: singular functions of f, weighted for natural light, stored as maps.

Wang, Tran and Luebke (2004, equation 2) decompose each channel separately. Here all channels share the light maps, and
a view map has one value per channel, so one transport vector per term serves all channels. The best such sum is the
singular value decomposition of the matrices of the channels side by side, ωi × (ωo, channel). The cosine is not part of
f, as in Wang. It weights the error: columns by cosθo dωo, the projected area in a picture, and rows by f cosθi times
the expected light. Under white light, whose directions are independent of each other, the strongest functions of a
sharp lobe are bumps where f cosθi is largest, and a few of them miss most of the lobe's light. Natural light is smooth:
the variance of its spherical harmonics falls with their order l. The falloff 1/(l + 1) that is assumed here lies
between the flat spectrum of small lamps and the exponents of 2 to 2.5 that Dror, Willsky and Adelson (2004) find in the
logarithms of natural illumination. The rows are therefore projected onto the harmonics, each multiplied by its expected
amplitude. The strongest functions are then smooth, and leaving out the other terms only blurs a highlight.

An isotropic f is decomposed order by order of azimuth, f = Σ_m f_m(θi, θo) exp(im(φo − φi)); the two terms of one
order, cosine and sine, are kept or dropped together. A lobe may be far narrower than any function that a few terms can
represent. So f is not sampled on a grid but integrated against smooth functions (Galerkin): for each θi, against the
polynomials through `rings` Gauss nodes in θo. The nodes of these integrals are dense near the mirror direction and near
the direction of the light. The truncated terms then blur a highlight without losing its light. Between the nodes, g_k
and h_k are computed from f by the same integrals, g_k(ωi) = ∫ f(ωi, ωo) v_k(ωo) cosθo dωo/σ_k (Nyström). They are
stored on parabolic maps, bilinear in between, whose rim is the horizon. An anisotropic f is sampled on a grid of nodes.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.symmetry import Symmetry, find_symmetry
from homofact.errors import BadInput
from homofact.geometry.parabolic import from_disc
from homofact.relighting.factors import InOutFactors, fitted_texels, texel_points
from homofact.relighting.moments import moments
from homofact.rendering.light import EnvironmentMap
from homofact.theory.harmonics import harmonics, normalised_legendre, orders
from homofact.theory.in_out import DirectionGrid, count_for_share, evaluated
from homofact.theory.light_power import light_power

MOST_TERMS = 256
_ISOTROPIC_GRIDS = ((20, 40), (32, 64), (48, 96))
_ANISOTROPIC_GRIDS = ((12, 36), (18, 54), (24, 72))
# Radii of the table that an isotropic function is drawn from, for each texel of the map.
_FINE = 2
LIGHT_POWER, VIEW_POWER = 2.0, 1.0
FALLOFF = 1.0
# A measurement says nothing at the horizon itself, and models run away there.
_RIM = math.cos(math.radians(89.0))


@dataclass(frozen=True)
class WeightedTerms:
    """Singular values in descending order with their data; `sigma` (R,), `multiplicity` (R,) 1 or 2.

    `order` (R,) of azimuth. `right` (R, C, nodes) are the unit singular vectors of the view; `excited` (R, rows) is the
    light p that produces each of them, at the nodes of `rows`: σ v(ωo) = ∫ f p(ωi) cosθi dωi. `white` are the singular
    values for white light, repeated by their multiplicity. `sent` (R, L + 1) is the energy that each term reflects if
    every coefficient of order l has the power 1, and `total` (L + 1,) is its sum over all terms. `power` (L + 1,) is
    the power of the light by order. Errors are relative to the energy `whole`. Default: the energy of all terms.
    """

    grid: DirectionGrid
    rows: DirectionGrid
    sigma: Tensor
    multiplicity: Tensor
    order: Tensor
    excited: Tensor
    right: Tensor
    white: Tensor
    sent: Tensor
    total: Tensor
    power: Tensor
    isotropic: bool
    even: bool
    whole: float | None = None

    def under(self, light: EnvironmentMap | None) -> "WeightedTerms":
        """Return the same terms, with energies under this light."""
        return self if light is None else replace(self, power=light_power(light, len(self.power) - 1))

    @property
    def parts(self) -> Tensor:
        """Return the energy (R,) that each term reflects; the two terms of a pair are summed."""
        return (self.sent @ self.power) * self.multiplicity

    @property
    def energy(self) -> float:
        """Return the reflected energy of all terms, including those that are not stored."""
        return float(self.total @ self.power)

    def chosen(self, terms: int | None, share: float, error: float | None = None) -> list[int]:
        """Return the indices of the kept terms: the strongest ones, as many as the rule allows, pairs intact."""
        if error is not None:
            left = self.energy - self.parts.cumsum(0)
            enough = (left <= error**2 * (self.energy if self.whole is None else self.whole)).nonzero()
            first = int(enough[0, 0]) if len(enough) else len(left) - 1
            terms = min(int(self.multiplicity[: first + 1].sum()), MOST_TERMS)
        elif terms is None:
            terms = min(count_for_share(self.white, share), MOST_TERMS)
        room, picked = terms, []
        for k in range(len(self.sigma)):
            if room == 0 or float(self.sigma[k]) <= 1e-7 * float(self.sigma[0]):
                break
            if int(self.multiplicity[k]) <= room:
                picked.append(k)
                room -= int(self.multiplicity[k])
        return picked

    def drawn(self, reflectance: Reflectance, picked: list[int], size: int) -> InOutFactors:
        """Return the maps of the picked terms."""
        double = self.multiplicity[picked]
        draw = self._rings if self.isotropic else self._texels
        light, view = map(fitted_texels, draw(reflectance, picked, size))
        strength = (self.sent @ self.power)[picked].repeat_interleave(double)
        whole = self.energy if self.whole is None else self.whole
        return InOutFactors(
            light.float().numpy(), view.float().numpy(), strength.numpy(), whole, tuple(reflectance.channels),
            whole - self.energy,
        )  # fmt: skip

    def _rings(self, reflectance: Reflectance, picked: list[int], size: int) -> tuple[Tensor, Tensor]:
        """Return view and light maps from tables over the radius, multiplied by harmonics of the azimuth."""
        outgoing = _root(self.grid, VIEW_POWER)
        radius = torch.linspace(0, 1, _FINE * size + 1, dtype=torch.float64)
        theta = torch.acos(((1 - radius**2) / (1 + radius**2)).clamp_min(_RIM))
        order, sigma = self.order[picked], self.sigma[picked]
        seen = _complex(moments(reflectance, theta, self.grid, VIEW_POWER, even=self.even)[0][order])
        views = (self.right[picked] / outgoing).conj()
        g = torch.stack([torch.einsum("foc,co->f", *each) for each in zip(seen, views, strict=True)])
        sent = _complex(moments(reflectance, theta, self.rows, 1.0, True, self.even)[0][order])
        lights = self.excited[picked].conj()
        h = torch.stack([torch.einsum("fic,i->cf", *each) for each in zip(sent, lights, strict=True)])
        scale = (2 * math.pi * sigma).sqrt().to(g)
        g, h = g / scale[:, None], h / scale[:, None, None]
        uv = texel_points(size)
        rho, phi = uv.norm(dim=-1).clamp_max(1.0), torch.atan2(uv[..., 1], uv[..., 0])
        at = rho * (_FINE * size)
        low = at.long().clamp_max(_FINE * size - 1)
        part = (at - low).to(g)
        light, view = [], []
        for k, m in enumerate(order.tolist()):
            wave = torch.exp(1j * m * phi)
            a = (g[k][low] * (1 - part) + g[k][low + 1] * part) * wave.conj()
            b = (h[k][:, low] * (1 - part) + h[k][:, low + 1] * part) * wave
            b = b.permute(1, 2, 0)
            # Re(a b) = Re a Re b − Im a Im b; of ±m together twice that.
            twice = math.sqrt(2.0) if m else 1.0
            light.append(a.real * twice)
            view.append(b.real * twice)
            if m:
                light.append(a.imag * twice)
                view.append(-b.imag * twice)
        return torch.stack(light), torch.stack(view)

    def _texels(self, reflectance: Reflectance, picked: list[int], size: int) -> tuple[Tensor, Tensor]:
        """Return view and light maps computed directly at the texels."""
        uv = texel_points(size).reshape(-1, 2)
        # A texel beyond the rim is read by interpolation at the rim alone: it takes the rim's value.
        uv = uv / uv.norm(dim=1, keepdim=True).clamp_min(1.0)
        w = from_disc(uv)
        z = w[:, 2:].clamp_min(_RIM)
        w = torch.cat((w[:, :2] * ((1 - z**2) / (w[:, :2] ** 2).sum(1, keepdim=True).clamp_min(1e-300)).sqrt(), z), 1)
        outgoing = _roots(self.grid, VIEW_POWER)
        nodes = self.grid.directions().reshape(-1, 3)
        arriving = _roots(self.grid, 0) ** 2 * nodes[:, 2]
        sigma = self.sigma[picked].sqrt()[:, None]
        g, h = [], []
        for part in w.split(512):
            g.append(torch.einsum("toc,o,kco->kt", evaluated(reflectance, part, nodes), outgoing, self.right[picked]))
            h.append(torch.einsum("itc,i,ki->ktc", evaluated(reflectance, nodes, part), arriving, self.excited[picked]))
        light, view = torch.cat(g, 1) / sigma, torch.cat(h, 1) / sigma[..., None]
        return light.reshape(-1, size, size), view.reshape(len(view), size, size, -1)


def decompositions(reflectance: Reflectance) -> list[Callable[[], WeightedTerms]]:
    """Return functions that compute the terms of a reflectance, on finer and finer grids."""
    symmetry = find_symmetry(reflectance)
    split, grids = (_isotropic, _ISOTROPIC_GRIDS) if symmetry.isotropic else (_anisotropic, _ANISOTROPIC_GRIDS)
    return [partial(split, reflectance, DirectionGrid(*each, math.pi / 2), symmetry) for each in grids]


def _isotropic(reflectance: Reflectance, grid: DirectionGrid, symmetry: Symmetry) -> WeightedTerms:
    # Twice the rings for the rows: they must hold what f makes of the finest polynomial.
    rows = DirectionGrid(2 * grid.rings, grid.turns, math.pi / 2)
    incident, outgoing = _root(rows, LIGHT_POWER), _root(grid, VIEW_POWER)
    waves, squares = moments(reflectance, rows.theta, grid, VIEW_POWER, even=symmetry.mirrored)
    _check_energy(squares)
    waves = waves.permute(0, 1, 3, 2) * (incident[:, None, None] / outgoing)
    count, incidents, channels, rings = waves.shape
    matrices = waves.reshape(count, incidents, -1)
    order = torch.arange(count)[:, None]
    white = torch.linalg.svdvals(matrices)
    white = white.flatten().repeat_interleave((1 + (order > 0).long()).expand(white.shape).flatten())
    lights = _ring_lights(rows, count).to(matrices)
    arriving = lights * _root(rows, 0)[:, None]
    u, sigma, vh = torch.linalg.svd(arriving.mT @ matrices, full_matrices=False)
    order = order.expand(sigma.shape).flatten()
    multiplicity = 1 + (order > 0).long()
    power = _natural(lights.shape[2] - 1)
    sent = ((u * sigma[:, None]) ** 2).abs().mT.reshape(len(order), -1) / power
    total = (sent * multiplicity[:, None]).sum(0)
    excited, right = (lights @ u).mT.reshape(-1, incidents), vh.reshape(-1, channels, rings)
    place = sigma.flatten().argsort(descending=True, stable=True)[: 2 * MOST_TERMS]
    return WeightedTerms(
        grid,
        rows,
        sigma.flatten()[place],
        multiplicity[place],
        order[place],
        _complex(excited[place]),
        _complex(right[place]),
        white.sort(descending=True).values,
        sent[place],
        total,
        power,
        True,
        symmetry.mirrored,
    )


def _anisotropic(reflectance: Reflectance, grid: DirectionGrid, symmetry: Symmetry) -> WeightedTerms:
    nodes = grid.directions().reshape(-1, 3)
    values = evaluated(reflectance, nodes, nodes)
    _check_energy(values)
    incident, outgoing = _roots(grid, LIGHT_POWER), _roots(grid, VIEW_POWER)
    matrix = (values.permute(0, 2, 1) * (incident[:, None, None] * outgoing)).reshape(len(nodes), -1)
    white = torch.linalg.eigvalsh(matrix @ matrix.T).flip(0).clamp_min(0).sqrt()
    degree = 3 * grid.rings // 2
    power, degrees = _natural(degree), orders(degree)[0]
    lights = harmonics(degree, nodes) * power.sqrt()[degrees]
    matrix = (_roots(grid, 0)[:, None] * lights).T @ matrix
    # The eigenvectors of M Mᵀ: of its rows alone, whatever the channels.
    squares, u = torch.linalg.eigh(matrix @ matrix.T)
    count = min(2 * MOST_TERMS, len(squares))
    sigma, left = squares.flip(0).clamp_min(0).sqrt()[:count], u.flip(1).T[:count]
    right = ((left @ matrix) / sigma.clamp_min(1e-300)[:, None]).reshape(count, -1, len(nodes))
    single = torch.ones(count, dtype=torch.long)
    by_order = torch.zeros(degree + 1, count + 1, dtype=torch.float64)
    by_order.index_add_(0, degrees, torch.cat(((left * sigma[:, None]) ** 2, (matrix**2).sum(1)[None])).T)
    sent = by_order.T / power
    return WeightedTerms(
        grid, grid, sigma, single, 0 * single, left @ lights.T, right, white, sent[:-1], sent[-1], power, False, False
    )  # fmt: skip


def _natural(degree: int) -> Tensor:
    """Return the mean squares P_l (degree + 1,) of natural light's coefficients at order l, relative to l = 0."""
    return (1 + torch.arange(degree + 1, dtype=torch.float64)) ** -FALLOFF


def _ring_lights(rows: DirectionGrid, count: int) -> Tensor:
    """Return functions (m, rings, l) of θ whose outer product is natural light's covariance for each m.

    These are the harmonics √(2π) N_lm P_lm(cosθ), multiplied by the amplitude √P_l of natural light at l.
    """
    degree = 2 * len(rows.theta)
    values = normalised_legendre(degree, torch.cos(rows.theta)) * math.sqrt(2 * math.pi)
    return (values * _natural(degree).sqrt()[:, None, None])[:, :count].permute(1, 2, 0)


def _root(grid: DirectionGrid, power: float) -> Tensor:
    """Return √(cos^power θ sinθ dθ) at the rings."""
    return (grid.weights * torch.cos(grid.theta) ** power).sqrt()


def _roots(grid: DirectionGrid, power: float) -> Tensor:
    """Return √(cos^power θ dω) at the nodes of all azimuths as a flat array."""
    return (_root(grid, power) * math.sqrt(2 * math.pi / grid.turns)).repeat_interleave(grid.turns)


def _complex(values: Tensor) -> Tensor:
    return values if values.is_complex() else values + 0j


def _check_energy(values: Tensor) -> None:
    if not bool(values.any()):
        raise BadInput("the reflectance is 0 everywhere", where="relighting", expected="some light to be reflected")
