"""From scenes to transport: the sums are the integrals, and both forms and any number of threads agree."""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
import torch
from editing.scenes import BRUSHED, PAINT, VIEW, on_the_floor, prepared_paint, relative, single
from slow_cases import slow_among

from homofact.brdf.analytic import Lambert
from homofact.editing import factored, models, precompute
from homofact.editing.basis import trial_edits
from homofact.editing.curves import Bands, banded, flat
from homofact.editing.errors import rank_errors
from homofact.editing.lights import triangle_lights
from homofact.editing.lowrank import LowRank
from homofact.editing.picture import image, radiance, starting_curves
from homofact.editing.precompute import prepare
from homofact.editing.reaching import DirectLight, visible_lights
from homofact.editing.scene import EditObject, EditScene
from homofact.errors import BadInput
from homofact.meshes.shapes import sphere
from homofact.rendering.light import EnvironmentMap
from homofact.scene.cameras import Camera
from homofact.scene.lighting import Lighting, named_lighting
from homofact.scene.meshes import MeshGroup
from homofact.scene.visibility import visible_pixels


def centre_sum(prepared, view: int = 0) -> torch.Tensor:
    """R (P, C) by each light's centre, the material as it is, no curves and no bands."""
    pixels, lights, scene = prepared.pixels[view], prepared.lights, prepared.scene
    begins, numbers = visible_lights(pixels, lights, MeshGroup([thing.mesh for thing in scene.objects]))
    owner = np.repeat(np.arange(len(pixels)), np.diff(begins))
    wi = torch.from_numpy(np.einsum("pij,pj->pi", pixels.frames[owner], lights.centres[numbers]))
    weight = torch.from_numpy((lights.solid_angles[:, None] * lights.radiance)[numbers]) * wi[:, 2:]
    total = torch.zeros(len(pixels), 3, dtype=torch.float64)
    for which, thing in enumerate(scene.objects):
        own = torch.from_numpy(pixels.objects[owner] == which)
        value = thing.material.edited({}).evaluate(wi[own], torch.from_numpy(pixels.wo[owner])[own])
        total.index_add_(0, torch.from_numpy(owner)[own], value * weight[own])
    return total


def test_white_in_even_light_is_white() -> None:
    """A furnace: R of a convex white Lambertian is 1, but for cosines at the centres of 800 lights."""
    scene = single(models.light_view(Lambert((1.0, 1.0, 1.0)), "white"), named_lighting("uniform"))
    prepared = prepare(scene, 800, "full")
    found = radiance(prepared, 0, starting_curves(prepared))
    assert float(found.mean()) == pytest.approx(1, abs=2e-3)
    assert float((found - 1).abs().max()) < 0.02


@pytest.mark.parametrize("angles", [("theta_h",), ("theta_i", "theta_h"), ("gamma_alpha", "gamma_beta")])
def test_curves_of_1_give_the_unedited_picture(angles: tuple[str, ...]) -> None:
    """The analytic identity: bands and angles do not matter to a curve that is 1."""
    material = models.from_reflectance(BRUSHED, angles, "metal", (64, 32))
    prepared = prepare(single(material), 100, "full", divided=0)
    work = precompute._Work(1, 1, None)
    light = DirectLight(prepared.pixels[0], prepared.lights, MeshGroup([prepared.scene.objects[0].mesh]))
    work.ask(light, prepared.scene.objects[0], 0)
    block = work.block(light, prepared.scene.objects[0])[0]
    expected = centre_sum(prepared)
    assert float((torch.from_numpy(block.sum(2)) - expected).abs().max() / expected.max()) < 1e-10
    # As stored, in float32.
    assert relative(radiance(prepared, 0, starting_curves(prepared)), expected) < 1e-6


SMALL = Camera((0.0, 0.5, 4.0), (0.0, 0.0, 0.0), 40, (8, 8), "v")


@lru_cache(maxsize=2)
def rendered_densely(model) -> torch.Tensor:
    """R of a ball under 3,000 lights, the material asked at their centres."""
    dense = prepare(single(models.from_reflectance(model, ("theta_i",), "x", (32,)), views=(SMALL,)), 3000, "full",
                    divided=0)  # fmt: skip
    return radiance(dense, 0, starting_curves(dense))


@pytest.mark.parametrize(
    ("kind", "most"), slow_among([("CT", 6e-3), ("AS", 0.01), ("HF", 0.012), ("HD", 0.012)], "CT", "AS", "HD")
)
def test_models_as_they_start_give_the_picture_of_the_material(kind: str, most: float) -> None:
    """Curves divided out and put back, bands, triangles and all, against many lights and none of that."""
    material = {
        "CT": lambda: models.cook_torrance(PAINT, "x", (256, 64)),
        "AS": lambda: models.ashikhmin_shirley(BRUSHED, "x"),
        "HF": lambda: factored.homomorphic(PAINT, "x"),
        "HD": lambda: factored.half_and_diffuse(PAINT, "x"),
    }[kind]()
    prepared = prepare(single(material, views=(SMALL,)), 700, "full")
    found = radiance(prepared, 0, starting_curves(prepared))
    assert relative(found, rendered_densely(BRUSHED if kind == "AS" else PAINT)) < most


