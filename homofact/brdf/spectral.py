"""Spectra to linear sRGB and to luminance, with the tables of colour-science.

homofact reads nearly all files under D65. The tables for D65 are stored in d65.json
(scripts/data/make_colour_table.py), since the library takes a second to load.

A BRDF in sr⁻¹ at each wavelength is weighted by illuminant × colour-matching functions (CIE 15:2018, 7.1)
on a 1 nm raster of 360–780 nm; between the given wavelengths it is interpolated linearly, beyond them its
end values are kept. XYZ are scaled so that a flat spectrum of 1 has Y = 1, adapted from the illuminant's
white to sRGB's (D65, x .3127, y .3290) by Bradford's transform, and taken to the ITU-R BT.709 primaries of
IEC 61966-2-1, without its transfer curve. A flat spectrum of 1 is therefore RGB (1, 1, 1), whatever the
illuminant and however few the wavelengths.
"""

import json
from collections.abc import Sequence
from functools import lru_cache
from importlib.resources import files
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.wavelengths import colour_wavelengths
from homofact.errors import BadInput

OBSERVER = "CIE 1931 2 Degree Standard Observer"
ILLUMINANT = "D65"
# Y of linear sRGB: the middle row of RGB → XYZ (IEC 61966-2-1, derived from primaries and white).
LUMINANCE = (0.21263901, 0.71516868, 0.07219232)
# Linear sRGB from CIE XYZ with D65 white: the inverse of the primaries' matrix (IEC 61966-2-1).
FROM_XYZ = (
    (3.2404542, -1.5371385, -0.4985314),
    (-0.9692660, 1.8760108, 0.0415560),
    (0.0556434, -0.2040259, 1.0572252),
)
_RASTER = np.arange(360.0, 781.0)


def to_rgb(
    spectra: Tensor, wavelengths: Sequence[float], illuminant: str = ILLUMINANT, clip: bool = True
) -> tuple[Tensor, dict[str, Any]]:
    """Return linear sRGB (N, 3) in sr⁻¹ of spectra (N, W) in sr⁻¹ at `wavelengths` in nm, and the facts (JSON-able).

    Colours outside the gamut have a negative channel: it is set to 0 unless `clip` is false (a picture counts
    and clips what leaves the gamut itself), and facts["clipped"] counts those per channel. Raises BadInput for
    wavelengths that do not match the spectra, do not increase or do not cover blue and red, and for an unknown
    illuminant.
    """
    weights = _weights(_checked(spectra, wavelengths), illuminant)
    rgb = spectra @ torch.from_numpy(weights[0].copy()).to(spectra)
    clipped = (rgb < 0).sum(0)
    facts = _facts(wavelengths, illuminant, weights[1])
    facts["space"] = "linear sRGB"
    facts["clipped"] = {name: int(count) for name, count in zip("RGB", clipped, strict=True)}
    return rgb.clamp_min(0) if clip else rgb, facts


def to_luminance(
    spectra: Tensor, wavelengths: Sequence[float], illuminant: str = ILLUMINANT
) -> tuple[Tensor, dict[str, Any]]:
    """Return CIE Y (N, 1) in sr⁻¹, 1 for a flat spectrum of 1, and the facts; same errors as `to_rgb`."""
    weights = _weights(_checked(spectra, wavelengths), illuminant)
    facts = _facts(wavelengths, illuminant, weights[1])
    facts["space"] = "CIE Y"
    return spectra @ torch.from_numpy(weights[2].copy()).to(spectra)[:, None], facts


def xyz_weights(wavelengths: Sequence[float], illuminant: str = ILLUMINANT) -> np.ndarray:
    """Return weights (W, 3) that turn spectra (..., W) into CIE XYZ under an illuminant, without adaptation.

    Their sum over the wavelengths is the illuminant's white, whose Y is 1. Raises BadInput as `to_rgb`.
    """
    return _xyz_weights(colour_wavelengths(wavelengths), illuminant)


