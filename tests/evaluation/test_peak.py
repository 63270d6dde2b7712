"""How narrow a highlight is, in closed form; texels a radian by hand; and a mirror-like one is named."""

import math

import pytest
import torch

import homofact
from homofact.brdf.analytic import Ward
from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import Source
from homofact.errors import Advice
from homofact.evaluation.energy import energy_errors
from homofact.evaluation.peak import half_width, texels_per_radian
from homofact.factor.factorization import Factorization, Term
from homofact.factor.projection import Warp, fixed_projection


def ward(slope: float) -> Ward:
    return Ward((0.05,), (0.5,), alpha_x=slope, alpha_y=slope, channels=("Y",))


@pytest.mark.parametrize("slope", [5e-4, 0.01, 0.1])
def test_the_half_width_of_a_gaussian_of_slopes(slope: float) -> None:
    """Ward's lobe is exp(−tan²θh/α²): half of it is left at tanθh = α √ln 2, cosines of ωo aside."""
    assert half_width(ward(slope)) == pytest.approx(math.atan(slope * math.sqrt(math.log(2))), rel=0.04)


def test_a_matte_material_has_no_highlight_and_its_record_says_so() -> None:
    matte = Lambert((0.5,), channels=("Y",))
    assert half_width(matte) is None
    assert energy_errors(matte, matte, True).record()["half_width"] is None


def test_texels_a_radian_of_a_plain_axis_and_of_a_stretched_one() -> None:
    def fit(projection, rows: int, columns: int) -> Factorization:
        term = Term(projection, torch.zeros(rows, columns, 1).double(), torch.ones(rows, columns, dtype=torch.bool))
        return Factorization((term,), LogTransform(1e-2, torch.ones(1).double()), ("Y",))

    plain = fit(fixed_projection("theta_h-theta_d", True), 5, 33)
    assert texels_per_radian(plain) == pytest.approx(32 / (math.pi / 2), rel=1e-3)
    width = 0.01
    warped = fit(fixed_projection("theta_h-theta_d", True, Warp(width)), 5, 33)
    assert texels_per_radian(warped) == pytest.approx(32 / (math.pi / 2 * width * math.asinh(1 / width)), rel=1e-3)
    assert texels_per_radian(fit(fixed_projection("theta_i-theta_o", True), 33, 33)) < 1


@pytest.mark.parametrize(("slope", "named"), [(2e-4, True), (0.1, False)])
def test_a_highlight_narrower_than_any_texel_is_named_with_the_size_that_holds_it(slope: float, named: bool) -> None:
    model = ward(slope)
    samples = sample_model(model, 3000, "lobe", seed=0)
    source = Source("ward", "material", samples, model, 1e-4, 0.0)
    fit = homofact.fit(source, homofact.Search(textures=1, size=8, effort=10.0, epsilon=1e-4))
    assert fit.verdict is not None
    found = {finding.name: finding for finding in fit.verdict.findings}
    assert ("narrow" in found) == named
    if named:
        assert (found["narrow"].advice or Advice("", 0)).setting == "size" or "mirror" in found["narrow"].remedy
