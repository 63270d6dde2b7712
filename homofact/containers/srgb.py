"""The transfer curve of sRGB (IEC 61966-2-1), which encodes the values of 8-bit pictures."""

import numpy as np


def decode_srgb(encoded: np.ndarray) -> np.ndarray:
    """Return linear values, 0 to 1, of encoded ones, 0 to 1."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
