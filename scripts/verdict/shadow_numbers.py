"""Count how often the shadow of an arm is suspected in values that were rounded or cut at zero.

    python scripts/verdict/shadow_numbers.py [--part report] [--materials 26] [--out FILE.md]

The materials are the neural surrogates of one part of the calibration (`drawn_cases.py`); the check was set on the
first two parts. Each is measured in two of seven ways, without a shadow and with one of each strength. Then the values
are left as they are, rounded or cut at zero, and the check for the shadow is run.
"""

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from homofact.brdf.formats.nbrdf import load
from homofact.brdf.quality.suspicion.calibration import SAID, log_odds
from homofact.brdf.quality.suspicion.evidence import Evidence
from homofact.brdf.quality.suspicion.suspects import CHECKS
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.linear.threads import one_thread
from homofact.stability.fault import CasePart

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import data_folder, finish, markdown, parser_of, progress
from scripts.verdict.drawn_cases import networks
from scripts.verdict.planting import FAULTS
from scripts.verdict.suspicion_numbers import LAYOUTS, measured, on_coarse_rings

_PLANTS = {fault.name: fault for fault in FAULTS}
_SHADOW = _PLANTS["shadow of the arm"]
_COARSE = ((15, 5, 10), (15, 10, 15))
_COUNT = 2500


def digits(samples: Samples, count: int) -> Samples:
    """Samples with values of `count` decimal digits."""
    unit = 10.0 ** (torch.floor(torch.log10(samples.values.clamp_min(1e-300))) - count + 1)
    return replace(samples, values=torch.where(samples.values > 0, (samples.values / unit).round() * unit, 0.0))


def _planted(name: str, strength: float) -> Callable[[Samples], Samples]:
    return lambda samples: _PLANTS[name].plant(samples, strength, 0)


VALUES: dict[str, Callable[[Samples], Samples]] = {
    "as they are": lambda samples: samples,
    **{f"{levels} levels": _planted("quantised", levels) for levels in (15, 63, 255, 1023)},
    "2 digits": lambda samples: digits(samples, 2),
    **{f"darkest {share:.0%} cut": _planted("dark frame over-subtracted", share) for share in (0.1, 0.3)},
}


def _layouts(model: Reflectance, number: int) -> list[Samples]:
    ways = [*LAYOUTS, *_COARSE]
    chosen = [ways[number % len(ways)], ways[(number + 3) % len(ways)]]
    return [
        measured(model, way, _COUNT, number) if isinstance(way, str) else on_coarse_rings(model, way, number)
        for way in chosen
    ]


def suspected(samples: Samples) -> bool:
    """Whether the check for the shadow reports one."""
    check = CHECKS["shadow"]
    with np.errstate(all="ignore"):
        figures = check.figures(Evidence.of(samples))
    return figures is not None and log_odds(check.name, figures) >= math.log(SAID)


@one_thread
def main(arguments: list[str] | None = None) -> int:
    """Count, print the table, and write it where it is asked for."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--part", default="report", choices=[part.name.lower() for part in CasePart])
    parser.add_argument("--materials", type=int, default=26, help="at most so many (%(default)s)")
    chosen = parser.parse_args(arguments)
    sources = networks(CasePart[chosen.part.upper()], data_folder(chosen.data))
    sources = sources[: 1 if chosen.short else chosen.materials]
    strengths = (0.0, *_SHADOW.strengths)
    counts = {(way, strength): 0 for way in VALUES for strength in strengths}
    for number, source in enumerate(sources):
        for samples in _layouts(load(source), number):
            for strength in strengths:
                struck = _SHADOW.plant(samples, strength, number) if strength else samples
                for way, change in VALUES.items():
                    counts[way, strength] += suspected(change(struck))
        progress(f"{number + 1} of {len(sources)}: {source}")
    rows = [(way, 2 * len(sources), *(counts[way, strength] for strength in strengths)) for way in VALUES]
    header = ("values", "measurements", "clean: shadow", *(f"shadow {s:g} named" for s in _SHADOW.strengths))
    return finish(markdown(header, rows), chosen)


if __name__ == "__main__":
    sys.exit(main())
