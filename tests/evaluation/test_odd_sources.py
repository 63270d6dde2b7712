"""Sources with hardly anything in them: a clear line, or a verdict that says so."""

import pytest
import torch
from torch import Tensor

import homofact
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import draw_in_discs
from homofact.errors import BadInput

WI, WO = draw_in_discs(1500, torch.Generator().manual_seed(0))
QUICK = homofact.Search(textures=2, size=6, effort=10.0)


def samples(values: Tensor) -> Samples:
    return Samples(WI, WO, values, channels=("Y",), isotropic=True)


def found(given: Samples) -> set[str]:
    verdict = homofact.fit(given, QUICK).verdict
    assert verdict is not None
    return {finding.name for finding in verdict.findings}


def test_a_source_without_energy_is_refused() -> None:
    with pytest.raises(BadInput, match="samples: channel Y is zero everywhere, expected some reflectance"):
        homofact.fit(samples(torch.zeros(1500, 1)), QUICK)


@pytest.mark.slow
def test_all_energy_in_one_sample_is_not_trusted() -> None:
    values = torch.zeros(1500, 1)
    values[7] = 3
    assert {"explained", "zeros"} <= found(samples(values))


@pytest.mark.slow
def test_a_hole_is_named() -> None:
    assert "coverage" in found(samples(torch.full((1500, 1), 0.2)).select((WI[:, 2] > 0.8).nonzero()[:, 0]))


def test_no_weight_at_all_is_refused() -> None:
    with pytest.raises(BadInput, match="weights that are all 0"):
        Samples(WI, WO, torch.ones(1500, 1), channels=("Y",), isotropic=True, weights=torch.zeros(1500))
