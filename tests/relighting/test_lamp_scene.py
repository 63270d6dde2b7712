"""Scenes with lamps: read, relit, with stated errors that hold, stored and read again, beside Mitsuba, and refused."""

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

from homofact.brdf.reflectance import Reflectance
from homofact.files.archive import read_archive, write_archive
from homofact.relighting import build
from homofact.relighting.build import RelightScene, RelitObject, open_relight_scene, relit_objects
from homofact.relighting.cube import environment_cube
from homofact.relighting.errors import relative, scene_errors, sending_surfaces
from homofact.relighting.lobe_table import sun_tables
from homofact.relighting.picture import picture
from homofact.relighting.reference import Geometry, scene_picture
from homofact.relighting.result import RelightResult, open_relit
from homofact.relighting.scene_file import read_relight_scene
from homofact.relighting.seen import SeenPixels, seen_pixels, seen_vertices
from homofact.rendering.light import EnvironmentMap
from homofact.scene.cameras import Camera

SCENE = """
[[object]]
mesh = "shape:sphere"
material = "material:phong-30"
terms = 4
lobe = "factored"
size = 0.5
[ground]
albedo = [0.4, 0.3, 0.2]
half = 2
steps = 12
[lighting]
named = "uniform"
[[camera]]
eye = [0, 1.5, 3]
pixels = [32, 24]
[transport]
cube = 8
kept = 384
bounces = 1
"""
LAMP = """
[[lamp]]
position = [0.9, 0.7, 0.4]
radius = 0.15
intensity = [12.0, 8.0, 4.0]
"""
PLACE, RADIUS, LEVELS = np.array([0.9, 0.7, 0.4]), 0.15, np.array([12.0, 8.0, 4.0])
Made = tuple[RelightScene, tuple[RelitObject, ...]]


@pytest.fixture(scope="module", autouse=True)
def _coarse() -> Iterator[None]:
    with coarse_shapes(), coarse_terms():
        yield


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """The scene with its lamp, relit."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(build, "factored", factored_once)
        scene = open_relight_scene(read_relight_scene(written(tmp_path_factory.mktemp("lamp"), SCENE + LAMP)))
    return scene, relit_objects(scene)


def written(folder: Path, text: str) -> Path:
    file = folder / "scene.toml"
    file.write_text(text)
    return file


def sphere_points(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of the lamp's whole surface (N, 3), spread evenly, and the normals there."""
    place = np.arange(count) + 0.5
    y, turn = 1 - 2 * place / count, place * math.pi * (3 - math.sqrt(5))
    normals = np.stack((np.sqrt(1 - y**2) * np.cos(turn), y, np.sqrt(1 - y**2) * np.sin(turn)), 1)
    return PLACE + RADIUS * normals, normals


def by_area(scene: RelightScene, pixels: SeenPixels, reflectance: Reflectance, origins: np.ndarray) -> np.ndarray:
    """The lamp's light (S, 3) at pixels: the integral over its surface of L f cosθ cosθ' V/d² dA."""
    surface, normals = sphere_points(900)
    area, radiance = 4 * math.pi * RADIUS**2 / len(surface), LEVELS / (math.pi * RADIUS**2)
    rows, wo = pixels.points.rows, torch.from_numpy(pixels.points.wo)
    found = np.zeros((len(origins), 3))
    for point, normal in zip(surface, normals, strict=True):
        towards = point - origins
        distance = np.linalg.norm(towards, axis=1)
        w = towards / distance[:, None]
        sent, wi = -(w @ normal), np.einsum("sij,sj->si", rows, w)
        lit = np.flatnonzero((sent > 0) & (wi[:, 2] > 0))
        # A ray that ends just before the surface of the lamp.
        clear = ~scene.occluder.blocked(origins[lit], w[lit], 0.999 * distance[lit])
        lit = lit[clear]
        f = reflectance.evaluate(torch.from_numpy(wi[lit]), wo[lit]).double().expand(-1, 3).numpy()
        found[lit] += f * (wi[lit, 2] * sent[lit] / distance[lit] ** 2)[:, None] * area * radiance
    return found


