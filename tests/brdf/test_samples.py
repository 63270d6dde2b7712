"""Samples: every refusal, the split, the azimuth copies."""

import math

import pytest
import torch
from refusals import refused
from torch import Tensor

from homofact.brdf.analytic import Lambert, Phong
from homofact.brdf.samples import Samples
from homofact.geometry.coordinates import coordinate_system
from homofact.geometry.directions import draw_uniform, to_spherical

N = 60


def make(seed: int = 0, isotropic: bool = True, weights: Tensor | None = None) -> Samples:
    wi, wo = draw_uniform(N, torch.Generator().manual_seed(seed))
    values = Phong((0.1, 0.2, 0.3), (0.5, 0.5, 0.5), 20).evaluate(wi, wo)
    return Samples(wi, wo, values, channels=("R", "G", "B"), isotropic=isotropic, weights=weights)


def parts() -> dict[str, Tensor]:
    samples = make()
    return {"wi": samples.wi, "wo": samples.wo, "values": samples.values, "weights": samples.weights}


def build(**changed: Tensor) -> Samples:
    given = parts() | changed
    return Samples(
        given["wi"], given["wo"], given["values"], given["weights"], channels=("R", "G", "B"), isotropic=True
    )


def with_entry(tensor: Tensor, row: int, value: float | tuple[float, float, float]) -> Tensor:
    changed = tensor.clone()
    if tensor.ndim == 1 or isinstance(value, tuple):
        changed[row] = torch.tensor(value, dtype=tensor.dtype)
    else:
        changed[row, -1] = value
    return changed


def test_make_converts_to_float64_and_weighs_alike() -> None:
    samples = make()
    again = Samples(
        samples.wi.float() / samples.wi.float().norm(dim=1, keepdim=True),
        samples.wo,
        samples.values.float(),
        channels=("R", "G", "B"),
        isotropic=False,
    )
    assert again.wi.dtype == again.values.dtype == again.weights.dtype == torch.float64
    assert torch.equal(again.weights, torch.ones(N, dtype=torch.float64))
    assert not again.isotropic
    assert len(again) == N


@pytest.mark.parametrize("name", ["wi", "wo", "values", "weights"])
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_not_finite_is_refused(name: str, bad: float) -> None:
    with refused(f"samples: {name} at row 7 is not finite, expected finite"):
        build(**{name: with_entry(parts()[name], 7, bad)})


def test_values_beyond_what_a_fit_can_hold_are_refused() -> None:
    values = torch.full((4, 1), 5e-324, dtype=torch.float64)
    values[::2] = 1e308
    up = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64).expand(4, 3)
    with refused(where="samples", found="values at row 0 are up to 1e+308"):
        Samples(up, up, values)


@pytest.mark.parametrize("name", ["values", "weights"])
def test_negative_is_refused(name: str) -> None:
    with refused(f"samples: {name} at row 3 is negative, expected >= 0"):
        build(**{name: with_entry(parts()[name], 3, -1e-9)})


@pytest.mark.parametrize("name", ["wi", "wo"])
def test_under_the_horizon_is_refused(name: str) -> None:
    with refused(f"{name} at row 5 has z = -0.6, under the horizon, expected z >= 0"):
        build(**{name: with_entry(parts()[name], 5, (0.8, 0.0, -0.6))})


@pytest.mark.parametrize("name", ["wi", "wo"])
def test_other_lengths_are_refused(name: str) -> None:
    with refused(f"{name} at row 2 has length 1.1, expected a unit vector"):
        build(**{name: with_entry(parts()[name], 2, (0.0, 0.0, 1.1))})


@pytest.mark.parametrize(
    ("name", "shape"), [("wo", (N - 1, 3)), ("wi", (N, 2)), ("values", (N, 2)), ("weights", (N, 1))]
)
def test_wrong_shapes_are_refused(name: str, shape: tuple[int, ...]) -> None:
    with refused(rf"samples: {name} has shape \({shape[0]}, {shape[1]}\), expected"):
        build(**{name: torch.zeros(shape, dtype=torch.float64)})


