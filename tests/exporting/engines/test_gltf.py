"""The glTF look-alike: the model against closed forms, its fit, and the file in other programs' eyes."""

import json
import math
import shutil
import struct
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from browser import browser
from engine_cases import NODE, isotropic, npm_package, script

from homofact.brdf.analytic import Lambert
from homofact.brdf.analytic.common import AnalyticModel
from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.brdf.source import open_source
from homofact.containers.formats import format_named
from homofact.errors import BadInput
from homofact.evaluation.energy import energy_errors
from homofact.exporting.engines import gltf
from homofact.exporting.engines.gltf import GLTF, GOOD, NAME, POOR, README, glb, readme, said
from homofact.exporting.exported import exported
from homofact.exporting.gltf_fit import CLEARCOAT, fit_metallic_roughness
from homofact.exporting.look_alike import AddedLookAlike
from homofact.geometry.directions import draw_uniform, from_spherical
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.rendering.light import DEFAULT_LIGHT
from homofact.rendering.sphere import render_sphere
from homofact.rendering.surface import RADIUS

COATED = MetallicRoughness((0.5, 0.3, 0.1), 0.3, 0.4, 0.8, 0.15)
# What KHR_materials_specular adds: F0 of .12, .06 and .3 in the place of .04, and .3 of the light at grazing angles.
TINTED = MetallicRoughness((0.1, 0.05, 0.02), 0.0, 0.4, specular=0.3, specular_colour=(10.0, 5.0, 30.0))
LONG = MetallicRoughness((0.9, 0.8, 0.7), 1.0, 0.3, anisotropy=0.6, rotation=0.7)


SIZE = 256


def pairs(count: int = 400):
    return draw_uniform(count, torch.Generator().manual_seed(2))


def test_closed_forms() -> None:
    """At normal incidence a dielectric is c/π (1 − .04) + .04 D V with D = 1/(π α²) and V = 1/4."""
    up = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64)
    plain = MetallicRoughness((0.5, 0.3, 0.1), 0.0, 0.6)
    lobe = 1 / (math.pi * 0.36**2) / 4
    expected = [c / math.pi * 0.96 + 0.04 * lobe for c in plain.base_colour]
    assert plain.evaluate(up, up)[0].tolist() == pytest.approx(expected)
    metal = MetallicRoughness((0.5, 0.3, 0.1), 1.0, 0.6)
    assert metal.evaluate(up, up)[0].tolist() == pytest.approx([c * lobe for c in metal.base_colour])
    coat = MetallicRoughness((0.5, 0.3, 0.1), 1.0, 0.6, clearcoat=0.5, clearcoat_roughness=0.3)
    over = 0.02 / (math.pi * 0.09**2) / 4
    assert coat.evaluate(up, up)[0].tolist() == pytest.approx([over + 0.98 * c * lobe for c in coat.base_colour])
    # The diffuse part of a channel has what its F0 leaves.
    bright = 1 / (math.pi * 0.16**2) / 4
    tinted = [c / math.pi * (1 - f) + f * bright for c, f in zip(TINTED.base_colour, (0.12, 0.06, 0.3), strict=True)]
    assert TINTED.evaluate(up, up)[0].tolist() == pytest.approx(tinted)
    stretched = replace(LONG, rotation=0.0).evaluate(up, up)[0, 0]
    along = 0.09 + 0.91 * 0.36
    assert float(stretched) == pytest.approx(0.9 / (math.pi * along * 0.09) / 4)


def test_the_specular_factor_is_what_is_reflected_at_grazing_angles() -> None:
    low = 1e-3
    wi, wo = (torch.tensor([[x, 0.0, low]], dtype=torch.float64) for x in (1.0, -1.0))
    black = replace(TINTED, base_colour=(0.0, 0.0, 0.0))
    whole = replace(black, specular=1.0).evaluate(wi, wo)[0]
    assert (black.evaluate(wi, wo)[0] / whole).tolist() == pytest.approx([0.3] * 3, rel=0.02)
    same = replace(COATED, specular_colour=(1.0, 1.0, 1.0))
    assert torch.allclose(same.evaluate(*pairs()), COATED.evaluate(*pairs()), rtol=1e-12)


