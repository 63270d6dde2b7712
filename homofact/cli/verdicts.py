"""The verdict on a fit, as a person reads it, and what --strict and --refuse make of it."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from homofact.errors import BadInput
from homofact.evaluate.wording import figure, findings_named

if TYPE_CHECKING:
    from homofact.evaluate.verdict.finding import Finding
    from homofact.evaluate.verdict.verdict import Verdict


def verdict_lines(verdict: "Verdict") -> list[str]:
    """The verdict in a sentence with its figures, then its findings by whose fault they are, then what to try."""
    from homofact.evaluate.verdict.finding import About

    figures = [f"explains {max(verdict.explained, 0):.1%}", f"held out / training {figure(verdict.gap)}"]
    if verdict.determined is not None:
        figures.append(f"{verdict.determined:.0%} of the texels determined by samples")
    if verdict.condition is not None:
        figures.append(f"condition {verdict.condition:.0e}")
    figures += [f"albedo up to {figure(verdict.albedo)}", f"misplaced light {verdict.misplaced:.1%}"]
    lines = [f"Verdict: {verdict.summary}", f"  ({', '.join(figures)})"]
    for whose in About:
        found = verdict.about(whose)
        if found:
            lines += [f"{whose.title}:", *(f"  - {_graded(each)}" for each in found)]
    if verdict.recommended:
        lines.append(f"Try next: the same command with {verdict.recommended}")
    return lines


def brief_lines(verdicts: Mapping[str, "Verdict"]) -> list[str]:
    """A line a fit: its label, what it is good for, and the findings that a picture shows, by name."""
    width = max(map(len, verdicts))
    return [
        f"Verdict on {label:{width}}  {verdict.summary}"
        + findings_named([each.name for each in verdict.findings if each.matters])
        for label, verdict in verdicts.items()
    ]


def refused_names(text: str) -> tuple[str, ...]:
    """The findings that --refuse names, joined by +. Raises BadInput that lists them for one that there is not."""
    if not text:
        return ()
    from homofact.brdf.suspicion.suspects import NAMES as SUSPECTED
    from homofact.evaluate.verdict.finding import NAMES

    names = tuple(each.strip() for each in text.split("+"))
    known = tuple(dict.fromkeys((*NAMES, *SUSPECTED)))
    unknown = [each for each in names if each not in known]
    if unknown:
        raise BadInput(f"--refuse: found {unknown[0]!r}, expected some of {', '.join(known)}, joined by +")
    return names


def refuse_findings(verdict: "Verdict", label: str, strict: bool, names: Sequence[str] = ()) -> None:
    """What --strict and --refuse do: raise BadInput with the first finding that they refuse, and the others' names.

    `strict` refuses what is wrong with the fit and shows in a picture, `names` these findings whatever they are about.
    """
    from homofact.evaluate.verdict.finding import About

    refused = [
        each for each in verdict.findings if (strict and each.about is About.FIT and each.matters) or each.name in names
    ]
    if refused:
        first, *more = refused
        others = f" (and {', '.join(finding.name for finding in more)})" if more else ""
        option = "--refuse" if first.name in names else "--strict"
        raise BadInput(f"{label}: refused by {option}, {first.line()}{others}")


def _graded(finding: "Finding") -> str:
    return f"{finding.grade.value}: {finding.line()}" + (f" ({finding.options})" if finding.options else "")
