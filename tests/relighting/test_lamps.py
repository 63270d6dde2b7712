"""Lamps in a relit scene: light and shadows against geometry, and against a sun that is as far away as one likes."""

import math

import numpy as np
import pytest

from homofact.brdf.analytic import Lambert, Ward
from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.brdf.materials import material
from homofact.brdf.tinted import Tinted
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.shapes import ground, sphere
from homofact.meshes.tangents import frames
from homofact.relighting.errors import relative
from homofact.relighting.lamps import Lamp, distance_to
from homofact.relighting.lit_points import LitPoints
from homofact.relighting.lobe import SurfacePoints
from homofact.relighting.lobe_table import sun_tables
from homofact.relighting.seen import seen_vertices
from homofact.relighting.sunlight import Sun, Sunlight, summed

LEVELS = np.array([3.0, 2.0, 1.0])
WHITE = Lambert((1.0, 1.0, 1.0))
# A triangle far away: something that rays are traced against.
FAR = Occluder(np.array([[0, 900, 0], [1, 900, 0], [0, 900, 1]], float), np.array([[0, 1, 2]]))
UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, 1, 0]])


def level(places: np.ndarray) -> LitPoints:
    """Points (S, 3) that face up."""
    return LitPoints(places, np.tile(UP, (len(places), 1, 1)))


def irradiance(lamp: Lamp, points: LitPoints, occluder: Occluder = FAR) -> np.ndarray:
    """E (S, 3), by the exact sum over a white matt surface that reflects E/π."""
    up = np.tile([0.0, 0.0, 1.0], (len(points.origins), 1))
    return math.pi * summed(WHITE, [lamp], points, up, occluder)


def lit(material_tables: tuple, mesh: Mesh, *lamps: Lamp, occluder: Occluder | None = None) -> Sunlight:
    return Sunlight.traced((), material_tables, mesh, FAR if occluder is None else occluder, lamps)


@pytest.mark.parametrize("radius", [1e-3, 0.3, 0.9])
def test_the_irradiance_of_a_sphere_is_pi_l_sine_squared(radius: float) -> None:
    """Of a sphere above the horizon it is π L (r/d)² cosθ exactly, at every distance; here d is as small as 1.1 r."""
    lamp = Lamp(np.array([0.0, 1.0, 0.0]), radius, LEVELS)
    x = np.array([0.0, 0.2, 0.4]) if radius > 0.5 else np.array([0.0, 0.5, 1.5])
    distance = np.hypot(1, x)
    assert (np.arccos(1 / distance) + np.arcsin(radius / distance) < math.pi / 2).all()
    expected = math.pi * lamp.radiance() * ((radius / distance) ** 2 / distance)[:, None]
    points = level(np.stack((x, 0 * x, 0 * x), 1))
    assert irradiance(lamp, points) == pytest.approx(expected, rel=0.01)
    cones = lamp.cones(points.origins)
    assert cones.irradiance / distance[:, None] == pytest.approx(expected, rel=1e-9)
    assert np.sin(cones.radius) == pytest.approx(radius / distance)


def test_light_falls_with_the_square_of_the_distance() -> None:
    model = material("phong-30").model
    tables = sun_tables(model)
    found = []
    for scale in (1.0, 2.0, 5.0):
        lamp = Lamp(scale * np.array([0.6, 0.8, 0.0]), scale * 0.05, LEVELS)
        plane = ground(1e-3, 0.0, 1)
        points = SurfacePoints.all_vertices(plane.positions, frames(plane.normals), (-0.6, 0.8, 0.0))
        light = lit(tables, plane, lamp)
        found.append(light.at(points, plane.positions, light.seen).mean(0) * scale**2)
    assert found[0] == pytest.approx(found[1], rel=0.01)
    assert found[0] == pytest.approx(found[2], rel=0.01)
    assert (found[0] > 0.1).all()


