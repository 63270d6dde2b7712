"""The sum of a lobe over the sky's cells: against sums over every texel that are written apart, and its bookkeeping."""

import math
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import torch
from relighting_cases import EYE, ball, knot, light, occluder
from slow_cases import slow_among

import homofact
from homofact.brdf.analytic import AshikhminShirley, Phong
from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.meshes.shapes import ground
from homofact.meshes.tangents import frames
from homofact.relighting import cube
from homofact.relighting.errors import relative
from homofact.relighting.factored_material import factored
from homofact.relighting.factoring import factor
from homofact.relighting.lit import LitObject
from homofact.relighting.lit_points import LitPoints
from homofact.relighting.lobe import PointSight, SeparateLobe, SurfacePoints
from homofact.relighting.lobe_light import BRIGHT, LightCells, morton_order
from homofact.relighting.lobe_table import LobeTable, lobe_table
from homofact.relighting.picture import picture, surface_points
from homofact.relighting.precompute import TransportSettings, transport
from homofact.relighting.relit_mesh import RelitMesh
from homofact.relighting.seen import SeenVertices, seen_pixels, seen_vertices
from homofact.relighting.sight import SIGHT, VertexSight, kept_sight, seen_part, sight_words, traced_sight
from homofact.relighting.tracer import Tracer
from homofact.rendering.light import EnvironmentMap
from homofact.scene.cameras import Camera
from homofact.scene.lighting import named_environment
from homofact.scene.meshes import MeshGroup

ROUND = Phong((0.3, 0.2, 0.1), (0.4,) * 3, 150)
GRAINED = AshikhminShirley((0.3, 0.2, 0.1), (0.5,) * 3, nu=10, nv=100)
SIZE = 32


@cache
def studio(size: int = SIZE) -> np.ndarray:
    return cube.environment_cube(named_environment("studio"), size)


