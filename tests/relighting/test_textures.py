"""Base-colour textures in relit scenes: parts that add up, tables and terms in two parts, pictures, errors, folders."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from coarse import coarse_terms
from textured import LINEAR, MEAN, written

from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.brdf.tinted import Tinted, values_under
from homofact.errors import BadInput
from homofact.files.archive import read_archive, write_archive
from homofact.geometry.directions import draw_cosine_weighted
from homofact.relighting.build import RelightScene, RelitObject, open_relight_scene, relit_objects
from homofact.relighting.cube import environment_cube
from homofact.relighting.errors import relative, scene_errors
from homofact.relighting.factored_material import ERROR, factored
from homofact.relighting.lobe_table import lobe_table, sun_tables
from homofact.relighting.result import RelightResult, open_relit
from homofact.relighting.scene_file import read_relight_scene
from homofact.relighting.seen import SeenPixels, seen_pixels
from homofact.scene.tint import SurfaceTint

SCENE = """
[[object]]
mesh = "{mesh}"
lobe = "{lobe}"
terms = {terms}
[ground]
albedo = [0.5]
half = 2
steps = 8
[lighting]
named = "studio"
[[sun]]
direction = [0.5, 0.8, 0.6]
irradiance = [3.0]
radius = 3
[[camera]]
eye = [0, 0.8, 3.2]
pixels = [48, 36]
[transport]
cube = 8
kept = 384
bounces = 1
"""
GLOSS, METAL = (0.0, 0.4), (1.0, 0.4)
MODELS = {
    "paint": MetallicRoughness(tuple(MEAN.tolist()), 0.0, 0.3),
    "metal": MetallicRoughness(tuple(MEAN.tolist()), 1.0, 0.3),
    "half": MetallicRoughness(tuple(MEAN.tolist()), 0.4, 0.5),
}


@pytest.fixture(scope="module", autouse=True)
def _coarse() -> Iterator[None]:
    with coarse_terms():
        yield


def pairs(count: int = 500) -> tuple[torch.Tensor, torch.Tensor]:
    return draw_cosine_weighted(count, torch.Generator().manual_seed(3))


def off(found: torch.Tensor, expected: torch.Tensor) -> float:
    """Relative root mean square of f cosθi cosθo."""
    wi, wo = pairs(len(found))
    cosines = (wi[:, 2] * wo[:, 2])[:, None]
    return float(((found - expected) * cosines).norm() / (expected * cosines).norm())


@pytest.mark.parametrize("name", MODELS)
def test_the_parts_of_a_material_give_every_colour(name: str) -> None:
    """f is linear in the base colour: under the tint c/mean it is the material of the colour c."""
    model = MODELS[name]
    tinted, (wi, wo) = Tinted.of(model), pairs()
    np.testing.assert_allclose(tinted.evaluate(wi, wo), model.evaluate(wi, wo), rtol=1e-9)
    for colour in LINEAR:
        expected = replace(model, base_colour=tuple(colour.tolist())).evaluate(wi, wo)
        found = values_under(tinted, torch.from_numpy(colour / MEAN), wi, wo)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(values_under(model, torch.tensor(9.0), wi, wo), model.evaluate(wi, wo))


def test_a_texture_is_read_bilinearly_and_repeats() -> None:
    rows = np.arange(12, dtype=float).reshape(2, 2, 3) + 1
    tint = SurfaceTint.of(rows, np.zeros((0, 2)))
    np.testing.assert_allclose(tint.tints.mean((0, 1)), 1, rtol=1e-6)
    mean = rows.mean((0, 1))
    at = np.array([[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.5, 0.5], [3.75, -5.25], [0.0, 0.25], [1.0, 0.25]])
    across = (rows[0, 0] + rows[0, 1]) / 2
    expected = [rows[0, 0], rows[0, 1], rows[1, 0], mean, rows[1, 1], across, across]
    np.testing.assert_allclose(tint.at(at) * mean, expected, rtol=1e-6)
    dark = rows * (1, 0, 1)
    assert (SurfaceTint.of(dark, np.zeros((0, 2))).at(at)[:, 1] == 1).all()
    with pytest.raises(BadInput, match=r"expected \(H, W, 3\)"):
        SurfaceTint.of(rows[0], np.zeros((0, 2)))


@pytest.mark.parametrize("name", ["paint", "metal"])
def test_tables_of_suns_give_every_colour(name: str) -> None:
    model, (wi, wo) = MODELS[name], pairs()
    tables = sun_tables(Tinted.of(model))
    for colour in LINEAR:
        tint = np.broadcast_to(colour / MEAN, (len(wi), 3))
        found = sum(table.evaluate(wi, wo) * torch.from_numpy(table.under(tint, wo.numpy())) for table in tables)
        assert isinstance(found, torch.Tensor)
        assert off(found, replace(model, base_colour=tuple(colour.tolist())).evaluate(wi, wo)) < 0.03


def test_the_part_of_a_lobe_that_is_tinted() -> None:
    """Of paint none: its highlight is white. Of metal all but the white edge that Fresnel's law gives it."""
    paint, metal = (lobe_table(Tinted.of(MODELS[name])).tinted for name in ("paint", "metal"))
    assert paint is not None
    assert metal is not None
    assert paint[:21].max() < 0.05
    assert metal[:7].min() > 0.99
    assert (np.diff(metal.mean(1)) < 1e-3).all()
    assert metal[-1].max() < 0.2
    table = lobe_table(Tinted.of(MODELS["metal"]))
    wi, wo = pairs()
    np.testing.assert_allclose(table.in_parts.evaluate(wi, wo), table.evaluate(wi, wo), rtol=1e-4, atol=1e-9)
    assert (table.under(np.ones((3, 3)), np.eye(3)) == 1).all()
    assert lobe_table(MODELS["metal"]).tinted is None


