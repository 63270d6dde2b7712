"""Suns beside the sky of a relit scene: light and shadows against geometry, stored and read, and what is refused."""

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from coarse import coarse_shapes, coarse_terms
from refusals import refused
from relighting_cases import factored_once
from slow_cases import slow_among

from homofact.brdf.analytic import Lambert, Phong
from homofact.brdf.materials import material
from homofact.brdf.reflectance import Reflectance
from homofact.files.archive import read_archive, write_archive
from homofact.geometry.directions import from_spherical
from homofact.meshes.occlusion import Occluder
from homofact.meshes.shapes import sphere
from homofact.relighting import build
from homofact.relighting.build import RelightScene, RelitObject, open_relight_scene, relit_objects
from homofact.relighting.cube import environment_cube
from homofact.relighting.errors import relative, scene_errors
from homofact.relighting.lit_points import LitPoints
from homofact.relighting.lobe import SurfacePoints
from homofact.relighting.lobe_table import sun_tables
from homofact.relighting.picture import picture
from homofact.relighting.result import RelightResult, open_relit
from homofact.relighting.scene_file import read_relight_scene
from homofact.relighting.sunlight import Sun, Sunlight, reflected, summed
from homofact.scene.cameras import Camera

SCENE = """
[[object]]
mesh = "shape:sphere"
material = "material:phong-30"
size = 0.5
[ground]
albedo = [0.4, 0.3, 0.2]
half = 2
steps = 12
[lighting]
named = "uniform"
[[camera]]
eye = [0, 1.5, 3]
pixels = [64, 48]
[transport]
cube = 8
kept = 40
"""
SUN = """
[[sun]]
direction = [0.6, 0.8, 0]
irradiance = [2.0, 1.0, 0.5]
"""
TOWARDS, LEVELS = np.array([0.6, 0.8, 0.0]), np.array([2.0, 1.0, 0.5])
Made = tuple[RelightScene, tuple[RelitObject, ...]]


@pytest.fixture(scope="module", autouse=True)
def _coarse() -> Iterator[None]:
    with coarse_shapes(), coarse_terms():
        yield


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """The scene with its sun, relit."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(build, "factored", factored_once)
        scene = open_relight_scene(read_relight_scene(written(tmp_path_factory.mktemp("sun"), SCENE + SUN)))
    return scene, relit_objects(scene)


def written(folder: Path, text: str) -> Path:
    file = folder / "scene.toml"
    file.write_text(text)
    return file


def turned_pairs(count: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Directions to a light and to a viewer, both up to 85° from the normal."""
    angles = torch.rand(4, count, generator=torch.Generator().manual_seed(3), dtype=torch.float64)
    wi, wo = (from_spherical(math.radians(85) * angles[k], 2 * math.pi * angles[k + 2]) for k in (0, 1))
    return wi, wo


@pytest.mark.parametrize(
    ("name", "count", "most"),
    slow_among(
        [
            ("phong-10", 1, 0.02),
            ("phong-30", 2, 0.02),
            ("car-paint-red", 2, 0.01),
            ("ashikhmin-shirley-wang", 2, 0.05),
            ("ward-brushed", 2, 0.05),
        ],
        "ashikhmin-shirley-wang",
        "ward-brushed",
    ),
)
def test_tables_add_up_to_the_material(name: str, count: int, most: float) -> None:
    model: Reflectance = material(name).model
    tables = sun_tables(model)
    assert len(tables) == count
    wi, wo = turned_pairs(4000)
    cosines = (wi[:, 2] * wo[:, 2])[:, None].numpy()
    found = sum(table.evaluate(wi, wo).numpy() for table in tables) * cosines
    assert relative(found, model.evaluate(wi, wo).double().numpy() * cosines) < most


def test_a_matt_surface_has_one_table() -> None:
    wi, wo = turned_pairs(500)
    (table,) = sun_tables(Lambert((0.6, 0.4, 0.2)))
    exact = torch.tensor([0.6, 0.4, 0.2]).double() / math.pi
    assert table.evaluate(wi, wo).numpy() == pytest.approx(np.broadcast_to(exact.numpy(), (500, 3)), rel=0.04)


