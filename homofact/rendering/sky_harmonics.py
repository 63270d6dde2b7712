"""The spherical harmonics of an environment, for averaging it over wide round kernels.

A kernel K round a direction d turns the coefficients a of the light into

    ∫ K L dω = Σl kl Σm alm Ylm(d),    kl = 2π ∫ K(γ) Pl(cosγ) sinγ dγ

(Funk and Hecke; Driscoll and Healy 1994, theorem 1). The wider K is, the faster kl falls with l. A few degrees then
give the average exactly, while rings would need thousands of lookups. The map's texels have constant radiance, so their
coefficients are computed exactly: ∫ exp(−i m α) dα over a texel's azimuths in closed form, and over its polar angles by
Gauss-Legendre nodes.
"""

import math
from typing import NamedTuple

import numpy as np

from homofact.linear.kernels import kernel
from homofact.rendering.chain_kernels import ChainKernels
from homofact.rendering.light import EnvironmentMap

MOST = 160  # degrees; more cost more than rings
_ANGLES = 8000
_LEFT = 3e-5  # of kl: what is left out from there on


class SkyHarmonics(NamedTuple):
    """Coefficients `cosine` and `sine` (MOST + 1, MOST + 1, 3) of an environment over degree and order, y the pole."""

    cosine: np.ndarray
    sine: np.ndarray

    @classmethod
    def of(cls, light: EnvironmentMap) -> "SkyHarmonics":
        """Return an environment's."""
        radiance = light.radiance.expand(-1, -1, 3).numpy()
        rows, columns, _ = radiance.shape
        order = np.arange(MOST + 1)
        # Σ over texels by Fourier's transform, whose orders repeat; then each texel's own width, and where column 0 is.
        turned = np.fft.fft(radiance, axis=1)[:, order % columns]
        width = 2 * math.pi / columns
        turned = turned * (width * np.sinc(order * width / (2 * math.pi)))[:, None]
        turned = turned * np.exp(-1j * order * (width / 2 - math.pi - light.turn))[:, None]
        # A function of degree MOST has MOST/(2 rows) periods in a row.
        nodes = 5 + math.ceil(2 * MOST / rows)
        x, w = np.polynomial.legendre.leggauss(nodes)
        theta = ((np.arange(rows)[:, None] + (x + 1) / 2) * (math.pi / rows)).reshape(-1)
        weight = np.tile(w / 2 * (math.pi / rows), rows) * np.sin(theta)
        parts = (np.ascontiguousarray(part) for part in (turned.real, turned.imag))
        return cls(*_analysed(np.cos(theta), weight, *parts, nodes))

    def averaged(self, gains: np.ndarray, towards: np.ndarray) -> np.ndarray:
        """Return light (N, 3) averaged by a kernel with coefficients kl around unit world directions (N, 3)."""
        return _summed(np.ascontiguousarray(towards), gains, self.cosine, self.sine)


def gains_of(kernels: ChainKernels, level: int) -> np.ndarray | None:
    """Return the significant kl (L + 1,) of a level's kernel; None if it needs degrees above `MOST`."""
    gamma = (np.arange(_ANGLES) + 0.5) * (math.pi / 2 / _ANGLES)
    flux = kernels.at(level, gamma) * np.sin(gamma)
    flux /= flux.sum()
    x = np.cos(gamma)
    before, now, gains = np.ones_like(x), x, [1.0]
    for degree in range(1, MOST + 1):
        gains.append(float(flux @ now))
        before, now = now, ((2 * degree + 1) * x * now - degree * before) / (degree + 1)
    found = np.array(gains)
    mattering = np.flatnonzero(np.abs(found) > _LEFT)
    return None if mattering[-1] == MOST else found[: mattering[-1] + 1]


@kernel(nogil=True)
def _steps(most):  # pragma: no cover (compiled)
    """(a, b) (most + 1, most + 1) of P̄lm = a (z P̄(l−1)m − b P̄(l−2)m), the normalized Legendre functions."""
    a, b = np.zeros((most + 1, most + 1)), np.zeros((most + 1, most + 1))
    for m in range(most + 1):
        for degree in range(m + 1, most + 1):
            a[degree, m] = math.sqrt((4.0 * degree * degree - 1) / (degree * degree - m * m))
            if degree > m + 1:
                low = degree - 1.0
                b[degree, m] = math.sqrt((low * low - m * m) / (4 * low * low - 1))
    return a, b


@kernel(nogil=True, fastmath=True)
def _analysed(z, weight, real, imaginary, nodes):  # pragma: no cover (compiled)
    """Coefficients of rows that are sums over azimuth already: at cosines `z` (R · nodes,), each row `nodes` times."""
    most = real.shape[1] - 1
    cosine, sine = np.zeros((most + 1, most + 1, 3)), np.zeros((most + 1, most + 1, 3))
    a, b = _steps(most)
    for k in range(len(z)):
        row, first = k // nodes, math.sqrt(1 / (4 * math.pi))
        across = math.sqrt(1 - z[k] * z[k])
        for m in range(most + 1):
            if m > 0:
                first *= across * math.sqrt((2 * m + 1.0) / (2.0 * m))
            share = weight[k] * (1 if m == 0 else 2)
            older, now = 0.0, first
            for degree in range(m, most + 1):
                if degree > m:
                    older, now = now, a[degree, m] * (z[k] * now - b[degree, m] * older)
                for channel in range(3):
                    cosine[degree, m, channel] += share * now * real[row, m, channel]
                    sine[degree, m, channel] -= share * now * imaginary[row, m, channel]
    return cosine, sine


@kernel(nogil=True, fastmath=True)
def _summed(towards, gains, cosine, sine):  # pragma: no cover (compiled)
    """Light (N, 3) at directions (N, 3), each degree times its gain."""
    most = len(gains) - 1
    light = np.zeros((len(towards), 3))
    a, b = _steps(most)
    for k in range(len(towards)):
        z, first = towards[k, 1], math.sqrt(1 / (4 * math.pi))
        across = math.sqrt(max(1 - z * z, 0.0))
        azimuth = math.atan2(towards[k, 0], -towards[k, 2])
        step_c, step_s = math.cos(azimuth), math.sin(azimuth)
        c, s = 1.0, 0.0
        for m in range(most + 1):
            if m > 0:
                first *= across * math.sqrt((2 * m + 1.0) / (2.0 * m))
                c, s = c * step_c - s * step_s, s * step_c + c * step_s
            older, now = 0.0, first
            red = green = blue = red_s = green_s = blue_s = 0.0
            for degree in range(m, most + 1):
                if degree > m:
                    older, now = now, a[degree, m] * (z * now - b[degree, m] * older)
                value = gains[degree] * now
                red += value * cosine[degree, m, 0]
                green += value * cosine[degree, m, 1]
                blue += value * cosine[degree, m, 2]
                red_s += value * sine[degree, m, 0]
                green_s += value * sine[degree, m, 1]
                blue_s += value * sine[degree, m, 2]
            light[k, 0] += c * red + s * red_s
            light[k, 1] += c * green + s * green_s
            light[k, 2] += c * blue + s * blue_s
    return light