@pytest.mark.slow
def test_terms_of_the_two_parts_add_up(tmp_path: Path) -> None:
    reflectance, (wi, wo) = Tinted.of(MODELS["half"]), pairs()
    made = factored(reflectance, "factored", terms=4).factors
    np.testing.assert_allclose(made.in_parts.evaluate(wi, wo), made.evaluate(wi, wo), rtol=1e-6, atol=1e-9)
    assert (made.tinted, made.terms) == (4, 8)
    assert 0.5 < made.share <= 1
    assert (made.tinted_terms == (np.arange(made.terms) < made.tinted)).all()
    between = replace(made, bounced=4)
    assert between.tinted_terms[-4:].tolist() == [True, True, False, False]
    assert not replace(made, tinted=0, bounced=4).tinted_terms.any()


def test_parts_follow_the_error_of_the_whole() -> None:
    """A matte paint's gloss has much of f's energy and little of the light: few terms hold what the whole holds."""
    reflectance = Tinted.of(MetallicRoughness((0.5, 0.4, 0.3), 0.0, 0.8))
    made = factored(reflectance, "factored", map_size=16).factors
    assert made.expected_error < ERROR
    assert made.terms <= 8


def opened(
    folder: Path, kind: tuple[float, float], lobe: str, colour: int | None = None, terms: int = 3
) -> RelightScene:
    folder.mkdir(exist_ok=True)
    written(folder / "ball.glb", *kind, colour)
    (folder / "scene.toml").write_text(SCENE.format(mesh="ball.glb", lobe=lobe, terms=terms))
    return open_relight_scene(read_relight_scene(folder / "scene.toml"))


def pixels_of(scene: RelightScene, objects: tuple[RelitObject, ...]) -> tuple[SeenPixels, np.ndarray]:
    """(all pixels that see the ball, their light (S, 3))."""
    placed, camera = scene.objects[0], scene.file.cameras[0]
    meshes = [each.mesh for each in objects]
    seen = seen_pixels(meshes, 0, placed.reflectance, scene.occluder, camera, None, tint=placed.tint)
    radiance = environment_cube(scene.file.light, scene.file.settings.cube)
    return seen, objects[0].lit(radiance).between(seen.mixture, camera.eye)


Case = tuple[RelightScene, tuple[RelitObject, ...]]


