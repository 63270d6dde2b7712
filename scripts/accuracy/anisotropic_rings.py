"""Fit anisotropic materials from a goniometer's rings by the search and by McCool's projections, at equal bytes.

    python scripts/accuracy/anisotropic_rings.py                  # all of it: two minutes
    python scripts/accuracy/anisotropic_rings.py --materials steel --bytes 12288

Materials of which all values are known are "measured" without noise, up to θi = 65 or 70° and θo = 80°. Each row is a
fit: the Cole error on held-out samples and at directions between the rings, what it has of the brightest sample, and
its light over that of the samples at the angle of incidence where it is farthest off.
"""

import argparse
import math

from homofact.brdf.source import source_of
from homofact.evaluation.compare import fit_and_measure
from homofact.evaluation.metrics import measure
from homofact.methods.mccool import McCool
from homofact.methods.search import Search
from homofact.methods.table import with_bytes
from scripts.accuracy.interpolated_samples import LAYOUTS, model_of, rings

MATERIALS = ("steel", "ward-brushed", "ashikhmin-shirley-wang", "satin")
RINGS = ("rings", "coarse rings")


def main() -> None:
    """Print a line per fit."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--materials", nargs="+", default=MATERIALS, choices=MATERIALS)
    parser.add_argument("--layouts", nargs="+", default=RINGS, choices=RINGS)
    parser.add_argument("--bytes", type=int, default=6144)
    asked = parser.parse_args()
    methods = {"search": Search(bytes=asked.bytes), "McCool": with_bytes(McCool(), asked.bytes)}
    heads = ("bytes", "held out", "between", "peak", "light", "fit s")
    print(f"{'material':22} {'samples':13} {'method':7} " + " ".join(f"{head:>9}" for head in heads))
    for name in asked.materials:
        for layout in asked.layouts:
            source = source_of(LAYOUTS[layout](model_of(name)))
            tests = rings(model_of(name), (12, 42, 57), (15, 75), (4, 9))
            for label, method in methods.items():
                assert method is not None
                row = fit_and_measure(source, method)
                fit, light = row.factorization, row.verdict.figures.light
                between = measure(fit, tests, fit.transform).log_mse
                off = max((ratio for *_, ratio in light.by_incidence), key=lambda ratio: abs(math.log(ratio)))
                errors = f"{row.held_out.log_mse:9.3g} {between:9.3g}"
                kept = f"{light.peak_fit / light.peak:9.2f} {off:9.2f} {row.report.seconds:9.1f}"
                print(f"{name:22} {layout:13} {label:7} {fit.nbytes:9} {errors} {kept}", flush=True)


if __name__ == "__main__":
    main()
