"""Anything that reflects, read as a source to fit, compare and draw: `homofact.read`."""

from collections.abc import Sequence
from typing import Any

from homofact.brdf.source import Source, source_of
from homofact.brdf.source_names import DEFAULT_CALIBRATE, DEFAULT_COUNT, DEFAULT_SCHEME


def read(
    source: Any,
    *,
    channels: str = "rgb",
    count: int = DEFAULT_COUNT,
    scheme: str = DEFAULT_SCHEME,
    seed: int = 0,
    calibrate: Sequence[str] = DEFAULT_CALIBRATE,
    clipped: float | str | None = None,
    dismiss: Sequence[str] = (),
) -> Source:
    """Read a measurement, or draw samples of a material, a reflectance or a function.

    Parameters
    ----------
    source : the path of a file, whose content is sniffed; "material:NAME"; `Samples`, or a tuple (wi, wo, values) or
        (wi, wo, values, weights) of arrays that make them; a `Reflectance`, e.g. a loaded `Fit`; or a function
        f(wi, wo) of unit vectors (N, 3) with values (N, C) in sr⁻¹.
    channels : "rgb", "luminance", "spectral" or the name of one channel, of a file or a material.
    count, scheme, seed : how many pairs of directions are drawn of what can be evaluated anywhere, and how ("lobe",
        "discs", "cosine" or "grid").
    calibrate : faults of the instrument to undo: the sample's "tilt" (`brdf.quality.tilt`, and `tilt_of_samples` for
        lists), gains by "rings" and by "rows" (`brdf.quality.gains`), "auto" for a tilt in a whole table where the
        odds are clear, or "none".
    clipped : values of so many sr⁻¹ and more, or of the level that is "found", are taken as bounds
        (`brdf.quality.clipping`). Only measured samples have gains or clipped values.
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
        source, channels=channels, count=count, scheme=scheme, seed=seed, calibrate=calibrate, clipped=clipped,
        dismiss=dismiss,
    )  # fmt: skip