def test_a_sliders_picture_is_the_model_rendered_again() -> None:
    scene = single(models.cook_torrance(PAINT, "x", (256, 64)), views=(SMALL,))
    prepared = prepare(scene, 700, "full")
    curves = starting_curves(prepared)
    slot = scene.objects[0].material.slot(("specular", "distribution"))
    assert slot.sliders is not None
    curves["x", "specular", "distribution"] = slot.banded(slot.sliders.curve(sigma=0.4))
    again = prepare(single(models.cook_torrance(replace(PAINT, roughness=0.4), "x", (256, 64)), views=(SMALL,)),
                    700, "full")  # fmt: skip
    expected = radiance(again, 0, starting_curves(again))
    assert relative(radiance(prepared, 0, curves), expected) < 1e-6
    # A curve in bands of another kind is taken to those of its place.
    curves["x", "specular", "distribution"] = banded(slot.sliders.curve(sigma=0.4), 256)
    assert 1e-6 < relative(radiance(prepared, 0, curves), expected) < 2e-3


def test_shadows_fall_where_something_is_in_the_way() -> None:
    prepared = prepared_paint()
    curves = starting_curves(prepared)
    found, _ = image(prepared, 0, radiance(prepared, 0, curves))
    floor = prepared.pixels[0].objects == 1
    points = prepared.pixels[0].points[floor]
    values = radiance(prepared, 0, curves)[torch.from_numpy(floor)]
    light = np.where((np.floor(points[:, 0] * 2) + np.floor(points[:, 2] * 2)) % 2 == 0, 1, 0.4)
    even = values[:, 0].numpy() / light
    near, far = np.hypot(points[:, 0], points[:, 2]) < 0.6, np.hypot(points[:, 0], points[:, 2]) > 1.6
    assert even[near].mean() < 0.6 * even[far].mean()
    assert found.shape == (24, 24, 3)


def test_patterns_and_curves_over_the_outgoing_angle_multiply() -> None:
    prepared = prepared_paint()
    curves = starting_curves(prepared)
    before = radiance(prepared, 1, curves)
    floor = torch.from_numpy(prepared.pixels[1].objects == 1)
    curves["floor", "diffuse", "outgoing"] = Bands(torch.full((256, 3), 0.5, dtype=torch.float64))
    after = radiance(prepared, 1, curves)
    assert torch.allclose(after[floor], before[floor] / 2, rtol=1e-12)
    assert torch.equal(after[~floor], before[~floor])


@pytest.mark.slow
def test_low_rank_errs_by_what_it_says() -> None:
    full, low = prepared_paint("full"), prepared_paint("low-rank")
    curves = starting_curves(full)
    for view in (0, 1):
        assert relative(radiance(low, view, curves), radiance(full, view, curves)) < 3e-3
    errors = [each.error for each in rank_errors(low)]
    for part, exact in zip(low.parts, full.parts, strict=True):
        assert isinstance(part.transport, LowRank)
        material = full.scene.objects[part.object].material
        # An edit far from the start: what is said follows it.
        own = precompute_curves(curves, material, part.term)
        own[0] = own[0].flip(0) + 0.01
        said = part.transport.error(own)
        true = relative(part.transport.picture(own), exact.transport.picture(own))
        assert said < 0.2
        assert true < 3 * said + 1e-4
        edits = trial_edits(precompute_curves(curves, material, part.term))
        assert errors.pop(0) == pytest.approx(max(part.transport.error(each) for each in edits))
        assert max(relative(part.transport.picture(each), exact.transport.picture(each)) for each in edits) < 5e-3
    assert low.nbytes < full.nbytes / 5


def test_of_few_pixels_every_channel_is_known() -> None:
    view = Camera((0.0, 0.5, 4.0), (0.0, 0.0, 0.0), 90, (8, 8), "v")
    # Light of another colour from everywhere: what one channel sees says little of the others.
    sky = EnvironmentMap(torch.rand(6, 12, 3, generator=torch.Generator().manual_seed(4), dtype=torch.float64) ** 6)
    material = models.cook_torrance(PAINT, "x", (64, 32))
    scene = single(material, Lighting("spots", (sky,)), (view,))
    low, full = (prepare(scene, 60, form, 1e-4) for form in ("low-rank", "full"))
    assert len(low.pixels[0]) < 12
    for each in trial_edits(precompute_curves(starting_curves(low), material, "diffuse")):
        assert relative(low.parts[0].transport.picture(each), full.parts[0].transport.picture(each)) < 1e-3


def precompute_curves(curves, material, term: str) -> list[torch.Tensor]:
    return [curves[material.name, term, slot.name].values.clone() for slot in material.term(term).summed]


