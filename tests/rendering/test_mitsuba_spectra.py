"""Spectra in Mitsuba's variants against `evaluate`: at wavelengths, as colours, and in a picture.

Install the extra `mitsuba` to run these, and Debian's libllvm19 for the variants that compile.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from mitsuba_cases import (
    at,
    drawn,
    evaluated,
    factorization,
    pairs,
    random_texture,
    searched,
    seen_from,
    variant,
    vectors,
)
from slow_cases import slow_among
from torch import Tensor

import homofact
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.samples import Samples
from homofact.brdf.spectral import to_luminance, to_rgb
from homofact.brdf.upsampling import NODES, to_spectra
from homofact.brdf.wavelengths import spectral_names
from homofact.factor.factorization import Factorization, Term
from homofact.factor.fitted import Fitted
from homofact.factor.projection import fixed_projection
from homofact.factor.spectral_fit import SpectralFit
from homofact.rendering import mitsuba_bsdf

BANDS = tuple(float(w) for w in range(400, 701, 10))
UNEVEN = (380.0, 420.0, 500.0, 520.0, 610.0, 700.0)


def product(bands: tuple[float, ...] = BANDS) -> Factorization:
    """Coloured spectra that no few vectors hold exactly."""
    made = np.random.default_rng(4)
    waves = (np.array(bands) - 400) / 300
    shapes = np.stack([np.ones_like(waves), waves, np.sin(4 * waves), np.cos(9 * waves), np.sin(15 * waves)])
    terms = []
    for name, size in (("theta_h-theta_d", (8, 9)), ("theta_i", (1, 7))):
        texture = made.normal(size=(*size, 5)) * (0.3, 0.3, 0.2, 0.1, 0.02) @ shapes
        terms.append(Term(fixed_projection(name, True), texture, np.ones(size, dtype=bool)))
    mean = 0.1 + 0.08 * np.sin(5 * waves)
    return Factorization(tuple(terms), LogTransform(1e-3, mean), spectral_names(bands))


def with_basis(fit: Factorization, tolerance: float = 0.3) -> SpectralFit:
    wi, wo = pairs(400, 7)
    samples = Samples(wi, wo, fit.evaluate(wi, wo), torch.ones(400, dtype=torch.float64), fit.channels)
    return SpectralFit.of(fit, samples, tolerance)


def nonnegative() -> Fitted:
    """A sum of products of all bands."""
    fit = product()
    wi, wo = pairs(800, 8)
    samples = Samples(wi, wo, fit.evaluate(wi, wo), torch.ones(800, dtype=torch.float64), fit.channels)
    return homofact.Nmf(textures=2, size=8).fit(samples).factorization


FITS = {
    "basis": lambda: with_basis(product()),
    "more than four vectors": lambda: with_basis(product(), 1e-4),
    "all bands": product,
    "uneven bands": lambda: with_basis(product(UNEVEN)),
    "three bands": lambda: product((450.0, 550.0, 650.0)),
    "sum of products": nonnegative,
}


@pytest.fixture(params=slow_among(FITS, "sum of products"))
def fit(request: pytest.FixtureRequest) -> Fitted:
    return FITS[request.param]()


def loaded(fit: Fitted, folder: Path, sampling: str = "cosine") -> Any:
    fit.save(folder / "fit.npz")
    return mitsuba_bsdf.load_bsdf(folder / "fit.npz", sampling)


def in_bands(fit: Fitted, wi: Tensor, wo: Tensor) -> Tensor:
    """F cosθi (N, W)."""
    return fit.evaluate(wi, wo) * wi[:, 2:]


def bands_of(fit: Fitted) -> list[float]:
    return [float(name.removesuffix("nm")) for name in fit.channels]


def interpolated(wavelengths: np.ndarray, bands: list[float], values: Tensor) -> np.ndarray:
    """Values (N, W) at wavelengths (4, N)."""
    return np.stack(
        [[np.interp(w, bands, row) for w, row in zip(own, values.numpy(), strict=True)] for own in wavelengths]
    )


def at_wavelengths(mi: Any, bsdf: Any, wi: Tensor, wo: Tensor, wavelengths: np.ndarray) -> np.ndarray:
    """F cosθi (4, N) in a compiled spectral variant."""
    si = seen_from(mi, wo)
    si.wavelengths = type(si.wavelengths)(wavelengths.astype(np.float32))
    return np.array(bsdf.eval(mi.BSDFContext(), si, vectors(mi, wi)))


def wavelengths(count: int) -> np.ndarray:
    """Some of them beyond the bands."""
    return np.random.default_rng(1).uniform(365, 790, (4, count)).astype(np.float32).astype(np.float64)


def test_it_answers_at_the_wavelengths_of_a_path(fit: Fitted, tmp_path: Path) -> None:
    mi = variant("llvm_ad_spectral")
    bsdf = loaded(fit, tmp_path)
    wi, wo = pairs(2000)
    own = wavelengths(2000)
    found = at_wavelengths(mi, bsdf, wi, wo, own)
    expected = interpolated(own, bands_of(fit), in_bands(fit, wi, wo))
    error = abs(found - expected) / expected.mean()
    assert np.median(error) < 2e-6
    assert np.quantile(error, 0.999) < 1e-3


def test_the_scalar_variant_answers_the_same(tmp_path: Path) -> None:
    mi = variant("scalar_spectral")
    fit = with_basis(product())
    bsdf = loaded(fit, tmp_path)
    wi, wo = pairs(10)
    own = wavelengths(10)
    expected = interpolated(own, bands_of(fit), in_bands(fit, wi, wo))
    si = mi.SurfaceInteraction3f()
    for k in range(10):
        si.wi, si.wavelengths = mi.Vector3f(*wo[k].tolist()), own[:, k]
        value = np.array(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(*wi[k].tolist())))
        assert value == pytest.approx(expected[:, k], rel=2e-4)


@pytest.mark.parametrize("name", ["llvm_ad_rgb", "llvm_ad_mono"])
def test_other_variants_get_its_colour(fit: Fitted, tmp_path: Path, name: str) -> None:
    mi = variant(name)
    bsdf = loaded(fit, tmp_path)
    wi, wo = pairs(1000)
    convert = to_rgb if name.endswith("rgb") else to_luminance
    expected = convert(in_bands(fit, wi, wo), bands_of(fit))[0]
    error = (evaluated(mi, bsdf, wi, wo) - expected).abs() / expected.mean()
    assert float(error.median()) < 2e-6
    assert float(error.quantile(0.999)) < 1e-3


def test_rgb_becomes_the_spectra_that_have_its_colours(tmp_path: Path) -> None:
    mi = variant("llvm_ad_spectral")
    fit = factorization((searched("isotropic-half-diff"), random_texture(9, 8)))
    bsdf = loaded(fit, tmp_path)
    wi, wo = pairs(500)
    own = wavelengths(500)
    expected = interpolated(own, list(NODES), to_spectra(in_bands(fit, wi, wo)))
    error = abs(at_wavelengths(mi, bsdf, wi, wo, own) - expected) / expected.mean()
    assert np.median(error) < 2e-6
    assert np.quantile(error, 0.999) < 1e-3


def test_one_channel_is_grey_at_every_wavelength(tmp_path: Path) -> None:
    mi = variant("llvm_ad_spectral")
    fit = factorization((searched("isotropic-half-diff"), random_texture(9, 8, channels=1)), mean=(0.2,))
    wi, wo = pairs(100)
    found = at_wavelengths(mi, loaded(fit, tmp_path), wi, wo, wavelengths(100))
    assert found == pytest.approx(np.repeat(in_bands(fit, wi, wo).numpy().T, 4, 0), rel=2e-3)


def test_weights_of_samples_are_values_over_densities(tmp_path: Path) -> None:
    mi = variant("llvm_ad_spectral")
    bsdf = loaded(with_basis(product()), tmp_path, "lobe")
    si, sample, weight = drawn(mi, bsdf, at(40), 2000)
    value, density = bsdf.eval_pdf(mi.BSDFContext(), si, sample.wo)
    assert np.array(weight).shape == (4, 2000)
    np.testing.assert_allclose(np.array(weight) * np.array(density), np.array(value), rtol=1e-4, atol=1e-7)


def test_a_lit_patch_has_the_colour_of_its_spectrum(tmp_path: Path) -> None:
    """A patch seen from above under a lamp of D65 at 40°: in sRGB as `spectral.to_rgb` has it."""
    mi = variant("llvm_ad_spectral")
    fit = with_basis(product())
    fit.save(tmp_path / "fit.npz")
    towards = at(40, 0.3)
    lamp = {"type": "directional", "direction": (-towards).tolist(), "irradiance": {"type": "d65"}}
    material = {"type": "homofact", "filename": str(tmp_path / "fit.npz"), "sampling": "cosine"}
    above = mi.ScalarTransform4f().look_at([0, 0, 2], [0, 0, 0], [0, 1, 0]).scale([0.5, 0.5, 1])
    film = {"type": "hdrfilm", "width": 16, "height": 16, "pixel_format": "rgb"}
    scene = {
        "type": "scene",
        "integrator": {"type": "direct"},
        "lamp": lamp,
        "patch": {"type": "rectangle", "material": material},
        "camera": {"type": "orthographic", "to_world": above, "film": film},
    }
    found = np.array(mi.render(mi.load_dict(scene), spp=2048, seed=1)).mean((0, 1))
    up = torch.tensor([[0, 0, 1.0]], dtype=torch.float64)
    expected = to_rgb(in_bands(fit, towards[None], up), bands_of(fit), clip=False)[0][0]
    assert found == pytest.approx(expected.numpy(), rel=0.01, abs=3e-4)


def test_spectra_beyond_the_visible_are_refused(tmp_path: Path) -> None:
    variant("scalar_spectral")
    fit = factorization((searched("isotropic-half-diff"), random_texture(9, 8)))
    Factorization(fit.terms, fit.transform, ("900nm", "1200nm", "1700nm")).save(tmp_path / "fit.npz")
    with pytest.raises(homofact.BadInput, match=r"fit\.npz: wavelengths: found 900-1700 nm.*one of its bands"):
        mitsuba_bsdf.load_bsdf(tmp_path / "fit.npz")
