"""Decide whether a material's lobe is separate from its in-out factors, and factor the rest.

A sharp lobe needs hundreds of terms, and each costs every vertex `kept` coefficients. If the rule for the number of
terms gives more than `MOST_SHARED`, the lobe is therefore summed separately (`lobe_table`, `lobe`), at one bit per
texel and vertex, and only the rest is factored. The number of factors then follows from the rule `error`, relative to
the light of the whole material.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.tinted import Tinted
from homofact.errors import BadInput
from homofact.relighting.decomposition import decompositions
from homofact.relighting.factoring import MAP_SIZE, SHARE, check_channels, factor, factors_of_sizes
from homofact.relighting.factors import InOutFactors
from homofact.relighting.lobe_table import LobeTable, Rest, lobe_table, without_lobe
from homofact.relighting.tilted_view import TiltedView, tilted
from homofact.rendering.light import EnvironmentMap

AUTO, SEPARATE, FACTORED = "auto", "separate", "factored"
LOBES = (AUTO, SEPARATE, FACTORED)
MOST_SHARED = 32
# What more terms of a rest would hold is what the lobe's table misses between its nodes near the horizon: a hundred of
# terms for a percent. An odd number, since all but the strongest come in pairs.
MOST_REST = 9
ERROR = 0.02
# What a share close to 1 asks for at most of the parts of a textured material.
_TIGHTEST = 1e-3


@dataclass(frozen=True)
class FactoredMaterial:
    """In-out `factors` of a material, or of its rest without the `lobe`; `tilted` is for mapped normals."""

    factors: InOutFactors
    lobe: LobeTable | None = None
    tilted: TiltedView | None = None

    def with_normals(self, sines: np.ndarray) -> "FactoredMaterial":
        """The same for a surface with a normal map, whose texels have tilts of these `sines` (N,)."""
        factors, view = tilted(self.factors, sines)
        return replace(self, factors=factors, tilted=view)

    def part(self, reflectance: Reflectance) -> Reflectance:
        """Return the part of the material `reflectance` that the factors approximate."""
        return reflectance if self.lobe is None else without_lobe(reflectance, self.lobe)


def factored(
    reflectance: Reflectance,
    lobe: str = AUTO,
    terms: int | None = None,
    share: float | None = None,
    error: float | None = None,
    map_size: int = MAP_SIZE,
    light: EnvironmentMap | None = None,
) -> FactoredMaterial:
    """The factors of a reflectance, and its lobe if that is separate: `lobe` is one of `LOBES`.

    `terms`, `share`, `error`, `map_size` and `light` are those of `factoring.factor`. If `terms` or a `share` are
    given, a lobe is separate only if `lobe` requires it. Without `terms`, the rule `error` (default: `ERROR`) gives the
    number of factors of the rest. A material with a base-colour texture is factored in two parts, with `terms` terms
    each. Raises BadInput as `factor` does, for an unknown `lobe`, and for a `share` with a separate lobe.
    """
    if lobe not in LOBES:
        raise BadInput(where="lobe", found=repr(lobe), expected=f"one of {', '.join(LOBES)}")
    if lobe == SEPARATE and share is not None:
        raise BadInput(where="share", found="it beside a separate lobe", expected="terms or an error")
    whole = None
    if lobe != SEPARATE:
        found = factor(reflectance, terms, SHARE if share is None else share, map_size, error, light)
        given = terms is not None or share is not None
        if lobe == FACTORED or given or found.terms <= MOST_SHARED:
            whole = FactoredMaterial(found)
    if whole is None:
        whole = separated(reflectance, (map_size,), terms, error, light)[0]
    return in_parts(reflectance, whole, terms, share, error, light) if isinstance(reflectance, Tinted) else whole


def in_parts(
    reflectance: Tinted,
    whole: FactoredMaterial,
    terms: int | None = None,
    share: float | None = None,
    error: float | None = None,
    light: EnvironmentMap | None = None,
) -> FactoredMaterial:
    """Return the factors of the two parts of a textured material, by the rule for the factors of the `whole`.

    A `share` measures the energy of f itself, and the glossy part has much more of this energy than of the reflected
    light. If each part had to reach the share alone, the error of the glossy part would be limited to a twentieth of
    the error of the whole. The parts therefore use the expected error of the whole.
    """
    lobe, size = whole.lobe, whole.factors.view.shape[1]
    rest = reflectance if lobe is None else without_lobe(reflectance, lobe)
    assert isinstance(rest, Tinted)
    if terms is None and error is None:
        error = ERROR if lobe is not None else max(whole.factors.expected_error, ERROR if share is None else _TIGHTEST)
    found = []
    for part in (rest.tinted, rest.plain):
        if error is None:
            made = factor(part, terms, map_size=size, light=light)
        else:
            # Errors of the two add up in squares.
            own = factors_of_sizes(part, (size,), error=error / math.sqrt(2), light=light, whole=whole.factors.energy)
            made = own[0] if lobe is None else own[0].first(MOST_REST)
        found.append(made)
    both, energy = found[0].with_plain(found[1]), whole.factors.energy
    # What the parts' terms leave out adds up; what they hold of their own products is nobody's strength.
    lost = sum(each.energy - each.beside - float(each.strength.sum()) for each in found)
    return FactoredMaterial(replace(both, energy=energy, beside=energy - lost - float(both.strength.sum())), lobe)


def separated(
    reflectance: Reflectance,
    map_sizes: tuple[int, ...],
    terms: int | None = None,
    error: float | None = None,
    light: EnvironmentMap | None = None,
) -> list[FactoredMaterial]:
    """The separate lobe, and the factors of the rest on maps of several sizes. Raises BadInput as `factored`."""
    check_channels(reflectance)
    table = lobe_table(reflectance)
    whole = decompositions(reflectance)[1]().under(light).energy
    allowed = None if terms is not None else ERROR if error is None else error
    made = factors_of_sizes(Rest(reflectance, table), map_sizes, terms, error=allowed, light=light, whole=whole)
    few = [each.first(MOST_REST) if terms is None else each for each in made]
    return [FactoredMaterial(each, table) for each in few]
