"""Convert reflectance spectra to CIELAB under several illuminants, and compute the derivatives.

The reference for f in sr⁻¹ is the perfect diffuser, whose f is 1/π. So π f is a reflectance factor (CIE 15:2018, 5.2),
which exceeds 1 in highlights. L*a*b* (`cielab`) refer to the white of the illuminant: the observer is assumed to be
adapted to it.
"""

from collections.abc import Sequence

import numpy as np

from homofact.brdf.cielab import lab
from homofact.brdf.spectral import xyz_weights

# Daylight, incandescent light, a narrow-band fluorescent lamp: what indices of metamerism ask for (CIE 15:2018, 9.2).
ILLUMINANTS = ("D65", "A", "F11")
_LINEAR = 6 / 29  # the cube root of where L* becomes linear


def lab_of(spectra: np.ndarray, wavelengths: Sequence[float], illuminant: str) -> np.ndarray:
    """L*a*b* (..., 3) of spectra (..., W) in sr⁻¹ at `wavelengths` in nm; raises BadInput as `spectral.to_rgb`."""
    weights = xyz_weights(wavelengths, illuminant)
    return lab(np.pi * spectra @ weights / weights.sum(0))


def lab_of_xyz(xyz: np.ndarray, white: np.ndarray) -> np.ndarray:
    """Return L*a*b* (..., 3) of CIE XYZ (..., 3) in sr⁻¹; the perfect diffuser has XYZ of `white`/π (3,)."""
    return lab(np.pi * xyz / white)


def lab_slopes(spectra: np.ndarray, wavelengths: Sequence[float], illuminant: str) -> np.ndarray:
    """Derivatives (N, 3, W) of L*a*b* by each band of spectra (N, W) in sr⁻¹; raises BadInput as `spectral.to_rgb`."""
    weights = xyz_weights(wavelengths, illuminant)
    shares = np.pi * weights / weights.sum(0)
    ratio = spectra @ shares
    steep = np.where(ratio > _LINEAR**3, np.maximum(ratio, _LINEAR**3) ** (-2 / 3) / 3, 1 / (3 * _LINEAR**2))
    x, y, z = (steep[:, k : k + 1] * shares[:, k] for k in range(3))
    return np.stack((116 * y, 500 * (x - y), 200 * (y - z)), 1)
