"""Averages of a sky by its harmonics: known ones of simple skies, those of rings, and which kernels have them."""

import math

import numpy as np
import pytest
import torch
from skies import gradient, lamps, normals

from homofact.rendering.chain_kernels import ChainKernels, ggx_kernels
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.octahedral import Pyramid
from homofact.rendering.sky_chain import FilteredSky, _filtered, _rings
from homofact.rendering.sky_harmonics import MOST, SkyHarmonics, gains_of

SLOPE = (0.3, 0.4, -0.2)
KERNELS = ggx_kernels((0.02, 0.3, 0.5, 0.7, 1.0), 0.004)


def test_gains_of_powers_of_the_cosine_are_known() -> None:
    """Of cosᵖ the first is (p + 1)/(p + 2); the cosine itself has 2/3, 1/4, 0 and −1/24."""
    kernels = ChainKernels((0.1, 1.0))
    narrow, wide = (gains_of(kernels, level) for level in range(2))
    assert narrow is not None
    assert wide is not None
    assert narrow[:2] == pytest.approx([1, 101 / 102], rel=1e-6)
    assert wide[:5] == pytest.approx([1, 2 / 3, 1 / 4, 0, -1 / 24], abs=1e-6)
    assert 40 < len(narrow) < MOST


def test_narrow_kernels_have_none() -> None:
    assert gains_of(KERNELS, 0) is None
    assert all(gains_of(KERNELS, level) is not None for level in range(1, 5))


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_the_average_of_a_gradient_is_known(turn: float) -> None:
    """Of 1 + s·ω it is 1 + k1 s·m, s turned with the sky."""
    light = gradient(SLOPE, 32).turned(turn)
    m, _ = normals(60)
    x, y, z = SLOPE
    turned = (x * math.cos(turn) + z * math.sin(turn), y, z * math.cos(turn) - x * math.sin(turn))
    gains = np.array([1.0, 0.8])
    found = SkyHarmonics.of(light).averaged(gains, m.numpy())
    expected = (1 + 0.8 * m @ m.new_tensor(turned))[:, None] * m.new_tensor((1, 2, 3))
    assert found == pytest.approx(expected.numpy(), rel=2e-3)


def test_lamps_are_averaged_as_by_rings() -> None:
    """Of every kernel that few harmonics hold, also where the sky is dark."""
    light, (towards, _) = lamps(), normals(150)
    pyramid, harmonics = Pyramid.of(light, torch.eye(3, dtype=torch.float64)), SkyHarmonics.of(light)
    for level in range(1, 5):
        gains = gains_of(KERNELS, level)
        assert gains is not None
        found = harmonics.averaged(gains, towards.numpy())
        expected = _filtered(towards.numpy(), *_rings(KERNELS, level, 48), *pyramid[:3])
        assert np.linalg.norm(found - expected) < 0.02 * np.linalg.norm(expected)
        assert found.min() > 0.5


def test_a_sky_is_read_between_its_levels_whichever_way_they_are_averaged() -> None:
    light, (towards, _) = lamps(), normals(40)
    sky = FilteredSky.of(light, KERNELS)
    for low in (0, 1):
        one, other, between = (
            sky.read(towards, torch.full((len(towards),), level, dtype=torch.float64))
            for level in (low, low + 1.0, low + 0.25)
        )
        assert torch.allclose(between, 0.75 * one + 0.25 * other, rtol=1e-9)


def test_channels_of_a_grey_sky_are_alike() -> None:
    found = SkyHarmonics.of(EnvironmentMap.constant(2.0)).averaged(np.ones(MOST + 1), normals(20)[0].numpy())
    assert found == pytest.approx(2.0, rel=1e-6)
