"""Pictures at more pixels than were precomputed: silhouettes, surfaces, the sky behind, soft ground."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from editing.scenes import FLOOR, PAINT, VIEW, on_the_floor, single

from homofact.editing import models
from homofact.editing.enlarged import clear_shares, enlarged, sky_behind
from homofact.editing.picture import radiance, starting_curves
from homofact.editing.precompute import prepare
from homofact.editing.scene import EditObject, EditScene, PreparedScene
from homofact.meshes.mesh import Mesh
from homofact.meshes.shapes import ground, sphere
from homofact.rendering.light import DirectionalLight
from homofact.scene.cameras import Camera
from homofact.scene.lighting import Lighting, named_lighting


def prepared_at(pixels: tuple[int, int]) -> PreparedScene:
    """The ball on its floor, without its squares, in one view of so many pixels."""
    scene = on_the_floor(models.cook_torrance(PAINT, "paint", (64, 32)))
    things = tuple(replace(each, patterns={}) for each in scene.objects)
    return prepare(replace(scene, objects=things, cameras=(replace(VIEW, pixels=pixels),)), 60, "full")


def values_of(prepared: PreparedScene) -> torch.Tensor:
    return radiance(prepared, 0, starting_curves(prepared))


@pytest.mark.slow
def test_an_enlarged_picture_is_nearly_the_one_precomputed_in_as_many_pixels() -> None:
    few, many = prepared_at((32, 32)), prepared_at((96, 96))
    found, expected = enlarged(few, 0, values_of(few), 3), enlarged(many, 0, values_of(many), 1)
    assert torch.allclose(found.coverage, expected.coverage, atol=1e-9)
    size = float(expected.radiance.square().mean().sqrt())
    off = (found.radiance - expected.radiance).square().mean(2).sqrt()
    assert float(off.square().mean().sqrt()) / size < 0.03
    # Blown up pixel by pixel it is off by more than three times as much.
    blown = enlarged(few, 0, values_of(few), 1).radiance.repeat_interleave(3, 0).repeat_interleave(3, 1)
    plain = float((blown - expected.radiance).square().mean().sqrt()) / size
    assert plain > 3 * float(off.square().mean().sqrt()) / size


def shades_of(prepared: PreparedScene, dark: np.ndarray) -> np.ndarray:
    """Radiance of all pixels that are wholly covered, where the `dark` ones of the few pixels are 0, the others 1."""
    values = torch.from_numpy(np.where(dark[:, None], 0.0, 1.0).repeat(3, 1))
    found = enlarged(prepared, 0, values, 4)
    return found.radiance[found.coverage == 1][:, 0].numpy()


def test_objects_do_not_bleed_into_each_other() -> None:
    """Two halves of one plane: nothing but the object tells their pixels apart, and the edge is a pixel wide."""
    whole = ground(2.0, 0.0, 8)
    left = whole.positions[whole.triangles, 0].mean(1) < 0
    halves = [replace(whole, triangles=whole.triangles[left]), replace(whole, triangles=whole.triangles[~left])]
    things = tuple(EditObject(half, models.light_view(FLOOR, name)) for half, name in zip(halves, "ab", strict=True))
    above = Camera((0.0, 3.0, 0.01), (0.0, 0.0, 0.0), 30, (24, 24), "above")
    prepared = prepare(EditScene(things, named_lighting("uniform"), (above,)), 20, "full")
    shades = shades_of(prepared, prepared.pixels[0].objects == 0)
    assert ((shades > 0.01) & (shades < 0.99)).mean() < 1.5 / (4 * 24)
    assert abs(shades.mean() - 0.5) < 0.02


def test_a_near_part_of_an_object_does_not_bleed_into_a_far_one() -> None:
    """Two balls that are one object, the nearer one before the other: distance and normals tell them apart."""
    ball = sphere(24)
    positions = np.concatenate((0.6 * ball.positions + [-0.3, 0, 0.5], 0.6 * ball.positions + [0.3, 0, -0.5]))
    triangles = np.concatenate((ball.triangles, ball.triangles + len(ball.positions)))
    both = Mesh(positions, np.tile(ball.normals, (2, 1)), triangles, "balls")
    scene = EditScene((EditObject(both, models.light_view(FLOOR, "a")),), named_lighting("uniform"), (VIEW,))
    prepared = prepare(scene, 20, "full")
    near = np.linalg.norm(prepared.pixels[0].points - [-0.3, 0, 0.5], axis=1) < 0.61
    shades = shades_of(prepared, near)
    assert ((shades > 0.02) & (shades < 0.98)).mean() < 0.03
    assert (shades < 0.02).mean() > 0.2
    assert (shades > 0.98).mean() > 0.2


def test_the_sky_stands_behind_and_ground_ends_softly() -> None:
    prepared = prepared_at((24, 24))
    found = enlarged(prepared, 0, values_of(prepared), 2)
    rays = replace(VIEW, pixels=(48, 48)).rays(2)
    sky = sky_behind(prepared.scene.lighting, rays.reshape(-1, 3), 3).reshape(48, 48, 4, 3).mean(2)
    empty = (found.coverage == 0).numpy()
    assert empty.any()
    np.testing.assert_allclose(found.radiance.numpy()[empty], sky[empty], rtol=1e-12)
    soft = (found.coverage > 0) & (found.coverage < 1)
    assert float(soft.double().mean()) > 0.05
    meshes = [edited.mesh for edited in prepared.scene.objects]
    clear = clear_shares(meshes, prepared.pixels[0])
    distance = np.hypot(*prepared.pixels[0].points[:, ::2].T)
    floor = prepared.pixels[0].objects == 1
    assert (clear[~floor] == 0).all()
    assert (clear[floor & (distance < 1.1)] == 0).all()
    assert (clear[floor & (distance > 1.97)] == 1).all()


def test_lamps_alone_leave_the_background_black() -> None:
    lamp = Lighting("lamp", (DirectionalLight((0.3, 0.8, 0.5), 1.0),))
    assert (sky_behind(lamp, np.eye(3), 3) == 0).all()
    prepared = prepare(single(models.light_view(FLOOR, "a"), lamp), 20, "full")
    found = enlarged(prepared, 0, values_of(prepared), 2)
    assert float(found.radiance[found.coverage == 0].abs().max()) == 0
    assert float(found.radiance.max()) > 0


@pytest.mark.parametrize("times", [1, 3])
def test_even_radiance_stays_even(times: int) -> None:
    prepared = prepare(on_the_floor(models.light_view(FLOOR, "a")), 20, "full")
    even = torch.full((len(prepared.pixels[0]), 3), 0.7, dtype=torch.float64)
    found = enlarged(prepared, 0, even, times)
    whole = found.coverage == 1
    assert torch.allclose(found.radiance[whole], torch.tensor(0.7, dtype=torch.float64), atol=1e-9)
    assert found.radiance.shape == (24 * times, 24 * times, 3)