@pytest.mark.parametrize("radius", [0.2665, 6.0])
def test_a_lamp_far_away_is_a_sun(radius: float) -> None:
    towards, angle, far = np.array([0.48, 0.8, 0.36]), math.radians(radius), 1e5
    sun = Sun(towards, LEVELS, angle)
    lamp = Lamp(far * towards, far * math.sin(angle), far**2 * LEVELS)
    ball = sphere(8)
    occluder = Occluder(ball.positions, ball.triangles)
    model = material("car-paint-red").model
    seen = seen_vertices(ball, model, occluder, (0.5, 1.5, 4), 60)
    assert seen.sunlit([lamp]) == pytest.approx(seen.sunlit([sun]), rel=1e-3, abs=1e-4)
    tables = sun_tables(model)
    both = Sunlight.traced([sun], tables, ball, occluder, [lamp])
    assert np.abs(both.seen[:, 0] - both.seen[:, 1]).max() < 0.05
    points = SurfacePoints.at_vertices(seen.rows, seen.wo, seen.which)
    by_sun, by_lamp = (both.only(*kind) for kind in ((True, False), (False, True)))
    assert by_sun is not None
    assert by_lamp is not None
    given = (points, ball.positions, by_sun.seen[seen.which])
    assert by_lamp.at(*given) == pytest.approx(by_sun.at(*given), rel=1e-3, abs=1e-5)


def test_a_penumbra_is_as_wide_as_the_edge_and_the_lamp_make_it() -> None:
    """An edge at the height h under a lamp of radius r at the height H: 2 r h/(H − h) wide, a segment's area each."""
    high, edge, radius = 4.0, 1.0, 0.2
    lamp = Lamp(np.array([0.0, high, 0.0]), radius, LEVELS)
    roof = np.array([[0, edge, -50], [0, edge, 50], [-50, edge, 50], [-50, edge, -50]], float)
    occluder = Occluder(roof, np.array([[0, 1, 2], [0, 2, 3]]))
    width = 2 * radius * edge / (high - edge)
    offsets = np.array([-0.7, -0.45, -0.2, 0.0, 0.2, 0.45, 0.7])
    points = level(np.stack((offsets * width, 0 * offsets, 0 * offsets), 1))
    x = (-2 * offsets).clip(-1, 1)
    open_ = (np.arccos(x) - x * np.sqrt(1 - x**2)) / math.pi
    assert points.seen([lamp], occluder, 400)[:, 0] == pytest.approx(open_, abs=0.02)
    facing = irradiance(lamp, points, occluder)[:, 0] / irradiance(lamp, points)[:, 0]
    assert facing == pytest.approx(open_, abs=0.04)


def test_only_what_is_before_a_lamp_hides_it() -> None:
    lamp = Lamp(np.array([0.0, 2.0, 0.0]), 0.3, LEVELS)
    point = level(np.zeros((1, 3)))
    square = np.array([[-9, 0, -9], [9, 0, -9], [9, 0, 9], [-9, 0, 9]], float)
    for height, open_ in ((1.0, 0.0), (1.6, 0.0), (2.4, 1.0), (5.0, 1.0)):
        occluder = Occluder(square + np.array([0, height, 0]), np.array([[0, 1, 2], [0, 2, 3]]))
        assert point.seen([lamp], occluder, 16)[0, 0] == open_
        assert irradiance(lamp, point, occluder)[0, 0] == pytest.approx(0.75 * open_, rel=0.01)


