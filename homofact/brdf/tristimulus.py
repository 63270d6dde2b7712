"""Convert between CIE XYZ, linear sRGB and spectra, the colours of measurement files and of homofact."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from homofact.brdf.in_kind import answering_in_kind
from homofact.brdf.reflectance import Derived
from homofact.brdf.spectral import FROM_XYZ, to_luminance, to_rgb
from homofact.brdf.wavelengths import spectral_names, wavelengths_of
from homofact.errors import BadInput

_RGB = ("R", "G", "B")


def from_xyz(xyz: Tensor) -> Tensor:
    """Return linear sRGB (..., 3) of CIE XYZ (..., 3) with D65's white; negative where a colour leaves the gamut."""
    return xyz @ torch.tensor(FROM_XYZ, dtype=xyz.dtype).T


def to_xyz(values: Tensor, channels: Sequence[str]) -> Tensor:
    """Return CIE XYZ (N, 3) of linear sRGB or spectra (N, C); a single channel (N, 1) is returned as Y.

    Raises BadInput for other channels, and as `spectral.to_rgb`.
    """
    if len(channels) == 1:
        return values
    if tuple(channels) == _RGB:
        rgb = values
    elif (wavelengths := wavelengths_of(channels)) is not None:
        rgb = to_rgb(values, wavelengths, clip=False)[0]
    else:
        raise BadInput(f"channels {', '.join(channels)}", expected="R, G, B, one alone, or wavelengths")
    return rgb @ torch.linalg.inv(torch.tensor(FROM_XYZ, dtype=rgb.dtype)).T


@dataclass(frozen=True)
class CieY(Derived):
    """A `Reflectance` with the CIE Y of another one in linear sRGB, in a spectrum or in one channel."""

    @property
    def channels(self) -> tuple[str, ...]:
        """("Y",)."""
        return ("Y",)

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return CIE Y (N, 1) in sr⁻¹, without the cosine."""
        xyz = to_xyz(self.base.evaluate(wi, wo), self.base.channels)
        return xyz[:, 1:2] if xyz.shape[1] == 3 else xyz


def spectra_in(
    values: Tensor, wavelengths: Sequence[float], channels: str
) -> tuple[Tensor, tuple[str, ...], dict[str, Any]]:
    """Convert spectra (..., W) to `channels`; return (values (..., C), channel names, facts on the conversion).

    Raises BadInput as `spectral.to_rgb`.
    """
    if channels == "spectral":
        return values, spectral_names(wavelengths), {}
    converted, facts = (to_rgb if channels == "rgb" else to_luminance)(
        values.reshape(-1, values.shape[-1]), wavelengths
    )
    return converted.reshape(*values.shape[:-1], -1), _RGB if channels == "rgb" else ("Y",), facts