def test_none_left_is_refused() -> None:
    samples = make()
    with refused(where="samples"):
        samples.select(samples.values[:, 0] > 1e9)


def test_unknown_channel_lists_the_channels() -> None:
    assert torch.equal(make().channel("G").values, make().values[:, 1:2])
    with refused(where="channel", found="'X'"):
        make().channel("X")


def rows(samples: Samples) -> set[tuple[float, ...]]:
    return {tuple(row) for row in torch.cat((samples.wi, samples.wo), 1).tolist()}


def test_split_is_a_partition_by_seed() -> None:
    samples = make()
    train, held = samples.split(0.2, seed=1)
    assert (len(train), len(held)) == (48, 12)
    assert rows(train) | rows(held) == rows(samples)
    assert not rows(train) & rows(held)
    assert rows(samples.split(0.2, seed=1)[1]) == rows(held)
    assert rows(samples.split(0.2, seed=2)[1]) != rows(held)


@pytest.mark.parametrize("fraction", [0.0, 1.0, -0.5, math.nan])
def test_impossible_fractions_are_refused(fraction: float) -> None:
    with refused(where="held-out fraction"):
        make().split(fraction, seed=0)


def test_too_few_to_split_is_refused() -> None:
    with refused(where="samples"):
        make().select(torch.arange(2)).split(0.2, seed=0)


def test_split_before_copies_keeps_held_out_configurations_out() -> None:
    train, held = make().split(0.2, seed=0)
    copies = train.azimuth_copies(4, seed=0)
    system = coordinate_system("isotropic-in-out")
    distance = torch.cdist(system.evaluate(copies.wi, copies.wo), system.evaluate(held.wi, held.wo))
    assert float(distance.min()) > 1e-6


def test_subset_keeps_order_and_stops_at_all() -> None:
    samples = make()
    some = samples.subset(10, seed=4)
    assert len(some) == 10
    place = [samples.wi.tolist().index(row) for row in some.wi.tolist()]
    assert place == sorted(place)
    assert samples.subset(1000, seed=4) is samples


@pytest.mark.parametrize("mirrored", [True, False])
def test_azimuth_copies_keep_weight_values_and_angles(mirrored: bool) -> None:
    weights = torch.rand(N, dtype=torch.float64, generator=torch.Generator().manual_seed(9)) + 0.1
    samples = make(weights=weights)
    copies = samples.azimuth_copies(5, seed=1, mirrored=mirrored)
    factor = 10 if mirrored else 5
    assert len(copies) == factor * N
    assert float(copies.weights.sum()) == pytest.approx(float(samples.weights.sum()), rel=1e-12)
    assert torch.equal(copies.values, samples.values.repeat(factor, 1))
    system = coordinate_system("isotropic-in-out")
    before, after = system.evaluate(samples.wi, samples.wo), system.evaluate(copies.wi, copies.wo)
    assert torch.allclose(after, before.repeat(factor, 1), atol=1e-7, rtol=0)
    # A model sees what the measurement says: the values are right where the copies stand.
    model = Phong((0.1, 0.2, 0.3), (0.5, 0.5, 0.5), 20)
    assert torch.allclose(model.evaluate(copies.wi, copies.wo), copies.values, atol=1e-12)


def signed_turn(samples: Samples) -> Tensor:
    """φi − φo in (−π, π]: its sign is what mirroring changes."""
    turn = to_spherical(samples.wi)[1] - to_spherical(samples.wo)[1]
    return torch.remainder(turn + math.pi, 2 * math.pi) - math.pi


def test_copies_are_stratified_and_the_second_half_mirrored() -> None:
    samples = make()
    copies = samples.azimuth_copies(4, seed=1)
    turn = signed_turn(copies).reshape(8, N)
    assert torch.allclose(turn[:4], signed_turn(samples).expand(4, N), atol=1e-9)
    assert torch.allclose(turn[4:], -signed_turn(samples).expand(4, N), atol=1e-9)
    before, after = to_spherical(samples.wi)[1], to_spherical(copies.wi)[1].reshape(8, N)
    angle = torch.remainder(after[:4] - before, 2 * math.pi)
    assert torch.equal((angle / (math.pi / 2)).floor(), torch.arange(4.0).double()[:, None].expand(4, N))


