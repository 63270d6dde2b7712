"""A cube map's light in cells of all sizes, for sums over a lobe.

A face of n × n texels is divided into quarters, down to single texels: level k has cells of 2^k × 2^k texels, up to 8 ×
8 cells a face. Texels are stored in Morton order, so the texels of a cell and of its four parts are contiguous. The
light of a cell is the mean of its texels weighted by solid angle. If one texel contains more than `BRIGHT` of all the
light, the cells that contain it are always divided, since their light and shadow come from one spot.

For a lobe narrower than a texel (`texel_pattern`) there are finer levels still: a texel divided into 2 × 2 or 4 × 4
cells, each with the radiance of its texel.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from homofact.relighting import cube

BRIGHT = 1e-3
_ROOTS = 8  # cells along a face of the coarsest level


@dataclass(frozen=True)
class LightCells:
    """Cells of all levels, level k from `starts`[k] on, face by face; the first `divisions` levels are parts of texels.

    Each row of `parts` (P, 4) and `places` (N, 4), float32, is the direction of a cell's centre and the square root of
    its solid angle, negative if the cell contains a bright texel. Row i of `places` is cell P + i. `light` (N, 3)
    float32 is the radiance of texels and larger cells.
    """

    light: np.ndarray
    places: np.ndarray
    parts: np.ndarray
    starts: np.ndarray
    divisions: int

    @classmethod
    def of(cls, radiance: np.ndarray, divisions: int = 0) -> "LightCells":
        """Make the cells of a cube map (6, n, n, 3), its texels divided `divisions` times into 2 × 2 parts."""
        size = radiance.shape[1]
        parts = _parts(size, divisions)
        lights, places = [], []
        counts = [cube.FACES * (size << more) ** 2 for more in range(divisions, 0, -1)]
        starts = [sum(counts[:k]) for k in range(divisions + 1)]
        solid = _cells(size)[1]
        flux = radiance.reshape(cube.FACES, -1, 3)[:, morton_order(size)] * solid[..., None]
        peak, all_light = flux.mean(-1), flux.mean(-1).sum()
        while True:
            places.append(_places(_cells(size)[0], solid, peak > BRIGHT * all_light))
            lights.append((flux / solid[..., None]).reshape(-1, 3))
            if size == _ROOTS:
                break
            starts.append(starts[-1] + len(lights[-1]))
            size //= 2
            flux, solid = flux.reshape(cube.FACES, -1, 4, 3).sum(2), solid.reshape(cube.FACES, -1, 4).sum(2)
            peak = peak.reshape(cube.FACES, -1, 4).max(2)
        return cls(
            np.concatenate(lights).astype(np.float32), np.concatenate(places).astype(np.float32), parts,
            np.array(starts, np.int64), divisions,
        )  # fmt: skip

    def directions(self, numbers: np.ndarray) -> np.ndarray:
        """Unit vectors (M, 3) to the centres of cells."""
        count = len(self.parts)
        found = self.places[np.maximum(numbers - count, 0), :3]
        of_parts = numbers < count
        found[of_parts] = self.parts[numbers[of_parts], :3]
        return found.astype(np.float64)


def _places(towards: np.ndarray, solid: np.ndarray, bright: np.ndarray) -> np.ndarray:
    """Return rows of cell direction and square root of solid angle, with a negative root for `bright` cells."""
    return np.concatenate((towards, (np.sqrt(solid) * np.where(bright, -1, 1))[..., None]), -1).reshape(-1, 4)


@lru_cache(maxsize=8)
def _parts(side: int, divisions: int) -> np.ndarray:
    """Return rows (P, 4) float32 for subdivided cube map texels, finest level first, grouped by texel."""
    found = [np.zeros((0, 4))]
    for more in range(divisions, 0, -1):
        towards, solid = _cells(side << more)
        found.append(_places(towards, solid, np.zeros_like(solid, bool)))
    return np.concatenate(found).astype(np.float32)


@lru_cache(maxsize=8)
def _cells(side: int) -> tuple[np.ndarray, np.ndarray]:
    """Return directions (6, n², 3) and solid angles (6, n²) of a cube map's texels in Morton order."""
    order = morton_order(side)
    towards = cube.directions(side).reshape(cube.FACES, -1, 3)[:, order]
    return towards, np.tile(cube.solid_angles(side).reshape(-1)[order], (cube.FACES, 1))


def morton_order(side: int) -> np.ndarray:
    """The flat indices (n²,) of a face's texels in Morton's order: bits of row and column in turn, the row's first."""
    place = np.arange(side * side)
    row, column = np.zeros_like(place), np.zeros_like(place)
    for bit in range(side.bit_length() - 1):
        row |= (place >> (2 * bit + 1) & 1) << bit
        column |= (place >> (2 * bit) & 1) << bit
    return row * side + column
