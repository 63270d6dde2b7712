"""Which pixels of a picture show more than was measured.

A source that interpolates scattered samples is drawn everywhere, though a goniometer does not reach everywhere
(`brdf.quality.extrapolation`). A pixel is marked where more than half of the light that falls on it comes from
directions that were not measured together with the view; under a point light that is all of it or nothing. Hatched is
what is as wide as `NARROWEST` of the picture, with what is as near to it: hatching of a thin mark, beside the shadow,
at the rim or at the mirror direction between two angles of the light, looks like a defect of the material.
"""

import math
from collections.abc import Sequence

import numpy as np
import torch
from scipy.ndimage import binary_dilation, binary_opening
from torch import Tensor

from homofact.brdf.quality.extrapolation import Extrapolation
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.scattered import interpolated_samples
from homofact.rendering.filtered import FilteredMaterial, Surroundings
from homofact.rendering.light import DirectionalLight
from homofact.rendering.lobe_patches import DRAFT
from homofact.rendering.sphere import render_sphere

LEAST = 0.5
NARROWEST = 0.05
_THINNEST = 3  # pixels, also of marks that are wider elsewhere


class _Part:
    """1 where a pair of directions was measured, else 0; 1 everywhere without samples."""

    channels = ("Y",)
    nbytes, fetches = 0, 0

    def __init__(self, samples: Samples | None) -> None:
        self._extrapolation = None if samples is None else Extrapolation(samples)

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """1 or 0 (N, 1) for pairs of directions (N, 3); 0 below the horizon."""
        above = (wi[:, 2] >= 0) & (wo[:, 2] >= 0)
        if self._extrapolation is not None:
            above &= self._extrapolation.measured(wi, wo)
        return above.to(torch.float64)[:, None]


def beyond_the_measurement(
    source: Reflectance, lights: Sequence[DirectionalLight | Surroundings], size: int
) -> list[tuple[Tensor, Tensor]] | None:
    """For each light which pixels are marked and which of these hatched (size, size); None without samples."""
    samples = interpolated_samples(source)
    if samples is None:
        return None
    parts = _Part(samples), _Part(None)
    asked = [FilteredMaterial.of(part, fineness=DRAFT) for part in parts]
    marks = []
    for light in lights:
        if isinstance(light, Surroundings):
            known, whole = (material.under(light).radiance[..., 0] for material in asked)
        else:
            known, whole = (render_sphere(part, light, size).radiance[..., 0] for part in parts)
        # What is left of the light by rounding is no light, and what is not lit makes no mark wider or narrower.
        lit = whole > 1e-6 * whole.max()
        marked = (known < LEAST * whole) | ~lit
        clear = binary_opening(marked.cpu().numpy(), np.ones((_THINNEST, _THINNEST))) & lit.cpu().numpy()
        side = math.ceil(NARROWEST * size)
        wide = binary_dilation(binary_opening(clear, np.ones((side, side))), iterations=side, mask=clear)
        marks.append((marked & lit, torch.from_numpy(wide).to(lit.device)))
    return marks
