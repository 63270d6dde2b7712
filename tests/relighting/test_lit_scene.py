"""Pictures of relit scenes and meshes from any point and under any sky, without new transport."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from relighting.ball_scene import TEXT, read

import homofact
from homofact.api.progress import ProgressStep
from homofact.errors import BadInput
from homofact.relighting.build import open_relight_scene, relit_objects
from homofact.relighting.relit_mesh import RelitMesh
from homofact.relighting.result import RelightResult
from homofact.scene.cameras import Camera, camera_on
from homofact.scene.lighting import named_environment

pytestmark = pytest.mark.usefixtures("decomposed_once")
OTHER = (0.8, 0.9, 2.0)
CAMERAS = """
[[camera]]
name = "side"
eye = [3, 1, 0]
pixels = [32, 24]
"""


@pytest.fixture(scope="module")
def made(decomposed_once: None, tmp_path_factory: pytest.TempPathFactory) -> tuple[RelightResult, Path]:
    """A scene of two cameras with its pictures, and its folder."""
    place = tmp_path_factory.mktemp("lit")
    # A cube map for which the folder has all 64 rows of a built-in sky.
    read(place, TEXT.replace("cube = 8", "cube = 16") + CAMERAS)
    found = homofact.relight(place / "scene.toml", to=place / "out", vertices=0)
    return found, place / "out"


@pytest.fixture(scope="module")
def ball(decomposed_once: None) -> RelitMesh:
    found = homofact.relight("shape:sphere", "material:phong-10", terms=4, cube=8, kept=60)
    found.relight("studio")
    return found


def apart(one: np.ndarray, other: np.ndarray) -> int:
    """The largest difference of two 8-bit pictures."""
    return int(np.abs(one.astype(int) - other).max())


@pytest.mark.parametrize(("camera", "number"), [(None, 0), ("1", 0), ("side", 1), ("2", 1)])
def test_a_scene_s_own_pictures_come_again(made: tuple[RelightResult, Path], camera: str | None, number: int) -> None:
    """From memory to the bit; from the folder to the rounding of its sky."""
    scene, folder = made
    assert np.array_equal(homofact.render(scene, camera=camera).pixels, scene.pictures[number])
    assert apart(homofact.render(folder, camera=camera).pixels, scene.pictures[number]) <= 1


def test_another_sky_and_point_show_what_a_scene_made_for_them_shows(
    made: tuple[RelightResult, Path], tmp_path: Path
) -> None:
    text = (
        TEXT.replace("cube = 8", "cube = 16")
        .replace('named = "studio"', 'named = "overcast"')
        .replace("eye = [0, 1.5, 3]", f"eye = {list(OTHER)}")
    )
    read(tmp_path, text)
    wanted = homofact.relight(tmp_path / "scene.toml", vertices=0).pictures[0]
    found = homofact.render(made[0], environment="overcast", eye=OTHER)
    assert apart(found.pixels, wanted) <= 1
    assert "overcast" in found.light
    # The light and the point make the picture.
    assert apart(homofact.render(made[0], eye=OTHER).pixels, wanted) > 20
    assert apart(homofact.render(made[0], environment="overcast").pixels, wanted) > 20


def test_suns_shine_with_their_own_sky_only(tmp_path: Path) -> None:
    sun = "[[sun]]\ndirection = [0.5, 1, 0.3]\nirradiance = [9, 9, 9]\n"
    scenes = []
    for name, more in (("with", sun), ("without", "")):
        (tmp_path / name).mkdir()
        file = read(tmp_path / name, TEXT + more)
        scenes.append(RelightResult.of(file, relit_objects(open_relight_scene(file)), {}))
    camera = scenes[0].cameras[0]
    own, dark = (each.lit().radiance(camera)[0] for each in scenes)
    assert own.sum() > 1.5 * dark.sum()
    assert "and 1 sun" in homofact.render(scenes[0]).caption
    assert "sun" not in homofact.render(scenes[1]).caption
    other, same = (each.lit(named_environment("uniform")).radiance(camera)[0] for each in scenes)
    assert other == pytest.approx(same, rel=1e-6)


def test_the_sun_of_another_sky_is_a_light_of_its_own_where_the_scene_has_tables(tmp_path: Path) -> None:
    sky = Path(__file__).resolve().parents[2] / "data_synthetic" / "sky.hdr"
    own = TEXT.replace('named = "studio"', f'environment = "{sky}"')
    (tmp_path / "own").mkdir()
    read(tmp_path / "own", own)
    wanted = homofact.relight(tmp_path / "own" / "scene.toml", vertices=0).pictures[0]
    sun = "[[sun]]\ndirection = [0.5, 1, 0.3]\nirradiance = [9, 9, 9]\n"
    notes: dict[str, list[str]] = {}
    found = {}
    for name, more in (("sun", sun), ("none", "")):
        (tmp_path / name).mkdir()
        read(tmp_path / name, TEXT + more)
        scene = homofact.relight(tmp_path / name / "scene.toml", vertices=0)
        told: list[ProgressStep] = []
        found[name] = homofact.render(scene, environment=sky, progress=told.append).pixels
        notes[name] = [step.note for step in told if step.note]
    assert apart(found["sun"], wanted) <= 1
    assert apart(found["none"], wanted) > 10
    assert [len(notes["sun"]), len(notes["none"])] == [0, 1]


def test_exposure_size_and_target_are_those_asked_for(made: tuple[RelightResult, Path], tmp_path: Path) -> None:
    scene, _ = made
    plain = homofact.render(scene)
    lit = homofact.render(scene, tmp_path / "new" / "a.png", exposure=1.5, size=60, target=(0.2, 0.1, 0.0))
    assert lit.pixels.shape == (60, 80, 3)
    assert lit.record()["width"] == 80
    assert (tmp_path / "new" / "a.png").is_file()
    again = homofact.render(scene, exposure=1.5)
    assert again.exposure == pytest.approx(plain.exposure * 2**1.5)
    other = replace(scene, cameras=(replace(scene.cameras[0], target=(0.2, 0.1, 0.0), pixels=(80, 60)),))
    assert np.array_equal(homofact.render(other, exposure=1.5).pixels, lit.pixels)


def test_a_mesh_is_drawn_as_a_scene_of_it(ball: RelitMesh, tmp_path: Path) -> None:
    text = """[[object]]
