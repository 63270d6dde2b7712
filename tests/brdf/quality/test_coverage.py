"""Spread of samples and holes between them."""

import math

import pytest
import torch

from homofact.brdf.analytic import Lambert
from homofact.brdf.quality.coverage import STEPS, holes, occupied_cells, spread
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import describe, open_source
from homofact.geometry.directions import from_spherical

MODEL = Lambert((0.5,), channels=("Y",))


def at(theta_i: list[float], theta_o: list[float], phi: list[float]) -> Samples:
    ti, to, azimuth = (torch.tensor(x, dtype=torch.float64) * (math.pi / 180) for x in (theta_i, theta_o, phi))
    wi, wo = from_spherical(ti, 0 * ti), from_spherical(to, azimuth)
    return Samples(wi, wo, torch.ones(len(ti), 1), channels=("Y",), isotropic=True)


def test_one_sample_leaves_all_cells_but_one() -> None:
    assert holes(at([7], [22], [100])) == {"share": round(215 / 216, 4), "empty": 215, "cells": 216}


def test_a_sample_in_every_cell_leaves_none_and_mirrored_ones_fill_the_same() -> None:
    middle = [7.5 + 15 * k for k in range(STEPS)]
    every = [(a, b, 2 * c) for a in middle for b in middle for c in middle]
    full = at(*(list(x) for x in zip(*every, strict=True)))
    assert holes(full)["empty"] == 0
    assert holes(full.select(full.wi[:, 2] > 0.5))["share"] == pytest.approx(1 / 3, abs=1e-4)
    mirrored = at([30, 30], [40, 40], [50, -50])
    assert holes(mirrored)["empty"] == 215


def test_a_model_drawn_densely_has_no_holes() -> None:
    assert holes(sample_model(MODEL, 45_000))["empty"] == 0


def test_places_outside_go_to_the_edge() -> None:
    place = torch.tensor([[0.0, 0.0], [1.0, 1.0], [0.49, 0.51], [-0.1, 1.2]], dtype=torch.float64)
    assert occupied_cells(place, (2, 3)).tolist() == [0, 5, 1, 2]


def test_spread_is_of_the_angles() -> None:
    found = spread(at([0, 0, 30, 60], [10, 20, 30, 60], [0, 90, 180, 180]))
    assert found["lights"] == 3  # the normal is one light at any azimuth
    assert found["theta_i"] == [0.0, 30.0, 60.0]
    assert found["theta_h"][0] == 0.0
    nearly = from_spherical(torch.full((3,), 1e-8, dtype=torch.float64), torch.tensor([0.0, 1.0, 2.0]).double())
    assert spread(Samples(nearly, nearly, torch.ones(3, 1), channels=("Y",), isotropic=True))["lights"] == 1


def test_info_has_them_and_the_units() -> None:
    facts = describe(open_source("material:ward-brushed", count=2000))
    assert facts["units"] == "1/sr, no cosine"
    assert facts["faults"]["holes"]["cells"] == 216
    assert facts["spread_degrees"]["theta_o"][0] < facts["spread_degrees"]["theta_o"][2]


def test_lights_are_told_apart_by_a_hundredth_of_a_degree_in_either_angle() -> None:
    theta = [10.0, 10.0, 10.004, 10.02, 10.0, 9.0]
    phi = torch.tensor([0.0, 180.0, 0.0, 0.0, -0.02, 100.0], dtype=torch.float64).deg2rad()
    wi = from_spherical(torch.tensor(theta, dtype=torch.float64).deg2rad(), phi)
    assert spread(Samples(wi, wi, torch.ones(6, 1), channels=("Y",), isotropic=False))["lights"] == 5


def test_angles_on_the_border_of_two_cells_are_in_the_upper_one() -> None:
    """Rings of 15° lie on the borders of the grid: their rounding does not decide which cells are empty."""
    i, o, phi = torch.cartesian_prod(
        *(torch.arange(first, most, step) for first, most, step in ((15, 76, 15), (15, 76, 15), (0, 181, 30)))
    ).T
    found = []
    for shift in (0.0, 1e-5):
        angles = [each.double().deg2rad() + math.radians(shift) for each in (i, o, phi)]
        wi, wo = from_spherical(angles[0], 0 * angles[0]), from_spherical(angles[1], angles[2])
        found.append(holes(Samples(wi, wo, torch.ones(len(i), 1), isotropic=True))["empty"])
    assert found == [216 - 5 * 5 * 6] * 2
