"""From linear radiance to an 8-bit sRGB picture: one stated exposure, one curve, nothing else.

Pictures that are compared share the exposure, which is chosen from the source. Pictures for people (`render`, the
comparison pictures, `info`, sheets of materials, the viewer) use `automatic_exposure` and `DEFAULT_CURVE`. Colours
are linear sRGB with the D65 white point (IEC 61966-2-1); what leaves the gamut is clipped and its share reported.

The curve is "srgb" or "filmic". "srgb" is sRGB's own curve, which can be inverted up to white. "filmic" compresses
radiances many times as bright as white into the range of the picture, before sRGB's curve (Narkowicz 2015, a fit to
ACES): y = x (2.51 x + 0.03)/(x (2.43 x + 0.59) + 0.14) of each channel, 1 from x = 7.24 on.
"""

from typing import NamedTuple

import torch
from torch import Tensor

from homofact.errors import BadInput
from homofact.rendering.sphere import SphereImage

PERCENTILE = 99.0
TARGET = 0.9
MIDDLE = 0.18
CURVES = ("srgb", "filmic")
DEFAULT_CURVE = "filmic"
# How much of the automatic exposure, in stops, the median decides; the highlight decides the rest.
MIDDLE_SHARE = 0.7
# Linear value behind the sphere, about #2b2b2b: bright and dark limbs both stand out against it.
_BACKGROUND = 0.024


class ToneMapped(NamedTuple):
    """`pixels` (H, W, 3) uint8 and the share of covered pixels in which some channel was clipped."""

    pixels: Tensor
    clipped: float


def encode_srgb(linear: Tensor) -> Tensor:
    """Return the sRGB transfer curve of linear values, clipped to [0, 1] (IEC 61966-2-1)."""
    linear = linear.clamp(0, 1)
    return torch.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def choose_exposure(image: SphereImage) -> float:
    """Return the factor that takes the 99th percentile of the pixels' largest channel to 0.9; 1 if all is black."""
    brightest = image.radiance.max(2).values[image.coverage > 0]
    if brightest.numel() == 0:
        return 1.0
    level = float(torch.quantile(brightest, PERCENTILE / 100))
    level = level if level > 0 else float(brightest.max())
    return TARGET / level if level > 0 else 1.0


def choose_middle(image: SphereImage) -> float:
    """Return the factor that takes the median brightness of the lit pixels to 0.18; 1 if all is black.

    Unlike `choose_exposure`, it keeps the body of a glossy paint visible beside its highlights, which the filmic curve
    then compresses. Brightness is the mean of a pixel's channels.
    """
    brightness = image.radiance.mean(2)[image.coverage > 0]
    lit = brightness[brightness > 0]
    return MIDDLE / float(lit.median()) if lit.numel() else 1.0


def automatic_exposure(image: SphereImage) -> float:
    """Return the default exposure: the weighted mean in stops of `choose_middle` and `choose_exposure`.

    It is for the filmic curve. The median has the weight `MIDDLE_SHARE`, and the highlight the rest. If r is the ratio
    of highlight to median, the median is mapped to 0.18 (5/r)^0.3: 0.22 for a diffuse paint (r = 2.5), 0.12 for a gloss
    (r = 20), whose body stays visible. Highlights up to 98 times the median stay below the curve's white. 1 if all is
    black.
    """
    return choose_middle(image) ** MIDDLE_SHARE * choose_exposure(image) ** (1 - MIDDLE_SHARE)


def tonemap(image: SphereImage, exposure: float, background: float = _BACKGROUND, curve: str = CURVES[0]) -> ToneMapped:
    """Return the picture over a grey `background` (linear), coverage blended in linear light.

    One channel becomes grey. Raises BadInput for an exposure that is not above 0, and for a curve that is none.
    """
    pixels = (displayed(image, exposure, background, curve) * 255).round().to(torch.uint8)
    exposed = image.radiance * exposure
    inside = image.coverage > 0
    clipped = (((_bent(exposed, curve) > 1) | (exposed < 0)).any(2) & inside).sum() / inside.sum().clamp_min(1)
    return ToneMapped(pixels, float(clipped))


def tonemap_scene(
    radiance: Tensor, coverage: Tensor, exposure: float | None = None, stops: float = 0.0, curve: str = DEFAULT_CURVE
) -> tuple[ToneMapped, float]:
    """Return the picture of objects in front of their surroundings, and its exposure.

    All of `radiance` (H, W, 3) is shown; negative values are black. The default exposure is the automatic one of the
    pixels with `coverage` (H, W) by objects; `stops` multiplies it by 2**stops. Raises BadInput as `tonemap`.
    """
    shown = radiance.clamp_min(0)
    chosen = (automatic_exposure(SphereImage(shown, coverage)) if exposure is None else exposure) * 2**stops
    return tonemap(SphereImage(shown, torch.ones_like(coverage)), chosen, curve=curve), chosen


def displayed(image: SphereImage, exposure: float, background: float = _BACKGROUND, curve: str = CURVES[0]) -> Tensor:
    """Return the same picture before its rounding to 8 bits: (H, W, 3) in [0, 1], clipped; same errors."""
    if not 0 < exposure < float("inf"):
        raise BadInput(where="exposure", found=exposure, expected="above 0")
    share = image.coverage[..., None]
    # Clipped before blending: a bright limb would otherwise eat its smooth edge.
    blended = _bent(image.radiance * exposure, curve).clamp(0, 1) * share + background * (1 - share)
    return encode_srgb(blended).expand(-1, -1, 3).contiguous()


def _bent(linear: Tensor, curve: str) -> Tensor:
    """Linear values under the part of a curve that comes before sRGB's."""
    if curve not in CURVES:
        raise BadInput(where="tonemap", found=repr(curve), expected=f"one of {', '.join(CURVES)}")
    if curve == "srgb":
        return linear
    x = linear.clamp_min(0)
    return x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)
