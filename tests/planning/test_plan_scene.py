"""Scenes of plans: what is read from TOML, and the one line that refuses each thing that cannot be meant."""

import math
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from refusals import refused

from homofact.errors import BadInput
from homofact.planning.scene import Budget, SceneMaterial, read_scene
from homofact.planning.tolerance import Tolerance

SCENE = """
[[material]]
source = "material:phong-30"
share = 1
[lighting]
named = "sun"
[tolerance]
reflected = 0.1
"""


def test_a_scene_is_read(tmp_path: Path) -> None:
    file = tmp_path / "shop.toml"
    file.write_text(SCENE + "[budget]\nbytes = 5000\n")
    found = read_scene(file)
    assert (found.name, found.tolerance) == ("shop", Tolerance.of(reflected=0.1))
    assert [each.name for each in found.lightings] == ["sun"]
    assert found.budget == Budget(5000, None)
    assert found.materials == (SceneMaterial("material:phong-30", 1.0),)


def test_a_trusted_verdict_is_asked_for_beside_limits(tmp_path: Path) -> None:
    file = tmp_path / "shop.toml"
    file.write_text(SCENE + "trusted = true\n")
    assert read_scene(file).tolerance == Tolerance.of(reflected=0.1, trusted=True)
    file.write_text(SCENE + "trusted = false\n")
    assert read_scene(file).tolerance == Tolerance.of(reflected=0.1)


def test_materials_without_a_share_have_equal_parts_of_what_the_others_leave(tmp_path: Path) -> None:
    file = tmp_path / "shop.toml"
    more = "".join(f'[[material]]\nsource = "material:phong-{n}"\n' for n in (10, 30))
    file.write_text(SCENE.replace("share = 1\n", "share = 0.5\n" + more))
    assert [each.share for each in read_scene(file).materials] == [0.5, 0.25, 0.25]
    file.write_text(SCENE.replace("share = 1\n", ""))
    assert [each.share for each in read_scene(file).materials] == [1]


def test_a_material_may_have_a_tolerance_of_its_own(tmp_path: Path) -> None:
    file = tmp_path / "shop.toml"
    own = '[[material]]\nsource = "material:phong-30"\nname = "far"\nshare = 0.4\n'
    text = SCENE.replace("share = 1", "share = 0.6\ntolerance = { delta_e = 0.5, trusted = true }\n" + own)
    file.write_text(text)
    found = read_scene(file)
    near, far = found.materials
    assert near.tolerance == found.tolerance_of(near) == Tolerance.of(delta_e=0.5, trusted=True)
    assert far.tolerance is None
    assert found.tolerance_of(far) == found.tolerance == Tolerance.of(reflected=0.1)
    assert near.key != far.key
    # Two names are needed to tell them apart.
    file.write_text(text.replace('name = "far"\n', ""))
    with refused(r"material\[1\].name: found none, expected a name of its own"):
        read_scene(file)


def test_where_every_material_has_its_own_the_scene_needs_none(tmp_path: Path) -> None:
    file = tmp_path / "shop.toml"
    without = SCENE.replace("[tolerance]\nreflected = 0.1\n", "")
    file.write_text(without.replace("share = 1", "share = 1\ntolerance = { cole = 0.1 }"))
    found = read_scene(file)
    assert found.tolerance is None
    assert found.tolerance_of(found.materials[0]) == Tolerance.of(cole=0.1)
    file.write_text(without)
    with refused(r"material\[0\].tolerance: found none, expected a section \[tolerance\], or one of each material"):
        read_scene(file)


def test_a_fit_is_no_source_of_a_plan(tmp_path: Path) -> None:
    (tmp_path / "paint").mkdir()
    (tmp_path / "paint" / "factorization.npz").write_bytes(b"")
    file = tmp_path / "shop.toml"
    file.write_text(SCENE.replace("material:phong-30", "paint"))
    with refused(r"material\[0\].source: found the folder of a fit \(result\), expected a measurement"):
        read_scene(file)


