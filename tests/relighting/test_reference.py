"""Mitsuba's direct illumination at vertices, against closed forms and quadrature; it needs the extra `mitsuba`."""

import math
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import torch
from mitsuba_cases import factorization, random_texture, saved, searched, variant
from rgl_files import rough, write_tensors

import homofact
from homofact.brdf.analytic import Lambert
from homofact.brdf.formats.rgl import load
from homofact.brdf.materials import material
from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput, MissingDependency
from homofact.files import extras
from homofact.meshes import shapes
from homofact.meshes.tangents import frames
from homofact.relighting.reference import Estimate, Geometry, picture, vertex_radiance
from homofact.rendering.light import EnvironmentMap
from homofact.scene.cameras import Camera
from homofact.scene.lighting import solid_angles, texel_directions

WHITE = Lambert((1.0, 0.5, 0.25))
BRUSHED = material("ashikhmin-shirley-wang").model


@pytest.fixture
def mi() -> Any:
    """Mitsuba, or the test is skipped."""
    return variant("llvm_ad_rgb", register=False)


needs_mitsuba = pytest.mark.usefixtures("mi")


def of(mesh: shapes.Mesh, tangents: np.ndarray | None = None) -> Geometry:
    return Geometry(mesh.positions, mesh.normals, mesh.triangles, tangents)


def one_texel(rows: int, row: int, column: int, turn: float = 0.0) -> EnvironmentMap:
    radiance = torch.zeros(rows, 2 * rows, 3, dtype=torch.float64)
    radiance[row, column] = torch.tensor([100.0, 50.0, 20.0])
    return EnvironmentMap(radiance, turn)


def studio(turn: float = 0.0) -> EnvironmentMap:
    """Soft light that differs in all directions."""
    w = texel_directions(16, 32)
    level = (2 * (w @ torch.tensor([0.5, 0.7, 0.5], dtype=torch.float64)) - 1).exp()
    colour = torch.tensor([1.0, 0.8, 0.6], dtype=torch.float64)
    return EnvironmentMap((level[:, None] * colour).reshape(16, 32, 3), turn)


def lit(environment: EnvironmentMap, times: int) -> tuple[np.ndarray, np.ndarray]:
    """(directions (N, 3), radiance times solid angle (N, 3)) of every texel in times² parts."""
    rows, columns, _ = environment.radiance.shape
    w = texel_directions(rows * times, columns * times, environment.turn)
    radiance = environment.radiance.repeat_interleave(times, 0).repeat_interleave(times, 1).reshape(len(w), -1)
    return w.numpy(), (radiance * solid_angles(rows * times, columns * times)[:, None]).numpy()


