"""Places that an eye sees count by the area that they take in its picture, and its error is that of every pixel."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from relighting_cases import EYE, MATT, SHINY, knot, matt, occluder, shiny
from relit_errors import errors_of

from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.shapes import ground, sphere
from homofact.relighting import cube
from homofact.relighting.factors import InOutFactors
from homofact.relighting.precompute import TransportSettings, transport
from homofact.relighting.relight import Relit
from homofact.relighting.seen import RIM, seen_pixels, seen_vertices, vertex_areas
from homofact.rendering.light import EnvironmentMap
from homofact.scene.cameras import Camera
from homofact.scene.meshes import MeshGroup

FAR = (0.0, 0.0, 1000.0)


def ball() -> Mesh:
    return sphere(40)


def around(*meshes: Mesh) -> Occluder:
    return MeshGroup(meshes).occluder


def test_areas_add_up_to_the_solid_angle_however_triangles_are_wound() -> None:
    areas = vertex_areas(ball(), np.array(FAR))
    assert areas.sum() == pytest.approx(math.pi / 1000**2, rel=0.01)
    wound = replace(ball(), triangles=ball().triangles[:, ::-1])
    assert vertex_areas(wound, np.array(FAR)) == pytest.approx(areas)
    assert areas[ball().positions[:, 2] < -0.2].max() == 0


def test_a_mean_over_those_drawn_is_one_over_the_picture() -> None:
    """Over a disc a sphere's cosθo has the mean 2/3, its rim a part of RIM²; over the vertices it would be 1/2."""
    drawn = seen_vertices(ball(), MATT, around(ball()), FAR, 800)
    assert drawn.wo[:, 2].mean() == pytest.approx(2 / 3, abs=0.01)
    assert (drawn.wo[:, 2] < RIM).mean() == pytest.approx(RIM**2, abs=0.015)
    every = seen_vertices(ball(), MATT, around(ball()), FAR, None)
    assert every.weights is not None
    assert np.average(every.wo[:, 2], weights=every.weights) == pytest.approx(2 / 3, abs=0.01)
    assert len(set(every.which.tolist())) == len(every.which)


def test_the_rim_is_drawn_by_itself() -> None:
    drawn = seen_vertices(ball(), MATT, around(ball()), FAR, 50, rim=True)
    assert len(drawn.which) == 50
    assert (drawn.wo[:, 2] < RIM).all()
    flat = ground(1.0, 0.0, 4)
    with pytest.raises(BadInput):
        seen_vertices(flat, MATT, around(flat), (0, 3, 0.1), 5, rim=True)


def test_pixels_are_of_the_mesh_that_is_asked_for_and_mixed_of_its_corners() -> None:
    meshes = [knot(), ground(2.0, -1.2, 6)]
    camera, both = Camera(EYE, pixels=(24, 18)), around(*meshes)
    rays, whole = camera.rays().reshape(-1, 3), 0
    for number, mesh in enumerate(meshes):
        found = seen_pixels(meshes, number, MATT, both, camera, 10_000)
        whole += len(found.mixture.corners)
        points = found.points.mesh.positions
        assert found.mixture.mixed(mesh.positions) == pytest.approx(points)
        # They lie along the camera's rays, and nothing stands before them.
        towards = points - np.array(EYE)
        distance = np.linalg.norm(towards, axis=1)
        nearest = (towards / distance[:, None] @ rays.T).max(1)
        assert nearest == pytest.approx(1, abs=1e-9)
        assert not both.blocked(points + 1e-3 * (np.array(EYE) - points), np.array(EYE) - points).any()
        assert (found.points.wo[:, 2] > 0).all()
    triangles, _ = both.first(np.array(EYE)[None], rays)
    assert 0.97 * (triangles >= 0).sum() <= whole <= (triangles >= 0).sum()
    with pytest.raises(BadInput):
        seen_pixels(meshes, 0, MATT, both, Camera(EYE, (0.5, 0.8, 9.0), pixels=(8, 8)), 5)


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize(("material", "factors"), [(SHINY, shiny()), (MATT, matt())], ids=["shiny", "matt"])
def test_what_is_stated_is_the_error_of_the_whole_picture(
    material: Reflectance, factors: InOutFactors, seed: int
) -> None:
    """Against a dense sum written apart, over every pixel: within 1.3."""
    camera, size = Camera(EYE, pixels=(32, 24), field=45), 8
    made = transport(knot(), factors, TransportSettings(size, kept=16), occluder())
    rng = np.random.default_rng(seed)
    radiance = torch.from_numpy(rng.uniform(0.1, 1, (32, 64, 3)))
    radiance[8 + 3 * seed, 30] = 100
    sky = EnvironmentMap(radiance)
    relit, given = Relit(made), cube.environment_cube(sky, size)
    relit.relight(given)
    colours = relit.shade(EYE).astype(np.float64)
    directions, angles = cube.directions(size).reshape(-1, 3), np.tile(cube.solid_angles(size).reshape(-1), 6)
    rays = camera.rays().reshape(-1, 3)
    triangle, shares = occluder().first(np.array(EYE)[None], rays)
    squares, before = np.zeros(2), 0.0
    for ray, hit, share in zip(rays, triangle, shares, strict=True):
        if hit < 0:
            continue
        corners = knot().triangles[hit]
        n = share @ knot().normals[corners]
        n /= np.linalg.norm(n)
        if n @ ray >= 0:
            continue
        t = np.cross(n, [0.3, 0.5, 0.8])
        t /= np.linalg.norm(t)
        frame = np.stack((t, np.cross(n, t), n))
        lit = directions @ n > 0
        start = share @ knot().positions[corners] + occluder().offset * n
        lit[lit] = ~occluder().blocked(start[None], directions[lit])
        wi = torch.from_numpy(directions[lit] @ frame.T)
        f = material.evaluate(wi, torch.from_numpy(frame @ -ray).expand_as(wi)).numpy()
        truth = (f * wi[:, 2:].numpy() * given.reshape(-1, 3)[lit] * angles[lit][:, None]).sum(0)
        # What a corner that is turned away sends is not mixed in.
        facing = share * ((np.array(EYE) - knot().positions[corners]) * knot().normals[corners]).sum(1).clip(0).astype(
            bool
        )
        if not facing.any():
            facing = share
        before += ((share @ colours[corners] - truth) ** 2).sum()
        squares += ((facing / facing.sum() @ colours[corners] - truth) ** 2).sum(), (truth**2).sum()
    if material is MATT:
        assert squares[0] < 0.3 * before
    exact = math.sqrt(squares[0] / squares[1])
    pixels = seen_pixels([knot()], 0, material, occluder(), camera, 64)
    those = seen_vertices(knot(), material, occluder(), EYE, 4)
    found = errors_of(those, made, None, sky, ("picture",), pixels)
    assert exact / 1.3 < found.errors["picture"] < 1.3 * exact
    assert found.psnr is not None
    assert 5 < found.psnr < 60
