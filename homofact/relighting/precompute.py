"""Precomputed transport: a few wavelet coefficients of g_k(ωi) V(ωi) cosθi per vertex and term (Wang 2004, (3)).

Embree computes the visibility of a vertex once over its upper hemisphere, for all terms. A vector keeps its N largest
coefficients, as in the paper. With a `tolerance`, each vertex keeps as many as needed so that at most this share of the
root sum square is left out, with each term weighted by the strength of its view map. A coefficient is stored as a
16-bit number, with one scale per vector, and a 16-bit index.

Threads process blocks of vertices. If a folder is given, each block is written there whole or not at all, under the
fingerprint of all its inputs, so an interrupted run resumes with the finished blocks. These are then joined in two
files of the folder, which are memory-mapped. Memory is therefore limited to the current blocks and a few numbers per
vector, whatever the number of coefficients. `cost` estimates it before tracing starts.
"""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numba
import numpy as np

from homofact.errors import BadInput
from homofact.files.archive import write_arrays
from homofact.linear.threads import in_parallel
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.tangents import frames
from homofact.relighting import cube
from homofact.relighting.blocks import BLOCK, LONG, block_file, blocks_folder, claim, joined_blocks, read_block
from homofact.relighting.factors import InOutFactors
from homofact.relighting.interreflection import Interreflection
from homofact.relighting.kernels import keep_above, keep_largest, threshold_of_energy, transport_vectors
from homofact.relighting.sight import VertexSight
from homofact.relighting.tracer import Tracer

KEPT, KEPT_BOUNCED = 96, 64
# Bytes of memory beside the stored vectors: places and frames with what makes them; counts, scales, starts, products.
_VERTEX_BYTES, _VECTOR_BYTES = 400, 64


@dataclass(frozen=True)
class TransportSettings:
    """Settings for the sampling of transport and the number of stored coefficients.

    `cube` texels along a face; `rays` across each texel (1 or 2: one ray or four); `kept` coefficients per vector,
    unless `tolerance` limits the share of a vertex's root sum square that is left out.
    """

    cube: int = 64
    rays: int = 1
    kept: int = KEPT
    tolerance: float | None = None

    def __post_init__(self) -> None:
        """Reject values outside the allowed choices. Raises BadInput."""
        cube.check_size(self.cube)
        if self.rays not in (1, 2):
            raise BadInput(where="rays", found=self.rays, expected="1 or 2 across a texel")
        most = cube.FACES * self.cube**2
        if not isinstance(self.kept, int):
            raise BadInput(where="kept", found=self.kept, expected="a whole number")
        if not 1 <= self.kept <= most:
            raise BadInput(where="kept", found=f"{self.kept} coefficients", expected=f"1 to {most} (6 × {self.cube}²)")
        if self.tolerance is not None and not 0 <= self.tolerance < 1:
            raise BadInput(where="tolerance", found=f"{self.tolerance:g}", expected="0 to below 1")


@dataclass(frozen=True)
class WaveletTransport:
    """Sparse transport of V vertices by K terms, in Haar coefficients of a cube map.

    Vector r = v·K + k consists of entries `start[r]` to `start[r + 1]`: the coefficients `number` times `scale[r]`, at
    the indices `index`. `positions` (V, 3), `frames` (V, 3, 3) rows tangent, binormal, normal, float32.
    """

    positions: np.ndarray
    frames: np.ndarray
    factors: InOutFactors
    settings: TransportSettings
    start: np.ndarray
    index: np.ndarray
    number: np.ndarray
    scale: np.ndarray

    @property
    def vertices(self) -> int:
        """V."""
        return len(self.positions)

    @property
    def nbytes(self) -> int:
        """Return the bytes of the vectors: 4 per coefficient, a scale and a count of 2 bytes per vector."""
        return self.index.nbytes + self.number.nbytes + self.scale.nbytes + 2 * len(self.scale)

    @property
    def mean_kept(self) -> float:
        """Return the mean number of coefficients per vector."""
        return len(self.index) / max(len(self.scale), 1)

    def vector(self, vertex: int, term: int) -> np.ndarray:
        """One vector's coefficients (6·n²,) float64, with zeros."""
        r = vertex * self.factors.terms + term
        part = slice(self.start[r], self.start[r + 1])
        whole = np.zeros(cube.FACES * self.settings.cube**2)
        whole[self.index[part]] = self.number[part] * float(self.scale[r])
        return whole


