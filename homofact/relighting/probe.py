"""The error of each approximation of an object, measured at a few vertices before transport is computed.

At each vertex the transport of all terms is computed once. Its coefficients are counted by magnitude and by groups of
terms (`kernels.binned`), so that the error and the size of every number of terms at every threshold are sums of bins.
The light is the scene's light in four rotations about y, at the same vertices. A lamp that no vertex mirrors in one
rotation may be mirrored in another. Errors are relative RMS over vertices, rotations and channels, as in `errors`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from homofact.errors import BadInput
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.tangents import frames
from homofact.relighting import cube
from homofact.relighting.factors import InOutFactors, look_up, view_values
from homofact.relighting.harmonic import harmonic_maps
from homofact.relighting.kernels import binned, transport_vectors
from homofact.relighting.lobe import SeparateLobe, SurfacePoints
from homofact.relighting.lobe_table import LobeTable
from homofact.relighting.relight import light_coefficients
from homofact.relighting.seen import SeenVertices
from homofact.relighting.sight import VertexSight, traced_sight
from homofact.relighting.tracer import Tracer
from homofact.rendering.light import EnvironmentMap

TURNS = 4
_BINS = 2048


@dataclass(frozen=True)
class ProbedVertices:
    """Vertices `which` (S,) of a mesh and the eye's direction (S, 3) in their frames."""

    mesh: Mesh
    occluder: Occluder
    which: np.ndarray
    wo: np.ndarray


@dataclass(frozen=True)
class ProbedErrors:
    """Errors by groups of terms: index g of each array is for the terms of the first g + 1 groups together.

    `maps` (G, M) is the error of maps of each size against the last; `counts` and `squares` (S, G, B) are the number of
    coefficients in each of B bins and the sum of their squares. `sent` (S, G, B, T·3) is their reflected light under T
    rotations of the light. `smooth` (S, G, N, T·3) is the light by harmonics up to each of the N `orders`. `share` is
    the argument of `beside`.
    """

    maps: np.ndarray
    counts: np.ndarray
    squares: np.ndarray
    sent: np.ndarray
    smooth: np.ndarray
    orders: tuple[int, ...]
    share: float = 1.0

    def beside(self, share: float) -> "ProbedErrors":
        """Return the errors relative to all light, of which this light is the RMS share `share`."""
        return replace(self, maps=self.maps * share, share=share)

    def harmonics(self, group: int) -> np.ndarray:
        """Return the errors (N,) of harmonics up to each order, for the terms of the first `group` + 1 groups."""
        whole = self.sent[:, group].sum(1)
        return self.share * np.array([_relative(self.smooth[:, group, n], whole) for n in range(len(self.orders))])

    def truncated(self, group: int, allowed: float) -> tuple[float, float, float]:
        """Return (tolerance, error, coefficients per vertex) of the largest tolerance within `allowed` error."""
        whole = self.sent[:, group].sum(1)
        gone = self.squares[:, group].cumsum(1)
        left = self.sent[:, group].cumsum(1)
        found = (0.0, 0.0, float(self.counts[:, group].sum(1).mean()))
        for tolerance in _TOLERANCES:
            # As `threshold_of_energy`: bins from the smallest on, while they fit.
            bins = (gone <= tolerance**2 * gone[:, -1:]).sum(1) - 1
            rows = np.arange(len(bins))
            out = np.where((bins >= 0)[:, None], left[rows, bins], 0.0)
            error = self.share * _relative(whole - out, whole)
            if error > allowed:
                break
            lost = np.where(bins >= 0, self.counts[:, group].cumsum(1)[rows, bins], 0)
            found = (tolerance, error, float((self.counts[:, group].sum(1) - lost).mean()))
        return found


# From what leaves next to nothing out to half of everything.
_TOLERANCES = tuple(float(each) for each in np.geomspace(1e-4, 0.5, 50))


