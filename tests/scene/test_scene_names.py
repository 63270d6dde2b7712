"""Names in scene files: of the scene, of its materials and objects, and what a key that means nothing says."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from refusals import refused

from homofact.editing.scene_file import read_edit_scene
from homofact.planning.scene import read_scene
from homofact.relighting.scene_file import RelightObjectTable, read_relight_scene
from homofact.rendering.light import EnvironmentMap
from homofact.scene.objects import bounce_note, edge_note, place_objects

PLAN = """{top}[[material]]
source = "material:phong-30"
share = 1
{own}[lighting]
named = "studio"
[tolerance]
delta_e = 2
"""
RELIT = """{top}[[object]]
mesh = "shape:sphere"
albedo = [0.5]
{own}[ground]
albedo = [0.3]
steps = 2
{ground}[lighting]
named = "studio"
[[camera]]
eye = [0, 1, 3]
"""


def written(folder: Path, text: str, top: str = "", own: str = "", ground: str = "") -> Path:
    file = folder / "stem.toml"
    file.write_text(text.format(top=top, own=own, ground=ground), encoding="utf-8")
    return file


def test_a_name_replaces_the_stem_of_the_file(tmp_path: Path) -> None:
    top = 'name = "Show room"\n'
    for text, read in ((PLAN, read_scene), (RELIT, read_relight_scene), (RELIT, read_edit_scene)):
        assert read(written(tmp_path, text)).name == "stem"
        assert read(written(tmp_path, text, top)).name == "Show room"


def test_a_material_of_a_plan_has_its_name_beside_its_source(tmp_path: Path) -> None:
    (plain,) = read_scene(written(tmp_path, PLAN)).materials
    (named,) = read_scene(written(tmp_path, PLAN, own='name = "case"\n')).materials
    assert (plain.name, named.name) == (None, "case")
    # One choice serves both.
    assert plain.key == named.key


def test_objects_and_ground_are_called_by_their_names(tmp_path: Path) -> None:
    file = read_relight_scene(written(tmp_path, RELIT, own='name = "ball"\n', ground='name = "table"\n'))
    placed, _ = place_objects(file.objects, file.ground, file.cameras)
    assert [each.mesh.name for each in placed] == ["ball", "table"]
    file = read_relight_scene(written(tmp_path, RELIT))
    placed, _ = place_objects(file.objects, file.ground, file.cameras)
    assert [each.mesh.name for each in placed] == ["sphere", "ground"]


def test_parts_of_a_named_gltf_scene_keep_their_own_names_behind_it() -> None:
    whole = RelightObjectTable(mesh="lamp.glb", name="lamp")
    assert whole.part("lamp.glb#foot", several=True).name == "lamp foot"
    assert whole.part("lamp.glb#foot", several=False).name == "lamp"
    assert RelightObjectTable(mesh="lamp.glb").part("lamp.glb#foot", several=True).name is None


@pytest.mark.parametrize(
    ("text", "own", "where"),
    [(PLAN, 'name = " "\n', "material[0].name"), (RELIT, 'name = ""\n', "object[0].name")],
)
def test_a_name_is_more_than_spaces(text: str, own: str, where: str, tmp_path: Path) -> None:
    read = read_scene if text is PLAN else read_relight_scene
    with refused(where=f"stem.toml: {where}"):
        read(written(tmp_path, text, own=own))


@pytest.mark.parametrize("top", ["seed = 3\n", "[transport]\n"])
def test_a_key_that_edit_does_not_have_says_what_to_do(top: str, tmp_path: Path) -> None:
    file = written(tmp_path, RELIT, top if "seed" in top else "", own="")
    if "seed" not in top:
        file.write_text(file.read_text(encoding="utf-8") + top, encoding="utf-8")
    file.write_text(file.read_text(encoding="utf-8") + "[edit]\n", encoding="utf-8")
    with refused("leave it out"):
        read_edit_scene(file)


def test_a_map_that_shines_past_the_edge_of_the_ground_is_noted(tmp_path: Path) -> None:
    file = read_relight_scene(written(tmp_path, RELIT))
    assert file.ground is not None
    radiance = torch.full((32, 64, 3), 0.01, dtype=torch.float64)
    radiance[17:22] = 1.0
    low = EnvironmentMap(radiance, name="low.hdr")
    (line,) = edge_note(file.ground, low)
    assert line.startswith("low.hdr is bright below its horizon too")
    assert edge_note(None, low) == edge_note(replace(file.ground, half=100.0), low) == ()
    # What is bright above the horizon does not count, nor what is so deep that the ground hides it.
    assert edge_note(file.ground, EnvironmentMap(radiance.flip(0))) == ()
    assert edge_note(file.ground, EnvironmentMap(radiance.roll(9, 0))) == ()


def test_light_that_the_ground_would_send_is_noted_where_there_is_some(tmp_path: Path) -> None:
    ground = read_relight_scene(written(tmp_path, RELIT)).ground
    assert ground is not None
    (line,) = bounce_note(ground, 0, "transport")
    assert "bounces = 1 in [transport] adds it" in line
    assert bounce_note(ground, 1, "transport") == ()
    assert bounce_note(None, 0, "transport") == ()
    black = read_relight_scene(written(tmp_path, RELIT.replace("[0.3]", "[0.01, 0, 0]"))).ground
    assert bounce_note(black, 0, "edit") == ()
    metal = read_relight_scene(written(tmp_path, RELIT.replace("albedo = [0.3]", 'material = "material:phong-30"')))
    assert len(bounce_note(metal.ground, 0, "edit")) == 1
