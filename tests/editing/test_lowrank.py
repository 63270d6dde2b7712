"""Transports at low rank: what is kept in 16 bits, how many numbers a pixel needs, and what is exact."""

import numpy as np
import pytest
import torch
from editing.scenes import relative

from homofact.editing.basis import basis_of, product_of, trial_edits
from homofact.editing.block_floats import BlockFloats
from homofact.editing.lowrank import LowRank
from homofact.editing.transport import FullTransport
from homofact.editing.wavelets import transformed

PIXELS, BANDS = 500, (64, 32)


def test_numbers_in_16_bits_keep_the_digits_of_dark_rows_and_small_columns() -> None:
    generator = np.random.default_rng(0)
    values = generator.standard_normal((5000, 3, 20))
    values *= 10.0 ** generator.uniform(-4, 4, (5000, 3, 1)) * 10.0 ** -np.linspace(0, 6, 20)
    values[7, 1] = values[..., 4] = 0
    kept = BlockFloats.of(values)
    sizes = np.sqrt((values**2).mean((0, 1)))
    largest = np.abs(values / np.where(sizes > 0, sizes, 1)).max(2, keepdims=True) * sizes
    assert (np.abs(kept.values() - values) <= largest / 32767 * 0.51).all()
    assert kept.nbytes < 0.6 * values.astype(np.float32).nbytes
    # Sums of the codes as they are, a vector a channel; a part of the rows; one vector for all.
    vectors = generator.standard_normal((3, 20)) / np.where(sizes > 0, sizes, 1)
    exact = np.einsum("pcr,cr->pc", kept.values().astype(np.float64), vectors)
    assert np.abs(kept.times(vectors) - exact).max() < 1e-5 * np.abs(exact).max()
    shared = BlockFloats.of(values[:, :1])
    exact = shared.values()[:, 0].astype(np.float64) @ vectors.T
    assert np.abs(shared.times(vectors) - exact).max() < 1e-5 * np.abs(exact).max()
    some = np.array([3, 4999, 7])
    assert np.array_equal(kept.values(some), kept.values()[some])


def curves() -> list[torch.Tensor]:
    """A lobe that ends in nothing, not alike in the channels, and a slow rise."""
    gamma, slow = torch.linspace(0, 1, BANDS[0]).double(), torch.linspace(1, 3, BANDS[1]).double()
    lobe = torch.stack([torch.exp(-((gamma / width) ** 2)) for width in (0.4, 0.5, 0.8)], 1)
    return [lobe, slow[:, None].expand(-1, 3).contiguous()]


def bands_of_pixels() -> np.ndarray:
    """(P, 3, J·K): a highlight that wanders over both angles, over an even ground."""
    place = np.random.default_rng(1).uniform(0, 1, (PIXELS, 2))
    parts = [np.exp(-(((np.linspace(0, 1, n) - place[:, k, None]) / 0.35) ** 2)) for k, n in enumerate(BANDS)]
    table = np.einsum("pj,pk->pjk", *parts).reshape(PIXELS, 1, -1)
    return 0.05 + table * np.array([1.0, 0.7, 0.3])[:, None]


def low_rank(tolerance: float) -> tuple[LowRank, FullTransport, float]:
    """(at low rank, in full, the worst trial edit's error as it is said)."""
    bands = bands_of_pixels()
    channels = np.arange(PIXELS) % 3
    basis = basis_of(bands[np.arange(PIXELS), channels], channels, curves(), tolerance)
    full = FullTransport(bands.reshape(PIXELS, 3, *BANDS).astype(np.float32), 2)
    outward = BlockFloats.of(basis.outward[:, None])
    kept = BlockFloats.of(basis.coefficients(bands))
    return LowRank(kept, outward, basis.scale, BANDS, np.arange(PIXELS), full), full, basis.reached


def test_the_start_is_exact_and_so_is_a_curve_that_changes_everywhere_alike() -> None:
    kept, full, reached = low_rank(0.3)
    assert reached > 1e-3
    own = curves()
    tinted = [own[0] * torch.tensor([3.0, 0.5, 0.1], dtype=torch.float64), own[1]]
    for each in (own, tinted):
        assert relative(kept.picture(each), full.picture(each)) < 3e-5
        assert kept.error(each) < 3e-5


def test_as_few_numbers_as_the_tolerance_asks_for() -> None:
    ranks = []
    for tolerance in (0.1, 0.02):
        kept, full, reached = low_rank(tolerance)
        assert 0.01 * tolerance < reached <= tolerance
        errors = [relative(kept.picture(each), full.picture(each)) for each in trial_edits(curves())]
        assert max(errors) <= 1.2 * tolerance
        assert kept.error(trial_edits(curves())[1]) == pytest.approx(errors[1], rel=0.05, abs=1e-5)
        ranks.append(kept.rank)
    assert ranks[0] < 0.7 * ranks[1] < 0.7 * PIXELS


def test_what_no_pixel_tells_of_the_others_is_not_said_to_be_known() -> None:
    """Pixels that have nothing to do with each other: every one that is known is exact, the others are not."""
    noise = np.random.default_rng(2).exponential(1.0, (60, 64 * 32)) ** 4
    assert basis_of(noise, np.zeros(60, np.int64), curves()).reached > 0.03


def test_trial_edits_change_one_curve_each() -> None:
    own = curves()
    start = product_of(own)
    for each in trial_edits(own):
        assert sum(not torch.equal(a, b) for a, b in zip(own, each, strict=True)) == 1
        assert not np.allclose(product_of(each), start, rtol=0.2)
        assert product_of(each).shape == start.shape


def test_wavelets_of_the_few_are_those_of_every_pixel() -> None:
    kept, full, _ = low_rank(3e-3)
    for form in (kept, full):
        for active in (0, 1):
            expected = transformed(form.frozen(active, curves())).permute(1, 2, 0)
            assert relative(form.wavelets(active, curves()), expected) < 3e-6


def test_pixels_without_light_and_fewer_pixels_than_trials() -> None:
    for count, light in ((40, 0.0), (3, 1.0), (1, 1.0)):
        block = light * bands_of_pixels()[:count]
        basis = basis_of(block.reshape(3 * count, -1), np.arange(3 * count) % 3, curves())
        assert np.isfinite(basis.outward).all()
        kept = BlockFloats.of(basis.coefficients(block)).values() @ basis.outward
        assert np.isfinite(kept).all()
        picture = (kept * (product_of(curves()) / basis.scale)).sum(2)
        assert np.abs(picture - (block * product_of(curves())).sum(2)).max() <= 1e-4 * max(picture.max(), 1e-300)
