"""Count how often the error bars of total reflected light hold for fits of goniometers' scans.

    python scripts/verdict/bars_of_scans.py [--materials 24] [--seed 0] [--out FILE.md]

Materials are drawn and scanned as in `artefacts_of_scans`, and fitted with 6 KB. At each angle of incidence of the
verdict, the bar holds if the true light lies between its limits. The fits are made twice: as they are, following a
model of the samples where nothing was measured (`brdf.quality.extrapolation`), and without that model. Angles whose
bar rests on extrapolation are counted apart.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
import homofact
from homofact.brdf.quality import extrapolation
from homofact.brdf.quality.faults import albedo
from homofact.linear.threads import one_thread
from scripts.shared.harness import figure, finish, markdown, parser_of, progress
from scripts.verdict.artefacts_of_scans import BYTES, EPSILON, drawn_material, scan

RINGS = 128  # of the half vectors that an albedo is summed over


@one_thread
def main(arguments: list[str] | None = None) -> int:
    """Draw, scan, fit and count; print the table."""
    parser = parser_of(__doc__, "out")
    parser.add_argument("--materials", type=int, default=24, help="how many are drawn (%(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of materials and noise (%(default)s)")
    chosen = parser.parse_args(arguments)
    surface_of = extrapolation._surface_of
    counts: dict[tuple[str, bool], list[float]] = {}
    trusted = {"no model": 0, "model": 0}
    generator = np.random.default_rng(chosen.seed)
    number_of = 2 if chosen.short else chosen.materials
    for number in range(number_of):
        material = drawn_material(generator)
        samples = scan(material, generator)
        for label in trusted:
            extrapolation._surface_of = surface_of if label == "model" else (lambda samples: None)
            fit = homofact.fit(samples, homofact.Search(bytes=BYTES, epsilon=EPSILON))
            assert fit.verdict is not None
            assert fit.verdict.bars is not None
            trusted[label] += fit.verdict.trusted
            for bar in fit.verdict.bars.by_angle:
                if bar.low is None or bar.high is None:
                    continue
                true, found = (albedo(each, bar.degrees[0], rings=RINGS) for each in (material, fit.factorization))
                ratios = (true / found).tolist()
                row = counts.setdefault((label, bar.rests_on_extrapolation), [0, 0, 0.0, 0.0])
                row[0] += 1
                row[1] += all(bar.low <= ratio <= bar.high for ratio in ratios)
                row[2] += max(abs(np.log(ratio)) for ratio in ratios)
                row[3] += np.log(bar.high)
        progress(number, str(trusted))
    rows = [
        (
            label,
            "extrapolated" if beyond else "measured",
            f"{held} of {several}",
            figure(off / several),
            figure(wide / several),
        )
        for (label, beyond), (several, held, off, wide) in sorted(counts.items())
    ]
    told = [(label, f"{count} of {number_of}") for label, count in trusted.items()]
    heads = ("fit", "angles", "bars that hold", "mean log error", "mean log bar")
    return finish([markdown(heads, rows), markdown(("fit", "trusted"), told)], chosen)


if __name__ == "__main__":
    sys.exit(main())
