"""What a command works on: the source of the configuration, methods by label, how to show it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from homofact.errors import BadInput

if TYPE_CHECKING:
    from torch import Tensor

    from homofact.brdf.reflectance import Reflectance
    from homofact.brdf.source import Source
    from homofact.config import Config
    from homofact.factor.settings import FitSettings


def check_source(settings: "Config") -> None:
    """Refuse a run without a source, before anything else is done. Raises BadInput."""
    if settings.source.path is None:
        raise BadInput("SOURCE: none given, expected a file or material:NAME (or path under [source])")


def open_subject(settings: "Config") -> "Source":
    """The configured source, read or sampled, in all its channels or in one of them. Raises BadInput."""
    from homofact.brdf.channels import CHANNELS
    from homofact.brdf.source import open_source

    check_source(settings)
    wanted = settings.source.channels
    if wanted in CHANNELS:
        kind = wanted
    elif wanted in ("R", "G", "B") or wanted.endswith("nm"):
        kind = "spectral" if wanted.endswith("nm") else "rgb"
    else:
        raise BadInput(f"channels: found {wanted!r}, expected {', '.join(CHANNELS)}, or one channel such as G or 550nm")
    source = open_source(
        str(settings.source.path),
        channels=kind,
        count=settings.source.count,
        scheme=settings.source.scheme,
        seed=settings.seed,
    )
    if wanted in CHANNELS:
        return source
    return replace(source, samples=source.samples.channel(wanted), reflectance=OneChannel(source.reflectance, wanted))


@dataclass(frozen=True)
class OneChannel:
    """One channel of a `Reflectance`, itself a `Reflectance`."""

    base: "Reflectance"
    name: str

    @property
    def channels(self) -> tuple[str, ...]:
        """The name alone."""
        return (self.name,)

    @property
    def nbytes(self) -> int:
        """Those of all channels."""
        return self.base.nbytes

    @property
    def fetches(self) -> int:
        """Those of all channels."""
        return self.base.fetches

    def evaluate(self, wi: "Tensor", wo: "Tensor") -> "Tensor":
        """BRDF values (N, 1) in sr⁻¹, without the cosine."""
        column = self.base.channels.index(self.name)
        return self.base.evaluate(wi, wo)[:, column : column + 1]


def method_settings(base: "FitSettings", label: str) -> "FitSettings":
    """The settings that a method's label stands for: `base` with its method and fixed projections.

    A label is a method's name, or `mccool:` and projections joined with "+". Raises BadInput for an
    unknown method, an unknown projection, and for projections behind a method that searches its own.
    """
    from homofact.evaluate.methods import method
    from homofact.factor.projection import fixed_projection

    name, colon, listed = label.partition(":")
    method(name)
    projections = tuple(part.strip() for part in listed.split("+") if part.strip())
    if colon and (name != "mccool" or not projections):
        raise BadInput(f"method: found {label!r}, expected projections behind mccool only, as in mccool:wi+h")
    for each in projections:
        fixed_projection(each, base.reciprocal)
    return replace(base, method=name, projections=projections)


def display_of(channels: Sequence[str]) -> "Callable[[Tensor], Tensor] | None":
    """What turns values (N, C) into linear sRGB (N, 3) for a picture; None where they show as they are.

    Spectra become sRGB; one channel shows as grey.
    """
    from homofact.brdf.channels import wavelengths_of
    from homofact.brdf.spectral import to_rgb

    wavelengths = wavelengths_of(channels) if len(channels) > 1 else None
    return None if wavelengths is None else lambda values: to_rgb(values, wavelengths)[0]