@pytest.mark.parametrize("form", ["full", "low-rank"])
def test_a_held_curve_leaves_the_sum_over_the_other(form: str) -> None:
    prepared = prepared_paint(form)
    part = next(part for part in prepared.parts if part.term == "specular")
    curves = precompute_curves(starting_curves(prepared), prepared.scene.objects[part.object].material, "specular")
    expected = part.transport.picture(curves)
    for active in (0, 1):
        table = part.transport.frozen(active, curves).double()
        assert relative(torch.einsum("pcj,jc->pc", table, curves[active]), expected) < 1e-5
    with pytest.raises(BadInput, match=r"curves: found the shapes \[\(64, 3\)\], expected \[\(64, 3\), \(32, 3\)\]"):
        part.transport.picture(curves[:1])


def test_threads_change_no_bit() -> None:
    scene = on_the_floor(models.from_reflectance(PAINT, ("theta_h",), "paint", (64,)))
    one, two = (prepare(scene, 30, "low-rank", threads=count) for count in (1, 3))
    for first, second in zip(one.parts, two.parts, strict=True):
        assert isinstance(first.transport, LowRank)
        assert isinstance(second.transport, LowRank)
        assert np.array_equal(first.transport.coefficients.codes, second.transport.coefficients.codes)


def test_views_see_what_is_in_front() -> None:
    pixels = visible_pixels(MeshGroup([sphere(32)]), VIEW)
    forward = np.subtract(VIEW.eye, pixels.points)
    distance = np.linalg.norm(forward, axis=1)
    # The near side of the sphere, whose normal is the point itself, seen along the ray.
    assert np.abs(np.linalg.norm(pixels.points, axis=1) - 1).max() < 0.01
    np.testing.assert_allclose(pixels.frames[:, 2], pixels.points, atol=0.05)
    seen = np.einsum("pij,pj->pi", pixels.frames, forward / distance[:, None])
    np.testing.assert_allclose(pixels.wo, seen, atol=1e-6)
    assert bool((pixels.wo[:, 2] > 0).all())
    # The first row is the top one, the first column the left one.
    rows, columns = pixels.numbers // 24, pixels.numbers % 24
    assert np.corrcoef(rows, pixels.points[:, 1])[0, 1] < -0.9
    assert np.corrcoef(columns, pixels.points[:, 0])[0, 1] > 0.99
    radius = math.tan(math.asin(1 / np.linalg.norm(np.subtract(VIEW.eye, VIEW.target))))
    share = math.pi * radius**2 / (2 * math.tan(math.radians(20))) ** 2
    assert len(pixels) / 24**2 == pytest.approx(share, rel=0.1)


def test_what_is_no_scene_is_refused() -> None:
    paint = models.cook_torrance(PAINT, "paint", (64, 32))
    light, thing = named_lighting("studio"), EditObject(sphere(8), paint)
    grey = EditObject(sphere(8), models.light_view(Lambert((0.5,), channels=("Y",)), "grey"))
    for things, views, words in (
        ((), (VIEW,), "objects: found none"),
        ((thing,), (), "views: found none"),
        ((thing, grey), (VIEW,), "materials: found the channels"),
        ((thing, thing), (VIEW,), "materials: found paint, paint, expected different names"),
    ):
        with pytest.raises(BadInput, match=words):
            EditScene(things, light, views)
    with pytest.raises(BadInput, match="paint: has no term 'coat', expected one of diffuse, specular"):
        EditObject(sphere(8), paint, {"coat": lambda points, uv: points})
    away = EditScene((thing,), light, (Camera((0.0, 0.0, 4.0), (0.0, 0.0, 8.0), 40, (8, 8), "away"),))
    with pytest.raises(BadInput, match="views: found no object in any of them"):
        prepare(away, 20)
    with pytest.raises(BadInput, match="form: found 'dense', expected one of low-rank, full"):
        prepare(single(paint), 20, "dense")
    large = single(models.cook_torrance(PAINT, "paint"), views=(replace(VIEW, pixels=(512, 512)),))
    with pytest.raises(BadInput, match=r"form: full would be .*fewer pixels, or low-rank"):
        prepare(large, 20, "full")
    for wrong, words in (({"pixels": (4, 24)}, "pixels: found"), ({"field": 0.0}, "field: found 0"),
                         ({"target": VIEW.eye}, "eye: found")):  # fmt: skip
        with pytest.raises(BadInput, match=words):
            replace(VIEW, **wrong)


def test_a_quotient_that_is_not_finite_is_named() -> None:
    class Broken:
        channels, nbytes, fetches = ("R", "G", "B"), 0, 0

        def evaluate(self, wi: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
            return torch.full((len(wi), 3), math.nan, dtype=wi.dtype)

    with pytest.raises(BadInput, match="broken: whole: the quotient is nan somewhere"):
        prepare(single(models.from_reflectance(Broken(), ("theta_i",), "broken", (32,))), 20, "full")


def test_the_light_has_as_many_channels_as_the_materials() -> None:
    lights = triangle_lights(named_lighting("studio"), 30, 3)
    assert lights.channels == 3
    assert flat(3).at(torch.zeros(2)).shape == (2, 3)
