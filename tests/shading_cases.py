"""Factorizations that between them use everything a shading program can hold, with random smooth textures."""

import math

import torch

from homofact.brdf.log_transform import LogTransform
from homofact.factor.factorization import Factorization, Term
from homofact.factor.fitted import Fitted
from homofact.factor.fixed_projections import FIXED_PROJECTIONS
from homofact.factor.projection import Projection, Warp, fixed_projection
from homofact.geometry.coordinates import coordinate_system
from homofact.geometry.directions import draw_uniform
from homofact.geometry.rotation import Rotation
from homofact.separable.separable import Separable, SeparableTerm
from homofact.shading.encoding import Encoded, encode_texture
from homofact.shading.lobe_coordinates import PHIS, RADII, THETAS
from homofact.shading.lobe_mixture import ROUND, LobeMixture, halves
from homofact.shading.program import Program, program_of


def random_term(projection: Projection, seed: int, channels: int, size: tuple[int, int] = (9, 12)) -> Term:
    """A term with texels in ±1, the whole texture inside the mask; one row where the projection has one."""
    generator = torch.Generator().manual_seed(seed)
    rows = 1 if bool((projection.matrix[1] == 0).all()) else size[0]
    texture = torch.rand(rows, size[1], channels, generator=generator, dtype=torch.float64) * 2 - 1
    return Term(projection, texture, torch.ones(rows, size[1], dtype=torch.bool))


def factorization(*projections: Projection, channels: int = 3, epsilon: float = 1e-3) -> Factorization:
    """A product of random textures under these projections."""
    mean = torch.tensor([0.3, 0.2, 0.15, 0.1], dtype=torch.float64)[:channels]
    terms = tuple(random_term(projection, 7 + k, channels) for k, projection in enumerate(projections))
    return Factorization(terms, LogTransform(epsilon, mean), tuple("RGBA"[:channels]) if channels > 1 else ("Y",))


def searched(coordinates: str, seed: int, warp: Warp | None = None, reciprocal: bool = True) -> Projection:
    """A projection with a random rotation."""
    generator = torch.Generator().manual_seed(seed)
    rotation = Rotation.random(generator, coordinate_system(coordinates).dimension)
    return Projection.from_rotation(coordinates, rotation, reciprocal, warp=warp)


CASES = {
    f"fixed {name}": factorization(fixed_projection(name, True)) for name in FIXED_PROJECTIONS
} | {
    "searched in-out": factorization(searched("in-out", 1)),
    "searched half-diff": factorization(searched("half-diff", 2)),
    "searched isotropic half-diff": factorization(searched("isotropic-half-diff", 3)),
    "searched isotropic in-out": factorization(searched("isotropic-in-out", 4)),
    "searched isotropic angles": factorization(searched("isotropic-angles", 11)),
    "searched, warped isotropic half-tilt": factorization(searched("isotropic-half-tilt", 12, Warp(0.03))),
    "searched in-out, not reciprocal": factorization(searched("in-out", 1, reciprocal=False)),
    "warped half-diff": factorization(searched("half-diff", 5, Warp(0.05))),
    "warped isotropic half-diff": factorization(searched("isotropic-half-diff", 6, Warp(0.03))),
    "warped h": factorization(fixed_projection("h", True, Warp(0.1))),
    "McCool, one channel": factorization(fixed_projection("wi", True), fixed_projection("h", True), channels=1),
    "round, warped, beside all angles": factorization(
        fixed_projection("theta_h-phi_h", True, Warp(0.1)),
        searched("isotropic-half-diff", 8, Warp(0.03)),
        searched("isotropic-in-out", 9),
    ),
    "five of all kinds": factorization(
        searched("isotropic-half-diff", 8, Warp(0.03)),
        searched("isotropic-in-out", 9),
        searched("half-diff", 10),
        fixed_projection("theta_h", True),
        fixed_projection("theta_h-theta_d", True, Warp(0.2)),
    ),
}  # fmt: skip


def separable(parameterization: str, map_name: str, shared: bool) -> Separable:
    """A sum of two products of random textures."""
    generator = torch.Generator().manual_seed(3)

    def texture() -> torch.Tensor:
        return torch.rand(8, 8, 3, generator=generator, dtype=torch.float64) * 1.5 - 0.3

    signs = (torch.tensor([1.0, 1, 1], dtype=torch.float64), torch.tensor([1.0, -1, 1], dtype=torch.float64))
    terms = tuple(SeparableTerm(texture(), None if shared else texture(), sign) for sign in signs)
    transform = LogTransform(1e-3, torch.ones(3, dtype=torch.float64))
    return Separable(terms, map_name, parameterization, torch.ones(8, 8, dtype=torch.bool), transform, ("R", "G", "B"))


SEPARABLE = {
    f"{kind}, {name}, {'shared' if shared else 'two'}": separable(kind, name, shared)
    for kind, shared in (("in-out", True), ("in-out", False), ("half-diff", False))
    for name in ("parabolic", "orthographic", "polar")
}


def grain(ratio: float, turn: float) -> tuple[float, float, float]:
    """The matrix that stretches by so much along an axis at `turn` radians, its determinant 1."""
    axes = torch.tensor([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]], dtype=torch.float64)
    matrix = axes @ torch.diag(torch.tensor([ratio, 1 / ratio], dtype=torch.float64).sqrt()) @ axes.T
    return float(matrix[0, 0]), float(matrix[0, 1]), float(matrix[1, 1])


def mixture(seed: int, scale: float, grain: tuple[float, float, float] = ROUND, grained: bool = False) -> LobeMixture:
    """A lobe with a random, rough table and random shares of the cosine."""
    generator = torch.Generator().manual_seed(seed)
    lobe, turns = (
        torch.rand(THETAS, PHIS, count, generator=generator, dtype=torch.float64) + 0.2 for count in (RADII, 1)
    )
    place = torch.arange(1, RADII + 1, dtype=torch.float64) / RADII
    # Little at the horizon, where a step would be hard to integrate.
    peak = (1.02 - place) / (1 + (place - 0.3).square() * 30)
    cosine = 0.05 + 0.3 * torch.rand(THETAS, generator=generator, dtype=torch.float64)
    return LobeMixture(
        halves(lobe * peak), halves(turns[..., 0]), halves(cosine), scale, grain, grained or grain != ROUND
    )


MIXTURES = {
    "isotropic": mixture(1, 0.1),
    "narrow": mixture(2, 3e-3),
    "brushed, turned": mixture(3, 0.2, grain(2.0, 0.7)),
}
NAMES = (*CASES, *SEPARABLE)
BELOW = 50


def program(name: str) -> tuple[Fitted, Program, list[Encoded]]:
    """A case, its program and its textures as floats."""
    fitted = (CASES | SEPARABLE)[name]
    textures = [encode_texture(texture, "float32") for texture in fitted.textures]
    return fitted, program_of(fitted, textures), textures


def pairs() -> tuple[torch.Tensor, torch.Tensor]:
    """Pairs of directions, the first `BELOW` with the light under the horizon."""
    wi, wo = draw_uniform(4000, torch.Generator().manual_seed(0))
    wi[:BELOW, 2] *= -1
    return wi, wo
