"""BC6H signed: three-channel textures of halves in one byte per texel, for values of either sign.

Every block of 4 × 4 texels becomes a segment in colour space with 16 colours on it (see `bc6h_blocks`). The encoder
uses the four block modes with one region, which differ only in the precision of the segment's ends: 10 bits for
arbitrary ends, and 11, 12 and 16 bits for ends that are closer and closer together. For each mode it

1. lays the segment along the principal axis of the 16 values, from the least projection to the largest;
2. gives every texel the nearest of the 16 decoded colours;
3. solves for the ends that fit these choices in least squares, and repeats from step 2 while the error falls.

Interpolation is linear in the bit patterns q of the halves, but the error is measured in their values v. Step 3
therefore weights the pattern of a texel by dv/dq, the spacing of halves at its value. The encoder then improves the
best mode of each block by descent, one end and channel at a time, finally in steps of one quantum. All steps minimise
the sum of the squared errors of the decoded values, with equal weights for the channels. A block of one colour is
stored exactly.

What to expect: with 10 bits, one of which is the sign, there are 16.5 quanta from one power of two to the next. So an
end is off by up to 3 % of its value, and with 12 bits by 0.8 %. A segment that passes through zero passes all powers of
two down to 2⁻²⁴ twice, and has few colours left for the rest. A smooth texture of 32² whose values stay on one side of
zero (0.5 to 12.5, 4 to 16, −16 to −4, 0 to 1) comes back with an RMS error of 0.5 % and a largest error of 3 % of its
range; from −6 to 6, these errors are 1.1 % and 8 % (tests/containers/test_bc6h.py). So shift a logarithm to one side of
zero before it is stored.
"""

import numpy as np

from homofact.containers.bc6h_blocks import MODES, WEIGHTS, pack, palette, spread, unpack
from homofact.errors import BadInput

# Blocks at a time: bounds the memory of the 16 × 16 distances.
_BATCH = 2048
_REPEATS = 6
# Rounds of the walk at each of its strides, in quanta; far strides matter to segments through zero.
_STRIDES = (64, 16, 4, 1)
_WALKS = 32
_MOST = 0x7FFF


