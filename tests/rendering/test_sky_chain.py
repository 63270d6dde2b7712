"""The chain of a sky: known averages of simple skies on every level, a lamp by brute force, sizes."""

import math

import numpy as np
import pytest
import torch
from skies import chain, gradient, lamps, normals
from torch import Tensor

from homofact.errors import BadInput
from homofact.geometry.directions import normalize
from homofact.rendering.chain_kernels import cosine_power
from homofact.rendering.cube import directions_of
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.sky_chain import LAST, chain_of, own_kernels, sides_of


@pytest.mark.slow
def test_lobes_are_of_flux_one_and_the_last_is_the_cosine() -> None:
    gamma = (np.arange(200_000) + 0.5) * (math.pi / 2 / 200_000)
    for alpha in own_kernels(256).alphas:
        flux = 2 * math.pi * (cosine_power(alpha, gamma) * np.sin(gamma)).sum() * (math.pi / 2 / len(gamma))
        assert flux == pytest.approx(1, abs=1e-6)
    assert cosine_power(1.0, gamma) == pytest.approx(np.cos(gamma) / math.pi)
    assert (cosine_power(0.5, np.array([1.6, 3.0])) == 0).all()


def test_sides_halve_and_widths_grow_geometrically_to_one() -> None:
    assert sides_of(256) == [256, 128, 64, 32, 16, 8]
    assert sides_of(32) == [32, 16, LAST]
    alphas = own_kernels(256).alphas
    assert alphas[0] == pytest.approx(4 / 256)
    assert alphas[-1] == 1
    assert np.diff(np.log(alphas)) == pytest.approx(np.log(64) / 5)


@pytest.mark.parametrize("side", [0, 16, 48, 2048, -64])
def test_other_sides_are_refused(side: int) -> None:
    with pytest.raises(BadInput, match=f"found {side} texels per side, expected a power of two from 32 to 1024"):
        chain_of(gradient(), side)


@pytest.mark.slow
def test_every_level_of_a_gradient_is_known() -> None:
    """Of 1 + s·ω the mean over cosᵖ is 1 + (p + 1)/(p + 2) s·m, on the last level E/π = 1 + ⅔ s·n."""
    slope, known = (0.3, 0.4, -0.2), chain("gradient", 64)
    for level, alpha in zip((*known.levels, known.irradiance), (*own_kernels(64).alphas, 1.0), strict=True):
        power = alpha**-2
        m = directions_of(level.shape[1])
        expected = (1 + (power + 1) / (power + 2) * m @ m.new_tensor(slope))[..., None] * m.new_tensor((1, 2, 3))
        assert torch.allclose(level, expected, rtol=6e-3)


@pytest.mark.slow
def test_every_level_of_a_band_is_known() -> None:
    """Of 3z² the mean is 1 + P2(z) times that of 2 P2 over cosᵖ, (3 (p + 1)/(p + 3) − 1)."""
    sky = gradient((0.0, 0.0, 1.0), 128)
    band = EnvironmentMap(3 * (sky.radiance[..., :1] - 1) ** 2, name="band")
    known = chain_of(band, 64)
    for level, alpha in zip(known.levels, own_kernels(64).alphas, strict=True):
        z = directions_of(level.shape[1])[..., 2]
        gain = 3 * (alpha**-2 + 1) / (alpha**-2 + 3) - 1
        assert torch.allclose(level[..., 0], 1 + gain * (3 * z * z - 1) / 2, atol=2e-2)
    x, y, z = normals()[0].unbind(1)
    basis = torch.stack((torch.ones_like(x), x, y, z, x * y, y * z, z * x, 3 * z * z - 1, x * x - y * y), 1)
    assert torch.allclose((basis @ known.harmonics)[:, 0], 1 + (3 * z * z - 1) / 4, atol=5e-3)


def averaged(light: EnvironmentMap, towards: Tensor, alpha: float) -> Tensor:
    """The sum over all texels of the map."""
    rows, columns, _ = light.radiance.shape
    theta = (torch.arange(rows, dtype=torch.float64) + 0.5) * (math.pi / rows)
    around = ((torch.arange(columns, dtype=torch.float64) + 0.5) / columns - 0.5) * (2 * math.pi)
    t, a = torch.meshgrid(theta, around, indexing="ij")
    w = torch.stack((t.sin() * a.sin(), t.cos(), -t.sin() * a.cos()), -1).reshape(-1, 3)
    angle = torch.acos((towards @ w.T).clamp(-1, 1))
    weight = torch.from_numpy(cosine_power(alpha, angle.numpy())) * t.sin().reshape(-1)
    return weight @ light.radiance.reshape(-1, light.radiance.shape[2]) / weight.sum(1, keepdim=True)


@pytest.mark.slow
def test_lamps_are_averaged_as_by_brute_force() -> None:
    light = lamps(rows=128)
    known = chain_of(light, 32)
    for level, alpha in zip((*known.levels, known.irradiance), (*own_kernels(32).alphas, 1.0), strict=True):
        every = max(level[..., 0].numel() // 150, 1)
        d, found = directions_of(level.shape[1]).reshape(-1, 3)[::every], level.reshape(-1, 3)[::every]
        expected = averaged(light, d, alpha)
        assert float((found - expected).norm() / expected.norm()) < 0.02
        # It would be seen if the light were mirrored, turned or another level's.
        assert float((averaged(light, d * d.new_tensor((-1, 1, 1)), alpha) - expected).norm() / expected.norm()) > 0.1
        assert float((averaged(light, d, 1.3 * alpha) - expected).norm() / expected.norm()) > 0.04


@pytest.mark.slow
def test_bright_light_is_scaled_into_half_floats() -> None:
    radiance = lamps().radiance.clone()
    radiance[10, 20] = 1e8
    bright, plain = chain_of(EnvironmentMap(radiance, name="sun"), 32), chain()
    assert math.log2(bright.factor) == round(math.log2(bright.factor)) > 0
    assert 2**14 < max(float(level.max()) for level in bright.levels) <= 2**15
    assert plain.factor == 1
    d = normalize(torch.tensor([[0.0, -1.0, 0.2]], dtype=torch.float64))
    dark = [each.cube.read(d, torch.zeros(1)) * each.factor for each in (bright, plain)]
    assert torch.allclose(*dark, rtol=1e-2)


@pytest.mark.slow
def test_bytes_are_those_of_half_floats() -> None:
    constant = chain("constant")
    assert constant.nbytes == 8 * 6 * (32**2 + 16**2 + 8**2 + 32**2)
    for level in (*constant.levels, constant.irradiance):
        assert level.flatten().tolist() == pytest.approx([2.0] * level.numel(), rel=1e-5)
