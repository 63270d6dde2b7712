"""In-out factors of a material, f(ωi, ωo) ≈ Σ_k g_k(ωi) h_k(ωo), as light maps and view maps.

Besides a given number of terms, two rules choose how many terms are kept. Mahajan, Tseng and Ramamoorthi (2008) use the
energy of f, as under white light: 99% of it leaves an RMS error of a tenth of f, whose effect on a picture depends on
the light. The other rule uses the energy of the reflected light. Averaged over all rotations, term k reflects a light
whose harmonics have the mean squares P_l with the energy Σ_l S_kl P_l, S_kl = Σ_m (∫ Y_lm f v_k cosθi)², since the v_k
are orthogonal and so are the harmonics. √(left out/all) is the expected relative RMS error of the light without
shadows: under natural light, or under an environment map with its own P_l.
"""

from collections.abc import Sequence
from dataclasses import replace

from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.linear.threads import one_thread
from homofact.relighting.decomposition import MOST_TERMS, WeightedTerms, decompositions
from homofact.relighting.factors import InOutFactors
from homofact.rendering.light import EnvironmentMap
from homofact.theory.harmonics import check_share

MAP_SIZE, SHARE = 64, 0.99


def factor(
    reflectance: Reflectance,
    terms: int | None = None,
    share: float = SHARE,
    map_size: int = MAP_SIZE,
    error: float | None = None,
    light: EnvironmentMap | None = None,
) -> InOutFactors:
    """Return the factors of a reflectance of 1 or 3 channels; one of three rules gives their number.

    The rules are: `terms` of them; the fewest with an expected relative RMS error of the reflected light of at most
    `error`; or the fewest with `share` of f's energy. Errors and strengths are computed for `light`. Default: natural
    light, which always determines the functions. There are at most `MOST_TERMS`; compare `expected_error` with `error`
    to see if they were enough. Raises BadInput for terms outside 1 to `MOST_TERMS`, terms and an error both, an error
    or a share outside (0, 1), maps of fewer than 8 or more than 256 texels across, and a reflectance without energy or
    with values that are not finite.
    """
    return factors_of_sizes(reflectance, (map_size,), terms, share, error, light)[0]


@one_thread
def factors_of_sizes(
    reflectance: Reflectance,
    map_sizes: Sequence[int],
    terms: int | None = None,
    share: float = SHARE,
    error: float | None = None,
    light: EnvironmentMap | None = None,
    whole: float | None = None,
) -> list[InOutFactors]:
    """`factor` on maps of several sizes: the same terms, decomposed once. Raises BadInput as `factor`.

    Errors are relative to the energy `whole`, which parts of a material need. Default: the energy of the reflectance.
    """
    if terms is not None and not 1 <= terms <= MOST_TERMS:
        raise BadInput(where="terms", found=terms, expected=f"1 to {MOST_TERMS}")
    if terms is not None and error is not None:
        raise BadInput(found="terms and error", expected="one of the two")
    if error is not None and not 0 < error < 1:
        raise BadInput(where="error", found=error, expected="between 0 and 1")
    check_share(share)
    for size in map_sizes:
        if not 8 <= size <= 256:
            raise BadInput(where="map size", found=size, expected="8 to 256 texels across")
    found, picked = _settled(reflectance, terms, share, error, light, whole)
    return [found.drawn(reflectance, picked, size) for size in map_sizes]


@one_thread
def terms_for(reflectance: Reflectance, error: float, light: EnvironmentMap | None = None) -> int:
    """Return how many terms reach the expected `error`, at most `MOST_TERMS`. Raises BadInput as `factor`."""
    found, picked = _settled(reflectance, None, SHARE, error, light, None)
    return int(found.multiplicity[picked].sum())


def check_channels(reflectance: Reflectance) -> None:
    """Raise BadInput unless the reflectance has 1 or 3 channels."""
    if len(reflectance.channels) not in (1, 3):
        raise BadInput(where="relighting", found=f"{len(reflectance.channels)} channels", expected="1 or 3")


def _settled(
    reflectance: Reflectance,
    terms: int | None,
    share: float,
    error: float | None,
    light: EnvironmentMap | None,
    whole: float | None,
) -> tuple[WeightedTerms, list[int]]:
    """Return the terms on the first sufficiently fine grid, and the indices of the kept terms."""
    check_channels(reflectance)
    before, found, picked = None, None, []
    for split in decompositions(reflectance):
        found = split().under(light)
        found = found if whole is None else replace(found, whole=whole)
        picked = found.chosen(terms, share, error)
        # Settled where the next finer grid finds the same: the number of terms, or with a given one their share.
        now = float(len(picked)) if terms is None else float(found.parts[picked].sum()) / found.energy
        if before is not None and abs(now - before) <= (max(1.0, 0.03 * now) if terms is None else 0.002):
            break
        before = now
    assert found is not None
    return found, picked