@dataclass(frozen=True)
class TransportCost:
    """What a precomputation will take: rays, the largest size of the result and the peak of memory, in bytes.

    `disk_bytes` is the size of the blocks and of the files into which they are joined; 0 without a folder.
    """

    rays: int
    most_bytes: int
    peak_bytes: int
    disk_bytes: int = 0

    def describe(self) -> str:
        """Describe the cost in one line, to be printed before tracing."""
        disk = f" and {self.disk_bytes / 1e6:.0f} MB of disk for blocks" if self.disk_bytes else ""
        millions = self.rays / 1e6
        rays = f"{millions:.0f}" if millions >= 10 else f"{millions:.2g}"
        return (
            f"{rays} million rays, at most {self.most_bytes / 1e6:.0f} MB of transport, at most"
            f" {self.peak_bytes / 1e6:.0f} MB of memory{disk}"
        )


def cost(vertices: int, terms: int, settings: TransportSettings, on_disk: bool = False) -> TransportCost:
    """Return upper bounds of the cost of `transport`; `on_disk` if its blocks are stored in a folder.

    The memory excludes that of the program, the mesh and Embree.
    """
    texels = cube.FACES * settings.cube**2
    kept = texels if settings.tolerance is not None else settings.kept
    stored = vertices * terms * (4 * kept + 6)
    threads = numba.get_num_threads()
    # A block's arrays stand there twice while they are put together, and once more while they are written.
    at_work = threads * (BLOCK * terms * kept * 12 + terms * texels * 4 + texels * settings.rays**2 * 40)
    rays = vertices * texels // 2 * settings.rays**2
    peak = vertices * (_VERTEX_BYTES + terms * _VECTOR_BYTES) + at_work
    # Without a folder, blocks and what they are put together to stand in memory at once.
    return TransportCost(rays, stored, peak, 2 * stored) if on_disk else TransportCost(rays, stored, peak + 2 * stored)


def transport(
    mesh: Mesh,
    factors: InOutFactors,
    settings: TransportSettings,
    occluder: Occluder,
    folder: Path | None = None,
    progress: Callable[[int, int], object] | None = None,
    between: Interreflection | None = None,
    sight: VertexSight | None = None,
) -> WaveletTransport:
    """Compute the transport of every vertex of a mesh; everything in `occluder` casts shadows.

    `folder` keeps finished blocks for a later run; `progress` is called with (blocks done, blocks). `between` is the
    interreflected light; it is needed if the factors have terms for it. `sight` is the visibility of the vertices, if
    it is known; otherwise rays are traced. Raises BadInput if the folder has blocks of another mesh, material or
    setting.
    """
    if not len(mesh.positions) or not np.isfinite(mesh.positions).all() or not np.isfinite(mesh.normals).all():
        found = "no vertices" if not len(mesh.positions) else "positions or normals that are not finite"
        raise BadInput(where=mesh.name, found=found, expected="a mesh")
    work = _Work(mesh, factors, settings, occluder, between, sight)
    places = list(range(0, len(mesh.positions), BLOCK))
    if folder is not None:
        claim(blocks_folder(folder), work.fingerprint(), mesh.name)
    done = [0]

    def one(first: int) -> dict[str, np.ndarray]:
        file = None if folder is None else block_file(folder, first)
        vertices = min(BLOCK, len(mesh.positions) - first)
        found = read_block(file, work.factors.terms, vertices) if file else None
        if found is None:
            found = work.block(first, first + vertices)
            if file is not None:
                write_arrays(file, found)
        done[0] += 1
        if progress is not None:
            progress(done[0], len(places))
        return found if file is None else {name: each for name, each in found.items() if name not in LONG}

    blocks = in_parallel(one, places)
    counts = np.concatenate([each["count"] for each in blocks])
    start = np.zeros(len(counts) + 1, np.int64)
    np.cumsum(counts, out=start[1:])
    scale = np.concatenate([each["scale"] for each in blocks])
    if folder is None:
        index, number = (np.concatenate([each[name] for each in blocks]) for name in LONG)
    else:
        index, number = joined_blocks(folder, places, int(start[-1]))
    return WaveletTransport(
        mesh.positions.astype(np.float32), work.rows, factors, settings, start, index, number, scale
    )


