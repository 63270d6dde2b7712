"""A cube map's light in cells of all sizes, for sums over a lobe.

A face of n × n texels is divided into quarters, down to single texels: level k has cells of 2^k × 2^k texels, up to 8 ×
8 cells a face. Texels are stored in Morton order, so the texels of a cell and of its four parts are contiguous. The
light of a cell is the mean of its texels weighted by solid angle. If one texel contains more than `BRIGHT` of all the
light, its cells are always divided, since their light and shadow come from one spot.
"""

from dataclasses import dataclass

import numpy as np

from homofact.relighting import cube

BRIGHT = 1e-3
_ROOTS = 8  # cells along a face of the coarsest level


@dataclass(frozen=True)
class LightCells:
    """Cells of all levels, level k from `starts`[k] on, face by face.

    `light` (N, 3) float32 is their radiance; `places` (N, 4) float32 the direction of a cell's centre and the root of
    its solid angle, below 0 where the cell is never taken as a whole. `side` are the texels along a face.
    """

    light: np.ndarray
    places: np.ndarray
    starts: np.ndarray
    side: int

    @classmethod
    def of(cls, radiance: np.ndarray) -> "LightCells":
        """Those of a cube map of radiance (6, n, n, 3)."""
        side = radiance.shape[1]
        order = morton_order(side)
        solid = np.tile(cube.solid_angles(side).reshape(-1)[order], (cube.FACES, 1))
        flux = radiance.reshape(cube.FACES, -1, 3)[:, order] * solid[..., None]
        peak, all_light = flux.mean(-1), flux.mean(-1).sum()
        lights, places, starts = [], [], [0]
        size = side
        while True:
            towards = cube.directions(size).reshape(cube.FACES, -1, 3)[:, morton_order(size)]
            # A texel itself is not divided.
            whole = (peak <= BRIGHT * all_light) | (size == side)
            place = np.concatenate((towards, (np.sqrt(solid) * np.where(whole, 1, -1))[..., None]), -1)
            lights.append((flux / solid[..., None]).reshape(-1, 3))
            places.append(place.reshape(-1, 4))
            if size == _ROOTS:
                break
            starts.append(starts[-1] + len(lights[-1]))
            size //= 2
            flux, solid = flux.reshape(cube.FACES, -1, 4, 3).sum(2), solid.reshape(cube.FACES, -1, 4).sum(2)
            peak = peak.reshape(cube.FACES, -1, 4).max(2)
        return cls(
            np.concatenate(lights).astype(np.float32), np.concatenate(places).astype(np.float32),
            np.array(starts, np.int64), side,
        )  # fmt: skip


def morton_order(side: int) -> np.ndarray:
    """The flat indices (n²,) of a face's texels in Morton's order: bits of row and column in turn, the row's first."""
    place = np.arange(side * side)
    row, column = np.zeros_like(place), np.zeros_like(place)
    for bit in range(side.bit_length() - 1):
        row |= (place >> (2 * bit + 1) & 1) << bit
        column |= (place >> (2 * bit) & 1) << bit
    return row * side + column
