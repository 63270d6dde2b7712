"""The pattern of texels in a mirrored sky: its law against the lobe's own sum, and when it is noted."""

import numpy as np
import pytest

from homofact.brdf.analytic import Phong
from homofact.brdf.analytic.common import AnalyticModel
from homofact.brdf.analytic.cook_torrance import CookTorrance
from homofact.brdf.reflectance import Reflectance
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.relighting.cube import texel_of
from homofact.relighting.errors import relative
from homofact.relighting.lobe import SeparateLobe, SurfacePoints
from homofact.relighting.lobe_light import LightCells
from homofact.relighting.lobe_table import lobe_table
from homofact.relighting.seen import SeenVertices
from homofact.relighting.sight import VertexSight, sight_words
from homofact.relighting.texel_pattern import texel_divisions, texel_note, texel_ripple


def phong(exponent: float) -> Phong:
    return Phong((0.1,) * 3, (0.8,) * 3, exponent)


def normals_of(count: int) -> np.ndarray:
    """Normals that mirror an eye above them around the middle of a face, where texels are largest."""
    turns = np.random.default_rng(0).uniform(-0.2, 0.2, (count, 2))
    normals = np.stack((turns[:, 0], turns[:, 1], np.ones(count)), 1)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def mirrored(material: AnalyticModel, size: int, divisions: int | None, angle: float = 0.0) -> np.ndarray:
    """The light (400,) of the material's lobe in an even sky over many normals, texels divided as given or as usual."""
    open_ = np.full((1, sight_words(size)), 2**64 - 1, np.uint64)
    lobe = SeparateLobe(lobe_table(material), VertexSight.of(open_))
    normals = normals_of(400)
    right = np.cross((0.0, 1.0, 0.0), normals)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    frames = np.stack((right, np.cross(normals, right), normals), 1)
    wo = np.tile([np.sin(angle), 0.0, np.cos(angle)], (400, 1))
    points = SurfacePoints.at_vertices(frames, wo, np.zeros(400, int))
    even = np.ones((6, size, size, 3))
    return lobe.at(points, lobe.cells(even) if divisions is None else LightCells.of(even, divisions))[:, 0]


def varied(exponent: float, size: int) -> tuple[float, float]:
    """(the law, how much brighter than its mean a lobe's light gets in an even sky), over whole texels."""
    light = mirrored(phong(exponent), size, 0)
    return texel_ripple(lobe_table(phong(exponent)).half_width, size), float((light / light.mean()).max() - 1)


@pytest.mark.parametrize(("exponent", "size"), [(600, 16), (1000, 16), (2000, 32), (2000, 16)])
def test_the_law_is_the_variation_of_the_sum(exponent: float, size: int) -> None:
    law, found = varied(exponent, size)
    assert law > 0.05
    assert found == pytest.approx(law, rel=0.2)


def test_a_lobe_wider_than_a_texel_has_no_pattern() -> None:
    law, found = varied(150, 32)
    assert law < 1e-3
    assert found < 0.01


@pytest.mark.parametrize(("roughness", "size"), [(0.012, 64), (0.012, 16), (0.03, 16), (0.03, 32)])
@pytest.mark.parametrize("angle", [0.0, 0.9, 1.1])
def test_divided_texels_leave_no_pattern_nor_change_the_mean(roughness: float, size: int, angle: float) -> None:
    narrow = CookTorrance((0.1,) * 3, (0.3,) * 3, roughness, 0.05)
    light = mirrored(narrow, size, None, angle)
    assert (light / light.mean()).max() < 1.025
    # The light of a lobe in an even sky does not hang on the size of its texels.
    finest = mirrored(narrow, 64, 2, angle)
    assert light.mean() == pytest.approx(finest.mean(), rel=0.01)


def test_texels_are_divided_for_narrow_lobes_alone() -> None:
    assert [texel_divisions(0.05, size) for size in (64, 32, 16, 8)] == [0, 1, 2, 3]
    assert [texel_divisions(width, 64) for width in (0.03, 0.02, 0.01, 1e-3)] == [0, 1, 2, 2]


