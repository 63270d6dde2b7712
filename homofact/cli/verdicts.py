"""The verdict on a fit, as a person reads it."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from homofact.cli.flags import option
from homofact.evaluation.wording import figure, findings_named

if TYPE_CHECKING:
    from homofact.evaluation.verdict.finding import Finding
    from homofact.evaluation.verdict.verdict import Verdict

LEAST_LEFT_OUT = 0.01  # of the pictures: from here on it is said


def verdict_lines(verdict: "Verdict") -> list[str]:
    """The verdict in a sentence with its figures, then its findings by whose fault they are, then what to try."""
    from homofact.evaluation.verdict.finding import About

    figures = [f"explains {max(verdict.errors.explained, 0):.1%}", f"held out / training {figure(verdict.errors.gap)}"]
    if verdict.system.determined is not None:
        figures.append(f"{verdict.system.determined:.0%} of the texels determined by samples")
    if verdict.system.condition is not None:
        figures.append(f"condition {verdict.system.condition:.0e}")
    if verdict.look is not None and verdict.look.left_out >= LEAST_LEFT_OUT:
        figures.append(f"{verdict.look.left_out:.0%} of the pictures without samples, not searched for artefacts")
    figures += [f"albedo up to {figure(verdict.light.albedo)}", f"misplaced light {verdict.errors.misplaced:.1%}"]
    lines = [f"Verdict: {verdict.summary}", f"  ({', '.join(figures)})"]
    for whose in About:
        found = verdict.about(whose)
        if found:
            lines += [f"{whose.title}:", *(f"  - {_graded(each)}" for each in found)]
    if verdict.recommended:
        lines.append(f"Try next: the same command with {option(verdict.recommended)}")
    return lines


def brief_lines(verdicts: Mapping[str, "Verdict"]) -> list[str]:
    """A line a fit: its label, what it is good for, and the findings that a picture shows, by name."""
    width = max(map(len, verdicts))
    return [
        f"Verdict on {label:{width}}  {verdict.summary}"
        + findings_named([each.name for each in verdict.findings if each.matters])
        for label, verdict in verdicts.items()
    ]


def names_of(text: str) -> tuple[str, ...]:
    """The findings that --refuse names, joined by +."""
    return tuple(name.strip() for name in text.split("+")) if text else ()


def _graded(finding: "Finding") -> str:
    return f"{finding.grade.value}: {finding.line()}" + (f" ({finding.advice})" if finding.advice else "")
