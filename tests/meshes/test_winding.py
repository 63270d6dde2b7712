"""Triangles that are wound against their neighbours are turned; what has one side only is left."""

from pathlib import Path

import numpy as np
import pytest

from homofact.meshes.mesh import read_mesh
from homofact.meshes.prepare import prepared
from homofact.meshes.shapes import sphere, torus_knot
from homofact.meshes.winding import wound_alike

KNOT = torus_knot(24, 8)


def mixed(triangles: np.ndarray, share: float, seed: int = 0) -> np.ndarray:
    away = np.random.default_rng(seed).random(len(triangles)) < share
    return np.where(away[:, None], triangles[:, ::-1], triangles)


def same(found: np.ndarray, expected: np.ndarray) -> bool:
    """Whether triangles have the same orientation: the same corners up to rotation."""
    turns = [np.roll(expected, k, 1) for k in range(3)]
    return bool(np.logical_or.reduce([(found == each).all(1) for each in turns]).all())


@pytest.mark.parametrize("share", [0.01, 0.3, 0.5, 0.9])
def test_a_closed_mesh_is_wound_outward_whatever_its_triangles_were(share: float) -> None:
    given = mixed(KNOT.triangles, share)
    found, turned = wound_alike(KNOT.positions, given)
    assert same(found, KNOT.triangles)
    assert turned == (~(given == KNOT.triangles).all(1)).sum()


def test_a_mesh_that_agrees_is_left_as_it_is() -> None:
    for triangles in (KNOT.triangles, KNOT.triangles[:, ::-1], KNOT.triangles[:50]):
        found, turned = wound_alike(KNOT.positions, triangles)
        assert turned == 0
        assert found is triangles


def test_parts_are_wound_by_themselves() -> None:
    """A ball that agrees, though inside out, beside a knot that does not: the cavity of a hollow body stays one."""
    ball = sphere(8)
    positions = np.concatenate((KNOT.positions, 0.1 * ball.positions))
    inner = ball.triangles[:, ::-1] + len(KNOT.positions)
    found, turned = wound_alike(positions, np.concatenate((mixed(KNOT.triangles, 0.2), inner)))
    assert same(found[: len(KNOT.triangles)], KNOT.triangles)
    assert (found[len(KNOT.triangles) :] == inner).all()
    assert 0.1 * len(KNOT.triangles) < turned < 0.3 * len(KNOT.triangles)


def test_most_of_an_open_part_stays() -> None:
    side = KNOT.triangles[:-3]
    given = mixed(side, 0.2)
    assert same(wound_alike(KNOT.positions, given)[0], side)
    assert same(wound_alike(KNOT.positions, given[:, ::-1])[0], side[:, ::-1])


def test_a_strip_with_one_side_is_left_alone() -> None:
    steps = np.arange(12)
    turn = 2 * np.pi * steps / 12
    across = np.stack((np.cos(turn / 2) * np.cos(turn), np.cos(turn / 2) * np.sin(turn), np.sin(turn / 2)), 1)
    middle = np.stack((np.cos(turn), np.sin(turn), 0 * turn), 1)
    positions = np.concatenate((middle - 0.3 * across, middle + 0.3 * across))
    following = (steps + 1) % 12
    a, b, c, d = steps, steps + 12, following, following + 12
    c[-1], d[-1] = d[-1], c[-1]
    triangles = np.concatenate((np.stack((a, b, c), 1), np.stack((c, b, d), 1)))
    found, turned = wound_alike(positions, triangles)
    assert turned == 0
    assert (found == triangles).all()


def test_vertices_split_at_one_place_are_neighbours() -> None:
    positions = KNOT.positions[KNOT.triangles].reshape(-1, 3)
    triangles = np.arange(len(positions)).reshape(-1, 3)
    found, turned = wound_alike(positions, mixed(triangles, 0.3))
    assert same(found, triangles)
    assert turned > 0


def test_a_file_is_mended_and_says_so(tmp_path: Path) -> None:
    """Normals are as if nothing had been turned: before, they cancelled each other."""
    place = tmp_path / "knot.obj"

    def write(triangles: np.ndarray) -> None:
        lines = [f"v {x:.17g} {y:.17g} {z:.17g}" for x, y, z in KNOT.positions]
        lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles]
        place.write_text("\n".join(lines))

    write(KNOT.triangles)
    whole = read_mesh(place)
    assert whole.remarks == ()
    write(mixed(KNOT.triangles, 0.5))
    found, notes = prepared(read_mesh(place))
    # The reader numbers vertices as faces name them.
    placed = [mesh.normals[np.lexsort(mesh.positions.T)] for mesh in (found, whole)]
    assert placed[0] == pytest.approx(placed[1], abs=1e-9)
    sides = np.cross(*np.diff(found.positions[found.triangles], axis=1).swapaxes(0, 1))
    assert ((sides * found.normals[found.triangles[:, 0]]).sum(1) > 0).all()
    count = (~(mixed(KNOT.triangles, 0.5) == KNOT.triangles).all(1)).sum()
    assert len(notes) == 1
    assert f"{count} of {len(KNOT.triangles)}" in notes[0]