@pytest.mark.parametrize("size", [8, 16])
@pytest.mark.parametrize("divisions", [1, 2])
def test_parts_of_texels_share_its_light_and_its_solid_angle(size: int, divisions: int) -> None:
    radiance = np.random.default_rng(0).uniform(0, 2, (6, size, size, 3))
    whole, divided = LightCells.of(radiance), LightCells.of(radiance, divisions)
    count = divided.starts[divisions]
    assert count == len(divided.parts)
    assert np.array_equal(divided.light, whole.light)
    assert np.array_equal(divided.places, whole.places)
    assert np.array_equal(divided.starts[divisions:] - count, whole.starts)
    parts = slice(divided.starts[divisions - 1], count)
    solid = (divided.parts[parts, 3].astype(float) ** 2).reshape(-1, 4).sum(1)
    assert solid == pytest.approx(whole.places[: 6 * size * size, 3].astype(float) ** 2, rel=1e-5)
    numbers = np.array([0, count - 1, count, count + 5])
    expected = np.concatenate((divided.parts[[0, -1]], whole.places[[0, 5]]))[:, :3]
    assert divided.directions(numbers) == pytest.approx(expected)
    # They lie around their texel's centre.
    middle = divided.parts[parts, :3].reshape(-1, 4, 3).mean(1)
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    assert (middle * whole.places[: 6 * size * size, :3]).sum(1).min() > 0.9998


def seen_points(material: Reflectance, count: int, angle: float = 0.0) -> SeenVertices:
    """Points with such normals that an eye sees from an angle; nothing hides the sky from them."""
    far = np.array([[-9.0, 0, -9], [-9, 1, -9], [-9, 0, -8]])
    mesh = Mesh(np.zeros((count, 3)), normals_of(count), np.zeros((0, 3), int), "points")
    occluder = Occluder(far, np.array([[0, 1, 2]]))
    return SeenVertices(mesh, material, occluder, 9 * np.array([np.sin(angle), 0, np.cos(angle)]), np.arange(count))


def test_a_bright_texel_shines_with_all_of_its_width() -> None:
    """By the lobe's sum and the dense one, at points that see its mirror image and at points that see it beside."""
    size, angle, table = 32, 1.0, lobe_table(phong(600.0))
    radiance = np.zeros((6, size, size, 3))
    radiance.reshape(-1, 3)[texel_of(np.array([[-np.sin(angle), 0.01, np.cos(angle)]]), size)] = 1.0
    seen = seen_points(table, 100, angle)
    lobe = SeparateLobe(table, VertexSight.of(np.full((100, sight_words(size)), 2**64 - 1, np.uint64)))
    found, exact = lobe.at(seen.points, lobe.cells(radiance)), seen.dense(radiance, size)
    beside = exact.max(1) < 0.05 * exact.max()
    assert relative(found, exact) < 0.006
    assert relative(found[beside], exact[beside]) < 0.03


def test_the_dense_sum_divides_texels_too() -> None:
    seen = seen_points(phong(2000.0), 24)
    for size in (16, 32):
        light = seen.dense(np.ones((6, size, size, 3)), size)[:, 0]
        # ∫ f cosθ for so narrow a lobe: the diffuse albedo, and the specular one at the cosine of the mirror direction.
        assert light == pytest.approx(0.1 + 0.8 * seen.wo[:, 2], rel=0.005)


def test_a_lobe_that_no_parts_are_small_enough_for_is_noted() -> None:
    (line,) = texel_note("pot", 0.002, 64)
    assert line.startswith("pot: ")
    # On every cube map, since texels are divided into parts of the same size.
    assert texel_note("pot", 0.002, 16) == (line,)
    assert texel_note("pot", 0.008, 64) == texel_note("pot", 0.008, 16) == ()
