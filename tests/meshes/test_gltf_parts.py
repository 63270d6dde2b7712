"""A glTF scene by its parts: places, names, materials, textures, and what is refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refused

from homofact.errors import BadInput
from homofact.meshes.gltf_parts import gltf_part, gltf_parts, is_gltf
from homofact.meshes.mesh import read_mesh

trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed: pip install 'homofact[relight]'")
Image = pytest.importorskip("PIL.Image", reason="pillow is not installed: pip install 'homofact[pictures]'")


def quad(z: float = 0.0) -> Any:
    """A square of two triangles with texture coordinates: (0, 0) at its lower left as OpenGL counts them."""
    corners = np.array([[0, 0, z], [1, 0, z], [1, 1, z], [0, 1, z]], float)
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


def dressed(mesh: Any, **material: Any) -> Any:
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    mesh.visual = trimesh.visual.TextureVisuals(uv=uv, material=trimesh.visual.material.PBRMaterial(**material))
    return mesh


def halves() -> Any:
    """Four rows of pixels: the upper two red of 128, the lower two white."""
    pixels = np.full((4, 4, 3), 255, np.uint8)
    pixels[:2] = (128, 0, 0)
    return Image.fromarray(pixels)


def scene(folder: Path, kind: str = "glb") -> Path:
    """A textured square, and one of metal with a name that is taken, two units along x."""
    found = trimesh.Scene()
    found.add_geometry(dressed(quad(), name="paper", baseColorTexture=halves(), metallicFactor=0.0), geom_name="square")
    metal = dressed(quad(), name="metal", baseColorFactor=[255, 128, 0, 255], roughnessFactor=0.25)
    found.add_geometry(metal, geom_name="plate", transform=trimesh.transformations.translation_matrix([2, 0, 0]))
    place = folder / f"scene.{kind}"
    if kind == "glb":
        place.write_bytes(found.export(file_type="glb"))
    else:
        for name, data in found.export(file_type="gltf").items():
            (folder / (place.name if name.endswith(".gltf") else name)).write_bytes(data)
    return place


@pytest.mark.parametrize("kind", ["glb", "gltf"])
def test_parts_keep_their_places_and_materials(kind: str, tmp_path: Path) -> None:
    metal, paper = gltf_parts(scene(tmp_path, kind))
    assert (metal.name, paper.name) == ("plate", "square")
    # The whole fits the unit sphere: 3 wide and 1 high.
    both = np.concatenate((paper.mesh.positions, metal.mesh.positions))
    assert np.linalg.norm(both, axis=1).max() == pytest.approx(1)
    assert metal.mesh.positions[:, 0].min() - paper.mesh.positions[:, 0].min() == pytest.approx(2 / np.sqrt(2.5))
    whole = read_mesh(scene(tmp_path, kind))
    assert sorted(map(tuple, whole.positions.round(9))) == sorted(map(tuple, both.round(9)))
    assert metal.material is not None
    assert metal.material.base_colour == pytest.approx((1, 128 / 255, 0), abs=1e-6)
    assert (metal.material.metallic, metal.material.roughness, metal.material.picture) == (1.0, 0.25, None)


def test_textures_stand_the_right_way_up(tmp_path: Path) -> None:
    part = gltf_part(f"{scene(tmp_path)}#square")
    assert part.material is not None
    picture = part.material.picture
    assert picture is not None
    np.testing.assert_allclose(picture[0, 0], (128 / 255, 0, 0), atol=1e-12)
    np.testing.assert_allclose(picture[3, 0], (1, 1, 1))
    # v runs downwards: the upper corners, at y = 1, read the first row.
    assert part.mesh.uv is not None
    upper = part.mesh.positions[:, 1] > 0
    np.testing.assert_allclose(part.mesh.uv[upper, 1], 0, atol=1e-6)
    np.testing.assert_allclose(part.mesh.uv[~upper, 1], 1, atol=1e-6)


def test_what_is_not_used_is_named(tmp_path: Path) -> None:
    mesh = dressed(quad(), normalTexture=halves(), emissiveFactor=[1.0, 0.0, 0.0], metallicRoughnessTexture=halves())
    place = tmp_path / "m.glb"
    place.write_bytes(trimesh.Scene(mesh).export(file_type="glb"))
    (part,) = gltf_parts(place)
    assert part.material is not None
    assert part.material.left_out == ("its emission", "the detail of its metallic-roughness texture")
    # The mean of green is of roughness, that of blue of metal.
    assert part.material.roughness == pytest.approx(0.5)
    assert part.material.metallic == pytest.approx(0.5)


def test_extensions_are_named(tmp_path: Path) -> None:
    place = scene(tmp_path, "gltf")
    header = json.loads(place.read_text())
    for material in header["materials"]:
        material["extensions"] = {"KHR_materials_clearcoat": {"clearcoatFactor": 1.0}}
    place.write_text(json.dumps(header))
    assert [part.material.left_out for part in gltf_parts(place) if part.material] == [("KHR_materials_clearcoat",)] * 2


def test_names_are_made_different(tmp_path: Path) -> None:
    found = trimesh.Scene()
    for k in range(3):
        found.add_geometry(quad(float(k)), geom_name="a#b")
    place = tmp_path / "m.glb"
    place.write_bytes(found.export(file_type="glb"))
    names = [part.name for part in gltf_parts(place)]
    assert len(set(names)) == 3
    assert not any("#" in name for name in names)


def test_which_names_are_of_gltf() -> None:
    assert is_gltf("a/b.GLB")
    assert is_gltf("b.gltf#lamp")
    assert not is_gltf("b.obj")


def test_pictures_and_parts_that_are_not_there_are_refused(tmp_path: Path) -> None:
    place = scene(tmp_path, "gltf")
    with refused(where="scene.gltf", found="no part 'lamp'"):
        gltf_part(f"{place}#lamp")
    header = json.loads(place.read_text())
    header["images"][0] = {"uri": "gone.png"}
    place.write_text(json.dumps(header))
    with refused(where="gone.png"):
        gltf_parts(place)
    (tmp_path / "gone.png").write_bytes(b"no picture")
    with pytest.raises(BadInput) as caught:
        gltf_parts(place)
    assert "\n" not in str(caught.value)


def test_a_texture_without_coordinates_is_refused(tmp_path: Path) -> None:
    place = scene(tmp_path, "gltf")
    header = json.loads(place.read_text())
    for mesh in header["meshes"]:
        for primitive in mesh["primitives"]:
            primitive["attributes"].pop("TEXCOORD_0", None)
    place.write_text(json.dumps(header))
    with refused(where="scene.gltf: square"):
        gltf_parts(place)
