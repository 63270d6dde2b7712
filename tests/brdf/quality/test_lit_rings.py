"""The light of a goniometer's ring is that of the material, also where its highlight was scanned in one plane alone."""

import math

import pytest
import torch

from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.quality.faults import albedo
from homofact.brdf.quality.lit_rings import lit_rings
from homofact.brdf.samples import Samples
from homofact.geometry.directions import from_spherical


def scanned(model: GgxBrdf, azimuth: float = 0.0) -> Samples:
    """Rings of 5° by 15°, and steps of half a degree across the highlight in the plane of incidence."""
    rows = [(i, o, p) for i in (15.0, 40.0, 65.0) for o in range(0, 81, 5) for p in range(0, 181, 15)]
    rows += [(i, i + off / 2, 180.0) for i in (15.0, 40.0, 65.0) for off in range(-8, 9)]
    i, o, phi = torch.tensor(rows, dtype=torch.float64).deg2rad().T
    wi, wo = from_spherical(i, i * 0 + azimuth), from_spherical(o, phi + azimuth)
    return Samples(wi, wo, model.evaluate(wi, wo), isotropic=True)


@pytest.mark.parametrize(("roughness", "within"), [(0.03, 0.08), (0.1, 0.05), (0.4, 0.03)])
@pytest.mark.parametrize("azimuth", [0.0, 2.0])
def test_the_light_of_a_ring_is_that_of_the_material(roughness: float, within: float, azimuth: float) -> None:
    model = GgxBrdf((0.1, 0.2, 0.3), (GgxLobe((1.0, 1.0, 1.0), roughness, 0.05),))
    samples = scanned(model, azimuth)
    rings = lit_rings(samples)
    assert [round(ring.degrees) for ring in rings] == [15, 40, 65]
    for ring in rings:
        found = float(ring.weights @ samples.values[ring.index].mean(1))
        expected = float(albedo(model, ring.degrees, rings=96).mean())
        assert found == pytest.approx(expected, rel=within)
        assert float(ring.weights.sum()) == pytest.approx(math.pi, rel=1e-3)


def test_samples_on_one_side_of_the_hemisphere_are_no_ring() -> None:
    samples = scanned(GgxBrdf((0.2,) * 3, (GgxLobe((1.0,) * 3, 0.2, 0.05),)))
    assert lit_rings(samples.select(samples.wo[:, 0] <= 0.1)) == ()
