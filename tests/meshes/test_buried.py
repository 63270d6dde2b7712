"""Where the light of vertices that lie inside other parts is asked."""

import numpy as np
import pytest

from homofact.meshes.buried import with_open_origins
from homofact.meshes.mesh import Mesh
from homofact.meshes.shapes import sphere
from homofact.scene.meshes import MeshGroup


def wall(low: float, high: float, name: str = "wall") -> Mesh:
    """An upright square, 2 wide, that faces +z."""
    corners = np.array([[-1.0, low, 0], [1, low, 0], [1, high, 0], [-1, high, 0]])
    return Mesh(corners, np.tile([0.0, 0, 1], (4, 1)), np.array([[0, 1, 2], [0, 2, 3]]), name)


def box(height: float) -> Mesh:
    """A closed box from y = −3 up to `height`, round the wall's foot."""
    x, y, z = np.meshgrid([-2.0, 2.0], [-3.0, height], [-2.0, 2.0], indexing="ij")
    corners = np.stack((x, y, z), -1).reshape(-1, 3)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))])
    return Mesh(corners, corners / np.linalg.norm(corners, axis=1, keepdims=True), triangles, "box")


@pytest.mark.parametrize("height", [-0.6, 0.1, 0.4])
def test_a_foot_in_a_box_is_lit_where_it_comes_out(height: float) -> None:
    """The wall goes from −1 to 1: its lower corners are asked at the first place on the list above the box."""
    own = wall(-1, 1)
    found = with_open_origins(own, MeshGroup([own, box(height)]).occluder)
    assert found.origins is not None
    assert np.array_equal(found.positions, own.positions)
    moved = (found.lit_at != own.positions).any(1)
    assert moved.tolist() == [True, True, False, False]
    lowest = found.lit_at[:2, 1]
    assert (lowest > height).all()
    # Lines to the upper corners rise by 2 in all, those to middles of triangles by two thirds or a third of it.
    along = np.array([1 / 8, 1 / 4, 1 / 2, 3 / 4])
    rises = 2 * along[:, None] * [1, 2 / 3, 1 / 3]
    assert np.isclose(rises.ravel(), lowest[:, None] + 1).any(1).all()
    assert (lowest + 1 <= 2 * along[2 * along - 1 > height].min() + 1e-9).all()


def test_what_is_in_the_open_or_nowhere_stays() -> None:
    """A mesh alone, a sphere under a larger one, and a surface that stands just above another one."""
    own = wall(-1, 1)
    assert with_open_origins(own, MeshGroup([own]).occluder) is own
    inner, outer = sphere(8), sphere(8)
    inner = Mesh(inner.positions * 0.5, inner.normals, inner.triangles, "inner")
    assert with_open_origins(inner, MeshGroup([inner, outer]).occluder) is inner
    on_top = wall(0.11, 1)
    assert with_open_origins(on_top, MeshGroup([on_top, box(0.1)]).occluder) is on_top
