"""The cube map and its Haar transform: solid angles, light that is kept, scalar products, inverses."""

import math

import numpy as np
import pytest
import torch

from homofact.errors import BadInput
from homofact.relighting import cube
from homofact.relighting.haar import transform_faces, transformed
from homofact.rendering.light import EnvironmentMap


@pytest.mark.parametrize("size", cube.SIZES)
def test_six_faces_make_the_sphere(size: int) -> None:
    angles = cube.solid_angles(size)
    assert 6 * angles.sum() == pytest.approx(4 * math.pi, rel=1e-12)
    w = cube.directions(size)
    assert np.linalg.norm(w, axis=-1) == pytest.approx(1)
    # ∫ ω = 0 and ∫ ω ωᵀ = 4π/3: the directions are where the solid angles are.
    assert np.einsum("fijk,ij->k", w, angles) == pytest.approx(np.zeros(3), abs=1e-12)
    second = np.einsum("fijk,fijl,ij->kl", w, w, angles)
    assert second == pytest.approx(np.eye(3) * 4 * math.pi / 3, abs=1e-2)


def test_every_direction_finds_its_texel() -> None:
    w = cube.directions(16).reshape(-1, 3)
    assert (cube.texel_of(w, 16) == np.arange(len(w))).all()


@pytest.mark.parametrize("rows", [8, 64, 256])
def test_an_environment_keeps_its_light_and_place(rows: int) -> None:
    radiance = torch.zeros(rows, 2 * rows, 3, dtype=torch.float64)
    row, column = rows // 3, rows
    radiance[row, column] = torch.tensor([3.0, 2.0, 1.0])
    light = EnvironmentMap(radiance, 0.7)
    found = cube.environment_cube(light, 16)
    edges = [math.cos(math.pi * r / rows) for r in (row, row + 1)]
    flux = (edges[0] - edges[1]) * math.pi / rows
    total = np.einsum("fijc,ij->c", found, cube.solid_angles(16))
    # A texel far smaller than the cube's is given whole, but that its texel got a little more or less of the map.
    assert total == pytest.approx(flux * np.array([3.0, 2.0, 1.0]), rel=0.2)
    polar, azimuth = math.pi * (row + 0.5) / rows, ((column + 0.5) / (2 * rows) - 0.5) * 2 * math.pi - 0.7
    centre = (math.sin(polar) * math.sin(azimuth), math.cos(polar), -math.sin(polar) * math.cos(azimuth))
    mean = np.einsum("fijc,ij,fijk->k", found, cube.solid_angles(16), cube.directions(16))
    assert mean / np.linalg.norm(mean) @ centre > 0.99


def test_constant_light_stays_constant() -> None:
    for rows in (8, 256):
        found = cube.environment_cube(EnvironmentMap.constant(2.5, rows), 16)
        assert found == pytest.approx(2.5, rel=1e-12)


def test_haar_is_orthonormal_and_comes_back() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, 6, 32, 32))
    assert (transformed(a) * transformed(b)).sum() == pytest.approx((a * b).sum())
    unit = transformed(np.eye(1024).reshape(-1, 32, 32)).reshape(1024, -1)
    assert transformed(a).reshape(6, -1) @ unit.T == pytest.approx(a.reshape(6, -1))
    flat = transformed(np.ones((8, 8)))
    assert flat[0, 0] == pytest.approx(8)
    assert np.abs(flat).sum() == pytest.approx(8)


def test_a_detail_is_one_coefficient() -> None:
    picture = np.zeros((8, 8))
    picture[2:4, 4:6] = [[1, -1], [1, -1]]
    found = transformed(picture)
    assert np.count_nonzero(np.abs(found) > 1e-12) == 1
    # Horizontal details of the finest level stand to the right of the sums, at half the place.
    assert found[1, 4 + 2] == pytest.approx(2)


def test_the_compiled_transform_is_the_same() -> None:
    rng = np.random.default_rng(1)
    faces = rng.normal(size=(6, 16, 16)).astype(np.float32)
    faces[2] = 0
    faces[3, :15] = 0
    expected = transformed(faces)
    transform_faces(faces, np.empty((16, 16), np.float32))
    assert faces == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("size", [0, 12, 128])
def test_other_sizes_are_refused(size: int) -> None:
    with pytest.raises(BadInput, match=f"cube: found {size} texels along a face, expected one of 8, 16, 32, 64"):
        cube.check_size(size)