def test_random_rotation_keeps_the_configuration_and_mirrors_about_half() -> None:
    samples = make()
    turned = samples.rotated_at_random(3)
    system = coordinate_system("isotropic-in-out")
    before, after = system.evaluate(samples.wi, samples.wo), system.evaluate(turned.wi, turned.wo)
    assert torch.allclose(after, before, atol=1e-7, rtol=0)
    assert not torch.allclose(turned.wi, samples.wi, atol=0.1)
    flipped = int((signed_turn(samples) * signed_turn(turned) < 0).sum())
    assert 15 < flipped < 45
    assert torch.equal(samples.rotated_at_random(3).wi, turned.wi)


def test_anisotropic_samples_are_never_turned() -> None:
    samples = make(isotropic=False)
    assert samples.rotated_at_random(0) is samples
    with refused(where="azimuth copies"):
        samples.azimuth_copies(4, seed=0)


def test_turning_by_a_known_angle() -> None:
    w = torch.tensor([[1.0, 0.0, 0.0], [0.6, 0.0, 0.8]], dtype=torch.float64)
    values = Lambert((1.0,), channels=("Y",)).evaluate(w, w)
    samples = Samples(w, w, values, channels=("Y",), isotropic=True)
    turned = samples.turned(torch.full((2,), math.pi / 2, dtype=torch.float64))
    expected = torch.tensor([[0.0, 1.0, 0.0], [0.0, 0.6, 0.8]], dtype=torch.float64)
    assert torch.allclose(turned.wi, expected, atol=1e-15)


@pytest.mark.parametrize(("most", "expected"), [(3 * N, 2 * N), (N, N), (1, N), (100 * N, 16 * N)])
def test_copies_stay_under_the_limit_and_keep_the_weight(most: int, expected: int) -> None:
    samples = make()
    copies = samples.azimuth_copies(8, seed=1, most=most)
    assert len(copies) == expected
    assert float(copies.weights.sum()) == pytest.approx(float(samples.weights.sum()), rel=1e-12)
    assert torch.equal(copies.values, samples.values.repeat(expected // N, 1))
    turn = to_spherical(copies.wi)[1] - to_spherical(samples.wi)[1].repeat(expected // N)
    assert float(turn.std()) > 0.5


def test_a_mirrored_pair_has_its_azimuth_the_other_way_round_before_it_is_turned() -> None:
    """y goes to −y, then the turn: φ becomes angle − φ, where without the mirror it is angle + φ."""
    up = torch.tensor([[0.6, 0.0, 0.8], [0.0, 0.6, 0.8]], dtype=torch.float64)
    samples = Samples(up, up.flip(0), torch.ones(2, 1), channels=("Y",), isotropic=True)
    angles = torch.full((2,), 0.3, dtype=torch.float64)
    for mirrored, sign in ((torch.zeros(2, dtype=torch.bool), 1), (torch.ones(2, dtype=torch.bool), -1)):
        moved = samples.turned(angles, mirrored)
        for before, after in ((samples.wi, moved.wi), (samples.wo, moved.wo)):
            phi = torch.atan2(before[:, 1], before[:, 0])
            expected = torch.stack((0.6 * torch.cos(0.3 + sign * phi), 0.6 * torch.sin(0.3 + sign * phi)), 1)
            assert torch.allclose(after[:, :2], expected, atol=1e-12)
            assert torch.equal(after[:, 2], before[:, 2])


def test_random_azimuths_fill_the_whole_turn() -> None:
    w = torch.tensor([[0.6, 0.0, 0.8]], dtype=torch.float64).repeat(8000, 1)
    samples = Samples(w, w, torch.ones(8000, 1), channels=("Y",), isotropic=True)
    moved = samples.rotated_at_random(0).wi
    quadrant = (moved[:, 0] > 0).long() + 2 * (moved[:, 1] > 0).long()
    assert (torch.bincount(quadrant) / 8000).tolist() == pytest.approx([0.25] * 4, abs=0.02)
