"""Compiled loops of precomputed transport: the vectors of a vertex and the choice of stored coefficients.

All loops use float32 and release the GIL, so that threads process blocks in parallel.
"""

import math

import numpy as np

from homofact.linear.kernels import kernel
from homofact.relighting.haar import transform_faces

_NO_BITS = np.int32(0x7FFFFFFF)
_LARGEST = np.float32(32767.0)
# Steps of a stored number in the largest coefficient that is left out: finer ones would cost bytes for nothing.
STEPS = np.float32(4.0)


@kernel(nogil=True, inline="always")
def place(x: float, y: float, z: float, size: int) -> tuple:
    """Return the corner texel and the weights of the bilinear lookup of a direction in a parabolic map."""
    below = np.float32(1.0) + max(z, np.float32(0.0))
    half = np.float32(0.5) * size
    u = min(max(x / below * half + half - np.float32(0.5), np.float32(0.0)), np.float32(size - 1))
    v = min(max(y / below * half + half - np.float32(0.5), np.float32(0.0)), np.float32(size - 1))
    i, j = min(int(u), size - 2), min(int(v), size - 2)
    return i, j, u - np.float32(i), v - np.float32(j)


@kernel(nogil=True, fastmath=True)
def transport_vectors(
    frame: np.ndarray,
    lit: np.ndarray,
    directions: np.ndarray,
    angles: np.ndarray,
    light_maps: np.ndarray,
    with_cosine: bool,
    out: np.ndarray,
    scratch: np.ndarray,
) -> None:
    """T_k (K, 6·n²) of one vertex into `out`: g_k(ωi) V cosθi dω at every texel, and their Haar transforms.

    `frame` (3, 3) rows tangent, binormal, normal; `lit` (6·n²) the visible share of each texel; `directions` (6·n², 3),
    `angles` (6·n²) steradians; `light_maps` (M, M, K), `with_cosine` if cosθi is in them; `scratch` (n, n).
    """
    terms = light_maps.shape[2]
    size = light_maps.shape[0]
    side = scratch.shape[0]
    for j in range(len(lit)):
        x, y, z = directions[j, 0], directions[j, 1], directions[j, 2]
        cosine = frame[2, 0] * x + frame[2, 1] * y + frame[2, 2] * z
        if cosine <= 0 or lit[j] == 0:
            for k in range(terms):
                out[k, j] = 0
            continue
        a = frame[0, 0] * x + frame[0, 1] * y + frame[0, 2] * z
        b = frame[1, 0] * x + frame[1, 1] * y + frame[1, 2] * z
        p, q, s, t = place(a, b, cosine, size)
        w = lit[j] * (np.float32(1.0) if with_cosine else cosine) * angles[j]
        w00, w01 = w * (1 - s) * (1 - t), w * (1 - s) * t
        w10, w11 = w * s * (1 - t), w * s * t
        for k in range(terms):
            out[k, j] = (
                w00 * light_maps[p, q, k]
                + w01 * light_maps[p, q + 1, k]
                + w10 * light_maps[p + 1, q, k]
                + w11 * light_maps[p + 1, q + 1, k]
            )
    for k in range(terms):
        transform_faces(out[k].reshape(6, side, side), scratch)


@kernel(nogil=True)
def threshold_of(values: np.ndarray, kept: int) -> np.int32:
    """The bits of the `kept`-th largest magnitude of a flat float32 array; magnitudes order as their bits do.

    This is a radix select: three histograms, of the top 11 bits and of twice 10 lower bits, replace a sort.
    """
    bits = values.view(np.int32)
    counts = np.zeros(2048, np.int32)
    for each in bits:
        counts[(each & _NO_BITS) >> 20] += 1
    left, top = kept, 2047
    while top > 0 and counts[top] < left:
        left -= counts[top]
        top -= 1
    second = np.zeros(1024, np.int32)
    for each in bits:
        magnitude = each & _NO_BITS
        if magnitude >> 20 == top:
            second[(magnitude >> 10) & 1023] += 1
    middle = 1023
    while middle > 0 and second[middle] < left:
        left -= second[middle]
        middle -= 1
    third = np.zeros(1024, np.int32)
    for each in bits:
        magnitude = each & _NO_BITS
        if magnitude >> 10 == (top << 10 | middle):
            third[magnitude & 1023] += 1
    low = 1023
    while low > 0 and third[low] < left:
        left -= third[low]
        low -= 1
    return np.int32((top << 20) | (middle << 10) | low)


