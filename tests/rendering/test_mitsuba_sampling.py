"""What the material in Mitsuba draws, against its density (a chi-square test), its values and the albedo."""

import importlib
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from mitsuba_cases import albedo, at, drawn, pairs, saved_fits, seen_from, variant, vectors
from torch import Tensor

from homofact.factor.factorization import Factorization
from homofact.rendering import mitsuba_bsdf


@pytest.fixture
def mi(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    # A chi-square test that fails writes a file where it stands.
    monkeypatch.chdir(tmp_path)
    return variant("llvm_ad_rgb")


@pytest.fixture(scope="module")
def fits(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return saved_fits(tmp_path_factory.mktemp("fits"))


@pytest.mark.parametrize("name", ["paint", "phong", "ward", "sharp"])
def test_the_density_is_that_of_the_mixture(mi: Any, fits: dict[str, Path], name: str) -> None:
    fit = Factorization.load(fits[name])
    wi, wo = pairs(5000)
    # As the material finds it, once (conftest.py).
    expected = mitsuba_bsdf.fitted_mixture(fit).density(wi, wo)
    bsdf = mitsuba_bsdf.load_bsdf(fits[name])
    arguments = mi.BSDFContext(), seen_from(mi, wo), vectors(mi, wi)
    found = torch.from_numpy(np.array(bsdf.pdf(*arguments))).double()
    assert torch.allclose(found, expected, rtol=2e-3)
    value, density = bsdf.eval_pdf(*arguments)
    assert np.array_equal(np.array(value), np.array(bsdf.eval(*arguments)))
    assert np.array_equal(np.array(density), np.array(bsdf.pdf(*arguments)))


def chi_square(mi: Any, bsdf: Any, wo: Tensor, steps: int = 8) -> Any:
    """Mitsuba's test of `sample` against `pdf` for one viewer: a cell's density is integrated in steps² steps.

    The test's cells meet at its poles. Its axes are turned so that the mirror direction lies between the poles.
    """
    context = mi.BSDFContext()
    dr = importlib.import_module("drjit")
    mirror = wo * wo.new_tensor((-1, -1, 1))
    across = torch.linalg.cross(mirror, wo.new_tensor((0.3, 1.0, 0.2)))
    across = across / across.norm()
    axes = [mi.Vector3f(axis.tolist()) for axis in (mirror, torch.linalg.cross(across, mirror), across)]
    # Not constants of the compiled code, which then serves every viewer.
    dr.make_opaque(axes)

    def draw(points: Any) -> tuple[Any, Any]:
        si = seen_from(mi, wo.expand(dr.width(points), 3))
        found, _ = bsdf.sample(context, si, points[0], mi.Point2f(points[1], points[2]))
        # Directions under the horizon, of which rounding makes a few, count for nothing.
        return mi.Vector3f(*(dr.dot(axis, found.wo) for axis in axes)), dr.select(found.pdf > 0, mi.Float(1), 0)

    def density(direction: Any) -> Any:
        turned = sum((axis * direction[k] for k, axis in enumerate(axes)), mi.Vector3f(0))
        return bsdf.pdf(context, seen_from(mi, wo.expand(dr.width(direction), 3)), turned)

    return mi.chi2.ChiSquareTest(
        domain=mi.chi2.SphericalDomain(), sample_func=draw, pdf_func=density, sample_dim=3, res=151, ires=steps
    )


VIEWS = (0.0, 30.0, 60.0, 80.0, 88.0)
DRAWN = [(name, "lobe") for name in ("paint", "phong", "ward", "sharp")] + [("paint", "cosine")]


@pytest.mark.parametrize(("name", "sampling"), DRAWN)
def test_directions_are_drawn_from_the_density(mi: Any, fits: dict[str, Path], name: str, sampling: str) -> None:
    bsdf = mitsuba_bsdf.load_bsdf(fits[name], sampling)
    for degrees in VIEWS:
        test = chi_square(mi, bsdf, at(degrees), 16 if name == "sharp" else 8)
        assert test.run(0.01, test_count=len(VIEWS) * len(DRAWN), quiet=True), f"{degrees}°: {test.messages}"
        total = float(np.ravel(test.pdf_sum)[0])
        # Nothing is lost under the horizon.
        assert total == pytest.approx(1, abs=2e-3)


@pytest.mark.parametrize("name", ["phong", "ward"])
def test_the_chi_square_test_sees_what_is_drawn_from_another_density(mi: Any, fits: dict[str, Path], name: str) -> None:
    """Directions for a viewer a degree off, and those of the cosine."""
    lobe, cosine = (mitsuba_bsdf.load_bsdf(fits[name], each) for each in mitsuba_bsdf.SAMPLINGS)
    for other in (chi_square(mi, lobe, at(31.0)), chi_square(mi, cosine, at(30.0))):
        test = chi_square(mi, lobe, at(30.0))
        test.sample_func = other.sample_func
        assert not test.run(0.01, quiet=True)


@pytest.mark.parametrize("name", ["paint", "sharp"])
def test_a_weight_is_the_value_over_the_density(mi: Any, fits: dict[str, Path], name: str) -> None:
    bsdf = mitsuba_bsdf.load_bsdf(fits[name])
    si, found, weight = drawn(mi, bsdf, at(50), 20_000)
    value, density = (np.array(each) for each in bsdf.eval_pdf(mi.BSDFContext(), si, found.wo))
    alive = np.array(found.pdf) > 0
    assert alive.mean() > 0.8
    assert np.allclose(np.array(found.pdf)[alive], density[alive], rtol=1e-4)
    assert np.allclose((np.array(weight) * density)[:, alive], value[:, alive], rtol=1e-4, atol=1e-6)
    assert np.allclose(np.linalg.norm(np.array(found.wo), axis=0), 1, atol=1e-5)


@pytest.mark.parametrize("degrees", [0.0, 45.0, 80.0])
@pytest.mark.parametrize(
    ("name", "sampling"), [("paint", "lobe"), ("paint", "cosine"), ("ward", "lobe"), ("sharp", "lobe")]
)
def test_the_mean_weight_is_the_albedo(
    mi: Any, fits: dict[str, Path], name: str, sampling: str, degrees: float
) -> None:
    count = 200_000
    bsdf = mitsuba_bsdf.load_bsdf(fits[name], sampling)
    weights = np.array(drawn(mi, bsdf, at(degrees), count)[2], dtype=np.float64)
    # Seen at a grazing angle, a narrow lobe is narrowest in azimuth.
    steps = (500, 1440) if name == "sharp" else (300, 480)
    expected = albedo(Factorization.load(fits[name]), at(degrees), *steps).numpy()
    noise = weights.std(1) / math.sqrt(count)
    assert np.all(np.abs(weights.mean(1) - expected) < 5 * noise + 1e-3 * expected)
    assert np.all(noise < 0.01 * expected)


@pytest.mark.parametrize(("name", "times"), [("phong", 10), ("ward", 50), ("sharp", 200)])
def test_the_lobe_lowers_the_variance(mi: Any, fits: dict[str, Path], name: str, times: float) -> None:
    """Against directions drawn from the cosine alone, 200,000 of each, at 30°."""
    lobe, cosine = (
        np.array(drawn(mi, mitsuba_bsdf.load_bsdf(fits[name], sampling), at(30), 200_000)[2])[1].var()
        for sampling in mitsuba_bsdf.SAMPLINGS
    )
    assert lobe < cosine / times
