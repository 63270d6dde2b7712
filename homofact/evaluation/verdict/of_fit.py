"""What a fit does wrong: light at the wrong place, none where there should be some, a system that was not solved."""

import math
from collections.abc import Iterator

from homofact.errors import Advice, Status
from homofact.evaluation.verdict.finding import About, Finding, Grade
from homofact.evaluation.verdict.verdict import LightFigures, Verdict
from homofact.methods.method import Method

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
    yield from _solver(verdict)
    yield from _artefacts(verdict, settings)
    yield from _light(verdict.light, settings)
    yield from _explained(verdict, settings)
    yield from _energy(verdict.light)
    yield from _symmetry(verdict.light, settings)


def _solver(verdict: Verdict) -> Iterator[Finding]:
    """How the fit ended, and the linear system that it solved."""
    condition = verdict.system.condition
    if verdict.status in (Status.INTERRUPTED, Status.FALLBACK):
        ended = f"the fit ended with status {verdict.status.value}"
        yield _finding("status", None, ended, verdict.status.remedy, least=Grade.VISIBLE)
    if condition is not None and not condition <= LARGEST_CONDITION:
        yield _finding(
            "condition",
            None,
            f"the system's condition number is {condition:.1e}, expected at most {LARGEST_CONDITION:.0e}",
            "more smoothing, fewer textures or more samples",
            Advice("smoothing", 1e-3),
            Grade.VISIBLE,
        )


def _artefacts(verdict: Verdict, settings: Method) -> Iterator[Finding]:
    """Structure that pictures of the fit show and those of its source do not."""
    for artefact in () if verdict.look is None else verdict.look.artefacts:
        yield _finding(
            "artefact",
            None,
            f"{artefact.words}, which the source does not have",
            "larger textures or more of them, other projections",
            _larger(settings),
            Grade.VISIBLE,
        )


def _explained(verdict: Verdict, settings: Method) -> Iterator[Finding]:
    """What of the logarithms and of the light the fit misses."""
    errors, light = verdict.errors, verdict.light
    whose = "held-out" if light.source_albedo is None else "source's"
    if not errors.explained >= LEAST_EXPLAINED or not errors.misplaced <= MISPLACED:
        yield _finding(
            "explained",
            errors.misplaced,
            f"{max(errors.explained, 0):.0%} of the variation of the {whose} logarithms is explained, expected"
            f" {LEAST_EXPLAINED:.0%}; {errors.misplaced:.0%} of the held-out light is misplaced, expected"
            f" {MISPLACED:.0%}{floor_of(light)}",
            "more textures or texels, another method; or data that contradict themselves",
            _more_textures(settings),
            Grade.SLIGHT if errors.explained >= LEAST_EXPLAINED else Grade.VISIBLE,
        )
    if errors.cut > LARGEST_CUT:
        yield _finding(
            "positivity",
            errors.cut,
            f"{errors.cut:.0%} of the held-out light is cut at zero, expected {LARGEST_CUT:.0%}",
            "a larger epsilon, or more terms",
        )


def _energy(light: LightFigures) -> Iterator[Finding]:
    """More light than comes in, and albedos that jump."""
    measured = light.source_albedo if light.source_albedo is not None else 1.0
    if light.albedo > LARGEST_ALBEDO and measured <= LARGEST_ALBEDO:
        yield _finding(
            "energy",
            light.albedo - 1,
            f"the fit's directional albedo is {light.albedo:.3g} at some angle up to 88°, expected at most"
            f" {LARGEST_ALBEDO:g}",
            "check the measurement's units and its grazing angles (homofact info)",
        )
    if abs(math.log(light.step)) > math.log(LARGEST_STEP):
        yield _finding(
            "step",
            abs(light.step - 1),
            f"the fit's directional albedo at {light.step_where} is {light.step:.3g}, expected 1 within a factor of"
            f" {LARGEST_STEP:g}",
            "single samples that are wrong, or too few there: robust weights, more smoothing or more samples",
            Advice("robust", True),
        )


def _symmetry(light: LightFigures, settings: Method) -> Iterator[Finding]:
    """Light that changes where light and viewer are swapped."""
    own = light.data_reciprocity or 0
    # A search that decides by itself has asked samples that nobody else can tell more of.
    by_the_data = light.floor is None and getattr(settings, "reciprocal", False) is None
    if light.reciprocity > LARGEST_ASYMMETRY + own and not by_the_data:
        yield _finding(
            "reciprocity",
            light.reciprocity - own,
            f"{light.reciprocity:.0%} of the fit's light changes where light and viewer are swapped, of the data's"
            f" {own:.0%}",
            "a reciprocal fit, or a method that keeps it",
            Advice("reciprocal", True),
        )


def _light(light: LightFigures, settings: Method) -> Iterator[Finding]:
    """Light in the wrong place, or none where there should be some."""
    if light.off is not None and not abs(light.off - 1) <= OFF:
        yield _finding(
            "light",
            abs(light.off - 1),
            f"the fit reflects {light.off:.3g} of the source's light in {light.off_where}, expected 1 within {OFF:.0%}",
            "more textures or texels",
            _larger(settings),
        )
    if light.highlight is not None and not abs(light.highlight - 1) <= OFF:
        yield _finding(
            "highlight",
            abs(light.highlight - 1),
            f"the brightest directions hold {light.highlight:.3g} of the source's light, expected 1 within {OFF:.0%}"
            f" (those of the brightest {light.highlight_share:.0%} of it)",
            "larger textures, samples within the highlight, less smoothing",
            _larger(settings),
        )
    if light.texels_across is not None and light.texels_across < LEAST_ACROSS:
        factor = LEAST_ACROSS / max(light.texels_across, 1e-6)
        size = math.ceil(settings.size * factor)
        wanted = f"textures {factor:.2g} times as wide hold it, or more bytes"
        advice: Advice | None = Advice("size", size)
        if light.texels_across < LEAST_ACROSS / 16:
            wanted, advice = "no texture of a usual size holds it: draw it as a mirror beside the fit", None
        yield _finding(
            "narrow",
            None if light.highlight is None else abs(light.highlight - 1),
            f"half of the highlight's height lies within {light.texels_across:.2g} texels of the finest texture,"
            f" expected {LEAST_ACROSS:g}",
            wanted,
            advice,
        )


def floor_of(light: LightFigures) -> str:
    """What the source's own lack of reciprocity leaves to a reciprocal fit, where it is worth a word."""
    if light.floor is None or not light.floor >= WORTH_NAMING:
        return ""
    return f" (no reciprocal fit comes nearer to this source than {light.floor:.0%} RMS of f cosθi cosθo)"


def _more_textures(settings: Method) -> Advice | None:
    """Nothing where the method has no such setting: McCool's fixed projections, a model without textures."""
    return Advice("textures", vars(settings)["textures"] + 1) if "textures" in vars(settings) else None


def _larger(settings: Method) -> Advice | None:
    """Nothing where the method has no such setting."""
    return Advice("size", 2 * settings.size) if "size" in vars(settings) else None


def _finding(
    name: str, light: float | None, found: str, remedy: str, advice: Advice | None = None, least: Grade = Grade.SLIGHT
) -> Finding:
    return Finding(name, About.FIT, light, found, remedy, advice, least)