mesh = "shape:sphere"
material = "material:phong-10"
terms = 4
[lighting]
named = "studio"
[[camera]]
eye = [1, 2, 4]
pixels = [64, 48]
[transport]
cube = 8
kept = 60
"""
    read(tmp_path, text)
    wanted = homofact.relight(tmp_path / "scene.toml", vertices=0).pictures[0]
    assert apart(homofact.render(ball, eye=(1, 2, 4), size=48).pixels, wanted) <= 1
    # All of it is in its own camera's picture, and fills much of it.
    _, coverage = ball.lit().radiance(camera_on(ball.mesh.positions))
    assert coverage[0].max() == coverage[-1].max() == coverage[:, 0].max() == 0
    assert 0.2 < coverage.mean() < 0.6


def test_the_light_of_a_mesh_changes_with_the_environment(ball: RelitMesh) -> None:
    first = homofact.render(ball, size=48)
    other = homofact.render(ball, environment="overcast", size=48)
    assert apart(first.pixels, other.pixels) > 20
    # The mesh keeps its own light.
    assert np.array_equal(homofact.render(ball, size=48).pixels, first.pixels)


@pytest.mark.parametrize(
    ("settings", "where"),
    [
        ({"camera": "none"}, "camera"),
        ({"camera": "3"}, "camera"),
        ({"light": (1, 1, 1)}, "light"),
        ({"eye": (0, 0, 0)}, "eye"),
        ({"environment": "dusk"}, "environment"),
        ({"size": 4}, "size"),
        ({"to": "picture.jpg"}, "picture.jpg"),
    ],
)
def test_what_a_scene_cannot_take_is_refused(
    made: tuple[RelightResult, Path], settings: dict[str, object], where: str
) -> None:
    for drawn in made:
        with pytest.raises(BadInput) as error:
            homofact.render(drawn, **settings)  # type: ignore[arg-type]
        assert where in str(error.value.where)


@pytest.mark.parametrize("name", ["camera", "eye", "target"])
def test_cameras_are_for_scenes(name: str) -> None:
    with pytest.raises(BadInput) as error:
        homofact.render("material:phong-10", **{name: "1" if name == "camera" else (1, 2, 3)})  # type: ignore[arg-type]
    assert error.value.where == name


def test_a_mesh_without_a_map_or_among_others_is_refused(ball: RelitMesh) -> None:
    for found in (RelitMesh(ball.mesh, ball.transport), RelitMesh(ball.mesh, ball.transport, alone=False)):
        with pytest.raises(BadInput):
            homofact.render(found)
    cubes = RelitMesh(ball.mesh, ball.transport)
    cubes.relight(np.ones((6, 8, 8, 3)))
    with pytest.raises(BadInput):
        homofact.render(cubes)
    with pytest.raises(BadInput) as error:
        homofact.render(ball, camera="1")
    assert error.value.where == "camera"


def test_a_camera_has_its_name_or_its_number() -> None:
    from homofact.scene.cameras import chosen_camera

    one, two = Camera((0.0, 0.0, 3.0), name="2"), Camera((1.0, 0.0, 3.0), name="b")
    assert chosen_camera((one, two), None) is one
    assert chosen_camera((one, two), "b") is two
    assert chosen_camera((one, two), "1") is one
