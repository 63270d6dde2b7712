"""Quick interpolation of scattered samples: what is linear comes back, nothing leaves the samples' values."""

import numpy as np
import pytest
import torch
from torch import Tensor

from homofact.brdf import neighbours
from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.materials import material
from homofact.brdf.neighbours import interpolated
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.geometry.coordinates import rusinkiewicz_angles
from homofact.geometry.directions import draw_in_discs, from_spherical

PLASTIC = material("cook-torrance-plastic").model


def pairs(count: int, seed: int) -> tuple[Tensor, Tensor]:
    return draw_in_discs(count, torch.Generator().manual_seed(seed), 0.9)


def test_logs_that_are_linear_come_back() -> None:
    def values(wi: Tensor, wo: Tensor) -> Tensor:
        theta_h, theta_d, _ = rusinkiewicz_angles(wi, wo)
        return torch.exp(1 + 0.5 * theta_h.sqrt() - 0.4 * theta_d)[:, None].expand(-1, 3)

    samples = Samples(*pairs(4000, 0), values(*pairs(4000, 0)), isotropic=True)
    wi, wo = pairs(500, 1)
    found = interpolated(samples, 1e-5, wi, wo)
    off = (found.readings[0] / values(wi, wo)).log().abs()
    # The samples nearest to an edge do not surround it: the value stays within theirs.
    assert float(off.median()) < 2e-3
    assert float(off.max()) < 0.05


def test_a_sample_is_close_to_itself_and_nothing_leaves_their_values() -> None:
    samples = sample_model(PLASTIC, 3000)
    found = interpolated(samples, 1e-5, samples.wi, samples.wo)
    for reading in found.readings:
        assert float(reading.min()) >= float(samples.values.min()) * (1 - 1e-9)
        assert float(reading.max()) <= float(samples.values.max()) * (1 + 1e-9)
    assert float((found.readings[0] / samples.values).log().abs().median()) < 0.05
    assert not bool(found.beyond.any())


def test_the_halves_are_no_better_than_the_whole() -> None:
    samples = sample_model(PLASTIC, 3000)
    wi, wo = pairs(1000, 5)
    truth = PLASTIC.evaluate(wi, wo)
    whole, one, two, _ = ((each / truth).log().abs().mean() for each in interpolated(samples, 1e-5, wi, wo).readings)
    assert whole < one
    assert whole < two
    assert one != two


def test_a_highlight_that_was_scanned_in_one_plane_is_known_beside_it() -> None:
    lobe = GgxBrdf((0.05,) * 3, (GgxLobe((1.0,) * 3, 0.06, 0.045),))
    coarse = [(i, o, p) for i in range(0, 71, 10) for o in range(0, 81, 5) for p in range(0, 181, 15)]
    fine = [(i, i + off, 180) for i in range(10, 71, 10) for off in np.arange(-6, 6.1, 0.5)]
    angles = torch.from_numpy(np.radians(np.unique(np.array(coarse + fine, float), axis=0)))
    wi = from_spherical(angles[:, 0], 0 * angles[:, 0])
    wo = from_spherical(angles[:, 1], angles[:, 2])
    samples = Samples(wi, wo, lobe.evaluate(wi, wo))
    # The half vector is tilted by 5° out of the plane of incidence.
    beside = torch.tensor([[60.0, 60.0, 174.2]], dtype=torch.float64).deg2rad()
    query = from_spherical(beside[:, 0], 0 * beside[:, 0]), from_spherical(beside[:, 1], beside[:, 2])
    true = float(lobe.evaluate(*query)[0, 0])
    found = interpolated(samples, 0.01, *query)
    assert 0.7 * true < float(found.readings[0][0, 0]) < 1.5 * true
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(neighbours, "READ_AZIMUTH", 4.0)
        assert float(interpolated(samples, 0.01, *query).readings[0][0, 0]) < 0.5 * true


def test_what_is_far_from_all_samples_is_beyond() -> None:
    samples = sample_model(PLASTIC, 3000)
    steep = samples.select((samples.wi[:, 2] > 0.8) & (samples.wo[:, 2] > 0.8))
    wi, wo = pairs(2000, 3)
    beyond = interpolated(steep, 1e-5, wi, wo).beyond
    grazing = (wi[:, 2] < 0.45) & (wo[:, 2] < 0.45)
    inside = (wi[:, 2] > 0.85) & (wo[:, 2] > 0.85)
    assert float(beyond[grazing].double().mean()) > 0.8
    assert float(beyond[inside].double().mean()) < 0.1


def test_under_the_horizon_is_nothing() -> None:
    samples = sample_model(PLASTIC, 300)
    below = torch.tensor([[0.6, 0.0, -0.8]], dtype=torch.float64)
    assert float(interpolated(samples, 1e-5, below, -below).readings[0].sum()) == 0


@pytest.mark.parametrize("isotropic", [True, False])
def test_anisotropic_samples_have_an_interpolation_too(isotropic: bool) -> None:
    model = material("ward-brushed").model
    wi, wo = pairs(4000, 0)
    samples = Samples(wi, wo, model.evaluate(wi, wo), isotropic=isotropic)
    near, far = pairs(300, 2)
    off = (interpolated(samples, 1e-3, near, far).readings[0] / model.evaluate(near, far)).log().abs().mean()
    assert float(off) < 0.5
