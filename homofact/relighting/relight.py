"""Light and view changes of precomputed transport: the run time of Wang, Tran and Luebke 2004 (4)–(6).

When the light changes, homofact computes the scalar product of each transport vector with the light. The K products of
a vertex are its K-tuple. When the view changes, homofact only looks up the view maps and sums K products per vertex. A
change of light can be applied in steps, the largest coefficients of the change first (Overbeck et al. 2006). The
picture then converges to the exact one.
"""

import os
from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise

import numba
import numpy as np

from homofact.errors import BadInput
from homofact.linear.threads import in_parallel
from homofact.relighting import cube
from homofact.relighting.haar import transformed
from homofact.relighting.light_kernels import add_columns, relight_all, shade_all
from homofact.relighting.lobe import SeparateLobe, checked_eye
from homofact.relighting.lobe_light import LightCells
from homofact.relighting.precompute import WaveletTransport
from homofact.rendering.light import EnvironmentMap
from homofact.scene.lighting import open_environment

_MOST_RADIANCE = 1e32
Light = EnvironmentMap | np.ndarray | str | os.PathLike[str]


def opened_light(light: Light) -> EnvironmentMap | np.ndarray:
    """Return the light; open it if it is a .hdr or .exr file or a built-in name. Raises BadInput otherwise."""
    if isinstance(light, str | os.PathLike):
        return open_environment(os.fspath(light))
    if not isinstance(light, EnvironmentMap | np.ndarray):
        raise BadInput(where="light", found=repr(light), expected="an EnvironmentMap, a cube map, a file or a name")
    return light


def light_cube(light: Light, size: int) -> np.ndarray:
    """Radiance (6, n, n, 3) of an environment map on a cube map, or the cube map that is given.

    Raises BadInput if `light` is not a light, and for a cube map of another shape or with values that are negative, not
    finite or above 1e32.
    """
    opened = opened_light(light)
    given = opened if isinstance(opened, np.ndarray) else cube.environment_cube(opened, size)
    if given.shape != (cube.FACES, size, size, 3):
        raise BadInput(where="light", found=f"a cube map of shape {given.shape}", expected=f"(6, {size}, {size}, 3)")
    if not np.isfinite(given).all() or (given < 0).any():
        raise BadInput(where="light", found="radiance that is negative or not finite", expected="finite numbers >= 0")
    # The products are of float32: a little more than any camera's or star's radiance.
    if given.max() > _MOST_RADIANCE:
        raise BadInput(where="light", found=f"a radiance of {given.max():.3g}", expected=f"at most {_MOST_RADIANCE:g}")
    return given


def light_coefficients(light: Light, size: int) -> np.ndarray:
    """Haar coefficients (6·n², 3) float64 of a light. Raises BadInput as `light_cube`."""
    return _transformed(light_cube(light, size))


def shaded(
    transport: WaveletTransport,
    tuples: np.ndarray,
    eye: Sequence[float] | np.ndarray,
    terms: np.ndarray | None = None,
) -> np.ndarray:
    """Return the radiance (V, 3) float32 of K-tuples (V, K, 3) towards a point `eye` (3,), with negative residues.

    It is 0 at vertices that face away. `terms` lists the indices of the used terms. Default: all. Raises BadInput if
    `eye` is not a point.
    """
    point = checked_eye(eye)
    out = np.empty((transport.vertices, 3), np.float32)
    maps = transport.factors.packed_view
    if terms is not None:
        tuples, maps = tuples[:, terms], np.ascontiguousarray(maps[:, :, terms])
    lit = np.ascontiguousarray(tuples, np.float32)
    shade_all(transport.positions, transport.frames, point.astype(np.float32), maps, lit, out)
    return out


