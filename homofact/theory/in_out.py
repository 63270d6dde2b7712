"""The singular value decomposition of a BRDF between incident and outgoing directions, without a matrix of pairs.

The operator that is decomposed has the kernel f(ωi, ωo), without a cosine, and the solid-angle measure on both sides.
This is also true of the matrix of Mahajan, Tseng and Ramamoorthi (2008), whose directions are evenly spaced in cosθ and
φ. Rotating both directions about the normal does not change an isotropic f, so the operator is diagonal in the Fourier
order m of azimuth. With f = Σ_m f_m(θi, θo) exp(im(φo − φi)) its singular values are those of the small matrices 2π √w
f_m √w over Gauss nodes in θ, each twice for m > 0. This is exact up to quadrature and takes milliseconds, while the
full matrix takes hours. An anisotropic f needs the full matrix.

Directions reach θ = `limit` from the normal: π/2 is the hemisphere, π the sphere (for kernels that are defined there).
"""

import math
from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.symmetry import Symmetry, find_symmetry
from homofact.errors import BadInput
from homofact.geometry.directions import from_spherical
from homofact.linear.threads import one_thread
from homofact.theory.harmonics import check_share, gauss_legendre

_CHUNK = 2**18


@dataclass(frozen=True)
class DirectionGrid:
    """Where a kernel is sampled: `rings` Gauss nodes in θ on [0, limit] by `turns` evenly spaced azimuths.

    Raises BadInput for a limit outside (0, π] and for fewer than 2 rings or 4 turns.
    """

    rings: int
    turns: int
    limit: float

    def __post_init__(self) -> None:
        """Refuse grids on which nothing can be integrated."""
        if not 0 < self.limit <= math.pi:
            raise BadInput(
                where="limit", found=f"{math.degrees(self.limit):g} degrees", expected="above 0 and at most 180"
            )
        if self.rings < 2 or self.turns < 4:
            raise BadInput(where="grid", found=f"{self.rings} rings of {self.turns}", expected="at least 2 of 4")

    @cached_property
    def _nodes(self) -> tuple[Tensor, Tensor]:
        return gauss_legendre(self.rings, 0.0, self.limit)

    @property
    def theta(self) -> Tensor:
        """Angles (rings,) from the normal in radians. Nodes in θ, not cosθ: odd orders m are smooth in θ alone."""
        return self._nodes[0]

    @property
    def weights(self) -> Tensor:
        """Quadrature weights (rings,): Σ w g(θ) = ∫ g sinθ dθ."""
        return self._nodes[1] * torch.sin(self.theta)

    @property
    def phi(self) -> Tensor:
        """Azimuths (turns,) in radians, from 0."""
        return torch.arange(self.turns, dtype=torch.float64) * (2 * math.pi / self.turns)

    def directions(self, turns: int | None = None) -> Tensor:
        """Return unit vectors (rings, turns, 3) of the first `turns` azimuths from φ = 0. Default: all."""
        phi = self.phi[:turns]
        return from_spherical(self.theta[:, None].expand(-1, len(phi)), phi.expand(self.rings, -1))


@dataclass(frozen=True)
class Decomposition:
    """Singular values and functions of each channel, strongest first.

    Attributes
    ----------
    grid : where the functions are sampled.
    sigma : (C, R) singular values; those of m > 0 count twice.
    order : (C, R) Fourier order m ≥ 0 in azimuth; 0 throughout where anisotropic.
    left, right : (C, R, rings) complex for isotropic, (C, R, rings, turns) real for anisotropic kernels:
        f = Σ multiplicity · σ/2π · Re(left(θi) right(θo) exp(im(φo − φi))), anisotropic f = Σ σ left(ωi) right(ωo).
    isotropic : whether the kernel is isotropic.
    channels : names of the C channels.
    """

    grid: DirectionGrid
    sigma: Tensor
    order: Tensor
    left: Tensor
    right: Tensor
    isotropic: bool
    channels: tuple[str, ...]

    @property
    def multiplicity(self) -> Tensor:
        """The multiplicity (C, R) of the singular values: 2 if m > 0, for a cosine and a sine, otherwise 1."""
        return 1 + (self.order > 0).long()

    def values(self, channel: int = 0) -> Tensor:
        """Return all singular values of a channel in decreasing order, each repeated by its multiplicity."""
        return self.sigma[channel].repeat_interleave(self.multiplicity[channel])

    def count(self, share: float, channel: int = 0) -> int:
        """Return the smallest K whose terms have `share` of Σσ². Raises BadInput for a share outside (0, 1)."""
        return count_for_share(self.values(channel), share)

    def truncated(self, terms: int) -> "InOutTerms":
        """Return the first `terms` terms of every channel as a reflectance. Raises BadInput for terms < 1."""
        if terms < 1:
            raise BadInput(where="terms", found=terms, expected="at least 1")
        return InOutTerms(self, terms)


