"""Which channels to work in: R, G, B; the spectrum as it was measured; luminance; or one of them alone."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from homofact.brdf.in_kind import answering_in_kind
from homofact.brdf.reflectance import Derived
from homofact.brdf.samples import Samples
from homofact.brdf.source_names import CHANNELS
from homofact.brdf.spectral import LUMINANCE, to_luminance, to_rgb
from homofact.brdf.wavelengths import covers_colours, wavelengths_of
from homofact.errors import BadInput

_RGB = ("R", "G", "B")


def check_channels(wanted: str) -> None:
    """Raise BadInput unless `wanted` is one of `CHANNELS`."""
    if wanted not in CHANNELS:
        raise BadInput(where="channels", found=repr(wanted), expected=f"one of {', '.join(CHANNELS)}")


def reading_of(wanted: str) -> tuple[str, str]:
    """Return (channels for the reader, the single channel to keep) for `wanted`: a name of `CHANNELS`, or a channel.

    The second string is empty if all channels are kept. Wavelengths are names such as 550nm. Raises BadInput for other
    names.
    """
    if wanted in CHANNELS:
        return wanted, ""
    if wanted in _RGB:
        return "rgb", wanted
    if wanted == "Y":
        return "luminance", ""
    if wavelengths_of((wanted,)) is not None:
        return "spectral", wanted
    raise BadInput(
        where="channels", found=repr(wanted), expected=f"{', '.join(CHANNELS)}, or one channel such as G or 550nm"
    )


def as_channels(samples: Samples, wanted: str) -> Samples:
    """Return the samples in the channels `wanted`: "rgb", "spectral" or "luminance".

    Spectra are converted to linear sRGB or CIE Y, and provenance["colour"] records the method. RGB is converted to
    luminance with the weights of sRGB. Other samples stay unchanged. Raises BadInput for an unknown name, and for
    "spectral" if the samples are not a spectrum.
    """
    check_channels(wanted)
    wavelengths = wavelengths_of(samples.channels)
    if wavelengths is None:
        if wanted == "spectral":
            raise BadInput(f"the samples have {', '.join(samples.channels)}", where="channels", expected="a spectrum")
        if wanted == "luminance" and samples.channels == _RGB:
            return replace(
                samples,
                values=_luminance(samples.values),
                channels=("Y",),
                provenance=samples.provenance | {"colour": {"space": "CIE Y of linear sRGB"}},
            )
        return samples
    if wanted == "spectral":
        return samples
    values, facts = (to_rgb if wanted == "rgb" else to_luminance)(samples.values, wavelengths)
    return replace(
        samples,
        values=values,
        channels=_RGB if wanted == "rgb" else ("Y",),
        provenance=samples.provenance | {"colour": facts},
    )


@dataclass(frozen=True)
class LuminanceOf(Derived):
    """The luminance of an RGB `Reflectance`, itself a `Reflectance` of one channel, Y."""

    @property
    def channels(self) -> tuple[str, ...]:
        """("Y",)."""
        return ("Y",)

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return CIE Y (N, 1) in sr⁻¹, without the cosine."""
        return _luminance(self.base.evaluate(wi, wo))


@dataclass(frozen=True)
class OneChannel(Derived):
    """One channel of a `Reflectance`, itself a `Reflectance`."""

    name: str

    @property
    def channels(self) -> tuple[str, ...]:
        """The name alone."""
        return (self.name,)

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return BRDF values (N, 1) in sr⁻¹, without the cosine."""
        column = self.base.channels.index(self.name)
        return self.base.evaluate(wi, wo)[:, column : column + 1]


def _luminance(rgb: Tensor) -> Tensor:
    return rgb @ torch.tensor(LUMINANCE, dtype=rgb.dtype, device=rgb.device)[:, None]


def display_of(channels: Sequence[str]) -> Callable[[Tensor], Tensor] | None:
    """Return a function from values (N, C) to linear sRGB (N, 3) for pictures, or None if none is needed.

    The function converts spectra to sRGB. Colours outside the gamut have negative values, which the picture clips and
    counts. A spectrum without blue or red has no colour, so its mean is shown as grey. A single channel is also shown
    as grey and needs no function.
    """
    wavelengths = wavelengths_of(channels) if len(channels) > 1 else None
    if wavelengths is None:
        return None
    if not covers_colours(wavelengths):
        return lambda values: values.mean(1, keepdim=True).expand(-1, 3)
    return lambda values: to_rgb(values, wavelengths, clip=False)[0]
