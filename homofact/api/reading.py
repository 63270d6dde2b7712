"""Reading: `homofact.read` makes a source from a measurement, a material, a reflectance or a function."""

from collections.abc import Sequence
from typing import Any

from homofact.brdf.source import Source, source_of
from homofact.brdf.source_names import DEFAULT_CALIBRATE, DEFAULT_COUNT, DEFAULT_SCHEME, as_names


def read(
    source: Any,
    *,
    channels: str = "rgb",
    count: int = DEFAULT_COUNT,
    scheme: str = DEFAULT_SCHEME,
    seed: int = 0,
    calibrate: Sequence[str] | str = DEFAULT_CALIBRATE,
    clipped: float | str | None = None,
    dismiss: Sequence[str] | str = (),
) -> Source:
    """Read a measurement, or draw samples of a material, a reflectance or a function.

    Parameters
    ----------
    source : the path of a file, whose format is detected from its content; "material:NAME"; `Samples`, or a tuple (wi,
        wo, values) or (wi, wo, values, weights) of arrays that make them; a `Reflectance`, e.g. a loaded `Fit`; or a
        function f(wi, wo) of unit vectors (N, 3) with values (N, C) in sr⁻¹.
    channels : "rgb", "luminance", "spectral" or the name of one channel, of a file or a material.
    count, scheme, seed : for sources that can be evaluated anywhere: the number of pairs of directions to draw, the
        sampling scheme ("lobe", "discs", "cosine" or "grid"), and the seed.
    calibrate : faults of the instrument to correct: the specimen's "tilt" (`brdf.quality.tilt`; for lists of samples
        `tilt_of_samples`), gains of "rings" and of "rows" (`brdf.quality.gains`), "auto" (a tilt, but only in complete
        tables and only if the evidence is clear), or "none".
    clipped : the clipping level in sr⁻¹, or "found" to detect it. Values at or above this level are lower bounds of the
        true values (`brdf.quality.clipping`). Only measured samples have gains or clipped values.
    dismiss : names of suspicions that `info` has raised and that you have checked, or "all": neither `info` nor a
        verdict raises them again.

    Returns
    -------
    The source, with `.samples`, `.reflectance` and `.evaluate(wi, wo)`.

    Raises
    ------
    BadInput : for what cannot be read.

    Examples
    --------
    >>> import homofact
    >>> homofact.read("material:phong-10", count=100)
    <Source phong-10, material: <Samples: 100 pairs of directions, R, G, B, isotropic>>
    >>> homofact.read(lambda wi, wo: 0.3 * wi[:, 2] * wo[:, 2], count=100).channels
    ('Y',)
    """
    return source_of(
        source, channels=channels, count=count, scheme=scheme, seed=seed, calibrate=as_names(calibrate),
        clipped=clipped, dismiss=as_names(dismiss),
    )  # fmt: skip
