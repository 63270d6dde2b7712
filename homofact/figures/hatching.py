"""Hatch the part of a picture that lies beyond the measurement: one region, in one style on every picture.

The hatching is a grey veil with light lines. The veil lets a fit show through, because samples of a few planes cover
little of a sphere, and hatching that hides the rest would hide nearly the whole fit.
"""

import math

import numpy as np
from scipy.ndimage import binary_closing, binary_dilation, binary_fill_holes, binary_opening, label

# Of the picture's width: narrower regions are not hatched. Of the lit pixels: smaller ones are not hatched either, and
# smaller holes are.
NARROWEST, SMALLEST = 0.05, 0.02
_GAP = 0.0375  # of the picture's width: narrower gaps are hatched
_THINNEST = 3  # pixels, also of regions that are wider elsewhere
_VEIL, _OPACITY, _LINES, _PERIOD = (0.33, 0.33, 0.33), 0.7, (0.85, 0.85, 0.85), 8


def hatched(pixels: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Return pixels (H, W, 3) in [0, 1] with the veil and its lines at 45° where the mask (H, W) is True."""
    y, x = np.indices(where.shape)
    lines = where & ((x + y) % _PERIOD < 2)
    veiled = (1 - _OPACITY) * pixels + _OPACITY * np.array(_VEIL)
    return np.where(lines[..., None], _LINES, np.where(where[..., None], veiled, pixels))


def region_to_hatch(marked: np.ndarray, lit: np.ndarray) -> np.ndarray:
    """Return the region (H, W) to draw for the marked pixels (H, W) of a picture with lit pixels (H, W).

    Marked areas that are narrow (`NARROWEST`) or small (`SMALLEST`) are dropped: at the rim, at the shadow, or between
    two measured angles, hatching looks like a defect of the material. Small gaps are closed. The region ends where the
    light ends, with an outline as smooth as the region's own.
    """
    width = marked.shape[1]
    gap, side = math.ceil(_GAP * width), math.ceil(NARROWEST * width)
    # The light of a lamp ends in steps.
    ground = np.asarray(binary_opening(_closed(lit, side), _disc(gap)), dtype=bool)
    whole = binary_opening(_closed(marked & lit, gap) & ground, _disc(_THINNEST))
    core = binary_opening(whole, _disc(side))
    region = binary_dilation(core, iterations=side, mask=whole)
    smallest = SMALLEST * lit.sum()
    region = _large(region, smallest)
    holes = np.asarray(binary_fill_holes(region), dtype=bool) & ~region
    return region | (holes & ~_large(holes, smallest) & ground)


def _closed(mask: np.ndarray, across: int) -> np.ndarray:
    """Return a mask with gaps up to `across` pixels closed, as if nothing were beyond the picture's edge."""
    return binary_closing(np.pad(mask, across), _disc(across))[across:-across, across:-across]


def _large(mask: np.ndarray, smallest: float) -> np.ndarray:
    """Return the connected parts of a mask that have at least `smallest` pixels."""
    parts = np.zeros(mask.shape, dtype=np.int32)
    label(mask, output=parts)
    sizes = np.bincount(parts.ravel())
    sizes[0] = 0
    return (sizes >= max(smallest, 1))[parts]


def _disc(across: int) -> np.ndarray:
    y, x = np.indices((across, across)) - (across - 1) / 2
    return x**2 + y**2 <= (across / 2) ** 2
