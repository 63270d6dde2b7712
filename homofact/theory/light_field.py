"""Lighting and BRDF out of the reflected light field of a sphere (Ramamoorthi 2002, eq. 3.8, 3.11, 3.12, 3.17).

B̃_lmpq = Λ_l L_lm ρ̃_lpq (3.8) is, at each order l, the product of a vector over m and a vector over (p, q). Each order
alone therefore leaves a scale undetermined. Reciprocity, ρ̃_lpq = ρ̃_plq, links the scales of two orders l and p if
their coupling (the coefficients ρ̃_lpq) is not zero. Then only one global scale remains; it is set by Λ_0 L_00 = 1.
Without coupling, as for a mirror (3.26), every order keeps its own scale: the lighting can be blurred and the BRDF
sharpened without changing the light field.

`factor_light_field` finds the least squares answer over all coefficients; `factor_by_ratios` is the chapter's formula,
which divides by the coefficients with p = q = 0 alone. Coefficients are stored as in `theory.sphere_field`. The
functions treat one channel, because each channel has its own global scale.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.errors import BadInput
from homofact.theory.harmonics import orders
from homofact.theory.reflection import brdf_condition, lighting_condition, normalisation

ROUNDING = 1e-11  # of the largest coefficient: what is smaller is 0
_STEPS, _HALVINGS, _SETTLED = 50, 20, 1e-13
_SIGNIFICANT = 4.0  # standard errors


@dataclass(frozen=True)
class LightFieldFactors:
    """The lighting and the BRDF that a light field determines; NaN where it does not determine them.

    `lighting` is L_lm ((order+1)²,), `transfer` ρ̃_lpq (order+1, order+1, 2·order+1), each with its standard error
    (to first order in the noise; 0 without). `scales` (order+1,) contains the group number of each order of the
    lighting, from 0; orders in one group share a scale. It is −1 for orders that the lighting does not excite, whose
    L_lm is 0 within its error, or NaN. In each group, the largest Λ_l L_lm of the first order is set to 1 and its error
    to 0; in group 0 this is Λ_0 L_00. `known_lighting` and `known_transfer` mark the coefficients in the scale of group
    0. `residual` is the relative RMS of the part of the field that the factors do not explain.
    """

    lighting: Tensor
    transfer: Tensor
    lighting_error: Tensor
    transfer_error: Tensor
    scales: Tensor
    residual: float

    @property
    def known_lighting(self) -> Tensor:
        """Which L_lm are known in the scale of group 0, booleans ((order+1)²,)."""
        return ~self.lighting.isnan() & (self.scales[orders(len(self.scales) - 1)[0]] <= 0)

    @property
    def known_transfer(self) -> Tensor:
        """Which ρ̃_lpq are known in the scale of group 0, booleans (order+1, order+1, 2·order+1)."""
        own = self.scales <= 0
        return ~self.transfer.isnan() & (own[:, None] & own)[..., None]

    @property
    def lighting_condition(self) -> float:
        """`reflection.lighting_condition` of Λ_l √(Σ_pq ρ̃_lpq²): how unevenly the BRDF passes the light's orders."""
        sizes = self.transfer.nan_to_num().square().sum((1, 2)).sqrt()
        sizes[sizes <= ROUNDING * sizes.max()] = 0
        return lighting_condition(normalisation(len(sizes) - 1) * sizes)

    @property
    def brdf_condition(self) -> float:
        """`reflection.brdf_condition` of the lighting: how unevenly it excites the orders of the BRDF."""
        excited = self.scales[orders(len(self.scales) - 1)[0]] >= 0
        return brdf_condition(torch.where(excited, self.lighting, torch.zeros_like(self.lighting)))

    def describe(self) -> str:
        """Return one line: what was recovered, what was not, and both conditions."""
        shared = int((self.scales == 0).sum())
        apart = sorted(set(self.scales[self.scales > 0].tolist()))
        lost = (self.scales < 0).nonzero()[:, 0].tolist()
        words = [f"{shared} of {len(self.scales)} orders share one scale"]
        if apart:
            words.append(f"{len(apart)} more scale{'s' if len(apart) > 1 else ''} cannot be told from the lighting's")
        if lost:
            words.append(f"not excited by the lighting: order {', '.join(map(str, lost))}")
        conditions = f"condition of the lighting {self.lighting_condition:.3g}, of the BRDF {self.brdf_condition:.3g}"
        return "; ".join([*words, conditions])


