"""The light of a fit over that of its samples, by angle of incidence: of measurements, and of bands that hold some."""

import math
from dataclasses import replace

import pytest
import torch
from goniometer import steel_rings
from judged import seen, verdict

from homofact.brdf.materials import material
from homofact.brdf.quality.lit_rings import lit_rings
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import source_of
from homofact.cli.verdicts import incidence_lines
from homofact.evaluation.compare import fit_and_measure
from homofact.evaluation.verdict.flux import BANDS, by_incidence, flux_of
from homofact.geometry.directions import from_spherical, to_spherical
from homofact.methods.mccool import McCool


def test_angles_with_samples_enough_have_rows_of_their_own() -> None:
    # As files have them, 30° and 45° are just below or above the edges of the bands.
    angles = torch.tensor([15.0, 30.0, 45.0], dtype=torch.float64).repeat_interleave(40)
    angles = (angles + torch.linspace(-1e-5, 1e-5, 120)).deg2rad()
    views = torch.linspace(0, 1.3, 40).repeat(3)
    wi, wo = from_spherical(angles, torch.zeros(120)), from_spherical(views, torch.full((120,), math.pi))
    samples = Samples(wi, wo, torch.ones(120, 3))
    factor = torch.tensor([1.0, 2.0, 3.0]).repeat_interleave(40)
    rows = by_incidence(samples, flux_of(samples), samples.values * factor[:, None])
    assert [row[0] for row in rows] == [row[1] for row in rows] == pytest.approx([15, 30, 45])
    assert [row[2] for row in rows] == pytest.approx([1, 2, 3])
    # At 45° there are too few.
    few = samples.select(torch.arange(100))
    rows = by_incidence(few, flux_of(few), few.values * factor[:100, None])
    assert [row[:2] for row in rows] == [(15, 30), (30, 45)]


def test_one_dense_ring_among_other_angles_does_not_hide_them() -> None:
    theta, phi = torch.meshgrid(torch.arange(0, 85, 8.0), torch.arange(0, 181, 12.0), indexing="ij")
    ring = torch.stack((torch.full_like(theta, 15), theta, phi), -1).reshape(-1, 3)
    plane = [torch.stack((torch.full((40,), each), torch.linspace(0, 75, 40), torch.full((40,), 180.0)), -1)
             for each in (30.0, 60.0)]  # fmt: skip
    angles = torch.cat((ring, *plane)).double().deg2rad()
    wi, wo = from_spherical(angles[:, 0], torch.zeros(len(angles))), from_spherical(angles[:, 1], angles[:, 2])
    samples = Samples(wi, wo, torch.ones(len(angles), 3))
    assert len(lit_rings(samples)) == 1
    rows = by_incidence(samples, flux_of(samples), samples.values)
    assert [row[0] for row in rows] == pytest.approx([15, 30, 60])


def test_each_band_has_its_own_ratio() -> None:
    samples = sample_model(material("lafortune-clay").model, 2000, "discs", 1)
    degrees = torch.rad2deg(to_spherical(samples.wi)[0])
    # Twice as bright from 45° on, half in the last band.
    factor = torch.where(degrees < 45, 1.0, 2.0) * torch.where(degrees < 75, 1.0, 0.25)
    rows = by_incidence(samples, flux_of(samples), samples.values * factor[:, None])
    assert [row[:2] for row in rows] == list(zip(BANDS["θi"], BANDS["θi"][1:], strict=False))
    assert [row[2] for row in rows] == pytest.approx([1, 1, 1, 2, 2, 0.5])


def test_a_band_without_enough_samples_or_light_has_none() -> None:
    samples = sample_model(material("lafortune-clay").model, 2000, "discs", 1)
    degrees = torch.rad2deg(to_spherical(samples.wi)[0])
    few = samples.select((degrees > 30) | (torch.arange(2000) < 40))
    assert by_incidence(few, flux_of(few), few.values)[0][0] == 30
    assert by_incidence(samples, flux_of(samples) * (degrees > 30), samples.values)[0][0] == 30


def test_it_is_told_of_samples_alone() -> None:
    fit = verdict()
    (line,) = incidence_lines(fit)
    for low, high, ratio in fit.figures.light.by_incidence:
        assert f"{low:.0f}–{high:.0f}° {ratio:.0%}" in line
    assert incidence_lines(verdict(seen=seen())) == []


def test_each_ring_of_a_goniometer_has_its_own_ratio() -> None:
    samples = steel_rings()
    degrees = torch.rad2deg(to_spherical(samples.wi)[0])
    factor = torch.where(degrees < 40, 1.0, 0.5)
    rows = by_incidence(samples, flux_of(samples), samples.values * factor[:, None])
    assert rows == tuple((angle, angle, pytest.approx(1 if angle < 40 else 0.5)) for angle in (5, 20, 35, 50, 65))
    # Weighed by solid angle, not by the number of samples: half of them, up to θo = 40°, hold sin² 42.5° here.
    inner = (samples.wo[:, 2] > 0.766).double()
    even = replace(samples, values=torch.ones_like(samples.values))
    part = by_incidence(even, flux_of(even), inner[:, None] * even.values)
    assert [ratio for *_, ratio in part] == pytest.approx([math.sin(math.radians(42.5)) ** 2] * 5, abs=0.02)


def test_a_fit_without_limits_has_findings_that_cost_nothing() -> None:
    samples = steel_rings(steps=(5, 15))
    row = fit_and_measure(source_of(samples), McCool(size=8))
    assert "without anisotropic measurements" in row.verdict.summary
    assert row.verdict.findings
    assert [each.name for each in row.verdict.findings if each.costs] == []
