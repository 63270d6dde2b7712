"""Kernels of chains: whole, of known shapes, and GGX's as an engine's shader draws it."""

import math

import numpy as np
import pytest

from homofact.rendering.chain_kernels import ChainKernels, cosine_power, ggx_kernels
from homofact.rendering.sky_chain import own_kernels

ROUGHNESSES = (0.0, 0.1, 0.3, 0.6, 0.9, 1.0)
KINDS = {
    "own": own_kernels(64),
    "cosine": ggx_kernels(ROUGHNESSES, 0.01),
    "Smith": ggx_kernels(ROUGHNESSES, 0.01, "Smith"),
}


def flux(kernels: ChainKernels, level: int) -> tuple[np.ndarray, np.ndarray]:
    """Angles γ, evenly in their square root, and the flux of a level at each."""
    root = (np.arange(200_000) + 0.5) / 200_000
    gamma = math.pi / 2 * root**2
    return gamma, 2 * math.pi * kernels.at(level, gamma) * np.sin(gamma) * math.pi * root / 200_000


@pytest.mark.parametrize("kind", KINDS)
def test_every_kernel_is_whole_and_wider_than_the_one_before(kind: str) -> None:
    kernels, before = KINDS[kind], 0.0
    for level in range(len(kernels.alphas)):
        gamma, own = flux(kernels, level)
        assert own.sum() == pytest.approx(1, abs=1e-5)
        assert (own >= 0).all()
        spread = float((own * gamma).sum())
        # Smith's of a roughness near 1 is wider than the cosine.
        assert spread > before or (kind == "Smith" and kernels.alphas[level] == 1)
        before = spread


@pytest.mark.parametrize("kind", KINDS)
def test_the_last_level_is_the_irradiance(kind: str) -> None:
    kernels, gamma = KINDS[kind], np.linspace(0, 1.5, 7)
    assert kernels.at(-1, gamma) == pytest.approx(np.cos(gamma) / math.pi)


def test_a_level_narrower_than_a_texel_is_a_texel() -> None:
    kernels, gamma = KINDS["cosine"], np.linspace(0, 0.05, 9)
    assert kernels.at(0, gamma) == pytest.approx(cosine_power(0.01, gamma))
    assert kernels.narrowest == 0.01
    assert ggx_kernels((0.5, 1.0), 0.01).narrowest == 0.25


@pytest.mark.parametrize("kind", ["cosine", "Smith"])
@pytest.mark.parametrize("level", [1, 2, 3, 4])
def test_ggx_is_what_is_drawn_by_its_visible_normals(kind: str, level: int) -> None:
    """From the normal the cosine of light is (1 − x − α² x)/(1 − x + α² x) of x even in [0, 1] (three.js 187)."""
    kernels = KINDS[kind]
    square = kernels.alphas[level] ** 2
    x = (np.arange(400_000) + 0.5) / 400_000
    cosine = (1 - x - square * x) / (1 - x + square * x)
    cosine = cosine[cosine > 0]
    weight = cosine
    if kind == "Smith":
        # 2/(1 + Λ of light), Λ of the viewer at the normal 1.
        weight = 2 / (1 + np.sqrt(1 + square * (1 / cosine**2 - 1)))
    gamma, own = flux(kernels, level)
    for most in (0.05, 0.2, 0.8):
        drawn = weight[np.arccos(cosine) < most].sum() / weight.sum()
        assert own[gamma < most].sum() == pytest.approx(drawn, abs=2e-4)
