"""Clustered principal components of transport: the compact form (Sloan, Hall, Hart and Snyder 2003; Liu et al. 2004).

Vertices are divided into clusters. The transport of a vertex (all K terms together) is the mean of its cluster plus a
few components, multiplied by the weights of the vertex. Only the means and components are multiplied by the light. Each
vertex then combines the results: T_v L ≈ M_c L + Σ_i w_vi P_ci L. The stored data are C (n + 1) sparse vectors of means
and components, and n numbers per vertex.

Distances between transports are measured on a sketch: the products of the transports with random vectors of ±1 (Johnson
and Lindenstrauss 1984). This reduces V × 98,304 numbers to V × 128 and preserves scalar products within a few percent.
k-means makes the first clusters. In a few further rounds every vertex moves to the cluster whose components approximate
it best, as Sloan et al. do. The final components come from the full vectors: they are eigenvectors of the Gram matrix
of a cluster's sparse rows.
"""

import warnings
from dataclasses import dataclass

import numpy as np
from scipy.cluster.vq import kmeans2
from scipy.sparse import csr_array

from homofact.errors import BadInput
from homofact.linear.threads import one_thread
from homofact.relighting import cube
from homofact.relighting.factors import InOutFactors
from homofact.relighting.kernels import keep_largest
from homofact.relighting.precompute import WaveletTransport

COMPONENTS, KEPT = 12, 256
_SKETCH, _ROUNDS, _A_CLUSTER = 128, 4, 128
_MOST = 32767


@dataclass(frozen=True)
class Clustered:
    """Transport as means and components.

    `basis` contains the means and components like C·(n + 1) vertices with K terms each. Those of cluster c start at
    index c (n + 1), and the mean comes first. `cluster` (V,) uint16 and `weights` (V, n) int16 times `steps` (C, n)
    give the mix of each vertex. `positions`, `frames` and `factors` are the object's.
    """

    positions: np.ndarray
    frames: np.ndarray
    factors: InOutFactors
    basis: WaveletTransport
    cluster: np.ndarray
    weights: np.ndarray
    steps: np.ndarray

    @property
    def components(self) -> int:
        """n."""
        return self.weights.shape[1]

    @property
    def nbytes(self) -> int:
        """Return the bytes of the basis, and of each vertex's cluster number and weights."""
        return self.basis.nbytes + self.cluster.nbytes + self.weights.nbytes + self.steps.nbytes

    def mixed(self, lit: np.ndarray) -> np.ndarray:
        """K-tuples (V, K, 3) of the vertices from those of the basis (C·(n + 1), K, 3)."""
        parts = lit.reshape(len(self.steps), self.components + 1, *lit.shape[1:])
        weights = self.weights * self.steps[self.cluster]
        found = np.empty((len(self.cluster), *lit.shape[1:]), lit.dtype)
        for c, own in enumerate(parts):
            rows = self.cluster == c
            found[rows] = own[0] + np.tensordot(weights[rows], own[1:], 1)
        return found


