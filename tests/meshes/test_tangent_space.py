"""Tangents of meshes with texture coordinates, and the normal maps of glTF parts."""

import base64
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bumpy import FLAT, edited, halves, square, tilted, waves, written
from refusals import refused

from homofact.meshes.gltf_parts import GltfMaterial, gltf_parts
from homofact.meshes.mesh import Mesh
from homofact.meshes.prepare import two_sided
from homofact.meshes.tangent_space import with_tangents
from homofact.scene.normal_map import SurfaceNormals
from homofact.scene.objects import ObjectTable, placed_mesh


def flat_square(u: float = 1.0, v: float = -1.0) -> Mesh:
    """A square that faces +z: u grows along x, v against y as glTF counts it, each times a number."""
    shape, _ = square()
    points = np.asarray(shape.vertices)
    normals, faces = np.tile([0.0, 0, 1], (len(points), 1)), np.asarray(shape.faces)
    return Mesh(points, normals, faces, "square", uv=points[:, :2] * (u, v))


@pytest.mark.parametrize(
    ("u", "v", "tangent", "sign"), [(1, -1, 1, 1), (-1, -1, -1, -1), (1, 1, 1, -1), (-1, 1, -1, 1)]
)
def test_the_tangent_follows_u_and_mirrored_coordinates_turn_the_binormal(
    u: int, v: int, tangent: int, sign: int
) -> None:
    found = with_tangents(flat_square(u, v))
    assert found.tangents is not None
    np.testing.assert_allclose(found.tangents, np.tile([tangent, 0, 0, sign], (25, 1)), atol=1e-12)
    # The green of a map points towards smaller v.
    bumps = SurfaceNormals(np.full((2, 2, 3), (0, 0.6, 0.8), np.float32), np.zeros((25, 2)), found.tangents)
    np.testing.assert_allclose(bumps.at_vertices(found.normals), np.tile([0, -0.6 * v, 0.8], (25, 1)), atol=1e-6)


def test_vertices_along_a_mirror_are_there_twice() -> None:
    mesh = flat_square()
    assert mesh.uv is not None
    uv = np.stack((np.abs(mesh.uv[:, 0]), mesh.uv[:, 1]), 1)
    mirrored = with_tangents(replace(mesh, uv=uv))
    assert mirrored.tangents is not None
    assert len(mirrored.positions) > 25
    corners = mirrored.tangents[mirrored.triangles]
    assert (corners[..., 3] == corners[:, :1, 3]).all()
    assert {*corners[:, 0, 3].tolist()} == {1.0, -1.0}
    np.testing.assert_array_equal(mirrored.positions[mirrored.triangles], mesh.positions[mesh.triangles])


def test_smooth_surfaces_share_tangents_by_angles() -> None:
    """On a cylinder round y the tangents of all vertices are those of the circle, whatever its triangles."""
    phi, y = (each.ravel() for each in np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, 1, 4)))
    points = np.stack((np.sin(phi), y, np.cos(phi)), 1)
    a = (25 * np.arange(3)[:, None] + np.arange(24)).ravel()
    faces = np.concatenate((np.stack((a, a + 1, a + 26), 1), np.stack((a, a + 26, a + 25), 1)))
    found = with_tangents(Mesh(points, points * (1, 0, 1), faces, "", uv=np.stack((phi, -y), 1)))
    assert found.tangents is not None
    inside = (phi > 0.1) & (phi < 6.1)
    expected = np.stack((np.cos(phi), 0 * phi, -np.sin(phi), 0 * phi + 1), 1)
    np.testing.assert_allclose(found.tangents[inside], expected[inside], atol=1e-9)


def test_coordinates_without_area_get_some_tangent() -> None:
    mesh = flat_square(0, 0)
    found = with_tangents(mesh)
    assert found.tangents is not None
    np.testing.assert_allclose(np.linalg.norm(found.tangents[:, :3], axis=1), 1)
    assert with_tangents(Mesh(mesh.positions, mesh.normals, mesh.triangles, "")).tangents is None


def test_the_back_of_a_surface_has_the_normals_turned_round() -> None:
    back = two_sided(with_tangents(flat_square()))
    assert back.tangents is not None
    assert back.uv is not None
    found = SurfaceNormals(np.full((2, 2, 3), (0.48, 0.36, 0.8), np.float32), back.uv, back.tangents).at_vertices(
        back.normals
    )
    np.testing.assert_allclose(found[25:], -found[:25], atol=1e-9)