def _checked(spectra: Tensor, wavelengths: Sequence[float]) -> tuple[float, ...]:
    if len(wavelengths) < 2 or spectra.shape[-1] != len(wavelengths):
        raise BadInput(
            f"{spectra.shape[-1]} values for {len(wavelengths)} wavelengths",
            where="spectra",
            expected="one each for at least 2",
        )
    return colour_wavelengths(wavelengths)


@lru_cache(maxsize=16)
def _xyz_weights(wavelengths: tuple[float, ...], illuminant: str) -> np.ndarray:
    # Row w: how much each raster line takes from wavelength w; linear inside, the end values outside.
    hats = np.stack([np.interp(_RASTER, wavelengths, unit) for unit in np.eye(len(wavelengths))])
    xyz = hats @ illuminated(illuminant).matching
    return xyz / xyz.sum(0)[1]


@lru_cache(maxsize=16)
def _weights(wavelengths: tuple[float, ...], illuminant: str) -> tuple[np.ndarray, tuple[float, float], np.ndarray]:
    """(RGB weights (W, 3), xy of the illuminant's white, Y weights (W,))."""
    _, primary, bradford = illuminated(illuminant)
    xyz = _xyz_weights(wavelengths, illuminant)
    white = xyz.sum(0)
    gain = (bradford @ primary.sum(1)) / (bradford @ white)
    to_linear = np.linalg.inv(primary) @ np.linalg.inv(bradford) @ np.diag(gain) @ bradford
    rgb = xyz @ to_linear.T
    total = white.sum()
    return rgb, (float(white[0] / total), float(white[1] / total)), xyz[:, 1]


class Illuminated(NamedTuple):
    """Illuminant times colour-matching functions on the raster (421, 3); sRGB's primaries and Bradford's transform."""

    matching: np.ndarray
    primary: np.ndarray
    bradford: np.ndarray


@lru_cache(maxsize=8)
def illuminated(illuminant: str) -> Illuminated:
    """Return the tables of an illuminant, for D65 the stored ones. Raises BadInput for an unknown name."""
    if illuminant != ILLUMINANT:
        return computed(illuminant)
    kept = json.loads(files("homofact.brdf").joinpath("d65.json").read_text(encoding="utf-8"))
    return Illuminated(**{name: np.array(values) for name, values in kept.items()})


def computed(illuminant: str) -> Illuminated:
    """Return the tables of an illuminant from colour-science. Raises BadInput for an unknown name."""
    import colour  # about a second to load

    # CIE 15 calls the fluorescent lamps FL1 to FL12, most others F1 to F12.
    name = f"FL{illuminant[1:]}" if illuminant[1:].isdecimal() and illuminant.startswith("F") else illuminant
    if name not in colour.SDS_ILLUMINANTS:
        raise BadInput(where="illuminant", found=repr(illuminant), expected="a CIE name, for instance D65, D50, A or E")
    light = colour.SDS_ILLUMINANTS[name]
    observer = colour.MSDS_CMFS[OBSERVER]
    power = np.interp(_RASTER, light.wavelengths, light.values)
    matching = np.stack([np.interp(_RASTER, observer.wavelengths, observer.values[:, k]) for k in range(3)], 1)
    space = colour.RGB_COLOURSPACES["sRGB"]
    primary = np.asarray(colour.normalised_primary_matrix(space.primaries, space.whitepoint))
    bradford = np.asarray(colour.CHROMATIC_ADAPTATION_TRANSFORMS["Bradford"])
    return Illuminated(matching * power[:, None], primary, bradford)


def _facts(wavelengths: Sequence[float], illuminant: str, white: tuple[float, float]) -> dict[str, Any]:
    return {
        "observer": OBSERVER,
        "illuminant": illuminant,
        "illuminant_xy": [round(x, 5) for x in white],
        "white": "a flat reflectance of 1 is 1 in every channel",
        "adaptation": "Bradford to D65 (x 0.3127, y 0.3290)",
        "wavelengths_nm": [float(w) for w in wavelengths],
        "outside": f"values at {wavelengths[0]:g} and {wavelengths[-1]:g} nm, repeated to 360 and 780 nm",
    }
