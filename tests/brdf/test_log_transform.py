"""The log transform: its round trip, the thesis's equation, and what it refuses."""

import torch
from refusals import refused

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.samples import Samples


def _samples(values: torch.Tensor, weights: torch.Tensor | None = None) -> Samples:
    up = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64).repeat(len(values), 1)
    names = tuple(f"c{k}" for k in range(values.shape[1]))
    return Samples(up, up, values, channels=names, isotropic=True, weights=weights)


def test_forward_is_equation_1_9_and_inverse_undoes_it() -> None:
    values = torch.tensor([[0.0, 1.0], [3.0, 5.0], [3.0, 6.0]], dtype=torch.float64)
    transform = LogTransform.of(_samples(values), 1e-3)
    assert transform.mean.tolist() == [2, 4]
    expected = torch.log((values + 1e-3 * transform.mean_like(values)) / transform.mean_like(values))
    assert torch.allclose(transform.forward(values), expected, rtol=1e-14)
    assert torch.allclose(transform.inverse(transform.forward(values)), values, atol=1e-15)


def test_the_mean_is_weighted_and_the_inverse_never_negative() -> None:
    weights = torch.tensor([3.0, 1.0], dtype=torch.float64)
    transform = LogTransform.of(_samples(torch.tensor([[1.0], [3.0]]), weights), 1e-2)
    assert transform.mean.tolist() == [1.5]
    assert float(transform.inverse(torch.tensor([[-20.0]], dtype=torch.float64))) == 0


def test_one_spike_counts_as_much_as_all_others_together() -> None:
    values = torch.tensor([[1.0, 1.0], [2.0, 2.0], [3.0, 3.0], [6.0, 600.0]], dtype=torch.float64)
    assert LogTransform.of(_samples(values), 1e-2).mean.tolist() == [3, 3]
    weights = torch.tensor([1.0, 1.0, 1.0, 0.01], dtype=torch.float64)
    # A weight of a hundredth: 600 counts as 6, and 6 as .06.
    assert LogTransform.of(_samples(values, weights), 1e-2).mean.tolist() == [6.06 / 3.01, 12 / 3.01]
    # Where all light is in one sample it is the mean.
    alone = torch.tensor([[0.0], [0.0], [9.0]], dtype=torch.float64)
    assert LogTransform.of(_samples(alone), 1e-2).mean.tolist() == [3]


def test_bad_epsilon_and_black_channels_are_refused() -> None:
    with refused(where="epsilon", found="0"):
        LogTransform.of(_samples(torch.ones(2, 1)), 0)
    with refused(where="samples"):
        LogTransform.of(_samples(torch.tensor([[1.0, 0.0], [1.0, 0.0]])), 1e-5)


def test_logs_that_ran_away_are_absurd_and_finite() -> None:
    transform = LogTransform(1e-3, torch.tensor([2.0, 0.5], dtype=torch.float64))
    logs = torch.tensor([[79.0, 79.9], [80.0, 80.0], [81.0, 1e3], [1e30, 1e30]], dtype=torch.float64)
    values = transform.inverse(logs)
    # Up to 80 nothing is touched.
    assert torch.allclose(values[:2], transform.mean_like(logs) * torch.exp(logs[:2]), rtol=1e-12)
    assert torch.equal(values[2:], values[1:2].expand(2, 2))
    single = transform.inverse(logs.float())
    assert single.dtype == torch.float32
    assert bool(torch.isfinite(single).all())
    assert bool(torch.isfinite(single.mean(0)).all())
