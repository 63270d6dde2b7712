"""BC6H signed: the specification's bits, an independent decoder to the bit, the encoder's laws and its error."""

import numpy as np
import pytest
from refusals import refused

from homofact.containers.bc6h import decode_bc6h, encode_bc6h
from homofact.containers.bc6h_blocks import MODES, WEIGHTS, palette, unpack


def block_bytes(fields):
    """16 bytes of (value, lowest bit) pairs."""
    return sum(value << at for value, at in fields).to_bytes(16, "little")


def wave(side, low, high):
    """A smooth three-channel texture from `low` to `high`: ridges and a lobe, the channels not quite alike."""
    y, x = np.mgrid[:side, :side] / side
    grey = np.sin(3 * x + 1) * np.cos(4 * y) - 2 * np.exp(-((x - 0.5) ** 2 + (y - 0.5) ** 2) * 20)
    grey = (grey - grey.min()) / np.ptp(grey)
    texels = np.stack([grey, grey**1.2, grey + 0.09 * np.sin(5 * x * y)], -1)
    return low + (high - low) * (texels - texels.min()) / np.ptp(texels)


def coded(pixels):
    return decode_bc6h(encode_bc6h(pixels), *pixels.shape[:2]).astype(np.float64)


def patterns(texels):
    """The bits of halves; bcdec gives +0 where the specification's formula sets the sign of a zero."""
    return np.where(texels == 0, np.float16(0), texels).view(np.uint16)


def rms(pixels):
    return float(np.sqrt(((coded(pixels) - pixels) ** 2).mean()))


def test_whole_endpoints_are_where_the_specification_has_them():
    # Mode 3 (Microsoft's 11): R0 at bit 5, G0 15, B0 25, R1 35, G1 45, B1 55, indices from 65, the first of 3 bits.
    ends = {5: 100, 15: 511, 25: 0, 35: -100 & 1023, 45: 1, 55: -511 & 1023}
    indices = [7, 0, 15, 8, *[3] * 12]
    where = [65, *range(68, 128, 4)]
    block = block_bytes([(3, 0), *((value, at) for at, value in ends.items()), *zip(indices, where, strict=True)])
    _, first, second, found = unpack(block)
    assert first.tolist() == [[100, 511, 0]]
    assert second.tolist() == [[-100, 1, -511]]
    assert found.tolist() == [indices]
    # 100 -> (100 * 32768 + 16384) >> 9 = 6432; 511 -> 32767; 1 -> 96; then 31/32 as the bits of a half.
    texels = decode_bc6h(block, 4, 4).view(np.uint16)
    assert texels[0, 1].tolist() == [6432 * 31 >> 5, 0x7BFF, 0]
    assert texels[0, 2].tolist() == [6432 * 31 >> 5 | 0x8000, 96 * 31 >> 5, 0xFBFF]
    # Index 8 takes 34/64 of the second end: (6432 * 30 - 6432 * 34 + 32) >> 6 = -402.
    assert texels[0, 3, 0] == 402 * 31 >> 5 | 0x8000
    # Index 3 takes 13/64 of it, rounded to the nearest: (32767 * 51 + 96 * 13 + 32) >> 6 = 26131.
    assert texels[1, 0, 1] == 26131 * 31 >> 5


@pytest.mark.parametrize(("number", "bits", "delta"), [(7, 11, 9), (11, 12, 8), (15, 16, 4)])
def test_differences_and_high_bits_are_where_the_specification_has_them(number, bits, delta):
    # R0's low 10 bits at 5; the difference at 35; R0's higher bits after it, highest first.
    first, difference = -(2 ** (bits - 2)) - 5, -3
    pattern = first & (2**bits - 1)
    high = [(pattern >> bit & 1, 35 + delta + place) for place, bit in enumerate(range(bits - 1, 9, -1))]
    block = block_bytes([(number, 0), (pattern & 1023, 5), (difference & (2**delta - 1), 35), *high])
    modes, start, end, _ = unpack(block)
    assert MODES[modes[0]].number == number
    assert (start[0, 0], end[0, 0]) == (first, first - 3)
    assert start[0, 1:].tolist() == end[0, 1:].tolist() == [0, 0]