class _Work(Tracer):
    """The state that all blocks of a transport share."""

    def __init__(
        self,
        mesh: Mesh,
        factors: InOutFactors,
        settings: TransportSettings,
        occluder: Occluder,
        between: Interreflection | None,
        sight: VertexSight | None,
    ) -> None:
        if factors.bounced and between is None:
            found = f"{factors.bounced} terms of interreflection"
            raise BadInput(where=mesh.name, found=found, expected="the light between surfaces for them")
        super().__init__(mesh, occluder, settings.cube, settings.rays)
        self.mesh, self.factors, self.settings = mesh, factors, settings
        self.rows = frames(mesh.normals).astype(np.float32)
        self.maps, self.between = np.ascontiguousarray(factors.light[: factors.direct].transpose(1, 2, 0)), between
        self.weights = factors.weights
        alike = sight is not None and settings.rays == 1 and sight.side == settings.cube
        self.seen_by = sight.texels if sight is not None and alike else self.visible

    def fingerprint(self) -> str:
        """Return a digest of all inputs of the blocks."""
        said = (self.settings, self.mesh.name, *(["cosine"] if self.factors.cosine else []))
        digest = hashlib.sha256(repr(said).encode())
        for each in (self.positions, self.rows, self.maps, self.factors.view, *self.occluder.arrays):
            digest.update(np.ascontiguousarray(each).data)
        if self.between is not None:
            digest.update(self.between.shares.data)
        return digest.hexdigest()

    def block(self, first: int, last: int) -> dict[str, np.ndarray]:
        """Compute `blocks.PARTS` of the vertices `first` to `last` − 1."""
        terms, texels = self.factors.terms, len(self.angles)
        vectors = np.empty((terms, texels), np.float32)
        direct, scratch = vectors[: self.factors.direct], np.empty((self.settings.cube,) * 2, np.float32)
        index, number = np.empty(texels, np.uint16), np.empty(texels, np.int16)
        counts, scales = np.zeros((last - first) * terms, np.int32), np.zeros((last - first) * terms, np.float32)
        places, numbers = [], []
        tolerance = self.settings.tolerance
        for v in range(first, last):
            lit = self.seen_by(v)
            cosine = self.factors.cosine
            transport_vectors(self.rows[v], lit, self.directions, self.angles, self.maps, cosine, direct, scratch)
            if self.between is not None and self.factors.bounced:
                # The same light for both parts of a material with a texture.
                parts = 2 if self.factors.tinted else 1
                count = self.factors.bounced // parts
                received = self.between.vectors(self.positions[v], self.rows[v], count, self.settings.cube)
                vectors[len(direct) :] = np.tile(received, (parts, 1))
            square = 0.0 if tolerance is None else threshold_of_energy(vectors, self.weights, tolerance)
            for k in range(terms):
                if tolerance is None:
                    most = self.settings.kept if k < len(direct) else min(self.settings.kept, KEPT_BOUNCED)
                    count, scale = keep_largest(vectors[k], most, index, number)
                else:
                    count, scale = keep_above(vectors[k], float(self.weights[k]), square, index, number)
                r = (v - first) * terms + k
                counts[r], scales[r] = count, scale
                places.append(index[:count].copy())
                numbers.append(number[:count].copy())
        return {
            "count": counts,
            "index": np.concatenate(places),
            "number": np.concatenate(numbers),
            "scale": scales,
        }