@pytest.mark.parametrize("model", [COATED, LONG, TINTED, MetallicRoughness((1.0, 1.0, 1.0), 1.0, 0.2)], ids=str)
def test_laws(model: MetallicRoughness) -> None:
    """Reciprocal, no brighter than what falls in, turned as its tangent is."""
    wi, wo = pairs()
    assert torch.allclose(model.evaluate(wi, wo), model.evaluate(wo, wi), rtol=1e-9)
    views = from_spherical(*(torch.tensor(x, dtype=torch.float64) for x in ([0.1, 0.8, 1.3], [0.3, 0.3, 0.3])))
    lights, solid = hemisphere_nodes(views)
    values = model.evaluate(lights.reshape(-1, 3), views[:, None].expand_as(lights).reshape(-1, 3))
    albedo = (values.reshape(*lights.shape[:2], 3) * (solid * lights[..., 2])[..., None]).sum(1)
    assert float(albedo.max()) < 1.001
    if not model.isotropic:
        cos, sin = math.cos(0.7), math.sin(0.7)
        turn = torch.tensor([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]], dtype=torch.float64)
        straight = replace(model, rotation=0.0).evaluate(wi, wo)
        assert torch.allclose(model.evaluate(wi @ turn, wo @ turn), straight, rtol=1e-9)
        assert not torch.allclose(model.evaluate(wi, wo), straight, rtol=0.1)
    # An anisotropy that vanishes is none, but for the form of its visibility, which differs at the horizon.
    high = (wi[:, 2] > 0.4) & (wo[:, 2] > 0.4)
    nearly, none = (replace(LONG, anisotropy=x, roughness=0.6).evaluate(wi[high], wo[high]) for x in (1e-6, 0.0))
    assert torch.allclose(nearly, none, rtol=0.1)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"metallic": 1.1}, "metallic is 1.1, expected 0 to 1"),
        ({"roughness": -0.1}, "roughness is -0.1"),
        ({"base_colour": (0.1, 0.2, 1.2)}, "base_colour is 1.2"),
        ({"base_colour": (0.1, 0.2)}, "base_colour has 2 numbers"),
        ({"specular": 1.5}, "specular is 1.5, expected 0 to 1"),
        ({"specular_colour": (1.0, -1.0, 1.0)}, "specular_colour is"),
    ],
)
def test_bad_materials_are_refused(change: dict, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        replace(COATED, **change)


@pytest.mark.slow
def test_a_material_of_this_kind_is_found_again() -> None:
    plain = MetallicRoughness((0.5, 0.3, 0.1), 0.25, 0.45)
    found = fit_metallic_roughness(plain, True)
    assert found.clearcoat == 0
    numbers = [*found.base_colour, found.metallic, found.roughness]
    assert numbers == pytest.approx([0.5, 0.3, 0.1, 0.25, 0.45], abs=2e-3)
    assert "baseColor (0.500, 0.300, 0.100), metallic 0.250, roughness 0.450" in said(found)


@pytest.mark.slow
def test_extensions_are_used_where_they_help() -> None:
    coated = fit_metallic_roughness(COATED, True)
    assert (coated.clearcoat, coated.clearcoat_roughness) == pytest.approx((0.8, 0.15), abs=0.02)
    stretched = fit_metallic_roughness(LONG, False)
    assert stretched.anisotropy == pytest.approx(0.6, abs=0.02)
    assert stretched.rotation == pytest.approx(0.7, abs=0.02)
    assert "anisotropy 0.600 at 40 degrees" in said(stretched)


@pytest.mark.slow
def test_the_specular_extension_is_found_again() -> None:
    found = fit_metallic_roughness(TINTED, True)
    assert found.clearcoat == 0
    assert (found.roughness, found.specular) == pytest.approx((0.4, 0.3), abs=2e-3)
    assert found.normal_reflectance == pytest.approx(TINTED.normal_reflectance, abs=2e-3)
    assert found.base_colour == pytest.approx(TINTED.base_colour, abs=2e-3)
    assert "specular 0.300 with (0.120, 0.060, 0.300) at normal incidence" in said(found)


@pytest.mark.slow
@pytest.mark.parametrize("allowed", [False, (CLEARCOAT,)], ids=["none", "coat"])
def test_no_extension_is_used_that_is_not_allowed(allowed: bool | tuple[str, ...]) -> None:
    found = fit_metallic_roughness(TINTED, True, extensions=allowed)
    assert not found.extended_specular
    assert found.isotropic
    assert allowed or found.clearcoat == 0


@pytest.mark.slow
def test_the_mean_albedo_is_held_in_every_channel() -> None:
    """Of what no such material can show, too: a lobe of a Gaussian's slopes, and one towards the light."""
    brushed = open_source("material:ward-brushed", count=10).reflectance
    for reflectance, turns in ((brushed, False), (Retro(), True)):
        found = fit_metallic_roughness(reflectance, turns, extensions=False)
        energy = energy_errors(found, reflectance, turns).energy
        assert energy == pytest.approx((1.0,) * 3, abs=0.005)


class Retro(AnalyticModel):
    """A retroreflector: a narrow lobe round the light, over a base."""

    def formula(self, wi: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
        """Values of three channels."""
        lobe = 5 * torch.exp(60 * ((wi * wo).sum(-1) - 1))
        return lobe[..., None] * self.colour((1.0, 0.6, 0.1), wi) + 0.02


@pytest.mark.slow
def test_what_has_no_look_is_refused() -> None:
    with pytest.raises(BadInput, match="the values are all 0"):
        fit_metallic_roughness(Lambert((0.0, 0.0, 0.0)), True)
    with pytest.raises(BadInput, match="channels a, b, expected R, G, B or one alone"):
        fit_metallic_roughness(Lambert((0.1, 0.2), channels=("a", "b")), True)
    grey = fit_metallic_roughness(Lambert((0.3,), channels=("Y",)), True)
    assert len(grey.base_colour) == 1
    assert (
        json_of(glb(grey, "grey"))["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"][:3]
        == [grey.base_colour[0]] * 3
    )


def json_of(data: bytes) -> dict:
    magic, version, total, length, kind = struct.unpack_from("<4sIII4s", data)
    assert (magic, version, total, kind) == (b"glTF", 2, len(data), b"JSON")
    return json.loads(data[20 : 20 + length])


@pytest.mark.parametrize("look", [COATED, LONG, TINTED], ids=["coat", "long", "tinted"])
def test_khronos_validator_has_no_complaint(look: MetallicRoughness, tmp_path: Path) -> None:
    npm_package("gltf-validator")
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is missing")
    (tmp_path / "a.glb").write_bytes(glb(look, "a </name> \u00e4"))
    done = subprocess.run(
        [node, str(NODE / "check_gltf.mjs"), str(tmp_path / "a.glb")], capture_output=True, text=True, check=True
    )
    report = json.loads(done.stdout)
    assert report["issues"]["numErrors"] == 0, report["issues"]["messages"][:3]
    assert report["issues"]["numWarnings"] == 0, report["issues"]["messages"][:3]
    assert report["info"]["totalTriangleCount"] > 4000


def test_trimesh_finds_the_sphere_and_its_material(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh", reason="trimesh is missing: pip install 'homofact[relight]'")
    (tmp_path / "a.glb").write_bytes(glb(COATED, "paint"))
    mesh = trimesh.load(tmp_path / "a.glb", force="mesh")
    assert mesh.volume == pytest.approx(4 / 3 * math.pi, rel=5e-3)
    assert mesh.visual.material.metallicFactor == pytest.approx(0.3)
    assert mesh.visual.material.roughnessFactor == pytest.approx(0.4)


@pytest.mark.slow
@pytest.mark.parametrize("look", [COATED, TINTED], ids=["coat", "tinted"])
def test_three_draws_what_we_draw(look: MetallicRoughness, tmp_path: Path) -> None:
    """But for what three adds: to roughness by the size of a pixel, to the lobe for light that is scattered twice."""
    (tmp_path / "glb").mkdir()
    (tmp_path / "glb" / NAME).write_bytes(glb(look, "a"))
    draw = script("engines.draw_three").three_sphere
    with browser() as driver:
        found = draw(driver, tmp_path / "page", tmp_path / "glb", SIZE, RADIUS, [DEFAULT_LIGHT], glb=NAME)
    expected = render_sphere(look, DEFAULT_LIGHT, SIZE).radiance.numpy()
    y, x = np.mgrid[:SIZE, :SIZE] + 0.5 - SIZE / 2
    inner = np.hypot(x, y) < 0.85 * RADIUS * SIZE / 2
    off = np.abs(found - expected)[inner] / np.maximum(expected, 0.05 * expected[inner].mean(0))[inner]
    # The lobe is 6% off, in blue; were the diffuse part what the largest F leaves, red would be 26% off.
    assert np.median(off, 0) == pytest.approx(0, abs=0.08)
    assert np.quantile(off, 0.99) < 0.12


def test_the_engine_adds_the_files_which_say_that_it_is_a_look_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gltf, "fit_metallic_roughness", lambda *args, **kwargs: COATED)
    made = exported(isotropic(), format_named("exr"))
    added = GLTF.add(made)
    assert list(added.files) == [NAME, README]
    assert added.looks == {"look-alike": COATED}
    assert isinstance(added, AddedLookAlike)
    found, likeness = json_of(bytes(added.files[NAME])), added.likeness  # type: ignore[arg-type]
    assert likeness is not None
    assert found["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] == 0.4
    assert found["materials"][0]["name"] == f"samples ({likeness.phrase})"
    assert found["nodes"][0]["name"] == "samples"
    assert found["extensionsUsed"] == ["KHR_materials_clearcoat"]
    text = str(added.files[README])
    for words in (
        "# A glTF look-alike of samples", f"**{likeness.phrase}**", likeness.pictures, likeness.table,
        "| clearcoat | 0.800 of roughness 0.150 |", "Extensions: KHR_materials_clearcoat.", POOR, "--engine three",
    ):  # fmt: skip
        assert words in text
    assert GOOD not in text
    plain = readme(MetallicRoughness((0.5, 0.3, 0.1), 0.0, 0.4), "a <b>", likeness)
    assert "Extensions: none." in plain
    assert "look-alike of a &#60;b&#62;" in plain


def test_the_specular_extension_is_written() -> None:
    material = json_of(glb(TINTED, "a", note="b"))["materials"][0]
    assert material["name"] == "a (b)"
    expected = {"specularFactor": 0.3, "specularColorFactor": [10.0, 5.0, 30.0]}
    assert material["extensions"] == {"KHR_materials_specular": expected}
    grey = MetallicRoughness((0.2,), 0.0, 0.4, specular=0.5, channels=("Y",))
    found = json_of(glb(grey, "a"))["materials"][0]["extensions"]["KHR_materials_specular"]
    assert found == {"specularFactor": 0.5, "specularColorFactor": [1.0] * 3}
