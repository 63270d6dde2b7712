"""The tilt of the sample behind a list: planted ones are found, and other faults are none."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
import torch
from refusals import refused
from torch import Tensor

from homofact import compare, info
from homofact.brdf.analytic.common import grazing
from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.materials import material
from homofact.brdf.quality import tilt_of_samples
from homofact.brdf.quality.clipping import marked
from homofact.brdf.quality.mending import mending_lines
from homofact.brdf.quality.tilt_of_samples import find_tilt_of_samples, straightened_samples
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.scattered import Scattered
from homofact.brdf.source import open_source, source_of
from homofact.brdf.tilt import Tilt
from homofact.geometry.directions import from_spherical, normalize, to_spherical


def paint(roughness: float) -> GgxBrdf:
    """A coloured base under a lobe of this roughness."""
    return GgxBrdf((0.1, 0.2, 0.3), (GgxLobe((1.0, 1.0, 1.0), roughness, 0.05),))


@cache
def scan() -> tuple[Tensor, Tensor]:
    """A goniometer's pairs: rings of 5° by 15°, and 1° steps across the highlight in the plane of incidence."""
    rows = [(i, o, p) for i in range(0, 76, 15) for o in range(0, 81, 5) for p in range(0, 181, 15)]
    rows += [(i, i + off, 180) for i in range(15, 76, 15) for off in range(-4, 5) if off]
    i, o, phi = torch.tensor(rows, dtype=torch.float64).deg2rad().T
    return from_spherical(i, i * 0), from_spherical(o, phi)


def reported(model: Reflectance, degrees: float, azimuth: float = 0.0, noise: float = 0.01) -> Samples:
    """The list of a sample that leans by `degrees`, with the light at an azimuth in degrees."""
    wi, wo = scan()
    lit, seen = (normalize(w) for w in Tilt(math.radians(degrees)).true(wi, wo))
    above = torch.minimum(lit[:, 2], seen[:, 2]) > 0
    wi, wo, lit, seen = (w[above] for w in (wi, wo, lit, seen))
    values = model.evaluate(lit, seen).double() * grazing(seen[:, 2:]) / grazing(wo[:, 2:])
    values = values * torch.exp(noise * torch.randn(values.shape, generator=torch.Generator().manual_seed(1)))
    turned = Samples(wi, wo, values, channels=model.channels, isotropic=True)
    return turned.turned(torch.full((len(wi),), math.radians(azimuth), dtype=torch.float64))


@pytest.mark.parametrize(
    ("roughness", "degrees", "within"), [(0.03, 0.2, 0.01), (0.03, -0.05, 0.01), (0.1, 0.3, 0.03), (0.2, -0.5, 0.1)]
)
def test_a_planted_tilt_is_found(roughness: float, degrees: float, within: float) -> None:
    found = find_tilt_of_samples(reported(paint(roughness), degrees)).in_plane
    assert found.claimed
    assert found.degrees == pytest.approx(degrees, abs=within)
    assert found.low - within < degrees < found.high + within
    assert found.undone < 0.9 * found.misfit


def test_the_error_that_is_left_is_the_noise() -> None:
    """A normal error of 1% in each of three channels has a median of 0.4% in their mean."""
    found = find_tilt_of_samples(reported(paint(0.1), 0.3)).in_plane
    assert 0.003 < found.undone < 0.006 < 0.009 < found.misfit


@pytest.mark.parametrize("azimuth", [0.0, 110.0, 180.0])
@pytest.mark.parametrize("degrees", [0.4, -0.3])
def test_straightening_gives_the_values_of_the_material(degrees: float, azimuth: float) -> None:
    model = paint(0.1)
    given = reported(model, degrees, azimuth, noise=0.0)
    straight = straightened_samples(given, Tilt(math.radians(degrees)))
    inside = (straight.wi[:, 2] > 0.05) & (straight.wo[:, 2] > 0.05)
    expected = model.evaluate(straight.wi[inside], straight.wo[inside])
    assert torch.allclose(straight.values[inside], expected, rtol=1e-9)
    assert 0 <= len(given) - len(straight) < 20


def test_light_at_another_azimuth_shows_the_same_tilt() -> None:
    one, two = (find_tilt_of_samples(reported(paint(0.03), 0.2, azimuth)).in_plane for azimuth in (0.0, 110.0))
    assert one.degrees == pytest.approx(two.degrees, abs=1e-6)


def _cosine(samples: Samples) -> Tensor:
    return samples.wo[:, 2:]


def _uneven_lamp(samples: Samples) -> Tensor:
    return 1 - 0.3 * to_spherical(samples.wi)[0][:, None]


def _bad_ring(samples: Samples) -> Tensor:
    return torch.where((samples.wi[:, 2:] - math.cos(math.radians(45))).abs() < 1e-6, 0.7, 1.0)


@pytest.mark.parametrize("fault", [_cosine, _uneven_lamp, _bad_ring, None])
@pytest.mark.parametrize("roughness", [0.03, 0.2])
def test_other_faults_are_no_tilt(roughness: float, fault: Callable[[Samples], Tensor] | None) -> None:
    samples = reported(paint(roughness), 0.0)
    gain = 1.0 if fault is None else fault(samples)
    found = find_tilt_of_samples(replace(samples, values=samples.values * gain)).in_plane
    assert not found.claimed
    assert found.reason


