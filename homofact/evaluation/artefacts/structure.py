"""Find structure in a picture of a fit that the pictures of its source do not have.

The display-encoded values of a picture are split into the frequency bands of `BANDS`. Each band is a difference of two
Gaussian blurs, whose widths in pixels are the two numbers. Only pixels of the sphere enter the blurs, so the silhouette
does not appear as an edge. For each pixel and band, the source has a range of values: the minimum and maximum within
`REACH` times the width of the first blur. `STRETCH` widens this range, so a highlight of the fit may be slightly too
strong, too wide or shifted by a pixel. The part of the fit's band outside the range is structure that the source does
not have. The range always contains 0. So a fit that only lacks structure of its source, such as instrument noise, has
no artefact.

If the source consists only of samples, there are pictures of several interpolations. The range then covers all of
them, widened by their differences.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

BANDS = ((0.0, 1.0), (0.7, 2.5), (1.5, 5.0), (3.0, 10.0))
REACH = 2.0
STRETCH = 0.25
# Of a channel in what is seen: the luminance of linear sRGB (IEC 61966-2-1).
LUMA = np.array([0.2126, 0.7152, 0.0722])
_CUT = 3.0  # a Gaussian's reach in widths


@dataclass(frozen=True)
class SourceRange:
    """The smallest and largest values (H, W, 3) of the source near each pixel, one pair per band."""

    inside: np.ndarray
    bounds: tuple[tuple[np.ndarray, np.ndarray], ...]

    @classmethod
    def of(cls, readings: Sequence[np.ndarray], inside: np.ndarray) -> "SourceRange":
        """Return the range of the source's encoded pictures (H, W, 3), the most accurate of which comes first."""
        banded = [bands(reading, inside) for reading in readings]
        bounds = []
        for (inner, _), *parts in zip(BANDS, *banded, strict=True):
            size = 2 * max(1, round(REACH * inner)) + 1
            low = np.min([_filtered(ndimage.minimum_filter, part, inside, size, np.inf) for part in parts], 0)
            high = np.max([_filtered(ndimage.maximum_filter, part, inside, size, -np.inf) for part in parts], 0)
            apart = np.max(parts, 0) - np.min(parts, 0)
            doubt = _filtered(ndimage.maximum_filter, apart, inside, 2 * size + 1, -np.inf)
            low, high = np.minimum(low, 0.0), np.maximum(high, 0.0)
            bounds.append(((1 + STRETCH) * low - doubt, (1 + STRETCH) * high + doubt))
        return cls(inside, tuple(bounds))

    def excess(self, picture: np.ndarray) -> np.ndarray:
        """Return how far a fit's encoded picture (H, W, 3) exceeds the range: (H, W), positive where too bright.

        At each pixel, the band with the largest excess counts, weighted by luminance. Outside the sphere the excess is
        0.
        """
        worst = np.zeros(self.inside.shape)
        for band, (low, high) in zip(bands(picture, self.inside), self.bounds, strict=True):
            beyond = band - np.clip(band, low, high)
            size = np.sqrt((beyond**2) @ LUMA) * np.sign(beyond @ LUMA)
            worst = np.where(np.abs(size) > np.abs(worst), size, worst)
        return np.where(self.inside, worst, 0.0)


def bands(picture: np.ndarray, inside: np.ndarray) -> list[np.ndarray]:
    """Return the bands (H, W, 3) of an encoded picture (H, W, 3), over the pixels `inside`; 0 elsewhere."""
    blurred = {width: _blur(picture, inside, width) for widths in BANDS for width in widths}
    return [np.where(inside[..., None], blurred[inner] - blurred[outer], 0.0) for inner, outer in BANDS]


def _blur(picture: np.ndarray, inside: np.ndarray, width: float) -> np.ndarray:
    weight = inside.astype(np.float64)
    share = ndimage.gaussian_filter(weight, width, truncate=_CUT, mode="constant")
    found = np.stack(
        [
            ndimage.gaussian_filter(picture[..., c] * weight, width, truncate=_CUT, mode="constant")
            for c in range(picture.shape[2])
        ],
        -1,
    )
    return found / np.maximum(share, 1e-12)[..., None]


def _filtered(
    which: Callable[..., np.ndarray], band: np.ndarray, inside: np.ndarray, size: int, outside: float
) -> np.ndarray:
    """The least or largest value of each pixel's surroundings, channel by channel."""
    filled = np.where(inside[..., None], band, outside)
    found = which(filled, size=(size, size, 1), mode="nearest")
    return np.where(inside[..., None], found, 0.0)
