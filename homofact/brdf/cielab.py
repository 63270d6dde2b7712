"""CIELAB of tristimulus values and of encoded sRGB, and the CIEDE2000 colour difference (CIE 142-2001).

The formulas are implemented here because homofact judges every fit by them, and loading a colour library takes longer
than most fits. The matrix and the white point are those of sRGB (IEC 61966-2-1, D65), the difference follows Sharma, Wu
and Dalal 2005, "The CIEDE2000 Color-Difference Formula", equations 2 to 22, with parametric factors of 1.
"""

import numpy as np

# Linear sRGB to CIE XYZ (IEC 61966-2-1), and XYZ of its white from the chromaticity (.3127, .3290).
_TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
_WHITE = np.array([0.3127 / 0.3290, 1.0, (1 - 0.3127 - 0.3290) / 0.3290])
_EPSILON, _KAPPA = 216 / 24389, 24389 / 27


def lab(relative: np.ndarray) -> np.ndarray:
    """Return L*a*b* (..., 3) of CIE XYZ (..., 3), each divided by the white's (CIE 15:2018, 8.2.1)."""
    bent = np.where(relative > _EPSILON, np.cbrt(relative), (_KAPPA * relative + 16) / 116)
    x, y, z = np.moveaxis(bent, -1, 0)
    return np.stack((116 * y - 16, 500 * (x - y), 200 * (y - z)), -1)


def lab_of_srgb(encoded: np.ndarray) -> np.ndarray:
    """Return CIE L*a*b* (..., 3) of encoded sRGB (..., 3) in [0, 1], against the white of sRGB."""
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return lab(linear @ _TO_XYZ.T / _WHITE)


def ciede2000(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return ΔE00 (...) between two arrays of L*a*b* (..., 3); about 1 is just noticeable."""
    (l1, a1, b1), (l2, a2, b2) = (np.moveaxis(lab, -1, 0) for lab in (first, second))
    mean = ((np.hypot(a1, b1) + np.hypot(a2, b2)) / 2) ** 7
    stretched = 1.5 - 0.5 * np.sqrt(mean / (mean + 25.0**7))
    c1, c2 = np.hypot(a1 * stretched, b1), np.hypot(a2 * stretched, b2)
    h1, h2 = (np.degrees(np.arctan2(b, a * stretched)) % 360 for a, b in ((a1, b1), (a2, b2)))
    coloured = c1 * c2 > 0
    apart = np.where(coloured, (h2 - h1 + 180) % 360 - 180, 0.0)
    # Hues that are just opposite: 180, not −180, as the standard has it.
    apart = np.where(coloured & (apart == -180) & (h2 > h1), 180.0, apart)
    hue = 2 * np.sqrt(c1 * c2) * np.sin(np.radians(apart / 2))
    light, chroma = (l1 + l2) / 2, (c1 + c2) / 2
    between = np.where(abs(h1 - h2) > 180, (h1 + h2 + np.where(h1 + h2 < 360, 360, -360)) / 2, (h1 + h2) / 2)
    between = np.where(coloured, between, h1 + h2)
    turned = np.radians(between)
    weight = (
        1
        - 0.17 * np.cos(turned - np.radians(30))
        + 0.24 * np.cos(2 * turned)
        + 0.32 * np.cos(3 * turned + np.radians(6))
        - 0.20 * np.cos(4 * turned - np.radians(63))
    )
    squared = (light - 50) ** 2
    by_light = (l2 - l1) / (1 + 0.015 * squared / np.sqrt(20 + squared))
    by_chroma = (c2 - c1) / (1 + 0.045 * chroma)
    by_hue = hue / (1 + 0.015 * chroma * weight)
    blue = np.radians(30) * np.exp(-(((between - 275) / 25) ** 2))
    rotation = -2 * np.sqrt(chroma**7 / (chroma**7 + 25.0**7)) * np.sin(2 * blue)
    total = by_light**2 + by_chroma**2 + by_hue**2 + rotation * by_chroma * by_hue
    return np.sqrt(np.maximum(total, 0))