@pytest.mark.parametrize(
    ("model", "most"),
    [
        (material("phong-30").model, 0.04),
        pytest.param(Ward((0.1,) * 3, (0.3, 0.2, 0.1), 0.3, 0.1), 0.05, marks=pytest.mark.slow),
        (material("car-paint-red").model, 0.06),
    ],
    ids=["isotropic", "anisotropic", "sharp"],
)
def test_tables_reflect_a_lamp_as_the_material_does(model: Lambert, most: float) -> None:
    ball = sphere(12)
    occluder = Occluder(ball.positions, ball.triangles)
    lamp = Lamp(np.array([1.5, 1.8, 1.2]), 0.15, LEVELS)
    seen = seen_vertices(ball, model, occluder, (0.5, 1.5, 4), 80)
    light = lit(sun_tables(model), ball, lamp, occluder=occluder)
    points = SurfacePoints.at_vertices(seen.rows, seen.wo, seen.which)
    found, exact = light.at(points, ball.positions, light.seen[seen.which]), seen.sunlit([lamp])
    assert relative(found, exact) < most
    # Half of the ball and more is in the dark.
    assert 0.1 < exact.any(1).mean() < 0.9


def test_a_texture_tints_the_light_of_a_lamp() -> None:
    plane = ground(0.4, 0.0, 2)
    model = Tinted.of(MetallicRoughness((0.5, 0.4, 0.3), metallic=0.2, roughness=0.6))
    lamp = Lamp(np.array([0.2, 1.0, 0.1]), 0.1, LEVELS)
    seen = seen_vertices(plane, model, FAR, (0.5, 1.5, 1), None)
    tint = np.random.default_rng(0).random((len(seen.which), 3))
    origins = LitPoints(plane.positions[seen.which], seen.rows)
    exact = summed(model, [lamp], origins, seen.wo, FAR, tint)
    points = SurfacePoints.at_vertices(seen.rows, seen.wo, seen.which)
    light = lit(sun_tables(model), plane, lamp)
    assert relative(light.at(points, plane.positions, light.seen[seen.which], tint), exact) < 0.03
    of_mean = summed(model, [lamp], origins, seen.wo, FAR, np.ones_like(tint))
    assert relative(exact, of_mean) > 0.2


def test_a_lamp_is_met_where_its_sphere_is() -> None:
    lamp = Lamp(np.array([0.0, 0.0, -3.0]), 0.5, LEVELS)
    rays = np.array([[0.0, 0, -1], [0, 0, 1], [0.6, 0, -0.8], [math.sin(0.16), 0, -math.cos(0.16)]])
    found = lamp.met(np.zeros(3), rays)
    assert found[0] == pytest.approx(2.5)
    assert np.isinf(found[1:3]).all()
    assert np.linalg.norm(found[3] * rays[3] - lamp.position) == pytest.approx(0.5)


def test_rays_end_on_the_lamp() -> None:
    lamp = Lamp(np.array([0.3, 1.0, -0.2]), 0.4, LEVELS)
    origins = np.random.default_rng(1).normal(size=(5, 3)) * 0.3 - [0, 1, 0]
    cones = lamp.cones(origins)
    w = cones.directions(40)
    assert np.linalg.norm(w, axis=-1) == pytest.approx(1)
    ends = origins[:, None] + cones.lengths(w)[..., None] * w
    assert np.linalg.norm(ends - lamp.position, axis=-1) == pytest.approx(0.4)
    assert np.einsum("srj,sj->sr", w, cones.middle).mean(1) == pytest.approx((1 + np.cos(cones.radius)) / 2, rel=1e-6)


def test_the_distance_from_a_mesh_is_that_of_its_nearest_point() -> None:
    corners, up = np.array([[0.0, 0, 0], [2, 0, 0], [0, 0, 2]]), np.tile([0.0, 1, 0], (3, 1))
    triangle = Mesh(corners, up, np.array([[0, 1, 2]]), "triangle")
    for point, expected in (
        ((0.5, 0.7, 0.5), 0.7),
        ((1.0, 0.0, -0.3), 0.3),
        ((-3.0, 4.0, 0.0), 5.0),
        ((2.0, 0.0, 2.0), math.sqrt(2)),
    ):
        assert distance_to(np.array(point), triangle) == pytest.approx(expected)
    ball = sphere(24)
    for distance in (1.5, 4.0):
        towards = np.array([0.48, 0.8, 0.36])
        assert distance_to(distance * towards, ball) == pytest.approx(distance - 1, abs=0.01)