class Swapped:
    """Light and viewer exchanged: Mitsuba's `measured` takes the viewer for the file's ωi."""

    nbytes, fetches = 0, 0

    def __init__(self, reflectance: Reflectance) -> None:
        self.channels, self.inner = reflectance.channels, reflectance

    def evaluate(self, wi: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
        return self.inner.evaluate(wo, wi)


def off(found: Estimate, expected: np.ndarray) -> float:
    """Relative RMS of the difference over what is seen."""
    wrong = (found.radiance - expected)[found.seen]
    return math.sqrt(float((wrong**2).sum() / (np.broadcast_to(expected, found.radiance.shape)[found.seen] ** 2).sum()))


@needs_mitsuba
def test_a_white_sphere_in_a_furnace_shines_like_it() -> None:
    found = vertex_radiance(of(shapes.sphere(12)), WHITE, EnvironmentMap.constant(2.0), (0, 1, 4), 256, 4)
    assert 0.3 < found.seen.mean() < 0.5
    assert off(found, np.array([2.0, 1.0, 0.5])) < 2.5 * found.noise
    assert found.noise < 0.003
    assert not found.radiance[~found.seen].any()
    # The error stated is the error made.
    wrong = (found.radiance / [2.0, 1.0, 0.5] - 1)[found.seen][:, 0]
    assert float(wrong.std()) == pytest.approx(float((found.error[found.seen][:, 0] ** 2).mean() ** 0.5) / 2, rel=0.25)


@needs_mitsuba
@pytest.mark.parametrize("turn", [0.0, 1.1])
def test_a_white_sphere_under_one_texel_has_its_irradiance(turn: float) -> None:
    sphere = shapes.sphere(12)
    sky = one_texel(16, 4, 18, turn)
    found = vertex_radiance(of(sphere), WHITE, sky, (0, 1, 4), 256, 2)
    w, flux = lit(sky, 8)
    irradiance = np.maximum(sphere.normals @ w.T, 0) @ flux
    # The texel's edges are blurred by 1/16 of it, and the sphere is a polyhedron that shades its own terminator.
    assert off(found, irradiance * [1.0, 0.5, 0.25] / math.pi) < 0.003


def box_on_ground() -> tuple[Geometry, list[np.ndarray]]:
    """A ground of 7 × 7 vertices and a block that stands beside its middle; the block's faces as polygons (4, 3)."""
    ground = shapes.ground(1.5, 0.0, 6)
    low, high = np.array([0.3, -0.2, -2.0]), np.array([0.9, 0.8, 2.0])
    corner = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    positions, normals, triangles = [ground.positions], [ground.normals], [ground.triangles]
    first, faces = len(ground.positions), []
    for quad in quads:
        face = corner[list(quad)]
        normal = np.cross(face[1] - face[0], face[2] - face[0])
        positions.append(face)
        normals.append(np.tile(normal / np.linalg.norm(normal), (4, 1)))
        triangles.append(first + np.array([[0, 1, 2], [0, 2, 3]]))
        faces.append(face)
        first += 4
    return Geometry(np.concatenate(positions), np.concatenate(normals), np.concatenate(triangles)), faces


def polygon_irradiance(point: np.ndarray, face: np.ndarray) -> float:
    """∫ cosθ over the polygon as it is seen from a point of the plane y = 0 (Lambert 1760); 0 from behind."""
    away = np.maximum(face - point, [-np.inf, 0, -np.inf])
    normal = np.cross(face[1] - face[0], face[2] - face[0])
    if (face[0] - point) @ normal >= 0:
        return 0.0
    unit = away / np.linalg.norm(away, axis=1, keepdims=True)
    total = 0.0
    for a, b in zip(unit, np.roll(unit, -1, 0), strict=True):
        across = np.cross(a, b)
        total += math.acos(np.clip(a @ b, -1, 1)) * across[1] / max(float(np.linalg.norm(across)), 1e-300) / 2
    return abs(total)


@pytest.mark.slow
@needs_mitsuba
def test_a_block_takes_away_the_light_that_it_hides() -> None:
    geometry, faces = box_on_ground()
    found = vertex_radiance(geometry, Lambert((1.0, 1.0, 1.0)), EnvironmentMap.constant(1.0), (-3, 4, 0.5), 576, 4)
    open_ground = np.nonzero((np.arange(len(geometry.positions)) < 49) & (geometry.positions[:, 0] < 0.2))[0]
    assert found.seen[open_ground].all()
    # What stands behind the block, and inside it, is not seen.
    behind = np.nonzero((np.arange(len(geometry.positions)) < 49) & (geometry.positions[:, 0] > 0.4))[0]
    assert not found.seen[behind[geometry.positions[behind, 0] < 1.2]].any()
    clipped = [np.where(face < [-9, 0, -9], np.where([False, True, False], 0.0, face), face) for face in faces]
    expected = np.array([
        1 - sum(polygon_irradiance(geometry.positions[row], face) for face in clipped) / math.pi for row in open_ground
    ])  # fmt: skip
    assert expected.min() < 0.75
    assert expected.max() > 0.95
    wrong = found.radiance[open_ground, 0] - expected
    assert float(np.abs(wrong).max()) < 4 * float(found.error[open_ground, 0].max()) < 0.02


@pytest.mark.slow
@needs_mitsuba
def test_rays_start_the_offset_above_the_vertex_and_no_more() -> None:
    """A plate as small as a crumb, 0.001 over the vertex, hides the zenith from below it alone."""
    ground, low = shapes.ground(1.0, 0.0, 2), 0.001
    crumb = np.array([[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]]) * 5e-4 + [0, low, 0]
    first = len(ground.positions)
    geometry = Geometry(
        np.concatenate((ground.positions, crumb)),
        np.concatenate((ground.normals, np.tile((0.0, 1.0, 0.0), (4, 1)))),
        np.concatenate((ground.triangles, first + np.array([[0, 1, 2], [0, 2, 3]]))),
    )
    middle = np.array([int(np.abs(ground.positions).sum(1).argmin())])
    zenith = torch.zeros(8, 16, 3, dtype=torch.float64)
    zenith[0] = 1.0
    sky, place = EnvironmentMap(zenith), (5.0, 0.4, 0.0)
    below, above = (
        vertex_radiance(geometry, WHITE, sky, place, 64, 2, offset=offset, which=middle)
        for offset in (0.95 * low, 1.05 * low)
    )
    assert below.seen.all()
    assert not below.radiance.any()
    # ∫ cosθ up to 22.5° over π.
    assert above.radiance[0, 0] == pytest.approx(math.sin(math.radians(22.5)) ** 2, rel=0.02)


@pytest.mark.slow
@needs_mitsuba
@pytest.mark.parametrize("turned", [False, True], ids=["Wang's tangents", "tangents given"])
def test_an_anisotropic_sphere_has_its_highlight_along_its_tangents(turned: bool) -> None:
    sphere = shapes.sphere(8)
    wangs = frames(sphere.normals)
    tangents = wangs[:, 1] + 0.5 * wangs[:, 2] if turned else None
    axes = np.stack((wangs[:, 1], -wangs[:, 0], wangs[:, 2]), 1) if turned else wangs
    sky, place = studio(0.4), np.array([0.0, 1.0, 4.0])
    found = vertex_radiance(of(sphere, tangents), BRUSHED, sky, tuple(place), 576, 4)
    w, flux = lit(sky, 8)
    toward = place - sphere.positions
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    expected = np.zeros_like(found.radiance)
    for row in np.nonzero(found.seen)[0]:
        wi = torch.from_numpy(w @ axes[row].T)
        wo = torch.from_numpy(axes[row] @ toward[row]).expand_as(wi)
        expected[row] = ((BRUSHED.evaluate(wi, wo) * wi[:, 2:].clamp_min(0)).numpy() * flux).sum(0)
    assert found.noise < 0.01
    assert off(found, expected) < 0.01 + 2 * found.noise


@pytest.mark.slow
@needs_mitsuba
def test_measured_and_fitted_materials_shine_as_their_reflectance_does(tmp_path: Path) -> None:
    """Mitsuba's own `measured`, and homofact's traced fit, beside the evaluation through memory."""
    sphere, sky = of(shapes.sphere(6)), studio()
    path = write_tensors(tmp_path / "rough_rgb.bsdf", rough((0.0,)))
    fit = saved(factorization((searched("in-out"), random_texture(6, 6))), tmp_path)
    for place, reflectance in ((path, Swapped(load(path))), (fit, homofact.load(fit))):
        own = vertex_radiance(sphere, place, sky, (0, 1, 4), 256, 4)
        asked = vertex_radiance(sphere, reflectance, sky, (0, 1, 4), 256, 4, seed=1)
        assert own.noise < 0.02
        assert off(own, asked.radiance) < 2 * math.hypot(own.noise, asked.noise)


@pytest.mark.slow
@needs_mitsuba
def test_the_same_seed_gives_the_same_bits() -> None:
    runs = [vertex_radiance(of(shapes.sphere(4)), WHITE, studio(), (0, 0, 3), 16, 2, seed=s) for s in (3, 3, 4)]
    assert np.array_equal(runs[0].radiance, runs[1].radiance)
    assert not np.array_equal(runs[0].radiance, runs[2].radiance)


@pytest.mark.slow
@needs_mitsuba
def test_some_vertices_are_those_of_all() -> None:
    sphere, which = of(shapes.sphere(4)), np.array([7, 2, 5, 11])
    whole = vertex_radiance(sphere, WHITE, studio(), (0, 1, 4), 1024, 4)
    some = vertex_radiance(sphere, WHITE, studio(), (0, 1, 4), 1024, 4, which=which)
    assert np.array_equal(some.seen, whole.seen[which])
    assert some.radiance == pytest.approx(whole.radiance[which], abs=0.03)
    assert 0 < some.seen.sum() < 4


@pytest.mark.slow
@needs_mitsuba
@pytest.mark.parametrize("tangent", [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
def test_a_picture_shows_what_the_vertices_send(tangent: tuple[float, float, float]) -> None:
    """A plane from far away: every pixel sees the same."""
    ground = shapes.ground(1.0, 0.0, 2)
    geometry = of(ground, np.tile(tangent, (len(ground.positions), 1)))
    eye = (0.0, 300.0, 400.0)
    camera = Camera(eye, field=0.1, pixels=(12, 12))
    shown = picture(geometry, BRUSHED, studio(), camera, 1024, 2)
    assert shown.seen.all()
    sent = vertex_radiance(geometry, BRUSHED, studio(), eye, 1024, 4)
    pixels = shown.radiance.reshape(-1, 3)
    assert pixels.mean(0) == pytest.approx(sent.radiance.mean(0), rel=0.01)
    assert math.hypot(*(pixels.std(0) / pixels.mean(0))) < 0.1


@needs_mitsuba
def test_a_picture_says_what_is_mesh() -> None:
    camera = Camera((0.0, 0.0, 4.0), pixels=(48, 48))
    shown = picture(of(shapes.sphere(24)), WHITE, EnvironmentMap.constant(2.0), camera, 64, 2)
    # A sphere of radius 1 at distance 4 has the half angle asin(1/4) of 40°/2.
    radius = math.tan(math.asin(0.25)) / math.tan(math.radians(20)) * 24
    assert shown.seen.sum() == pytest.approx(math.pi * (radius - 0.5) ** 2, rel=0.05)
    assert np.abs(shown.radiance[shown.seen] / [2.0, 1.0, 0.5] - 1).mean() < 0.05
    assert shown.radiance[0, 0] == pytest.approx([2.0] * 3)


def tetrahedron() -> dict[str, np.ndarray]:
    corners = np.array([[1.0, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]])
    return {
        "positions": corners,
        "normals": corners / math.sqrt(3),
        "triangles": np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
    }


def test_frames_are_those_of_the_tangents_given() -> None:
    sphere = shapes.sphere(5)
    wangs = frames(sphere.normals)
    assert np.allclose(of(sphere).axes, wangs)
    # Longer, and leaning out of the surface.
    assert np.allclose(of(sphere, 3 * wangs[:, 0] + wangs[:, 2]).axes, wangs)


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("positions", np.full((4, 3), np.nan), "positions: row 0 is not finite"),
        ("positions", np.zeros((0, 3)), r"positions: found shape \(0, 3\), expected \(V, 3\)"),
        ("normals", np.ones((4, 3)), "normals: row 0 has the length 1.732, expected unit vectors"),
        ("normals", np.ones((3, 3)), r"normals: found shape \(3, 3\), expected \(4, 3\)"),
        ("tangents", np.ones((4, 2)), r"tangents: found shape \(4, 2\)"),
        ("triangles", np.zeros((0, 3), int), r"triangles: found shape \(0, 3\), expected \(T, 3\)"),
        ("triangles", np.array([[0, 1, 4]]), "triangles: found vertex 4, expected 0 to 3"),
        ("triangles", np.array([[0, 1, -1]]), "triangles: found vertex -1, expected 0 to 3"),
    ],
)
def test_arrays_that_are_no_mesh(name: str, values: np.ndarray, words: str) -> None:
    with pytest.raises(BadInput, match=words):
        Geometry(**(tetrahedron() | {name: values}))


@needs_mitsuba
def test_what_is_refused(tmp_path: Path) -> None:
    geometry, sky = Geometry(**tetrahedron()), EnvironmentMap.constant()
    refused: list[tuple[dict[str, Any], str]] = [
        ({"samples": 0}, "samples: found 0, expected at least 1"),
        ({"repeats": 1}, "repeats: found 1, expected at least 2"),
        ({"which": np.array([0, 4])}, "which: found vertex 4, expected 0 to 3"),
    ]
    for arguments, words in refused:
        with pytest.raises(BadInput, match=words):
            vertex_radiance(geometry, WHITE, sky, (0, 0, 4), **arguments)
    with pytest.raises(BadInput, match="found 2 channels, expected R, G, B or one alone"):
        vertex_radiance(geometry, Lambert((0.5, 0.5), channels=("a", "b")), sky, (0, 0, 4))
    with pytest.raises(BadInput, match=r"none\.bsdf: Mitsuba's measured refused it"):
        vertex_radiance(geometry, tmp_path / "none.bsdf", sky, (0, 0, 4))


def test_without_mitsuba_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> ModuleType:
        raise ModuleNotFoundError(f"No module named {name!r}")

    monkeypatch.setattr(extras, "import_module", absent)
    with pytest.raises(
        MissingDependency,
        match=r"^mitsuba: mitsuba is not installed, expected it",
    ):
        vertex_radiance(Geometry(**tetrahedron()), WHITE, EnvironmentMap.constant(), (0, 0, 4))
