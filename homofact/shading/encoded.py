"""A texture as it is stored (`encoding` makes it so), and what a shader finds in it. No torch is loaded here."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from homofact.containers.bc6h import decode_bc6h, encode_bc6h

if TYPE_CHECKING:
    from torch import Tensor

LEVELS = {"unorm8": 255, "unorm16": 65535}


@dataclass(frozen=True)
class Encoded:
    """A texture as it goes into a file (`containers.formats`), and how its texels become logarithms.

    `stored` (rows, columns, C) is float32, float16 (BC6H too: what its encoder is given), uint8 or uint16; `scale` and
    `bias` are (C,) float64.
    """

    storage: str
    stored: np.ndarray
    scale: np.ndarray
    bias: np.ndarray

    @cached_property
    def sampled(self) -> np.ndarray:
        """Return the values of a sampler at texel centres, integers undivided: `stored` after block compression."""
        if self.storage != "bc6h":
            return self.stored
        rows, columns, channels = self.stored.shape
        # As in the file: a single channel stands in all three.
        blocks = encode_bc6h(np.repeat(self.stored, 3 // channels, 2), "bc6h")
        return decode_bc6h(blocks, rows, columns, "bc6h")[..., :channels]

    @property
    def values(self) -> np.ndarray:
        """The texels (rows, columns, C) float64 that a sampler gives at texel centres, decoded by the shader."""
        return self.sampled.astype(np.float64) / LEVELS.get(self.storage, 1) * self.scale + self.bias

    def decoded(self) -> "Tensor":
        """Return `values` as a tensor."""
        import torch

        return torch.from_numpy(self.values)


def plain(texels: np.ndarray) -> Encoded:
    """Return texels (rows, columns, C) as float32, which a shader takes as they are."""
    channels = texels.shape[2]
    return Encoded("float32", texels.astype(np.float32), np.ones(channels), np.zeros(channels))