def test_weights_mirror_each_other():
    assert (WEIGHTS + WEIGHTS[::-1] == 64).all()


def test_every_one_region_block_decodes_as_bcdec_has_it():
    imagecodecs = pytest.importorskip("imagecodecs", reason="imagecodecs is missing: pip install homofact[textures]")
    data = np.random.default_rng(0).integers(0, 256, (4096, 16), dtype=np.uint8)
    # Ends that clamp, wrap and differ most, too.
    data[:64, 1:8] = 255
    data[64:128, 1:8] = 0
    data[:, 0] = data[:, 0] & 0xE0 | np.array([3, 7, 11, 15], np.uint8)[np.arange(4096) % 4]
    ours = decode_bc6h(data.tobytes(), 256, 256)
    theirs = imagecodecs.bcn_decode(data.tobytes(), imagecodecs.BCN.FORMAT.BC6HS, shape=(256, 256, 3))
    np.testing.assert_array_equal(patterns(ours), patterns(theirs))
    # Nearly all of it is exact in the signs of zeros, too, and every mode is there.
    assert (ours.view(np.uint16) == theirs.view(np.uint16)).mean() > 0.99
    assert set(unpack(data.tobytes())[0].tolist()) == {0, 1, 2, 3}


@pytest.mark.parametrize("low", [-6, 4, 0, -40000])
def test_what_the_encoder_writes_decodes_as_bcdec_has_it(low):
    imagecodecs = pytest.importorskip("imagecodecs", reason="imagecodecs is missing: pip install homofact[textures]")
    noise = np.random.default_rng(1).normal(0, 1, (16, 24, 3))
    for pixels in (wave(32, low, low + 12), low + 12 * noise, low + 1e-3 * noise, 1e-6 * noise):
        data = encode_bc6h(pixels)
        theirs = imagecodecs.bcn_decode(data, imagecodecs.BCN.FORMAT.BC6HS, shape=pixels.shape)
        ours = decode_bc6h(data, *pixels.shape[:2])
        np.testing.assert_array_equal(patterns(ours), patterns(theirs))
        assert np.isfinite(ours).all()


def test_a_block_of_one_colour_is_exact_and_in_its_place():
    bits = np.random.default_rng(2).integers(0, 0x7C00, (16, 16, 3)).astype(np.uint16)
    bits |= np.random.default_rng(3).integers(0, 2, bits.shape).astype(np.uint16) << 15
    bits[0, :4] = [[0, 0x8000, 1], [0x8001, 0x3FF, 0x400], [0x7BFF, 0xFBFF, 0x3C00], [0x7BFF, 0, 0x8001]]
    colours = bits.view(np.float16)
    pixels = colours.repeat(4, 0).repeat(4, 1).astype(np.float64)
    np.testing.assert_array_equal(coded(pixels), pixels)


def test_sixteen_colours_on_a_line_come_back():
    # Evenly spaced in one power of two and across ends that 12 bits hold: off by rounding of the weights alone.
    steps = np.linspace(0, 1, 16).reshape(4, 4, 1)
    low, high = np.array([1.0, 1.25, 1.5]), np.array([1.25, 1.125, 1.75])
    pixels = low + steps * (high - low)
    assert np.abs(coded(pixels) - pixels).max() < 0.01