class Relit:
    """An object under a light: `tuples` (V, K, 3), Σ over the light of each transport vector, and views of it.

    A light is an `EnvironmentMap`, a cube map of radiance (6, n, n, 3), a .hdr or .exr file, or the name of one of
    `scene.lighting.NAMED` that is a map. A separate `lobe` uses a new light from the call of `relight` or `ask` on.
    `environment` is the last light if it was a map.
    """

    def __init__(self, transport: WaveletTransport, lobe: SeparateLobe | None = None) -> None:
        self.transport, self.lobe = transport, lobe
        self._cells: LightCells | None = None
        self._light = np.zeros((cube.FACES * transport.settings.cube**2, 3))
        self._target: np.ndarray | None = None
        self._change = np.zeros_like(self._light)
        self._order = np.zeros(0, np.int64)
        self.tuples = np.zeros((transport.vertices, transport.factors.terms, 3), np.float32)
        self.environment: EnvironmentMap | None = None

    def relight(self, light: Light) -> None:
        """Change to another light in one step, with all sums computed anew."""
        self._light = self._named(light)
        self._target = None
        self._sum()

    def ask(self, light: Light) -> None:
        """Set the light that `step` approaches."""
        self._target = self._named(light)
        self._change = self._target - self._light
        size = np.abs(self._change).max(1) * self._columns[3]
        # What reaches no transport vector changes nothing.
        self._order = np.argsort(-size, kind="stable")[: np.count_nonzero(size)]

    def step(self, coefficients: int = 64) -> int:
        """Apply the largest `coefficients` of the change, weighted by their transport; return how many are left.

        When none is left, the light is the one of `ask`, and all sums are computed anew, without the rounding of the
        steps.
        """
        if coefficients < 1:
            raise BadInput(where="coefficients", found=coefficients, expected="at least 1")
        if self._target is None:
            return 0
        chosen, self._order = self._order[:coefficients], self._order[coefficients:]
        if not len(self._order):
            self._light, self._target = self._target, None
            self._sum()
            return 0
        self._add(chosen)
        self._light[chosen] = self._target[chosen]
        return len(self._order)

    def shade(self, eye: Sequence[float] | np.ndarray) -> np.ndarray:
        """Radiance (V, 3) float32 of every vertex towards a point `eye` (3,); negative residues stay in it."""
        found = shaded(self.transport, self.tuples, eye)
        if self.lobe is not None and self._cells is not None:
            found += self.lobe.at_vertices(self.transport.positions, self.transport.frames, eye, self._cells)
        return found

    def _named(self, light: Light) -> np.ndarray:
        """Return the coefficients of a light, and store its cells for the lobe, and the map itself."""
        opened = opened_light(light)
        radiance = light_cube(opened, self.transport.settings.cube)
        self.environment = opened if isinstance(opened, EnvironmentMap) else None
        self._cells = None if self.lobe is None else self.lobe.cells(radiance)
        return _transformed(radiance)

    def _sum(self) -> None:
        given = self.transport
        padded = np.zeros((len(self._light), 4), np.float32)
        padded[:, :3] = self._light
        relight_all(given.start, given.index, given.number, given.scale, padded, self.tuples.reshape(-1, 3))

    def _add(self, chosen: np.ndarray) -> None:
        start, rows, values, _ = self._columns
        change, out = self._change.astype(np.float32), self.tuples.reshape(-1, 3)
        edges = np.linspace(0, len(out), numba.get_num_threads() + 1).astype(np.int64)
        in_parallel(
            lambda part: add_columns(chosen, start, rows, values, change, part[0], part[1], out),
            list(pairwise(edges.tolist())),
        )

    @cached_property
    def _columns(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return the transport sorted by coefficient: start (J + 1,), rows, values, and column norms (J,)."""
        given = self.transport
        counts = np.bincount(given.index, minlength=len(self._light))
        start = np.concatenate(([0], np.cumsum(counts)))
        vector = np.repeat(np.arange(len(given.scale), dtype=np.int32), np.diff(given.start))
        order = np.argsort(given.index, kind="stable")
        values = (given.number * given.scale[vector])[order]
        length = np.sqrt(np.bincount(given.index[order], values.astype(np.float64) ** 2, len(self._light)))
        return start, vector[order], values, length


def _transformed(radiance: np.ndarray) -> np.ndarray:
    return np.moveaxis(transformed(np.moveaxis(radiance, -1, 0)), 0, -1).reshape(-1, 3)
