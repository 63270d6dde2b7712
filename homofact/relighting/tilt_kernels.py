"""The compiled loop of in-out factors under mapped normals."""

import math
from typing import NamedTuple

import numpy as np
from numba import prange

from homofact.linear.kernels import kernel
from homofact.relighting.kernels import place


class TiltArrays(NamedTuple):
    """`TiltedView` as arrays for the loop, with view maps (M, M, K, C)."""

    view: np.ndarray
    tilts: np.ndarray
    entries: np.ndarray
    reach: float
    tinted: np.ndarray


@kernel(nogil=True, parallel=True, fastmath=True)
def shade_tilted(tuples, frames, corners, shares, normals, views, given, out):  # pragma: no cover (compiled)
    """Write the radiance of points by the plain and the tinted terms to `out` (2, P, 3), for `TiltedView.light`.

    Each corner evaluates the mapped normal in its own frame, and the radiances of the three corners are interpolated.
    """
    view_maps, tilts, entries, most, tinted = given
    size, channels, nodes = view_maps.shape[0], view_maps.shape[3], tilts.shape[0]
    one, reach, last = np.float32(1), np.float32(most), channels - 1
    for p in prange(len(normals)):
        for c in range(3):
            share = shares[p, c]
            if share == 0:
                continue
            v = corners[p, c]
            f = frames[v]
            x = f[0, 0] * normals[p, 0] + f[0, 1] * normals[p, 1] + f[0, 2] * normals[p, 2]
            y = f[1, 0] * normals[p, 0] + f[1, 1] * normals[p, 1] + f[1, 2] * normals[p, 2]
            z = f[2, 0] * normals[p, 0] + f[2, 1] * normals[p, 1] + f[2, 2] * normals[p, 2]
            across = math.sqrt(x * x + y * y)
            if z < 0 or across > reach:
                # No farther than the farthest tilt.
                x, y = x * reach / max(across, np.float32(1e-12)), y * reach / max(across, np.float32(1e-12))
            z = math.sqrt(max(one - x * x - y * y, np.float32(0)))
            a, b = (x / reach + one) * (nodes - 1) / 2, (y / reach + one) * (nodes - 1) / 2
            i, j = max(min(int(a), nodes - 2), 0), max(min(int(b), nodes - 2), 0)
            a, b = a - np.float32(i), b - np.float32(j)
            u00, u01, u10, u11 = share * (1 - a) * (1 - b), share * (1 - a) * b, share * a * (1 - b), share * a * b
            # The view in the frame of the tilted normal, which is turned there the shortest way.
            ox = f[0, 0] * views[p, 0] + f[0, 1] * views[p, 1] + f[0, 2] * views[p, 2]
            oy = f[1, 0] * views[p, 0] + f[1, 1] * views[p, 1] + f[1, 2] * views[p, 2]
            oz = f[2, 0] * views[p, 0] + f[2, 1] * views[p, 1] + f[2, 2] * views[p, 2]
            along = (x * ox + y * oy) / (one + z) + oz
            wx, wy, wz = ox - x * along, oy - y * along, x * ox + y * oy + z * oz
            if wz < 0:
                length = max(math.sqrt(wx * wx + wy * wy), np.float32(1e-12))
                wx, wy, wz = wx / length, wy / length, np.float32(0)
            m, n, s, t = place(wx, wy, wz, size)
            w00, w01, w10, w11 = (1 - s) * (1 - t), (1 - s) * t, s * (1 - t), s * t
            for e in range(len(entries)):
                term, k, slot = entries[e, 0], entries[e, 1], entries[e, 2]
                h = (
                    u00 * tilts[i, j, slot]
                    + u01 * tilts[i, j + 1, slot]
                    + u10 * tilts[i + 1, j, slot]
                    + u11 * tilts[i + 1, j + 1, slot]
                )
                part = 1 if tinted[term] else 0
                for channel in range(3):
                    own = min(channel, last)
                    value = (
                        w00 * view_maps[m, n, k, own]
                        + w01 * view_maps[m, n + 1, k, own]
                        + w10 * view_maps[m + 1, n, k, own]
                        + w11 * view_maps[m + 1, n + 1, k, own]
                    )
                    out[part, p, channel] += h * value * tuples[v, term, channel]
