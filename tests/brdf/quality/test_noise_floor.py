"""The noise floor against noise that was planted, from repeated, swapped and neighbouring samples."""

from dataclasses import replace

import pytest
import torch

from homofact.brdf.materials import MATERIALS
from homofact.brdf.quality.noise_floor import noise_floor
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model


def base(count: int = 3000) -> Samples:
    return sample_model(MATERIALS["lafortune-clay"].model, count, "discs", 0)


def joined(one: Samples, other: Samples) -> Samples:
    parts = {name: torch.cat((getattr(one, name), getattr(other, name))) for name in ("wi", "wo", "values", "weights")}
    return replace(one, **parts)


def noisy(samples: Samples, level: float, seed: int = 0) -> Samples:
    """The values plus noise of `level` in units of the mean; an offset keeps them above zero."""
    values = samples.values + samples.values.mean(0)
    draw = torch.randn(values.shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    return replace(samples, values=(values + level * values.mean(0) * draw).clamp_min(0))


@pytest.mark.parametrize("level", [0.02, 0.1])
def test_neighbours_tell_the_noise(level: float) -> None:
    assert noise_floor(noisy(base(), level)) == pytest.approx(level, rel=0.25)


@pytest.mark.parametrize("swap", [False, True])
def test_repeated_and_swapped_samples_tell_it_by_themselves(swap: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("homofact.brdf.quality.noise_floor.local_scatter", lambda *_: None)
    some = base(2000)
    assert noise_floor(some) is None
    other = replace(some, wi=some.wo, wo=some.wi) if swap else some
    assert noise_floor(joined(noisy(some, 0.01, 0), noisy(other, 0.01, 1))) == pytest.approx(0.01, rel=0.2)


def test_too_few_samples_tell_nothing() -> None:
    assert noise_floor(base(10)) is None
