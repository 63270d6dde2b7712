"""The bands of a spectrum as names of channels, "550nm", and as wavelengths in nm. No torch is loaded here."""

from collections.abc import Sequence
from itertools import pairwise

from homofact.errors import Advice, BadInput

# Without these the blue or the red primary would be made up of end values.
_NEEDED = (450.0, 650.0)
_INSTEAD = f"keep the spectra with {Advice('channels', 'spectral')}"


def spectral_names(wavelengths: Sequence[float]) -> tuple[str, ...]:
    """Channel names of a spectrum, for instance "550nm"."""
    return tuple(f"{w:.12g}nm" for w in wavelengths)


def wavelengths_of(channels: Sequence[str]) -> tuple[float, ...] | None:
    """Wavelengths in nm where the channels are those of a spectrum, else None."""
    if not channels or not all(name.endswith("nm") for name in channels):
        return None
    try:
        return tuple(float(name.removesuffix("nm")) for name in channels)
    except ValueError:
        return None


def colour_wavelengths(wavelengths: Sequence[float], instead: str = _INSTEAD) -> tuple[float, ...]:
    """Wavelengths in nm from which a colour can be computed: at least two, rising, from blue to red.

    Raises BadInput for others; if they do not cover blue and red, the message includes the advice `instead`.
    """
    given = tuple(float(w) for w in wavelengths)
    if len(given) < 2:
        found = f"{given[0]:g} nm alone" if given else "none"
        raise BadInput(where="wavelengths", found=found, expected="at least 2 for a colour")
    for before, after in pairwise(given):
        if not after > before:
            raise BadInput(f"{after:g} nm follows {before:g} nm", where="wavelengths", expected="rising wavelengths")
    if not covers_colours(given):
        raise BadInput(
            where="wavelengths",
            found=f"{given[0]:g}-{given[-1]:g} nm",
            expected=f"them to cover {_NEEDED[0]:g}-{_NEEDED[1]:g} nm for a colour",
            hint=instead,
        )
    return given


def covers_colours(wavelengths: Sequence[float]) -> bool:
    """Return whether wavelengths in nm, of which there is one, reach from blue to red."""
    return min(wavelengths) <= _NEEDED[0] and max(wavelengths) >= _NEEDED[1]


def spectrum_of(channels: Sequence[str]) -> tuple[float, ...]:
    """Return the wavelengths in nm of channels that are a visible spectrum, as `colour_wavelengths` has them.

    Raises BadInput for others.
    """
    wavelengths = wavelengths_of(channels)
    if wavelengths is None:
        shown = ", ".join(channels[:3]) + (", …" if len(channels) > 3 else "")
        raise BadInput(where="channels", found=shown or "none", expected="the bands of a spectrum, such as 550nm")
    return colour_wavelengths(wavelengths, "")
