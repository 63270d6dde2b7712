"""In-out factors of a material: f(ωi, ωo) ≈ Σ_k g_k(ωi) h_k(ωo), as light maps and view maps.

Wang, Tran and Luebke (2004) decompose each channel by itself, (2). Here all channels share the light maps, and a view
map has a value a channel: one transport vector a term serves them all. The best such sum is the singular value
decomposition of the matrices of the channels side by side, ωi × (ωo, channel). The cosine stays out of f, as in Wang.
It weights the error: rows by cos²θi dωi, for light from everywhere errs by f cosθi, and columns by cosθo dωo, the area
that a surface takes in a picture. Weighted by cosθ on both sides, as on Wang's maps, the first terms are spent on f's
rise towards the horizon.

An isotropic f is decomposed order by order of azimuth, f = Σ_m f_m(θi, θo) exp(im(φo − φi)); a pair of terms of one
order, cosine and sine, is kept whole or not at all. A lobe may be far narrower than any function that a few terms can
hold. So f is not sampled on a grid but integrated against such functions (Galerkin): for each θi over nodes that crowd
towards the mirror direction and towards the light, against the polynomials through `rings` Gauss nodes in θo. What is
left out then blurs a highlight and keeps its light. Between the nodes g_k and h_k are asked of f by the same integrals,
g_k(ωi) = ∫ f(ωi, ωo) v_k(ωo) cosθo dωo/σ_k (Nyström). They are stored on parabolic maps, bilinear in between, whose rim
is the horizon. An anisotropic f is sampled on a grid of nodes.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.symmetry import Symmetry, find_symmetry
from homofact.errors import BadInput
from homofact.geometry.directions import from_spherical
from homofact.geometry.parabolic import from_disc, to_disc
from homofact.linear.threads import one_thread
from homofact.scene.harmonics import check_share, gauss_legendre
from homofact.scene.in_out import Grid, evaluated, polynomial

MAP_SIZE = 64
MOST_TERMS = 256
_ISOTROPIC_GRIDS = ((20, 40), (32, 64), (48, 96))
_ANISOTROPIC_GRIDS = ((12, 36), (18, 54), (24, 72))
# Radii of the table that an isotropic function is drawn from, for each texel of the map.
_FINE = 4
# Gauss nodes of each half of a crowded interval, and the power by which they crowd.
_NODES, _CROWDING = 24, 3
LIGHT_POWER, VIEW_POWER = 2.0, 1.0
# A measurement says nothing at the horizon itself, and models run away there.
_RIM = math.cos(math.radians(89.0))


@dataclass(frozen=True)
class InOutFactors:
    """Light maps `light` (K, M, M) and view maps `view` (K, M, M, C), float32, f in sr⁻¹ without the cosine.

    `strength` (K,) is each term's part of `energy`, ∫∫ Σ_c f² cos²θi cosθo dωi dωo. Texel (i, j) lies at
    (2(i + ½)/M − 1, 2(j + ½)/M − 1) of the parabolic disc (u, v). A `Reflectance`.
    """

    light: np.ndarray
    view: np.ndarray
    strength: np.ndarray
    energy: float
    channels: tuple[str, ...]

    @property
    def terms(self) -> int:
        """K."""
        return len(self.light)

    @property
    def share(self) -> float:
        """The part of the energy that the terms hold."""
        return float(self.strength.sum() / self.energy)

    @property
    def nbytes(self) -> int:
        """All maps as float32."""
        return self.light.nbytes + self.view.nbytes

    @property
    def fetches(self) -> int:
        """A light map and a view map a term."""
        return 2 * self.terms

    @cached_property
    def packed_view(self) -> np.ndarray:
        """The view maps with a texel's numbers side by side: (M, M, K, C) float32."""
        return np.ascontiguousarray(self.view.transpose(1, 2, 0, 3))

    @cached_property
    def weights(self) -> np.ndarray:
        """The root mean square (K,) float32 of each term's view map: what an error of its transport counts for."""
        return np.sqrt((self.view.astype(np.float64) ** 2).mean((1, 2, 3))).astype(np.float32)

    def first(self, terms: int) -> "InOutFactors":
        """The strongest `terms` alone."""
        return InOutFactors(self.light[:terms], self.view[:terms], self.strength[:terms], self.energy, self.channels)

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Values (N, C) of the maps in sr⁻¹, negative ones included; 0 under the horizon."""
        above = (wi[:, 2] > 0) & (wo[:, 2] > 0)
        g = look_up(torch.from_numpy(self.light).permute(1, 2, 0).double(), wi.double())
        h = look_up(torch.from_numpy(self.packed_view).flatten(2).double(), wo.double())
        values = torch.einsum("nk,nkc->nc", g, h.reshape(len(h), self.terms, -1))
        return torch.where(above[:, None], values, 0.0).to(wi)


@one_thread
def factor(
    reflectance: Reflectance, terms: int | None = None, share: float = 0.99, map_size: int = MAP_SIZE
) -> InOutFactors:
    """The factors of a reflectance of 1 or 3 channels: `terms` of them, or as many as hold `share` of the energy.

    `MOST_TERMS` at most. Raises BadInput for terms outside 1 to `MOST_TERMS` and more than there are, a share outside
    (0, 1), maps of fewer than 8 texels across, and a reflectance without energy or with values that are not finite.
    """
    if terms is not None and not 1 <= terms <= MOST_TERMS:
        raise BadInput(f"terms: found {terms}, expected 1 to {MOST_TERMS}")
    check_share(share)
    if not 8 <= map_size <= 256:
        raise BadInput(f"map size: found {map_size}, expected 8 to 256 texels across")
    if len(reflectance.channels) not in (1, 3):
        raise BadInput(f"relighting: found {len(reflectance.channels)} channels, expected 1 or 3")
    symmetry = find_symmetry(reflectance)
    grids = _ISOTROPIC_GRIDS if symmetry.isotropic else _ANISOTROPIC_GRIDS
    split = _isotropic if symmetry.isotropic else _anisotropic
    before, found = None, None
    for rings, turns in grids:
        found = split(reflectance, Grid(rings, turns, math.pi / 2), symmetry)
        count = len(found.chosen(terms, share))
        # Settled where the next finer grid finds the same: the number of terms, or with a given one their share.
        now = float(count) if terms is None else found.kept(terms, share)
        if before is not None and abs(now - before) <= (max(1.0, 0.03 * now) if terms is None else 0.002):
            break
        before = now
    assert found is not None
    return found.drawn(reflectance, found.chosen(terms, share), map_size)


@dataclass(frozen=True)
class _Terms:
    """Singular values in falling order with what each needs; `sigma` (R,), `multiplicity` (R,) 1 or 2.

    `order` (R,) of azimuth, `left` (R, nodes) and `right` (R, C, nodes) the unit singular vectors, divided by nothing.
    """

    grid: Grid
    rows: Grid
    sigma: Tensor
    multiplicity: Tensor
    order: Tensor
    left: Tensor
    right: Tensor
    energy: float
    isotropic: bool

    def chosen(self, terms: int | None, share: float) -> list[int]:
        """Which are kept: as many as the share asks for; or greedily, a pair only where there is room for both."""
        if terms is None:
            running = (self.sigma**2 * self.multiplicity).cumsum(0)
            # Of what this grid resolves: on it the terms' own sum is the energy.
            count = int((running < share * running[-1]).sum()) + 1
            while int(self.multiplicity[:count].sum()) > MOST_TERMS:
                count -= 1
            return list(range(count))
        room, picked = terms, []
        for k in range(len(self.sigma)):
            if room == 0 or float(self.sigma[k]) <= 1e-7 * float(self.sigma[0]):
                break
            if int(self.multiplicity[k]) <= room:
                picked.append(k)
                room -= int(self.multiplicity[k])
        return picked

    def kept(self, terms: int | None, share: float) -> float:
        """The part of the energy in the chosen ones."""
        picked = self.chosen(terms, share)
        return float((self.sigma**2 * self.multiplicity)[picked].sum()) / self.energy

    def drawn(self, reflectance: Reflectance, picked: list[int], size: int) -> InOutFactors:
        """The maps of the chosen ones."""
        sigma, double = self.sigma[picked], self.multiplicity[picked]
        draw = self._rings if self.isotropic else self._texels
        light, view = draw(reflectance, picked, size)
        strength = (sigma**2).repeat_interleave(double) if self.isotropic else sigma**2
        return InOutFactors(
            light.float().numpy(), view.float().numpy(), strength.numpy(), self.energy, tuple(reflectance.channels)
        )

    def _rings(self, reflectance: Reflectance, picked: list[int], size: int) -> tuple[Tensor, Tensor]:
        """From tables over the radius times the waves of the azimuth."""
        incident, outgoing = _root(self.rows, LIGHT_POWER), _root(self.grid, VIEW_POWER)
        radius = torch.linspace(0, 1, _FINE * size + 1, dtype=torch.float64)
        theta = torch.acos(((1 - radius**2) / (1 + radius**2)).clamp_min(_RIM))
        order, sigma = self.order[picked], self.sigma[picked]
        seen = _moments(reflectance, theta, self.grid, VIEW_POWER)[0][order]
        views = (self.right[picked] / outgoing).conj()
        g = torch.stack([torch.einsum("foc,co->f", *each) for each in zip(seen, views, strict=True)])
        sent = _moments(reflectance, theta, self.rows, LIGHT_POWER, swapped=True)[0][order]
        lights = (self.left[picked] / incident).conj()
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
        """Straight at the texels."""
        uv = texel_points(size).reshape(-1, 2)
        # A texel beyond the rim is read by interpolation at the rim alone: it takes the rim's value.
        uv = uv / uv.norm(dim=1, keepdim=True).clamp_min(1.0)
        w = from_disc(uv)
        z = w[:, 2:].clamp_min(_RIM)
        w = torch.cat((w[:, :2] * ((1 - z**2) / (w[:, :2] ** 2).sum(1, keepdim=True).clamp_min(1e-300)).sqrt(), z), 1)
        incident, outgoing = _roots(self.grid, LIGHT_POWER), _roots(self.grid, VIEW_POWER)
        nodes = self.grid.directions().reshape(-1, 3)
        sigma = self.sigma[picked].sqrt()[:, None]
        g, h = [], []
        for part in w.split(512):
            g.append(torch.einsum("toc,o,kco->kt", evaluated(reflectance, part, nodes), outgoing, self.right[picked]))
            h.append(torch.einsum("itc,i,ki->ktc", evaluated(reflectance, nodes, part), incident, self.left[picked]))
        light, view = torch.cat(g, 1) / sigma, torch.cat(h, 1) / sigma[..., None]
        return light.reshape(-1, size, size), view.reshape(len(view), size, size, -1)


def _isotropic(reflectance: Reflectance, grid: Grid, symmetry: Symmetry) -> _Terms:
    # Twice the rings for the rows: they must hold what f makes of the finest polynomial.
    rows = Grid(2 * grid.rings, grid.turns, math.pi / 2)
    incident, outgoing = _root(rows, LIGHT_POWER), _root(grid, VIEW_POWER)
    waves, squares = _moments(reflectance, rows.theta, grid, VIEW_POWER, even=symmetry.mirrored)
    _check_energy(squares)
    energy = 2 * math.pi * float(squares @ incident**2)
    waves = waves.permute(0, 1, 3, 2) * (incident[:, None, None] / outgoing)
    orders, incidents, channels, rings = waves.shape
    matrices = waves.reshape(orders, incidents, -1)
    if symmetry.mirrored:
        matrices = matrices.real
    u, sigma, vh = torch.linalg.svd(matrices, full_matrices=False)
    order = torch.arange(orders)[:, None].expand(sigma.shape).reshape(-1)
    left, right = u.mT.reshape(-1, incidents), vh.reshape(-1, channels, rings)
    place = sigma.reshape(-1).argsort(descending=True, stable=True)[: 2 * MOST_TERMS]
    return _Terms(
        grid,
        rows,
        sigma.reshape(-1)[place],
        1 + (order[place] > 0).long(),
        order[place],
        _complex(left[place]),
        _complex(right[place]),
        energy,
        True,
    )


def _anisotropic(reflectance: Reflectance, grid: Grid, symmetry: Symmetry) -> _Terms:
    nodes = grid.directions().reshape(-1, 3)
    values = evaluated(reflectance, nodes, nodes)
    _check_energy(values)
    incident, outgoing = _roots(grid, LIGHT_POWER), _roots(grid, VIEW_POWER)
    matrix = (values.permute(0, 2, 1) * (incident[:, None, None] * outgoing)).reshape(len(nodes), -1)
    # The eigenvectors of M Mᵀ: of its nodes alone, whatever the channels.
    power, u = torch.linalg.eigh(matrix @ matrix.T)
    sigma = power.flip(0).clamp_min(0).sqrt()[: 2 * MOST_TERMS]
    left = u.flip(1).T[: 2 * MOST_TERMS]
    right = (left @ matrix) / sigma.clamp_min(1e-300)[:, None]
    count = len(sigma)
    return _Terms(
        grid,
        grid,
        sigma,
        torch.ones(count, dtype=torch.long),
        torch.zeros(count, dtype=torch.long),
        left,
        right.reshape(count, -1, len(nodes)),
        float((matrix**2).sum()),
        False,
    )


def texel_points(size: int) -> Tensor:
    """(u, v) of a map's texel centres (M, M, 2), float64."""
    along = 2 * (torch.arange(size, dtype=torch.float64) + 0.5) / size - 1
    return torch.stack(torch.meshgrid(along, along, indexing="ij"), -1)


