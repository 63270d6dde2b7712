"""What a fit does wrong: light at the wrong place, none where there should be some, a system that was not solved."""

import math
from collections.abc import Iterator

from homofact.errors import Status
from homofact.evaluate.verdict.finding import About, Finding, Grade
from homofact.evaluate.verdict.verdict import Verdict
from homofact.methods.fitting import Method

LARGEST_CONDITION = 1e12
OFF = 0.05  # light over the source's: from here on it is named
LEAST_EXPLAINED = 0.9
MISPLACED = 0.25
LEAST_ACROSS = 0.5  # texels that the half width of a highlight takes
LARGEST_CUT = 0.01
LARGEST_ASYMMETRY = 0.05
LARGEST_ALBEDO = 1.02
LARGEST_STEP = 1.5  # of the albedo from one angle to the next, away from grazing
WORTH_NAMING = 0.01  # a source's own floor, relative RMS


def faults_of_the_fit(verdict: Verdict, settings: Method) -> Iterator[Finding]:
    """The findings about a fit by `settings`, from its figures."""
    if verdict.status in (Status.INTERRUPTED, Status.FALLBACK):
        ended = f"the fit ended with status {verdict.status.value}"
        yield _finding("status", None, ended, verdict.status.remedy, least=Grade.VISIBLE)
    if verdict.condition is not None and not verdict.condition <= LARGEST_CONDITION:
        yield _finding(
            "condition",
            None,
            f"the system's condition number is {verdict.condition:.1e}, expected at most {LARGEST_CONDITION:.0e}",
            "more smoothing, fewer textures or more samples",
            "--smoothing 1e-3",
            Grade.VISIBLE,
        )
    yield from _light(verdict, settings)
    whose = "held-out" if verdict.source_albedo is None else "source's"
    if not verdict.explained >= LEAST_EXPLAINED or not verdict.misplaced <= MISPLACED:
        yield _finding(
            "explained",
            verdict.misplaced,
            f"{max(verdict.explained, 0):.0%} of the variation of the {whose} logarithms is explained, expected"
            f" {LEAST_EXPLAINED:.0%}; {verdict.misplaced:.0%} of the held-out light is misplaced, expected"
            f" {MISPLACED:.0%}{floor_of(verdict)}",
            "more textures or texels, another method; or data that contradict themselves",
            _more_textures(settings),
            Grade.SLIGHT if verdict.explained >= LEAST_EXPLAINED else Grade.VISIBLE,
        )
    if verdict.cut > LARGEST_CUT:
        yield _finding(
            "positivity",
            verdict.cut,
            f"{verdict.cut:.0%} of the held-out light is cut at zero, expected {LARGEST_CUT:.0%}",
            "a larger epsilon, or more terms",
        )
    measured = verdict.source_albedo if verdict.source_albedo is not None else 1.0
    if verdict.albedo > LARGEST_ALBEDO and measured <= LARGEST_ALBEDO:
        yield _finding(
            "energy",
            verdict.albedo - 1,
            f"the fit's directional albedo is {verdict.albedo:.3g} at some angle up to 88°, expected at most"
            f" {LARGEST_ALBEDO:g}",
            "check the measurement's units and its grazing angles (homofact info)",
        )
    if abs(math.log(verdict.step)) > math.log(LARGEST_STEP):
        yield _finding(
            "step",
            abs(verdict.step - 1),
            f"the fit's directional albedo at {verdict.step_where} is {verdict.step:.3g}, expected 1 within a factor of"
            f" {LARGEST_STEP:g}",
            "single samples that are wrong, or too few there: robust weights, more smoothing or more samples",
            "--robust",
        )
    own = verdict.data_reciprocity or 0
    # A search that decides by itself has asked samples that nobody else can tell more of.
    by_the_data = verdict.floor is None and getattr(settings, "reciprocal", False) is None
    if verdict.reciprocity > LARGEST_ASYMMETRY + own and not by_the_data:
        yield _finding(
            "reciprocity",
            verdict.reciprocity - own,
            f"{verdict.reciprocity:.0%} of the fit's light changes where light and viewer are swapped, of the data's"
            f" {own:.0%}",
            "a reciprocal fit, or a method that keeps it",
            "--reciprocal",
        )


def _light(verdict: Verdict, settings: Method) -> Iterator[Finding]:
    if verdict.off is not None and not abs(verdict.off - 1) <= OFF:
        yield _finding(
            "light",
            abs(verdict.off - 1),
            f"the fit reflects {verdict.off:.3g} of the source's light in {verdict.off_where}, expected 1 within"
            f" {OFF:.0%}",
            "more textures or texels",
            _larger(settings),
        )
    if verdict.highlight is not None and not abs(verdict.highlight - 1) <= OFF:
        yield _finding(
            "highlight",
            abs(verdict.highlight - 1),
            f"the brightest directions hold {verdict.highlight:.3g} of the source's light, expected 1 within {OFF:.0%}",
            "larger textures, samples within the highlight, less smoothing",
            _larger(settings),
        )
    if verdict.texels_across is not None and verdict.texels_across < LEAST_ACROSS:
        factor = LEAST_ACROSS / max(verdict.texels_across, 1e-6)
        size = math.ceil(settings.size * factor)
        wanted, options = f"textures {factor:.2g} times as wide hold it, or more --bytes", f"--size {size}"
        if verdict.texels_across < LEAST_ACROSS / 16:
            wanted, options = "no texture of a usual size holds it: draw it as a mirror beside the fit", ""
        yield _finding(
            "narrow",
            None if verdict.highlight is None else abs(verdict.highlight - 1),
            f"half of the highlight's height lies within {verdict.texels_across:.2g} texels of the finest texture,"
            f" expected {LEAST_ACROSS:g}",
            wanted,
            options,
        )


def floor_of(verdict: Verdict) -> str:
    """What the source's own lack of reciprocity leaves to a reciprocal fit, where it is worth a word."""
    if verdict.floor is None or not verdict.floor >= WORTH_NAMING:
        return ""
    return f" (no reciprocal fit comes nearer to this source than {verdict.floor:.0%} RMS)"


def _more_textures(settings: Method) -> str:
    """Nothing where the method has no such setting: McCool's fixed projections, a model without textures."""
    return f"--textures {vars(settings)['textures'] + 1}" if "textures" in vars(settings) else ""


def _larger(settings: Method) -> str:
    """Nothing where the method has no such setting."""
    return f"--size {2 * settings.size}" if "size" in vars(settings) else ""


def _finding(
    name: str, light: float | None, found: str, remedy: str, options: str = "", least: Grade = Grade.SLIGHT
) -> Finding:
    return Finding(name, About.FIT, light, found, remedy, options, least)
