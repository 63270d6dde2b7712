"""What a fit's channels become in a variant of Mitsuba 3: R, G, B, grey, or values at the wavelengths of a path.

| channels | rgb | mono | spectral |
|---|---|---|---|
| R, G, B | linear sRGB | luminance | Mallett and Yuksel's spectra (`brdf.upsampling`) |
| one | grey | as it is | the same at every wavelength |
| wavelengths | linear sRGB under D65, cut at 0 | CIE Y under D65 | linear between bands, end values beyond |

In a spectral variant every path has its own few wavelengths, which are in the surface interaction. Colours come from
the emitters' spectra and the film. Import this module only if Mitsuba is installed.
"""

from collections.abc import Callable, Sequence
from typing import Any

import torch

from homofact.brdf.spectral import to_luminance, to_rgb
from homofact.brdf.upsampling import NODES, basis
from homofact.brdf.wavelengths import spectrum_of

_LUMINANCE = (0.212671, 0.71516, 0.072169)  # Mitsuba's `luminance`

Spectra = Callable[[list[Any], Any], Any]


def spectra_of(mi: Any, channels: Sequence[str]) -> Spectra:
    """Return a function from C values in sr⁻¹ and a surface interaction to a `mitsuba.Spectrum`, for variant `mi`.

    Raises BadInput for several channels that are neither R, G, B nor visible wavelengths.
    """
    if len(channels) == 1:
        # One value is grey in all of Mitsuba's.
        return lambda values, si: mi.Spectrum(values[0])
    bands = None if tuple(channels) == ("R", "G", "B") else spectrum_of(channels)
    if mi.is_spectral:
        if bands is None:
            weights = basis().tolist()
            return lambda values, si: _at(mi, si.wavelengths, NODES, _mixed(values, weights))
        return lambda values, si: _at(mi, si.wavelengths, bands, values)
    if bands is None:
        return lambda values, si: mi.Spectrum(*(_mixed(values, (_LUMINANCE,)) if mi.is_monochromatic else values))
    unit = torch.eye(len(bands), dtype=torch.float64)
    made = to_luminance(unit, bands)[0] if mi.is_monochromatic else to_rgb(unit, bands, clip=False)[0]
    weights = made.T.tolist()
    return lambda values, si: mi.Spectrum(*(_positive(each) for each in _mixed(values, weights)))


def _mixed(values: list[Any], weights: Sequence[Sequence[float]]) -> list[Any]:
    """The sums of the values, weighted by each row."""
    return [sum(value * weight for value, weight in zip(values, row, strict=True)) for row in weights]


def _positive(value: Any) -> Any:
    import drjit as dr

    return dr.maximum(value, 0)


def _at(mi: Any, wavelengths: Any, nodes: Sequence[float], values: list[Any]) -> Any:
    """The values at `nodes` interpolated at each wavelength of the paths; the end values beyond.

    A sum of rises: v0 + Σ (v(k+1) − v(k)) times how far the wavelength is through the interval, from 0 to 1.
    """
    import drjit as dr

    total = mi.Spectrum(values[0])
    for k in range(len(nodes) - 1):
        through = dr.clip((wavelengths - nodes[k]) * (1 / (nodes[k + 1] - nodes[k])), 0, 1)
        total = total + mi.Spectrum(through) * mi.Spectrum(values[k + 1] - values[k])
    return total