@pytest.mark.parametrize("name", ["lafortune-blue-paint", "phong-10", "blinn-phong-50", "car-paint-red"])
def test_nothing_is_found_of_clean_models(name: str) -> None:
    assert find_tilt_of_samples(reported(material(name).model, 0.0)).tilt is None


@pytest.mark.parametrize("change", [lambda s: s.subset(150, 0), lambda s: replace(s, values=0 * s.values)])
def test_lists_that_cannot_tell_say_why(change: Callable[[Samples], Samples]) -> None:
    found = find_tilt_of_samples(change(reported(paint(0.03), 0.2)))
    assert found.tilt is None
    assert found.in_plane.reason
    assert found.record()["left_in"] is False


def test_clipped_values_are_not_asked() -> None:
    samples = reported(paint(0.03), 0.2)
    cut = replace(samples, values=samples.values.clamp_max(float(samples.values.reshape(-1).quantile(0.97))))
    bounded = marked(cut, "found")
    assert bounded.clipped is not None
    chosen = tilt_of_samples._telling(bounded, 0)
    assert chosen is not None
    assert chosen.clipped is not None
    assert not bool(chosen.clipped.any())
    assert find_tilt_of_samples(bounded).in_plane.degrees == pytest.approx(0.2, abs=0.02)


def test_the_same_seed_finds_the_same_bits() -> None:
    samples = reported(paint(0.1), 0.16)
    assert find_tilt_of_samples(samples).record() == find_tilt_of_samples(samples).record()


@pytest.mark.parametrize("name", ["irid_flake_paint1", "cc_iris_purple_gem", "chm_light_blue"])
def test_a_list_drawn_from_a_real_table_has_the_tilt_of_the_table(real_data: Path, name: str) -> None:
    path = str(real_data / f"rgl/{name}_rgb.bsdf")
    table = open_source(path, count=100).samples.provenance["tilt"]["in_plane"]
    listed = find_tilt_of_samples(open_source(path, calibrate=["none"]).samples).in_plane
    assert listed.degrees == pytest.approx(table["degrees"], abs=0.025)
    assert listed.claimed == table["claimed"]


@pytest.fixture(scope="module")
def leaning() -> Samples:
    """A list with a tilt of 0.2°."""
    return reported(paint(0.03), 0.2)


def test_a_tilt_of_a_list_is_undone_where_it_is_asked_for(leaning: Samples) -> None:
    straight = source_of(leaning, calibrate=["tilt"])
    facts = straight.samples.provenance["tilt"]
    assert facts["undone"]
    assert not facts["left_in"]
    assert facts["left_out"] == len(leaning) - len(straight.samples)
    expected = straightened_samples(leaning, Tilt(math.radians(facts["in_plane"]["degrees"])))
    assert torch.allclose(straight.samples.wo, expected.wo, atol=1e-6)
    assert isinstance(straight.reflectance, Scattered)
    assert straight.reflectance.samples is straight.samples
    assert len(mending_lines(straight.samples.provenance)) == 1 + (facts["left_out"] > 0)


def test_a_tilt_of_a_list_stays_where_it_is_not_asked_for(leaning: Samples) -> None:
    assert torch.equal(source_of(leaning).samples.wo, leaning.wo)
    found = info(source_of(leaning))
    assert found.facts["tilt"]["left_in"]
    assert not found.facts["tilt"]["undone"]
    assert "calibrate='tilt'" in " ".join(found.mended)
    upright = info(reported(paint(0.03), 0.0))
    assert not upright.facts["tilt"]["left_in"]
    assert len(upright.mended) == 1


def test_a_comparison_names_a_tilt_that_is_left_in_and_in_its_table_one_that_is_undone(
    leaning: Samples, tmp_path: Path
) -> None:
    table = tmp_path / "table.tex"
    found = compare(source_of(leaning), "ggx", latex=table)
    assert any(": the sample was tilted by" in line for line in found.warnings)
    assert ", left in" in table.read_text()
    straight = compare(source_of(leaning, calibrate=["tilt"]), "ggx", latex=tmp_path / "straight.tex")
    assert not any("tilted" in line for line in straight.warnings)
    assert ", undone" in (tmp_path / "straight.tex").read_text()
    # What was looked for in vain is neither.
    compare(source_of(reported(paint(0.03), 0.0), calibrate=["tilt"]), "ggx", latex=tmp_path / "upright.tex")
    upright = (tmp_path / "upright.tex").read_text()
    assert "no tilt of the sample undone" in upright
    assert ", left in" not in upright
    assert ", undone" not in upright


def test_values_are_clipped_and_gains_estimated_before_the_directions_turn(leaning: Samples) -> None:
    cut = replace(leaning, values=leaning.values.clamp_max(float(leaning.values.reshape(-1).quantile(0.97))))
    both = source_of(cut, calibrate=["tilt", "rings"], clipped="found").samples
    alone = source_of(cut, calibrate=["rings"], clipped="found").samples
    assert both.provenance["clipped"] == alone.provenance["clipped"]
    assert both.provenance["gains"] == alone.provenance["gains"]
    assert both.provenance["tilt"]["undone"]


def test_an_anisotropic_list_and_a_model_show_no_tilt(leaning: Samples) -> None:
    with refused(where="calibrate"):
        source_of(replace(leaning, isotropic=False), calibrate=["tilt"])
    with refused(where="calibrate"):
        open_source("material:phong-30", calibrate=["tilt"])
