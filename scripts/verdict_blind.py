"""Whether the verdict says what is wrong, on cases that none of its thresholds was set on.

Cases are drawn by a seeded generator: a material, what is done to its samples and how strongly, or which settings it is
fitted with. Materials and stressors are split in two: thresholds are set on cases of the tuning halves alone, the test
half combines materials and stressors of the other. The truth is the material without the stress: a fit is bad where its
albedo is off by more than `BAD_ALBEDO` at some angle in a channel, or it explains less than `LEAST_EXPLAINED` of the
variance of clean logarithms. The verdict warns where it has a finding that a picture shows, about fit, data or what was
not measured. Stressed samples are given as a measurement is: nobody can ask their source.

    python scripts/verdict_blind.py [--cases 120] [--half tuning|test] [--seed 0] [--data FOLDER] [--out FILE.md]
"""

import math
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from conditions import data_folder, markdown, parser_of, write
from torch import Tensor

from homofact.brdf.formats.nbrdf import material_names
from homofact.brdf.samples import Samples
from homofact.brdf.source import Source, open_source
from homofact.errors import BadInput, SolverFailure
from homofact.evaluate.compare import fit_and_measure
from homofact.evaluate.energy import energy_errors
from homofact.evaluate.machine import machine
from homofact.evaluate.stability.cells import Unasked
from homofact.geometry.directions import from_spherical, normalize, to_spherical
from homofact.linear.normal import warm_up
from homofact.methods.fitting import Method
from homofact.methods.mccool import McCool
from homofact.methods.search import Search

BAD_ALBEDO, LEAST_EXPLAINED = 0.15, 0.9
COUNT = 6000
MODELS = {
    "tuning": ("lafortune-blue-paint", "phong-10", "cook-torrance-plastic"),
    "test": ("blinn-phong-50", "torrance-sparrow-20", "lafortune-skin"),
}
RGL = {"tuning": ("aurora_white", "vch_golden_yellow"), "test": ("chm_light_blue", "irid_flake_paint1")}

Stress = Callable[[Samples, float, torch.Generator], Samples]


@dataclass(frozen=True)
class Stressor:
    """What is done to samples, its strengths, and why a verdict cannot know of it, where it cannot."""

    name: str
    strengths: tuple[float, ...]
    stress: Stress
    unknowable: str = ""


def _values(change: Callable[[Samples, Tensor, float, torch.Generator], Tensor]) -> Stress:
    def stress(samples: Samples, strength: float, generator: torch.Generator) -> Samples:
        return replace(samples, values=change(samples, samples.values, strength, generator).clamp_min(0))

    return stress


def _normal(like: Tensor, generator: torch.Generator) -> Tensor:
    return torch.randn(like.shape, dtype=torch.float64, generator=generator)


def _struck(samples: Samples, share: float, generator: torch.Generator) -> Tensor:
    return torch.rand(len(samples), dtype=torch.float64, generator=generator)[:, None] < share


def _hole(samples: Samples, strength: float, generator: torch.Generator) -> Samples:
    degrees = torch.rad2deg(to_spherical(samples.wo)[0])
    return samples.select((degrees - 40).abs() >= strength)


def _no_highlight(samples: Samples, strength: float, generator: torch.Generator) -> Samples:
    degrees = torch.rad2deg(to_spherical(normalize(samples.wi + samples.wo))[0])
    return samples.select(degrees >= strength)


def _few(samples: Samples, strength: float, generator: torch.Generator) -> Samples:
    return samples.subset(int(strength), 0)


def _not_grazing(samples: Samples, strength: float, generator: torch.Generator) -> Samples:
    limit = math.cos(math.radians(strength))
    return samples.select((samples.wi[:, 2] > limit) & (samples.wo[:, 2] > limit))


def _tilted(samples: Samples, strength: float, generator: torch.Generator) -> Samples:
    angle = math.radians(strength)
    turn = torch.tensor(
        [[math.cos(angle), 0, math.sin(angle)], [0, 1, 0], [-math.sin(angle), 0, math.cos(angle)]], dtype=torch.float64
    )
    wi, wo = samples.wi @ turn.T, samples.wo @ turn.T
    above = (wi[:, 2] > 0.02) & (wo[:, 2] > 0.02)
    return replace(samples.select(above), wi=wi[above], wo=wo[above])


def _elevation(samples: Samples, strength: float, generator: torch.Generator) -> Samples:
    def turned(w: Tensor) -> Tensor:
        theta, phi = to_spherical(w)
        return from_spherical(math.pi / 2 - theta, phi)

    wi, wo = turned(samples.wi), turned(samples.wo)
    above = (wi[:, 2] > 0.02) & (wo[:, 2] > 0.02)
    return replace(samples.select(above), wi=wi[above], wo=wo[above])


