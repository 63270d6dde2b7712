"""KHR_texture_transform: what it makes of texture coordinates, in numbers and in glTF files."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refused

from homofact.meshes.gltf_parts import GltfPart, gltf_parts
from homofact.meshes.texture_transform import NAME, TextureTransform
from homofact.scene.file_fits import FileFits
from homofact.scene.materials import open_material

trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed: pip install 'homofact[relight]'")
Image = pytest.importorskip("PIL.Image", reason="pillow is not installed: pip install 'homofact[pictures]'")

CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
MOVE = {"offset": [0.25, 0.5], "rotation": 0.3, "scale": [2.0, 3.0]}


def part_of(folder: Path, on: Any = None, **moves: Any) -> GltfPart:
    """A square with `baseColorTexture` and `normalTexture`, each moved where it is named.

    `on` is the `texCoord` of both.
    """
    square = trimesh.Trimesh(np.c_[CORNERS, np.zeros(4)], [[0, 1, 2], [0, 2, 3]], process=False)
    pixels = Image.fromarray(np.arange(48, dtype=np.uint8).reshape(4, 4, 3))
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=pixels, normalTexture=pixels)
    square.visual = trimesh.visual.TextureVisuals(uv=CORNERS, material=material)
    for name, data in trimesh.Scene(square).export(file_type="gltf").items():
        (folder / ("m.gltf" if name.endswith(".gltf") else name)).write_bytes(data)
    place = folder / "m.gltf"
    header = json.loads(place.read_text())
    own = header["materials"][0]
    for key, move in moves.items():
        info = (own if key == "normalTexture" else own["pbrMetallicRoughness"])[key]
        info["extensions"] = {NAME: move}
    if on is not None:
        for info in (own["normalTexture"], own["pbrMetallicRoughness"]["baseColorTexture"]):
            info["texCoord"] = on
    place.write_text(json.dumps(header))
    (part,) = gltf_parts(place)
    return part


def coordinates(part: GltfPart) -> np.ndarray:
    assert part.mesh.uv is not None
    return part.mesh.uv


def left_out(part: GltfPart) -> tuple[str, ...]:
    assert part.material is not None
    return part.material.left_out


def test_scale_comes_first_then_rotation_then_offset() -> None:
    found = TextureTransform((0.25, 0.5), math.pi / 2, (2.0, 3.0)).applied(np.array([[0, 0], [1, 0], [0, 1]]))
    # u points right and v down: a quarter turn anticlockwise takes u up and v right.
    np.testing.assert_allclose(found, [[0.25, 0.5], [0.25, 0.5 - 2], [0.25 + 3, 0.5]], atol=1e-12)


def test_nothing_given_changes_nothing(tmp_path: Path) -> None:
    for info in (None, {}, {"extensions": []}, {"extensions": {NAME: 3}}, {"extensions": {NAME: {}}}):
        assert TextureTransform.of(info, "m") == TextureTransform()
    np.testing.assert_array_equal(TextureTransform().applied(CORNERS), CORNERS)
    np.testing.assert_allclose(coordinates(part_of(tmp_path)), CORNERS * (1, -1) + (0, 1), atol=1e-6)


def test_a_file_moves_both_of_its_pictures(tmp_path: Path) -> None:
    part = part_of(tmp_path, baseColorTexture=MOVE, normalTexture=MOVE)
    expected = TextureTransform((0.25, 0.5), 0.3, (2.0, 3.0)).applied(CORNERS * (1, -1) + (0, 1))
    np.testing.assert_allclose(coordinates(part), expected, atol=1e-6)
    assert left_out(part) == ()
    # Tangents point to where the moved u grows and the moved v stays.
    assert part.mesh.tangents is not None
    along = np.array([math.cos(0.3) / 2, -math.sin(0.3) / 3])
    np.testing.assert_allclose(part.mesh.tangents[:, :2], np.tile(along / np.linalg.norm(along), (4, 1)), atol=1e-6)


def test_pictures_that_move_apart_stay_and_are_named(tmp_path: Path) -> None:
    plain = CORNERS * (1, -1) + (0, 1)
    for key, words in (("baseColorTexture", "its texture"), ("normalTexture", "its normal map")):
        folder = tmp_path / key
        folder.mkdir()
        part = part_of(folder, **{key: MOVE})
        np.testing.assert_allclose(coordinates(part), plain, atol=1e-6)
        assert left_out(part) == (f"{NAME} of {words}",)


def test_other_coordinates_leave_the_mean_colour_and_are_named(tmp_path: Path) -> None:
    usual = part_of(tmp_path).material
    assert usual is not None
    assert usual.placed
    moved = part_of(tmp_path, baseColorTexture={"texCoord": 1, "scale": [2.0, 2.0]})
    assert moved.material is not None
    assert not moved.material.placed
    assert left_out(moved) == ("the detail of its texture, on TEXCOORD_1",)
    # The transform of a picture that is not placed moves nothing.
    np.testing.assert_allclose(coordinates(moved), CORNERS * (1, -1) + (0, 1), atol=1e-6)
    bumps = part_of(tmp_path, normalTexture={"texCoord": 2}).material
    assert bumps is not None
    assert bumps.normals is None
    assert bumps.placed
    assert bumps.left_out == ("its normal map, on TEXCOORD_2",)


def test_a_scene_reads_the_mean_of_a_texture_on_other_coordinates(tmp_path: Path) -> None:
    name = part_of(tmp_path).name
    usual = open_material(f"{tmp_path / 'm.gltf'}#{name}", FileFits())
    part_of(tmp_path, baseColorTexture={"texCoord": 1})
    moved = open_material(f"{tmp_path / 'm.gltf'}#{name}", FileFits())
    assert usual.picture is not None
    assert moved.picture is None
    assert moved.reflectance == usual.reflectance


def test_the_coordinates_of_a_transform_replace_those_of_the_texture(tmp_path: Path) -> None:
    back = part_of(tmp_path, on=1, baseColorTexture={"texCoord": 0}, normalTexture={"texCoord": 0}).material
    assert back is not None
    assert back.placed
    assert back.normals is not None
    assert back.left_out == ()
    assert set(left_out(part_of(tmp_path, on=1))) == {
        "the detail of its texture, on TEXCOORD_1", "its normal map, on TEXCOORD_1",
    }  # fmt: skip


@pytest.mark.parametrize("key", ["offset", "scale"])
@pytest.mark.parametrize("value", [[1.0], [1.0, True], [1.0, float("inf")], [1.0, -2e6], "ab", 2.0])
def test_pairs_that_are_none_are_refused(key: str, value: Any) -> None:
    with refused(where="m", found=f"a {NAME} of {key} {value!r}"):
        TextureTransform.of({"extensions": {NAME: {key: value}}}, "m")


def test_a_rotation_that_is_no_number_is_refused(tmp_path: Path) -> None:
    with refused(match=f"a {NAME} of rotation 'much'"):
        part_of(tmp_path, baseColorTexture={"rotation": "much"}, normalTexture={"rotation": "much"})