def encode_bc6h(pixels: np.ndarray, name: str = "BC6H") -> bytes:
    """Encode finite pixels (rows, columns, 3), up to ±65504, as rows · columns bytes of BC6H signed blocks.

    Blocks are stored row by row from the top left. The encoder minimises the mean square error of each block, as
    described at the start of this module. Raises BadInput that names `name` for sides that are not multiples of 4,
    another shape, and values that are not finite or too large.
    """
    values = np.asarray(pixels, np.float64)
    if values.ndim != 3 or values.shape[2] != 3:
        raise BadInput(where=name, found=f"pixels of shape {values.shape}", expected="(rows, columns, 3)")
    rows, columns, _ = values.shape
    if rows % 4 or columns % 4 or not values.size:
        raise BadInput(f"{columns} x {rows} texels", where=name, expected="sides that are multiples of 4 (BC6H blocks)")
    if not (np.abs(values) <= 65504).all():
        row, column, channel = (int(place) for place in np.argwhere(~(np.abs(values) <= 65504))[0])
        where = f"row {row}, column {column}, channel {channel} is {values[row, column, channel]:g}"
        raise BadInput(where, where=name, expected="finite values of at most 65504 (float16)")
    blocks = values.reshape(rows // 4, 4, columns // 4, 4, 3).swapaxes(1, 2).reshape(-1, 16, 3)
    return b"".join(_encode(blocks[at : at + _BATCH]) for at in range(0, len(blocks), _BATCH))


def decode_bc6h(data: bytes, rows: int, columns: int, name: str = "BC6H") -> np.ndarray:
    """Return texels float16 (rows, columns, 3) of BC6H signed blocks, as a GPU's sampler reads them.

    Raises BadInput that names `name` for sides that are not multiples of 4, a wrong number of bytes, and blocks with
    two regions, which `encode_bc6h` does not write.
    """
    if rows % 4 or columns % 4 or rows < 1 or columns < 1:
        raise BadInput(f"{columns} x {rows} texels", where=name, expected="sides that are multiples of 4 (BC6H blocks)")
    if len(data) != rows * columns:
        raise BadInput(where=name, found=f"{len(data)} bytes for {columns} x {rows} texels", expected=rows * columns)
    modes, first, second, indices = unpack(data, name)
    colours = palette(first, second, np.array([mode.bits for mode in MODES])[modes])
    texels = np.take_along_axis(colours, indices[..., None], 1)
    return texels.reshape(rows // 4, columns // 4, 4, 4, 3).swapaxes(1, 2).reshape(rows, columns, 3)


def _encode(blocks: np.ndarray) -> bytes:
    """16 bytes for each of the blocks (N, 16, 3)."""
    count = len(blocks)
    modes = np.zeros(count, np.int64)
    first, second = np.zeros((2, count, 3), np.int64)
    least = np.full(count, np.inf)
    for position in range(len(MODES)):
        start, end, error = _fit(blocks, position)
        better = error < least
        modes[better], least[better] = position, error[better]
        first[better], second[better] = start[better], end[better]
    first, second, indices = _walk(blocks, modes, first, second)
    # The first index has no room for its highest bit: reversing the segment clears it.
    turned = indices[:, 0] >= 8
    first[turned], second[turned] = second[turned], first[turned]
    indices[turned] = 15 - indices[turned]
    return pack(modes, first, second, indices)


def _fit(blocks: np.ndarray, position: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(first, second, squared error) of the blocks in one mode: steps 1 to 3 of the module's head."""
    bits = np.full(len(blocks), MODES[position].bits)
    codes, slopes = _codes(blocks)
    low, high = (_codes(end)[0] for end in _principal_segment(blocks))
    best_first, best_second = _quantized(low, high, position)
    indices, least = _nearest(blocks, best_first, best_second, bits)
    for _ in range(_REPEATS):
        low, high = spread(best_first, bits[:, None]), spread(best_second, bits[:, None])
        first, second = _quantized(*_least_squares(codes, slopes, indices, low, high), position)
        chosen, error = _nearest(blocks, first, second, bits)
        better = error < least
        if not better.any():
            break
        best_first[better], best_second[better] = first[better], second[better]
        indices[better], least[better] = chosen[better], error[better]
    return best_first, best_second, least


def _walk(
    blocks: np.ndarray, modes: np.ndarray, first: np.ndarray, second: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(first, second, indices) after steps of ever fewer quanta, each kept where it lowers the block's error."""
    bits = np.array([mode.bits for mode in MODES])[modes]
    reach = np.array([mode.reach for mode in MODES])[modes, None]
    most = (1 << (bits - 1)) - 1
    ends = np.stack((first, second), 1)
    indices, least = _nearest(blocks, ends[:, 0], ends[:, 1], bits)
    for stride in _STRIDES:
        # A round moves every end and channel once either way; blocks that it leaves alone are done.
        moving = np.arange(len(blocks))
        for _ in range(_WALKS):
            before = least[moving]
            for end, channel, step in np.ndindex(2, 3, 2):
                tried = ends[moving]
                tried[:, end, channel] += stride * (2 * step - 1)
                legal = (np.abs(tried[:, 0] - tried[:, 1]) <= reach[moving]).all(1)
                legal &= np.abs(tried[:, end, channel]) <= most[moving]
                chosen, error = _nearest(blocks[moving], tried[:, 0], tried[:, 1], bits[moving])
                better = legal & (error < least[moving])
                at = moving[better]
                ends[at], indices[at], least[at] = tried[better], chosen[better], error[better]
            moving = moving[least[moving] < before]
            if not len(moving):
                break
    return ends[:, 0], ends[:, 1], indices


def _principal_segment(blocks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both ends (N, 3) of the values' extent along their principal axis."""
    mean = blocks.mean(1, keepdims=True)
    apart = blocks - mean
    axis = np.linalg.eigh(apart.swapaxes(1, 2) @ apart)[1][..., -1]
    along = (apart @ axis[..., None])[..., 0]
    ends = (mean[:, 0] + extent[:, None] * axis for extent in (along.min(1), along.max(1)))
    low, high = (np.clip(end, -65504, 65504) for end in ends)
    return low, high


def _codes(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(16-bit integers, not rounded, that decode to the values; the values' change by one of them)."""
    magnitude = np.abs(values)
    # Below 2^-14 halves are evenly spaced; frexp gives zero the exponent of 0.5.
    exponent = np.where(magnitude < 2.0**-14, -14, np.frexp(magnitude)[1] - 1)
    pattern = (exponent + 14) * 1024 + np.ldexp(magnitude, 10 - exponent)
    # Decoding takes the whole part of 31/32: the middle of what decodes to a pattern.
    return np.copysign((pattern + 0.5) * 32 / 31, values), np.ldexp(1.0, exponent - 10)


def _quantized(low: np.ndarray, high: np.ndarray, position: int) -> tuple[np.ndarray, np.ndarray]:
    """Endpoints of the mode nearest to 16-bit integers; where they are too far apart, both move inwards."""
    mode = MODES[position]
    most = (1 << (mode.bits - 1)) - 1
    quantum = 2.0 ** (16 - mode.bits)
    half = 0.5 if mode.bits < 16 else 0.0
    first, second = (
        (np.sign(end) * np.clip(np.rint(np.abs(end) / quantum - half), 0, most)).astype(np.int64) for end in (low, high)
    )
    excess = np.maximum(np.abs(second - first) - mode.reach, 0)
    side = np.sign(second - first)
    first = first + side * (excess // 2)
    return first, second - side * (excess - excess // 2)


def _nearest(
    blocks: np.ndarray, first: np.ndarray, second: np.ndarray, bits: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(indices (N, 16) of the nearest colours, summed squared error (N,))."""
    limit = (1 << (bits - 1))[:, None] - 1
    colours = palette(np.clip(first, -limit, limit), np.clip(second, -limit, limit), bits).astype(np.float64)
    # Distances from the block's mean, where squares of both lose no digits to it.
    mean = blocks.mean(1, keepdims=True)
    texels, colours = blocks - mean, colours - mean
    distances = (colours**2).sum(2)[:, None] - 2 * texels @ colours.swapaxes(1, 2)
    indices = distances.argmin(2)
    apart = texels - np.take_along_axis(colours, indices[..., None], 1)
    return indices, (apart**2).sum((1, 2))


def _least_squares(
    codes: np.ndarray, slopes: np.ndarray, indices: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Ends (N, 3) of the weighted least squares for given indices; where these are all alike, as they were."""
    share = WEIGHTS[indices][..., None] / 64
    weight = slopes**2
    a, b, c = ((weight * part).sum(1) for part in ((1 - share) ** 2, share * (1 - share), share**2))
    right_low, right_high = (weight * (1 - share) * codes).sum(1), (weight * share * codes).sum(1)
    determinant = a * c - b * b
    sound = determinant > 1e-9 * a * c
    safe = np.where(sound, determinant, 1.0)
    new_low = np.where(sound, (c * right_low - b * right_high) / safe, low)
    new_high = np.where(sound, (a * right_high - b * right_low) / safe, high)
    return np.clip(new_low, -_MOST, _MOST), np.clip(new_high, -_MOST, _MOST)