@one_thread
def clustered(
    transport: WaveletTransport,
    components: int = COMPONENTS,
    kept: int = KEPT,
    clusters: int | None = None,
    seed: int = 0,
) -> Clustered:
    """Return the compact form of a transport, by default with about 128 vertices per cluster.

    `kept` is the number of coefficients per term that each mean and component stores. Raises BadInput for numbers below
    1 and for more clusters or components than vertices.
    """
    count = -(-transport.vertices // _A_CLUSTER) if clusters is None else clusters
    for what, value, most in (
        ("clusters", count, transport.vertices),
        ("components", components, transport.vertices),
        ("kept", kept, cube.FACES * transport.settings.cube**2),
    ):
        if not 1 <= value <= most:
            raise BadInput(where=what, found=value, expected=f"1 to {most}")
    rows = _rows(transport)
    rng = np.random.default_rng(seed)
    length = transport.factors.terms * cube.FACES * transport.settings.cube**2
    signs = rng.integers(0, 2, (length, _SKETCH), np.int8).astype(np.float32) * 2 - 1
    sketch = np.asarray(rows @ signs) / np.sqrt(_SKETCH)
    with warnings.catch_warnings():
        # A cluster that runs empty is left out.
        warnings.filterwarnings("ignore", "One of the clusters is empty")
        labels = kmeans2(sketch, count, iter=12, minit="points", rng=rng)[1]
    labels = _settled(sketch, labels, count, components)
    used, labels = np.unique(labels, return_inverse=True)
    vectors, weights = _SparseVectors(transport, kept), np.zeros((transport.vertices, components), np.float32)
    for c in range(len(used)):
        own = np.flatnonzero(labels == c)
        basis, mixing = _components(rows[own], components)
        vectors.add(basis)
        weights[own] = mixing
    steps = np.stack([np.abs(weights[labels == c]).max(0) for c in range(len(used))]) / _MOST
    steps = np.maximum(steps, 1e-30).astype(np.float32)
    numbers = np.rint(weights / steps[labels]).astype(np.int16)
    cluster = labels.astype(np.uint16)
    return Clustered(
        transport.positions, transport.frames, transport.factors, vectors.joined(), cluster, numbers, steps
    )


def _rows(transport: WaveletTransport) -> csr_array:
    """Return the transport as a sparse matrix (V, K·6·n²) float32, terms weighted by their view maps' strength."""
    terms, texels = transport.factors.terms, cube.FACES * transport.settings.cube**2
    weight = transport.factors.weights
    vector = np.repeat(np.arange(len(transport.scale)), np.diff(transport.start))
    term = vector % terms
    values = transport.number * (transport.scale[vector] * weight[term])
    places = term * texels + transport.index
    start = transport.start[::terms]
    return csr_array((values.astype(np.float32), places, start), (transport.vertices, terms * texels))


def _settled(sketch: np.ndarray, labels: np.ndarray, count: int, components: int) -> np.ndarray:
    """Return the labels after repeatedly moving each vertex to the cluster that approximates it best."""
    for _ in range(_ROUNDS):
        error = np.full((len(sketch), count), np.inf, np.float32)
        for c in range(count):
            own = sketch[labels == c]
            if not len(own):
                continue
            mean = own.mean(0)
            _, _, axes = np.linalg.svd(own - mean, full_matrices=False)
            off = sketch - mean
            error[:, c] = (off**2).sum(1) - ((off @ axes[:components].T) ** 2).sum(1)
        moved = error.argmin(1)
        if (moved == labels).all():
            break
        labels = moved
    return labels


def _components(rows: csr_array, components: int) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and components (n + 1, J) float32 and weights (V_c, n) of rows; missing components are 0."""
    gram = (rows @ rows.T).toarray().astype(np.float64)
    count = len(gram)
    mean = np.asarray(rows.sum(0)).reshape(-1) / count
    centred = gram - gram.mean(0) - gram.mean(1)[:, None] + gram.mean()
    power, vectors = np.linalg.eigh(centred)
    kept = min(components, count - 1)
    root = np.sqrt(np.maximum(power[::-1][:kept], 0))
    u = vectors[:, ::-1][:, :kept]
    real = root > 1e-6 * max(root.max(initial=0.0), 1e-30)
    basis = np.zeros((components + 1, mean.size), np.float32)
    basis[0] = mean
    inverse = np.where(real, 1 / np.maximum(root, 1e-30), 0.0)
    combined = (u * inverse).T
    basis[1 : kept + 1] = np.asarray(rows.T @ combined.T).T - np.outer(combined.sum(1), mean)
    weights = np.zeros((count, components))
    weights[:, :kept] = u * np.where(real, root, 0.0)
    return basis, weights.astype(np.float32)


class _SparseVectors:
    """Collects vectors and keeps only their largest coefficients, because all full vectors would need gigabytes."""

    def __init__(self, transport: WaveletTransport, kept: int) -> None:
        self._like, self._kept, self._count = transport, kept, 0
        self._counts: list[int] = []
        self._scales: list[float] = []
        self._places: list[np.ndarray] = []
        self._numbers: list[np.ndarray] = []

    def add(self, vectors: np.ndarray) -> None:
        """Add vectors (B, K·J) after dividing them by their terms' weights."""
        factors = self._like.factors
        weight = np.maximum(factors.weights, 1e-30)
        texels = cube.FACES * self._like.settings.cube**2
        parts = vectors.reshape(len(vectors), factors.terms, texels) / weight[:, None]
        index, number = np.empty(texels, np.uint16), np.empty(texels, np.int16)
        for vector in parts.reshape(-1, texels).astype(np.float32):
            count, scale = keep_largest(vector, self._kept, index, number)
            self._counts.append(count)
            self._scales.append(scale)
            self._places.append(index[:count].copy())
            self._numbers.append(number[:count].copy())
        self._count += len(vectors)

    def joined(self) -> WaveletTransport:
        """Return all vectors as a transport."""
        empty, frames = np.zeros((self._count, 3), np.float32), np.zeros((self._count, 3, 3), np.float32)
        return WaveletTransport(
            empty, frames, self._like.factors, self._like.settings,
            np.concatenate(([0], np.cumsum(self._counts))), np.concatenate(self._places),
            np.concatenate(self._numbers), np.array(self._scales, np.float32),
        )  # fmt: skip
