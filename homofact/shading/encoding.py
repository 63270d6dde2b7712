"""Storage of a texture: float32, float16, integers of 8 or 16 bits, or blocks of BC6H.

A stored texel t encodes p = scale · t + bias, per channel, with t in [0, 1] for integers and scale 1 for floats; p is a
logarithm of a product, or a factor of a sum of products. Interpolation is linear, so a sampler can interpolate t and
the shader decodes the result. float16 stores 11 bits of a number. Its bias is the middle of the texture's range, which
keeps the numbers small.

BC6H (`containers.bc6h`) interpolates the bit patterns of halves: linearly within a power of two, geometrically across
several, and with large errors through zero, near which it is finest. So the stored values of a texture have one sign.
Let R be the range of the widest channel. Then t = (p − bias)/R lies in [a, a + 1] or in [−a − 1, −a], and every channel
starts at the end nearest to zero. All channels have the same scale, so they have equal weight in the error that the
encoder minimises. The best distance a from zero depends on the texture: a small a gives high precision at one end of
the range, a large a gives even precision. The encoder tries both signs of three values of a, and keeps the one with the
smallest error inside the mask.
"""

from itertools import product

import numpy as np
import torch
from torch import Tensor

from homofact.errors import BadInput
from homofact.factor.fitted import QuantizationGrid, Texture
from homofact.linear.arrays import as_array
from homofact.shading.encoded import LEVELS, Encoded, plain

STORAGES = ("float32", "float16", *LEVELS, "bc6h")
# The distances a from zero at which BC6H is tried, in ranges of the texture.
_STARTS = (0.0, 0.125, 0.5)


def as_floats(texture: Tensor | np.ndarray) -> Encoded:
    """Return the texture as float32 with scale 1 and bias 0."""
    return plain(as_array(texture))


def encode_texture(texture: Texture, storage: str) -> Encoded:
    """Return a fit's texture in a storage format (see `encode`).

    A texture that was quantized for this storage (`factor.quantize`) keeps its scale and bias, so encoding is lossless.
    """
    return encode(texture.texels, texture.mask, storage, texture.grid)


def encode(
    texture: Tensor | np.ndarray, mask: Tensor | np.ndarray, storage: str, grid: QuantizationGrid | None = None
) -> Encoded:
    """Encode a texture (rows, columns, C); except for float32, texels are clipped to the range inside the mask.

    Raises BadInput for an unknown storage, and for bc6h if C is not 1 or 3 or a side is not a multiple of 4.
    """
    if storage not in STORAGES:
        raise BadInput(where="storage", found=repr(storage), expected=f"one of {', '.join(STORAGES)}")
    texture, mask = torch.from_numpy(as_array(texture, np.float64)), torch.from_numpy(as_array(mask))
    channels = texture.shape[2]
    if storage == "float32":
        return as_floats(texture)
    inside = texture[mask] if bool(mask.any()) else texture.reshape(-1, channels)
    low, high = inside.amin(0), inside.amax(0)
    clipped = texture.clamp(low, high)
    if storage == "bc6h":
        return _blocks(clipped, mask, low, high)
    if storage not in LEVELS:
        middle = (low + high) / 2
        return Encoded(storage, (clipped - middle).numpy().astype(np.float16), np.ones(channels), middle.numpy())
    levels = LEVELS[storage]
    scale = (high - low).clamp_min(1e-6)
    if grid is not None and grid.levels == levels:
        low, scale = torch.from_numpy(grid.low), torch.from_numpy(grid.step * levels)
        clipped = texture
    steps = ((clipped - low) / scale * levels).round().clamp(0, levels)
    kind = np.uint8 if levels < 256 else np.uint16
    return Encoded(storage, steps.numpy().astype(kind), scale.numpy(), low.numpy())


def _blocks(texture: Tensor, mask: Tensor, low: Tensor, high: Tensor) -> Encoded:
    """The affine map, of those that the module's head tells, with which BC6H errs least inside the mask."""
    channels = texture.shape[2]
    if channels not in (1, 3):
        raise BadInput(where="bc6h", found=f"{channels} channels", expected="1 or 3")
    span = float((high - low).max().clamp_min(1e-6))
    weights = mask.to(texture)[..., None] if bool(mask.any()) else torch.ones_like(texture)
    tried = []
    for start, (end, side) in product(_STARTS, ((low, 1), (high, -1))):
        bias = end - side * start * span
        stored = ((texture - bias) / span).numpy().astype(np.float16)
        tried.append(Encoded("bc6h", stored, np.full(channels, span), bias.numpy()))
    return min(tried, key=lambda grid: float(((grid.decoded() - texture).square() * weights).sum()))
