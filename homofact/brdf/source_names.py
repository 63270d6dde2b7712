"""The names of channels, schemes and materials, without their code, so that checks and help do not import torch."""

from collections.abc import Sequence

CHANNELS = ("rgb", "spectral", "luminance")
SCHEMES = ("lobe", "discs", "cosine", "grid")
DEFAULT_SCHEME = "lobe"
DEFAULT_COUNT = 45_000
HELD_OUT = 0.2  # the part of the samples that is kept from a fit to test it
MOST_COUNT = 10_000_000  # pairs: a gigabyte of samples
MATERIAL_PREFIX = "material:"
MATERIAL_NAMES = (
    "lafortune-blue-paint", "lafortune-clay", "lafortune-skin", "cook-torrance-plastic", "ashikhmin-shirley-wang",
    "phong-10", "phong-30", "blinn-phong-50", "torrance-sparrow-20", "ward-brushed",
    "car-paint-red",
)  # fmt: skip
GAINS = ("rings", "rows")  # what `brdf.quality.gains` can divide out
TILT, AUTOMATIC, NOTHING = "tilt", "auto", "none"
# What is undone of the instrument: "auto" is the tilt where the odds are clear, "none" nothing.
CALIBRATIONS = (AUTOMATIC, NOTHING, TILT, *GAINS)
DEFAULT_CALIBRATE = (AUTOMATIC,)
DISMISSED = "dismissed"  # in the provenance of samples: the suspicions that somebody has checked
ALL_DISMISSED = "all"
MOST = 80.0  # logarithms above it are cut: e⁸⁰ is the largest power that float32 holds


def as_names(given: str | Sequence[str]) -> tuple[str, ...]:
    """Return names as a tuple; a text is one name, and not its letters."""
    return (given,) if isinstance(given, str) else tuple(given)
