"""Whether the verdict says what is wrong, on cases that none of its thresholds was set on.

Cases are drawn by a seeded generator: a material, what is done to its samples and how strongly, or which settings it is
fitted with (`verdict_cases.py`). What is true of each fit, and which faults nobody could know of, says the rule of
`verdict_truth.py`. The verdict warns where it has a finding that a picture shows, about fit, data or what was not
measured. Samples are given as a measurement is: nobody can ask their source. Cases of settings alone keep theirs.

Thresholds are set on the draws "tuning", "test" and "both", the last of materials and stressors of either and measured
in several ways; "fresh" is of others.

    python scripts/verdict/verdict_blind.py [--cases 120] [--draw fresh] [--seed 0] [--data FOLDER] [--out FILE.md]
"""

import math
import sys
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import torch

from homofact.brdf.samples import Samples
from homofact.brdf.sampling import Drawable, sample_model
from homofact.brdf.source import MEASURED_EPSILON, Source
from homofact.errors import BadInput, SolverFailure
from homofact.evaluation.compare import fit_and_measure
from homofact.evaluation.machine import machine
from homofact.evaluation.verdict.finding import About
from homofact.linear.normal import warm_up
from homofact.methods.method import Method
from homofact.stability.cells import NeverEvaluated

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import data_folder, finish, markdown, parser_of, progress
from scripts.verdict.verdict_cases import (
    FITTED,
    SETTINGS,
    STRESSORS,
    TEST,
    TUNING,
    UNTOUCHED,
    Stressor,
    fresh_material,
    of_a_half,
    on_rings,
)
from scripts.verdict.verdict_truth import BETWEEN, Truth, truth_of

COUNT = 6000
DRAWS = ("tuning", "test", "both", "fresh")
LAYOUTS = ("discs", "lobe", "rings")


@dataclass(frozen=True)
class Given:
    """What a case is made of: a stressor (None for none) or settings, numbered `choice`, and how it is measured."""

    name: str
    material: Drawable
    stressor: Stressor | None
    choice: int
    settings: tuple[Method, ...] = ()
    layout: str = "discs"


@dataclass(frozen=True)
class Case:
    """One fit: what it is of, what is true of it, and which findings a picture shows, by name; None where refused.

    `unknown` are the findings of any grade about what was not measured.
    """

    material: str
    stress: str
    truth: Truth
    warnings: tuple[str, ...] | None
    unknown: tuple[str, ...] = ()

    @property
    def warned(self) -> bool:
        """Whether the verdict, or a refusal, says that something is wrong."""
        return self.warnings is None or bool(self.warnings)


def measured(given: Given, seed: int) -> Samples:
    """The clean samples, without a word on how they were drawn."""
    if given.layout == "rings":
        return on_rings(given.material)
    return replace(sample_model(given.material, COUNT, given.layout, seed), provenance={})


def judged(given: Given, seed: int) -> Case:
    """One case."""
    what, method, of_values = "none", FITTED, None
    if given.settings:
        method = given.settings[given.choice % len(given.settings)]
        smoothing = getattr(method, "smoothing", None)
        what = f"{method.name} {getattr(method, 'textures', 2)} × {method.size}²"
        what += (
            f", smoothing {smoothing:g}" if smoothing not in (None, getattr(type(method)(), "smoothing", None)) else ""
        )
        samples = sample_model(given.material, COUNT, "lobe", seed)
        source = Source(given.name, "material", samples, given.material, 1e-5, 0.0)
    else:
        samples = measured(given, seed)
        if given.stressor is not None:
            strength = given.stressor.strengths[given.choice % len(given.stressor.strengths)]
            what = f"{given.stressor.name} {strength:g}"
            of_values = given.stressor.another and given.stressor.another(samples, strength)
            samples = given.stressor.stress(samples, strength, torch.Generator().manual_seed(seed))
        what += "" if given.layout == "discs" else f", {given.layout}"
        source = Source(given.name, "measurement", samples, NeverEvaluated(samples.channels), MEASURED_EPSILON, 0.0)
    try:
        row = fit_and_measure(source, replace(method, epsilon=source.default_epsilon))
    except (BadInput, SolverFailure):
        return Case(given.name, what, Truth(math.nan, math.nan, math.nan), None)
    train = row.split.parts(source)[0]
    truth = truth_of(row.factorization, given.material, train, of_values, seed)
    findings = row.verdict.findings
    warnings = tuple(each.name for each in findings if each.matters)
    return Case(given.name, what, truth, warnings, tuple(f.name for f in findings if f.about is About.UNKNOWN))


def drawn(draw: str, cases: int, seed: int, folder: Path) -> Iterable[Case]:
    """The cases of a draw."""
    generator = torch.Generator().manual_seed(20261122 + seed)

    def pick(count: int) -> int:
        return int(torch.randint(count, (1,), generator=generator))

    for number in range(cases):
        given = _halved(draw, folder, pick) if draw in ("tuning", "test") else _mixed(draw, folder, pick)
        case = judged(given, 1000 * seed + number)
        said = "refused" if case.warnings is None else "+".join(case.warnings) or "nothing"
        words = "{}, {}: albedo {}, explained {}, highlight {}".format(*_figures(case))
        grade = "bad" if case.truth.plainly_bad else "highlight" if case.truth.bad else "good"
        progress(f"{words}, {grade} ({case.truth.unknowable}): {said}")
        yield case