def count_for_share(values: Tensor, share: float) -> int:
    """Return the least K with Σ_{k≤K} σ_k² ≥ share Σ σ²; `values` must decrease.

    Raises BadInput for no energy, a bad share.
    """
    check_share(share)
    energy = (values.double() ** 2).cumsum(0)
    if not float(energy[-1]) > 0:
        raise BadInput("the reflectance is 0 everywhere", where="terms", expected="some energy")
    return int((energy < share * energy[-1]).sum()) + 1


@one_thread
def decompose(
    reflectance: Reflectance, grid: DirectionGrid, symmetry: Symmetry | None = None, mean: bool = False
) -> Decomposition:
    """Return the decomposition of a reflectance (or of any kernel with `evaluate` and `channels`) on `grid`.

    `symmetry` is tested by default. `mean` decomposes the mean of the channels instead of each, as the paper does.
    Raises BadInput for values that are not finite.
    """
    known = find_symmetry(reflectance, grid.limit) if symmetry is None else symmetry
    channels = ("mean",) if mean else reflectance.channels
    split = _isotropic if known.isotropic else _anisotropic
    return split(reflectance, grid, known.mirrored, mean, channels)


def _isotropic(
    reflectance: Reflectance, grid: DirectionGrid, mirrored: bool, mean: bool, channels: tuple[str, ...]
) -> Decomposition:
    # A mirrored kernel is even in φo − φi: half of the turn says all.
    turns = grid.turns // 2 + 1 if mirrored else grid.turns
    outgoing = grid.directions(turns)
    incident = grid.directions(1)
    values = evaluated(reflectance, incident.reshape(-1, 3), outgoing.reshape(-1, 3), mean)
    values = values.reshape(grid.rings, grid.rings, turns, -1)
    if mirrored:
        rest = values[:, :, 1 : grid.turns - turns + 1].flip(2)
        values = torch.cat((values, rest), 2)
    # The highest order has no sine beside its cosine and is left out.
    waves = torch.fft.rfft(values, dim=2)[:, :, : (grid.turns + 1) // 2] / grid.turns
    scale = 2 * math.pi * grid.weights.sqrt()[:, None] * grid.weights.sqrt()
    matrices = waves.permute(3, 2, 0, 1) * scale
    if mirrored:
        matrices = matrices.real
    u, sigma, vh = torch.linalg.svd(matrices)
    root = grid.weights.sqrt()
    left, right = (u.mT / root).flatten(1, 2), (vh / root).flatten(1, 2)
    order = torch.arange(sigma.shape[1])[:, None].expand(sigma.shape[1:]).reshape(-1)
    return _sorted(grid, sigma.flatten(1), order, left, right, True, channels)


def _anisotropic(
    reflectance: Reflectance, grid: DirectionGrid, mirrored: bool, mean: bool, channels: tuple[str, ...]
) -> Decomposition:
    directions = grid.directions().reshape(-1, 3)
    values = evaluated(reflectance, directions, directions, mean)
    root = (grid.weights * (2 * math.pi / grid.turns)).sqrt().repeat_interleave(grid.turns)
    matrices = values.permute(2, 0, 1) * root[:, None] * root
    u, sigma, vh = torch.linalg.svd(matrices)
    shape = (len(channels), -1, grid.rings, grid.turns)
    left, right = ((side / root).reshape(shape) for side in (u.mT, vh))
    return _sorted(grid, sigma, torch.zeros(sigma.shape[1], dtype=torch.long), left, right, False, channels)


def _sorted(
    grid: DirectionGrid,
    sigma: Tensor,
    order: Tensor,
    left: Tensor,
    right: Tensor,
    isotropic: bool,
    channels: tuple[str, ...],
) -> Decomposition:
    place = sigma.argsort(dim=1, descending=True, stable=True)
    rows = torch.arange(len(sigma))[:, None]
    return Decomposition(
        grid, sigma[rows, place], order[place], left[rows, place], right[rows, place], isotropic, channels
    )


def evaluated(reflectance: Reflectance, incident: Tensor, outgoing: Tensor, mean: bool = False) -> Tensor:
    """Values (I, O, C) float64 of all pairs of (I, 3) and (O, 3), in chunks; `mean` averages the channels.

    Raises BadInput for values that are not finite.
    """
    step = max(1, _CHUNK // len(outgoing))
    parts = []
    for wi in incident.split(step):
        pairs = wi.repeat_interleave(len(outgoing), 0), outgoing.repeat(len(wi), 1)
        values = reflectance.evaluate(*pairs).double()
        values = values.mean(1, keepdim=True) if mean else values
        parts.append(values.reshape(len(wi), len(outgoing), -1))
    values = torch.cat(parts)
    if not bool(torch.isfinite(values).all()):
        raise BadInput("the reflectance has values that are not finite", where="terms", expected="finite numbers")
    return values


@dataclass(frozen=True)
class InOutTerms:
    """The first `terms` terms of a decomposition: a `Reflectance`, Σ σ h(ωo) g(ωi) per channel.

    Between nodes, the functions are interpolated by a polynomial in θ and a trigonometric polynomial in φ through the
    nodes. Sums may be negative, as in the paper; `evaluate` clamps them at 0, `signed` does not. A pair of terms (m >
    0) that `terms` would split is left out. Beyond the grid's limit, the functions keep their values at the limit.
    """

    decomposition: Decomposition
    terms: int

    @property
    def channels(self) -> tuple[str, ...]:
        """Those of the decomposition."""
        return self.decomposition.channels

    @property
    def nbytes(self) -> int:
        """Bytes of g and h at all nodes as float32, with one map each per term and channel."""
        grid = self.decomposition.grid
        return 4 * 2 * self.terms * grid.rings * grid.turns * len(self.channels)

    @property
    def fetches(self) -> int:
        """Two maps per term."""
        return 2 * self.terms

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return BRDF values (N, C) in sr⁻¹, ≥ 0, without the cosine; 0 where a direction is under the horizon."""
        above = (wi[:, 2] >= 0) & (wo[:, 2] >= 0)
        return torch.where(above[:, None], self.signed(wi, wo), 0.0).clamp_min(0)

    @one_thread
    def signed(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return the sums (N, C) as they are, on the whole of the grid's domain."""
        parts = [self._rows(*pair) for pair in zip(wi.double().split(4096), wo.double().split(4096), strict=True)]
        return torch.cat(parts).to(wi)

    def _rows(self, wi: Tensor, wo: Tensor) -> Tensor:
        whole = self.decomposition
        rows_i, rows_o = (polynomial(whole.grid, w) for w in (wi, wo))
        columns = []
        for c in range(len(whole.channels)):
            kept = int((whole.multiplicity[c].cumsum(0) <= self.terms).sum())
            sigma, order = whole.sigma[c, :kept], whole.order[c, :kept]
            left, right = whole.left[c, :kept], whole.right[c, :kept]
            if whole.isotropic:
                turn = torch.atan2(wo[:, 1], wo[:, 0]) - torch.atan2(wi[:, 1], wi[:, 0])
                # Each order's wave once, not for each of its terms.
                waves = torch.exp(1j * turn[:, None] * torch.arange(int(order.max()) + 1))[:, order]
                product = (rows_i.to(left) @ left.T) * (rows_o.to(right) @ right.T) * waves
                columns.append(product.real @ (whole.multiplicity[c, :kept] * sigma / (2 * math.pi)))
            else:
                turns = [_trigonometric(whole.grid.turns, w) for w in (wi, wo)]
                g = torch.einsum("nt,nf,ktf->nk", rows_i, turns[0], left)
                h = torch.einsum("nt,nf,ktf->nk", rows_o, turns[1], right)
                columns.append((g * h) @ sigma)
        return torch.stack(columns, 1)


def polynomial(grid: DirectionGrid, w: Tensor) -> Tensor:
    """Weights (N, rings) of the polynomial through the rings' values at the angles of `w`: the barycentric formula.

    The barycentric weights at Gauss nodes are (−1)^k √((1 − x_k²) w_k) (Wang and Xiang 2012).
    """
    x, gauss = gauss_legendre(grid.rings, -1.0, 1.0)
    signs = 1 - 2 * (torch.arange(grid.rings) % 2)
    own = signs * ((1 - x**2) * gauss).sqrt()
    theta = torch.atan2(torch.hypot(w[:, 0], w[:, 1]), w[:, 2]).clamp_max(grid.limit)
    gap = (2 * theta / grid.limit - 1)[:, None] - x
    hit = gap.abs() < 1e-14
    terms = own / torch.where(hit, 1.0, gap)
    rows = terms / terms.sum(1, keepdim=True)
    return torch.where(hit.any(1, keepdim=True), hit.double(), rows)


def _trigonometric(turns: int, w: Tensor) -> Tensor:
    """Weights (N, turns) of the trigonometric polynomial through values at even azimuths."""
    phi = torch.atan2(w[:, 1], w[:, 0])[:, None] - torch.arange(turns, dtype=w.dtype) * (2 * math.pi / turns)
    order = torch.arange(1, (turns + 1) // 2, dtype=w.dtype)
    return (1 + 2 * torch.cos(phi[..., None] * order).sum(-1)) / turns
