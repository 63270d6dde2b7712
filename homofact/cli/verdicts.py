"""The verdict on a fit, as lines of text."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from homofact.cli.flags import option
from homofact.errors import Advice, BadInput
from homofact.evaluation.wording import figure, findings_named, light_by_incidence

if TYPE_CHECKING:
    from homofact.evaluation.compare import ComparisonRow
    from homofact.evaluation.verdict.finding import Finding
    from homofact.evaluation.verdict.verdict import Verdict

USUAL = "usual"  # of --strict without a number
BULLET = "  - "  # before a finding
LEAST_LEFT_OUT = 0.01  # of the pictures: from here on it is said


def verdict_lines(row: "ComparisonRow") -> list[str]:
    """Return the lines of a verdict: error bars, warning and cause, findings, figures, and what to try next."""
    verdict = row.verdict
    return [
        verdict_line(verdict), *where_lines(verdict), *incidence_lines(verdict), *cause_lines(verdict),
        *finding_lines(verdict),
        figures_line(verdict), *advice_lines(row),
    ]  # fmt: skip


def verdict_line(verdict: "Verdict") -> str:
    """Return the error bars in a sentence, with a warning if there is one."""
    return f"Verdict: {verdict.summary}"


def where_lines(verdict: "Verdict") -> list[str]:
    """Return a line on the angles where the fit is good or bad, and one on extrapolated error bars.

    A line is missing if the fit has no error bars by angle, or if they are all alike.
    """
    bars = verdict.bars
    heads = {"Where": bars.by_angle_sentence(), "Extrapolated": bars.extrapolated_sentence()}
    return [f"{head}: {words}" for head, words in heads.items() if words]


def incidence_lines(verdict: "Verdict") -> list[str]:
    """Return a line with the light of the fit over its samples' light, by angle of incidence; empty if unknown."""
    light = light_by_incidence(verdict.figures.light.by_incidence)
    return [f"Light of the fit over that of its samples, by θi: {light}"] if light else []


def cause_lines(verdict: "Verdict") -> list[str]:
    """Return why the verdict warns, in a line; no line without a warning."""
    return [f"Why it warns: {verdict.cause}"] if verdict.cause else []


def finding_lines(verdict: "Verdict") -> list[str]:
    """Return the findings under a line that names what they are about."""
    from homofact.evaluation.verdict.finding import About

    lines = []
    for whose in About:
        found = verdict.about(whose)
        if found:
            lines += [f"{whose.title}:", *(f"{BULLET}{noted(each)}" for each in found)]
    return lines


def tilt_lines(verdict: "Verdict") -> list[str]:
    """Return a line on how to undo the tilt of the measurement; empty if no tilt was found."""
    undo = option(Advice("calibrate", "tilt"))
    tilted = any(each.name == "tilt" for each in verdict.findings)
    return [f"To undo the tilt of the sample, run the same command with {undo}"] if tilted else []


def advice_lines(row: "ComparisonRow") -> list[str]:
    """Return what to try after a fit that is not trusted, in a line; no line if no option is known to help."""
    from homofact.evaluation.verdict.next_steps import next_steps

    steps = next_steps(row.verdict, row.factorization, row.settings)
    if not steps:
        return []
    parts = [
        " ".join(map(option, step.settings)) + ("" if step.bytes is None else f" (about {step.bytes} bytes)")
        for step in steps
    ]
    compared = "; keep the fit with the smaller held-out error"
    return [f"Try next: the same command with {', or with '.join(parts)}{compared}"]


def figures_line(verdict: "Verdict") -> str:
    """Return the figures that the verdict was computed from."""
    from homofact.evaluation.bar.causes import gap_in_words

    errors, system = verdict.figures.errors, verdict.figures.system
    figures = [f"explains {max(errors.explained, 0):.1%}", gap_in_words(errors.gap, errors.is_held_out)]
    if system.determined is not None:
        figures.append(f"{system.determined:.0%} of the texels determined by samples")
    if system.condition is not None:
        figures.append(f"condition {system.condition:.0e}")
    if verdict.look is not None and verdict.look.left_out >= LEAST_LEFT_OUT:
        figures.append(
            f"{verdict.look.left_out:.0%} of the rendered pixels not checked for artefacts (no samples there)"
        )
    light = verdict.figures.light
    figures.append(
        f"brightest sample {figure(light.peak)} sr⁻¹ at {light.peak_where}, there the fit has {figure(light.peak_fit)}"
    )
    light_at = f"albedo up to {figure(light.albedo)} (at θi {light.albedo_at:g}°)"
    figures += [light_at, f"misplaced light {errors.misplaced:.1%}"]
    return f"Figures of the verdict: {', '.join(figures)}"


def brief_lines(verdicts: Mapping[str, "Verdict"]) -> list[str]:
    """Return one line per fit: its label, its error bars, and the names of findings that widen them."""
    return [
        f"Verdict on {label}: {verdict.summary}"
        + findings_named([each.name for each in verdict.findings if each.costs])
        for label, verdict in verdicts.items()
    ]


def names_of(text: str) -> tuple[str, ...]:
    """Return the findings that --refuse names, joined by +."""
    return tuple(name.strip() for name in text.split("+")) if text else ()


def strictness(text: str) -> bool | float:
    """Return the value of --strict: False if not given, True for the usual threshold, or a probability.

    Raises BadInput for any other text that is not a number.
    """
    if text in ("", USUAL):
        return bool(text)
    try:
        return float(text)
    except ValueError:
        raise BadInput(where="strict", found=repr(text), expected="a probability from 0 to 1") from None


def noted(finding: "Finding") -> str:
    """Return a line on a finding: its name, the setting to try, and how much it widens the error bars."""
    advice = f" ({finding.advice})" if finding.advice else ""
    return f"{finding.name}: {finding.line()}{advice}" + (f"; {finding.costs}" if finding.costs else "")
