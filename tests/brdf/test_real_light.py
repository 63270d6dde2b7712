"""Real files of measured light: the same surface in two formats, and XML beside its own totals."""

import math
from pathlib import Path

import pytest
import torch

from homofact.brdf.formats import open_file
from homofact.brdf.incidences import IncidenceTable, IncidenceTables, directions
from homofact.brdf.klems import FULL
from homofact.brdf.reflectance import innermost
from homofact.geometry.directions import from_spherical, to_spherical


def tables(path: str) -> IncidenceTables:
    found = innermost(open_file(path).reflectance)  # pyright: ignore[reportArgumentType]
    assert isinstance(found, IncidenceTables)
    return found


def light_of(table: IncidenceTable, count: int) -> torch.Tensor:
    theta, turn = (torch.tensor(x, dtype=torch.float64) for x in (table.theta_i, table.turn))
    return from_spherical(theta, turn).expand(count, 3)


def test_a_zemax_file_and_the_speos_file_made_of_it(real_data: Path) -> None:
    zemax = tables(str(real_data / "lighting/planesymmetric_zemax.bsdf"))
    speos = tables(str(real_data / "lighting/planesymmetric_speos.anisotropicbsdf") + "#table")
    for row in speos.tables[0]:
        wo, values = directions(row, about_mirror=False), row.values.reshape(-1)
        mirror = light_of(row, len(wo)) * torch.tensor([-1.0, -1, 1], dtype=torch.float64)
        # Beyond the last angle that was measured the converter writes 0.
        inner = (wo[:, 2] > 0.03) & ((wo * mirror).sum(1) > math.cos(math.radians(79.99)))
        found = zemax.evaluate(light_of(row, len(wo))[inner], wo[inner])[:, 0]
        # It scales each incidence to its TIS, times π.
        scale = float((values[inner] * found).sum() / (found**2).sum())
        assert scale / math.pi == pytest.approx(1.1, abs=0.11)
        assert float((values[inner] - scale * found).abs().max()) < 1e-12 * float(values.max())


def test_a_speos_file_and_the_zemax_file_made_of_it(real_data: Path) -> None:
    zemax = tables(str(real_data / "lighting/one_wavelength_zemax.bsdf"))
    speos = tables(str(real_data / "lighting/one_wavelength_speos.brdf") + "#table")
    for row in zemax.tables[0]:
        wo, values = directions(row, about_mirror=True), row.values.reshape(-1)
        # The converter has special rules at x = 0, and rounds angles to hundredths of a degree.
        inner = (wo[:, 2] > 0.01) & (wo[:, 0].abs() > 0.0051)
        theta, phi = ((x.rad2deg() * 100).round().div(100).deg2rad() for x in to_spherical(wo[inner]))
        found = speos.evaluate(light_of(row, int(inner.sum())), from_spherical(theta, phi))[:, 0]
        # The file has four digits: half of the last one is at most 5e-4.
        off = (values[inner] - found).abs()
        assert float((off / values[inner]).max()) < 5.1e-4
        assert float(off.mean() / values[inner].mean()) < 2e-4


def test_the_same_light_by_both_where_their_totals_are_taken(real_data: Path) -> None:
    zemax = tables(str(real_data / "lighting/one_wavelength_zemax.bsdf") + "#total")
    speos = tables(str(real_data / "lighting/one_wavelength_speos.brdf"))
    wo = from_spherical(torch.linspace(0, 1.4, 30), torch.linspace(0, 6, 30)).double()
    for row in speos.tables[0]:
        wi = light_of(row, len(wo))
        # The total of 1.932% is written as 0.019.
        assert torch.allclose(zemax.evaluate(wi, wo), speos.evaluate(wi, wo), rtol=0.03)


@pytest.mark.parametrize("side", ["front", "back"])
@pytest.mark.parametrize(
    ("name", "most"), [("klems_mcs6216", 0.1), ("klems_blinds", 0.02), ("tensortree_blinds", 0.25)]
)
def test_light_and_viewer_can_be_exchanged(real_data: Path, name: str, side: str, most: float) -> None:
    reflectance = open_file(f"{real_data / 'lighting' / name}.xml#{side}").reflectance
    assert reflectance is not None
    wi = FULL.middles()[:, None].expand(145, 145, 3).reshape(-1, 3)
    wo = FULL.middles().repeat(145, 1)
    weight = wi[:, 2] * wo[:, 2]
    one, other = (reflectance.evaluate(*pair)[:, 0] for pair in ((wi, wo), (wo, wi)))
    off = float(((one - other).abs() * weight).sum() / (one * weight).sum())
    assert off < most
    # With y of one direction turned round it is far more.
    turned = reflectance.evaluate(wo * torch.tensor([1.0, -1, 1]).double(), wi)[:, 0]
    assert float(((one - turned).abs() * weight).sum() / (one * weight).sum()) > 1.7 * off
