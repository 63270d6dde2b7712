"""What reading a file gives, how one that is a whole reflectance is sampled, and what readers check alike."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from torch import Tensor

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
    """A file's samples; and its reflectance, where it is one by itself (a full table, a network)."""

    samples: Samples
    reflectance: Reflectance | None = None


def check_azimuths(path: object, lines: Sequence[int], name: str, phi: Tensor, degrees: bool) -> None:
    """Raise BadInput, naming the row's line, for an azimuth (N,) of more than a turn: mostly degrees among radians."""
    turn = 360.0 if degrees else 2 * math.pi
    over = phi.abs() > turn * (1 + 1e-3)
    if bool(over.any()):
        row = int(over.nonzero()[0])
        unit = "360 degrees" if degrees else "2 pi radians"
        raise BadInput(
            f"{name} {float(phi[row]):g}", where=f"{path}: line {lines[row]}", expected=f"at most a turn, {unit}"
        )
