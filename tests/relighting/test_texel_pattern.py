"""The pattern of texels in a mirrored sky: its law against the lobe's own sum, and when it is noted."""

import numpy as np
import pytest

from homofact.brdf.analytic import Phong
from homofact.relighting.lobe import SeparateLobe, SurfacePoints
from homofact.relighting.lobe_light import LightCells
from homofact.relighting.lobe_table import lobe_table
from homofact.relighting.sight import VertexSight, sight_words
from homofact.relighting.texel_pattern import texel_note, texel_ripple


def varied(exponent: float, size: int) -> tuple[float, float]:
    """(the law, how much brighter than its mean a lobe's light gets in an even sky), over many normals."""
    table = lobe_table(Phong((0.1,) * 3, (0.8,) * 3, exponent))
    open_ = np.full((1, sight_words(size)), 2**64 - 1, np.uint64)
    lobe = SeparateLobe(table, VertexSight.of(open_))
    # Mirrored around the middle of a face, where texels are largest.
    turns = np.random.default_rng(0).uniform(-0.2, 0.2, (400, 2))
    normals = np.stack((turns[:, 0], turns[:, 1], np.ones(400)), 1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    right = np.cross((0.0, 1.0, 0.0), normals)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    frames = np.stack((right, np.cross(normals, right), normals), 1)
    wo = np.tile([0.0, 0.0, 1.0], (400, 1))
    points = SurfacePoints.at_vertices(frames, wo, np.zeros(400, int))
    light = lobe.at(points, LightCells.of(np.ones((6, size, size, 3))))[:, 0]
    return texel_ripple(table.half_width, size), float((light / light.mean()).max() - 1)


@pytest.mark.parametrize(("exponent", "size"), [(600, 16), (1000, 16), (2000, 32), (2000, 16)])
def test_the_law_is_the_variation_of_the_sum(exponent: float, size: int) -> None:
    law, found = varied(exponent, size)
    assert law > 0.05
    assert found == pytest.approx(law, rel=0.2)


def test_a_lobe_wider_than_a_texel_has_no_pattern() -> None:
    law, found = varied(150, 32)
    assert law < 1e-3
    assert found < 0.01


def test_a_narrow_lobe_is_noted_with_the_cube_map_that_is_fine_enough() -> None:
    (line,) = texel_note("pot", 0.02, 16)
    assert line.startswith("pot: ")
    assert "cube = 32 in [transport]" in line
    assert texel_note("pot", 0.02, 32) == ()
    # None is: the finest there is, and no advice beyond it.
    assert "cube = 64 in [transport]" in texel_note("pot", 0.004, 16)[0]
    assert "[transport]" not in texel_note("pot", 0.004, 64)[0]