def test_a_placed_mesh_turns_its_tangents(tmp_path: Path) -> None:
    written(tmp_path / "m.glb", waves(), mesh=square())
    table = ObjectTable(mesh=f"{tmp_path / 'm.glb'}#part", turn=90.0)
    found = placed_mesh(table)
    assert found.tangents is not None
    np.testing.assert_allclose(found.tangents, np.tile([0, 0, -1, 1], (25, 1)), atol=1e-9)


def part_of(file: Path) -> tuple[Mesh, GltfMaterial]:
    (part,) = gltf_parts(file)
    assert part.material is not None
    return part.mesh, part.material


def test_a_map_is_read_with_its_strength(tmp_path: Path) -> None:
    file = written(tmp_path / "m.glb", halves(tilted(30), tilted(45, 90)), mesh=square())
    _, material = part_of(file)
    assert material.normals is not None
    assert material.left_out == ()
    np.testing.assert_allclose(material.normals[0, 0], (0.5, 0, np.sqrt(0.75)), atol=0.01)
    np.testing.assert_allclose(material.normals[0, 15], (0, np.sqrt(0.5), np.sqrt(0.5)), atol=0.01)

    def stronger(header: dict[str, Any]) -> None:
        header["materials"][0]["normalTexture"]["scale"] = 2.0

    _, material = part_of(edited(file, stronger))
    assert material.normals is not None
    np.testing.assert_allclose(material.normals[0, 15], (0, np.sqrt(0.8), np.sqrt(0.2)), atol=0.01)


def test_a_flat_map_and_one_of_no_strength_are_none(tmp_path: Path) -> None:
    assert part_of(written(tmp_path / "m.glb", halves(FLAT, FLAT), mesh=square()))[1].normals is None
    file = written(tmp_path / "n.glb", waves(), mesh=square())

    def nothing(header: dict[str, Any]) -> None:
        header["materials"][0]["normalTexture"]["scale"] = 0

    mesh, material = part_of(edited(file, nothing))
    assert material.normals is None
    assert mesh.tangents is None


def test_tangents_of_the_file_are_kept(tmp_path: Path) -> None:
    """Also where a node turns the part; and those that are none are derived."""
    for value, expected in (((0, 1, 0, -1), (0, 1, 0, -1)), ((0, 0, 0, 1), (1, 0, 0, 1))):
        file = written(tmp_path / "m.glb", waves(), mesh=square())
        data = base64.b64encode(np.tile(np.array(value, "<f4"), (25, 1)).tobytes()).decode()

        def given(header: dict[str, Any], data: str = data) -> None:
            header["buffers"].append({"byteLength": 400, "uri": f"data:application/octet-stream;base64,{data}"})
            header["bufferViews"].append({"buffer": len(header["buffers"]) - 1, "byteLength": 400})
            view = len(header["bufferViews"]) - 1
            header["accessors"].append({"bufferView": view, "componentType": 5126, "count": 25, "type": "VEC4"})
            header["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = len(header["accessors"]) - 1

        mesh, _ = part_of(edited(file, given))
        assert mesh.tangents is not None
        np.testing.assert_allclose(mesh.tangents, np.tile(expected, (25, 1)), atol=1e-6)
        file.unlink()


def test_what_of_a_map_is_not_used_is_named(tmp_path: Path) -> None:
    file = written(tmp_path / "m.glb", waves(), mesh=square())

    def extended(header: dict[str, Any]) -> None:
        header["materials"][0]["normalTexture"]["extensions"] = {"EXT_other": {}}

    _, material = part_of(edited(file, extended))
    assert material.left_out == ("EXT_other of its normal map",)
    assert material.normals is not None

    def other(header: dict[str, Any]) -> None:
        header["materials"][0]["normalTexture"]["texCoord"] = 1

    _, material = part_of(edited(file, other))
    assert material.left_out[0] == "its normal map, on TEXCOORD_1"
    assert material.normals is None


def test_maps_that_cannot_be_used_are_refused(tmp_path: Path) -> None:
    shape, _ = square()
    written(tmp_path / "m.glb", waves(), mesh=(shape, None))
    with refused("expected TEXCOORD_0", found="a normal map on a mesh without texture coordinates"):
        gltf_parts(tmp_path / "m.glb")
    file = written(tmp_path / "n.glb", waves(), mesh=square())

    def far(header: dict[str, Any]) -> None:
        header["materials"][0]["normalTexture"]["index"] = 99

    with refused("expected a PNG or JPEG", found="a normal map that cannot be read"):
        gltf_parts(edited(file, far))
    file = written(tmp_path / "o.glb", waves(), mesh=square())

    def endless(header: dict[str, Any]) -> None:
        header["materials"][0]["normalTexture"]["scale"] = "much"

    with refused("expected a finite number", found="a normal map of scale 'much'"):
        gltf_parts(edited(file, endless))
