"""Measure the gain of straightening: RGL's measurements before and after, and fits of both.

For every isotropic file of RGL's in the folder of real measurements: the tilt that is found (`brdf.quality.tilt`), the
floor of a reciprocal fit (relative RMS of f cosθi cosθo) of the measurement as it is and straightened, and fits of both
by the default search. All files are straightened where the odds are clear, also those that show no tilt.

    python scripts/accuracy/straightening.py [--data FOLDER] [--done FILE.jsonl] [--out docs/straightening.md]
"""

import sys
from pathlib import Path
from typing import Any

from homofact.brdf.source import Source, open_source
from homofact.brdf.tilt import Straightened
from homofact.evaluation.appearance import appearance
from homofact.evaluation.machine import machine
from homofact.methods.search import Search

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import Finished, data_folder, finish, markdown, parser_of, progress

SHAPES = ((2, 16), (3, 32))
SHORT_COUNT = 2000

HEAD = """# Straighten a measurement

Read this page if you fit a glossy material that was measured with a goniometer. In many real measurements, the
highlight is some hundredths to tenths of a degree away from the mirror direction, towards one side. If you swap
light and viewer, it is shifted towards the other side. The cause is a specimen that was tilted by such an angle. A
reciprocal fit blurs such a highlight. A fit without reciprocity makes one side of it bright and the other dark.

`homofact info FILE` prints the tilt of a measurement. If a file contains a complete table, as RGL's files do, every
command straightens it while reading, but only if the evidence for a tilt is clear ([conditions](#how-it-works)):

    homofact info irid_flake_paint1_rgb.bsdf
    homofact factorize irid_flake_paint1_rgb.bsdf                    # straightened if the evidence is clear
    homofact factorize irid_flake_paint1_rgb.bsdf --calibrate none   # the measurement as it is
    homofact convert irid_flake_paint1_rgb.bsdf straight.bsdf        # the straightened measurement

homofact corrects a list of samples (CSV, ASTM and others) only with `--calibrate tilt`. If `info` and `factorize`
find a tilt in a list, they print it with the option that undoes it:

    homofact info paint.csv                            # the sample was tilted by +0.198° in the plane of incidence ...
    homofact factorize paint.csv --calibrate tilt      # straightened if the evidence is clear
    homofact convert paint.csv straight.csv --calibrate tilt

In Python, `homofact.read(path, calibrate=["none"])` keeps the tilt. `calibrate=["tilt"]` undoes the tilt of a list
too. It fails for an anisotropic measurement and for a model, where homofact cannot look for a tilt.
`read(path).samples.provenance["tilt"]` contains the angle, its interval and the errors.

## How it works

homofact turns both directions of each pair by one angle δ in the plane of incidence and looks for the δ that makes
the measurement most reciprocal. This search needs no fit. The derivation is in `homofact/brdf/tilt.py`, the search
and its interval in `homofact/brdf/quality/tilt.py`. In a list of samples, only few pairs were also measured with
light and viewer swapped. For a list, homofact therefore looks for the δ at which it can best predict each value
from all other values. This works because the values of a reciprocal material are one smooth function of the half
and difference angles (`homofact/brdf/quality/tilt_of_samples.py`).

- **Reciprocity shows one angle.** Only the sum of the specimen's tilt and the angular errors of the two arms affects
  reciprocity. homofact therefore finds one δ per table. A tilt across the plane of incidence is visible only in files
  that distinguish the two sides of this plane. RGL's isotropic files do not: they are exactly symmetric about the
  plane.
- **The interval** (95%) comes from a bootstrap over the angles θd. If different θd suggest different tilts, the
  interval is wide.
- **The table's own error.** RGL's tables have eight angles of incidence. Interpolation between them is uneven, so
  even a perfect material can seem tilted. homofact therefore stores the straightened, reciprocal material in a
  table with the same angles and repeats the search on it. It subtracts the tilt that it finds there.
- **A tilt is undone only if** all of these are true:
    - the interval of the tilt excludes 0, and the tilt is at least 0.005°;
    - a search with only the pairs near the plane of incidence finds at least half of the tilt (this fails for an
      anisotropic sample that was measured as isotropic);
    - without the tilt, the lack of reciprocity ("misfit" below) is lower by at least a tenth, and its square is lower
      by more than the square of the misfit that interpolation in the measured table causes ("the table's own" below).
      In a list, the error of the predictions must be lower by at least a tenth;
    - it explains the lack of reciprocity better than an error of gain would: a factor that depends on the angle, such
      as a forgotten cosine.

## How much straightening gains
"""

