"""Undo wrong conventions and units in samples, by name.

`homofact convert` writes the corrected samples. Each correction is a pure function of the samples. Corrections that
divide by a cosine drop samples within 0.6° of the horizon, where the quotient is unreliable.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from homofact.brdf.samples import Samples
from homofact.errors import BadInput
from homofact.geometry.directions import from_spherical, to_spherical

LEAST_COSINE = 0.01


@dataclass(frozen=True)
class Undo:
    """One correction: `words` describe the fault, and `apply` removes it from samples."""

    name: str
    words: str
    apply: Callable[[Samples], Samples]


def names_in(text: str) -> tuple[str, ...]:
    """Return the names in a text with commas, none in an empty one.

    Raises BadInput for an unknown one (listing all).
    """
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    for name in names:
        _check(name)
    return names


def undone(samples: Samples, names: Sequence[str]) -> Samples:
    """Return the samples with all of `names` undone, in that order; provenance["undone"] lists them.

    Raises BadInput for an unknown name (listing all), and where nothing is left.
    """
    for name in names:
        _check(name)
    for name in names:
        samples = UNDO[name].apply(samples)
        facts = {"undone": [*samples.provenance.get("undone", []), name]}
        samples = replace(samples, provenance=samples.provenance | facts)
    return samples


def _check(name: str) -> None:
    if name not in UNDO:
        raise BadInput(where="undo", found=repr(name), expected=f"some of {', '.join(UNDO)}")


def srgb_decoded(values: Tensor) -> Tensor:
    """Decode sRGB values (IEC 61966-2-1) to linear ones; the curve is extrapolated above 1."""
    return torch.where(values <= 0.04045, values / 12.92, ((values.clamp_min(0.04045) + 0.055) / 1.055) ** 2.4)


def _of_values(change: Callable[[Tensor], Tensor]) -> Callable[[Samples], Samples]:
    return lambda samples: replace(samples, values=change(samples.values))


def _by_cosines(power_i: int, power_o: int) -> Callable[[Samples], Samples]:
    """f / (cosθi^power_i cosθo^power_o), the powers of one sign."""

    def apply(samples: Samples) -> Samples:
        if power_i > 0 or power_o > 0:
            cosines = [w[:, 2] for w, power in ((samples.wi, power_i), (samples.wo, power_o)) if power > 0]
            samples = samples.select(torch.stack(cosines).amin(0) >= LEAST_COSINE)
            return replace(samples, values=samples.values / _product(samples, power_i, power_o))
        return replace(samples, values=samples.values * _product(samples, -power_i, -power_o))

    return apply


def _product(samples: Samples, power_i: int, power_o: int) -> Tensor:
    return samples.wi[:, 2:] ** power_i * samples.wo[:, 2:] ** power_o


def _of_angles(
    change_i: Callable[[Tensor, Tensor], Tensor], change_o: Callable[[Tensor, Tensor], Tensor]
) -> Callable[[Samples], Samples]:
    def apply(samples: Samples) -> Samples:
        wi, wo = change_i(*to_spherical(samples.wi)), change_o(*to_spherical(samples.wo))
        for w in (wi, wo):
            w[:, 2] = torch.where(w[:, 2].abs() < 1e-9, 0.0, w[:, 2])
        above = (wi[:, 2] >= 0) & (wo[:, 2] >= 0)
        return replace(samples.select(above), wi=wi[above], wo=wo[above])

    return apply


def _complement(theta: Tensor, phi: Tensor) -> Tensor:
    return from_spherical(math.pi / 2 - theta, phi)


def _degrees(theta: Tensor, phi: Tensor) -> Tensor:
    return from_spherical(theta * (180 / math.pi), phi * (180 / math.pi))


def _swapped(samples: Samples) -> Samples:
    return replace(samples, wi=samples.wo, wo=samples.wi)


_SAME = from_spherical
_ALL = (
    Undo("cosine-o", "the values hold cosθo", _by_cosines(0, 1)),
    Undo("cosine-i", "the values hold cosθi", _by_cosines(1, 0)),
    Undo("cosines", "the values hold cosθi cosθo", _by_cosines(1, 1)),
    Undo("cosine-o-squared", "the values hold cos²θo", _by_cosines(0, 2)),
    Undo("cosine-i-squared", "the values hold cos²θi", _by_cosines(2, 0)),
    Undo("per-cosine-o", "the values are divided by cosθo", _by_cosines(0, -1)),
    Undo("per-cosine-i", "the values are divided by cosθi", _by_cosines(-1, 0)),
    Undo("per-cosines", "the values are divided by cosθi cosθo", _by_cosines(-1, -1)),
    Undo("pi", "the values are times π", _of_values(lambda v: v / math.pi)),
    Undo("per-pi", "the values are divided by π", _of_values(lambda v: v * math.pi)),
    Undo("srgb", "the values are sRGB encoded", _of_values(srgb_decoded)),
    Undo("gamma", "the values are f to the power 1/2.2", _of_values(lambda v: v**2.2)),
    Undo("log1p", "the values are log(1 + f)", _of_values(torch.expm1)),
    Undo("density", "the values are −log10 f", _of_values(lambda v: 10.0**-v)),
    Undo("elevation", "θ is measured from the surface, not from the normal", _of_angles(_complement, _complement)),
    Undo("elevation-i", "θi is measured from the surface, not from the normal", _of_angles(_complement, _SAME)),
    Undo("elevation-o", "θo is measured from the surface, not from the normal", _of_angles(_SAME, _complement)),
    Undo("azimuth", "one azimuth is off by 180°, as where it is counted from the mirror direction", _of_angles(_SAME,
         lambda theta, phi: _SAME(theta, phi + math.pi))),
    Undo("radians", "angles in radians were read as degrees", _of_angles(_degrees, _degrees)),
    Undo("swap", "ωi and ωo are swapped", _swapped),
)  # fmt: skip
UNDO = {undo.name: undo for undo in _ALL}
