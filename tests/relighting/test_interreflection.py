"""Light between surfaces: against geometry, the sum in full and Mitsuba's paths, stored, and what is refused."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from refusals import refused
from relighting_cases import factored_once

from homofact.brdf.analytic import Lambert, Phong, Ward
from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.meshes.mesh import Mesh
from homofact.meshes.shapes import ground, sphere
from homofact.meshes.tangents import frames
from homofact.relighting import build, cube
from homofact.relighting.build import RelightScene, RelitObject, open_relight_scene, relit_objects
from homofact.relighting.clusters import clustered
from homofact.relighting.errors import relative, scene_errors, sending_surfaces
from homofact.relighting.factors import look_up
from homofact.relighting.haar import transform_faces
from homofact.relighting.harmonic import harmonic
from homofact.relighting.interreflection import INNER, ORDER, BounceColours, Interreflection, spread_suns
from homofact.relighting.lit import LitObject
from homofact.relighting.precompute import TransportSettings, transport
from homofact.relighting.reference import Geometry, scene_picture
from homofact.relighting.result import RelightResult, open_relit
from homofact.relighting.scene_file import read_relight_scene
from homofact.relighting.seen import seen_vertices
from homofact.relighting.smooth_response import mean_albedo, modes, smooth_response, zernike
from homofact.relighting.sunlight import Sun
from homofact.rendering.light import EnvironmentMap
from homofact.scene.meshes import MeshGroup

SCENE = """
[[object]]
mesh = "shape:sphere"
albedo = [0.7, 0.5, 0.2]
size = 0.5
[ground]
albedo = [0.3, 0.4, 0.6]
half = 2
steps = 12
[lighting]
named = "studio"
[[camera]]
eye = [0, 1.2, 3]
pixels = [48, 36]
[transport]
cube = 8
kept = 384
bounces = 1
"""

BRUSHED = Ward((0.1,) * 3, (0.3, 0.2, 0.1), 0.3, 0.1)
SHINY = Phong((0.1, 0.2, 0.4), (0.4,) * 3, exponent=6)


@pytest.fixture(scope="module")
def nodes() -> tuple[np.ndarray, np.ndarray]:
    """Directions (N, 3) of the upper hemisphere, and cosθ dω (N,) of each."""
    w = cube.directions(192).reshape(-1, 3)
    solid = np.tile(cube.solid_angles(192).reshape(-1), cube.FACES)
    up = w[:, 2] > 0
    return w[up], (w[:, 2] * solid)[up]


def written(folder: Path, text: str) -> Path:
    file = folder / "scene.toml"
    file.write_text(text)
    return file


def relit(folder: Path, text: str) -> tuple[RelightScene, tuple[RelitObject, ...]]:
    scene = open_relight_scene(read_relight_scene(written(folder, text)))
    return scene, relit_objects(scene)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[RelightScene, tuple[RelitObject, ...]]:
    return relit(tmp_path_factory.mktemp("bounce"), SCENE)


def bounced_part(scene: RelightScene, objects: tuple[RelitObject, ...], number: int) -> np.ndarray:
    """What the terms of interreflection of an object alone send (V, 3) to the first camera."""
    direct = objects[number].transport.factors.direct
    lit = objects[number].lit(cube.environment_cube(scene.file.light, scene.file.settings.cube))
    alone = lit.tuples.copy()
    alone[:, :direct] = 0
    return replace(lit, tuples=alone).terms(scene.file.cameras[0].eye)


def test_the_polynomials_are_orthonormal_under_the_cosine(nodes: tuple[np.ndarray, np.ndarray]) -> None:
    w, flux = nodes
    found = zernike(w, 4)
    assert len(found) == len(modes(4)) == 15
    np.testing.assert_allclose((found * flux) @ found.T, np.eye(15), atol=1e-3)


@pytest.mark.parametrize("reflectance", [SHINY, BRUSHED], ids=["isotropic", "anisotropic"])
def test_the_response_is_the_integral_of_each(reflectance: Reflectance, nodes: tuple[np.ndarray, np.ndarray]) -> None:
    w, flux = nodes
    maps = torch.from_numpy(smooth_response(reflectance, 3, 48)).permute(1, 2, 0, 3).double()
    for view in ((0.1, 0.2), (0.6, -0.3), (-0.2, -0.8)):
        wo = torch.tensor([[*view, math.sqrt(1 - view[0] ** 2 - view[1] ** 2)]], dtype=torch.float64)
        f = reflectance.evaluate(torch.from_numpy(w), wo.expand(len(w), 3)).double().numpy()
        expected = (zernike(w, 3) * flux) @ f
        found = look_up(maps.flatten(2), wo).reshape(expected.shape).numpy()
        np.testing.assert_allclose(found, expected, atol=0.03 * np.abs(expected).max())


def test_a_matt_material_answers_to_the_constant_alone() -> None:
    found = smooth_response(Lambert((0.6, 0.3, 0.1)), 3, 8)
    np.testing.assert_allclose(found[0], np.broadcast_to([0.6, 0.3, 0.1], (8, 8, 3)) / math.sqrt(math.pi), rtol=1e-3)
    assert np.abs(found[1:]).max() < 1e-3
    np.testing.assert_allclose(mean_albedo(Lambert((0.6, 0.3, 0.1))), [0.6, 0.3, 0.1], rtol=1e-3)


def test_the_mean_albedo_is_over_both_hemispheres(nodes: tuple[np.ndarray, np.ndarray]) -> None:
    w, flux = (each[::37] for each in nodes)
    flux = flux / flux.sum() * math.pi
    every = torch.from_numpy(w)
    albedos = [
        (BRUSHED.evaluate(every, wo.expand_as(every)).double().numpy() * flux[:, None]).sum(0) for wo in every[::11]
    ]
    weights = flux[::11] / flux[::11].sum()
    expected = (np.stack(albedos) * weights[:, None]).sum(0)
    np.testing.assert_allclose(mean_albedo(BRUSHED), expected, rtol=0.03)


def test_as_few_colours_as_the_albedos_need() -> None:
    grey = BounceColours.of([np.array([0.5]), np.array([0.2, 0.2, 0.2])])
    assert len(grey.colours) == 1
    np.testing.assert_allclose(grey.shares @ grey.colours, [[0.5] * 3, [0.2] * 3], atol=1e-12)
    assert (grey.shares > 0).all()
    rows = np.random.default_rng(0).random((5, 3))
    many = BounceColours.of(list(rows))
    assert many.shares.shape == (5, 3)
    np.testing.assert_allclose(many.shares @ many.colours, rows, atol=1e-12)
    assert len(BounceColours.of([np.zeros(3)]).colours) == 0


def test_a_wide_floor_lights_what_is_above_it() -> None:
    """A floor of albedo ρ under an even sky L sends ρL: a normal at height n_y receives ρLπ(1 − n_y)/2 of it."""
    ball = sphere(24)
    small = replace(ball, positions=ball.positions * 0.02 + [0, 2, 0])
    floor = ground(400.0, 0.0, 24)
    meshes = [small, floor]
    colours = BounceColours.of([np.full(3, 0.9), np.full(3, 0.5)])
    between = Interreflection.traced(meshes, colours, MeshGroup(meshes).occluder)
    rows = frames(small.normals)
    for v in range(0, len(small.positions), 40):
        found = between.received(small.positions[v], rows[v], 1).sum(1) @ colours.colours
        up = small.normals[v, 1]
        # The constant polynomial is 1/√π.
        assert found * math.sqrt(math.pi) == pytest.approx(0.5 * math.pi * (1 - up) / 2, abs=0.012)


@pytest.mark.parametrize("times", [1, 2, 4])
def test_on_a_finer_map_each_texel_is_shared_out(times: int) -> None:
    """Haar coefficients on cube maps of 8, 16 and 32 texels along a face are those of the same light."""
    ball, floor = sphere(4), ground(4.0, -1.5, 4)
    meshes, frame = [ball, floor], frames(ball.normals)[-1]
    colours = BounceColours.of([np.full(3, 0.9), np.full(3, 0.5)])
    between = Interreflection.traced(meshes, colours, MeshGroup(meshes).occluder)
    coarse = between.received(ball.positions[-1], frame, 3).astype(np.float32).reshape(-1, INNER, INNER)
    fine = np.ascontiguousarray(coarse.repeat(times, 1).repeat(times, 2) / times**2)
    size = times * INNER
    transform_faces(fine, np.empty((size, size), np.float32))
    found = between.vectors(ball.positions[-1], frame, 3, size).reshape(fine.shape)
    assert np.abs(found).max() > 0
    np.testing.assert_allclose(found, fine, atol=1e-6)


def test_the_back_of_a_surface_is_dark() -> None:
    ball = sphere(24)
    floor = ground(4.0, 3.0, 8)
    meshes = [ball, floor]
    colours = BounceColours.of([np.zeros(3), np.full(3, 0.5)])
    between = Interreflection.traced(meshes, colours, MeshGroup(meshes).occluder)
    # The ball is under the floor, whose normals point up.
    assert not between.received(ball.positions[0], frames(ball.normals)[0], 1).any()


@pytest.mark.slow
def test_matt_surfaces_send_what_the_sum_in_full_has(made: tuple[RelightScene, tuple[RelitObject, ...]]) -> None:
    scene, objects = made
    around = sending_surfaces(scene)
    assert around is not None
    for number, placed in enumerate(scene.objects):
        seen = seen_vertices(placed.mesh, placed.material.reflectance, scene.occluder, scene.file.cameras[0].eye, 32)
        expected = around.bounced(seen, scene.file.light)
        found = bounced_part(scene, objects, number)[seen.which]
        # Near its contact with the ball the ground is coarser than what is sent there.
        assert relative(found, expected) < (0.06, 0.16)[number]
        assert found.sum() == pytest.approx(expected.sum(), rel=0.04)


@pytest.mark.slow
def test_errors_are_against_light_with_the_bounce(made: tuple[RelightScene, tuple[RelitObject, ...]]) -> None:
    scene, objects = made
    stages = ("bounce", "together", "picture")
    found = scene_errors(scene, objects, 32, stages)
    dark = [replace(each, transport=without_bounce(each)) for each in objects]
    less = scene_errors(scene, dark, 32, stages)
    for one, other, least in zip(found, less, (0.05, 0.01), strict=True):
        assert one is not None
        assert other is not None
        assert one.errors["bounce"] < 0.01
        # Without its terms all of the bounce is missing.
        assert other.errors["bounce"] > max(least, 2 * one.errors["bounce"])
        assert other.errors["together"] > one.errors["together"]


def without_bounce(each: RelitObject) -> object:
    factors = each.transport.factors
    view = factors.view.copy()
    view[factors.direct :] = 0
    return replace(each.transport, factors=replace(factors, view=view))


@pytest.mark.slow
def test_suns_are_sent_on_too(tmp_path: Path) -> None:
    sun = "[[sun]]\ndirection = [0.5, 0.7, 0.4]\nirradiance = [4.0, 3.0, 2.0]\n"
    scene, objects = relit(tmp_path, SCENE.replace("cube = 8", "cube = 16") + sun)
    around = sending_surfaces(scene)
    assert around is not None
    placed = scene.objects[0]
    seen = seen_vertices(placed.mesh, placed.material.reflectance, scene.occluder, scene.file.cameras[0].eye, 48)
    found, sky = around.bounced(seen, scene.file.light), replace(around, lights=()).bounced(seen, scene.file.light)
    assert found.sum() > 1.3 * sky.sum()
    assert relative(bounced_part(scene, objects, 0)[seen.which], found) < 0.1
    light = cube.environment_cube(scene.file.light, 16)
    on, off = (objects[0].lit(light, suns=suns).tuples[:, -1].sum() for suns in (True, False))
    assert off < 0.8 * on


def test_spread_suns_keep_their_irradiance() -> None:
    sun = Sun(np.array([0.6, 0.8, 0.0]), np.array([3.0, 2.0, 1.0]), 0.01)
    for size in (8, 32):
        flux = spread_suns([sun], size) * cube.solid_angles(size)[..., None]
        np.testing.assert_allclose(flux.sum((0, 1, 2)), sun.irradiance, rtol=0.02)
        middle = (flux[..., :1] * cube.directions(size)).sum((0, 1, 2))
        # As wide as a disc of .2 and the texels that it meets.
        assert middle @ sun.direction > 0.97 * sun.irradiance[0]


def test_compact_forms_have_it(made: tuple[RelightScene, tuple[RelitObject, ...]]) -> None:
    objects = made[1]
    light = cube.environment_cube(EnvironmentMap.constant(1.0), 8)
    given = objects[0]
    whole = LitObject.of(given.transport, None, None, light).tuples[:, given.transport.factors.direct :]
    assert whole.max() > 0.01
    for compact in (harmonic(given.transport, 3), clustered(given.transport, 16, clusters=8)):
        found = LitObject.of(given.transport, compact, None, light).tuples[:, given.transport.factors.direct :]
        assert relative(found.reshape(-1, 3), whole.reshape(-1, 3)) < 0.06


def test_the_terms_of_f_stay_what_they_are(made: tuple[RelightScene, tuple[RelitObject, ...]]) -> None:
    objects = made[1]
    factors = objects[0].transport.factors
    assert (factors.bounced, factors.direct) == (2, factors.terms - 2)
    wi = wo = torch.tensor([[0.3, 0.2, 0.9327]], dtype=torch.float64)
    np.testing.assert_allclose(factors.evaluate(wi, wo)[0] * math.pi, [0.7, 0.5, 0.2], rtol=0.02)
    assert factors.share == pytest.approx(1, abs=0.01)


@pytest.mark.slow
def test_glossy_materials_answer_by_several_polynomials(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build, "factored", factored_once)
    scene = open_relight_scene(
        read_relight_scene(
            written(tmp_path, SCENE.replace("albedo = [0.7, 0.5, 0.2]", 'material = "material:phong-30"'))
        )
    )
    assert [each.material.factors.bounced for each in scene.choices] == [2 * len(modes(ORDER)), 2]
    assert scene.cost.rays > replace(scene, bounces=None).cost.rays
    assert scene.cost.peak_bytes > replace(scene, bounces=None).cost.peak_bytes


def test_stored_and_read(made: tuple[RelightScene, tuple[RelitObject, ...]], tmp_path: Path) -> None:
    scene, objects = made
    result = RelightResult.of(scene.file, objects, {})
    result.save(tmp_path / "relit")
    back = open_relit(tmp_path / "relit")
    for one, other in zip(result.objects, back.objects, strict=True):
        assert other.transport.factors.bounced == one.transport.factors.bounced == 2
        np.testing.assert_array_equal(one.transport.factors.view, other.transport.factors.view)
    eye = scene.file.cameras[0].eye
    for one, other in zip(result.shade("studio", eye), back.shade("studio", eye), strict=True):
        np.testing.assert_array_equal(one, other)


def test_factors_without_their_surroundings_are_refused(made: tuple[RelightScene, tuple[RelitObject, ...]]) -> None:
    scene, objects = made
    given = objects[0].transport
    with pytest.raises(BadInput):
        transport(scene.objects[0].mesh, given.factors, TransportSettings(8), scene.occluder)


def test_bounces_of_a_scene_are_none_or_one(tmp_path: Path) -> None:
    with refused("scene.toml: transport.bounces: found 2, expected a whole number from 0 to 1"):
        read_relight_scene(written(tmp_path, SCENE.replace("bounces = 1", "bounces = 2")))


def geometry(mesh: Mesh) -> Geometry:
    return Geometry(mesh.positions, mesh.normals, mesh.triangles)


@pytest.mark.slow
def test_mitsuba_has_the_same_of_one_bounce(made: tuple[RelightScene, tuple[RelitObject, ...]]) -> None:
    pytest.importorskip("mitsuba")
    scene, objects = made
    camera = replace(scene.file.cameras[0], pixels=(32, 24))
    pairs = [(geometry(each.mesh), each.material.reflectance) for each in scene.objects]
    none, one = (scene_picture(pairs, scene.file.light, camera, 1024, 2, bounces=count) for count in (0, 1))
    w = camera.rays(1).reshape(-1, 3)
    triangle, weights = scene.occluder.first(np.array(camera.eye)[None], w)
    colours = np.concatenate([bounced_part(scene, objects, number) for number in range(2)])
    inside = none.seen.reshape(-1) & (triangle >= 0)
    corners = MeshGroup([each.mesh for each in scene.objects]).triangles[triangle[inside]]
    found = (colours[corners] * weights[inside][..., None]).sum(1)
    expected = (one.radiance - none.radiance).reshape(-1, 3)[inside]
    assert expected.sum() > 0.03 * none.radiance.reshape(-1, 3)[inside].sum()
    np.testing.assert_allclose(found.sum(0), expected.sum(0), rtol=0.06)
    noise = 1.5 * (one.noise + none.noise)
    assert relative(found, expected, of=one.radiance.reshape(-1, 3)[inside]) < noise + 0.02