@pytest.fixture(scope="module")
def truths(made: Made) -> list[tuple[np.ndarray, np.ndarray]]:
    """Of each object what all its pixels show without the light between surfaces, and what is right."""
    scene, objects = made
    meshes, camera = [each.mesh for each in objects], scene.file.cameras[0]
    radiance = environment_cube(scene.file.light, 8)
    found = []
    for number, (placed, relit) in enumerate(zip(scene.objects, objects, strict=True)):
        pixels = seen_pixels(meshes, number, placed.reflectance, scene.occluder, camera, None)
        points = pixels.lit_points(relit.mesh)
        lit = relit.lit(radiance)
        dark = replace(lit, tuples=lit.tuples.copy())
        dark.tuples[:, relit.transport.factors.direct :] = 0
        shown = dark.between(pixels.mixture, camera.eye, points.seen(scene.file.lights, scene.occluder, 64))
        right = pixels.points.dense(radiance, 8) + by_area(scene, pixels, placed.reflectance, points.origins)
        found.append((shown, right))
    return found


@pytest.mark.slow
def test_pixels_have_the_light_of_the_lamp_s_surface(truths: list[tuple[np.ndarray, np.ndarray]]) -> None:
    for (shown, right), most in zip(truths, (0.06, 0.03), strict=True):
        assert relative(shown, right) < most


def test_the_stated_error_is_within_1_3_of_the_truth(made: Made, truths: list[tuple[np.ndarray, np.ndarray]]) -> None:
    scene, objects = made
    # The truth is without the light between surfaces, which has errors of its own.
    plain = replace(scene, bounces=None)
    direct = []
    for each in objects:
        factors = each.transport.factors
        none = replace(factors, view=factors.view.copy())
        none.view[factors.direct :] = 0
        direct.append(replace(each, transport=replace(each.transport, factors=none)))
    stated = scene_errors(plain, direct, 400, ("lamps", "picture"))
    for found, (shown, right) in zip(stated, truths, strict=True):
        assert found is not None
        assert found.errors["lamps"] < 0.05
        assert 1 / 1.3 < found.errors["picture"] / relative(shown, right) < 1.3
    # A lamp that is too bright is found out in both.
    sunlight = direct[1].sunlight
    assert sunlight is not None
    wrong = replace(sunlight, tables=tuple(replace(table, values=1.2 * table.values) for table in sunlight.tables))
    (worse,) = scene_errors(plain, [direct[0], replace(direct[1], sunlight=wrong)], 60, ("lamps", "picture"))[1:]
    assert worse is not None
    assert all(value > 0.08 for value in worse.errors.values())


def test_surfaces_send_the_light_of_the_lamp_on(tmp_path: Path) -> None:
    """A matt ball and the ground light each other: by the terms as by the full sum."""
    matt = SCENE.replace('material = "material:phong-30"\nterms = 4\nlobe = "factored"', "albedo = [0.7, 0.5, 0.2]")
    scene = open_relight_scene(read_relight_scene(written(tmp_path, matt.replace("half = 2", "half = 1.2") + LAMP)))
    objects, around = relit_objects(scene), sending_surfaces(scene)
    assert around is not None
    night, dark, eye = EnvironmentMap(torch.full((8, 16, 1), 1e-9).double()), np.full((6, 8, 8, 3), 1e-9), (0, 1.5, 3)
    for placed, relit in zip(scene.objects, objects, strict=True):
        seen = seen_vertices(relit.mesh, placed.reflectance, scene.occluder, eye, 40)
        exact = around.bounced(seen, night, 16)
        lit = relit.lit(dark)
        alone = replace(lit, tuples=lit.tuples.copy(), sunlight=None)
        alone.tuples[:, : relit.transport.factors.direct] = 0
        found = alone.terms(eye)[seen.which]
        assert exact.max() > 0.01
        # From the ground the ball is small: few directions of the full sum meet it.
        ball = relit is objects[0]
        assert found.sum(0) == pytest.approx(exact.sum(0), rel=0.05 if ball else 0.3)
        assert relative(found, exact) < (0.1 if ball else 0.6)
        assert np.abs(relit.lit(dark, lamps=False).tuples).max() < 1e-6