def factor_light_field(field: Tensor, noise: float = 0.0) -> LightFieldFactors:
    """Separate B̃_lmpq ((order+1)², order+1, 2·order+1) into lighting and BRDF, up to undetermined scales.

    `noise` is the standard deviation of a coefficient (as of white noise in the light field), in its unit: orders of
    the lighting and couplings of two orders are used only if they are well above the noise. Raises BadInput for another
    shape, values that are not finite, a field of zeros and a negative noise.
    """
    problem = _Problem.of(field, noise)
    start, scales = problem.spanning_scales()
    return problem.factors(*problem.solved(start, scales), scales)


def factor_by_ratios(field: Tensor) -> tuple[Tensor, Tensor]:
    """Return (L_lm, ρ̃_lpq) by the chapter's ratios (3.17, before the BRDF is put in), Λ_0 L_00 = 1.

    L_lm = B̃_lm00/(Λ_l B̃_00l0) and ρ̃_lpq = B̃_lmpq B̃_00l0/B̃_lm00 at the m where |B̃_lm00| is largest. NaN where a
    denominator is 0 to rounding. Raises BadInput as `factor_light_field`.
    """
    values = _checked(field)
    order = values.shape[1] - 1
    degree = orders(order)[0]
    floor = ROUNDING * float(values.abs().max())
    across = values[:, 0, order]
    along = values[0, :, order]
    lighting = across / (normalisation(order) * along)[degree]
    lighting[along[degree].abs() <= floor] = math.nan
    transfer = torch.full((order + 1, order + 1, 2 * order + 1), math.nan, dtype=torch.float64)
    for band in range(order + 1):
        row = band * band + int(across[band * band : (band + 1) ** 2].abs().argmax())
        if float(across[row].abs()) > floor:
            transfer[band] = values[row] * along[band] / across[row]
    return lighting, transfer


def _checked(field: Tensor) -> Tensor:
    order = math.isqrt(field.shape[0]) - 1 if field.ndim == 3 else -1
    expected = ((order + 1) ** 2, order + 1, 2 * order + 1)
    if order < 0 or tuple(field.shape) != expected:
        raise BadInput(
            where="light field",
            found=f"coefficients of shape {tuple(field.shape)}",
            expected="((n+1)², n+1, 2n+1) of an order n",
        )
    if not bool(torch.isfinite(field).all()):
        raise BadInput(where="light field", found="coefficients that are not finite", expected="finite numbers")
    if not bool(field.any()):
        raise BadInput("every coefficient is 0", where="light field", expected="some light")
    return field.double()