def test_what_is_seen_of_a_disc_over_an_edge_is_a_segment_s_area() -> None:
    """A wall to the left of x = 0 as high as y = 1, without end: from below it hides the disc up to its edge."""
    wall = np.array([[0, 1, -100], [0, 1, 100], [0, -100, 100], [0, -100, -100]], float)
    occluder = Occluder(wall, np.array([[0, 1, 2], [0, 2, 3]]))
    radius = math.radians(4)
    sun = Sun(np.array([math.sqrt(0.5), math.sqrt(0.5), 0.0]), np.ones(3), radius)
    # Seen from (−d, 0, 0) the edge stands at the elevation atan(1/d).
    offsets = np.array([-1.3, -0.6, -0.2, 0.0, 0.3, 0.8, 1.3])
    d = 1 / np.tan(math.pi / 4 + offsets * radius)
    origins = np.stack((-d, 0 * d, 0 * d), 1)
    up = np.tile(np.array([[[1.0, 0, 0], [0, 0, 1], [0, 1, 0]]]), (len(d), 1, 1))
    x = offsets.clip(-1, 1)
    above = (np.arccos(x) - x * np.sqrt(1 - x**2)) / math.pi
    assert LitPoints(origins, up).seen([sun], occluder, 400)[:, 0] == pytest.approx(above, abs=0.02)
    turned = LitPoints(np.repeat(origins, 50, 0), np.repeat(up, 50, 0)).seen([sun], occluder, 8, seed=1)
    assert turned[:, 0].reshape(-1, 50).mean(1) == pytest.approx(above, abs=0.03)


def test_finer_rays_in_half_shadow_leave_no_grain() -> None:
    """Of a disc behind an edge, 8 rays leave grain of some percent; 64 rays that follow them leave a tenth of that."""
    wall = np.array([[0, 1, -100], [0, 1, 100], [0, -100, 100], [0, -100, -100]], float)
    occluder, radius = Occluder(wall, np.array([[0, 1, 2], [0, 2, 3]])), math.radians(4)
    sun = Sun(np.array([math.sqrt(0.5), math.sqrt(0.5), 0.0]), np.ones(3), radius)
    offsets = np.repeat([-1.3, -0.4, 0.0, 0.5, 1.3], 400)
    d = 1 / np.tan(math.pi / 4 + offsets * radius)
    up = np.tile(np.array([[[1.0, 0, 0], [0, 0, 1], [0, 1, 0]]]), (len(d), 1, 1))
    points = LitPoints(np.stack((-d, 0 * d, 0 * d), 1), up)
    coarse, fine = (points.seen([sun], occluder, 8, 1, more)[:, 0].reshape(5, 400) for more in (None, 64))
    assert coarse[1:4].std(1).min() > 0.03
    assert fine[1:4].std(1).max() < 0.02
    x = np.array([-0.4, 0.0, 0.5])
    exact = (np.arccos(x) - x * np.sqrt(1 - x**2)) / math.pi
    assert fine[1:4].mean(1) == pytest.approx(exact, abs=0.01)
    assert (fine[0] == 1).all()
    assert (fine[4] == 0).all()


@pytest.mark.parametrize("exponent", [2000, 150])
def test_a_narrow_lobe_mirrors_what_is_seen_of_the_place_it_points_at(exponent: float) -> None:
    """The lower half of a disc is hidden: its mirror image is whole in the upper half and black in the lower one."""
    wall = np.array([[0, 1, -100], [0, 1, 100], [0, -100, 100], [0, -100, -100]], float)
    occluder = Occluder(wall, np.array([[0, 1, 2], [0, 2, 3]]))
    radius, up = math.radians(4), np.array([[[1.0, 0, 0], [0, 0, 1], [0, 1, 0]]])
    sun, gloss = (
        Sun(np.array([math.sqrt(0.5), math.sqrt(0.5), 0.0]), np.ones(3), radius),
        Phong((0.1,) * 3, (0.8,) * 3, 2000),
    )
    # Views from which the upper, the middle and the lower part of the disc is mirrored; the first point is in the open.
    angle = math.pi / 4 + np.array([0.0, 0.6, 0.0, -0.6]) * radius
    wo, frames = np.stack((-np.cos(angle), 0 * angle, np.sin(angle)), 1), np.repeat(up, 4, 0)
    edges = np.array([0.3, 0.0, 0.05])
    origins = np.zeros((4, 3))
    origins[:, 0] = 1, *(-1 / np.tan(math.pi / 4 + edges * radius))
    points, lit = SurfacePoints.at_vertices(frames, wo, np.arange(4)), LitPoints(origins, frames)
    seen = lit.seen([sun], occluder, 64)
    assert seen[0] == 1
    assert ((seen[1:] > 0.2) & (seen[1:] < 0.8)).all()
    exact, sunlight = summed(gloss, [sun], lit, wo, occluder), Sunlight((sun,), sun_tables(gloss), seen)
    found = sunlight.at(points, origins, seen, None, lit.sight(occluder))
    assert np.abs(found - exact).max() < 0.025 * exact.max()
    # Without rays the mean over the disc is all that is known.
    blurred = sunlight.at(points, origins, seen)
    assert np.abs(blurred - exact).max() > 0.1 * exact.max()


