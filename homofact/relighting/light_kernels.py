"""Compiled loops of relighting's run time: products of all vectors with a light, and the look-ups of a view."""

import math

import numpy as np
from numba import prange

from homofact.linear.kernels import kernel
from homofact.relighting.kernels import place


@kernel(nogil=True, parallel=True, fastmath=True)
def relight_all(
    start: np.ndarray, index: np.ndarray, number: np.ndarray, scale: np.ndarray, light: np.ndarray, out: np.ndarray
) -> None:
    """Write each vector's product with the transformed `light` (J, 4), fourth column unused, to `out` (R, 3)."""
    for r in prange(len(scale)):
        red, green, blue = np.float32(0), np.float32(0), np.float32(0)
        for p in range(start[r], start[r + 1]):
            j = index[p]
            value = np.float32(number[p])
            red += value * light[j, 0]
            green += value * light[j, 1]
            blue += value * light[j, 2]
        out[r, 0], out[r, 1], out[r, 2] = red * scale[r], green * scale[r], blue * scale[r]


@kernel(nogil=True, fastmath=True)
def add_columns(
    chosen: np.ndarray,
    start: np.ndarray,
    rows: np.ndarray,
    values: np.ndarray,
    change: np.ndarray,
    first: int,
    last: int,
    out: np.ndarray,
) -> None:
    """Add the change (J, 3) of the `chosen` coefficients to `out` (R, 3), rows from `first` to below `last` alone.

    `start` (J + 1), `rows` and `values` hold the transport by coefficient, rows rising within each.
    """
    for j in chosen:
        red, green, blue = change[j, 0], change[j, 1], change[j, 2]
        begin, end = start[j], start[j + 1]
        low = begin + np.searchsorted(rows[begin:end], first)
        high = begin + np.searchsorted(rows[begin:end], last)
        for p in range(low, high):
            r = rows[p]
            value = values[p]
            out[r, 0] += value * red
            out[r, 1] += value * green
            out[r, 2] += value * blue


@kernel(nogil=True, parallel=True, fastmath=True)
def shade_all(
    positions: np.ndarray, frames: np.ndarray, eye: np.ndarray, view_maps: np.ndarray, lit: np.ndarray, out: np.ndarray
) -> None:
    """Radiance (V, 3) towards `eye` (3,): Σ_k h_k(ωo) of `view_maps` (M, M, K, C) times `lit` (V, K, 3).

    It is 0 where a vertex is seen from behind. Negative sums are not clipped; the caller can clip them.
    """
    size, terms, channels = view_maps.shape[0], view_maps.shape[2], view_maps.shape[3]
    for v in prange(len(positions)):
        dx, dy, dz = eye[0] - positions[v, 0], eye[1] - positions[v, 1], eye[2] - positions[v, 2]
        short = np.float32(1.0) / math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy, dz = dx * short, dy * short, dz * short
        z = frames[v, 2, 0] * dx + frames[v, 2, 1] * dy + frames[v, 2, 2] * dz
        red, green, blue = np.float32(0), np.float32(0), np.float32(0)
        if z > 0:
            x = frames[v, 0, 0] * dx + frames[v, 0, 1] * dy + frames[v, 0, 2] * dz
            y = frames[v, 1, 0] * dx + frames[v, 1, 1] * dy + frames[v, 1, 2] * dz
            i, j, a, b = place(x, y, z, size)
            w00, w01, w10, w11 = (1 - a) * (1 - b), (1 - a) * b, a * (1 - b), a * b
            last = channels - 1
            for k in range(terms):
                h0 = (
                    w00 * view_maps[i, j, k, 0]
                    + w01 * view_maps[i, j + 1, k, 0]
                    + w10 * view_maps[i + 1, j, k, 0]
                    + w11 * view_maps[i + 1, j + 1, k, 0]
                )
                if last == 0:
                    h1, h2 = h0, h0
                else:
                    h1 = (
                        w00 * view_maps[i, j, k, 1]
                        + w01 * view_maps[i, j + 1, k, 1]
                        + w10 * view_maps[i + 1, j, k, 1]
                        + w11 * view_maps[i + 1, j + 1, k, 1]
                    )
                    h2 = (
                        w00 * view_maps[i, j, k, 2]
                        + w01 * view_maps[i, j + 1, k, 2]
                        + w10 * view_maps[i + 1, j, k, 2]
                        + w11 * view_maps[i + 1, j + 1, k, 2]
                    )
                red += h0 * lit[v, k, 0]
                green += h1 * lit[v, k, 1]
                blue += h2 * lit[v, k, 2]
        out[v, 0], out[v, 1], out[v, 2] = red, green, blue
