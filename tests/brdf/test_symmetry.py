"""What stays the same in a BRDF: of models whose symmetries are known, of samples, and of how samples were taken."""

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from homofact.brdf.analytic import Lambert, Phong, Ward
from homofact.brdf.materials import material
from homofact.brdf.samples import Samples, lit_from_one_azimuth
from homofact.brdf.sampling import sample_model
from homofact.brdf.symmetry import (
    Symmetry,
    angles_of_pairs,
    find_symmetry,
    light_azimuths,
    reciprocity_of,
    reciprocity_of_samples,
    ring_numbers,
)
from homofact.geometry.coordinates import coordinate_system
from homofact.geometry.directions import draw_cosine_weighted, from_spherical

ALL = Symmetry(isotropic=True, reciprocal=True, mirrored=True, half_turn=True)


class OneSided(Lambert):
    """A matte surface that is brighter the more the light grazes: not reciprocal."""

    def formula(self, wi: Tensor, wo: Tensor) -> Tensor:
        return super().formula(wi, wo) * (1 + wo[:, 2:])


def grid(model: Lambert | Phong) -> Samples:
    angles = torch.arange(5, 80, 15).double() * (math.pi / 180)
    theta_i, theta_o, phi = (x.reshape(-1) for x in torch.meshgrid(angles, angles, angles, indexing="ij"))
    wi, wo = from_spherical(theta_i, 0 * phi), from_spherical(theta_o, phi)
    return Samples(wi, wo, model.evaluate(wi, wo), channels=model.channels, isotropic=True)


def test_reciprocal_models_have_no_error() -> None:
    assert reciprocity_of(material("lafortune-blue-paint").model)["p95"] < 1e-6
    error = reciprocity_of(OneSided((0.5,), channels=("Y",)))
    # |cosθi − cosθo|/(1 + mean cosine) at cosine-weighted pairs: .12 in the median.
    assert error["median"] == pytest.approx(0.125, abs=0.03)


def test_samples_are_compared_with_their_swapped_places() -> None:
    error = reciprocity_of_samples(grid(Phong((0.2,), (0.3,), 20, channels=("Y",))))
    assert error is not None
    assert error["p95"] < 1e-6
    assert error["pairs"] == 5 * 5 * 5 - 5 * 5
    lopsided = reciprocity_of_samples(grid(OneSided((0.5,), channels=("Y",))))
    assert lopsided is not None
    assert lopsided["median"] > 0.1


def test_samples_without_swapped_places_say_nothing() -> None:
    assert reciprocity_of_samples(sample_model(material("phong-30").model, 50)) is None


class Askew(Lambert):
    """Brighter towards +x, seen from there, and at an angle to the axes: nothing stays the same."""

    def formula(self, wi: Tensor, wo: Tensor) -> Tensor:
        return super().formula(wi, wo) * (3 + wi[:, :1] + 0.5 * wo[:, 1:2])


class Rim(Lambert):
    """A matte surface that tells azimuths apart beyond 60° only."""

    def formula(self, wi: Tensor, wo: Tensor) -> Tensor:
        return super().formula(wi, wo) * (1 + wi[:, :1] ** 2 * (wi[:, 2:] < 0.5))


def test_symmetries_of_models() -> None:
    one = {"channels": ("Y",)}
    assert find_symmetry(Lambert((0.5,), **one)) == ALL
    assert find_symmetry(OneSided((0.5,), **one)) == replace(ALL, reciprocal=False)
    assert find_symmetry(Askew((0.5,), **one)) == Symmetry(False, False, False, False)
    # Nearly all of a bright base, its sharp highlight alone is brushed.
    assert find_symmetry(Ward((0.9,), (0.05,), 0.02, 0.06, **one)) == replace(ALL, isotropic=False)


def test_only_pairs_within_the_limit_count() -> None:
    rim = Rim((0.5,), channels=("Y",))
    assert find_symmetry(rim).isotropic is False
    assert find_symmetry(rim, math.radians(59)).isotropic is True


def test_light_from_one_azimuth() -> None:
    def lit(theta: list[float], phi: list[float]) -> bool:
        return lit_from_one_azimuth(from_spherical(*(torch.tensor(each, dtype=torch.float64) for each in (theta, phi))))

    assert lit([0.1, 0.7, 1.5], [0.3, 0.3, 0.3])
    assert lit([0.1, 0.7], [0.0, 2 * math.pi])
    assert lit([0.0, 0.7, 0.0], [2.0, 0.3, 0.0])
    assert lit([0.0], [2.0])
    assert not lit([0.1, 0.7, 1.5], [0.3, 0.3, 0.31])
    assert not lit([0.5, 0.5], [0.0, math.pi])
    assert light_azimuths(True) == (0.0,)
    assert light_azimuths(False) == (0.0, math.pi / 2)


def test_rings() -> None:
    theta = torch.tensor([0.2, 0.5, 0.8, 1.1], dtype=torch.float64).repeat(9)
    phi = torch.linspace(0, 6, 36, dtype=torch.float64)
    found = ring_numbers(from_spherical(theta, phi))
    assert found is not None
    assert found[1] == 4
    assert found[0].tolist() == [0, 1, 2, 3] * 9
    # Rings are as wide as a motor is exact; of three there is none to leave out, and a few samples make no ring.
    assert ring_numbers(from_spherical(theta + 1e-4 * torch.sin(phi), phi)) is not None
    assert ring_numbers(from_spherical(theta.clamp_max(0.8), phi)) is None
    assert ring_numbers(from_spherical(theta[:28], phi[:28])) is None
    assert ring_numbers(from_spherical(theta + 0.1 * phi, phi)) is None


def test_angles_of_pairs_are_those_of_the_isotropic_coordinates() -> None:
    wi, wo = draw_cosine_weighted(200, torch.Generator().manual_seed(0))
    scaled = (coordinate_system("isotropic-in-out").evaluate(wi, wo) + 1) * (math.pi / 4)
    torch.testing.assert_close(angles_of_pairs(wi, wo), scaled * torch.tensor([1.0, 1.0, 2.0]), rtol=1e-6, atol=1e-6)
