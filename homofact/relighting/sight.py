"""The visibility of the sky at vertices: one bit per texel of a cube map, in 64-bit words.

The cube map has at most `SIGHT` texels along a face, in the order of the cells of light (`lobe_light`): a word is a
block of 8 × 8 texels. Nine words in ten are all 0 or all 1, under the horizon or in the open. For each face,
`VertexSight` stores two bit masks, of its full words and of its mixed words, and only the mixed words themselves. This
compression to about a seventh is lossless. The position of a mixed word follows from counting the bits before it in the
mask.

The transport of the same vertices needs the same visibility, and reads it from `VertexSight.texels`.
"""

import hashlib
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from homofact.errors import BadInput
from homofact.files.archive import read_arrays, write_arrays
from homofact.files.reading import read_bytes
from homofact.linear.kernels import kernel
from homofact.linear.threads import in_parallel
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.relighting import cube
from homofact.relighting.blocks import blocks_folder
from homofact.relighting.lobe_light import morton_order
from homofact.relighting.tracer import Tracer

SIGHT = 64
_WORD = 64
_BLOCK = 256
_FACE_BYTES = 2 * 8 + 4
_FULL = np.uint64(0xFFFFFFFFFFFFFFFF)
_EXPECTED = "what vertices see, as homofact wrote it"


class SightArrays(NamedTuple):
    """`VertexSight` as arrays for kernels; `texels` is the number of texels of a face."""

    full: np.ndarray
    mixed: np.ndarray
    starts: np.ndarray
    words: np.ndarray
    texels: int


@dataclass(frozen=True)
class VertexSight:
    """The words of V vertices: masks of `full` and `mixed` words per face, (V, 6) uint64, bit w for word w.

    The mixed `words` (M,) uint64 of a face of a vertex begin at index `starts` (V, 6) uint32. `count` is the number of
    words per face.
    """

    full: np.ndarray
    mixed: np.ndarray
    starts: np.ndarray
    words: np.ndarray
    count: int

    @classmethod
    def of(cls, words: np.ndarray) -> "VertexSight":
        """Compress plain words (V, 6·n²/64) of `traced_sight`."""
        faces = words.reshape(len(words), cube.FACES, -1)
        place = np.arange(faces.shape[2], dtype=np.uint64)
        full, mixed = faces == _FULL, (faces != _FULL) & (faces != 0)
        bits = [(each.astype(np.uint64) << place).sum(2, dtype=np.uint64) for each in (full, mixed)]
        counts = mixed.sum(2).reshape(-1)
        starts = (np.cumsum(counts) - counts).astype(np.uint32).reshape(-1, cube.FACES)
        return cls(bits[0], bits[1], starts, faces[mixed], faces.shape[2])

    @property
    def shape(self) -> tuple[int, int]:
        """Return the shape of `plain`."""
        return len(self.full), cube.FACES * self.count

    @property
    def plain(self) -> np.ndarray:
        """Return the uncompressed words (V, 6·n²/64) uint64."""
        return self._faces(self.full, self.mixed, self.words).reshape(len(self.full), -1)

    def texels(self, vertex: int) -> np.ndarray:
        """Return the visibility of each texel from a vertex, 0 or 1, in the cube map's order: (6·n²,) float32."""
        first = int(self.starts[vertex, 0])
        end = first + sum(int(mixed).bit_count() for mixed in self.mixed[vertex])
        faces = self._faces(self.full[vertex], self.mixed[vertex], self.words[first:end])
        found = np.empty((cube.FACES, self.count * _WORD), np.float32)
        found[:, self._order] = np.unpackbits(faces.astype("<u8").view(np.uint8), axis=1, bitorder="little")
        return found.reshape(-1)

    @property
    def side(self) -> int:
        """Texels along a face."""
        return math.isqrt(self.count * _WORD)

    @cached_property
    def _order(self) -> np.ndarray:
        return morton_order(self.side)

    def _faces(self, full: np.ndarray, mixed: np.ndarray, words: np.ndarray) -> np.ndarray:
        """Return the words (..., 6, n²/64) of faces, given their masks `full` and `mixed` (..., 6)."""
        place = np.arange(self.count, dtype=np.uint64)
        whole, partly = ((each[..., None] >> place) & np.uint64(1) > 0 for each in (full, mixed))
        faces = np.where(whole, _FULL, np.uint64(0))
        faces[partly] = words
        return faces

    @property
    def nbytes(self) -> int:
        """Return the bytes of all arrays."""
        return self.full.nbytes + self.mixed.nbytes + self.starts.nbytes + self.words.nbytes

    @property
    def arrays(self) -> SightArrays:
        """For kernels."""
        return SightArrays(self.full, self.mixed, self.starts, self.words, self.count * _WORD)