def test_a_picture_has_the_lamp_itself(made: Made) -> None:
    scene, objects = made
    lit = [each.lit(environment_cube(scene.file.light, 8)) for each in objects]
    meshes = [each.mesh for each in objects]

    def seen_from(eye: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        camera = Camera(tuple(eye), tuple(PLACE), 12.0, (32, 32))
        return picture(meshes, [each.terms(camera.eye) for each in lit], scene.occluder, camera, scene.file.light, lit)

    away = PLACE / np.linalg.norm(PLACE)
    shown, cover = seen_from(PLACE + 2 * away)
    radiance = LEVELS / (math.pi * RADIUS**2)
    bright = np.abs(shown / radiance - 1).max(-1) < 1e-6
    # As large as the sphere looks, with its edge's pixels in part.
    disc = math.pi * math.tan(math.asin(RADIUS / 2)) ** 2 / (2 * math.tan(math.radians(6))) ** 2
    assert (shown.mean(-1) > radiance.mean() / 2).mean() == pytest.approx(disc, rel=0.05)
    assert (cover[bright] == 0).all()
    # From behind the ball it is hidden.
    shown, _ = seen_from(-3 * away)
    assert shown.max() < radiance.max() / 4


@pytest.mark.slow
def test_mitsuba_has_the_same_light(made: Made) -> None:
    pytest.importorskip("mitsuba")
    scene, objects = made
    camera = scene.file.cameras[0]
    shapes = [Geometry(each.mesh.positions, each.mesh.normals, each.mesh.triangles) for each in scene.objects]
    pairs = [(shape, each.reflectance) for shape, each in zip(shapes, scene.objects, strict=True)]
    night = EnvironmentMap(torch.full((8, 16, 3), 1e-4, dtype=torch.float64))
    theirs = scene_picture(pairs, night, camera, 128, 2, lamps=scene.file.lamps)
    dark = np.full((6, 8, 8, 3), 1e-4)
    lit = [each.lit(dark) for each in objects]
    for each, relit in zip(lit, objects, strict=True):
        each.tuples[:, relit.transport.factors.direct :] = 0
    colours = [each.terms(camera.eye) for each in lit]
    ours, cover = picture([o.mesh for o in objects], colours, scene.occluder, camera, night, lit)
    triangle, _ = scene.occluder.first(np.array(camera.eye)[None], camera.rays().reshape(-1, 3))
    of_ball = ((triangle >= 0) & (triangle < len(objects[0].mesh.triangles))).reshape(24, 32)
    inside = theirs.seen & (cover > 0.999)
    # Not at the outline, where Mitsuba has no bent normals.
    near = [np.roll(of_ball, step, axis) for step in (-1, 1) for axis in (0, 1)]
    inside &= np.logical_and.reduce(near) == np.logical_or.reduce(near)
    # A pixel of Mitsuba is a mean over its area, where a highlight is a few pixels wide.
    for pixels, sums, most in ((inside & of_ball, 0.04, 0.05), (inside & ~of_ball, 0.005, 0.02)):
        assert pixels.sum() > 50
        found, expected = ours[pixels], theirs.radiance[pixels]
        assert found.sum(0) == pytest.approx(expected.sum(0), rel=sums)
        assert relative(found, expected) < most + theirs.noise


def saved(folder: Path, made: Made) -> RelightResult:
    scene, objects = made
    result = RelightResult.of(scene.file, objects, {})
    result.save(folder / "out")
    return result


def test_a_saved_scene_has_its_lamps(tmp_path: Path, made: Made) -> None:
    result, eye = saved(tmp_path, made), (0, 1.5, 3)
    again = open_relit(tmp_path / "out")
    (lamp,) = again.lamps
    assert lamp.position == pytest.approx(PLACE)
    assert lamp.radius == RADIUS
    assert lamp.intensity == pytest.approx(LEVELS)
    for lamps in (True, False):
        pairs = zip(result.shade("studio", eye, lamps=lamps), again.shade("studio", eye, lamps=lamps), strict=True)
        assert all(np.array_equal(one, other) for one, other in pairs)
    lit, dark = (again.shade("studio", eye, lamps=lamps)[1] for lamps in (True, False))
    assert (lit > 1.5 * dark).any()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("position", [0.6, 0.9]),
        ("position", [1e30, 0.0, 0.0]),
        ("intensity", [0.0, 0.0, 0.0]),
        ("intensity", [1.0, -1.0, 0.0]),
        ("radius", 0.0),
        ("radius", 1e9),
    ],
)
def test_damaged_lamps_are_refused(name: str, value: object, tmp_path: Path, made: Made) -> None:
    saved(tmp_path, made)
    file = tmp_path / "out" / "relight.npz"
    arrays, header = read_archive(file)
    header["lamps"][0][name] = value
    write_archive(file, header, arrays)
    with refused(rf"lamps\[0\]\.{name}"):
        open_relit(tmp_path / "out")


