"""Normal maps of relit scenes: terms, lobes, suns and light between surfaces; errors, folders, plans."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from bumpy import FLAT, halves, square, tilted, waves, written
from coarse import coarse_terms

from homofact.brdf.analytic import Lambert
from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.errors import BadInput
from homofact.files.archive import read_archive, write_archive
from homofact.geometry.directions import draw_cosine_weighted
from homofact.relighting import cube
from homofact.relighting.build import RelightScene, RelitObject, open_relight_scene, relit_objects
from homofact.relighting.errors import relative, scene_errors
from homofact.relighting.factored_material import factored
from homofact.relighting.factors import look_up
from homofact.relighting.result import RelightResult, open_relit
from homofact.relighting.scene_file import read_relight_scene
from homofact.relighting.seen import SeenPixels, seen_pixels
from homofact.relighting.tilted_view import rotation, tilt_nodes
from homofact.relighting.tilted_view import tilted as tilted_factors
from homofact.scene.normal_map import SurfaceNormals

SCENE = """
[[object]]
mesh = "part.glb"
{lines}
[lighting]
named = "studio"
{more}
[[camera]]
eye = [0.6, 0.5, 3.2]
pixels = [32, 24]
[transport]
cube = 8
kept = 384
bounces = {bounces}
"""
SUN = """[[sun]]
direction = [0.5, 0.8, 0.6]
irradiance = [3.0]
radius = 3
"""
GROUND = """[ground]
albedo = [0.5]
half = 2
steps = 8
"""
# Light from well above the horizons of a surface that faces +z and of its tilted normals.
HIGH = np.where(cube.directions(8)[..., 2:] > 0.6, 1.0, 0.0) * np.array([1.0, 0.8, 0.6])
Case = tuple[RelightScene, tuple[RelitObject, ...]]


@pytest.fixture(scope="module", autouse=True)
def _coarse() -> Iterator[None]:
    with coarse_terms():
        yield


def opened(folder: Path, lines: str = "", more: str = "", bounces: int = 0) -> Case:
    """The scene of part.glb in the folder."""
    (folder / "scene.toml").write_text(SCENE.format(lines=lines, more=more, bounces=bounces))
    scene = open_relight_scene(read_relight_scene(folder / "scene.toml"))
    return scene, relit_objects(scene)


def pixels_of(case: Case, light: np.ndarray) -> tuple[SeenPixels, np.ndarray, np.ndarray]:
    """(all pixels that see the first object, their light (S, 3), the sum over every texel of a cube map)."""
    scene, objects = case
    placed, camera = scene.objects[0], scene.file.cameras[0]
    meshes, given = [each.mesh for each in objects], (placed.reflectance, scene.occluder, camera, None)
    seen = seen_pixels(meshes, 0, *given, tint=placed.tint, bumps=placed.bumps)
    found = objects[0].lit(light, suns=False).between(seen.mixture, camera.eye)
    return seen, found, seen.points.dense(light, light.shape[1])


@pytest.fixture(scope="module")
def wavy(tmp_path_factory: pytest.TempPathFactory) -> Case:
    """A ball with a wavy normal map and a texture of two colours, over a ground, under a sun."""
    folder = tmp_path_factory.mktemp("wavy")
    written(folder / "part.glb", waves(), 0.0, 0.4, coloured=True)
    return opened(folder, "terms = 3", GROUND + SUN, 1)


@pytest.mark.parametrize("metallic", [pytest.param(0.0, marks=pytest.mark.slow), 1.0])
def test_a_constant_tilt_is_the_square_with_turned_normals(tmp_path: Path, metallic: float) -> None:
    """Under a sky that both horizons leave whole; and the sum over every texel says so too."""
    written(tmp_path / "part.glb", halves(tilted(20), tilted(20)), metallic, 0.5, mesh=square())
    scene, objects = opened(tmp_path, "terms = 4")
    seen, found, exact = pixels_of((scene, objects), HIGH)
    normal = np.array([np.sin(np.radians(20)), 0, np.cos(np.radians(20))])
    np.testing.assert_allclose(seen.mixture.frames[:, 2], np.broadcast_to(normal, (len(found), 3)), atol=0.01)
    mesh = replace(objects[0].mesh, normals=np.broadcast_to(normal, objects[0].mesh.normals.shape).copy())
    place, given = scene.objects[0], (scene.occluder, scene.file.cameras[0], None)
    turned = seen_pixels([mesh], 0, place.reflectance, *given).points.dense(HIGH, 8)
    assert relative(exact, turned) < 0.01
    assert relative(found, exact) < 0.02
    # It is another light than the flat square's.
    assert relative(exact, seen_pixels([objects[0].mesh], 0, place.reflectance, *given).points.dense(HIGH, 8)) > 0.04


def test_the_full_sum_is_that_of_its_definition(tmp_path: Path) -> None:
    """Matt: ρ/π Σ L max(0, n'·ω) Δω over the texels above the surface's own horizon."""
    written(tmp_path / "part.glb", halves(tilted(50), tilted(50)), mesh=square())
    scene, objects = opened(tmp_path, "terms = 1")
    placed, camera = scene.objects[0], scene.file.cameras[0]
    seen = seen_pixels([objects[0].mesh], 0, Lambert((0.5,) * 3), scene.occluder, camera, None, bumps=placed.bumps)
    light = np.random.default_rng(0).random((6, 8, 8, 3))
    w, solid = cube.directions(8).reshape(-1, 3), np.tile(cube.solid_angles(8).reshape(-1), 6)
    cosine = (seen.mixture.frames[:, 2] @ w.T).clip(0) * (w[:, 2] > 0)
    expected = 0.5 / np.pi * (cosine * solid) @ light.reshape(-1, 3)
    np.testing.assert_allclose(seen.points.dense(light, 8), expected, rtol=1e-5)


@pytest.mark.slow
def test_halves_of_a_map_are_those_of_the_two_maps(tmp_path: Path) -> None:
    found = []
    for pixels in (halves(FLAT, tilted(25, 60)), halves(FLAT, FLAT), halves(tilted(25, 60), tilted(25, 60))):
        written(tmp_path / "part.glb", pixels, mesh=square())
        scene, objects = opened(tmp_path, "terms = 4")
        found.append(pixels_of((scene, objects), HIGH)[:2])
        (tmp_path / "part.glb").unlink()
    uv = objects[0].mesh.uv
    assert uv is not None
    u = (uv[found[0][0].mixture.corners] * found[0][0].mixture.shares[..., None]).sum(1)[:, 0]
    for own, inside in ((1, (u > 0.1) & (u < 0.4)), (2, (u > 0.6) & (u < 0.9))):
        assert inside.sum() > 20
        # The functions of tilt follow the tilts of the map.
        assert relative(found[0][1][inside], found[own][1][inside]) < 0.015
        assert relative(found[0][1][inside], found[3 - own][1][inside]) > 0.05


def test_a_flat_map_and_one_without_strength_are_none(tmp_path: Path) -> None:
    written(tmp_path / "part.glb", halves(FLAT, FLAT), mesh=square())
    scene, objects = opened(tmp_path, "terms = 1")
    assert scene.objects[0].bumps is None
    assert objects[0].tilted is None
    assert not any("normal" in note for note in scene.notes)


def test_terms_without_tilt_are_in_out_factors() -> None:
    """Of the same reflectance; and tilted by the map's angles they are those of the turned directions."""
    model = MetallicRoughness((0.6, 0.3, 0.2), 0.0, 0.6)
    made = factored(model, "factored", terms=4).factors
    sines = np.linspace(0, 0.5, 500)
    found, view = tilted_factors(made, sines)
    wi, wo = draw_cosine_weighted(400, torch.Generator().manual_seed(1))
    np.testing.assert_allclose(view.upright(found.terms), found.view)
    weight = (wi[:, 2] * wo[:, 2])[:, None]
    expected = made.evaluate(wi, wo)
    assert float(((found.evaluate(wi, wo) - expected) * weight).norm() / (expected * weight).norm()) < 0.03
    assert found.cosine
    assert found.weights[0] == 1
    assert made.terms < found.terms <= 4 * made.terms
    # One point under one texel of light each, tilted.
    turn = rotation(0.3, -0.2)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    inside = (wi.numpy() @ turn.T)[:, 2] > 0
    tuples = np.zeros((len(wi), found.terms, 3), np.float32)
    g = torch.from_numpy(found.light).permute(1, 2, 0).double()
    tuples[:] = look_up(g, wi)[..., None].numpy()
    frames = np.broadcast_to(np.eye(3), (len(wi), 3, 3))
    corners = np.repeat(np.arange(len(wi))[:, None], 3, 1)
    shares, normals = np.broadcast_to([1.0, 0, 0], corners.shape), np.broadcast_to(turn[2], corners.shape)
    got, tinted = view.light(tuples, frames, corners, shares, normals, wo.numpy(), found.tinted_terms)
    local = [torch.from_numpy(each.numpy() @ turn.T) for each in (wi, wo)]
    wanted = (made.evaluate(*local) * local[0][:, 2:].clamp_min(0)).numpy()
    seen = local[1][:, 2].numpy() > 0.2
    assert not tinted.any()
    cosine = wo[:, 2:].numpy()
    assert relative((got * cosine)[seen & inside], (wanted * cosine)[seen & inside]) < 0.12
    assert relative(got[seen].sum(0, keepdims=True), wanted[seen].sum(0, keepdims=True)) < 0.01


def test_nodes_of_tilts_lie_in_the_disc() -> None:
    nodes = np.hypot(*np.array(tilt_nodes(0.97)).T)
    assert nodes.max() == pytest.approx(0.99)
    assert np.hypot(*np.array(tilt_nodes(0.5)).T).max() == pytest.approx(0.575)


@pytest.mark.slow
def test_errors_are_of_the_mapped_surface(wavy: Case) -> None:
    scene, objects = wavy
    stages = ("terms", "maps", "normals", "lobe", "suns", "bounce", "truncation", "together", "rim", "picture")
    found = scene_errors(scene, objects, 16, stages)[0]
    assert found is not None
    # `normals` has the place of the terms and the maps.
    assert set(found.errors) == {*stages} - {"terms", "maps"}
    assert max(found.errors[stage] for stage in ("normals", "lobe", "truncation")) < 0.02
    assert found.errors["suns"] < 0.03
    assert found.errors["together"] < 0.06
    assert found.errors["picture"] < 0.12
    # Terms as if nothing were tilted are wrong, and so are the normals turned the other way.
    other = objects[0].tilted
    assert other is not None
    reach = tuple(replace(each, tilted=replace(other, reach=2.0) if each.bumps else None) for each in objects)
    wrong = scene_errors(scene, reach, 16, ("normals",))[0]
    assert wrong is not None
    assert wrong.errors["normals"] > 3 * found.errors["normals"]


def test_light_between_surfaces_follows_the_map(wavy: Case) -> None:
    scene, objects = wavy
    factors, tilted_view = objects[0].transport.factors, objects[0].tilted
    assert tilted_view is not None
    assert factors.bounced > 0
    assert tilted_view.entries[:, 0].max() == factors.terms - 1
    assert tilted_view.entries[:, 1].max() == len(tilted_view.view) - 1
    flat = replace(tilted_view, entries=tilted_view.entries[tilted_view.entries[:, 0] < factors.direct])
    lit = objects[0].lit(cube.environment_cube(scene.file.light, 8))
    points = lit.vertex_points(scene.file.cameras[0].eye)
    whole, direct = (
        replace(lit, tilted=each).terms_at(points, scene.file.cameras[0].eye) for each in (tilted_view, flat)
    )
    under = objects[0].mesh.normals[:, 1] < -0.4
    # What the ground sends from below.
    assert (whole - direct)[under & (points.wo[:, 2] > 0.2)].mean() > 0.01


def test_stored_and_read(wavy: Case, tmp_path: Path) -> None:
    scene, objects = wavy
    result = RelightResult.of(scene.file, objects, {})
    result.save(tmp_path / "relit")
    back, eye = open_relit(tmp_path / "relit"), scene.file.cameras[0].eye
    for one, other in zip(result.shade("studio", eye, True), back.shade("studio", eye, True), strict=True):
        np.testing.assert_array_equal(one, other)
    assert back.objects[0].nbytes == result.objects[0].nbytes
    # Vertices have the map's normals too.
    flat = replace(result, objects=tuple(replace(each, bumps=None, tilted=None) for each in result.objects))
    assert relative(flat.shade("studio", eye)[0], result.shade("studio", eye)[0]) > 0.05


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("normal_map", np.zeros((4, 4, 3), np.float32)),
        ("normal_map", np.full((4, 4, 3), (0, 0, -1), np.float32)),
        ("tangents", np.zeros((3, 4))),
        ("tilts", np.zeros((5, 5, 1), np.float32)),
        ("tilt_entries", np.array([[0, 0, 9999]], np.int32)),
        ("tilt_view", None),
    ],
)
def test_damaged_maps_are_refused(wavy: Case, tmp_path: Path, name: str, value: np.ndarray | None) -> None:
    scene, objects = wavy
    RelightResult.of(scene.file, objects, {}).save(tmp_path / "relit")
    file, key = tmp_path / "relit" / "relight.npz", f"object_0_{name}"
    arrays, header = read_archive(file)
    arrays = {one: array for one, array in arrays.items() if one != key} | ({} if value is None else {key: value})
    write_archive(file, header, arrays)
    with pytest.raises(BadInput, match=key):
        open_relit(tmp_path / "relit")


