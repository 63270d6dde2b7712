"""Convert linear sRGB to spectra for spectral renderers, with a linear basis that also works for values above 1.

Mallett and Yuksel (2019) give three spectra in [0, 1] that add up to 1 at every wavelength and whose colours under D65
are the primaries of sRGB: The spectrum of a colour is their sum with the weights R, G and B. Non-negative RGB gives a
non-negative spectrum, and grey gives a flat one. Operations that are linear in RGB, such as interpolation in a table,
stay linear.

The published spectra have 81 steps of 5 nm. Here they are piecewise linear between the 14 wavelengths `NODES`, where
they bend most. This choice of nodes has the smallest error, weighted by the contribution of a wavelength to RGB (0.015
RMS). The values at the nodes are adjusted as little as possible, relative to the smallest of the three, so that
conversion to RGB under D65 is exact (`brdf.spectral`).
"""

from functools import lru_cache

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.spectral import to_rgb

NODES = (380.0, 430.0, 470.0, 485.0, 495.0, 510.0, 570.0, 585.0, 590.0, 595.0, 605.0, 645.0, 710.0, 780.0)


def to_spectra(rgb: Tensor) -> Tensor:
    """Return the spectra (..., 14) of linear sRGB (..., 3) at the wavelengths `NODES`.

    Spectra are linear between `NODES` and constant beyond them. Their unit is that of RGB, sr⁻¹ for a BRDF.
    `brdf.spectral.to_rgb` under D65 returns the same RGB.
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
