"""Shares of triangles in bands: the formulas of appendix A, and whole lights against many points in them."""

import itertools
import math

import numpy as np
import pytest
from slow_cases import slow_among

from homofact.editing.angles import ANGLES, PEAKED, RIGHT_ANGLE, chord_at
from homofact.editing.lights import TriangleLights, triangle_lights
from homofact.editing.overlap import VisibleLights, transport
from homofact.editing.shares import TOLERANCE, below, bend, put_corners
from homofact.scene.lighting import named_lighting
from homofact.scene.visibility import VisiblePixels

LIGHTS = triangle_lights(named_lighting("studio"), 300)
FRAME = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
FRAME[2] *= np.sign(np.linalg.det(FRAME))


def share_below(edge: float, *corners: float) -> float:
    """The share of one triangle by its values at the corners."""
    row = np.zeros((1, 5))
    put_corners(row, 0, *corners)
    return below(edge, row, 0)


def test_share_below_is_that_of_points_in_the_triangle() -> None:
    u, v = (np.arange(400) + 0.5) / 400, (np.arange(400) + 0.5) / 400
    u, v = (each.reshape(-1) for each in np.meshgrid(u, v))
    u, v = u[u + v < 1], v[u + v < 1]
    for a, b, c in ((0.0, 1.0, 3.0), (-1.0, -1.0, 2.0), (0.5, 2.0, 2.0), (0.0, 0.1, 4.0)):
        values = a + u * (b - a) + v * (c - a)
        for edge in np.linspace(a - 0.5, c + 0.5, 11):
            assert share_below(edge, a, b, c) == pytest.approx(float((values < edge).mean()), abs=5e-3)
    # At the ends, and of a triangle that is all of one value.
    assert (share_below(1.0, 1.0, 2.0, 3.0), share_below(3.0, 1.0, 2.0, 3.0)) == (0, 1)
    assert (share_below(1.0, 1.0, 1.0, 1.0), share_below(1.1, 1.0, 1.0, 1.0)) == (0, 1)
    assert share_below(2.0, 1.0, 2.0, 3.0) == pytest.approx(0.5)


def test_bend_is_how_far_a_middle_is_from_the_mean_of_its_own_edge() -> None:
    """The middle of each edge is opposite to the corner of its number, as in `TriangleLights`."""
    corners = np.array([1.0, 4.0, 11.0])
    means = np.array([corners[[1, 2]].mean(), corners[[0, 2]].mean(), corners[[0, 1]].mean()])
    # The second row, so that the first is not read in its place.
    y = np.stack([np.full(6, np.nan), np.concatenate([corners, means])])
    assert bend(y, 1) == 0
    for middle in range(3):
        for off in (0.25, -0.25):
            bent = y.copy()
            bent[1, 3 + middle] += off
            assert bend(bent, 1) == pytest.approx(0.25)


def pixels_of(wo: np.ndarray, count: int) -> VisiblePixels:
    """So many pixels that see the same point from the same direction."""
    none, points = np.zeros(count, np.int64), np.zeros((count, 3))
    return VisiblePixels(
        none, none, points, np.tile(FRAME, (count, 1, 1)), np.tile(wo, (count, 1)), np.zeros((count, 2))
    )


def found_bands(
    lights: TriangleLights, wo: np.ndarray, kinds: tuple[int, int], bands: tuple[int, int], numbers: np.ndarray
) -> np.ndarray:
    """Shares (S, J·K) of single lights."""
    found = np.zeros((len(numbers), 1, bands[0] * bands[1]))
    begins = np.arange(len(numbers) + 1)
    count = len(numbers)
    transport(lights, pixels_of(wo, count), kinds, bands, VisibleLights(begins, numbers, np.ones((count, 1))), found)
    return found[:, 0]


def sampled_bands(lights, wo, kinds, bands, number, side=160) -> np.ndarray:
    """The same of one light by points that are uniform in solid angle: of its fine division, weighted."""
    corners = lights.vertices[lights.triangles[number]] @ FRAME.T
    u, v = np.meshgrid((np.arange(side) + 1 / 3) / side, (np.arange(side) + 1 / 3) / side)
    keep = u + v < 1
    flat = np.concatenate([np.stack((u[keep], v[keep]), -1), 1 - np.stack((u[keep], v[keep]), -1)])
    flat = flat[flat.sum(1) < 1]
    points = corners[0] + flat[:, :1] * (corners[1] - corners[0]) + flat[:, 1:] * (corners[2] - corners[0])
    weights = 1 / np.linalg.norm(points, axis=1) ** 3
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    place = np.zeros(len(points), dtype=np.int64)
    for kind, count in zip(kinds, bands, strict=True):
        if kind >= 0:
            gamma = np.array([chord_at(kind, *each, *wo) for each in points])
            gamma = 2 * np.arcsin(np.minimum(gamma / 2, 1))
            share = np.clip(gamma / RIGHT_ANGLE, 0, 1)
            along = np.sqrt(share) if ANGLES[kind] in PEAKED else share
            band = np.minimum((along * count).astype(np.int64), count - 1)
        else:
            band = np.zeros(len(points), dtype=np.int64)
        place = place * count + band
    return np.bincount(place, weights, bands[0] * bands[1]) / weights.sum()