@pytest.fixture(
    scope="module", params=[pytest.param(GLOSS, marks=pytest.mark.slow, id="gloss"), pytest.param(METAL, id="metal")]
)
def cases(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> list[Case]:
    """The ball with the texture, and the ball in each of its colours."""
    place, found = tmp_path_factory.mktemp("textured"), []
    for colour in (None, 0, 1):
        scene = opened(place / str(colour), request.param, "separate", colour)
        found.append((scene, relit_objects(scene)))
    return found


def test_each_half_of_a_ball_is_the_ball_of_its_colour(cases: list[Case]) -> None:
    """Under the sky, a sun and light from the ground alike; near the edges of a half the two mix."""
    (seen, found), *others = (pixels_of(*case) for case in cases)
    uv = (textured_uv(cases[0])[seen.mixture.corners] * seen.mixture.shares[..., None]).sum(1)
    for colour, (other, expected) in enumerate(others):
        np.testing.assert_array_equal(seen.numbers, other.numbers)
        inside = np.flatnonzero((np.abs(uv[:, 0] - (0.25, 0.75)[colour]) < 0.2) & (np.abs(uv[:, 1] - 0.5) < 0.4))
        assert len(inside) > 60
        assert relative(found[inside], expected[inside]) < 0.04
        # The other colour is another.
        assert relative(found[inside], others[1 - colour][1][inside]) > 0.3


def textured_uv(case: Case) -> np.ndarray:
    tint = case[0].objects[0].tint
    assert tint is not None
    return tint.uv


@pytest.mark.slow
def test_errors_are_of_the_textured_surface(cases: list[Case]) -> None:
    scene, objects = cases[0]
    assert isinstance(scene.objects[0].material.reflectance, MetallicRoughness)
    stages = ("lobe", "suns", "bounce", "truncation", "together", "rim", "picture")
    # The terms of one of the two are enough.
    stages += () if scene.objects[0].material.reflectance.metallic else ("terms", "maps")
    found = scene_errors(scene, objects, 12, stages)[0]
    assert found is not None
    assert set(found.errors) == {*stages}
    # What surfaces send counts as if they were matt, and light is mixed between few vertices, at the rim too.
    least = {
        stage: error for stage, error in found.errors.items() if stage not in ("bounce", "together", "rim", "picture")
    }
    assert max(least.values()) < 0.01
    assert max(found.errors.values()) < 0.2
    # As if the texture were its mean, much of the light is wrong.
    flat = tuple(replace(each, tint=None) for each in objects)
    wrong = scene_errors(scene, flat, 12, ("suns", "together"))[0]
    assert wrong is not None
    for stage, error in wrong.errors.items():
        assert error > 2 * found.errors[stage], stage


def test_stored_and_read(cases: list[Case], tmp_path: Path) -> None:
    scene, objects = cases[0]
    result = RelightResult.of(scene.file, objects, {})
    result.save(tmp_path / "relit")
    back, eye = open_relit(tmp_path / "relit"), scene.file.cameras[0].eye
    for one, other in zip(result.shade("studio", eye, True), back.shade("studio", eye, True), strict=True):
        np.testing.assert_array_equal(one, other)
    radiance = environment_cube(scene.file.light, scene.file.settings.cube)
    points = pixels_of(scene, objects)[0].mixture
    one, other = (each.objects[0].lit(radiance).between(points, eye) for each in (result, back))
    np.testing.assert_array_equal(one, other)
    assert back.objects[0].nbytes == result.objects[0].nbytes > replace(result.objects[0], tint=None).nbytes


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("object_0_tints", np.full((4, 4, 3), -1, np.float32), "object_0_tints"),
        ("object_0_uv", np.zeros((3, 2)), "object_0_uv"),
        ("object_0_uv", None, "object_0_uv"),
    ],
)
def test_damaged_textures_are_refused(
    cases: list[Case], tmp_path: Path, name: str, value: np.ndarray | None, words: str
) -> None:
    scene, objects = cases[0]
    RelightResult.of(scene.file, objects, {}).save(tmp_path / "relit")
    file = tmp_path / "relit" / "relight.npz"
    arrays, header = read_archive(file)
    arrays = {key: array for key, array in arrays.items() if key != name} | ({} if value is None else {name: value})
    write_archive(file, header, arrays)
    with pytest.raises(BadInput, match=words):
        open_relit(tmp_path / "relit")


@pytest.mark.slow
def test_a_plan_has_both_parts(tmp_path: Path) -> None:
    written(tmp_path / "ball.glb", *GLOSS)
    text = SCENE.format(mesh="ball.glb", lobe="auto", terms=0) + "[tolerance]\nreflected = 0.1\n"
    for line in ("terms = 0\n", "kept = 384\n", "bounces = 1\n"):
        text = text.replace(line, "")
    (tmp_path / "scene.toml").write_text(text)
    choice = open_relight_scene(read_relight_scene(tmp_path / "scene.toml")).choices[0]
    assert choice.plan is not None
    factors = choice.material.factors
    assert 0 < factors.tinted < factors.terms
    assert (choice.material.lobe is None) == (choice.plan.chosen.of_lobe is None)


@pytest.mark.slow
def test_a_textured_part_keeps_its_model_and_says_nothing(tmp_path: Path) -> None:
    """Editing asks for the model; relighting for its two parts."""
    scene = opened(tmp_path, GLOSS, "factored", terms=1)
    assert not any("texture" in note for note in scene.notes)
    assert isinstance(scene.objects[0].reflectance, Tinted)
    assert isinstance(scene.objects[0].material.reflectance, MetallicRoughness)
    assert scene.objects[1].tint is None
    black = replace(scene.objects[0].material, reflectance=MetallicRoughness((0.0,) * 3, 0.0, 0.5))
    assert black.tinted is None


@pytest.mark.slow
def test_a_material_has_its_texture_where_the_mesh_has_coordinates(tmp_path: Path) -> None:
    """The same part as the material of a mesh without coordinates, which comes first, and of its own mesh."""
    written(tmp_path / "ball.glb", *GLOSS)
    text = SCENE.format(mesh="ball.glb", lobe="factored", terms=1)
    other = (
        '[[object]]\nmesh = "shape:sphere"\nmaterial = "ball.glb#ball"\nlobe = "factored"\nterms = 1\nat = [3, 0, 0]\n'
    )
    (tmp_path / "scene.toml").write_text(other + text)
    scene = open_relight_scene(read_relight_scene(tmp_path / "scene.toml"))
    plain, textured, _ = scene.choices
    assert [each.tint is None for each in scene.objects] == [True, False, True]
    assert (plain.material.factors.tinted, textured.material.factors.tinted) == (0, 1)
    assert [len(each.sun_tables) for each in (plain, textured)] == [2, 3]
    assert textured.material.factors.bounced == 2 * plain.material.factors.bounced
