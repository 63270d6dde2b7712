"""Spectra for linear sRGB, for renderers that want them: a linear basis, so that values above 1 need no care.

Mallett and Yuksel (2019) give three spectra in [0, 1] that add up to 1 at every wavelength and whose colours under D65
are the primaries of sRGB: R, G and B are their weights. Any non-negative RGB becomes a non-negative spectrum, grey a
flat one, and what is linear in RGB, such as interpolation in a table, stays linear.

They come in 81 steps of 5 nm. Here the spectra are polygons through the 14 wavelengths `NODES`, where they bend most
(chosen for the least error of all such choices, weighted by what a wavelength adds to RGB; 0.015 RMS). Their values at
the nodes are changed by the least, in units of the smallest of the three, that makes RGB under D65 come back exactly
(`brdf.spectral`).
"""

from functools import lru_cache

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.spectral import to_rgb

NODES = (380.0, 430.0, 470.0, 485.0, 495.0, 510.0, 570.0, 585.0, 590.0, 595.0, 605.0, 645.0, 710.0, 780.0)


def to_spectra(rgb: Tensor) -> Tensor:
    """Return values (..., 14) at the wavelengths `NODES` of linear sRGB (..., 3), linear between and held beyond them.

    Same unit, sr⁻¹ for a BRDF; `brdf.spectral.to_rgb` under D65 gives the RGB again.
    """
    return rgb @ torch.from_numpy(basis().copy()).to(rgb).T


@lru_cache(maxsize=1)
def basis() -> np.ndarray:
    """Return the spectra (14, 3) of R, G and B at `NODES`: between 0 and 1, each row's sum 1."""
    from colour.recovery import MSDS_BASIS_FUNCTIONS_sRGB_MALLETT2019 as given  # about a second to load

    spectra = np.stack([np.interp(NODES, given.wavelengths, given.values[:, k]) for k in range(3)], 1)
    spectra /= spectra.sum(1, keepdims=True)
    # What each wavelength adds to R, G and B, (14, 3).
    weights = to_rgb(torch.eye(len(NODES), dtype=torch.float64), NODES, clip=False)[0].numpy()
    # The rows of the correction add up to 0, as those of `missing` do.
    missing = np.eye(3) - weights.T @ spectra
    scaled = spectra.min(1, keepdims=True) * weights
    return spectra + scaled @ np.linalg.solve(weights.T @ scaled, missing)