WO = np.array([0.5, -0.3, math.sqrt(1 - 0.34)])


@pytest.mark.parametrize("name", [name for name in ANGLES if name != "theta_o"])
@pytest.mark.parametrize("count", slow_among([32, 256], 256))
def test_one_angle_is_that_of_points(name: str, count: int) -> None:
    kinds, bands = (ANGLES.index(name), -1), (count, 1)
    visible = np.flatnonzero((LIGHTS.centres @ FRAME.T)[:, 2] > 0)
    # The largest, those about the peak of the half vector, and some others.
    mirror = FRAME.T @ (WO * (-1, -1, 1))
    chosen = np.unique(
        np.concatenate((visible[LIGHTS.solid_angles[visible].argsort()[-5:]],
                        visible[(LIGHTS.centres[visible] @ mirror).argsort()[-6:]], visible[::12]))
    )  # fmt: skip
    found = found_bands(LIGHTS, WO, kinds, bands, chosen)
    np.testing.assert_allclose(found.sum(1), 1, rtol=1e-12)
    distances = []
    for row, number in zip(found, chosen, strict=True):
        expected = sampled_bands(LIGHTS, WO, kinds, bands, number)
        # How far the running sums are apart: what share is counted on the wrong side of some boundary.
        distances.append(np.abs(np.cumsum(row) - np.cumsum(expected)).max())
    assert max(distances) < 1.3 * TOLERANCE
    assert np.mean(distances) < 0.015


@pytest.mark.slow
@pytest.mark.parametrize(("name_a", "name_b"), [("theta_h", "theta_d"), ("gamma_alpha", "gamma_beta")])
def test_two_angles_are_those_of_points(name_a: str, name_b: str) -> None:
    kinds, bands = (ANGLES.index(name_a), ANGLES.index(name_b)), (128, 64)
    visible = np.flatnonzero((LIGHTS.centres @ FRAME.T)[:, 2] > 0)[::9]
    found = found_bands(LIGHTS, WO, kinds, bands, visible)
    np.testing.assert_allclose(found.sum(1), 1, rtol=1e-12)
    both = found.reshape(-1, *bands)
    for row, number in zip(both, visible, strict=True):
        expected = sampled_bands(LIGHTS, WO, kinds, bands, number).reshape(bands)
        together = np.abs(row.cumsum(0).cumsum(1) - expected.cumsum(0).cumsum(1))
        # The angles bend by as much, each, and are not independent within the triangle.
        assert together.max() < 2.5 * TOLERANCE
    # Either angle alone: what the other one adds up to.
    alone = found_bands(LIGHTS, WO, (kinds[0], -1), (128, 1), visible)
    assert np.abs(both.sum(2).cumsum(1) - alone.cumsum(1)).max() < 1.3 * TOLERANCE


def test_what_is_beyond_the_horizon_counts_to_the_last_band() -> None:
    below = np.flatnonzero((LIGHTS.vertices[LIGHTS.triangles] @ FRAME[2]).max(1) < 0)[:4]
    found = found_bands(LIGHTS, WO, (ANGLES.index("theta_i"), -1), (64, 1), below)
    np.testing.assert_allclose(found[:, 63], 1)


def test_a_light_about_the_peak_reaches_the_first_band() -> None:
    """γ at the corners alone would put all of it into a band far out: the recursion must find the pole."""
    octahedron = triangle_lights(named_lighting("uniform"), 8)
    wo = np.array([0.0, 0.0, 1.0])
    # θh about the normal, which lies within one face of the octahedron.
    number = int((octahedron.centres @ FRAME[2]).argmax())
    found = found_bands(octahedron, wo, (ANGLES.index("theta_h"), -1), (64, 1), np.array([number]))[0]
    expected = sampled_bands(octahedron, wo, (ANGLES.index("theta_h"), -1), (64, 1), number, 600)
    assert np.abs(found.cumsum() - expected.cumsum()).max() < 0.02
    # As far as 2.8 degrees, which are the first two of 64 equal bands.
    assert found[:12].sum() == pytest.approx(expected[:12].sum(), rel=0.2)


def test_pixels_and_lights_add_up() -> None:
    """Several pixels with several lights each are the sums of single ones, in every channel."""
    rng = np.random.default_rng(0)
    numbers = np.array([3, 10, 11, 40, 41])
    begins, light = np.array([0, 2, 2, 5]), rng.random((5, 3))
    found = np.zeros((3, 3, 64))
    kinds, bands = (0, -1), (64, 1)
    transport(LIGHTS, pixels_of(WO, 3), kinds, bands, VisibleLights(begins, numbers, light), found)
    single = found_bands(LIGHTS, WO, kinds, bands, numbers)
    for pixel, (begin, end) in enumerate(itertools.pairwise(begins)):
        expected = sum((light[s][:, None] * single[s] for s in range(begin, end)), np.zeros((3, 64)))
        np.testing.assert_allclose(found[pixel], expected, atol=1e-14)
