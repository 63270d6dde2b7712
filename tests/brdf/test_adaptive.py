"""Reflectances in the adaptive parameterization: laws, round trips, and Mitsuba's own reading of the files."""

import importlib
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from mitsuba_cases import albedo, at, drawn, evaluated, pairs, variant
from refusals import refused
from rgl_files import rough, write_tensors
from slow_cases import slow_among
from torch import Tensor

from homofact.brdf.adaptive import azimuths, importance, relative_differences, tabulated
from homofact.brdf.analytic import Lambert
from homofact.brdf.formats import rgl
from homofact.brdf.formats.tensor_file import read_tensors
from homofact.brdf.materials import material
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.rgl import AdaptiveTable
from homofact.brdf.warp import MarginalConditional
from homofact.geometry.directions import from_spherical
from homofact.geometry.quadrature import hemisphere_nodes

CLAY = material("lafortune-clay").model
BRUSHED = material("ward-brushed").model


@pytest.fixture(scope="module")
def clay() -> AdaptiveTable:
    return tabulated(CLAY, True, side=64, thetas=24)


@pytest.fixture(scope="module")
def brushed() -> AdaptiveTable:
    return tabulated(BRUSHED, False, side=32, thetas=10)


def points(count: int = 2000, seed: int = 3) -> Tensor:
    return torch.rand(count, 2, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def test_the_warp_is_undone() -> None:
    generator = np.random.default_rng(0)
    density = torch.from_numpy(generator.uniform(0, 1, (3, 7, 9)) ** 4)
    density[1, :, 5:] = 0
    density[2, 4:] = 0
    warp = MarginalConditional.of(density)
    s = points()
    for number in range(3):
        u = warp.sample(s, number)
        slices = torch.full((len(s), 1), number)
        again = warp.invert(u, slices, torch.ones(len(s), 1, dtype=torch.float64))
        assert float((again - s).abs().max()) < 1e-9
    # Nothing lies where there is no density, the ends included.
    corners = torch.tensor([[1.0, 0.3], [0.4, 1.0], [1.0, 1.0]], dtype=torch.float64)
    assert float(warp.sample(corners, 1)[:, 0].max()) <= 5 / 8 + 1e-5
    assert float(warp.sample(corners, 2)[:, 1].max()) <= 4 / 6 + 1e-5
    even = MarginalConditional.of(torch.ones(1, 3, 4))
    assert torch.allclose(even.sample(s, 0), s, atol=1e-12)


def test_the_parts_are_what_the_microfacet_model_says(clay: AdaptiveTable) -> None:
    """∫ D cosθ dω = 1, hence σ = 1 at the normal; M is f cosθo · 4σ/D at its nodes."""
    u = (torch.arange(20_000, dtype=torch.float64) + 0.5) / 20_000
    theta = u**2 * (math.pi / 2)
    d = torch.from_numpy(np.interp(u.numpy(), np.linspace(0, 1, clay.ndf.shape[1]), clay.ndf[0].double().numpy()))
    assert float((d * theta.cos() * theta.sin() * 2 * math.pi**2 * u).mean()) == pytest.approx(1, abs=2e-3)
    assert float(clay.sigma[0, 0]) == pytest.approx(1, abs=2e-3)
    assert (clay.sigma.diff(dim=1) <= 1e-6).all()
    middle, most = relative_differences(CLAY, clay, 4000)
    assert middle < 0.005
    assert most < 0.1
    assert 0 < relative_differences(CLAY, replace(clay, table=clay.table * 1.01), 4000)[0] - middle < 0.011


@pytest.mark.parametrize(("which", "model"), slow_among([("clay", CLAY), ("brushed", BRUSHED)], "brushed"))
def test_grazing_incidence_reflects_as_much(which: str, model: Reflectance, request: pytest.FixtureRequest) -> None:
    """Between slices too, up to the last, behind which values are held."""
    table = request.getfixturevalue(which)
    theta = torch.deg2rad(torch.tensor([80, 83, 84.5, 86, 87, 88, 88.7], dtype=torch.float64))
    wi = from_spherical(theta, torch.full_like(theta, 0.4))
    wo, angles = hemisphere_nodes(wi)
    seen = wi[:, None].expand_as(wo).reshape(-1, 3)
    shares = []
    for each in (table, model):
        values = each.evaluate(seen, wo.reshape(-1, 3)).double().mean(1).reshape(angles.shape)
        shares.append((values * wo[..., 2] * angles).sum(1))
    assert shares[0].tolist() == pytest.approx(shares[1].tolist(), rel=0.08)


def test_slices_are_as_many_as_the_symmetry_needs(brushed: AdaptiveTable) -> None:
    assert (len(brushed.phi_i), brushed.isotropic) == (9, False)
    assert float(brushed.phi_i[-1] - brushed.phi_i[0]) == pytest.approx(math.pi / 2)
    middle, most = relative_differences(BRUSHED, brushed, 2000)
    assert middle < 0.02
    assert most < 0.3

    class Turned:
        """Brushed obliquely: the same after half a turn, but not mirrored."""

        channels, nbytes, fetches = BRUSHED.channels, 0, 0

        def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
            cos, sin = math.cos(0.5), math.sin(0.5)
            turn = torch.tensor([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]], dtype=torch.float64)
            return BRUSHED.evaluate(wi @ turn, wo @ turn)

    oblique = Turned()
    assert isinstance(oblique, Reflectance)
    assert len(azimuths(oblique)) == 17
    assert len(azimuths(BRUSHED, whole_turn=True)) == 33
    assert float(azimuths(oblique)[-1]) == pytest.approx(0, abs=1e-12)


