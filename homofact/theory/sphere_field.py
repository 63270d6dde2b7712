"""The reflected light field of a sphere in harmonics, and the transfer function of a BRDF (Ramamoorthi 2002, 3.1.1).

The surface with the normal (α, β) has the frame R = Rz(β) Ry(α): its z axis is the normal. Multiplied by cosθo, the
transfer function has the same reciprocity as the BRDF (3.7): ρ̃ = f cosθi cosθo. With real harmonics,

    ρ̃(ωi, ωo) = Σ ρ̃_lpq Y_lq(ωi) Y_pq(ωo),    B̃(α, β, ωo) = Σ B̃_lmpq C_lmpq,    C_lmpq = D^l_mq(R) Y_pq(ωo)/Λ_l

with B̃_lmpq = Λ_l L_lm ρ̃_lpq (3.8). An isotropic BRDF that is mirror-symmetric in Δφ has ρ̃_lp−q = ρ̃_lpq, and the
sums (C_lmpq + C_lmp−q)/√2 are orthonormal: white noise in the light field is white noise in its coefficients.
Coefficients are stored as in `theory.reflection`: ρ̃ by [l, p, q + order], B̃ by [l² + l + m, p, q + order].
"""

import math
from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.geometry.directions import from_cosine
from homofact.theory.harmonics import gauss_legendre, harmonics, normalised_legendre, orders, quadrature
from homofact.theory.reflection import normalisation


def transfer_coefficients(reflectance: Reflectance, order: int, nodes: int | None = None) -> Tensor:
    """ρ̃_lpq of an isotropic BRDF, (order+1, order+1, 2·order+1, C) by [l, p, q + order]; 0 for |q| > min(l, p).

    By quadrature with `nodes` nodes in cosθi and in cosθo and twice as many in Δφ (default: 4 · order + 16; a sharp
    lobe needs more). The result is symmetric in l and p if the BRDF is reciprocal. The part odd in Δφ, which an
    isotropic BRDF may have, is averaged out.
    """
    count = 4 * order + 16 if nodes is None else nodes
    cosine, weights = gauss_legendre(count, 0.0, 1.0)
    legendre = normalised_legendre(order, cosine) * (weights * cosine)
    turn = torch.arange(2 * count, dtype=torch.float64) * (math.pi / count)
    # By [q, node of Δφ]; 2π is the turning of both directions together.
    waves = torch.cos(torch.arange(order + 1)[:, None] * turn) * (2 * math.pi * math.pi / count)
    wo = from_cosine(cosine[:, None].expand(-1, 2 * count), turn.expand(count, -1)).reshape(-1, 3)
    total = None
    for i, wi in enumerate(from_cosine(cosine, torch.zeros_like(cosine))):
        values = reflectance.evaluate(wi.expand_as(wo), wo).reshape(count, 2 * count, -1)
        spectrum = torch.einsum("qt,ntc->qnc", waves, values)
        seen = torch.einsum("lq,pqn,qnc->lpqc", legendre[:, :, i], legendre, spectrum)
        total = seen if total is None else total + seen
    assert total is not None
    return torch.cat((total[:, :, 1:].flip(2), total), 2)


def frames(normals: Tensor) -> Tensor:
    """Return the frame R = Rz(β) Ry(α) of each normal as an array (N, 3, 3).

    `normals` is (N, 3). The columns of R are the x, y and z axes of the surface's frame in world coordinates.
    """
    around = torch.hypot(normals[:, 0], normals[:, 1])
    beta = torch.atan2(normals[:, 1], normals[:, 0])
    cosine, sine, zero = torch.cos(beta), torch.sin(beta), torch.zeros_like(beta)
    x = torch.stack((cosine * normals[:, 2], sine * normals[:, 2], -around), 1)
    return torch.stack((x, torch.stack((-sine, cosine, zero), 1), normals), 2)


def rotation_coefficients(order: int, rotations: Tensor) -> Tensor:
    """D (N, (order+1)², (order+1)²) with Y_lm(R ω) = Σ_q D_lm,lq Y_lq(ω) for the rotations (N, 3, 3)."""
    w, weights = quadrature(order)
    own = harmonics(order, w) * weights[:, None]
    return torch.stack([harmonics(order, w @ rotation.T).T @ own for rotation in rotations])


@dataclass(frozen=True)
class SphereGrid:
    """Normals all over a sphere and, above each, viewers' directions in its own frame, for quadrature.

    `normals` (N, 3) and `wo` (Q, 3) with `normal_weights` (N,) and `wo_weights` (Q,) in sr, wo above the horizon.
    """

    normals: Tensor
    normal_weights: Tensor
    wo: Tensor
    wo_weights: Tensor

    @classmethod
    def of(cls, normal_order: int, wo_order: int) -> "SphereGrid":
        """Return the grid that is exact for products of harmonics up to these orders."""
        return cls(*quadrature(normal_order), *quadrature(wo_order, 0.0))

    @cached_property
    def local_frames(self) -> Tensor:
        """The frames (N, 3, 3) of the normals, as `frames` returns them."""
        return frames(self.normals)


def field_coefficients(field: Tensor, grid: SphereGrid, order: int) -> Tensor:
    """B̃_lmpq ((order+1)², order+1, 2·order+1) of the reflected radiance B (N, Q) on a grid, one channel.

    By quadrature of B cosθo C_lmpq, the coefficients of q and −q averaged. Raises BadInput for another shape and for
    values that are not finite.
    """
    shape = (len(grid.normals), len(grid.wo))
    if tuple(field.shape) != shape:
        raise BadInput(
            where="light field", found=f"shape {tuple(field.shape)}", expected=f"{shape}, the grid's normals and views"
        )
    if not bool(torch.isfinite(field).all()):
        raise BadInput(
            where="light field", found="values that are not finite", expected="radiance everywhere on the grid"
        )
    degree, index = orders(order)
    seen = field @ (harmonics(order, grid.wo) * (grid.wo_weights * grid.wo[:, 2])[:, None])
    total = torch.zeros((order + 1) ** 2, order + 1, 2 * order + 1, dtype=torch.float64)
    for part in torch.arange(len(grid.normals)).split(64):
        turned = rotation_coefficients(order, grid.local_frames[part]) * grid.normal_weights[part, None, None]
        for q in range(-order, order + 1):
            # D is 0 between unlike l: the sum over l' leaves D^l_mq.
            total[:, degree[index == q], q + order] += turned[:, :, index == q].sum(2).T @ seen[part][:, index == q]
    total /= normalisation(order)[degree][:, None, None]
    return (total + total.flip(2)) / 2


def reflected_radiance(field: Tensor, grid: SphereGrid) -> Tensor:
    """B (N, Q) on a grid from its coefficients B̃_lmpq ((order+1)², order+1, 2·order+1): Σ B̃_lmpq C_lmpq / cosθo."""
    order = field.shape[1] - 1
    degree, index = orders(order)
    scaled = field / normalisation(order)[degree][:, None, None]
    out = []
    for part in torch.arange(len(grid.normals)).split(64):
        turned = rotation_coefficients(order, grid.local_frames[part])
        seen = torch.zeros(len(part), (order + 1) ** 2, dtype=torch.float64)
        for q in range(-order, order + 1):
            rows = index == q
            seen[:, rows] = turned[:, :, rows].sum(2) @ scaled[:, degree[rows], q + order]
        out.append(seen @ harmonics(order, grid.wo).T)
    return torch.cat(out) / grid.wo[:, 2]
