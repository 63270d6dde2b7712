"""A texture as it is stored in a file by `encoding`, and the values that a shader decodes. Does not import torch."""

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
    """A texture as it is stored in a file (`containers.formats`), with the scale and bias that decode its texels.

    `stored` (rows, columns, C) is float32, float16, uint8 or uint16; for BC6H it is the float16 input of the encoder.
    `scale` and `bias` are (C,) float64.
    """

    storage: str
    stored: np.ndarray
    scale: np.ndarray
    bias: np.ndarray

    @cached_property
    def sampled(self) -> np.ndarray:
        """Return the values at texel centres: `stored` after block compression, integers not scaled to [0, 1]."""
        if self.storage != "bc6h":
            return self.stored
        rows, columns, channels = self.stored.shape
        # As in the file: a single channel stands in all three.
        blocks = encode_bc6h(np.repeat(self.stored, 3 // channels, 2), "bc6h")
        return decode_bc6h(blocks, rows, columns, "bc6h")[..., :channels]

    @property
    def values(self) -> np.ndarray:
        """The decoded texels (rows, columns, C) in float64, as a shader computes them at texel centres."""
        return self.sampled.astype(np.float64) / LEVELS.get(self.storage, 1) * self.scale + self.bias

    def decoded(self) -> "Tensor":
        """Return `values` as a tensor."""
        import torch

        return torch.from_numpy(self.values)


def plain(texels: np.ndarray) -> Encoded:
    """Return texels (rows, columns, C) as float32 with scale 1 and bias 0."""
    channels = texels.shape[2]
    return Encoded("float32", texels.astype(np.float32), np.ones(channels), np.zeros(channels))