@kernel(nogil=True)
def threshold_of_energy(values: np.ndarray, weights: np.ndarray, tolerance: float) -> float:
    """The largest t for which the weighted squares below t sum to at most tolerance² of all, of (K, J) values.

    The squares are summed in 2,048 bins, each 2^(1/4) times as large as the one before. Only whole bins are dropped, so
    that the dropped sum stays within the bound.
    """
    counts = np.zeros(2048)
    total = 0.0
    for k in range(values.shape[0]):
        for each in values[k]:
            if each != 0:
                square = weights[k] * weights[k] * each * each
                total += square
                step = min(max(int(np.floor(4 * math.log2(square))) + 1024, 0), 2047)
                counts[step] += square
    allowed, step, gone = tolerance * tolerance * total, 0, 0.0
    while step < 2048 and gone + counts[step] <= allowed:
        gone += counts[step]
        step += 1
    return 2.0 ** ((step - 1024) / 4)


@kernel(nogil=True, fastmath=True)
def binned(
    values: np.ndarray,
    weights: np.ndarray,
    group: np.ndarray,
    light: np.ndarray,
    view: np.ndarray,
    counts: np.ndarray,
    squares: np.ndarray,
    sent: np.ndarray,
) -> None:
    """Count (K, J) coefficients and sum their light, by bins of `threshold_of_energy` and groups of terms.

    Adds their number to `counts` and their weighted squares to `squares`, both (G, 2048). Adds the light that they send
    to an eye with view values (K, C) to `sent` (G, 2048, L·C), under the L lights of `light` (J, L·C). `group` (K,) is
    the group of each term, below G.
    """
    channels = view.shape[1]
    for k in range(values.shape[0]):
        g = group[k]
        for j in range(values.shape[1]):
            each = values[k, j]
            if each == 0:
                continue
            square = weights[k] * weights[k] * each * each
            step = min(max(int(np.floor(4 * math.log2(square))) + 1024, 0), 2047)
            counts[g, step] += 1
            squares[g, step] += square
            for c in range(light.shape[1]):
                sent[g, step, c] += each * view[k, c % channels] * light[j, c]


@kernel(nogil=True)
def keep_largest(values: np.ndarray, kept: int, index: np.ndarray, number: np.ndarray) -> tuple:
    """Store the `kept` largest coefficients of a vector (J,) as indices and int16; return (count, scale).

    Of equal coefficients at the threshold, the first are kept. Coefficients that would round to 0 are dropped. The
    scale is the largest dropped coefficient divided by `STEPS`, so that rounding changes no coefficient by more than an
    eighth of it. If the largest coefficient divided by 32767 is larger, it is the scale instead.
    """
    bits = values.view(np.int32)
    threshold = threshold_of(values, kept)
    above, equal = 0, 0
    largest, left_out, tied = np.float32(0.0), np.float32(0.0), np.float32(0.0)
    for j in range(len(values)):
        magnitude = bits[j] & _NO_BITS
        size = abs(values[j])
        if magnitude > threshold:
            above += 1
        elif magnitude < threshold:
            left_out = max(left_out, size)
        else:
            equal += 1
            tied = size
        largest = max(largest, size)
    if largest == 0:
        return 0, 0.0
    ties, count = kept - above, 0
    if equal > ties:
        left_out = tied
    scale = max(largest / _LARGEST, left_out / STEPS)
    for j in range(len(values)):
        magnitude = bits[j] & _NO_BITS
        if magnitude < threshold or magnitude == 0:
            continue
        if magnitude == threshold:
            if ties == 0:
                continue
            ties -= 1
        rounded = np.int16(round(values[j] / scale))
        if rounded != 0:
            index[count] = j
            number[count] = rounded
            count += 1
    return count, scale


@kernel(nogil=True)
def keep_above(values: np.ndarray, weight: float, square: float, index: np.ndarray, number: np.ndarray) -> tuple:
    """Store, as `keep_largest` does, all coefficients whose weighted square is at least `square`."""
    count = 0
    largest, left_out = np.float32(0.0), np.float32(0.0)
    for each in values:
        size = abs(each)
        largest = max(largest, size)
        if weight * weight * each * each < square:
            left_out = max(left_out, size)
    if largest == 0:
        return 0, 0.0
    scale = max(largest / _LARGEST, left_out / STEPS)
    for j in range(len(values)):
        if weight * weight * values[j] * values[j] >= square:
            rounded = np.int16(round(values[j] / scale))
            if rounded != 0:
                index[count] = j
                number[count] = rounded
                count += 1
    return count, scale
