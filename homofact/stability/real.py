"""Stressors that are real measurements: a retroreflector, materials that are not reciprocal, values below zero.

They are read from the folder $HOMOFACT_DATA, or ../shared/data beside the working folder. If a file is missing, its
cells are skipped, with a note.
"""

import os
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from homofact.brdf.source import Source, open_source
from homofact.stability.problem import CLEAN_SEED, Problem, Scale, Stressor

RGL = ("aurora_white", "vch_golden_yellow", "chm_light_blue", "irid_flake_paint1")


class MissingMeasurement(Exception):
    """A measurement that is not on this machine; the message names the file and the searched folder."""


def data_folder() -> Path:
    """Return where real measurements are looked for."""
    return Path(os.environ.get("HOMOFACT_DATA", Path("..") / "shared" / "data"))


@lru_cache(maxsize=8)
def _opened(name: str, channels: str, count: int, seed: int) -> Source:
    path = data_folder() / name
    if not path.is_file():
        raise MissingMeasurement(
            f"{name} not found in {data_folder()}: set HOMOFACT_DATA to the folder of real measurements"
        )
    return open_source(str(path), channels=channels, count=count, seed=seed)


def measured(name: str, channels: str, seed: int, scale: Scale) -> Problem:
    """Return samples of a measurement to fit, and others, at random azimuths, to measure the errors."""
    source = _opened(name, channels, scale.samples + scale.clean, seed)
    chosen = source.samples.subset(scale.samples + scale.clean, seed)
    train, clean = chosen.split(scale.clean / (scale.samples + scale.clean), seed)
    return Problem(train, clean.rotated_at_random(seed + CLEAN_SEED), kind=source.kind, key="stressed")


def retroreflector(strength: float, seed: int, scale: Scale) -> Problem:
    """Return the tape's values to the power `strength`: 1 as measured."""
    problem = measured("retro/retro-3M-jaune.dat", "rgb", seed, scale)
    return problem.both(lambda samples: replace(samples, values=samples.values**strength))


def rgl(strength: float, seed: int, scale: Scale) -> Problem:
    """Return material number `strength` of `RGL` for reciprocal fits; its reference is fitted without reciprocity."""
    name = RGL[int(strength)]
    problem = measured(f"rgl/{name}_rgb.bsdf", "rgb", seed, scale)
    free = replace(problem, settings=({"reciprocal": False},), key=f"{name}, not reciprocal")
    return replace(problem, reference=free)


def _car_paint(strength: float, seed: int, scale: Scale) -> Problem:
    """A share of the measurement: where more than it are negative, and where the rest was extrapolated."""
    smaller = replace(scale, samples=int(scale.samples * strength))
    return measured("mdl/carpaint_red.mbsdf", "rgb", seed, smaller)


STRESSORS = (
    Stressor(
        "real-retroreflector", "retroreflective tape (measured)",
        "The measured values of a yellow retroreflective tape are raised to a power of at most 1. A smaller power"
        " compresses the range of values.",
        "The tape sends most light back to its source, and its values span three powers of ten (0.04 to 39 sr⁻¹). The"
        " lobe is a ridge at θd = 0 for every θh, which textures over h or ωi alone cannot represent.",
        "Use a texture over θd with enough texels there (`search`, larger `size`), and do not trust the fit at"
        " unmeasured angles.",
        "power", (0.25, 0.5, 1), retroreflector,
    ),
    Stressor(
        "real-non-reciprocal", "measured materials that are not reciprocal",
        "Each method fits four materials of the RGL database with reciprocity. The table divides the errors of these"
        " fits by those of the same fits without reciprocity.",
        "Their measurements deviate from reciprocity by at least 7%. This is small compared with the error that"
        " small textures have anyway.",
        "Use `reciprocal=False` to reproduce the measurement. Keep reciprocity if a renderer needs it.",
        "material", (0, 1, 2, 3), rgl, ("aurora", "golden", "chm blue", "flakes"),
    ),
    Stressor(
        "real-negative", "measured values below zero",
        "In the measurement of a car paint, a tenth of the values are negative because of noise. The fit uses a random"
        " share of the samples.",
        "The file reader leaves out the extrapolated angles of the file. It sets negative values to zero and counts"
        " them. These zeros make up a quarter of the green channel. They have a large influence on a fit of"
        " logarithms, so the fit can be too dark in green.",
        "`homofact info` shows the count. Use an ε as large as the noise (`epsilon=\"floor\"`, see [Repair bad"
        " measurements](robustness.md)).",
        "share of the samples", (1, 0.3, 0.1), _car_paint,
    ),
)  # fmt: skip