def _halved(half: str, folder: Path, pick: Callable[[int], int]) -> Given:
    """A third without stress, all at pairs drawn in the discs."""
    name, material = of_a_half(half, folder, pick)
    stressors = STRESSORS[half]
    stressor = None if pick(3) == 0 else stressors[pick(len(stressors))]
    return Given(name, material, stressor, pick(60), () if stressor else SETTINGS[half])


def _mixed(draw: str, folder: Path, pick: Callable[[int], int]) -> Given:
    """A quarter of settings, a quarter without stress, measured in one of `LAYOUTS`."""
    if draw == "fresh":
        name, material = fresh_material(folder, pick)
        stressors, settings = STRESSORS[draw], SETTINGS[draw]
    else:
        name, material = of_a_half(("tuning", "test")[pick(2)], folder, pick)
        while name in UNTOUCHED:
            name, material = of_a_half(("tuning", "test")[pick(2)], folder, pick)
        stressors, settings = (*TUNING, *TEST), (*SETTINGS["tuning"], *SETTINGS["test"])
    kind, layout, choice = pick(4), LAYOUTS[pick(3)], pick(60)
    if kind == 0:
        return Given(name, material, None, choice, settings)
    stressor = None if kind == 1 else stressors[pick(len(stressors))]
    return Given(name, material, stressor, choice, layout=layout if material.isotropic else "discs")


def tables(cases: list[Case]) -> str:
    """The confusion of warnings with the truth, each check's fires, and the silent ones."""
    found = [case for case in cases if case.warnings is not None]
    lines = [_line("bad, all, no rule applied", found, lambda t: t.plainly_bad)]
    lines += [
        _line("bad, can be known", found, lambda t: t.plainly_bad and not t.plainly_unknowable),
        _line("good", found, lambda t: not t.plainly_bad, good=True),
        _line("with the highlight: bad, all, no rule applied", found, lambda t: t.bad),
        _line("with the highlight: bad, can be known", found, lambda t: t.bad and not t.unknowable),
        _line("with the highlight: good", found, lambda t: not t.bad, good=True),
    ]
    unknowable = [case for case in found if case.truth.plainly_unknowable]
    reasons = Counter(case.truth.plainly_unknowable for case in unknowable)
    counted = []
    for why, count in sorted(reasons.items()):
        those = [case for case in unknowable if case.truth.plainly_unknowable == why]
        covered = sum(bool(case.unknown) for case in those) if BETWEEN in why else "–"
        counted.append((why, count, sum(case.warned for case in those), covered))
    fires: dict[bool, Counter[str]] = {True: Counter(), False: Counter()}
    for case in found:
        fires[case.truth.bad].update(case.warnings or ())
    names = sorted({*fires[True], *fires[False]}, key=lambda name: (-fires[True][name], name))
    shown = ("material", "stress", "albedo", "explained", "highlight")
    silent = [(*_figures(c), c.truth.unknowable or c.truth.plainly_unknowable) for c in found
              if c.truth.bad and not c.warned]  # fmt: skip
    loud = [(*_figures(c), " ".join(c.warnings or ())) for c in found if not c.truth.plainly_bad and c.warned]
    return "\n\n".join(
        [
            markdown(("truth", "fits", "warned", "silent", "rate of error"), lines),
            f"{len(cases) - len(found)} refused." if len(found) < len(cases) else "None was refused.",
            "Bad by the issue's truth and not to be known:",
            markdown(("why", "fits", "warned", "named as not measured"), counted),
            "Which check a picture shows the finding of (bad with the highlight):",
            markdown(("check", "of bad fits", "of good ones"), [(n, fires[True][n], fires[False][n]) for n in names]),
            "Bad with the highlight, and silent:",
            markdown((*shown, "cannot be known"), silent, 2),
            "Good by albedo and logarithms, and warned:",
            markdown((*shown, "findings"), loud, 2),
        ]
    )


def _line(name: str, cases: list[Case], which: Callable[[Truth], bool], good: bool = False) -> tuple[object, ...]:
    those = [case for case in cases if which(case.truth)]
    warned = sum(case.warned for case in those)
    wrong = warned if good else len(those) - warned
    return name, len(those), warned, len(those) - warned, f"{wrong / len(those):.1%}" if those else "–"


def _figures(case: Case) -> tuple[str, ...]:
    truth = case.truth
    return case.material, case.stress, *(f"{each:.2f}" for each in (truth.albedo, truth.explained, truth.highlight))


def main(arguments: list[str] | None = None) -> int:
    """Draw, fit, print the tables, and write them where it is asked for."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--cases", type=int, default=120, help="fits of a draw (%(default)s)")
    parser.add_argument("--draw", choices=DRAWS, default="fresh", help="which draw (%(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the draw of cases")
    options = parser.parse_args(arguments)
    warm_up()
    parts = [f"Draw {options.draw}, seed {options.seed}; {COUNT} pairs a material. {machine()}"]
    count = 2 if options.short else options.cases
    cases = list(drawn(options.draw, count, options.seed, data_folder(options.data)))
    return finish([*parts, f"## {len(cases)} fits", tables(cases)], options)


if __name__ == "__main__":
    sys.exit(main())
