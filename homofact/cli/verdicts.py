"""The verdict on a fit, as a person reads it."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from homofact.cli.flags import option
from homofact.errors import BadInput
from homofact.evaluation.wording import figure, findings_named

if TYPE_CHECKING:
    from homofact.evaluation.verdict.finding import Finding
    from homofact.evaluation.verdict.verdict import Verdict

USUAL = "usual"  # of --strict without a number
LEAST_LEFT_OUT = 0.01  # of the pictures: from here on it is said


def verdict_lines(verdict: "Verdict") -> list[str]:
    """The error bars in a sentence, a warning, the figures, then what was noted, and what to try where it is bad."""
    from homofact.evaluation.verdict.finding import About

    errors, system = verdict.figures.errors, verdict.figures.system
    figures = [f"explains {max(errors.explained, 0):.1%}", f"held out / training {figure(errors.gap)}"]
    if system.determined is not None:
        figures.append(f"{system.determined:.0%} of the texels determined by samples")
    if system.condition is not None:
        figures.append(f"condition {system.condition:.0e}")
    if verdict.look is not None and verdict.look.left_out >= LEAST_LEFT_OUT:
        figures.append(f"{verdict.look.left_out:.0%} of the pictures without samples, not searched for artefacts")
    figures += [f"albedo up to {figure(verdict.figures.light.albedo)}", f"misplaced light {errors.misplaced:.1%}"]
    lines = [f"Verdict: {verdict.summary}", f"  ({', '.join(figures)})"]
    for whose in About:
        found = verdict.about(whose)
        if found:
            lines += [f"{whose.title}:", *(f"  - {noted(each)}" for each in found)]
    if verdict.recommended:
        lines.append(f"Try next: the same command with {option(verdict.recommended)}")
    return lines


def brief_lines(verdicts: Mapping[str, "Verdict"]) -> list[str]:
    """One line per fit: its label, how far it may be off, and what widens its error bars, by name."""
    width = max(map(len, verdicts))
    return [
        f"Verdict on {f'{label}:':{width + 1}} {verdict.summary}"
        + findings_named([each.name for each in verdict.findings if each.costs])
        for label, verdict in verdicts.items()
    ]


def names_of(text: str) -> tuple[str, ...]:
    """The findings that --refuse names, joined by +."""
    return tuple(name.strip() for name in text.split("+")) if text else ()


def strictness(text: str) -> bool | float:
    """What --strict says: nothing, the usual threshold, or a probability. Raises BadInput for what is no number."""
    if text in ("", USUAL):
        return bool(text)
    try:
        return float(text)
    except ValueError:
        raise BadInput(where="strict", found=repr(text), expected="a probability from 0 to 1") from None


def noted(finding: "Finding") -> str:
    """A finding by name in a line, with the setting to try and what it costs."""
    advice = f" ({finding.advice})" if finding.advice else ""
    return f"{finding.name}: {finding.line()}{advice}" + (f"; {finding.costs}" if finding.costs else "")
