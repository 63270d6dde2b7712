"""Compare two pictures of a lit sphere: PSNR, SSIM, CIEDE2000, ΔE_ITP and FLIP.

A picture is (H, W, 3), sRGB with its transfer curve (IEC 61966-2-1), D65 white, values in [0, 1] and not
rounded to 8 bits, as `rendering.tonemap.displayed` makes it. Both pictures have the same exposure, chosen from the
source, and the same grey background. Each channel is clipped to the gamut before the comparison, so no metric measures
differences outside the gamut. Means are over the pixels of `mask` (H, W), which show the sphere. The background is
equal in both pictures and would make every fit look better.

SSIM, ΔE_ITP and FLIP each need an optional library; `MissingDependency` names it if it is not installed.
"""

import math
from typing import Any

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.cielab import ciede2000 as ciede2000_of_labs
from homofact.brdf.cielab import lab_of_srgb
from homofact.errors import BadInput
from homofact.files import extras

# Luminance of white, in cd/m², for the metric that wants an absolute one.
WHITE_LUMINANCE = 100.0
PIXELS_PER_DEGREE = 67.0


def psnr(source: Tensor, fit: Tensor, mask: Tensor) -> float:
    """Peak signal-to-noise ratio in dB, peak 1, of the encoded values; ∞ where they are equal."""
    a, b, inside = _checked(source, fit, mask)
    squared = float(np.mean((a[inside] - b[inside]) ** 2))
    return -10 * math.log10(squared) if squared > 0 else math.inf


def ssim(source: Tensor, fit: Tensor, mask: Tensor) -> float:
    """Structural similarity (Wang et al. 2004), 1 for equal pictures; by scikit-image with the paper's window.

    The window is a Gaussian with σ = 1.5, the covariance that of a population, and the data range 1. The mean is over
    channels and the mask's pixels. Raises BadInput for pictures smaller than the window of 11 pixels.
    """
    metrics = _library("skimage.metrics")
    a, b, inside = _checked(source, fit, mask)
    if min(inside.shape) < 11:
        raise BadInput(
            where="SSIM", found=f"a picture of {inside.shape[1]} × {inside.shape[0]}", expected="at least 11 × 11"
        )
    _, local = metrics.structural_similarity(
        a, b, data_range=1.0, channel_axis=2, gaussian_weights=True, sigma=1.5, use_sample_covariance=False, full=True
    )
    return float(local[inside].mean())


def ciede2000(source: Tensor, fit: Tensor, mask: Tensor) -> float:
    """Mean CIEDE2000 difference (CIE 142-2001), L*a*b* against the D65 white of sRGB; 1 is about just noticeable."""
    return float(np.mean(ciede2000_of_pixels(source, fit, mask)))


def ciede2000_of_pixels(source: Tensor, fit: Tensor, mask: Tensor) -> np.ndarray:
    """Return the CIEDE2000 difference of each of the mask's pixels (n,), row by row; `ciede2000` is its mean."""
    a, b, inside = _checked(source, fit, mask)
    return ciede2000_of_labs(*(lab_of_srgb(picture[inside]) for picture in (a, b)))


def delta_e_itp(source: Tensor, fit: Tensor, mask: Tensor) -> float:
    """Return mean ΔE_ITP (ITU-R BT.2124-0), white shown at 100 cd/m²; 1 is about just noticeable."""
    colour = _library("colour")
    first, second = (
        colour.XYZ_to_ICtCp(xyz * WHITE_LUMINANCE, method="ITU-R BT.2100-2 PQ")
        for xyz in _xyz(colour, source, fit, mask)
    )
    return float(np.mean(colour.delta_E(first, second, method="ITP")))


def flip(source: Tensor, fit: Tensor, mask: Tensor) -> float:
    """Return mean LDR-FLIP (Andersson et al. 2020) in [0, 1], seen at 67 pixels a degree; 0 where equal."""
    evaluator = _library("flip_evaluator")
    a, b, inside = _checked(source, fit, mask)
    pictures = (np.ascontiguousarray(x, dtype=np.float32) for x in (a, b))
    error, _, _ = evaluator.evaluate(
        *pictures,
        "LDR",
        inputsRGB=True,
        applyMagma=False,
        computeMeanError=False,
        parameters={"ppd": PIXELS_PER_DEGREE},
    )
    return float(np.asarray(error, dtype=np.float64).reshape(*inside.shape, -1)[..., 0][inside].mean())


def _library(module: str) -> Any:
    return extras.library(module, "metrics")


def _checked(source: Tensor, fit: Tensor, mask: Tensor) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Both pictures and the mask as arrays. Raises BadInput for shapes, ranges and masks that cannot be."""
    shape = tuple(mask.shape)
    for name, picture in (("source", source), ("fit", fit)):
        if tuple(picture.shape) != (*shape, 3):
            raise BadInput(
                f"shape {tuple(picture.shape)}", where=f"{name} picture", expected=f"{(*shape, 3)} like the mask"
            )
        if not bool(((picture >= 0) & (picture <= 1)).all()):
            raise BadInput("values outside [0, 1]", where=f"{name} picture", expected="encoded sRGB")
    if not bool(mask.any()):
        raise BadInput(where="mask", found="no pixels", expected="at least one")
    first, second = (picture.to(torch.float64).cpu().numpy() for picture in (source, fit))
    return first, second, mask.to(torch.bool).cpu().numpy()


def _xyz(colour: Any, source: Tensor, fit: Tensor, mask: Tensor) -> tuple[np.ndarray, np.ndarray]:
    """CIE XYZ (n, 3) of the mask's pixels in both, Y of white 1, D65."""
    a, b, inside = _checked(source, fit, mask)
    first, second = (np.asarray(colour.sRGB_to_XYZ(picture[inside])) for picture in (a, b))
    return first, second
