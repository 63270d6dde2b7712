"""Find the pixels of a picture that lie beyond the measurement.

A source that interpolates scattered samples has values everywhere, but a goniometer does not reach every pair of
directions (`brdf.quality.extrapolation`). A pixel is marked if more than half of its incident light comes from
directions that were not measured with its view. Under a point light the share is 0 or 1. `hatching.region_to_hatch`
turns the marked pixels into the hatched region.
"""

from collections.abc import Sequence

import torch
from torch import Tensor

from homofact.brdf.quality.extrapolation import Extrapolation
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.scattered import interpolated_samples
from homofact.figures.hatching import region_to_hatch
from homofact.rendering.filtered import FilteredMaterial, Surroundings
from homofact.rendering.light import DirectionalLight
from homofact.rendering.lobe_patches import DRAFT
from homofact.rendering.sphere import render_sphere

LEAST = 0.5


class _Part:
    """A reflectance that is 1 where a pair of directions was measured and 0 elsewhere; without samples, always 1."""

    channels = ("Y",)
    nbytes, fetches = 0, 0

    def __init__(self, samples: Samples | None) -> None:
        self._extrapolation = None if samples is None else Extrapolation(samples)

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return 1 or 0 (N, 1) for pairs of directions (N, 3); 0 below the horizon."""
        above = (wi[:, 2] >= 0) & (wo[:, 2] >= 0)
        if self._extrapolation is not None:
            above &= self._extrapolation.measured(wi, wo)
        return above.to(torch.float64)[:, None]


def beyond_the_measurement(
    source: Reflectance, lights: Sequence[DirectionalLight | Surroundings], size: int
) -> list[tuple[Tensor, Tensor]] | None:
    """Return for each light the marked and the hatched pixels (size, size); None without samples."""
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
        # What is left of the light by rounding is no light.
        lit = whole > 1e-6 * whole.max()
        marked = (known < LEAST * whole) & lit
        region = region_to_hatch(marked.cpu().numpy(), lit.cpu().numpy())
        marks.append((marked, torch.from_numpy(region).to(lit.device)))
    return marks
