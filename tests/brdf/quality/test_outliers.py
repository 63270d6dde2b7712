"""Gross errors are told from highlights: caught where they are planted, and nothing real goes with them."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from refusals import refused

from homofact.brdf.analytic import BlinnPhong
from homofact.brdf.materials import MATERIALS
from homofact.brdf.quality.outliers import FEWEST, outlier_weights, without_outliers
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model

ISOTROPIC = ("phong-30", "cook-torrance-plastic", "lafortune-skin", "torrance-sparrow-20")


def struck(samples: Samples, share: float, factor: float, seed: int = 5) -> tuple[Samples, np.ndarray]:
    """The samples with a share of them times a factor, and which."""
    hit = torch.rand(len(samples), generator=torch.Generator().manual_seed(seed)) < share
    return replace(samples, values=samples.values * torch.where(hit, factor, 1.0)[:, None]), hit.numpy()


def light(samples: Samples) -> np.ndarray:
    return (samples.values.mean(1) * samples.wi[:, 2] * samples.wo[:, 2]).numpy()


@pytest.mark.parametrize("name", ISOTROPIC)
@pytest.mark.parametrize("factor", [300.0, 0.03, 0.0])
def test_errors_are_caught_and_nothing_else(name: str, factor: float) -> None:
    samples, hit = struck(sample_model(MATERIALS[name].model, 1000, "discs", 3), 0.02, factor)
    weights = outlier_weights(samples)
    assert (weights[hit] == 0).mean() > 0.9
    assert (weights[~hit] < 0.5).mean() < 0.002


@pytest.mark.parametrize("name", sorted(MATERIALS))
def test_clean_materials_lose_next_to_no_light(name: str) -> None:
    samples = sample_model(MATERIALS[name].model, 1000, "discs", 3)
    lost = light(samples) * (1 - outlier_weights(samples))
    assert lost.sum() < 0.02 * light(samples).sum()


@pytest.mark.parametrize("exponent", [100, 1000, 10_000])
@pytest.mark.parametrize("share", [0.0, 0.02])
def test_a_narrow_highlight_is_no_outlier(exponent: int, share: float) -> None:
    """Of the highest exponent 3000 samples meet the lobe a handful of times; outliers stand among them."""
    model = BlinnPhong((0.1, 0.1), (0.5, 0.5), exponent=exponent, channels=("R", "G"))
    clean = sample_model(model, 3000, "discs", 0)
    samples, hit = struck(clean, share, 300.0)
    weights = outlier_weights(samples)
    lost = light(clean) * (1 - weights)
    assert lost[~hit].sum() < 0.01 * light(clean).sum()
    assert share == 0 or (weights[hit] == 0).mean() > 0.9


def test_a_retroreflective_lobe_is_no_outlier() -> None:
    clean = sample_model(MATERIALS["lafortune-clay"].model, 3000, "lobe", 1)
    near = (clean.wi * clean.wo).sum(1).clamp(-1, 1).acos()
    lobe = 1 + 50 * torch.exp(-((near / 0.03) ** 2))
    samples = replace(clean, values=clean.values * lobe[:, None])
    lost = light(samples) * (1 - outlier_weights(samples))
    assert lost.sum() < 0.02 * light(samples).sum()


def test_outliers_go_and_the_share_of_their_weight_is_told() -> None:
    clean = sample_model(MATERIALS["phong-30"].model, 1000, "discs", 3)
    samples, hit = struck(clean, 0.02, 300.0)
    left, taken = without_outliers(samples)
    assert len(left) == 1000 - hit.sum()
    assert taken == pytest.approx(hit.mean(), abs=2e-3)
    same, none = without_outliers(clean.subset(FEWEST - 1, 0))
    assert (len(same), none) == (FEWEST - 1, 0.0)


def test_parts_are_looked_at_apart_and_give_the_same_verdict(monkeypatch: pytest.MonkeyPatch) -> None:
    samples, hit = struck(sample_model(MATERIALS["phong-30"].model, 2000, "discs", 3), 0.02, 300.0)
    monkeypatch.setattr("homofact.brdf.quality.outliers.MOST_AT_ONCE", 700)
    weights = outlier_weights(samples)
    assert (weights[hit] == 0).mean() > 0.9
    assert (weights[~hit] < 0.5).mean() < 0.005
    assert np.array_equal(weights, outlier_weights(samples))


def test_samples_of_which_none_is_trusted_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    samples = sample_model(MATERIALS["phong-30"].model, 100, "discs", 3)
    monkeypatch.setattr("homofact.brdf.quality.outliers.outlier_weights", lambda *_: np.zeros(100))
    with refused(where="robust"):
        without_outliers(samples)
