"""Suggest settings after a verdict that does not trust a fit: larger textures, or more textures with equal bytes."""

import math
from dataclasses import dataclass

from homofact.errors import Advice
from homofact.evaluation.verdict.verdict import Verdict
from homofact.factor.fitted import Fitted
from homofact.methods.method import Method

# A search for a number of bytes tries up to so many textures (`methods.search`).
_MOST_TEXTURES = 3
# Only wider texels resolve a narrow highlight.
_BY_SIZE_ONLY = "narrow"


@dataclass(frozen=True)
class NextStep:
    """Settings to change, and the approximate number of bytes of the new fit; None if it is unknown."""

    settings: tuple[Advice, ...]
    bytes: int | None = None


def next_steps(verdict: Verdict, fitted: Fitted, method: Method) -> tuple[NextStep, ...]:
    """Return the next settings to try, cheapest first; none for a trusted fit or if no setting is known to help.

    If the fit used all allowed textures, the suggestions are one more texture with the same bytes, and larger textures.
    If a search used fewer textures, it found that more do not lower the validation error, so only larger textures are
    suggested.

    Parameters
    ----------
    verdict : Verdict
        The verdict on the fit.
    fitted : Fitted
        The fit.
    method : Method
        The settings that it was made with.

    Returns
    -------
    tuple of NextStep
        One or two alternatives.
    """
    advice = verdict.recommended
    if advice is None:
        return ()
    own = vars(method)
    size, most, kept = own.get("size"), own.get("textures"), len(fitted.terms)
    more = most is not None and kept >= most
    if advice.setting not in ("size", "textures") or not size or not kept or own.get("bytes") is not None:
        return (NextStep((advice,)),)
    by_size_only = next(each.name for each in verdict.findings if each.advice) == _BY_SIZE_ONLY
    steps = []
    if more and kept < _MOST_TEXTURES and not by_size_only:
        narrower = math.floor(size * math.sqrt(kept / (kept + 1)))
        if narrower >= 2:
            nbytes = fitted.nbytes * (kept + 1) * narrower**2 / (kept * size**2)
            steps.append(NextStep((Advice("textures", kept + 1), Advice("size", narrower)), round(nbytes)))
    wider = int(advice.value) if advice.setting == "size" else 2 * size
    steps.append(NextStep((Advice("size", wider),), round(fitted.nbytes * (wider / size) ** 2)))
    return tuple(steps)