def test_no_other_index_and_no_step_of_one_end_is_better():
    pixels = np.concatenate([wave(16, 4, 16), wave(16, -6, 6), np.random.default_rng(4).normal(0, 3, (16, 16, 3))])
    blocks = pixels.reshape(-1, 4, 4, 4, 3).swapaxes(1, 2).reshape(-1, 16, 3)
    modes, first, second, indices = unpack(encode_bc6h(pixels))
    bits = np.array([mode.bits for mode in MODES])[modes]
    reach = np.array([mode.reach for mode in MODES])[modes]

    def best(start, end):
        colours = palette(start, end, bits).astype(np.float64)
        return ((blocks[:, :, None] - colours[:, None]) ** 2).sum(3)

    distances = best(first, second)
    chosen = np.take_along_axis(distances, indices[..., None], 2)[..., 0]
    np.testing.assert_allclose(chosen, distances.min(2), rtol=1e-9, atol=1e-9)
    least = chosen.sum(1)
    assert (indices[:, 0] < 8).all()
    assert (np.abs(first - second) <= reach[:, None]).all()
    for end, channel, step in np.ndindex(2, 3, 2):
        ends = [first.copy(), second.copy()]
        ends[end][:, channel] += 2 * step - 1
        legal = (np.abs(ends[0] - ends[1]) <= reach[:, None]).all(1)
        legal &= np.abs(ends[end][:, channel]) < 2 ** (bits - 1)
        assert (best(*ends).min(2).sum(1) >= least - 1e-9)[legal].all()


def test_the_error_that_the_head_of_the_module_states():
    # On one side of zero half a percent of the range; through zero more than twice that: hence the advice to shift.
    for low, high in ((4, 16), (0.5, 12.5), (-16, -4), (1, 2), (0, 1)):
        assert rms(wave(32, low, high)) < 0.0052 * (high - low), (low, high)
    assert 0.0104 * 12 < rms(wave(32, -6, 6)) < 0.012 * 12
    # Smoother blocks lie nearer to their segments.
    assert rms(wave(128, 4, 16)) < 0.4 * rms(wave(32, 4, 16))


def test_ends_close_together_get_their_bits():
    # Within one power of two a quantum is 1/16.5 with 10 bits, 1/66 with 12: the modes with differences pay.
    pixels = wave(32, 1, 2)
    used = {MODES[mode].number for mode in unpack(encode_bc6h(pixels))[0]}
    assert 11 in used
    assert rms(pixels) < 0.0055
    # 16 bits for ends at most 7 quanta apart: single halves, which no quantum of 12 bits fits in all channels.
    near = 1 + (np.arange(16).reshape(4, 4, 1) % 4 + np.array([3, 9, 14])) * 2.0**-10
    assert {MODES[mode].number for mode in unpack(encode_bc6h(near))[0]} == {15}
    np.testing.assert_array_equal(coded(near), near)


def test_the_encoder_knows_no_dice_and_no_neighbours():
    pixels = wave(32, -3, 9)
    whole = encode_bc6h(pixels)
    assert encode_bc6h(pixels) == whole
    assert encode_bc6h(pixels[4:8, 8:12]) == whole[16 * (8 + 2) : 16 * (8 + 3)]


@pytest.mark.parametrize("shape", [(1, 16, 3), (16, 6, 3), (0, 4, 3)])
def test_sides_that_are_no_multiples_of_4(shape):
    with refused(f"t: {shape[1]} x {shape[0]} texels, expected sides that are multiples of 4"):
        encode_bc6h(np.zeros(shape), "t")
    with refused(where="BC6H"):
        decode_bc6h(b"", *shape[:2])


def test_pixels_that_cannot_be_stored():
    with refused(where="BC6H", found="pixels of shape (4, 4, 4)"):
        encode_bc6h(np.zeros((4, 4, 4)))
    for value in (np.nan, np.inf, 65505.0):
        pixels = np.zeros((4, 8, 3))
        pixels[3, 5, 1] = value
        with refused(f"row 3, column 5, channel 1 is {value:g}, expected finite values"):
            encode_bc6h(pixels)


def test_blocks_that_cannot_be_read():
    with refused(where="BC6H", found="15 bytes for 4 x 4 texels"):
        decode_bc6h(bytes(15), 4, 4)
    fine = encode_bc6h(np.ones((4, 4, 3)))
    for low, bits in ((0, "00000"), (1, "00001"), (2, "00010"), (19, "10011")):
        with refused(f"t: block 1 has mode bits {bits}, expected one region"):
            decode_bc6h(fine + bytes([low, *[0] * 15]), 4, 8, "t")
