"""Structure in a picture of a fit that the pictures of its source do not have.

A picture's values, encoded as a screen shows them, are cut into `BANDS`: a Gaussian blur by the first number of pixels
less a blur by the second, over the sphere's pixels alone (what lies outside counts for nothing, so the silhouette is
no edge). In each band the source shows values from a least to a largest one near a pixel, within `REACH` times the
band's first blur. Both are stretched by `STRETCH`, so that a highlight may be a little too strong, too wide or in a
neighbouring pixel. What of the fit's band lies outside this range is structure that the source does not have. The
range always holds 0: a fit that merely lacks structure of its source, such as the instrument's noise, has no artefact.

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
    """The least and the largest values (H, W, 3) that the source shows near each pixel, a pair a band."""

    inside: np.ndarray
    bounds: tuple[tuple[np.ndarray, np.ndarray], ...]

    @classmethod
    def of(cls, readings: Sequence[np.ndarray], inside: np.ndarray) -> "SourceRange":
        """That of the source's encoded pictures (H, W, 3), of which the first is the best."""
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
        """What of a fit's encoded picture (H, W, 3) lies outside the range: (H, W), positive where it is brighter.

        Of the bands the value farthest from 0, as luminance; 0 outside the sphere.
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
