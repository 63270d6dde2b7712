"""The octahedral pyramid: directions, solid angles, averages, and no seams."""

import math
from typing import Any

import numpy as np
import pytest
import torch

from homofact.rendering.light import EnvironmentMap
from homofact.rendering.octahedral import Pyramid, fetch

PLAIN: Any = fetch.py_func
AXES = torch.eye(3, dtype=torch.float64)


def smooth(rows: int = 256) -> EnvironmentMap:
    """2 + x, 2 + y and 2 + z of the direction (x, y, z)."""
    theta = (torch.arange(rows, dtype=torch.float64) + 0.5) * (math.pi / rows)
    phi = ((torch.arange(2 * rows, dtype=torch.float64) + 0.5) / (2 * rows) - 0.5) * (2 * math.pi)
    theta, phi = torch.meshgrid(theta, phi, indexing="ij")
    sine = torch.sin(theta)
    return EnvironmentMap(2 + torch.stack((sine * torch.sin(phi), torch.cos(theta), -sine * torch.cos(phi)), -1))


def directions(count: int = 400) -> np.ndarray:
    d = np.random.default_rng(0).normal(size=(count, 3))
    # Some on the folds and at the corner, where texels of different edges meet.
    d[:20, 2] = 0
    d[20:40, :2] *= 1e-3
    d[20:40, 2] = -1
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def read(pyramid: Pyramid, d: np.ndarray, solid: float) -> tuple[float, float, float]:
    return PLAIN(pyramid.texels, pyramid.starts, pyramid.sides, d[0], d[1], d[2], math.log2(solid) / 2)


def test_a_smooth_map_is_read_everywhere_alike() -> None:
    pyramid = Pyramid.of(smooth(), AXES)
    for d in directions():
        assert read(pyramid, d, 1e-6) == pytest.approx(tuple(2 + d), abs=0.02)
        assert read(pyramid, 3.7 * d, 0.01) == pytest.approx(tuple(2 + d), abs=0.06)


def test_axes_turn_the_map() -> None:
    axes = torch.tensor([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], dtype=torch.float64)
    pyramid = Pyramid.of(smooth(), axes)
    for d in directions(20):
        assert read(pyramid, d, 1e-6) == pytest.approx(tuple(2 + d @ axes.numpy()), abs=0.02)


def test_wide_readings_are_averages() -> None:
    # Of black and white stripes narrower than what is averaged nothing is left but grey.
    level = torch.zeros(256, 512, 1, dtype=torch.float64)
    level[:, ::8] = level[:, 1::8] = level[:, 2::8] = level[:, 3::8] = 1.0
    pyramid = Pyramid.of(EnvironmentMap(level), AXES)
    for d in directions(100):
        if abs(d[1]) < 0.7:
            assert read(pyramid, d, math.radians(24) ** 2)[0] == pytest.approx(0.5, abs=0.06)
    sharp = [read(pyramid, d, 1e-5)[0] for d in directions(100)]
    assert np.std(sharp) > 0.3


def test_every_level_has_all_the_light_and_so_have_the_lamps() -> None:
    level = torch.rand(64, 128, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0)) ** 8
    level[20, 30] = 500.0
    pyramid = Pyramid.of(EnvironmentMap(level), AXES)
    edges = torch.cos(torch.arange(65, dtype=torch.float64) * (math.pi / 64))
    expected = (level * ((edges[:-1] - edges[1:]) * (math.pi / 64))[:, None, None]).sum((0, 1)).tolist()
    assert pyramid.solid.sum() == pytest.approx(4 * math.pi)
    solid = pyramid.solid
    for start, side in zip(pyramid.starts, pyramid.sides, strict=True):
        inner = pyramid.texels[start : start + (side + 2) ** 2].reshape(side + 2, side + 2, 3)[1:-1, 1:-1]
        assert (inner * solid[..., None]).sum((0, 1)).tolist() == pytest.approx(expected, rel=0.03)
        solid = solid.reshape(side // 2, 2, side // 2, 2).sum((1, 3))
    where, light = pyramid.lamps(16, 64)
    assert light.sum(0).tolist() == pytest.approx(expected, rel=0.03)
    assert np.linalg.norm(where, axis=1) == pytest.approx(np.ones(len(where)))
    # The bright pixel's cell is divided, most others are not.
    assert 256 < len(light) < 600
    brightest = where[light.sum(1).argmax()]
    phi, theta = (30.5 / 128 - 0.5) * 2 * math.pi, 20.5 / 64 * math.pi
    pixel = (math.sin(theta) * math.sin(phi), math.cos(theta), -math.sin(theta) * math.cos(phi))
    assert brightest @ np.array(pixel) > math.cos(math.radians(2))
