"""Suns beside the lighting of a scene: what they add, their shadows, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
import torch
from refusals import refused

from homofact.editing.build import open_edit_scene
from homofact.editing.picture import radiance, starting_curves
from homofact.editing.precompute import prepare
from homofact.editing.scene import PreparedScene
from homofact.editing.scene_file import read_edit_scene, scene_of_record

SCENE = """
[[object]]
mesh = "shape:sphere"
albedo = [0.6]
size = 0.5
[ground]
albedo = [0.4, 0.3, 0.2]
half = 2
steps = 8
[lighting]
named = "uniform"
[[camera]]
eye = [0, 1.5, 3]
pixels = [40, 30]
"""
SUN = """
[[sun]]
direction = [0.6, 0.8, 0]
irradiance = [2.0, 1.0, 0.5]
"""


def prepared(folder: Path, text: str) -> PreparedScene:
    (folder / "scene.toml").write_text(text)
    return prepare(open_edit_scene(read_edit_scene(folder / "scene.toml")), 60, "full")


def values_of(scene: PreparedScene) -> torch.Tensor:
    return radiance(scene, 0, starting_curves(scene))


def test_a_sun_adds_its_light_where_it_shines(tmp_path: Path) -> None:
    without, with_sun = prepared(tmp_path, SCENE), prepared(tmp_path, SCENE + SUN)
    added = (values_of(with_sun) - values_of(without)).numpy()
    seen = with_sun.pixels[0]
    floor = seen.objects == 1
    sun = np.array([0.6, 0.8, 0.0])
    # The floor takes albedo/π E cosθ, all of it or nothing: the ball's shadow lies on the other side.
    expected = np.array([0.4, 0.3, 0.2]) / np.pi * np.array([2.0, 1.0, 0.5]) * 0.8
    lit = added[floor] / expected
    assert set(lit.round(2).ravel()) == {0.0, 1.0}
    # A ray towards the sun passes the ball, of radius .5 about the middle, or does not.
    away = np.linalg.norm(np.cross(seen.points[floor], sun), axis=1)
    inside = np.abs(away - 0.5) > 0.03
    np.testing.assert_array_equal((lit[:, 0] < 0.5)[inside], (away < 0.5)[inside])
    ball = ~floor
    cosine = (seen.frames[ball, 2] * sun).sum(1)
    clear = np.abs(cosine) > 0.05
    np.testing.assert_allclose(
        added[ball][clear], np.maximum(cosine, 0)[clear, None] * 0.6 / np.pi * np.array([2, 1, 0.5]), atol=2e-3
    )


def test_the_record_has_the_suns(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(SCENE + SUN)
    file = read_edit_scene(tmp_path / "scene.toml")
    again = scene_of_record(file.record(tmp_path), "x", tmp_path, "")
    assert again.suns == file.suns
    assert "a sun" in file.light().words


@pytest.mark.parametrize(
    ("old", "new", "where"),
    [
        ("[0.6, 0.8, 0]", "[0.6, -0.1, 0]", "scene.toml: sun[0].direction"),
        ("[0.6, 0.8, 0]", "[0.6, 0, 0]", "scene.toml: sun[0].direction"),
        ("[0.6, 0.8, 0]", "[0.6, 0.8]", "scene.toml: sun[0].direction"),
        ("[2.0, 1.0, 0.5]", "[0.0]", "scene.toml: sun[0].irradiance"),
        ("[2.0, 1.0, 0.5]", "[1.0, 2.0]", "scene.toml: sun[0].irradiance"),
        ("[2.0, 1.0, 0.5]", "[1.0, -2.0, 1.0]", "scene.toml: sun[0].irradiance"),
    ],
)
def test_suns_that_cannot_be_are_refused(old: str, new: str, where: str, tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(SCENE + SUN.replace(old, new))
    with refused(where=where):
        read_edit_scene(tmp_path / "scene.toml")