def test_flat_triangles_of_a_round_surface_do_not_shade_themselves() -> None:
    ball = sphere(6)
    occluder = Occluder(ball.positions, ball.triangles)
    sun = Sun(np.array([0.48, 0.8, 0.36]), np.ones(3), 1e-3)
    corners = np.repeat(ball.triangles, 40, 0)
    shares = np.random.default_rng(0).dirichlet((1, 1, 1), len(corners))
    normals = (ball.normals[corners] * shares[..., None]).sum(1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    frames = np.stack((normals, normals, normals), 1)
    points = SurfacePoints(frames, frames[:, 0], corners, shares)
    lit = normals @ sun.direction > 0.01
    assert (LitPoints.on(ball, points, occluder.offset).seen([sun], occluder, 4)[lit, 0] == 1).all()
    flat = LitPoints((ball.positions[corners] * shares[..., None]).sum(1) + occluder.offset * normals, frames)
    assert (flat.seen([sun], occluder, 4)[lit, 0] < 1).any()


def test_the_ground_has_the_sun_s_light_or_the_ball_s_shadow(made: Made) -> None:
    scene, objects = made
    (sun,) = scene.file.suns
    plane = objects[1]
    assert plane.sunlight is not None
    away = np.linalg.norm(np.cross(plane.mesh.positions, TOWARDS), axis=1)
    seen, clear = plane.sunlight.seen[:, 0], np.abs(away - 0.5) > 0.03
    assert np.array_equal(seen[clear] > 0.5, away[clear] > 0.5)
    assert (seen[clear] < 0.5).sum() > 3
    dark = np.zeros((6, 8, 8, 3))
    shown = plane.lit(dark).shade(scene.file.cameras[0].eye)
    expected = np.array([0.4, 0.3, 0.2]) / math.pi * LEVELS * 0.8 * seen[:, None]
    assert shown == pytest.approx(expected, rel=0.02, abs=1e-6)
    assert (plane.lit(dark, suns=False).shade(scene.file.cameras[0].eye) == 0).all()
    assert sun.radiance() * math.pi * math.sin(sun.radius) ** 2 == pytest.approx(LEVELS, rel=1e-4)


def test_a_picture_has_the_sun_and_its_shadow_at_each_pixel(made: Made) -> None:
    """Against rays of our own: the ball of radius .5 about the middle, the plane under it."""
    scene, objects = made
    camera, light = scene.file.cameras[0], scene.file.light
    lit = [each.lit(environment_cube(light, 8)) for each in objects]
    plain = [each.lit(environment_cube(light, 8), suns=False) for each in objects]
    meshes = [each.mesh for each in objects]
    shown, _ = picture(meshes, [each.terms(camera.eye) for each in lit], scene.occluder, camera, light, lit)
    without, _ = picture(meshes, [each.terms(camera.eye) for each in plain], scene.occluder, camera, light, plain)
    rays = camera.rays()[:, :, 0]
    eye = np.array(camera.eye)
    height = float(meshes[1].positions[0, 1])
    at = eye + rays * ((height - eye[1]) / rays[..., 1:2])
    # Pixels of the floor well away from the ball, the shadow's edge and the floor's soft end.
    floor = (rays[..., 1] < -0.05) & (np.linalg.norm(at[..., ::2], axis=-1) < 1.0)
    past_ball = np.linalg.norm(np.cross(np.broadcast_to(eye, rays.shape), rays), axis=-1) > 0.56
    away = np.linalg.norm(np.cross(at, TOWARDS), axis=-1)
    clear = floor & past_ball & (np.abs(away - 0.5) > 0.12)
    assert clear.sum() > 100
    assert (away[clear] < 0.5).sum() > 10
    expected = np.array([0.4, 0.3, 0.2]) / math.pi * LEVELS * 0.8 * (away[clear] > 0.5)[:, None]
    assert (shown - without)[clear] == pytest.approx(expected, rel=0.02, abs=2e-3)


def test_a_sun_stands_in_the_sky_behind(made: Made) -> None:
    scene, objects = made
    eye = np.array([5.0, 5.0, 0.0])
    camera = Camera(tuple(eye), tuple(eye + TOWARDS), 4.0, (64, 64))
    lit = [each.lit(environment_cube(scene.file.light, 8)) for each in objects]
    colours = [each.terms(camera.eye) for each in lit]
    shown, cover = picture([o.mesh for o in objects], colours, scene.occluder, camera, scene.file.light, lit)
    assert (cover == 0).all()
    solid = math.radians(4.0) ** 2 / 64**2
    assert ((shown - 1).sum((0, 1)) * solid) == pytest.approx(LEVELS, rel=0.05)


@pytest.mark.parametrize(
    ("name", "radius", "count"), [("phong-30", 0.27, 1), ("phong-30", 6, 16), ("car-paint-red", 6, 64)]
)
def test_a_disc_wider_than_a_lobe_is_asked_at_several_directions(
    name: str, radius: float, count: int, made: Made
) -> None:
    each = made[1][0]
    assert each.sunlight is not None
    sunlight = replace(each.sunlight, tables=sun_tables(material(name).model))
    assert sunlight.directions(Sun(TOWARDS, LEVELS, math.radians(radius)), each.mesh.positions) == count


def test_the_stated_error_has_the_suns(made: Made) -> None:
    scene, objects = made
    found = scene_errors(scene, objects, 40, ("suns", "together", "picture"))
    fine = found[0]
    assert fine is not None
    for each in found:
        assert each is not None
        assert each.errors["suns"] < 0.03
        assert each.errors["picture"] < 0.1
    # Tables of another material are found out, in every figure that has the suns in it.
    wrong = objects[0].sunlight
    assert wrong is not None
    worse = replace(objects[0], sunlight=replace(wrong, tables=sun_tables(Lambert((0.1, 0.1, 0.1)))))
    (apart, _) = scene_errors(scene, (worse, objects[1]), 40, ("suns", "together", "picture"))
    assert apart is not None
    assert all(value > 3 * fine.errors[name] for name, value in apart.errors.items())


def test_reflected_light_is_f_times_the_cosine() -> None:
    rows = np.eye(3)[None]
    wo = np.array([[0.0, 0.6, 0.8]])
    found = reflected(Lambert((0.5, 0.5, 0.5)), np.array([0.6, 0.0, 0.8]), rows, wo)
    assert found == pytest.approx(np.full((1, 3), 0.5 / math.pi * 0.8))
    assert reflected(Lambert((0.5, 0.5, 0.5)), np.array([0.6, 0.0, -0.8]), rows, wo) == pytest.approx(0)


def saved(folder: Path, made: Made) -> RelightResult:
    scene, objects = made
    result = RelightResult.of(scene.file, objects, {})
    result.save(folder / "out")
    return result


def test_a_saved_scene_has_its_suns(tmp_path: Path, made: Made) -> None:
    result, eye = saved(tmp_path, made), (0, 1.5, 3)
    again = open_relit(tmp_path / "out")
    (sun,) = again.suns
    assert sun.direction == pytest.approx(TOWARDS)
    assert sun.irradiance == pytest.approx(LEVELS)
    assert sun.radius == pytest.approx(math.radians(0.2665))
    for suns in (True, False):
        pairs = zip(result.shade("studio", eye, suns), again.shade("studio", eye, suns), strict=True)
        assert all(np.array_equal(one, other) for one, other in pairs)
    lit, dark = (again.shade("studio", eye, suns)[1] for suns in (True, False))
    assert (lit > dark).any()


def test_scenes_of_another_grid_of_lobes_are_refused(tmp_path: Path, made: Made) -> None:
    saved(tmp_path, made)
    file = tmp_path / "out" / "relight.npz"
    arrays, header = read_archive(file)
    write_archive(file, header | {"version": 7}, arrays)
    with refused(found="version 7"):
        open_relit(tmp_path / "out")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("direction", [0.6, 0.9, 0.0]),
        ("direction", [0.6, 0.8]),
        ("irradiance", [0.0, 0.0, 0.0]),
        ("irradiance", [1.0, -1.0, 0.0]),
        ("irradiance", [1e40, 0.0, 0.0]),
        ("radius", 0.0),
        ("radius", 1.5),
    ],
)
def test_damaged_suns_are_refused(name: str, value: object, tmp_path: Path, made: Made) -> None:
    saved(tmp_path, made)
    file = tmp_path / "out" / "relight.npz"
    arrays, header = read_archive(file)
    header["suns"][0][name] = value
    write_archive(file, header, arrays)
    with refused(rf"suns\[0\]\.{name}"):
        open_relit(tmp_path / "out")