@pytest.mark.slow
def test_a_plan_has_a_separate_lobe_and_tilted_terms(tmp_path: Path) -> None:
    written(tmp_path / "part.glb", waves(), 0.0, 0.4)
    text = SCENE.format(lines="", more="", bounces=0).replace("kept = 384\nbounces = 0\n", "")
    (tmp_path / "scene.toml").write_text(text + "[tolerance]\nreflected = 0.1\n")
    choice = open_relight_scene(read_relight_scene(tmp_path / "scene.toml")).choices[0]
    assert choice.material.lobe is not None
    assert choice.material.tilted is not None
    assert choice.material.factors.cosine


def test_normals_are_read_bilinearly_and_repeat() -> None:
    vectors = np.array([[(0.6, 0, 0.8), (0, 0, 1)], [(0, 0.6, 0.8), (0, 0, 1)]], np.float32)
    uv = np.array([[0.25, 0.25], [1.75, 0.25], [-0.75, -1.25]])
    bumps = SurfaceNormals(vectors, uv, np.array([[1.0, 0, 0, 1]] * 2 + [[1.0, 0, 0, -1]]))
    up = np.tile([0.0, 0, 1], (3, 1))
    # The binormal is n × t, or against it.
    np.testing.assert_allclose(bumps.at_vertices(up), [(0.6, 0, 0.8), (0, 0, 1), (0, -0.6, 0.8)], atol=1e-6)
    middle = bumps.between(np.array([[0, 1, 1]]), np.array([[1.0, 0, 0]]), np.array([[0.0, 0.6, 0.8]]))
    np.testing.assert_allclose(middle, [(0.6, 0.48, 0.64)], atol=1e-6)
    assert bumps.reach == pytest.approx(0.6)