def test_a_file_holds_every_number(tmp_path: Path, clay: AdaptiveTable) -> None:
    rgl.write(tmp_path / "a.bsdf", clay, ("a clay", "twice"))
    back = rgl.load(tmp_path / "a.bsdf")
    for name in ("theta_i", "phi_i", "ndf", "sigma", "vndf", "table"):
        assert torch.equal(getattr(back, name), getattr(clay, name)), name
    assert (back.jacobian, back.facts["comments"]) == (True, ["a clay", "twice"])
    fields = read_tensors(tmp_path / "a.bsdf")
    assert {name: field.shape for name, field in fields.items() if name != "description"} == {
        "phi_i": (1,), "theta_i": (24,), "sigma": (2, 128), "ndf": (2, 256), "vndf": (1, 24, 128, 128),
        "luminance": (1, 24, 64, 64), "rgb": (1, 24, 3, 64, 64), "jacobian": (1,),
    }  # fmt: skip


def test_one_channel_spectra_and_what_no_file_holds(tmp_path: Path) -> None:
    grey = tabulated(Lambert((0.3,), channels=("Y",)), True, side=32, thetas=8)
    rgl.write(tmp_path / "grey", grey)
    assert rgl.load(tmp_path / "grey").facts["comments"] == ["a BRDF"]
    wi, wo = pairs(50)
    found = rgl.load(tmp_path / "grey").evaluate(wi, wo)
    assert torch.equal(found, found[:, :1].expand(-1, 3))
    names = ("400nm", "550nm", "700nm")
    rgl.write(tmp_path / "spectra", replace(grey, table=grey.table.expand(-1, -1, -1, -1, 3), channels=names))
    assert rgl.load(tmp_path / "spectra", "spectral").channels == names
    two = replace(grey, table=grey.table.expand(-1, -1, -1, -1, 2), channels=("a", "b"))
    with refused(where="two"):
        rgl.write(tmp_path / "two", two)
    with refused(where="huge"):
        rgl.write(tmp_path / "huge", replace(grey, table=grey.table.double() * 1e39))
    with refused(where="adaptive table", found="1 slices of 32 nodes a side"):
        tabulated(CLAY, True, side=32, thetas=1)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["grey", "spectra"]


def test_what_reflects_nothing_is_a_table_too() -> None:
    black = tabulated(Lambert((0.0, 0.0, 0.0)), True, side=32, thetas=8)
    assert (black.table == 0).all()
    assert (importance(black) == 1).all()
    assert relative_differences(Lambert((0.0, 0.0, 0.0)), black, 100) == (0.0, 0.0)


