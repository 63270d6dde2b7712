"""Spectra for RGB: what the basis must be, and the RGB again, by our weights and by colour-science's integration."""

import colour
import numpy as np
import pytest
import torch
from colour.recovery import MSDS_BASIS_FUNCTIONS_sRGB_MALLETT2019 as MALLETT

from homofact.brdf.spectral import to_rgb
from homofact.brdf.upsampling import NODES, basis, to_spectra

RASTER = np.arange(360.0, 781.0)


def colours(count: int = 200) -> torch.Tensor:
    """Values of BRDFs: all over the cube, and far above 1."""
    values = torch.rand(count, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    return torch.cat((torch.eye(3, dtype=torch.float64), values, values * 300))


def test_three_reflectances_share_white_between_them() -> None:
    assert basis().shape == (len(NODES), 3)
    assert basis().min() >= 0
    assert basis().max() <= 1
    assert basis().sum(1) == pytest.approx(np.ones(len(NODES)), abs=1e-12)
    grey = to_spectra(torch.full((1, 3), 0.4, dtype=torch.float64))
    assert grey[0].tolist() == pytest.approx([0.4] * len(NODES), abs=1e-12)


def test_rgb_under_d65_comes_back() -> None:
    rgb = colours()
    found, facts = to_rgb(to_spectra(rgb), NODES, clip=False)
    assert facts["illuminant"] == "D65"
    assert torch.allclose(found, rgb, rtol=1e-10, atol=1e-12)


def test_colour_science_integrates_to_the_same() -> None:
    """CIE 1931 and D65, 1 nm, by ASTM E308's summation, and the matrix to sRGB: all not ours."""
    rgb = colours(5)[:8]
    shape = colour.SpectralShape(360, 780, 1)
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape)
    light = colour.SDS_ILLUMINANTS["D65"].copy().align(shape)
    for given, spectrum in zip(rgb.numpy(), to_spectra(rgb).numpy(), strict=True):
        values = np.interp(RASTER, NODES, spectrum)
        xyz = colour.sd_to_XYZ(colour.SpectralDistribution(values, RASTER), observer, light, method="Integration")
        found = colour.XYZ_to_sRGB(np.asarray(xyz) / 100, apply_cctf_encoding=False)
        assert np.asarray(found) == pytest.approx(given, abs=2e-3)


def test_polygons_are_near_the_spectra_that_were_published() -> None:
    given = np.asarray(MALLETT.values)
    ours = np.stack([np.interp(MALLETT.wavelengths, NODES, basis()[:, k]) for k in range(3)], 1)
    units = torch.eye(len(given), dtype=torch.float64)
    weights = to_rgb(units, list(MALLETT.wavelengths), clip=False)[0].abs().sum(1).numpy()
    rms = np.sqrt(np.average(((ours - given) ** 2).mean(1), weights=weights))
    assert rms == pytest.approx(0.015, abs=0.002)


def test_it_is_linear_in_any_type_and_shape() -> None:
    rgb = colours(24)[:24].reshape(2, 3, 4, 3)
    spectra = to_spectra(rgb)
    assert spectra.shape == (2, 3, 4, len(NODES))
    assert torch.allclose(to_spectra(rgb * 2 + 1), spectra * 2 + 1)
    assert to_spectra(rgb.float()).dtype == torch.float32
