"""Compare the statements of Cole 2002, section 4.4, with the errors that our fits have.

`Errors` maps (source, coordinates, reciprocal, textures) to one error, the thesis's "relative squared
error" (log_mse); McCool's projections stand under the coordinates MCCOOL with two textures. A
statement about something not in the table is "not tested". Where the words leave room (matched, about
half), the tolerance is ours and stands in the statement.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

MCCOOL = "mccool"
LAFORTUNE = "lafortune-blue-paint"
COOK_TORRANCE = "cook-torrance-plastic"
GARNET = "garnet_red.brdf"
PAINTS = (GARNET, "krylon_blue.brdf", "cayman.brdf")
THEORETICAL = (LAFORTUNE, COOK_TORRANCE)
SPECULAR = (COOK_TORRANCE, *PAINTS)
AGREES, DIFFERS, NOT_TESTED = "agrees", "differs", "not tested"


class Key(NamedTuple):
    """Which fit an error belongs to."""

    source: str
    coordinates: str
    reciprocal: bool
    textures: int


Errors = dict[Key, float]


@dataclass(frozen=True)
class Verdict:
    """A statement of the thesis, what was found here, and whether they agree."""

    statement: str
    found: str
    verdict: str


class _Missing(Exception):
    """The table does not hold what a statement speaks of."""


def judge(errors: Errors) -> list[Verdict]:
    """Every statement with its verdict."""
    verdicts = []
    for statement, check in STATEMENTS:
        try:
            agrees, found = check(errors)
        except _Missing as missing:
            verdicts.append(Verdict(statement, f"no figures for {missing}", NOT_TESTED))
            continue
        verdicts.append(Verdict(statement, found, AGREES if agrees else DIFFERS))
    return verdicts


def _least(
    errors: Errors,
    source: str,
    textures: int,
    coordinates: str | None = None,
    reciprocal: bool | None = None,
) -> float:
    """The lowest error of `source` at that many textures over the variants left open, McCool apart."""
    found = [
        error
        for key, error in errors.items()
        if key.source == source
        and key.textures == textures
        and key.coordinates != MCCOOL
        and coordinates in (None, key.coordinates)
        and reciprocal in (None, key.reciprocal)
    ]
    if not found:
        raise _Missing(f"{source} at {textures} textures")
    return min(found)


def _against(errors: Errors, source: str, textures: int, coordinates: str | None = None) -> float:
    """The lowest error divided by that of McCool's projections."""
    mccool = [error for key, error in errors.items() if key.source == source and key.coordinates == MCCOOL]
    if not mccool:
        raise _Missing(f"McCool's projections on {source}")
    return _least(errors, source, textures, coordinates) / mccool[0]


def _measured(errors: Errors) -> list[str]:
    """The paints that the table has. Raises where there are none."""
    present = {key.source for key in errors}
    found = [source for source in PAINTS if source in present]
    if not found:
        raise _Missing("the Cornell paints")
    return found


def _lafortune_two(errors: Errors) -> tuple[bool, str]:
    ratio = _against(errors, LAFORTUNE, 2)
    return ratio <= 0.17, f"cut by {1 - ratio:.0%}"


def _lafortune_five(errors: Errors) -> tuple[bool, str]:
    two, five = _against(errors, LAFORTUNE, 2), _against(errors, LAFORTUNE, 5)
    return five <= two / 2, f"five textures at {five / two:.2f} of two (cut by {1 - five:.0%} in all)"


def _cook_torrance_two(errors: Errors) -> tuple[bool, str]:
    ratio = _against(errors, COOK_TORRANCE, 2)
    return 0.9 <= ratio <= 1.1, f"{ratio:.2f} of McCool's at two textures"


def _cook_torrance_more(errors: Errors) -> tuple[bool, str]:
    ratio = _against(errors, COOK_TORRANCE, 3)
    return ratio < 1, f"{ratio:.2f} of McCool's at three textures"


def _paints_two(errors: Errors) -> tuple[bool, str]:
    ratios = {source: _against(errors, source, 2) for source in _measured(errors)}
    return all(ratio < 1 for ratio in ratios.values()), _each(ratios)