@pytest.mark.parametrize("name", ["object_0_sun_seen", "object_1_lamp_bounced"])
def test_damaged_lamplight_is_refused(name: str, tmp_path: Path, made: Made) -> None:
    saved(tmp_path, made)
    file = tmp_path / "out" / "relight.npz"
    arrays, header = read_archive(file)
    for other in (arrays[name][:-1], arrays[name] * np.float32(np.nan)):
        write_archive(file, header, arrays | {name: other})
        with refused(name):
            open_relit(tmp_path / "out")


@pytest.mark.parametrize(
    ("old", "new", "where"),
    [
        ("[0.9, 0.7, 0.4]", "[0.9, 0.7]", "lamp[0].position"),
        ("[0.9, 0.7, 0.4]", "[0.9, nan, 0.4]", "lamp[0].position"),
        ("[0.9, 0.7, 0.4]", "[0.9, 1e9, 0.4]", "lamp[0].position"),
        ("0.15", "0", "lamp[0].radius"),
        ("0.15", "-0.1", "lamp[0].radius"),
        ("0.15", "inf", "lamp[0].radius"),
        ("[12.0, 8.0, 4.0]", "[0, 0, 0]", "lamp[0].intensity"),
        ("[12.0, 8.0, 4.0]", "[12.0, -8.0, 4.0]", "lamp[0].intensity"),
        ("[12.0, 8.0, 4.0]", "[12.0, nan, 4.0]", "lamp[0].intensity"),
        ("[12.0, 8.0, 4.0]", "[12.0, 8.0]", "lamp[0].intensity"),
        ("intensity", "power = 3\nintensity", "lamp[0].power"),
        ("radius = 0.15\n", "", "lamp[0].radius"),
        (LAMP, 9 * LAMP, "lamp"),
    ],
)
def test_lamps_that_cannot_be_are_refused(old: str, new: str, where: str, tmp_path: Path) -> None:
    file = written(tmp_path, SCENE + LAMP.replace(old, new))
    with refused(where=f"scene.toml: {where}"):
        read_relight_scene(file)


@pytest.mark.parametrize(
    ("position", "radius", "found"),
    [
        ("[0.1, 0.1, 0]", 0.05, "its middle inside sphere"),
        ("[0.5, 0.5, 0]", 0.3, "sphere at a distance of 0.2071 from its middle"),
        ("[1, -0.4, 0]", 0.2, "its lowest point at y = -0.6"),
        ("[1, -0.7, 0]", 0.1, "its lowest point at y = -0.8"),
        ("[0, 1.5, 2.9]", 0.2, "a camera at a distance of 0.1 from its middle"),
    ],
)
def test_lamps_in_the_way_are_refused_before_any_material(
    position: str, radius: float, found: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: object, **__: object) -> None:
        raise AssertionError

    monkeypatch.setattr("homofact.scene.objects.open_materials", never)
    lamp = LAMP.replace("[0.9, 0.7, 0.4]", position).replace("0.15", str(radius))
    scene = read_relight_scene(written(tmp_path, SCENE + lamp))
    with refused(where="lamp[0]", found=found):
        open_relight_scene(scene)


def test_tables_of_a_scene_s_lamp_are_those_of_its_material(made: Made) -> None:
    scene, objects = made
    for placed, relit in zip(scene.objects, objects, strict=True):
        assert relit.sunlight is not None
        for one, other in zip(relit.sunlight.tables, sun_tables(placed.reflectance), strict=True):
            assert np.array_equal(one.values, other.values)
