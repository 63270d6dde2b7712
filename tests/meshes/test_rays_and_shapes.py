"""Generated meshes, what is wrong with a mesh, surface frames, and rays against closed forms."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from refusals import refused

from homofact.errors import BadInput
from homofact.geometry.directions import draw_uniform
from homofact.meshes.mesh import Mesh, read_mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.prepare import open_edges, prepared
from homofact.meshes.shapes import ground, sphere, torus_knot
from homofact.meshes.tangents import frames
from homofact.scene.meshes import MeshGroup


def directions(count: int, seed: int = 0) -> np.ndarray:
    import torch

    both = draw_uniform(count, torch.Generator().manual_seed(seed))
    return np.concatenate((both[0].numpy(), both[1].numpy() * (1, 1, -1)))


def volume(mesh: Mesh) -> float:
    a, b, c = (mesh.positions[mesh.triangles[:, k]] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def test_shapes_are_closed_and_face_outward() -> None:
    for mesh, expected in ((sphere(64), 4 / 3 * np.pi), (torus_knot(), None)):
        assert open_edges(mesh) == 0
        assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1)
        assert volume(mesh) > 0
        if expected:
            assert volume(mesh) == pytest.approx(expected, rel=3e-3)
    plane = ground(3, -1, 4)
    a, b, c = (plane.positions[plane.triangles[:, k]] for k in range(3))
    faces = np.cross(b - a, c - a)
    assert faces.sum(0) / 2 == pytest.approx([0, 36, 0])
    assert (faces[:, 1] > 0).all()
    assert (plane.positions[:, 1] == -1).all()


def test_the_knot_has_a_constant_tube() -> None:
    """Its enclosed volume is the length of the curve times the tube's section (Pappus)."""
    mesh = torus_knot(768, 96)
    t = np.linspace(0, 2 * np.pi, 20001)
    curve = np.stack(((2 + np.cos(3 * t)) * np.cos(2 * t), (2 + np.cos(3 * t)) * np.sin(2 * t), -np.sin(3 * t)), 1) / 3
    length = np.linalg.norm(np.diff(curve, axis=0), axis=1).sum()
    scale = np.linalg.norm(curve, axis=1).max() + 0.14
    assert volume(mesh) == pytest.approx(length * np.pi * 0.14**2 / scale**3, rel=0.02)


def test_what_is_wrong_with_a_mesh_is_said_and_mended() -> None:
    ball = sphere(8)
    assert prepared(ball)[1] == ()
    turned, notes = prepared(replace(ball, normals=-ball.normals, triangles=ball.triangles[:, ::-1].copy()))
    assert notes == ("sphere: its normals point inwards; they are turned",)
    assert volume(turned) > 0
    assert turned.normals == pytest.approx(ball.normals)
    thin = replace(ball, triangles=np.concatenate((ball.triangles, [[0, 0, 1], [2, 3, 2]])))
    mended, notes = prepared(thin)
    assert notes == (f"sphere: 2 degenerate triangles of {len(ball.triangles) + 2} are left out",)
    assert len(mended.triangles) == len(ball.triangles)
    _, notes = prepared(replace(ball, triangles=ball.triangles[1:]))
    assert notes == ("sphere: open along 3 edges; light may enter it from behind",)
    with refused(where="sphere"):
        prepared(replace(ball, triangles=np.array([[0, 0, 1]])))


def test_frames_are_wangs() -> None:
    normals = directions(500)
    found = frames(normals)
    assert np.einsum("vij,vkj->vik", found, found) == pytest.approx(np.broadcast_to(np.eye(3), found.shape), abs=1e-12)
    assert np.linalg.det(found) == pytest.approx(1)
    x, y, z = normals.T
    wang = np.stack(((y + 1) ** 2 + z**2 - x**2, -2 * (y + 1) * x, -2 * x * z), 1)
    assert found[:, 0] == pytest.approx(wang / np.linalg.norm(wang, axis=1, keepdims=True), abs=1e-9)
    lowest = frames(np.array([[0.0, -1.0, 0.0]]))[0]
    assert lowest[0].tolist() == [1, 0, 0]
    assert np.linalg.det(lowest) == pytest.approx(1)


@pytest.fixture(scope="module")
def ball() -> Occluder:
    pytest.importorskip("embreex", reason="embreex is not installed: pip install 'homofact[relight]'")
    mesh = sphere(96)
    return Occluder(mesh.positions, mesh.triangles)