def measured(
    probed: ProbedVertices,
    sizes: Sequence[InOutFactors],
    at: int,
    groups: np.ndarray,
    light: EnvironmentMap,
    size: int,
    orders: Sequence[int],
) -> ProbedErrors:
    """Measure the same terms on maps of several sizes; transport vectors use the maps at index `at`.

    Cube maps have `size` texels along a face. `groups` (K,) is each term's group, in ascending order. Raises BadInput
    where no light reaches the vertices.
    """
    count, terms = int(groups.max()) + 1, sizes[0].terms
    radiance = [cube.environment_cube(light.turned(2 * math.pi * k / TURNS), size) for k in range(TURNS)]
    flat = np.concatenate([each.reshape(-1, 3) for each in radiance], 1)
    coefficients = np.concatenate([light_coefficients(each, size) for each in radiance], 1)
    angles = np.tile(cube.solid_angles(size).reshape(-1), cube.FACES)
    tracer = Tracer(probed.mesh, probed.occluder, size)
    rows = frames(probed.mesh.normals[probed.which])
    views = [view_values(each, probed.wo) for each in sizes]
    maps = [torch.from_numpy(each.light).permute(1, 2, 0).double() for each in sizes]
    kept = np.ascontiguousarray(sizes[at].light.transpose(1, 2, 0))
    into, back = harmonic_maps(max(orders), size)
    smooth_light, back = into @ coefficients, back.astype(np.float32)
    number = len(probed.which)
    counts, squares = (np.zeros((number, count, _BINS)) for _ in range(2))
    sent = np.zeros((number, count, _BINS, 3 * TURNS))
    by_map = np.zeros((len(sizes), number, count, 3 * TURNS))
    smooth = np.zeros((number, count, len(orders), 3 * TURNS))
    vectors, scratch = np.empty((terms, len(angles)), np.float32), np.empty((size, size), np.float32)
    group = groups.astype(np.int64)

    def grouped(values: np.ndarray) -> np.ndarray:
        found = np.zeros((count, *values.shape[1:]))
        np.add.at(found, group, values)
        return found

    for s, v in enumerate(probed.which.tolist()):
        lit = tracer.visible(v)
        seen = np.flatnonzero(lit)
        wi = tracer.directions[seen].astype(np.float64) @ rows[s].T
        flux = flat[seen] * (lit * angles)[seen, None] * np.maximum(wi[:, 2:], 0)
        for m, each in enumerate(maps):
            got = look_up(each, torch.from_numpy(wi)).numpy().T @ flux
            by_map[m, s] = grouped(got * np.tile(views[m][s], TURNS))
        transport_vectors(
            rows[s].astype(np.float32), lit, tracer.directions, tracer.angles, kept, False, vectors, scratch
        )
        weights = sizes[at].weights.astype(np.float64)
        binned(vectors, weights, group, coefficients, views[at][s], counts[s], squares[s], sent[s])
        low = (vectors @ back.T).astype(np.float64)
        for n, order in enumerate(orders):
            few = (order + 1) ** 2
            smooth[s, :, n] = grouped(low[:, :few] @ smooth_light[:few] * np.tile(views[at][s], TURNS))
    if not sent.any():
        raise BadInput("no light reaches the vertices that were drawn", where=probed.mesh.name, expected="some")
    by_map = by_map.cumsum(2)
    counts, squares, sent, smooth = (each.cumsum(1) for each in (counts, squares, sent, smooth))
    errors = np.array([[_relative(each[:, g], by_map[-1][:, g]) for each in by_map] for g in range(count)])
    return ProbedErrors(errors, counts, squares, sent, smooth, tuple(orders))


def _relative(found: np.ndarray, truth: np.ndarray) -> float:
    return float(np.sqrt(((found - truth) ** 2).sum() / max((truth**2).sum(), 1e-300)))


def lobe_beside(
    probed: ProbedVertices, table: LobeTable, radiance: np.ndarray, rest: np.ndarray
) -> tuple[float, float]:
    """Return (RMS share of the rest, RMS error of the lobe), both relative to all light at the vertices.

    `radiance` (6, n, n, 3) is the light; `rest` (S, 3) is the part of it that the vertices reflect without the lobe.
    """
    which = probed.which
    seen = SeenVertices(probed.mesh, table, probed.occluder, np.full(3, np.inf), which, view=probed.wo)
    exact = seen.dense(radiance, radiance.shape[1])
    lobe = SeparateLobe(table, VertexSight.of(traced_sight(probed.mesh, probed.occluder, radiance.shape[1], which)))
    points = SurfacePoints.at_vertices(seen.rows, probed.wo, np.arange(len(which)))
    found = lobe.at(points, lobe.cells(radiance))
    whole = exact + rest
    every = max(float((whole**2).sum()), 1e-300)
    return float(np.sqrt((rest**2).sum() / every)), float(np.sqrt(((found - exact) ** 2).sum() / every))