def look_up(maps: Tensor, w: Tensor) -> Tensor:
    """Bilinear values (N, P) of maps (M, M, P) at directions (N, 3)."""
    size = len(maps)
    at = ((to_disc(torch.cat((w[:, :2], w[:, 2:].clamp_min(0)), 1)) + 1) / 2 * size - 0.5).clamp(0, size - 1)
    low = at.long().clamp_max(size - 2)
    (i, j), (a, b) = low.unbind(1), (at - low)[..., None].unbind(1)
    near = maps[i, j] * (1 - b) + maps[i, j + 1] * b
    far = maps[i + 1, j] * (1 - b) + maps[i + 1, j + 1] * b
    return near * (1 - a) + far * a


def _moments(
    reflectance: Reflectance, theta: Tensor, grid: Grid, power: float, swapped: bool = False, even: bool = False
) -> tuple[Tensor, Tensor]:
    """(∫ f p_q(θo) exp(−imφ) cosθo dωo (m, T, rings, C) complex, ∫ Σ_c f² cosθo dωo (T,)) for light from θ, φi = 0.

    p_q are the polynomials through the grid's rings, m goes below half its turns. `swapped` integrates over ωi for a
    view from θ at azimuth 0 instead, against exp(+imφ). An `even` f is asked on one side of the plane alone.
    """
    crowded, weights = _crowded()
    phi = torch.cat((crowded, 2 * math.pi - crowded.flip(0))) if not even else crowded
    turn = weights.repeat(2) if not even else 2 * weights
    order = torch.arange((grid.turns + 1) // 2, dtype=torch.float64)
    # The sign of an azimuth difference φo − φi: it is the light that is turned where swapped.
    wave = torch.exp(1j * order[:, None] * phi * (1 if swapped else -1)) * turn
    wave = torch.cos(order[:, None] * phi) * turn + 0j if even else wave
    moments, squares = [], []
    for each in theta.tolist():
        # Crowded on both sides of θ itself, by its shares of the quarter turn.
        low, high = each, math.pi / 2 - each
        other = torch.cat((each - low * crowded.flip(0) / math.pi, each + high * crowded / math.pi))
        width = torch.cat((low * weights.flip(0), high * weights)) / math.pi
        fixed = torch.tensor([math.sin(each), 0.0, math.cos(each)], dtype=torch.float64)
        w = from_spherical(other[:, None].expand(-1, len(phi)), phi.expand(len(other), -1)).reshape(-1, 3)
        here = fixed.expand(len(w), 3)
        values = reflectance.evaluate(*((w, here) if swapped else (here, w))).double()
        if not bool(torch.isfinite(values).all()):
            raise BadInput("relighting: the reflectance has values that are not finite, expected finite numbers")
        values = values.reshape(len(other), len(phi), -1)
        ring = width * torch.sin(other) * torch.cos(other) ** power
        against = polynomial(grid, from_spherical(other, torch.zeros_like(other))) * ring[:, None]
        moments.append(torch.einsum("mp,opc,oq->mqc", wave, values + 0j, against + 0j))
        squares.append(torch.einsum("opc,o,p->", values**2, ring, turn))
    return torch.stack(moments, 1), torch.stack(squares)


def _crowded() -> tuple[Tensor, Tensor]:
    """Nodes and weights of ∫ over [0, π] that crowd towards both ends: x = (π/2) s³ of Gauss nodes s."""
    s, weights = gauss_legendre(_NODES, 0.0, 1.0)
    x = math.pi / 2 * s**_CROWDING
    weights = math.pi / 2 * _CROWDING * s ** (_CROWDING - 1) * weights
    return torch.cat((x, math.pi - x.flip(0))), torch.cat((weights, weights.flip(0)))


def _root(grid: Grid, power: float) -> Tensor:
    """√(cos^power θ sinθ dθ) at the rings."""
    return (grid.weights * torch.cos(grid.theta) ** power).sqrt()


def _roots(grid: Grid, power: float) -> Tensor:
    """√(cos^power θ dω) at the nodes of all azimuths, flat."""
    return (_root(grid, power) * math.sqrt(2 * math.pi / grid.turns)).repeat_interleave(grid.turns)


def _complex(values: Tensor) -> Tensor:
    return values if values.is_complex() else values + 0j


def _check_energy(values: Tensor) -> None:
    if not bool(values.any()):
        raise BadInput("relighting: the reflectance is 0 everywhere, expected some light to be reflected")
