"""Quotients over a triangle of light: the points' shares, integrals, and how many points are enough."""

import math

import numpy as np
import pytest
import torch
from editing.scenes import VIEW

from homofact.brdf.analytic import CookTorrance
from homofact.editing.curves import flat
from homofact.editing.lights import triangle_lights, triangle_solid_angles
from homofact.editing.material import Editable, EditableTerm, Slot
from homofact.editing.quotient import LightPoints, enough_points, lit
from homofact.editing.reaching import DirectLight, visible_lights
from homofact.errors import BadInput
from homofact.meshes.shapes import sphere
from homofact.scene.cameras import Camera
from homofact.scene.lighting import named_lighting
from homofact.scene.meshes import MeshGroup
from homofact.scene.visibility import visible_pixels

LIGHTS = triangle_lights(named_lighting("studio"), 40, 3)
SOLIDS = MeshGroup([sphere(12)])
PIXELS = visible_pixels(SOLIDS, Camera(VIEW.eye, VIEW.target, 40, (12, 12), "v"))


def of(function) -> Editable:
    """A material of one term with that quotient of (wi, wo)."""
    slots = (Slot("incident", "theta_i", flat(3), 32),)
    return Editable("x", ("R", "G", "B"), (EditableTerm("whole", function, slots),))


def summed(material: Editable, points: LightPoints) -> np.ndarray:
    """R (P, C)."""
    reaching = DirectLight(PIXELS, LIGHTS, SOLIDS).reaching()
    each = lit(PIXELS, LIGHTS, points, reaching, material, material.terms[0])
    return np.stack([np.bincount(reaching.owner, column, len(PIXELS)) for column in each.T], 1)


@pytest.mark.parametrize("divided", [0, 1, 2])
def test_points_stand_for_parts_of_the_triangle(divided: int) -> None:
    points = LightPoints.of(LIGHTS, divided)
    assert points.points.shape == (LIGHTS.count, 4**divided, 3)
    np.testing.assert_allclose(points.shares.sum(1), 1, rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(points.points, axis=2), 1, rtol=1e-12)
    # All inside: with two corners, they make triangles whose solid angles add up to the whole one.
    corners = LIGHTS.vertices[LIGHTS.triangles]
    parts = np.zeros(())
    for k in range(3):
        pair = [points.points.reshape(-1, 3), *(corners[:, (k + i) % 3].repeat(4**divided, 0) for i in (1, 2))]
        parts = parts + triangle_solid_angles(np.stack(pair, 1)).reshape(LIGHTS.count, -1)
    np.testing.assert_allclose(parts, np.broadcast_to(LIGHTS.solid_angles[:, None], parts.shape), rtol=1e-9)
    if divided == 1:
        np.testing.assert_allclose(points.shares, LIGHTS.sizes, rtol=1e-9)
    if divided == 0:
        np.testing.assert_allclose(points.points[:, 0], LIGHTS.centres, atol=1e-12)


def test_more_points_come_nearer_to_the_integral() -> None:
    """∫ over each triangle of a lobe about the normal, by 4^5 points a triangle."""
    lobe = of(lambda wi, wo: (wi[:, 2:] ** 40).expand(-1, 3))
    exact = summed(lobe, LightPoints.of(LIGHTS, 5))
    errors = [np.abs(summed(lobe, LightPoints.of(LIGHTS, n)) - exact).max() / exact.max() for n in (0, 1, 2)]
    assert errors[0] > 2 * errors[1] > 4 * errors[2]
    assert errors[2] < 0.03


def test_what_dips_below_the_horizon_gives_nothing_and_asks_nothing() -> None:
    below = []

    def quotient(wi: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
        below.append(bool((wi[:, 2] <= 0).any()))
        return torch.ones(len(wi), 3, dtype=wi.dtype)

    points = LightPoints.of(LIGHTS, 2)
    begins, numbers = visible_lights(PIXELS, LIGHTS, SOLIDS)
    for pixel, found in enumerate(summed(of(quotient), points)[:20]):
        own = numbers[begins[pixel] : begins[pixel + 1]]
        cosine = points.points[own] @ PIXELS.frames[pixel, 2]
        mean = (points.shares[own] * np.maximum(cosine, 0)).sum(1)
        expected = (mean * LIGHTS.solid_angles[own]) @ LIGHTS.radiance[own]
        np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert (points.points[numbers] @ PIXELS.frames[:, 2].T < 0).any()
    assert not any(below)


def test_what_hardly_changes_is_asked_at_the_centres_and_what_is_sharp_at_more() -> None:
    lights = triangle_lights(named_lighting("overcast"), 1500, 3)
    reaching = DirectLight(PIXELS, lights, SOLIDS).reaching()

    def chosen(function) -> int:
        material = of(function)
        return enough_points(PIXELS, lights, reaching, material, material.terms[0]).divided

    assert chosen(lambda wi, wo: torch.full((len(wi), 3), 0.5, dtype=wi.dtype)) == 0
    # Not beyond 2^14 points.
    assert chosen(CookTorrance((0.1, 0.1, 0.1), (0.5, 0.5, 0.5), 0.05, 0.05).evaluate) == 1


@pytest.mark.parametrize("value", [math.nan, -1.0, math.inf])
def test_quotients_that_are_none_are_refused(value: float) -> None:
    bad = of(lambda wi, wo: torch.full((len(wi), 3), value, dtype=wi.dtype))
    with pytest.raises(BadInput, match=rf"^x: whole: the quotient is {value} somewhere, expected finite numbers >= 0$"):
        summed(bad, LightPoints.of(LIGHTS, 0))