FOUND = """\
Seven of the ten files are straightened. The floor of each of them falls, for the two iridescent paints to about a
quarter (from 0.092 and 0.097 to 0.024). These seven files have 14 fits, two sizes each:

- In 11 of the 14 cases, the fit of the straightened measurement has a lower error than the fit of the raw one. Both
  errors are measured against the straightened measurement. The fit of the straightened measurement has a higher error
  for cc_green_malachite and cc_iris_purple_gem with 3 × 32², and for irid_flake_paint1 with 2 × 16².
- The PSNR under the lamp rises in 9 fits, by up to 1.7 dB, and stays the same in 2. It falls by 0.2 to 1.1 dB in 3:
  both fits of vch_golden_yellow, and cc_iris_purple_gem with 2 × 16².
"""

LIMITS = """## Limits

- homofact looks for a tilt of isotropic materials only. An anisotropic sample is rotated during the measurement. A
  tilt that rotates with the sample does not change reciprocity, so it is not visible. In a list of samples,
  homofact looks only for the tilt in the plane of incidence.
- The more coarsely a list samples the highlights, the larger a tilt must be before homofact can find it. See [Tilts
  in lists of samples](measured.md#tilts-in-lists-of-samples).
- In lobes wider than about 6°, a tilt looks like a gain that depends on the angle. The interval of the tilt then
  grows to tenths of a degree.
- homofact uses one tilt angle for all angles of incidence.
- After straightening, light directions closer to the normal than δ have no measured values. For pairs with such a
  light direction, homofact uses the values of the nearest slice (measured angle of incidence) at the same half
  vector.
"""


def fitted(source: Source, textures: int, size: int, straight: Source) -> dict[str, Any]:
    """A fit of one source, and its errors against the straightened and against the raw measurement."""
    train, _ = source.samples.split(0.2, 0)
    fit = Search(textures=textures, size=size, epsilon=source.default_epsilon).fit(train).factorization
    found = appearance(fit, straight)
    assert found is not None
    raw = found.measured or found.energy
    return {
        "straight": found.energy.rms_cosine,
        "raw": raw.rms_cosine,
        "floor": found.energy.floor_cosine,
        "raw floor": raw.floor_cosine,
        "albedo": found.energy.albedo_worst,
        "lamp": found.psnr_light,
        "reciprocal": fit.terms[0].projection.reciprocal,
    }


def measured(path: Path, shapes: tuple[tuple[int, int], ...], count: int) -> dict[str, Any]:
    """The tilt of a file, and fits of the raw and of the straightened measurement."""
    raw, straight = (open_source(str(path), count=count, calibrate=[kind]) for kind in ("none", "auto"))
    fits = {}
    for textures, size in shapes:
        both = {"straight": fitted(straight, textures, size, straight)}
        same = not isinstance(straight.reflectance, Straightened)
        both["raw"] = both["straight"] if same else fitted(raw, textures, size, straight)
        fits[f"{textures} × {size}²"] = both
    return {"tilt": straight.samples.provenance["tilt"], "fits": fits}


