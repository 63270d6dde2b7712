"""Cube maps as Godot's text resources: every level, those that are missing, bad input."""

from itertools import pairwise

import numpy as np
import pytest
from cube_maps import read_godot_cubemap
from refusals import refused

from homofact.containers.godot_cubemap import godot_cubemap


def levels(*sides: int) -> list[np.ndarray]:
    random = np.random.default_rng(0)
    return [random.uniform(0, 4, (6, side, side, 4)).astype(np.float16) for side in sides]


def test_the_levels_come_back_and_the_last_ones_are_averages() -> None:
    given = levels(16, 8)
    found = read_godot_cubemap(godot_cubemap("sky.tres", given))
    assert [each.shape[1] for each in found] == [16, 8, 4, 2, 1]
    for level, own in zip(found, given, strict=False):
        np.testing.assert_array_equal(level, own)
    for above, below in pairwise(found[1:]):
        for row in range(len(below[0])):
            for column in range(len(below[0])):
                block = above[:, 2 * row : 2 * row + 2, 2 * column : 2 * column + 2].astype(float)
                np.testing.assert_allclose(below[:, row, column], block.mean((1, 2)), rtol=2e-3)


def test_one_level_has_no_mipmaps() -> None:
    (given,) = levels(4)
    (found,) = read_godot_cubemap(godot_cubemap("sky.tres", [given]))
    np.testing.assert_array_equal(found, given)


@pytest.mark.parametrize(
    ("given", "found"),
    [
        ([], "no levels of a cube map"),
        (levels(8, 2), "level 1 of shape (6, 2, 2, 4)"),
    ],
)
def test_what_is_no_chain_is_refused(given: list[np.ndarray], found: str) -> None:
    with refused(where="sky.tres", found=found):
        godot_cubemap("sky.tres", given)
