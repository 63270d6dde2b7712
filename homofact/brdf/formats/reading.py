"""The result of reading a file, the settings for sampling a reflectance from a file, and checks for all readers."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from torch import Tensor

from homofact.brdf.channels import LuminanceOf, as_channels
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.source_names import DEFAULT_COUNT, DEFAULT_SCHEME
from homofact.errors import BadInput


@dataclass(frozen=True)
class Drawing:
    """How samples are drawn from a reflectance that is defined everywhere: see `sampling.sample_model`."""

    count: int = DEFAULT_COUNT
    scheme: str = DEFAULT_SCHEME
    seed: int = 0


@dataclass(frozen=True)
class Reading:
    """The samples of a file, and its reflectance if the file defines one everywhere (a full table, a network)."""

    samples: Samples
    reflectance: Reflectance | None = None

    @classmethod
    def of(cls, path: object, samples: Samples, reflectance: Reflectance, channels: str) -> "Reading":
        """Return a file's reflectance and samples of it, both in `channels`. Raises BadInput as `in_channels`."""
        wants_sum = channels == "luminance" and len(reflectance.channels) == 3
        return cls(in_channels(path, samples, channels), LuminanceOf(reflectance) if wants_sum else reflectance)


def in_channels(path: object, samples: Samples, channels: str) -> Samples:
    """Return samples of a file in `channels`. Raises BadInput that names the file if they cannot be converted."""
    try:
        return as_channels(samples, channels)
    except BadInput as error:
        raise error.at(path) from error


def line_fault(path: object, number: int, problem: str, expected: object) -> BadInput:
    """Return an error about a line of a text file."""
    return BadInput(problem, where=f"{path}: line {number}", expected=expected)


def zeros_of(values: Tensor) -> dict[str, int]:
    """Return how many of the values (N, C) are exactly 0, and how many samples have such a value; for the faults."""
    zeros = values == 0
    return {"exact_zeros": int(zeros.sum()), "samples_with_zeros": int(zeros.any(1).sum())}


def check_azimuths(path: object, lines: Sequence[int], name: str, phi: Tensor, degrees: bool) -> None:
    """Raise BadInput naming the line if an azimuth (N,) exceeds one turn, as when degrees are read as radians."""
    turn = 360.0 if degrees else 2 * math.pi
    over = phi.abs() > turn * (1 + 1e-3)
    if bool(over.any()):
        row = int(over.nonzero()[0])
        unit = "360 degrees" if degrees else "2 pi radians"
        raise line_fault(path, lines[row], f"{name} {float(phi[row]):g}", f"at most a turn, {unit}")