def tables(rows: dict[str, dict[str, Any]]) -> list[str]:
    """The tilts, and the fits."""
    tilts, fits = [], []
    for name, row in rows.items():
        angle = row["tilt"]["in_plane"]
        first = next(iter(row["fits"].values()))["straight"]
        low, high = angle["interval"]
        undone = "yes" if row["tilt"]["undone"] else "no"
        numbers = (f"{angle['degrees']:+.3f}", f"{low:+.3f} to {high:+.3f}", undone)
        misfits = (angle["misfit"], angle["misfit_undone"], angle["misfit_of_the_table"])
        floors = (first["raw floor"], first["floor"])
        tilts.append((name, *numbers, *(f"{value:.3f}" for value in (*misfits, *floors))))
        for shape, both in row["fits"].items():
            raw, straight = both["raw"], both["straight"]
            errors = (raw["raw"], raw["straight"], straight["straight"], straight["floor"])
            over = straight["straight"] / straight["floor"] if straight["floor"] else float("nan")
            light = (f"{over:.2f}", f"{straight['albedo']:.3f}", f"{raw['lamp']:.1f}", f"{straight['lamp']:.1f}")
            words = "yes" if straight["reciprocal"] else "no"
            fits.append((name, shape, *(f"{value:.3f}" for value in errors), *light, words))
    return [
        markdown(
            (
                "file", "δ, °", "95% interval", "undone", "misfit", "misfit, undone", "the table's own", "floor",
                "straightened",
            ),
            tilts,
        ),
        'δ is the tilt in the plane of incidence. "Misfit" is the lack of reciprocity along the lobe, for θi and θo '
        "under 70°. \"Misfit, undone\" is the same after undoing δ. \"The table's own\" is the misfit that the "
        'interpolation of the table alone causes. "Floor" is the lack of reciprocity of all pairs, √∫∫(½(f − f '
        'swapped) cosθi cosθo)² over √∫∫(f cosθi cosθo)². No reciprocal fit has a smaller error. "Straightened" is '
        'the floor of the straightened measurement.',
        markdown(
            (
                "file", "textures", "raw fit: raw", "raw fit: straight", "straight fit: straight", "floor",
                "over floor", "worst albedo", "lamp dB, raw", "lamp dB, straight", "reciprocal",
            ),
            fits,
            2,
        ),
        "The errors are relative RMS of f cosθi cosθo. 'Raw fit: straight' is the error of the fit of the raw"
        " measurement, compared with the straightened measurement. 'Floor' is the floor of the straightened"
        " measurement (column 'straightened' of the first table). 'Over floor' is the error of the straight fit"
        " divided by this floor. 'Worst albedo' is fit over source for the straight fit, at the worst angle (5 to"
        " 75°) and channel. 'Lamp' is the PSNR in dB of a sphere under a small lamp, for the raw and for the"
        " straight fit. Albedo and PSNR are compared with the straightened measurement. 'reciprocal' is yes if the"
        " search enforced reciprocity for the straightened measurement.",
    ]  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    """Measure every file that is there, and print the page."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--done", type=Path, help="keep what is done in this file, and leave it out the next time")
    chosen = parser.parse_args(arguments)
    folder = data_folder(chosen.data) / "rgl"
    files = sorted(folder.glob("*_rgb.bsdf"))
    if not files:
        print(f"no RGL files in {folder} (--data FOLDER or HOMOFACT_DATA)", file=sys.stderr)
        return 2
    files, shapes, count = (files[-1:], SHAPES[:1], SHORT_COUNT) if chosen.short else (files, SHAPES, 45_000)
    finished = Finished(chosen.done)
    for path in files:
        if path.stem not in finished:
            finished.keep(path.stem, measured(path, shapes, count))
        progress(path.stem)
    rows = {path.stem.removesuffix("_rgb"): finished[path.stem] for path in files}
    conditions = (
        f"The tables show {len(rows)} RGL files with 45,000 pairs of directions each (`--scheme lobe`). The fits use"
        f" the default search, with 20% held out and seed 0. Machine: {machine()}. `python"
        " scripts/accuracy/straightening.py` makes the tables."
    )
    return finish(
        [HEAD.rstrip(), *([] if chosen.short else [FOUND.rstrip()]), conditions, *tables(rows), LIMITS.rstrip()], chosen
    )


if __name__ == "__main__":
    sys.exit(main())