def _lafortune_in_out(errors: Errors) -> tuple[bool, str]:
    ratios = {
        textures: _least(errors, LAFORTUNE, textures, "in-out") / _least(errors, LAFORTUNE, textures, "half-diff")
        for textures in (2, 5)
    }
    return ratios[5] <= 0.6, f"in-out / half-diff {ratios[5]:.2f} at five textures, {ratios[2]:.2f} at two"


def _specular_half(errors: Errors) -> tuple[bool, str]:
    ratios = {
        source: _least(errors, source, 5, "half-diff") / _least(errors, source, 5, "in-out")
        for source in (COOK_TORRANCE, *_measured(errors))
    }
    return all(ratio < 1 for ratio in ratios.values()), _each(ratios)


def _specular_in_out_behind_mccool(errors: Errors) -> tuple[bool, str]:
    ratios = {source: _against(errors, source, 2, "in-out") for source in (COOK_TORRANCE, *_measured(errors))}
    return all(ratio > 1 for ratio in ratios.values()), _each(ratios)


def _reciprocity(errors: Errors, source: str) -> float:
    """Best error at five textures with reciprocity over the best without."""
    return _least(errors, source, 5, reciprocal=True) / _least(errors, source, 5, reciprocal=False)


def _reciprocity_theoretical(errors: Errors) -> tuple[bool, str]:
    ratios = {source: _reciprocity(errors, source) for source in THEORETICAL}
    return all(ratio <= 1 for ratio in ratios.values()), _each(ratios)


def _reciprocity_garnet(errors: Errors) -> tuple[bool, str]:
    ratio = _reciprocity(errors, GARNET)
    return ratio >= 1, f"with / without {ratio:.2f}"


def _reciprocity_others(errors: Errors) -> tuple[bool, str]:
    ratios = {source: _reciprocity(errors, source) for source in _measured(errors) if source != GARNET}
    if not ratios:
        raise _Missing("krylon_blue and cayman")
    return all(ratio <= 1 for ratio in ratios.values()), _each(ratios)


def _almost_every(errors: Errors) -> tuple[bool, str]:
    sources = sorted({key.source for key in errors})
    if not sources:
        raise _Missing("any source")
    most = max(key.textures for key in errors)
    better = [source for source in sources if min(_against(errors, source, j) for j in range(1, most + 1)) < 1]
    return len(better) >= len(sources) - 1, f"better on {len(better)} of {len(sources)} at up to {most} textures"


def _each(ratios: dict[str, float]) -> str:
    return ", ".join(f"{source.removesuffix('.brdf')} {ratio:.2f}" for source, ratio in ratios.items())


STATEMENTS: tuple[tuple[str, Callable[[Errors], tuple[bool, str]]], ...] = (
    ("Lafortune paint, two textures: error cut by more than 83% against McCool", _lafortune_two),
    ("Lafortune paint, five textures: cut by more than half again", _lafortune_five),
    ("Cook-Torrance, two textures: McCool matched, not improved upon (within 10%)", _cook_torrance_two),
    ("Cook-Torrance: improved upon once another term is added", _cook_torrance_more),
    ("Cornell paints, two textures: better than McCool (best / McCool < 1)", _paints_two),
    ("Lafortune paint: (ωi, ωo) has half the error of Rusinkiewicz (ratio ≤ 0.6 at five)", _lafortune_in_out),
    ("Cook-Torrance and Cornell paints: Rusinkiewicz better (half-diff / in-out < 1 at five)", _specular_half),
    (
        "the same, expected: (ωi, ωo) lags behind McCool (in-out / McCool > 1 at two)",
        _specular_in_out_behind_mccool,
    ),
    ("reciprocity helps the theoretical BRDFs (with / without ≤ 1 at five)", _reciprocity_theoretical),
    ("reciprocity does not help Cornell garnet at five textures", _reciprocity_garnet),
    ("reciprocity helps the other Cornell paints at five (with / without ≤ 1)", _reciprocity_others),
    ("the best approximation improves on McCool in almost every case (all but one)", _almost_every),
)
