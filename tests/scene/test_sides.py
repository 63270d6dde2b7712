"""Open meshes that a camera sees from behind have a back, which is lit on its own side; others stay as they are."""

from pathlib import Path

import numpy as np
import pytest

import homofact
from homofact.meshes.prepare import open_edges, two_sided
from homofact.meshes.shapes import sphere
from homofact.scene.cameras import Camera
from homofact.scene.meshes import MeshGroup
from homofact.scene.visibility import seen_from_behind

pytest.importorskip("embreex", reason="embreex is not installed: pip install 'homofact[relight]'")
ABOVE, BELOW = Camera((0.2, 4.0, 0.3), pixels=(24, 18)), Camera((0.2, -4.0, 0.3), pixels=(24, 18))
SCENE = """
lighting = {named = "studio"}
[[object]]
mesh = "bowl.obj"
albedo = [0.7]
[[camera]]
eye = [0.2, 4.0, 0.3]
pixels = [24, 18]
"""


def bowl() -> tuple[np.ndarray, np.ndarray]:
    """The lower half of a ball, open at the top, its normals outward."""
    ball = sphere(12)
    low = (ball.positions[ball.triangles][..., 1] <= 0.01).all(1)
    return ball.positions, ball.triangles[low]


def write(folder: Path, rows: str) -> Path:
    positions, triangles = bowl()
    lines = [f"v {x:.9f} {y:.9f} {z:.9f}" for x, y, z in positions]
    lines += [f"vn {x:.9f} {y:.9f} {z:.9f}" for x, y, z in positions]
    lines += [f"f {a + 1}//{a + 1} {b + 1}//{b + 1} {c + 1}//{c + 1}" for a, b, c in triangles]
    (folder / "bowl.obj").write_text("\n".join(lines) + "\n")
    scene = folder / "scene.toml"
    scene.write_text(SCENE + rows)
    return scene


def test_the_inside_of_a_bowl_is_seen_from_above_alone() -> None:
    from dataclasses import replace

    positions, triangles = bowl()
    mesh = replace(sphere(12), positions=positions, triangles=triangles)
    closed = replace(sphere(12), positions=sphere(12).positions * 0.5 + [3, 0, 0])
    both = MeshGroup([mesh, closed])
    above, below = seen_from_behind(both, [ABOVE]), seen_from_behind(both, [BELOW])
    assert above[0] > 0.9
    assert below[0] < 0.01
    assert (above[1], below[1]) == (0, 0)
    assert 0.3 < seen_from_behind(both, [ABOVE, BELOW])[0] < 0.7


def test_a_back_faces_the_other_way_and_lies_behind() -> None:
    from dataclasses import replace

    positions, triangles = bowl()
    mesh = replace(sphere(12), positions=positions, triangles=triangles)
    assert open_edges(mesh) > 0
    both = two_sided(mesh)
    count = len(mesh.positions)
    assert (both.normals[count:] == -mesh.normals).all()
    gap = ((both.positions[:count] - both.positions[count:]) * mesh.normals).sum(1)
    assert gap == pytest.approx(gap[0])
    assert 0 < gap[0] < 0.01
    assert seen_from_behind(MeshGroup([both]), [ABOVE, BELOW])[0] < 0.02


@pytest.mark.parametrize("command", ["relight", "edit"])
def test_a_bowl_from_above_is_no_black_patch(tmp_path: Path, command: str) -> None:
    settings = "[transport]\ncube = 8\nkept = 64\n" if command == "relight" else "[edit]\ntriangles = 40\n"
    found = getattr(homofact, command)(write(tmp_path, settings))
    assert any("behind" in note and "%" in note for note in found.notes)
    middle = found.pictures[0][7:11, 9:15]
    assert (middle.max(2) > 40).all()


@pytest.mark.slow
def test_from_below_it_stays_as_it_is(tmp_path: Path) -> None:
    scene = write(tmp_path, "[transport]\ncube = 8\nkept = 8\n")
    scene.write_text(scene.read_text().replace("eye = [0.2, 4.0, 0.3]", "eye = [0.2, -4.0, 0.3]"))
    found = homofact.relight(scene, vertices=0)
    assert len(found.objects[0].mesh.triangles) == len(bowl()[1])
    assert not any("is given" in note for note in found.notes)
