"""The fewer triangles of a moving picture: a part of the vertices, the same surface, the same border."""

import numpy as np
import pytest

from homofact.meshes.mesh import Mesh
from homofact.meshes.shapes import ground, sphere, torus_knot
from homofact.relighting.page import coarse
from homofact.relighting.page.build import closed
from homofact.relighting.page.coarse import FEW, PART, coarse_triangles


def areas(mesh: Mesh, triangles: np.ndarray) -> np.ndarray:
    """Twice the vector areas (T, 3)."""
    a, b, c = (mesh.positions[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def euler(triangles: np.ndarray) -> int:
    """V − E + T."""
    edges = np.unique(np.sort(np.concatenate([triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])]), 1), axis=0)
    return len(np.unique(triangles)) - len(edges) + len(triangles)


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Meshes that are soon made coarse are not too few triangles."""
    monkeypatch.setattr(coarse, "FEW", 500)


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize("mesh", [sphere(24), torus_knot(96, 12)], ids=["sphere", "knot"])
def test_a_quarter_of_the_triangles_is_the_same_surface(mesh: Mesh) -> None:
    found = coarse_triangles(mesh)
    assert found is not None
    assert len(found) == pytest.approx(PART * len(mesh.triangles), abs=2)
    assert euler(found) == euler(np.asarray(mesh.triangles))
    assert closed(found)
    # No triangle looks the other way, and little of the area is cut off.
    faces = areas(mesh, found)
    assert ((faces * mesh.normals[found].sum(1)).sum(1) > 0).all()
    size = np.linalg.norm(areas(mesh, np.asarray(mesh.triangles)), axis=1).sum()
    assert 0.9 * size < np.linalg.norm(faces, axis=1).sum() < size


@pytest.mark.usefixtures("few")
def test_the_border_stays() -> None:
    mesh = ground(2.0, 0.0, 32)
    found = coarse_triangles(mesh)
    assert found is not None
    assert areas(mesh, found)[:, 1].sum() == pytest.approx(
        areas(mesh, np.asarray(mesh.triangles))[:, 1].sum(), rel=1e-9
    )
    assert (areas(mesh, found)[:, 1] > 0).all()
    rim = np.flatnonzero(np.abs(mesh.positions[:, ::2]).max(1) == 2.0)
    assert np.isin(rim, found).all()


def test_few_triangles_and_torn_ones_stay_as_they_are() -> None:
    assert coarse_triangles(torus_knot(48, 8)) is None
    loose = np.arange(3 * FEW).reshape(-1, 3)
    rng = np.random.default_rng(0)
    positions = rng.normal(size=(3 * FEW, 3))
    torn = Mesh(positions, np.broadcast_to((0.0, 0.0, 1.0), positions.shape).copy(), loose, "torn")
    assert coarse_triangles(torn) is None


@pytest.mark.usefixtures("few")
def test_the_same_mesh_gives_the_same_triangles() -> None:
    mesh = torus_knot(96, 12)
    first, second = coarse_triangles(mesh), coarse_triangles(mesh)
    assert first is not None
    assert second is not None
    assert np.array_equal(first, second)
