"""pbrt-v4's folder: a scene in its grammar, a table that its reader takes, Mitsuba's spectral reading of that table.

pbrt itself is in no package, so nothing here renders by it.
"""

import math
import re
from dataclasses import replace
from pathlib import Path

import colour
import numpy as np
import pytest
import torch
from engine_cases import brushed, engine_folder, isotropic
from mitsuba_cases import factorization as product
from mitsuba_cases import random_texture, seen_from, variant, vectors
from pbrt import Statement, parsed
from shading_cases import CASES, factorization

from homofact.brdf import adaptive
from homofact.brdf.formats import rgl
from homofact.brdf.formats.tensor_file import read_tensors
from homofact.brdf.reflectance import Exchanged, Reflectance
from homofact.brdf.upsampling import NODES, to_spectra
from homofact.containers.formats import format_named
from homofact.errors import BadInput
from homofact.exporting.engines.pbrt import MATERIAL, PBRT, SCENE, TABLE
from homofact.exporting.exported import exported
from homofact.factor.factorization import Factorization
from homofact.factor.projection import fixed_projection
from homofact.geometry.directions import draw_cosine_weighted

PLAIN = factorization(fixed_projection("theta_h", True))
ONE_WAY = CASES["searched in-out, not reciprocal"]


@pytest.fixture
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tables of few nodes, for what does not depend on them."""
    for isotropy in (True, False):
        monkeypatch.setitem(adaptive.SIDE, isotropy, 12)
        monkeypatch.setitem(adaptive.THETAS, isotropy, 4)
    monkeypatch.setattr(adaptive, "_AZIMUTHS", 8)
    monkeypatch.setattr(adaptive, "_ROUND", 8)
    monkeypatch.setattr(adaptive, "_FACETS", 64)


def of(statements: list[Statement], directive: str) -> list[Statement]:
    return [each for each in statements if each.directive == directive]


@pytest.mark.usefixtures("coarse")
def test_the_scene_is_one(tmp_path: Path) -> None:
    engine_folder(tmp_path / "fit", PLAIN, "pbrt")
    scene = parsed(tmp_path / "fit" / SCENE)
    (made,), (used,) = (of(scene, name) for name in ("MakeNamedMaterial", "NamedMaterial"))
    assert made.word == used.word == "samples"
    assert made.parameters == {"string type": ["measured"], "string filename": [TABLE]}
    assert (tmp_path / "fit" / TABLE).is_file()
    # The material is the sphere's: the shape behind it, at the same depth.
    after = scene[scene.index(used) + 1 :]
    assert [(each.directive, each.word, each.depth) for each in after] == [("Translate", "", 1), ("Shape", "sphere", 1)]
    ball = Sight(scene)
    assert ball.aside < 0.1
    assert 0.45 < ball.share < 0.9
    # Lit from the camera's side and from above, and standing on the floor.
    (lamp, floor) = (np.reshape(each.parameters["point3 P"], (-1, 3)) for each in of(scene, "Shape")[:2])
    assert (lamp - ball.centre).mean(0) @ (ball.eye - ball.centre) > 0
    assert lamp[:, 2].min() > 2
    assert np.abs(lamp[1] - lamp[0]) @ np.abs(lamp[1] - lamp[0]) == pytest.approx(2.4**2, rel=0.02)
    assert abs((lamp[1] - lamp[0]) @ (lamp[2] - lamp[0])) < 0.02
    across = np.cross(lamp[1] - lamp[0], lamp[2] - lamp[0])
    to_ball = ball.centre - lamp.mean(0)
    assert abs(across @ to_ball) / np.linalg.norm(across) / np.linalg.norm(to_ball) > 0.95
    assert floor[:, 2].tolist() == [0] * 4
    assert ball.centre[2] == ball.radius


class Sight:
    """Where the camera of a scene sees its sphere, by pinhole projection."""

    def __init__(self, scene: list[Statement]) -> None:
        (look,), (camera,), (film,) = (of(scene, name) for name in ("LookAt", "Camera", "Film"))
        self.eye, towards, up = np.reshape(look.numbers, (3, 3))
        (move,), ball = of(scene, "Translate"), of(scene, "Shape")[-1]
        self.centre, self.radius = np.array(move.numbers), ball.parameters["float radius"][0]
        forward = (towards - self.eye) / np.linalg.norm(towards - self.eye)
        right = np.cross(forward, up)
        right /= np.linalg.norm(right)
        above = np.cross(right, forward)
        way = self.centre - self.eye
        # fov is that of the shorter side, here the height.
        assert film.parameters["integer xresolution"][0] >= film.parameters["integer yresolution"][0]
        half = math.tan(math.radians(camera.parameters["float fov"][0]) / 2)
        depth = way @ forward
        self.aside = math.hypot(way @ right, way @ above) / depth / half
        self.share = self.radius / math.sqrt(depth**2 - self.radius**2) / half


@pytest.mark.usefixtures("coarse")
@pytest.mark.parametrize("name", ['a "paint"\nWorldBegin', "# [ ] \\", "лак", "x" * 300])
def test_any_name_leaves_it_a_scene(name: str, tmp_path: Path) -> None:
    named = replace(PLAIN, provenance={"source": {"file": name}})
    engine_folder(tmp_path / "fit", named, "pbrt")
    scene = parsed(tmp_path / "fit" / SCENE)
    assert len(of(scene, "Shape")) == 3
    assert re.fullmatch("[A-Za-z0-9-]+", of(scene, "NamedMaterial")[0].word)
    assert rgl.load(tmp_path / "fit" / TABLE).facts["comments"]


@pytest.mark.parametrize(
    ("right", "wrong", "told"),
    [
        ("float fov", "float fieldofview", "fieldofview"),
        ("[ 640 ]", "[ 640.5 ]", "no integer"),
        ("LightSource", "LightSorce", "LightSorce"),
        ("WorldBegin", "", "before WorldBegin"),
        ("AttributeEnd", "", "without AttributeEnd"),
        ('"rgb L" [ 0.3 0.36', '"rgb L" [ 0.36', "2 values"),
        ('NamedMaterial "samples"', 'NamedMaterial "sample"', "is not made"),
    ],
)
@pytest.mark.usefixtures("coarse")
def test_the_reader_of_scenes_sees_what_is_wrong(right: str, wrong: str, told: str, tmp_path: Path) -> None:
    engine_folder(tmp_path / "fit", PLAIN, "pbrt")
    scene = tmp_path / "fit" / SCENE
    text = scene.read_text()
    assert right in text
    scene.write_text(text.replace(right, wrong, 1))
    with pytest.raises(AssertionError, match=told):
        parsed(scene)


def taken(path: Path) -> dict[str, np.ndarray]:
    """The fields of a table that pbrt would take: each condition of its `MeasuredBRDF::Create` (src/pbrt/bxdfs.cpp)."""
    fields = read_tensors(path)
    axes = {"description": 1, "theta_i": 1, "phi_i": 1, "wavelengths": 1, "ndf": 2, "sigma": 2, "vndf": 4}
    axes |= {"luminance": 4, "spectra": 5, "jacobian": 1}
    for name, count in axes.items():
        kind = "u1" if name in ("description", "jacobian") else "f4"
        assert fields[name].ndim == count, name
        assert fields[name].dtype.str[1:] == kind, name
    slices = fields["phi_i"].shape + fields["theta_i"].shape
    for name in ("vndf", "luminance", "spectra"):
        assert fields[name].shape[:2] == slices, name
    assert fields["spectra"].shape[2:3] == fields["wavelengths"].shape
    assert fields["luminance"].shape[2:] == fields["spectra"].shape[3:]
    assert len(set(fields["spectra"].shape[3:])) == 1
    assert fields["jacobian"].shape == (1,)
    if len(fields["phi_i"]) > 2:
        covered = float(fields["phi_i"][-1] - fields["phi_i"][0])
        assert round(2 * math.pi / covered) == 1
    return fields


def symmetric() -> Factorization:
    """The same after half a turn, so that half of it would do for other readers."""
    texture = random_texture(9, 9)
    return product((fixed_projection("h", True), texture + texture.flip((0, 1))))


@pytest.mark.usefixtures("coarse")
@pytest.mark.parametrize("name", ["isotropic", "brushed"])
def test_pbrt_would_take_the_table(name: str, tmp_path: Path) -> None:
    assert len(adaptive.azimuths(symmetric())) == 5
    engine_folder(tmp_path / "fit", {"isotropic": isotropic, "brushed": symmetric}[name](), "pbrt")
    fields = taken(tmp_path / "fit" / TABLE)
    assert len(fields["phi_i"]) == {"isotropic": 1, "brushed": 9}[name]
    # `MeasuredBxDF::f` takes azimuths by atan2, multiplies by D/(4σ) whatever the flag says, and CHECKs for
    # what is negative; its tables are interpolated in rising wavelengths.
    if name == "brushed":
        assert fields["phi_i"][[0, -1]].tolist() == pytest.approx([-math.pi, math.pi], rel=1e-6)
    assert fields["jacobian"].tolist() == [1]
    assert fields["spectra"].min() >= 0
    assert (np.diff(fields["wavelengths"]) > 0).all()
    assert (np.diff(fields["theta_i"]) > 0).all()
    assert fields["luminance"].min() > 0


@pytest.mark.usefixtures("coarse")
def test_spectra_hold_the_table_in_rgb(tmp_path: Path) -> None:
    made = engine_folder(tmp_path / "fit", isotropic(), "pbrt")
    table = PBRT.add(made).looks[TABLE]
    read = rgl.load(tmp_path / "fit" / TABLE)
    spectral = rgl.load(tmp_path / "fit" / TABLE, "spectral")
    wi, wo = draw_cosine_weighted(500, torch.Generator().manual_seed(0))
    # The renderer's incidence, the first in a table, is the viewer.
    assert torch.allclose(read.evaluate(wo, wi), table.evaluate(wi, wo), rtol=1e-5)
    assert torch.allclose(spectral.evaluate(wo, wi), to_spectra(table.evaluate(wi, wo)), rtol=1e-4)


@pytest.mark.usefixtures("coarse")
def test_other_channels(tmp_path: Path) -> None:
    grey = factorization(fixed_projection("theta_h", True), channels=1)
    engine_folder(tmp_path / "grey", grey, "pbrt")
    fields = taken(tmp_path / "grey" / TABLE)
    assert fields["wavelengths"].tolist() == [NODES[0], NODES[-1]]
    assert (fields["spectra"][:, :, 0] == fields["spectra"][:, :, 1]).all()
    lines = replace(PLAIN, channels=("450nm", "550nm", "650nm"))
    engine_folder(tmp_path / "lines", lines, "pbrt")
    assert taken(tmp_path / "lines" / TABLE)["wavelengths"].tolist() == [450, 550, 650]
    four = factorization(fixed_projection("theta_h", True), channels=4)
    with pytest.raises(BadInput, match="pbrt: found channels R, G, B, A, expected R, G, B or one alone"):
        PBRT.add(exported(four, format_named("exr")))


def mitsuba_rgb(path: Path, wi: torch.Tensor, wo: torch.Tensor) -> np.ndarray:
    """f cosθi as linear sRGB (N, 3) under D65 of Mitsuba's spectral reading, by colour-science's tables, 4 nm."""
    mi = variant("llvm_ad_spectral", register=False)
    bsdf = mi.load_dict({"type": "measured", "filename": str(path)})
    raster = np.arange(360.0, 776.0, 4)
    shape = colour.SpectralShape(360, 780, 4)
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape).values[: len(raster)]
    light = colour.SDS_ILLUMINANTS["D65"].copy().align(shape).values[: len(raster)]
    # All in one call: four wavelengths are evaluated at once.
    repeats, fours = len(raster) // 4, raster.reshape(-1, 4).repeat(len(wi), axis=0).T
    si = seen_from(mi, wo.repeat(repeats, 1))
    si.wavelengths = mi.UnpolarizedSpectrum(*(mi.Float(each.astype(np.float32)) for each in fours))
    found = np.array(bsdf.eval(mi.BSDFContext(), si, vectors(mi, wi.repeat(repeats, 1))))
    values = found.reshape(4, repeats, len(wi)).transpose(2, 1, 0).reshape(len(wi), -1)
    weights = observer * light[:, None]
    xyz = values @ weights / weights[:, 1].sum()
    return colour.XYZ_to_sRGB(xyz, apply_cctf_encoding=False)


def off(path: Path, reflectance: Reflectance, pairs: int) -> np.ndarray:
    """Differences of Mitsuba's RGB over the channels' mean, or .01 of all's, at cosine-weighted pairs."""
    wi, wo = (each.float().double() for each in draw_cosine_weighted(pairs, torch.Generator().manual_seed(3)))
    expected = (reflectance.evaluate(wi, wo) * wi[:, 2:]).numpy()
    return np.abs(mitsuba_rgb(path, wi, wo) - expected) / np.maximum(
        expected.mean(1, keepdims=True), 0.01 * expected.mean()
    )


