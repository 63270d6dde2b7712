"""Patterns of an object, and scenes whose objects are the parts of a glTF file."""

from pathlib import Path

import numpy as np
import pytest
import torch
from meshes.test_gltf_parts import scene as gltf_scene
from refusals import refused

from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.containers.png import write_png
from homofact.editing.build import open_edit_scene
from homofact.editing.patterns import PicturePattern, Squares, Wood, open_pattern
from homofact.editing.picture import radiance, starting_curves
from homofact.editing.precompute import prepare
from homofact.editing.scene_file import EditSceneFile, read_edit_scene, scene_of_record
from homofact.scene.materials import open_materials

REST = """
[lighting]
named = "uniform"
[[camera]]
eye = [0, 0, 3]
pixels = [32, 24]
"""


def read(folder: Path, objects: str) -> EditSceneFile:
    (folder / "scene.toml").write_text(objects + REST)
    return read_edit_scene(folder / "scene.toml")


def test_a_picture_is_read_at_its_texels_and_keeps_its_mean() -> None:
    rng = np.random.default_rng(0)
    picture = rng.random((6, 4, 3)) + 0.1
    pattern = PicturePattern(picture)
    rows, columns = np.divmod(np.arange(24), 4)
    uv = np.stack(((columns + 0.5) / 4, (rows + 0.5) / 6), 1)
    found = pattern(np.zeros((24, 3)), uv)
    np.testing.assert_allclose(found, (picture / picture.mean((0, 1))).reshape(24, 3), rtol=1e-12)
    np.testing.assert_allclose(found.mean(0), 1)
    # Repeated beyond its edges, and straight between texels.
    np.testing.assert_allclose(pattern(np.zeros((24, 3)), uv + np.array([3, -2])), found, rtol=1e-9)
    between = pattern(np.zeros((1, 3)), (uv[:1] + uv[1:2]) / 2)
    np.testing.assert_allclose(between[0], (found[0] + found[1]) / 2, rtol=1e-12)


def test_built_in_patterns_repeat_with_their_size() -> None:
    points = np.random.default_rng(1).uniform(-2, 2, (4000, 3))
    none = np.zeros((4000, 2))
    squares = Squares(0.5, 3)(points, none)
    assert set(np.unique(squares)) == {0.35, 1.0}
    np.testing.assert_array_equal(Squares(0.5, 3)(points + np.array([1.0, 0, 0]), none), squares)
    assert (Squares(0.5, 3)(points + np.array([0.5, 0, 0]), none) != squares).all()
    np.testing.assert_array_equal(Squares(1.0, 1)(2 * points, none), squares[:, :1])
    wood = Wood(0.3, 3)(points, none)
    assert 0.4 < wood.min() < 0.8 < 1.1 < wood.max() <= 1.25
    np.testing.assert_allclose(Wood(0.6, 3)(2 * points, none), wood, rtol=1e-9)
    # Along the grain it changes less than across it.
    step = 0.02
    along, across = (np.abs(Wood(0.3, 1)(points + d, none) - Wood(0.3, 1)(points, none)).mean()
                     for d in ([step, 0, 0], [0, 0, step]))  # fmt: skip
    assert along < 0.3 * across


def test_a_pattern_of_the_file_multiplies_the_first_term(tmp_path: Path) -> None:
    plain = prepare(open_edit_scene(read(tmp_path, '[[object]]\nmesh = "shape:sphere"\nalbedo = [0.5]\n')), 20, "full")
    text = '[[object]]\nmesh = "shape:sphere"\nalbedo = [0.5]\npattern = "squares"\npattern_size = 0.4\n'
    file = read(tmp_path, text)
    made = prepare(open_edit_scene(file), 20, "full")
    factors = Squares(0.4, 3)(made.pixels[0].points, made.pixels[0].uv)
    expected = radiance(plain, 0, starting_curves(plain)) * torch.from_numpy(factors)
    torch.testing.assert_close(radiance(made, 0, starting_curves(made)), expected)
    # The folder's record brings it back.
    again = scene_of_record(file.record(tmp_path), "x", tmp_path, "")
    assert (again.objects[0].pattern, again.objects[0].pattern_size) == ("squares", 0.4)


def test_a_gltf_scene_is_an_object_for_each_part_with_its_texture(tmp_path: Path) -> None:
    gltf_scene(tmp_path)
    file = read(tmp_path, '[[object]]\nmesh = "scene.glb"\nbands = [32, 32]\n')
    built = open_edit_scene(file)
    assert [edited.material.name for edited in built.objects] == ["plate", "square"]
    plate, square = built.objects
    assert not plate.patterns
    assert list(square.patterns) == ["base"]
    prepared = prepare(built, 20, "full")
    seen, values = prepared.pixels[0], radiance(prepared, 0, starting_curves(prepared))
    paper = seen.objects == 1
    upper, lower = paper & (seen.uv[:, 1] < 0.3), paper & (seen.uv[:, 1] > 0.7)
    assert upper.any()
    assert lower.any()
    # The upper half is red, the lower half white, but for the gloss.
    red, white = values[torch.from_numpy(upper)].mean(0), values[torch.from_numpy(lower)].mean(0)
    assert float(red[0]) > 3 * float(red[2])
    assert float(white[2]) == pytest.approx(float(white[0]), rel=1e-6)
    # The mean of white and of a red of 128, in linear light, is the base colour.
    (opened,) = open_materials(file.objects[1:])
    assert isinstance(opened.reflectance, MetallicRoughness)
    linear = ((128 / 255 + 0.055) / 1.055) ** 2.4
    assert opened.reflectance.base_colour == pytest.approx(((1 + linear) / 2, 0.5, 0.5))
    assert opened.picture is not None
    assert opened.picture[0, 0, 0] == pytest.approx(linear)
    # From its record, wherever that lies: each part by its name.
    (tmp_path / "out").mkdir()
    again = scene_of_record(file.record(tmp_path / "out"), "x", tmp_path / "out", "")
    assert [Path(each.mesh).name for each in again.objects] == ["scene.glb#plate", "scene.glb#square"]
    one = read(tmp_path, '[[object]]\nmesh = "scene.glb#plate"\n')
    assert [edited.mesh.name for edited in open_edit_scene(one).objects] == ["plate"]


def test_patterns_that_cannot_be_are_refused(tmp_path: Path) -> None:
    with refused(where="scene.toml: object[0].pattern"):
        read(tmp_path, '[[object]]\nmesh = "shape:sphere"\nalbedo = [0.5]\npattern = "marble"\n')
    write_png(tmp_path / "p.png", np.zeros((2, 2, 3), np.uint8))
    file = read(tmp_path, '[[object]]\nmesh = "shape:sphere"\nalbedo = [0.5]\npattern = "p.png"\n')
    with refused(where="object[0]: pattern"):
        open_edit_scene(file)
    with refused(where="pattern"):
        open_pattern(str(tmp_path / "p.png"), 1.0, 1, textured=True)
    with refused(where="scene.toml: object[0]"):
        read(tmp_path, '[[object]]\nmesh = "shape:sphere"\n')
