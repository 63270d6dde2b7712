"""The hatched region is one whole region, in one style on every picture."""

import numpy as np
import pytest
from scipy.ndimage import label

from homofact.figures.hatching import hatched, region_to_hatch

SIZE = 160
Y, X = np.indices((SIZE, SIZE)) - SIZE / 2 + 0.5
SPHERE = X**2 + Y**2 <= 75**2


def crescent(width: float) -> tuple[np.ndarray, np.ndarray]:
    """Marks along the shadow of a sphere that is lit from the right, and its lit pixels."""
    edge = -0.6 * np.sqrt(np.maximum(75**2 - Y**2, 0))
    lit = SPHERE & (edge < X)
    return lit & (edge + width > X), lit


def parts(region: np.ndarray) -> int:
    found = np.zeros(region.shape, dtype=np.int32)
    label(region, output=found)
    return int(found.max())


def test_a_crescent_stays_one_region_without_its_gaps() -> None:
    marked, lit = crescent(10)
    whole = region_to_hatch(marked, lit)
    assert parts(whole) == 1
    assert (whole & marked).sum() > 0.9 * marked.sum()
    broken = marked & ~((np.abs(Y - 15) < 2) | (np.abs(Y + 20) < 2))
    assert parts(broken) == 3
    mended = region_to_hatch(broken, lit)
    assert parts(mended) == 1
    assert (mended ^ whole).sum() < 0.02 * whole.sum()
    # A wide gap was measured.
    wide = marked & (np.abs(Y) > 15)
    assert parts(region_to_hatch(wide, lit)) == 2


def test_islands_and_holes_are_dropped_by_their_area() -> None:
    marked, lit = crescent(12)
    for radius, kept in ((8, False), (14, True)):
        spot = np.hypot(X - 20, Y) <= radius
        assert region_to_hatch(marked | spot, lit)[spot].any() == kept
        hole = region_to_hatch(lit & ~spot, lit)
        assert (~hole & spot).any() == kept


def test_a_lamp_s_ragged_end_of_light_makes_no_ragged_region() -> None:
    marked, lit = crescent(12)
    teeth = (np.arange(SIZE)[:, None] // 3 % 2 == 0) & ~lit & SPHERE
    fringe = teeth & np.roll(lit, -3, axis=1)
    ragged = region_to_hatch(marked | fringe, lit | fringe)
    middle = slice(SIZE // 2 - 30, SIZE // 2 + 30)
    steps = np.abs(np.diff([np.flatnonzero(row)[0] for row in ragged[middle]]))
    assert steps.max() <= 1
    assert np.abs(np.diff([np.flatnonzero(row)[0] for row in (lit | fringe)[middle]])).max() >= 3


def test_the_unlit_side_is_not_hatched() -> None:
    marked, lit = crescent(12)
    assert not (region_to_hatch(marked, lit) & ~lit).any()
    assert not region_to_hatch(np.zeros_like(lit), lit).any()
    assert not region_to_hatch(np.zeros_like(lit), np.zeros_like(lit)).any()


@pytest.mark.parametrize("colour", [(0, 0, 0), (1, 1, 1), (0.7, 0.1, 0.1), (0.55, 0.55, 0.55)])
def test_the_hatching_looks_alike_on_every_ground(colour: tuple[float, float, float]) -> None:
    ground = np.full((24, 24, 3), colour, dtype=float)
    where = np.zeros((24, 24), dtype=bool)
    where[:, 4:] = True
    drawn = hatched(ground, where)
    np.testing.assert_array_equal(drawn[:, :4], ground[:, :4])
    lines = (drawn == 0.85).all(2)
    assert lines[:, 4:].mean() == pytest.approx(0.25)
    veil = drawn[where & ~lines]
    # Dark grey, so that the lines stand out, and never the ground: neither a black shadow nor a white difference.
    assert 0.2 < veil.min() <= veil.max() < 0.6
    assert np.abs(veil - 0.33).max() < 0.21
    # The ground shows through.
    other = hatched(ground * 0.5, where)[where & ~lines]
    assert colour == (0, 0, 0) or np.abs(other - veil).max() > 0.05


def test_a_hair_of_a_wide_region_is_not_hatched() -> None:
    lit = np.ones((SIZE, SIZE), dtype=bool)
    block = (np.abs(X) < 20) & (np.abs(Y) < 20)
    hair = (np.abs(Y) < 1) & (X > 20)
    region = region_to_hatch(block | hair, lit)
    assert (region & block).sum() == block.sum()
    assert not region[X > 24].any()