def _again(samples: Samples, strength: float, generator: torch.Generator) -> Samples:
    """Half of the samples once more, `strength` times as bright."""
    half = samples.subset(len(samples) // 2, 0)
    parts = (samples, replace(half, values=half.values * strength))
    joined = {name: torch.cat([getattr(each, name) for each in parts]) for name in ("wi", "wo", "values", "weights")}
    return replace(samples, **joined)


TUNING = (
    Stressor("noise", (0.03, 0.2, 0.6), _values(lambda s, v, x, g: v * torch.exp(x * _normal(v, g)))),
    Stressor("outliers", (0.002, 0.02), _values(lambda s, v, x, g: torch.where(_struck(s, x, g), 300 * v, v))),
    Stressor("zeros", (0.005, 0.05, 0.3), _values(lambda s, v, x, g: v * ~_struck(s, x, g))),
    Stressor("hole", (5.0, 15.0, 30.0), _hole),
    Stressor("few", (2000.0, 300.0, 60.0), _few),
    Stressor("cosine", (1.0, 2.0), _values(lambda s, v, x, g: v * s.wo[:, 2:] ** x)),
    Stressor("gamma", (2.2,), _values(lambda s, v, x, g: (v / v.max()) ** (1 / x))),
    Stressor("drift", (0.2, 0.8), _values(lambda s, v, x, g: v * torch.linspace(1, 1 - x, len(v))[:, None])),
    Stressor("clipped", (0.999, 0.98), _values(lambda s, v, x, g: v.minimum(v.quantile(x, 0)))),
    Stressor(
        "scaled", (0.5, 1.5), _values(lambda s, v, x, g: v * x),
        "the albedo stays within 1, and nothing else knows the scale",
    ),
)  # fmt: skip
TEST = (
    Stressor("additive", (0.002, 0.05, 0.5), _values(lambda s, v, x, g: v + x * v.mean(0) * _normal(v, g))),
    Stressor("no highlight", (3.0, 15.0, 30.0), _no_highlight),
    Stressor("not grazing", (80.0, 65.0, 50.0), _not_grazing),
    Stressor("repeated", (1.0, 1.5, 4.0), _again),
    Stressor("tilted", (0.3, 3.0, 10.0), _tilted),
    Stressor("elevation", (1.0,), _elevation),
    Stressor("π", (math.pi,), _values(lambda s, v, x, g: v * x)),
    Stressor("offset", (0.01, 0.2), _values(lambda s, v, x, g: v + x * v.mean(0))),
    Stressor("dark frame", (0.05, 0.3), _values(lambda s, v, x, g: v - x * v.mean(0))),
    Stressor("levels", (4096.0, 64.0), _values(lambda s, v, x, g: (v / v.max() * x).round() / x * v.max())),
    Stressor(
        "channels swapped", (1.0,), _values(lambda s, v, x, g: v.flip(1)), "another colour is as good a material",
    ),
)  # fmt: skip
SETTINGS: dict[str, tuple[Method, ...]] = {
    "tuning": (
        Search(textures=2, size=16, effort="quick"),
        Search(textures=1, size=8, effort="quick"),
        McCool(size=16),
    ),
    "test": (
        Search(textures=2, size=12, effort="quick"),
        Search(textures=2, size=4, effort="quick"),
        McCool(size=10, projections=("theta_h-theta_d", "theta_d-phi_d")),
    ),
}
FITTED = Search(textures=2, size=12, effort="quick")


@dataclass(frozen=True)
class Case:
    """One fit: what it is of, whether it is bad, and which findings a picture shows, by name; None where refused."""

    material: str
    stress: str
    albedo: float
    explained: float
    warnings: tuple[str, ...] | None
    unknowable: bool

    @property
    def bad(self) -> bool:
        """By the truth of the module's head."""
        return abs(self.albedo - 1) > BAD_ALBEDO or self.explained < LEAST_EXPLAINED

    @property
    def warned(self) -> bool:
        """Whether the verdict, or a refusal, says so."""
        return self.warnings is None or bool(self.warnings)


def materials(half: str, folder: Path) -> list[tuple[str, str]]:
    """(name, source) of a half: models, and what is there of paints and surrogates (even numbers tune)."""
    found = [(name, f"material:{name}") for name in MODELS[half]]
    found += [(name, str(folder / "rgl" / f"{name}_rgb.bsdf")) for name in RGL[half]]
    networks = folder / "nbrdf" / "merl_nbrdf_weights.npz"
    if networks.is_file():
        names = material_names(networks)[("tuning", "test").index(half) :: 2]
        found += [(name, f"{networks}#{name}") for name in names]
    return [(name, path) for name, path in found if path.startswith("material:") or Path(path.split("#")[0]).is_file()]


def judged(name: str, path: str, stressor: Stressor | None, choice: int, half: str, seed: int) -> Case:
    """One case: strength or setting number `choice` (counted round)."""
    clean = open_source(path, count=COUNT, scheme="discs" if stressor else "lobe", seed=seed)
    what, method, source = "none", FITTED, clean
    if stressor is None:
        method = SETTINGS[half][choice % len(SETTINGS[half])]
        what = f"{method.name} {getattr(method, 'textures', 2)} × {method.size}²"
    else:
        strength = stressor.strengths[choice % len(stressor.strengths)]
        what = f"{stressor.name} {strength:g}"
        bare = replace(clean.samples, provenance={})
        samples = stressor.stress(bare, strength, torch.Generator().manual_seed(seed))
        source = Source(name, "measurement", samples, Unasked(samples.channels), 1e-2, 0.0)
    try:
        row = fit_and_measure(source, replace(method, epsilon=source.default_epsilon))
    except (BadInput, SolverFailure):
        return Case(name, what, math.nan, math.nan, None, bool(stressor and stressor.unknowable))
    fit = row.factorization
    energy = energy_errors(fit, clean.reflectance, clean.samples.isotropic)
    other = open_source(path, count=2000, scheme="discs", seed=seed + 1).samples
    logs = [fit.transform.forward(v) for v in (other.values, fit.evaluate(other.wi, other.wo))]
    missed = (logs[1] - logs[0]).square().sum(0) / (logs[0] - logs[0].mean(0)).square().sum(0).clamp_min(1e-6 * 2000)
    warnings = tuple(each.name for each in row.verdict.findings if each.matters)
    unknowable = bool(stressor and stressor.unknowable)
    return Case(name, what, energy.albedo_worst, 1 - float(missed.max()), warnings, unknowable)


def drawn(half: str, cases: int, seed: int, folder: Path) -> list[Case]:
    """The cases of a half, a third of them without stress."""
    generator = torch.Generator().manual_seed(20261122 + seed)
    among, stressors = materials(half, folder), TUNING if half == "tuning" else TEST

    def pick(count: int) -> int:
        return int(torch.randint(count, (1,), generator=generator))

    found = []
    for number in range(cases):
        name, path = among[pick(len(among))]
        stressor = None if pick(3) == 0 else stressors[pick(len(stressors))]
        found.append(judged(name, path, stressor, pick(60), half, 1000 * seed + number))
        last = found[-1]
        said = "refused" if last.warnings is None else "+".join(last.warnings) or "nothing"
        words = f"{last.material}, {last.stress}: albedo {last.albedo:.2f}, explained {last.explained:.2f}"
        print(f"{words}, {'bad' if last.bad else 'good'}, {said}", file=sys.stderr, flush=True)
    return found


def tables(cases: list[Case]) -> str:
    """The confusion of warnings with the truth, each check's fires, and the silent ones."""
    lines = []
    for words, of in (("where it can be known", False), ("where it cannot", True)):
        for truth, bad in (("bad", True), ("good", False)):
            those = [
                case for case in cases if case.unknowable is of and case.bad is bad and not math.isnan(case.albedo)
            ]
            warned = sum(case.warned for case in those)
            share = f"{(len(those) - warned if bad else warned) / len(those):.0%}" if those else "–"
            lines.append((f"{truth}, {words}", len(those), warned, len(those) - warned, share))
    refused = sum(case.warnings is None for case in cases)
    lines.append(("refused", refused, refused, 0, "–"))
    header = ("truth", "fits", "warned", "silent", "silent of bad, warned of good")
    fires: dict[bool, Counter[str]] = {True: Counter(), False: Counter()}
    for case in cases:
        fires[case.bad].update(case.warnings or ())
    names = sorted({*fires[True], *fires[False]}, key=lambda name: -fires[True][name])
    counted = [(name, fires[True][name], fires[False][name]) for name in names]
    quiet = [case for case in cases if case.bad and not case.warned]
    silent = [
        (case.material, case.stress, f"{case.albedo:.2f}", f"{case.explained:.2f}", "yes" if case.unknowable else "")
        for case in quiet
    ]
    loud = [(c.material, c.stress, f"{c.albedo:.2f}", f"{c.explained:.2f}", " ".join(c.warnings or ())) for c in cases
            if not c.bad and c.warned and not math.isnan(c.albedo)]  # fmt: skip
    return "\n\n".join(
        [
            markdown(header, lines),
            markdown(("check", "of bad fits", "of good ones"), counted),
            "Bad and silent:",
            markdown(("material", "stress", "albedo", "explained", "cannot be known"), silent, 2),
            "Good and warned:",
            markdown(("material", "stress", "albedo", "explained", "findings"), loud, 2),
        ]
    )


def main(arguments: list[str] | None = None) -> int:
    """Draw, fit, print the tables, and write them where it is asked for."""
    parser = parser_of(__doc__)
    parser.add_argument("--cases", type=int, default=120, help="fits of each half (%(default)s)")
    parser.add_argument("--half", choices=("tuning", "test"), help="this half alone")
    parser.add_argument("--seed", type=int, default=0, help="of the draw of cases")
    parser.add_argument("--data", type=Path, help="the folder of real measurements")
    parser.add_argument("--out", type=Path, help="a Markdown file of the tables")
    options = parser.parse_args(arguments)
    warm_up()
    halves = ("tuning", "test") if options.half is None else (options.half,)
    parts = [f"Seed {options.seed}; {COUNT} pairs a material. {machine()}"]
    if options.short:
        parts.append("a smoke test: the figures mean nothing")
    for half in halves:
        cases = drawn(half, 2 if options.short else options.cases, options.seed, data_folder(options.data))
        parts += [f"## The {half} half, {len(cases)} fits", tables(cases)]
    text = "\n\n".join(parts) + "\n"
    print(text)
    if options.out:
        write(options.out, text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
