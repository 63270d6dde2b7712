"""Check whether more textures or more texels make a default fit worse on samples that were not fitted.

Each material is fitted with 1, 2, 3 … textures of 16², and with 2 textures of 8², 16² and 32². A fifth of the samples
is held out. The Cole error is that of the held-out samples (of other pairs drawn in the discs where the source can be
asked anywhere), the RMS is relative to the source and weighted by cosθi cosθo (over both hemispheres where it can be
asked, `evaluation.energy`, else over the held-out samples). The ratio is to the best with fewer textures or texels;
more than 1.02 is a violation.

    python scripts/accuracy/more_is_never_worse.py [--counts 1 2 3 5] [--only NAME ...] [--effort normal]
"""

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from homofact.brdf.scattered import made_of_samples
from homofact.brdf.source import Source, open_source
from homofact.evaluation.energy import SourceLight
from homofact.evaluation.machine import machine
from homofact.evaluation.metrics import measure
from homofact.linear.normal import warm_up
from homofact.methods.search import Search

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.accuracy.left_out_rings import relative_rms
from scripts.shared.harness import data_folder, figure, finish, markdown, parser_of, progress

MATERIALS = {
    "lafortune-blue-paint": "material:lafortune-blue-paint",
    "vch_golden_yellow": "rgl/vch_golden_yellow_rgb.bsdf",
    "irid_flake_paint1": "rgl/irid_flake_paint1_rgb.bsdf",
    "gold-metallic-paint": "nbrdf/merl_nbrdf_weights.npz#gold-metallic-paint",
    "alum-bronze": "nbrdf/merl_nbrdf_weights.npz#alum-bronze",
    "pink-plastic": "nbrdf/merl_nbrdf_weights.npz#pink-plastic",
    "garnet_red": "cornell/garnet_red.brdf",
}
SIZE, SIZES = 16, (8, 16, 32)
ALLOWED = 1.02


@dataclass(frozen=True)
class Fitted:
    """One fit: textures asked for and taken, texels a side, held-out errors, processor seconds."""

    textures: int
    taken: int
    size: int
    cole: float
    rms: float
    seconds: float


@dataclass(frozen=True)
class Judge:
    """What fits of one source are held against."""

    source: Source
    light: SourceLight | None
    path: str

    @classmethod
    def of(cls, path: str, source: Source) -> "Judge":
        """The judge of one source."""
        asked = not made_of_samples(source.reflectance)
        light = SourceLight.of(source.reflectance, source.samples.isotropic) if asked else None
        return cls(source, light, path)

    def fitted(self, textures: int, size: int, effort: str | float, count: int) -> Fitted:
        """A default fit, and its errors."""
        train, held = self.source.samples.split(0.2, 0)
        method = Search(textures=textures, size=size, effort=effort, epsilon=self.source.default_epsilon)
        began = time.process_time()
        fit = method.fit(train).factorization
        seconds = time.process_time() - began
        if self.light is None:
            test = held.rotated_at_random(0)
            rms = relative_rms(fit.evaluate(test.wi, test.wo), test)
        else:
            test = open_source(self.path, count=count, scheme="discs", seed=7).samples.rotated_at_random(0)
            rms = self.light.errors(fit).rms
        cole = measure(fit, test, fit.transform).log_mse
        return Fitted(textures, len(fit.terms), size, cole, rms, seconds)


def against_fewer(fits: Sequence[Fitted]) -> list[tuple[float, float]]:
    """(Cole error, RMS) of each over the best before it; 1 for the first."""
    ratios = [(1.0, 1.0)]
    for number in range(1, len(fits)):
        before = fits[:number]
        own = fits[number]
        ratios.append((own.cole / min(f.cole for f in before), own.rms / min(f.rms for f in before)))
    return ratios


def rows_of(name: str, what: str, fits: Sequence[Fitted]) -> tuple[list[tuple[str, ...]], list[str]]:
    """(the lines of the table, violations in words)."""
    lines, violations = [], []
    for fit, ratios in zip(fits, against_fewer(fits), strict=True):
        textures = str(fit.textures) if fit.taken == fit.textures else f"{fit.textures} ({fit.taken} taken)"
        lines.append(
            (
                name, what, textures, f"{fit.size}²", figure(fit.cole), f"{ratios[0]:.3f}", figure(fit.rms),
                f"{ratios[1]:.3f}", f"{fit.seconds:.0f}",
            )
        )  # fmt: skip
        for word, ratio in zip(("Cole error", "RMS"), ratios, strict=True):
            if ratio > ALLOWED:
                violations.append(f"{name}, {fit.textures} × {fit.size}²: {word} {ratio:.2f} times the best with fewer")
    return lines, violations


def main(arguments: list[str] | None = None) -> int:
    """Print (and with --out write) the table and the violations; returns the exit code."""
    parser = parser_of(__doc__, "data", "effort", "out")
    parser.add_argument("--counts", type=int, nargs="+", default=[1, 2, 3, 5], help="of textures of 16²")
    parser.add_argument("--only", nargs="+", metavar="NAME", choices=tuple(MATERIALS), help="these materials alone")
    chosen = parser.parse_args(arguments)
    counts, sizes, effort, count = chosen.counts, SIZES, chosen.effort, 45_000
    names = chosen.only or list(MATERIALS)
    if chosen.short:
        counts, sizes, effort, count, names = [1, 2], (4, 8), 5.0, 400, names[:1]
    warm_up()
    folder, lines, violations = data_folder(chosen.data), [], []
    for name in names:
        path = MATERIALS[name] if MATERIALS[name].startswith("material:") else str(folder / MATERIALS[name])
        if not path.startswith("material:") and not Path(path.split("#")[0]).is_file():
            print(f"skipped {name}: no {path} (--data FOLDER or HOMOFACT_DATA)", file=sys.stderr)
            continue
        judge = Judge.of(path, open_source(path, count=count))
        size = sizes[0] if chosen.short else SIZE
        by_count = [judge.fitted(textures, size, effort, count) for textures in counts]
        known = {(fit.textures, fit.size): fit for fit in by_count}
        by_size = [known.get((2, side)) or judge.fitted(2, side, effort, count) for side in sizes]
        for what, fits in (("textures", by_count), ("texels", by_size)):
            found, wrong = rows_of(name, what, fits)
            lines += found
            violations += wrong
            progress("\n".join(" ".join(line) for line in found))
    heads = ("more", "textures", "texels", "Cole error", "over fewer", "RMS", "over fewer", "CPU s")
    parts = [
        "# More textures or texels",
        'The table shows errors on samples that were not fitted. "over fewer" is the error over the best error with'
        " fewer textures or texels: below 1 it fell.",
        f"Made by `python scripts/accuracy/more_is_never_worse.py` with effort {effort}, {count} pairs of sources that"
        f" can be evaluated anywhere, ε of the source and seed 0. {machine()}",
        markdown(("material", *heads), lines, 2),
        f"These fits are worse than one with fewer textures or texels by more than {ALLOWED - 1:.0%}: "
        + ("; ".join(violations) if violations else "none")
        + ".",
    ]
    return finish(parts, chosen)


if __name__ == "__main__":
    sys.exit(main())
