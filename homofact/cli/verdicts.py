"""The verdict on a fit, as a person reads it, and what --strict makes of it."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from homofact.errors import BadInput
from homofact.evaluate.wording import figure

if TYPE_CHECKING:
    from homofact.evaluate.findings import Verdict


def verdict_lines(verdict: "Verdict") -> list[str]:
    """The verdict with its figures, then a line a finding."""
    figures = [f"explains {max(verdict.explained, 0):.1%}", f"held out / training {figure(verdict.gap)}"]
    if verdict.determined is not None:
        figures.append(f"{verdict.determined:.0%} of the texels determined by samples")
    if verdict.condition is not None:
        figures.append(f"condition {verdict.condition:.0e}")
    figures += [f"albedo up to {figure(verdict.albedo)}", f"reciprocity error {verdict.reciprocity:.1%}"]
    if verdict.highlight is not None:
        figures.append(f"highlight {figure(verdict.highlight)} of the source's")
    word = "nothing found against this fit" if verdict.trusted else "not to be trusted as it is"
    return [f"Verdict: {word} ({', '.join(figures)})", *(f"  - {finding.line()}" for finding in verdict.findings)]


def brief_lines(verdicts: Mapping[str, "Verdict"]) -> list[str]:
    """A line a fit: its label, and the checks that found something, by name."""
    width = max(map(len, verdicts))
    return [
        f"Verdict on {label:{width}}  {', '.join(finding.name for finding in verdict.findings) or 'nothing found'}"
        for label, verdict in verdicts.items()
    ]


def refuse_findings(verdict: "Verdict", label: str) -> None:
    """What --strict does: raise BadInput with the first finding where there is one, and the others' names."""
    if not verdict.trusted:
        first, *more = verdict.findings
        others = f" (and {', '.join(finding.name for finding in more)})" if more else ""
        raise BadInput(f"{label}: refused by --strict, {first.line()}{others}")