def test_several_lightings_and_limits_and_a_distance(tmp_path: Path) -> None:
    file = tmp_path / "shop.toml"
    text = SCENE.replace("share = 1", "share = 1\npixels = 40").replace(
        "reflected = 0.1", "delta_e = 1\ndelta_e_peak = 9"
    )
    file.write_text(text.replace("[lighting]", '[[lighting]]\nnamed = "overcast"\n[[lighting]]'))
    found = read_scene(file)
    assert [each.name for each in found.lightings] == ["overcast", "sun"]
    assert found.tolerance is not None
    assert found.tolerance.limits == (("delta_e", 1.0), ("delta_e_peak", 9.0))
    assert found.materials[0].pixels == 40


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("reflected = 0.1", "trusted = true", "tolerance: found no limit, expected at least one of cole, delta_e"),
        ("reflected = 0.1", "reflected = 0.1\ntrusted = 1", "tolerance.trusted: found 1, expected true or false"),
        (
            "share = 1",
            "share = 1\ntolerance = {}",
            r"material\[0\].tolerance: found no limit, expected at least one of",
        ),
        ("share = 1", "share = 1\ntolerance = { cole = -1 }", r"material\[0\].tolerance.cole: found -1, expected a"),
        ("share = 1", "share = 0.7", "the shares add up to 0.7, expected 1"),
        (
            "share = 1",
            'share = 1\n[[material]]\nsource = "material:phong-10"',
            "the shares add up to 1, expected less than 1",
        ),
        ("share = 1", "share = 0", r"material\[0\].share: found 0, expected a number above 0 and at most 1"),
        ("share = 1", 'share = "all"', "share: found the string 'all', expected a number"),
        ("material:phong-30", "material:phong-31", "material: found 'phong-31'"),
        ("material:phong-30", "paint.brdf", "no file .*paint.brdf, expected a measurement"),
        (
            "share = 1",
            "share = 1\ncolour = 2",
            r"material\[0\].colour: unknown key, expected one of source, share, pixels",
        ),
        ('named = "sun"', 'name = "sun"', r"lighting.name: unknown key \(nearest: lighting.named\)"),
        ('named = "sun"', 'named = "sun"\nenvironment = "x.hdr"', "found environment and named, expected exactly one"),
        ('named = "sun"', 'environment = "none.hdr"', "none.hdr: no such file, expected a .hdr or .exr"),
        ('named = "sun"', "lights = []", "lighting: found no lights, expected some light"),
        ('named = "sun"', "lights = [{direction = [0, 0, 1], radiance = 0}]", "only lights of radiance 0"),
        ('named = "sun"', "lights = [{direction = [0, 0, 0]}]", "light direction: found"),
        ('named = "sun"', "lights = [{direction = [0, 0, 1], radiance = [1, 2]}]", "expected 1 or 3 numbers"),
        ("reflected = 0.1", "de = 1", "tolerance.de: unknown key, expected one of cole, delta_e, delta_e_p95"),
        ("share = 1\n", 'share = 1\n[[object]]\nmesh = "knot.ply"\n', r"found \[\[material\]\] and \[\[object\]\]"),
        (SCENE, "[[object]]\nterms = 1\n", "found a scene for relighting, expected a scene for planning"),
        (SCENE, "[fit]\nsize = 1\n", "found a configuration, expected a scene for planning"),
        ("reflected = 0.1", "reflected = 0", "tolerance.reflected: found 0, expected a number above 0"),
        (
            "reflected = 0.1",
            "delta_e_peek = 1",
            r"tolerance.delta_e_peek: unknown key \(nearest: tolerance.delta_e_peak\)",
        ),
        ("reflected = 0.1", "delta_e_p95 = -1", "tolerance.delta_e_p95: found -1, expected a number above 0"),
        ("reflected = 0.1", "", "tolerance: found no limit, expected at least one of cole, delta_e, delta_e_p95"),
        ("share = 1", "share = 1\npixels = 1", r"material\[0\].pixels: found 1, expected a whole number from 2"),
        ("share = 1", "share = 1\npixels = 3.5", r"material\[0\].pixels: found 3.5, expected a whole number"),
        (
            "[lighting]",
            '[[lighting]]\nnamed = "moon"\n[[lighting]]',
            "lighting.named: found 'moon', expected one of sun, overcast",
        ),
        ("[lighting]", '[[lighting]]\nname = "sun"\n[[lighting]]', r"lighting\[0\].name: unknown key"),
        ('[lighting]\nnamed = "sun"', "[[lighting]]", r"lighting\[0\]: found none, expected exactly one of"),
        ("[tolerance]", "[tolerances]", r"tolerances: unknown section \(nearest: tolerance\)"),
        (
            "[lighting]",
            "[budget]\nbytes = 1\n[lighting]",
            "budget.bytes: found 1, expected a whole number of at least 4",
        ),
        ("[[material]]", "[material]", r"material: found a section, expected sections \[\[material\]\]"),
        ("[lighting]", "[lighting", "not TOML"),
    ],
)
def test_a_scene_that_cannot_be_meant(old: str, new: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    assert old in SCENE
    file.write_text(SCENE.replace(old, new))
    with pytest.raises(BadInput, match=message) as refused:
        read_scene(file)
    assert str(file) in str(refused.value)
    assert "\n" not in str(refused.value)


def test_no_scene(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no such file, expected a scene in TOML"):
        read_scene(tmp_path / "none.toml")


@pytest.mark.parametrize(("bad", "word"), [(math.nan, "not finite"), (-1.0, "negative"), (math.inf, "not finite")])
def test_an_environment_that_is_no_light(bad: float, word: str, tmp_path: Path) -> None:
    pixels = np.ones((8, 16, 3), dtype=np.float32)
    pixels[3, 5, 1] = bad
    _write_exr(tmp_path / "sky.exr", pixels)
    file = tmp_path / "scene.toml"
    file.write_text(SCENE.replace('named = "sun"', 'environment = "sky.exr"'))
    with pytest.raises(BadInput, match=f"sky.exr: pixel row 3, column 5 is {word}"):
        read_scene(file)


def test_a_black_environment_and_one_that_is_light(tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    file.write_text(SCENE.replace('named = "sun"', 'environment = "sky.exr"'))
    _write_exr(tmp_path / "sky.exr", np.zeros((8, 16, 3), dtype=np.float32))
    with pytest.raises(BadInput, match="every pixel is 0, expected some light"):
        read_scene(file)
    _write_exr(tmp_path / "sky.exr", np.ones((8, 16, 3), dtype=np.float32))
    assert read_scene(file).lightings[0].last_excited == 0


def _write_exr(path: Path, pixels: np.ndarray) -> None:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"RGB": pixels}) as file:
        file.write(str(path))