def traced_sight(
    mesh: Mesh,
    occluder: Occluder,
    size: int,
    which: np.ndarray | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> np.ndarray:
    """Trace the sky's visibility at every vertex, or at those in `which` (S,): (S, 6·n²/64) uint64.

    n is the size of the cube map, at most `SIGHT`. `progress` is called with (blocks done, blocks).
    """
    side = min(size, SIGHT)
    tracer, order = Tracer(mesh, occluder, side), morton_order(side)
    vertices = np.arange(len(mesh.positions)) if which is None else which
    words = np.zeros((len(vertices), sight_words(size)), np.uint64)
    blocks, done = list(range(0, len(words), _BLOCK)), [0]

    def block(first: int) -> None:
        for row in range(first, min(first + _BLOCK, len(words))):
            seen = tracer.visible(int(vertices[row])).reshape(cube.FACES, -1)[:, order].reshape(-1) > 0
            words[row] = np.packbits(seen, bitorder="little").view("<u8")
        done[0] += 1
        if progress is not None:
            progress(done[0], len(blocks))

    in_parallel(block, blocks)
    return words


def kept_sight(
    mesh: Mesh,
    occluder: Occluder,
    size: int,
    folder: Path | None,
    progress: Callable[[int, int], object] | None = None,
) -> np.ndarray:
    """`traced_sight`, kept in the folder of the object's blocks for a later run.

    Raises BadInput for a damaged file there, or one of other surfaces.
    """
    if folder is None:
        return traced_sight(mesh, occluder, size, progress=progress)
    digest = hashlib.sha256()
    for each in (mesh.lit_at, mesh.normals, *occluder.arrays):
        digest.update(np.ascontiguousarray(each).data)
    file, own = blocks_folder(folder) / "sight.npz", digest.hexdigest()
    if not file.exists():
        write_arrays(file, {"sight": traced_sight(mesh, occluder, size, progress=progress), "digest": np.array(own)})
    read = read_arrays(file, read_bytes(file, _EXPECTED), ("sight", "digest"), _EXPECTED)
    found, shape = read.get("sight"), (len(mesh.positions), sight_words(size))
    if found is None or found.dtype != np.uint64 or found.shape != shape or str(read.get("digest")) != own:
        raise BadInput("not what these vertices see", where=file, expected=f"{_EXPECTED}, or delete it")
    return found


def sight_words(size: int) -> int:
    """Return the words per vertex for a cube map of `size` texels along a face."""
    return cube.FACES * min(size, SIGHT) ** 2 // _WORD


def most_sight_bytes(size: int) -> int:
    """Return the most bytes per vertex of `VertexSight`: all words mixed, two masks and a start per face."""
    return 8 * sight_words(size) + _FACE_BYTES * cube.FACES


@kernel(nogil=True, inline="always")
def ones(word):  # pragma: no cover (compiled)
    """How many bits of a word of 64 are set."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return (word * np.uint64(0x0101010101010101)) >> np.uint64(56)


@kernel(nogil=True, inline="always")
def _word(sight, vertex, face, place):  # pragma: no cover (compiled)
    """Return one visibility word of a vertex's face."""
    bit = np.uint64(1) << np.uint64(place)
    mixed = sight.mixed[vertex, face]
    if mixed & bit:
        return sight.words[np.int64(sight.starts[vertex, face]) + np.int64(ones(mixed & (bit - np.uint64(1))))]
    return np.uint64(0xFFFFFFFFFFFFFFFF) if sight.full[vertex, face] & bit else np.uint64(0)


@kernel(nogil=True, inline="always")
def seen_part(sight, vertex, face, place, size):  # pragma: no cover (compiled)
    """Return the share that a vertex sees of `size` texels (1 or a power of 4) of a face, from index `place`."""
    if size == 1:
        return np.float32((_word(sight, vertex, face, place >> 6) >> np.uint64(place & 63)) & np.uint64(1))
    if size < 64:
        mask = (np.uint64(1) << np.uint64(size)) - np.uint64(1)
        part = (_word(sight, vertex, face, place >> 6) >> np.uint64(place & 63)) & mask
        return np.float32(ones(part)) / np.float32(size)
    total = 0
    for word in range(place >> 6, (place + size) >> 6):
        total += ones(_word(sight, vertex, face, word))
    return np.float32(total) / np.float32(size)