@pytest.mark.parametrize("name", ["object_0_sun_seen", "object_1_sun_values_0"])
def test_damaged_sunlight_is_refused(name: str, tmp_path: Path, made: Made) -> None:
    saved(tmp_path, made)
    file = tmp_path / "out" / "relight.npz"
    arrays, header = read_archive(file)
    for other in (arrays[name][:-1] if name.endswith("seen") else arrays[name][:1], arrays[name] * np.float32(np.nan)):
        write_archive(file, header, arrays | {name: other})
        with refused(name):
            open_relit(tmp_path / "out")


@pytest.mark.parametrize(
    ("old", "new", "where"),
    [
        ("[0.6, 0.8, 0]", "[0.6, -0.1, 0]", "sun[0].direction"),
        ("[2.0, 1.0, 0.5]", "[0.0]", "sun[0].irradiance"),
        ("irradiance", "radius = 0\nirradiance", "sun[0].radius"),
        ("irradiance", "radius = 30\nirradiance", "sun[0].radius"),
        (SUN, 9 * SUN, "sun"),
    ],
)
def test_suns_that_cannot_be_are_refused(old: str, new: str, where: str, tmp_path: Path) -> None:
    file = written(tmp_path, SCENE + SUN.replace(old, new))
    with refused(where=f"scene.toml: {where}"):
        read_relight_scene(file)


