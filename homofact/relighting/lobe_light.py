"""A cube map's light in cells of all sizes, for sums over a lobe; and what a vertex sees of the cells.

A face of n × n texels is divided into quarters, down to single texels: level k has cells of 2^k × 2^k texels, up to 8 ×
8 cells a face. Texels are stored in Morton order, so the texels of a cell and of its four parts are contiguous. The
light of a cell is the mean of its texels weighted by solid angle. If one texel contains more than `BRIGHT` of all the
light, its cells are always divided, since their light and shadow come from one spot.

The visibility of a vertex is one bit per texel of a cube map of at most `SIGHT` texels along a face, in the same order.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from homofact.errors import BadInput
from homofact.files.archive import read_arrays, write_arrays
from homofact.files.reading import read_bytes
from homofact.linear.kernels import kernel
from homofact.linear.threads import in_parallel
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.relighting import cube
from homofact.relighting.tracer import Tracer

SIGHT, BRIGHT = 64, 1e-3
_ROOTS = 8  # cells along a face of the coarsest level
_WORD = 64
_BLOCK = 256
_EXPECTED = "what vertices see, as homofact wrote it"


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


def traced_sight(mesh: Mesh, occluder: Occluder, size: int, which: np.ndarray | None = None) -> np.ndarray:
    """What every vertex sees, or those of `which` (S,): (S, 6·n²/64) uint64.

    n is the size of the cube map, at most `SIGHT`.
    """
    side = min(size, SIGHT)
    tracer, order = Tracer(mesh, occluder, side), morton_order(side)
    vertices = np.arange(len(mesh.positions)) if which is None else which
    words = np.zeros((len(vertices), sight_words(size)), np.uint64)

    def block(first: int) -> None:
        for row in range(first, min(first + _BLOCK, len(words))):
            seen = tracer.visible(int(vertices[row])).reshape(cube.FACES, -1)[:, order].reshape(-1) > 0
            words[row] = np.packbits(seen, bitorder="little").view("<u8")

    in_parallel(block, list(range(0, len(words), _BLOCK)))
    return words


def kept_sight(mesh: Mesh, occluder: Occluder, size: int, folder: Path | None) -> np.ndarray:
    """`traced_sight`, kept in the folder of the object's blocks for a later run. Raises BadInput for a damaged file."""
    if folder is None:
        return traced_sight(mesh, occluder, size)
    file = folder / "sight.npz"
    if not file.exists():
        write_arrays(file, {"sight": traced_sight(mesh, occluder, size)})
    found = read_arrays(file, read_bytes(file, _EXPECTED), ("sight",), _EXPECTED).get("sight")
    shape = (len(mesh.positions), sight_words(size))
    if found is None or found.dtype != np.uint64 or found.shape != shape:
        raise BadInput("not what so many vertices see", where=file, expected=f"{_EXPECTED}, or delete it")
    return found


def sight_words(size: int) -> int:
    """Words a vertex for a cube map of so many texels along a face."""
    return cube.FACES * min(size, SIGHT) ** 2 // _WORD


@kernel(nogil=True, inline="always")
def ones(word):  # pragma: no cover (compiled)
    """How many bits of a word of 64 are set."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return (word * np.uint64(0x0101010101010101)) >> np.uint64(56)


@kernel(nogil=True, inline="always")
def seen_part(words, face, place, size, texels):  # pragma: no cover (compiled)
    """The part that is seen of `size` texels (a power of 4, or 1) of a face from `place` on; `texels` are a face's."""
    at = face * texels + place
    if size == 1:
        return np.float32((words[at >> 6] >> np.uint64(at & 63)) & np.uint64(1))
    if size < 64:
        mask = (np.uint64(1) << np.uint64(size)) - np.uint64(1)
        return np.float32(ones((words[at >> 6] >> np.uint64(at & 63)) & mask)) / np.float32(size)
    total = 0
    for word in range(at >> 6, (at + size) >> 6):
        total += ones(words[word])
    return np.float32(total) / np.float32(size)