@pytest.mark.usefixtures("coarse")
@pytest.mark.parametrize("fit", [isotropic(), ONE_WAY], ids=["isotropic", "one way"])
def test_mitsuba_has_the_table_s_rgb_under_d65(fit: Factorization, tmp_path: Path) -> None:
    made = engine_folder(tmp_path / "fit", fit, "pbrt")
    found = off(tmp_path / "fit" / TABLE, PBRT.add(made).looks[TABLE], 500)
    assert np.median(found) < 1e-3
    assert np.quantile(found, 0.99) < 0.01
    if fit is ONE_WAY:
        # However few its nodes, the table is nearer to the fit than to the exchange of light and viewer.
        here, there = (np.median(off(tmp_path / "fit" / TABLE, each, 500)) for each in (fit, Exchanged(fit)))
        assert here < there / 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fit", "median", "most"),
    [(isotropic(), 0.005, 0.06), (ONE_WAY, 0.015, 0.25), (brushed(), 0.03, 0.5)],
    ids=["isotropic", "one way", "brushed"],
)
def test_mitsuba_has_the_fit_s_rgb_under_d65(fit: Factorization, median: float, most: float, tmp_path: Path) -> None:
    made = engine_folder(tmp_path / "fit", fit, "pbrt")
    found = off(tmp_path / "fit" / TABLE, made.stored, 2000)
    assert np.median(found) < median
    assert np.quantile(found, 0.99) < most


@pytest.mark.usefixtures("coarse")
def test_the_files_are_text_without_marks_and_say_how_far_off(tmp_path: Path) -> None:
    engine_folder(tmp_path / "fit", PLAIN, "pbrt")
    for name in (SCENE, MATERIAL):
        text = (tmp_path / "fit" / name).read_text()
        assert "@" not in text
        assert max(map(len, text.splitlines())) <= 120
    told = re.search(r"off the fit's values by (.*)% in the median", (tmp_path / "fit" / MATERIAL).read_text())
    assert told is not None
    assert float(told[1]) > 0
    assert f"by {told[1]}%" in "".join(rgl.load(tmp_path / "fit" / TABLE).facts["comments"])