@pytest.mark.parametrize("exponent", [30, 2000])
def test_tables_hold_the_highlight_and_what_is_around_it(exponent: int) -> None:
    """Light within 25° of the mirror direction, most of it close to it."""
    model = Phong((0.1, 0.1, 0.1), (0.8, 0.8, 0.8), exponent)
    wo = turned_pairs(3000)[1]
    angles = torch.rand(2, len(wo), generator=torch.Generator().manual_seed(5), dtype=torch.float64)
    off, turn = math.radians(25) * angles[0] ** 2, 2 * math.pi * angles[1]
    mirror = wo * torch.tensor([-1.0, -1.0, 1.0])
    across = torch.nn.functional.normalize(torch.linalg.cross(mirror, torch.tensor([[0.3, 0.5, 0.8]]).double()), dim=1)
    other = torch.linalg.cross(mirror, across)
    side = across * torch.cos(turn)[:, None] + other * torch.sin(turn)[:, None]
    wi = mirror * torch.cos(off)[:, None] + side * torch.sin(off)[:, None]
    up = wi[:, 2] > 0.02
    wi, wo = wi[up], wo[up]
    cosine = wi[:, 2:].numpy()
    tables = sun_tables(model)
    found = sum(table.evaluate(wi, wo).numpy() for table in tables) * cosine
    exact = model.evaluate(wi, wo).double().numpy() * cosine
    assert relative(found, exact) < 0.06
    # Nothing of it is spread over the rest.
    wi, wo = turned_pairs(4000)
    far = (wi * wo * torch.tensor([-1.0, -1.0, 1.0])).sum(1) < math.cos(math.radians(25))
    wi, wo = wi[far], wo[far]
    found, exact = (sum(each.evaluate(wi, wo).double().numpy() for each in parts) for parts in (tables, [model]))
    assert relative(found * wi[:, 2:].numpy(), exact * wi[:, 2:].numpy()) < 0.1
