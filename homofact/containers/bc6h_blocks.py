"""The bits of BC6H signed blocks with one region, and the halves that they decode to.

After the Khronos Data Format Specification, "BPTC Compressed Texture Image Formats" (BC6H); BC6H is bit-exact:
every decoder gives these halves. A block of 4 × 4 texels has 128 bits, little-endian. With one region they are

    0–4     mode: 3, 7, 11 or 15 (Microsoft's modes 11 to 14)
    5–34    the low 10 bits of the first endpoint, red, green, blue
    35–64   for each channel 10 bits: the second endpoint, or its difference to the first, in D bits; then the
            first endpoint's bits above the tenth, highest first
    65–127  16 indices of 4 bits, row by row; the first lacks its highest bit, which is 0

Endpoints are signed integers of E bits. Decoding expands them to 16 bits, and interpolates 16 colours between them in
integer arithmetic. 31/32 of each result, as sign and magnitude, is the bit pattern of a half. Interpolation is
therefore linear in the bit patterns of halves. In values, it is linear between two neighbouring powers of two, and
geometric across several. Through zero, it passes all powers of two twice.
"""

from dataclasses import dataclass

import numpy as np

from homofact.errors import BadInput

# Of the 64ths that an index takes of the second endpoint; weight 15 − k is 64 less weight k.
WEIGHTS = np.array([0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64])


@dataclass(frozen=True)
class Mode:
    """One block mode: its number, the bits E of an endpoint, and the bits D of a difference (None: two endpoints)."""

    number: int
    bits: int
    delta: int | None

    @property
    def reach(self) -> int:
        """The largest difference of the endpoints, of either sign, that the mode can store."""
        return 2**self.bits if self.delta is None else 2 ** (self.delta - 1) - 1


MODES = (Mode(3, 10, None), Mode(7, 11, 9), Mode(11, 12, 8), Mode(15, 16, 4))


def spread(endpoints: np.ndarray, bits: np.ndarray) -> np.ndarray:
    """Expand signed endpoints of `bits` bits to 16-bit integers, −32767 to 32767 ("unquantization")."""
    magnitude = np.abs(endpoints)
    middle = ((magnitude << 15) + 0x4000) >> (bits - 1)
    most = (1 << (bits - 1)) - 1
    wide = np.where(magnitude == 0, 0, np.where(magnitude >= most, 0x7FFF, middle))
    return np.where(bits >= 16, endpoints, np.sign(endpoints) * wide)


def palette(first: np.ndarray, second: np.ndarray, bits: np.ndarray) -> np.ndarray:
    """Return the 16 colours float16 (N, 16, 3) of blocks with these endpoints (N, 3) of `bits` (N,) bits."""
    wide = bits[:, None]
    low, high = spread(first, wide)[:, None], spread(second, wide)[:, None]
    weights = WEIGHTS[:, None]
    return halves((low * (64 - weights) + high * weights + 32) >> 6)


def halves(codes: np.ndarray) -> np.ndarray:
    """Return float16 values from interpolated 16-bit integers: the last step of decoding."""
    patterns = (np.abs(codes) * 31 >> 5) | np.where(codes < 0, 0x8000, 0)
    return patterns.astype(np.uint16).view(np.float16)


def pack(modes: np.ndarray, first: np.ndarray, second: np.ndarray, indices: np.ndarray) -> bytes:
    """Pack N blocks into 16 N bytes: modes (N,) (positions in MODES), endpoints (N, 3) and indices (N, 16).

    The first index of every block must be below 8, and the endpoints' difference within the mode's reach.
    """
    bits = np.zeros((len(modes), 128), np.uint8)
    _put(bits, 0, 5, np.array([mode.number for mode in MODES])[modes])
    for position, mode in enumerate(MODES):
        chosen = np.flatnonzero(modes == position)
        rows = bits[chosen]
        width = 10 if mode.delta is None else mode.delta
        for c in range(3):
            start, end = first[chosen, c], second[chosen, c]
            _put(rows, 5 + 10 * c, 10, start)
            _put(rows, 35 + 10 * c, width, end if mode.delta is None else end - start)
            for place, bit in enumerate(range(mode.bits - 1, 9, -1)):
                rows[:, 35 + 10 * c + width + place] = start >> bit & 1
        bits[chosen] = rows
    _put(bits, 65, 3, indices[:, 0])
    for texel in range(1, 16):
        _put(bits, 64 + 4 * texel, 4, indices[:, texel])
    return np.packbits(bits, axis=1, bitorder="little").tobytes()


def unpack(data: bytes, name: str = "BC6H") -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return (modes, first, second, indices) of blocks, as `pack` takes them.

    Raises BadInput for a block of another mode (two regions, or reserved); `name` is for messages.
    """
    bits = np.unpackbits(np.frombuffer(data, np.uint8).reshape(-1, 16), axis=1, bitorder="little")
    numbers = _take(bits, 0, 5)
    modes = np.full(len(bits), -1)
    first, second = np.zeros((2, len(bits), 3), np.int64)
    for position, mode in enumerate(MODES):
        chosen = np.flatnonzero(numbers == mode.number)
        modes[chosen] = position
        rows = bits[chosen]
        width = 10 if mode.delta is None else mode.delta
        for c in range(3):
            start, end = _take(rows, 5 + 10 * c, 10), _take(rows, 35 + 10 * c, width)
            for place, bit in enumerate(range(mode.bits - 1, 9, -1)):
                start |= rows[:, 35 + 10 * c + width + place].astype(np.int64) << bit
            start = _signed(start, mode.bits)
            first[chosen, c] = start
            # The sum wraps at the endpoint's own bits.
            second[chosen, c] = _signed(end if mode.delta is None else start + _signed(end, width), mode.bits)
    if (modes < 0).any():
        at = int(np.argmax(modes < 0))
        wanted = ", ".join(str(mode.number) for mode in MODES)
        what = f"block {at} has mode bits {numbers[at]:05b}"
        raise BadInput(what, where=name, expected=f"one region (mode {wanted})")
    anchor = _take(bits, 65, 3)[:, None]
    return modes, first, second, np.hstack([anchor, *(_take(bits, 64 + 4 * t, 4)[:, None] for t in range(1, 16))])


def _put(bits: np.ndarray, at: int, width: int, values: np.ndarray) -> None:
    bits[:, at : at + width] = values[:, None] >> np.arange(width) & 1


def _take(bits: np.ndarray, at: int, width: int) -> np.ndarray:
    return (bits[:, at : at + width].astype(np.int64) << np.arange(width)).sum(1)


def _signed(values: np.ndarray, bits: int) -> np.ndarray:
    wrapped = values & ((1 << bits) - 1)
    return np.where(wrapped >> (bits - 1), wrapped - (1 << bits), wrapped)