@pytest.mark.parametrize("name", ["vch_golden_yellow", "chm_light_blue"])
def test_published_files_go_round(name: str, real_data: Path, tmp_path: Path) -> None:
    """Every field as it was, but luminance, which is ours and near theirs."""
    path = real_data / "rgl" / f"{name}_rgb.bsdf"
    if not path.is_file():
        pytest.skip(f"no {path}")
    rgl.write(tmp_path / "a.bsdf", rgl.load(path), rgl.load(path).facts["comments"])
    before, after = read_tensors(path), read_tensors(tmp_path / "a.bsdf")
    for field in ("theta_i", "phi_i", "ndf", "sigma", "vndf", "rgb", "jacobian", "description"):
        assert np.array_equal(before[field], after[field]), field
    ours, theirs = (each["luminance"] / each["luminance"].mean((2, 3), keepdims=True) for each in (after, before))
    # The steepest slice is the one at the horizon, of which theirs holds nothing.
    assert np.abs(ours - theirs)[0, :7].mean() < 0.1
    assert np.corrcoef(ours[0, :7].ravel(), theirs[0, :7].ravel())[0, 1] > 0.9


def mitsubas(path: Path, name: str = "scalar_rgb"):
    mi = variant(name, register=False)
    return mi, mi.load_dict({"type": "measured", "filename": str(path)})


@pytest.mark.parametrize("which", ["clay", "brushed"])
def test_mitsuba_reads_the_values_that_we_wrote(
    which: str, request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    check = importlib.import_module("scripts.data.check_rgl_against_mitsuba")
    variant("scalar_rgb", register=False)
    table = request.getfixturevalue(which)
    rgl.write(tmp_path / "a.bsdf", table)
    # Mitsuba has the viewer for the table's incidence.
    wi, wo = pairs(1500)
    found = check.mitsuba_values(tmp_path / "a.bsdf", wi, wo).values
    expected = table.evaluate(wi, wo) * wo[:, 2:]
    off = ((found - expected).abs() / expected.clamp_min(1e-3 * expected.mean())).flatten()
    assert float(off.median()) < 1e-5
    assert float(off.quantile(0.99)) < 2e-3


@pytest.mark.parametrize("which", ["clay", "brushed"])
def test_mitsuba_draws_as_the_material_reflects(which: str, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    """The mean weight is the albedo; weights scatter less than from the cosine; pdf is that of what was drawn."""
    table = request.getfixturevalue(which)
    rgl.write(tmp_path / "a.bsdf", table)
    mi, bsdf = mitsubas(tmp_path / "a.bsdf", "llvm_ad_rgb")
    for degrees, within in ((5, 0.02), (50, 0.02), (75, 0.02), (86, 0.08)):
        viewer = at(degrees, 0.4).float().double()[None]
        si, samples, weights = drawn(mi, bsdf, viewer, 60_000)
        found = torch.from_numpy(np.array(weights)).double()
        model = CLAY if which == "clay" else BRUSHED
        assert torch.allclose(found.mean(1), albedo(model, viewer[0]), rtol=within), degrees
        light = torch.from_numpy(np.array(samples.wo)).double().T
        cosine = evaluated(mi, bsdf, light, viewer.expand(len(light), 3))[:, 1] / (light[:, 2] / math.pi)
        drawn_by_cosine = cosine**2 * (light[:, 2] / math.pi) / torch.from_numpy(np.array(samples.pdf)).double()
        used = torch.isfinite(drawn_by_cosine) & (light[:, 2] > 0)
        ours = float((found[1] ** 2).mean() - found[1].mean() ** 2)
        theirs = float(drawn_by_cosine[used].sum() / len(light) - found[1].mean() ** 2)
        assert ours < theirs, degrees
        pdf = np.array(bsdf.pdf(mi.BSDFContext(), si, samples.wo))
        kept = np.array(samples.pdf) > 0
        assert np.quantile(np.abs(pdf[kept] / np.array(samples.pdf)[kept] - 1), 0.99) < 0.02


def test_made_up_tables_are_written_as_they_are(tmp_path: Path) -> None:
    path = write_tensors(tmp_path / "a.bsdf", rough((-180.0, -120.0, -60.0, 0.0), wavelengths=5))
    rgl.write(tmp_path / "b.bsdf", rgl.load(path, "spectral"))
    before, after = read_tensors(path), read_tensors(tmp_path / "b.bsdf")
    for field in ("theta_i", "phi_i", "ndf", "sigma", "vndf", "spectra", "wavelengths", "jacobian"):
        assert np.array_equal(before[field], after[field]), field