def test_rays_are_blocked_where_the_sphere_is_in_the_way(ball: Occluder) -> None:
    """From distance d a sphere of radius 1 covers the cone with sin α = 1/d."""
    w = directions(4000, 1)
    origin = np.array([0.0, 0.0, 2.5])
    cosine = -w[:, 2]
    edge = np.sqrt(1 - 1 / 2.5**2)
    blocked = ball.blocked(origin, w)
    sure = np.abs(cosine - edge) > 0.01
    assert (blocked == (cosine > edge))[sure].all()
    triangle, weights = ball.first(origin, w)
    assert ((triangle >= 0) == blocked).all()
    assert weights[blocked].sum(1) == pytest.approx(1)


def test_a_convex_surface_does_not_shadow_itself(ball: Occluder) -> None:
    mesh = sphere(96)
    w = directions(300, 2)
    for k in range(0, len(mesh.positions), 997):
        up = w[w @ mesh.normals[k] > 0.05]
        assert not ball.blocked(mesh.positions[k] + ball.offset * mesh.normals[k], up).any()
        assert ball.blocked(mesh.positions[k] + ball.offset * mesh.normals[k], -up).all()


def test_the_first_hit_is_the_point_itself(ball: Occluder) -> None:
    mesh = sphere(96)
    w = directions(200, 3)
    triangle, weights = ball.first(3 * w, -w)
    points = (mesh.positions[mesh.triangles[triangle]] * weights[..., None]).sum(1)
    assert np.cross(points, w) == pytest.approx(np.zeros_like(w), abs=1e-5)
    assert (points * w).sum(1) == pytest.approx(1, abs=2e-3)


def test_without_embree_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "embreex.mesh_construction", None)
    with pytest.raises(BadInput, match=r"pip install 'homofact\[relight\]'"):
        Occluder(np.eye(3), np.array([[0, 1, 2]]))


def test_gltf_is_read_as_obj_is(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed: pip install 'homofact[relight]'")
    ball = sphere(12)
    made = trimesh.Trimesh(ball.positions * 5 + 1, ball.triangles, process=False)
    scene = trimesh.Scene()
    scene.add_geometry(made, transform=trimesh.transformations.translation_matrix((2, 0, 0)))
    for name in ("ball.glb", "ball.gltf"):
        files = {name: scene.export(file_type="glb")} if name == "ball.glb" else scene.export(file_type="gltf")
        for file, content in files.items():
            (tmp_path / (name if file == "model.gltf" else file)).write_bytes(content)
        found = read_mesh(tmp_path / name)
        assert sorted(map(tuple, found.positions.round(4))) == sorted(map(tuple, ball.positions.round(4)))
        own = read_mesh(tmp_path / name, fitted=False)
        assert own.positions.mean(0) == pytest.approx(ball.positions.mean(0) * 5 + (3, 1, 1), abs=1e-4)
    whole = (tmp_path / "ball.glb").read_bytes()
    (tmp_path / "half.glb").write_bytes(whole[: len(whole) // 2])
    with refused(where="half.glb"):
        read_mesh(tmp_path / "half.glb")
    (tmp_path / "no.gltf").write_text('{"asset": {"version": "2.0"}}')
    with refused(where="no.gltf"):
        read_mesh(tmp_path / "no.gltf")


def test_a_wide_ground_is_finer_in_the_middle() -> None:
    even, wide = ground(4.0, -1.0, 16), ground(100.0, -1.0, 16)
    along = np.unique(even.positions[:, 0])
    assert np.diff(along) == pytest.approx(np.full(16, 0.5))
    along = np.unique(wide.positions[:, 0])
    assert along[[0, 8, 16]] == pytest.approx([-100, 0, 100])
    assert along == pytest.approx(-along[::-1])
    assert (np.diff(along, 2)[8:] > 0).all()
    # As near as those of a ground of half the width of the widest even one, and what the cube adds.
    assert along[9] == pytest.approx(0.25 + 98 / 8**3)
    corners = wide.positions[wide.triangles]
    assert (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 1] > 0).all()


def test_a_wide_ground_does_not_lift_the_rays_of_what_stands_on_it() -> None:
    ball = sphere(8)
    alone, wide = MeshGroup([ball]).occluder, MeshGroup([ball, ground(100.0, -1.0, 16)]).occluder
    near = MeshGroup([ball, ground(2.5, -1.0, 16)]).occluder
    assert wide.offset == pytest.approx(3 * alone.offset)
    assert alone.offset < near.offset < wide.offset
    # A plane alone is as large as it is.
    assert MeshGroup([ground(100.0, -1.0, 4)]).occluder.offset == pytest.approx(1e-4 * 200 * 2**0.5)
