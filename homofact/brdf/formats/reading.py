"""What reading a file gives, and how a file that holds a whole reflectance is turned into samples."""

from dataclasses import dataclass

from homofact.brdf.names import DEFAULT_COUNT, DEFAULT_SCHEME
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples


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
