"""The scheme lobe: its density, and that what is defined over the discs does not depend on it."""

import math

import numpy as np
import pytest
import torch

from homofact.brdf.analytic import Ward
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.pair_density import density, draw_lobe, over_discs, solid_angles
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.evaluation.energy import energy_errors
from homofact.evaluation.metrics import measure
from homofact.geometry.coordinates import rusinkiewicz_angles
from homofact.geometry.directions import draw_uniform

PAIRS = draw_lobe(200_000, torch.Generator().manual_seed(3))
GLOSS = Ward((0.1, 0.05), (0.3, 0.2), alpha_x=0.05, alpha_y=0.05, channels=("R", "G"))


def test_the_density_is_that_of_the_draw() -> None:
    """Integrals of known value by pairs over their density: of 1 over the discs, of cosines, of one in θh."""
    wi, wo = PAIRS
    q = density("lobe", wi, wo)
    assert float((density("discs", wi, wo) / q).mean()) == pytest.approx(1, abs=0.01)
    assert float((wi[:, 2] * wo[:, 2] / q).mean()) == pytest.approx(math.pi**2, rel=0.02)
    # ∫∫ exp(−(θh/w)²) dωi dωo for a narrow w, over all difference vectors: 4 · π w² · ∫ cosθd dωd.
    for width in (0.002, 0.02):
        theta_h, theta_d, _ = rusinkiewicz_angles(wi, wo)
        inside = theta_d < 1.4
        found = float((torch.exp(-((theta_h / width) ** 2)) * inside / q).mean())
        assert found == pytest.approx(4 * math.pi * width**2 * math.pi * math.sin(1.4) ** 2, rel=0.03)
    uniform = draw_uniform(400_000, torch.Generator().manual_seed(1))
    assert float(density("lobe", *uniform).mean()) * (2 * math.pi) ** 2 == pytest.approx(1, abs=0.15)


def test_every_decade_of_the_half_vector_has_as_many_samples() -> None:
    theta_h, theta_d, _ = rusinkiewicz_angles(*PAIRS)
    degrees = theta_h * (180 / math.pi)
    decades = [float(((degrees > low) & (degrees <= 10 * low)).double().mean()) for low in (0.1, 1.0)]
    assert decades[0] == pytest.approx(0.375 * math.log(10) / math.asinh(90 / 0.05) * 0.97 / 0.912, abs=0.015)
    assert decades[1] > decades[0]
    assert float((theta_d < math.radians(1)).double().mean()) > 0.02


def test_a_and_the_cole_error_do_not_depend_on_the_scheme() -> None:
    # Of a narrow lobe the discs' own mean is the poorer estimate: 60,000 pairs leave it 12% short at a slope of 0.05.
    broad = Ward((0.1, 0.05), (0.3, 0.2), alpha_x=0.25, alpha_y=0.25, channels=("R", "G"))
    discs, lobe = (sample_model(broad, 60_000, scheme, seed=4) for scheme in ("discs", "lobe"))
    means = [LogTransform.of(each, 1e-3).mean for each in (discs, lobe)]
    np.testing.assert_allclose(means[0], means[1], rtol=0.04)
    transform = LogTransform.of(discs, 1e-3)
    other = Ward((0.12, 0.06), (0.3, 0.2), alpha_x=0.3, alpha_y=0.3, channels=("R", "G"))
    errors = [measure(other, each, transform).log_mse for each in (discs, lobe)]
    assert errors[1] == pytest.approx(errors[0], rel=0.06)
    assert torch.equal(over_discs(discs), discs.weights)


@pytest.mark.parametrize("scheme", ["discs", "grid", "lobe", "cosine"])
def test_solid_angles_give_the_energy(scheme: str) -> None:
    broad = Ward((0.1, 0.1), (0.2, 0.2), alpha_x=0.3, alpha_y=0.3, channels=("R", "G"))
    samples = sample_model(broad, 100_000, scheme, seed=1)
    dark = Ward((0.0, 0.0), (0.2, 0.2), alpha_x=0.3, alpha_y=0.3, channels=("R", "G"))
    expected = energy_errors(dark, broad, True).energy_overall
    share = solid_angles(samples) * samples.wi[:, 2] * samples.wo[:, 2]
    found = (share[:, None] * dark.evaluate(samples.wi, samples.wo)).sum() / (share[:, None] * samples.values).sum()
    assert float(found) == pytest.approx(expected, rel=0.03)


def test_a_measurement_is_counted_by_cells() -> None:
    wi, wo = draw_uniform(60_000, torch.Generator().manual_seed(0))
    values = torch.ones(len(wi), 1, dtype=torch.float64)
    crowded = torch.cat((torch.arange(len(wi)), torch.nonzero(wi[:, 2] > 0.9)[:, 0].repeat(5)))
    samples = Samples(wi, wo, values, channels=("Y",), isotropic=True)
    assert float((wi[crowded, 2] > 0.9).double().mean()) > 0.35
    solid = solid_angles(samples.select(crowded))
    steep = solid[wi[crowded, 2] > 0.9].sum() / solid.sum()
    assert float(steep) == pytest.approx(float((wi[:, 2] > 0.9).double().mean()), abs=0.1)
    weighed = Samples(wi, wo, values, channels=("Y",), isotropic=True, weights=wi[:, 2], provenance={"weights": "x"})
    assert torch.equal(solid_angles(weighed), weighed.weights)
