"""What `strict` and `refuse` make of a verdict: a fit with certain findings is refused."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from homofact.errors import BadInput

if TYPE_CHECKING:
    from homofact.evaluation.verdict.verdict import Verdict


def checked_findings(names: Sequence[str]) -> tuple[str, ...]:
    """The findings to refuse. Raises BadInput that lists them for one that there is not."""
    if not names:
        return ()
    from homofact.brdf.quality.suspicion.suspects import NAMES as SUSPECTED
    from homofact.evaluation.verdict.finding import NAMES

    known = tuple(dict.fromkeys((*NAMES, *SUSPECTED)))
    unknown = [name for name in names if name not in known]
    if unknown:
        raise BadInput(where="refuse", found=repr(unknown[0]), expected=f"some of {', '.join(known)}")
    return tuple(names)


def refuse_findings(verdict: "Verdict", label: str, strict: bool, names: Sequence[str] = ()) -> None:
    """Raise BadInput with the first finding that is refused, and the others' names.

    `strict` refuses what is wrong with the fit and shows in a picture, `names` these findings whatever they are about.
    """
    from homofact.evaluation.verdict.finding import About

    refused = [
        finding
        for finding in verdict.findings
        if (strict and finding.about is About.FIT and finding.matters) or finding.name in names
    ]
    if refused:
        first, *more = refused
        others = f" (and {', '.join(finding.name for finding in more)})" if more else ""
        by = "refuse" if first.name in names else "strict"
        raise BadInput(f"refused by {by}, {first.line()}{others}", where=label)