@dataclass(frozen=True)
class _Problem:
    """Entries e of B̃ with q ≥ 0: value ≈ x[row] ρ[pair], x_lm = Λ_l L_lm, pairs unordered in l and p (reciprocity).

    `weights` is 2 for q > 0, where a coefficient is the mean of two. `partner` by [l, p, q] is the number of the pair,
    −1 where q > min(l, p); `degree` is l of each row. `floor` is the noise, or what rounding makes where that is more.
    """

    field: Tensor
    values: Tensor
    weights: Tensor
    rows: Tensor
    pairs: Tensor
    partner: Tensor
    degree: Tensor
    noise: float
    floor: float

    @classmethod
    def of(cls, field: Tensor, noise: float) -> "_Problem":
        """Return the entries of checked coefficients."""
        values = _checked(field)
        if not 0 <= noise < math.inf:
            raise BadInput(where="noise", found=noise, expected="a finite number of 0 or more")
        order = values.shape[1] - 1
        half = (values[:, :, order:] + values[:, :, : order + 1].flip(2)) / 2
        first, p, q = torch.meshgrid(*(torch.arange(order + 1),) * 3, indexing="ij")
        partner = torch.full_like(first, -1)
        listed = (first <= p) & (q <= first)
        partner[listed] = torch.arange(int(listed.sum()))
        partner = torch.maximum(partner, partner.transpose(0, 1))
        degree = orders(order)[0]
        rows, p, q = (partner[degree] >= 0).nonzero(as_tuple=True)
        floor = max(noise, ROUNDING * float(values.abs().max()))
        weights, pairs = torch.where(q > 0, 2.0, 1.0).double(), partner[degree[rows], p, q]
        return cls(half, half[rows, p, q], weights, rows, pairs, partner, degree, noise, floor)

    def spanning_scales(self) -> tuple[Tensor, Tensor]:
        """Return (a first x, the number of the scale of each order); the strongest couplings link the orders.

        For each order the leading singular pair is B̃ ≈ u v; reciprocity is t_p v_lpq = t_l v_plq with x_l = t_l u.
        """
        count = len(self.partner)
        root = torch.where(torch.arange(count) > 0, 2.0, 1.0).double().sqrt()
        u, v = [], torch.zeros(count, count, count, dtype=torch.float64)
        scales, excited = torch.full((count,), -1), torch.zeros(count, dtype=torch.bool)
        for band in range(count):
            inside = self.partner[band] >= 0
            block = (self.field[self.degree == band] * root * inside).reshape(2 * band + 1, -1)
            left, sizes, right = torch.linalg.svd(block, full_matrices=False)
            # The largest singular value of noise alone is about this.
            alone = self.floor * (math.sqrt(2 * band + 1) + math.sqrt(float(inside.sum())))
            excited[band] = float(sizes[0]) > 1.5 * alone
            u.append(left[:, 0])
            v[band] = (sizes[0] * right[0]).reshape(count, count)
        size = v.norm(dim=2)
        entries = (self.partner >= 0).sum(2).double().sqrt()
        strength = torch.minimum(size, size.T) / (_SIGNIFICANT * self.floor * entries)
        strength[~excited] = 0
        t = torch.zeros(count, dtype=torch.float64)
        group = -1
        for first in excited.nonzero()[:, 0].tolist():
            if scales[first] >= 0:
                continue
            group += 1
            scales[first], t[first] = group, 1.0
            while True:
                ties = (scales == group)[:, None] & (excited & (scales < 0))
                reach = torch.where(ties, strength, torch.zeros_like(strength))
                if float(reach.max()) <= 1:
                    break
                a, b = divmod(int(reach.argmax()), count)
                t[b] = t[a] * math.copysign(float(size[b, a] / size[a, b]), float((v[a, b] * v[b, a]).sum()))
                scales[b] = group
        return torch.cat([t[band] * u[band] for band in range(count)]), scales

    def solved(self, x: Tensor, scales: Tensor) -> tuple[Tensor, Tensor]:
        """Return (x of the excited orders, which rows are free): Gauss-Newton with ρ solved for at every step.

        In each group the largest x of its first order at the beginning is 1 and stays so.
        """
        free = scales[self.degree] >= 0
        for group in range(int(scales.max()) + 1):
            first = int((scales == group).nonzero()[0, 0])
            reference = first * first + int(x[self.degree == first].abs().argmax())
            x = torch.where(scales[self.degree] == group, x / x[reference], x)
            free[reference] = False
        rho = self.best_transfer(x)
        residual = self.values - x[self.rows] * rho[self.pairs]
        cost = float((self.weights * residual**2).sum())
        for _ in range(_STEPS):
            slope = _total(self.rows, self.weights * residual * rho[self.pairs], len(x))
            step = torch.zeros_like(x)
            step[free] = _inverse(self.reduced(x, rho)[0][free][:, free]) @ slope[free]
            for halving in range(_HALVINGS):
                moved = x + step / 2**halving
                rho = self.best_transfer(moved)
                residual = self.values - moved[self.rows] * rho[self.pairs]
                lower = float((self.weights * residual**2).sum())
                if lower < cost:
                    break
            else:
                return x, free
            settled = float((moved - x).abs().max()) <= _SETTLED * float(x.abs().max())
            x, cost = moved, lower
            if settled:
                break
        return x, free

    def best_transfer(self, x: Tensor) -> Tensor:
        """ρ by pair, the least squares answer to x; 0 where no x meets it."""
        count = int(self.pairs.max()) + 1
        own = _total(self.pairs, self.weights * x[self.rows] ** 2, count)
        product = _total(self.pairs, self.weights * self.values * x[self.rows], count)
        return torch.where(own > 0, product / own, torch.zeros_like(own))

    def reduced(self, x: Tensor, rho: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """(normal equations of x with ρ eliminated, what an x adds to each ρ, 1/the normal equations of ρ alone)."""
        own = _total(self.pairs, self.weights * x[self.rows] ** 2, len(rho))
        inverse = torch.where(own > 0, 1 / own, torch.zeros_like(own))
        cross = torch.zeros(len(x), len(rho), dtype=torch.float64)
        products = self.weights * x[self.rows] * rho[self.pairs]
        cross.index_put_((self.rows, self.pairs), products, accumulate=True)
        diagonal = torch.diag(_total(self.rows, self.weights * rho[self.pairs] ** 2, len(x)))
        return diagonal - (cross * inverse) @ cross.T, cross * inverse, inverse

    def factors(self, x: Tensor, free: Tensor, scales: Tensor) -> LightFieldFactors:
        """Lighting and BRDF with their errors; what the lighting or the BRDF leaves open becomes NaN."""
        rho = self.best_transfer(x)
        on = scales[self.degree] >= 0
        matrix, carried, inverse = self.reduced(x, rho)
        covariance = torch.zeros_like(matrix)
        covariance[free.nonzero(), free.nonzero()[:, 0]] = _inverse(matrix[free][:, free])
        rho_variance = inverse + ((carried.T @ covariance) * carried.T).sum(1)
        # Where the lighting has nothing, it is 0 if the BRDF, known from the other orders, has something there.
        known = inverse > 0
        shown = _total(self.rows, self.weights * rho[self.pairs] ** 2 * known[self.pairs], len(x))
        doubt = self.floor**2 * _total(self.rows, self.weights * (rho_variance * known)[self.pairs], len(x))
        spare = _total(self.rows, self.weights * self.values * rho[self.pairs], len(x)) / shown
        open_rows = ~on & (shown <= _SIGNIFICANT**2 * doubt)
        lighting = torch.where(on, x, spare)
        error = self.noise * torch.where(on, covariance.diagonal(), 1 / shown).sqrt()
        residual = self.values - x[self.rows] * rho[self.pairs]
        share = (self.weights * residual**2).sum() / (self.weights * self.values**2).sum()
        scaled = normalisation(len(self.partner) - 1)[self.degree]
        return LightFieldFactors(
            lighting.masked_fill(open_rows, math.nan) / scaled,
            self._by_order(rho.masked_fill(~known, math.nan)),
            error.masked_fill(open_rows, math.nan) / scaled,
            self._by_order((self.noise * rho_variance.sqrt()).masked_fill(~known, math.nan)),
            scales,
            float(share.sqrt()),
        )

    def _by_order(self, rho: Tensor) -> Tensor:
        """ρ by [l, p, q + order] from ρ by pair."""
        half = torch.where(self.partner >= 0, rho[self.partner], torch.zeros_like(rho[self.partner]))
        return torch.cat((half[:, :, 1:].flip(2), half), 2)


def _total(index: Tensor, values: Tensor, count: int) -> Tensor:
    return torch.zeros(count, dtype=torch.float64).index_add(0, index, values)


def _inverse(matrix: Tensor) -> Tensor:
    """The inverse of a symmetric positive definite matrix whose diagonal spans many magnitudes."""
    root = matrix.diagonal().clamp_min(torch.finfo(torch.float64).tiny).sqrt()
    return torch.linalg.pinv(matrix / root / root[:, None], hermitian=True) / root / root[:, None]
