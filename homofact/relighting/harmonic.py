"""Transport in spherical harmonics of low order: the form for smooth lighting (Sloan, Kautz and Snyder 2002).

T_vk L ≈ Σ_lm t_vklm L_lm, t_vklm = ∫ T_vk Y_lm dω: (n + 1)² numbers per vector, which need no indices. Light of orders
above n is lost, and with it the detail at the edges of shadows. 9 numbers give the reflection of a matt surface without
shadows within 1% under any light (Ramamoorthi 2002, section 3.2.3).
"""

from dataclasses import dataclass

import numpy as np
import torch
from scipy.sparse import csr_array

from homofact.errors import BadInput
from homofact.relighting import cube
from homofact.relighting.clusters import Clustered
from homofact.relighting.factors import InOutFactors
from homofact.relighting.haar import transformed
from homofact.relighting.precompute import WaveletTransport
from homofact.theory.harmonics import harmonics

MOST_ORDER = 7
_MOST = 32767


@dataclass(frozen=True)
class Harmonic:
    """Coefficients `number` (V, K, (n + 1)²) int16 times `step` (V, K) float32, with the object's vertex data."""

    transport: WaveletTransport
    number: np.ndarray
    step: np.ndarray

    @property
    def factors(self) -> InOutFactors:
        """Return the factors of the transport that it was made from."""
        return self.transport.factors

    @property
    def order(self) -> int:
        """n."""
        return round(self.number.shape[2] ** 0.5) - 1

    @property
    def nbytes(self) -> int:
        """Return the bytes: two per coefficient, and a float32 step per vector."""
        return self.number.nbytes + self.step.nbytes

    def tuples(self, light: np.ndarray) -> np.ndarray:
        """K-tuples (V, K, 3) float32 under the Haar coefficients (6·n², 3) of a light."""
        coefficients = harmonic_maps(self.order, self.transport.settings.cube)[0] @ light
        found = np.einsum("vkj,jc->vkc", self.number.astype(np.float32), coefficients.astype(np.float32))
        return found * self.step[..., None]

    def clustered(self) -> Clustered:
        """Return the transport as one cluster with the harmonics of each term as components, for the page."""
        vertices, terms, count = self.number.shape
        settings = self.transport.settings
        maps = harmonic_maps(self.order, settings.cube)[0].astype(np.float32)
        scale = np.abs(maps).max(1) / _MOST
        rounded = np.rint(maps / scale[:, None]).astype(np.int16)
        places = [np.flatnonzero(each) for each in rounded]
        # The mean first, which is nothing; component k·(n + 1)² + lm has the harmonic lm in term k alone.
        lengths = np.zeros((1 + terms * count, terms), np.int64)
        scales = np.zeros(lengths.shape, np.float32)
        for k in range(terms):
            lengths[1 + k * count : 1 + (k + 1) * count, k] = [len(each) for each in places]
            scales[1 + k * count : 1 + (k + 1) * count, k] = scale
        basis = WaveletTransport(
            np.zeros((len(lengths), 3), np.float32), np.zeros((len(lengths), 3, 3), np.float32), self.factors, settings,
            np.concatenate(([0], np.cumsum(lengths))), np.concatenate(places * terms).astype(np.uint16),
            np.concatenate([each[place] for each, place in zip(rounded, places, strict=True)] * terms),
            scales.reshape(-1),
        )  # fmt: skip
        values = (self.number * self.step[..., None]).reshape(vertices, -1)
        steps = np.maximum(np.abs(values).max(0) / _MOST, 1e-30).astype(np.float32)[None]
        weights = np.rint(values / steps).astype(np.int16)
        return Clustered(
            self.transport.positions, self.transport.frames, self.factors, basis,
            np.zeros(vertices, np.uint16), weights, steps,
        )  # fmt: skip


def harmonic(transport: WaveletTransport, order: int) -> Harmonic:
    """A transport in harmonics up to `order`. Raises BadInput for an order outside 0 to `MOST_ORDER`."""
    if not 0 <= order <= MOST_ORDER:
        raise BadInput(where="harmonics", found=f"order {order}", expected=f"0 to {MOST_ORDER}")
    texels = cube.FACES * transport.settings.cube**2
    counts = np.diff(transport.start)
    values = (transport.number * np.repeat(transport.scale, counts)).astype(np.float32)
    rows = csr_array((values, transport.index.astype(np.int32), transport.start), (len(counts), texels))
    maps = harmonic_maps(order, transport.settings.cube)[1].astype(np.float32)
    found = np.asarray(rows @ maps.T).reshape(transport.vertices, transport.factors.terms, -1)
    step = np.maximum(np.abs(found).max(2) / _MOST, 1e-30).astype(np.float32)
    return Harmonic(transport, np.rint(found / step[..., None]).astype(np.int16), step)


def harmonic_maps(order: int, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Haar coefficients ((n + 1)², 6·size²) of Y_lm dω, whose product with light is L_lm, and of Y_lm alone."""
    w = torch.from_numpy(cube.directions(size).reshape(-1, 3))
    values = harmonics(order, w).T.numpy().reshape(-1, cube.FACES, size, size)
    weighted = transformed(values * cube.solid_angles(size))
    return weighted.reshape(len(values), -1), transformed(values).reshape(len(values), -1)
