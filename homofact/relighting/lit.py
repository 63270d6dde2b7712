"""An object under a light: what its vertices and the points between them send to an eye, by the form that is held."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from homofact.relighting.clusters import Clustered
from homofact.relighting.harmonic import Harmonic
from homofact.relighting.interreflection import spread_suns
from homofact.relighting.lobe import SeparateLobe, SurfacePoints
from homofact.relighting.lobe_light import LightCells
from homofact.relighting.precompute import WaveletTransport
from homofact.relighting.relight import Light, Relit, light_coefficients, light_cube, shaded
from homofact.relighting.sunlight import Sunlight


@dataclass(frozen=True)
class LitObject:
    """The K-tuples (V, K, 3) of an object's vertices, the light's `cells` for a separate `lobe`, and its suns."""

    transport: WaveletTransport
    tuples: np.ndarray
    lobe: SeparateLobe | None = None
    cells: LightCells | None = None
    sunlight: Sunlight | None = None

    @classmethod
    def of(
        cls,
        transport: WaveletTransport,
        compact: Clustered | Harmonic | None,
        lobe: SeparateLobe | None,
        light: Light,
        sunlight: Sunlight | None = None,
    ) -> "LitObject":
        """Under a light, by the compact form where there is one, and suns. Raises BadInput for no light."""
        cells = None if lobe is None else LightCells.of(light_cube(light, transport.settings.cube))
        tuples, bounced = lit_tuples(transport, compact, light), transport.factors.bounced
        if bounced and sunlight is not None:
            spread = spread_suns(sunlight.suns, transport.settings.cube)
            tuples[:, -bounced:] += lit_tuples(transport, compact, spread)[:, -bounced:]
        return cls(transport, tuples, lobe, cells, sunlight)

    def terms(self, eye: Sequence[float] | np.ndarray) -> np.ndarray:
        """Radiance (V, 3) float32 of the vertices towards a point `eye` (3,), by the in-out factors alone."""
        return shaded(self.transport, self.tuples, eye)

    def lobe_at(self, points: SurfacePoints) -> np.ndarray:
        """Radiance (S, 3) of the separate lobe; 0 where none does."""
        if self.lobe is None or self.cells is None:
            return np.zeros((len(points.frames), 3), np.float32)
        return self.lobe.at(points, self.cells)

    def suns_at(self, points: SurfacePoints, seen: np.ndarray | None = None) -> np.ndarray:
        """Radiance (S, 3) by suns of which points see the parts `seen` (S, Q), mixed of the vertices' unless given."""
        if self.sunlight is None:
            return np.zeros((len(points.frames), 3))
        return self.sunlight.at(points, points.mixed(self.sunlight.seen) if seen is None else seen)

    def shade(self, eye: Sequence[float] | np.ndarray) -> np.ndarray:
        """Radiance (V, 3) float32 of the vertices towards a point `eye` (3,); negative residues stay in it."""
        found = self.terms(eye)
        if self.lobe is not None and self.cells is not None:
            found += self.lobe.at_vertices(self.transport.positions, self.transport.frames, eye, self.cells)
        if self.sunlight is not None:
            lit = self.sunlight.at_vertices(self.transport.positions, self.transport.frames, eye)
            found += lit.astype(np.float32)
        return found

    def between(
        self, points: SurfacePoints, eye: Sequence[float] | np.ndarray, seen: np.ndarray | None = None
    ) -> np.ndarray:
        """Radiance (S, 3) of points between vertices: of the factors mixed, of lobe and suns at the point itself.

        `seen` is as in `suns_at`.
        """
        terms = points.mixed(self.terms(eye).astype(np.float64))
        return terms + self.lobe_at(points) + self.suns_at(points, seen)


def lit_tuples(transport: WaveletTransport, compact: Clustered | Harmonic | None, light: Light) -> np.ndarray:
    """K-tuples (V, K, 3) under a light, by the compact form where there is one. Raises BadInput for no light."""
    if isinstance(compact, Harmonic):
        return compact.tuples(light_coefficients(light, transport.settings.cube))
    relit = Relit(transport if compact is None else compact.basis)
    relit.relight(light)
    return relit.tuples if compact is None else compact.mixed(relit.tuples)