@cache
def lamp() -> np.ndarray:
    """A texel that holds half of the light, in a dim sky."""
    found = light(SIZE)
    found[2, SIZE // 3, SIZE // 2] = 6000
    return found


@cache
def lobe_of(material: Reflectance) -> LobeTable:
    return lobe_table(material)


@cache
def apart(material: Reflectance) -> SeparateLobe:
    return SeparateLobe(lobe_of(material), VertexSight.of(traced_sight(knot(), occluder(), SIZE)))


@cache
def seen(count: int = 40) -> SeenVertices:
    return seen_vertices(knot(), ROUND, occluder(), EYE, count)


def points(own: SeenVertices) -> SurfacePoints:
    return SurfacePoints.at_vertices(own.rows, own.wo, own.which)


@pytest.mark.parametrize("material", [ROUND, GRAINED], ids=["round", "grained"])
@pytest.mark.parametrize("sky", slow_among(["studio", "lamp"], "studio"))
def test_a_sum_is_that_of_every_texel(material: Reflectance, sky: str) -> None:
    """Of a lamp of one texel, which lights half of it, and of soft boxes: over vertices that the eye sees."""
    radiance = studio() if sky == "studio" else lamp()
    exact = seen().dense(radiance, SIZE, lobe_of(material))
    found = apart(material).at(points(seen()), apart(material).cells(radiance))
    assert relative(found, exact) < 0.025
    # Vertices that are turned away send nothing.
    turned = replace(points(seen()), wo=seen().wo * (1, 1, -1))
    assert not apart(material).at(turned, apart(material).cells(radiance)).any()


def test_all_vertices_are_those_one_by_one() -> None:
    cells, rows = LightCells.of(studio()), frames(knot().normals)
    every = apart(ROUND).at_vertices(knot().positions, rows, EYE, cells)
    assert every[seen().which] == pytest.approx(apart(ROUND).at(points(seen()), cells), rel=1e-4, abs=1e-6)
    with pytest.raises(BadInput):
        apart(ROUND).at_vertices(knot().positions, rows, (0, math.nan, 0), cells)


def test_even_light_gives_the_albedo_of_the_lobe() -> None:
    """On an open plane under radiance 1: Σ lobe cosθi dω over the hemisphere, by a quadrature of its own."""
    flat = ground(1.0, 0.0, 2)
    sight = VertexSight.of(traced_sight(flat, MeshGroup([flat]).occluder, SIZE))
    cells = LightCells.of(np.ones((6, SIZE, SIZE, 3)))
    w = cube.directions(256).reshape(-1, 3)
    solid = np.tile(cube.solid_angles(256).reshape(-1), 6)
    for theta in (0.1, 0.9, 1.3):
        wo = np.array([math.sin(theta), 0.0, math.cos(theta)])
        up = w[:, 2] > 0
        wi = torch.from_numpy(w[up])
        f = lobe_of(ROUND).evaluate(wi, torch.from_numpy(wo).expand(len(wi), 3)).numpy()
        albedo = (f * (w[up, 2] * solid[up])[:, None]).sum(0)
        point = SurfacePoints.at_vertices(frames(flat.normals[:1]), wo[None], np.array([0]))
        found = SeparateLobe(lobe_of(ROUND), sight).at(point, cells)[0]
        assert found == pytest.approx(albedo, rel=0.02)


def test_between_vertices_what_is_seen_is_mixed() -> None:
    """The sum is linear in what a point sees: by shares of its corners' sums with its own frame."""
    own, cells = points(seen()), LightCells.of(studio())
    corners = np.stack((own.corners[:, 0], np.roll(own.corners[:, 0], 1), np.roll(own.corners[:, 0], 2)), 1)
    shares = np.tile([0.5, 0.3, 0.2], (len(corners), 1))
    mixed = apart(ROUND).at(SurfacePoints(own.frames, own.wo, corners, shares), cells)
    alone = [
        apart(ROUND).at(SurfacePoints.at_vertices(own.frames, own.wo, corners[:, k]), cells).astype(float)
        for k in range(3)
    ]
    assert mixed == pytest.approx(0.5 * alone[0] + 0.3 * alone[1] + 0.2 * alone[2], rel=1e-3, abs=1e-5)
    assert own.mixed(knot().positions) == pytest.approx(knot().positions[own.corners[:, 0]])


@pytest.mark.parametrize("size", [8, 16, 64])
def test_cells_hold_all_the_light_on_every_level(size: int) -> None:
    radiance = light(size)
    cells = LightCells.of(radiance)
    solid = np.tile(cube.solid_angles(size), (6, 1, 1))
    flux = (radiance * solid[..., None]).sum((0, 1, 2))
    levels = int(math.log2(size // 8)) + 1
    assert len(cells.starts) == levels
    edges = [*cells.starts.tolist(), len(cells.light)]
    bright = (radiance.mean(-1) * solid).reshape(6, -1) > BRIGHT * flux.mean()
    for level, (first, last) in enumerate(pairwise(edges)):
        extent = cells.places[first:last, 3].astype(float)
        assert (extent**2).sum() == pytest.approx(4 * math.pi, rel=1e-5)
        assert (cells.light[first:last] * extent[:, None] ** 2).sum(0) == pytest.approx(flux, rel=1e-4)
        assert np.linalg.norm(cells.places[first:last, :3], axis=1) == pytest.approx(1, abs=1e-5)
        within = bright[:, morton_order(size)].reshape(6, -1, 4**level).any(2).reshape(-1)
        assert np.array_equal(extent < 0, within)


def test_a_cell_lies_in_the_middle_of_its_parts() -> None:
    cells = LightCells.of(studio(16))
    fine = cells.places[: cells.starts[1], :3].astype(float).reshape(-1, 4, 3).mean(1)
    coarse = cells.places[cells.starts[1] :, :3]
    assert (fine / np.linalg.norm(fine, axis=1, keepdims=True) * coarse).sum(1).min() > 1 - 1e-3


def test_mortons_order_keeps_quarters_together() -> None:
    assert morton_order(4).tolist() == [0, 1, 4, 5, 2, 3, 6, 7, 8, 9, 12, 13, 10, 11, 14, 15]
    assert sorted(morton_order(32).tolist()) == list(range(32 * 32))


@pytest.mark.parametrize("size", [8, 16, 64])
def test_what_is_seen_are_the_tracers_bits(size: int) -> None:
    side = min(size, SIGHT)
    which = np.array([3, 17, 100])
    words = traced_sight(knot(), occluder(), size, which)
    assert words.shape == (3, sight_words(size))
    bits = np.unpackbits(words.view(np.uint8), axis=1, bitorder="little").reshape(3, 6, -1)
    tracer = Tracer(knot(), occluder(), side)
    for row, vertex in zip(bits, which.tolist(), strict=True):
        seen_texels = np.zeros((6, side * side), bool)
        seen_texels[:, morton_order(side)] = row > 0
        assert np.array_equal(seen_texels.reshape(-1), tracer.visible(vertex) > 0)
    assert np.array_equal(traced_sight(knot(), occluder(), size)[which], words)


@pytest.mark.parametrize("size", [8, 16, 64])
def test_words_that_are_stored_apart_are_all_there(size: int) -> None:
    """Random, empty and full words; the part of every cell that the kernel reads is that of the plain bits."""
    rng = np.random.default_rng(size)
    plain = rng.integers(0, 2**64, (5, sight_words(size)), np.uint64)
    kind = rng.integers(0, 3, plain.shape)
    plain[kind == 0], plain[kind == 1] = 0, 2**64 - 1
    stored = VertexSight.of(plain)
    assert np.array_equal(stored.plain, plain)
    assert stored.shape == plain.shape
    assert stored.nbytes == 5 * 6 * (8 + 8 + 4) + 8 * int((kind == 2).sum())
    bits = np.unpackbits(plain.view(np.uint8), axis=1, bitorder="little").reshape(5, 6, size * size)
    for vertex, face, cell in ((0, 0, 1), (4, 5, 4), (2, 3, 16), (1, 2, 64), (3, 1, size * size)):
        parts = bits[vertex, face].reshape(-1, min(cell, size * size)).mean(1)
        found = [
            seen_part(stored.arrays, vertex, face, k * (size * size // len(parts)), cell) for k in range(len(parts))
        ]
        assert found == pytest.approx(parts)


def test_what_is_seen_is_kept_for_a_later_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    alone = MeshGroup([ball()]).occluder
    first = kept_sight(ball(), alone, 8, tmp_path)
    monkeypatch.setattr("homofact.relighting.sight.traced_sight", None)
    assert np.array_equal(kept_sight(ball(), alone, 8, tmp_path), first)
    # Of another cube map, among other surfaces, of another mesh.
    for mesh, among, size in ((ball(), alone, 16), (ball(), occluder(), 8), (knot(), occluder(), 8)):
        with pytest.raises(BadInput) as caught:
            kept_sight(mesh, among, size, tmp_path)
        assert str(caught.value.where).endswith("sight.npz")


@pytest.mark.parametrize("size", [8, 16])
def test_transport_takes_what_is_seen_instead_of_rays(size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    words = traced_sight(knot(), occluder(), size)
    sight, order = VertexSight.of(words), morton_order(size)
    bits = np.unpackbits(words.view(np.uint8), axis=1, bitorder="little").reshape(len(words), 6, -1)
    for vertex in (0, 17, 100):
        seen = np.zeros((6, size * size), np.float32)
        seen[:, order] = bits[vertex]
        assert np.array_equal(sight.texels(vertex), seen.reshape(-1))
    given = factor(Phong((0.3, 0.2, 0.1), (0.4,) * 3, 30), 2, map_size=8), TransportSettings(size, kept=40), occluder()
    traced = transport(knot(), *given)
    coarse, twice = (
        transport(knot(), given[0], TransportSettings(side, rays=rays, kept=40), occluder(), sight=known)
        for side, rays, known in ((8 if size == 16 else 16, 1, sight), (size, 2, sight))
    )
    monkeypatch.setattr(Tracer, "visible", None)
    taken = transport(knot(), *given, sight=sight)
    for name in ("start", "index", "number", "scale"):
        assert np.array_equal(getattr(taken, name), getattr(traced, name))
    # What it was traced for is another cube map, or has one ray per texel: rays are sent.
    assert coarse.settings.cube != size
    assert not np.array_equal(twice.scale, traced.scale)


@pytest.mark.slow
def test_a_mesh_relit_with_its_lobe_apart_is_right_where_terms_are_not() -> None:
    """A lobe that 4 terms lose: against the dense sum of all of f; and light changes at once or stepwise."""
    radiance = studio()
    exact = seen().dense(radiance, SIZE, ROUND)
    made = homofact.relight(knot(), ROUND, lobe="separate", error=0.02, cube=SIZE, kept=6 * SIZE**2)
    few = homofact.relight(knot(), ROUND, terms=4, cube=SIZE, kept=6 * SIZE**2)
    made.relight(radiance)
    few.relight(radiance)
    assert made.shade(EYE)[seen().which] == pytest.approx(made.shade(EYE)[seen().which])
    assert relative(made.shade(EYE)[seen().which], exact) < 0.025
    assert relative(few.shade(EYE)[seen().which], exact) > 0.2
    # The lobe has the light as soon as it is asked for; the factors step by step.
    at_once = made.shade(EYE)
    made.relight(light(SIZE))
    made.ask(radiance)
    while made.step(512):
        pass
    assert made.shade(EYE) == pytest.approx(at_once, rel=1e-3, abs=1e-4)
    assert homofact.relight(knot(), ROUND, terms=4, cube=8).lobe is None


@pytest.mark.slow
def test_in_the_dark_a_mesh_is_black() -> None:
    made = homofact.relight(ball(), ROUND, lobe="separate", cube=8, kept=10)
    assert isinstance(made, RelitMesh)
    assert not made.shade(EYE).any()


def test_a_picture_has_the_lobe_at_every_pixel() -> None:
    """Pixels that see the knot alone: the sum at their own points, whatever the light between vertices is."""
    made = factored(ROUND, "separate", terms=1)
    moved = transport(knot(), made.factors, TransportSettings(SIZE, kept=200), occluder())
    lit = LitObject.of(moved, None, apart(ROUND), studio())
    camera = Camera(EYE, pixels=(160, 120))
    sky = EnvironmentMap(named_environment("studio").radiance, name="studio")
    shown, cover = picture([knot()], [lit.terms(EYE)], occluder(), camera, sky, [lit])
    plain, _ = picture([knot()], [lit.terms(EYE)], occluder(), camera, sky)
    inside = cover == 1
    rays = camera.rays(2)[inside].reshape(-1, 3)
    triangle, shares = occluder().first(np.array(EYE)[None], rays)
    points = surface_points(knot(), triangle, shares, -rays)
    every = lit.lobe_at(points, LitPoints.on(knot(), points, occluder().offset).sight(occluder())).reshape(-1, 4, 3)
    close = 0.01 * float(every.mean())
    # Where the pixel is not at an outline one of its rays stands for all.
    smooth = (points.wo[:, 2].reshape(-1, 4) >= 0.3).all(1)
    assert smooth.any()
    assert (shown - plain)[inside][smooth] == pytest.approx(every[smooth, 0], rel=0.01, abs=close)
    # At an outline each ray has its own.
    steep = (points.wo[:, 2].reshape(-1, 4) < 0.3).all(1)
    assert np.ptp(every[steep], axis=1).max() > 0.01
    assert (shown - plain)[inside][steep] == pytest.approx(every[steep].mean(1), rel=0.01, abs=close)


def test_rays_find_where_the_mirror_image_of_a_shadow_ends() -> None:
    """Between vertices that see different parts of a lamp: as if each pixel had been traced by itself."""
    camera, sharp = Camera(EYE, pixels=(48, 36)), Phong((0.3, 0.2, 0.1), (0.4,) * 3, 2000)
    found = seen_pixels([knot()], 0, sharp, occluder(), camera, None)
    lobe, cells = apart(sharp), LightCells.of(studio())
    flat = found.points.mesh
    sight = PointSight(flat.positions + occluder().offset * flat.normals, occluder())
    own = VertexSight.of(traced_sight(flat, occluder(), SIZE))
    at = SurfacePoints.at_vertices(found.mixture.frames, found.mixture.wo, np.arange(len(flat.positions)))
    exact = replace(lobe, sight=own).at(at, cells)
    mixed, traced = lobe.at(found.mixture, cells), lobe.at(found.mixture, cells, sight)
    assert relative(mixed, exact) > 0.08
    assert relative(traced, exact) < 0.02
    # At vertices nothing is between, and the numbers stay.
    vertices = SurfacePoints.all_vertices(knot().positions, frames(knot().normals), EYE)
    nowhere = PointSight(np.zeros((len(vertices.frames), 3)), occluder())
    assert np.array_equal(lobe.at(vertices, cells), lobe.at(vertices, cells, nowhere))


def test_a_normal_that_is_turned_away_is_bent_back() -> None:
    """A little behind the horizon: it is seen at grazing angles; one that is seen stays."""
    normal = knot().normals[knot().triangles[:5, 0]]
    tangent = frames(normal)[:, 0]
    for tilt in (-0.1, 0.3):
        towards = math.cos(tilt) * tangent + math.sin(tilt) * normal
        found = surface_points(knot(), np.arange(5), np.tile([1.0, 0, 0], (5, 1)), towards)
        assert found.wo[:, 2] == pytest.approx(max(math.sin(tilt), 0.02), abs=1e-3)
