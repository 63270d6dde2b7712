"""Spectra to linear sRGB and luminance: white is white, colour-science agrees, clipping is counted."""

import subprocess
import sys

import numpy as np
import pytest
import torch
from refusals import refused

from homofact.brdf.spectral import ILLUMINANT, LUMINANCE, OBSERVER, computed, illuminated, to_luminance, to_rgb

CORNELL = tuple(range(400, 701, 10))
FINE = tuple(range(360, 781))


def hump(wavelengths: tuple[int, ...], centre: float, width: float) -> torch.Tensor:
    w = torch.tensor(wavelengths, dtype=torch.float64)
    return (0.1 + 0.5 * torch.exp(-(((w - centre) / width) ** 2)))[None]


@pytest.mark.parametrize("illuminant", ["D65", "D50", "A", "E"])
@pytest.mark.parametrize("wavelengths", [CORNELL, FINE, (450, 550, 650)])
def test_flat_one_is_white(illuminant: str, wavelengths: tuple[int, ...]) -> None:
    flat = torch.ones(2, len(wavelengths), dtype=torch.float64) * torch.tensor([[1.0], [7.0]])
    rgb, facts = to_rgb(flat, wavelengths, illuminant)
    assert torch.allclose(rgb, torch.tensor([[1.0], [7.0]]).double().expand(2, 3), atol=1e-12)
    luminance, _ = to_luminance(flat, wavelengths, illuminant)
    assert luminance.reshape(-1).tolist() == pytest.approx([1, 7], abs=1e-12)
    assert facts["illuminant"] == illuminant
    assert facts["observer"] == OBSERVER


@pytest.mark.parametrize("centre", [470, 545, 575, 610])
def test_agrees_with_colour_science(centre: float) -> None:
    import colour

    spectrum = hump(FINE, centre, 70)
    values = dict(zip(FINE, spectrum[0].tolist(), strict=True))
    shape = colour.SpectralShape(360, 780, 1)
    light = colour.SDS_ILLUMINANTS["D65"].copy().align(shape)
    observer = colour.MSDS_CMFS[OBSERVER].copy().align(shape)
    xyz = colour.sd_to_XYZ(colour.SpectralDistribution(values), observer, light, method="Integration") / 100
    expected = np.asarray(colour.RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB) @ np.asarray(xyz)
    rgb, _ = to_rgb(spectrum, FINE)
    # colour's own matrix is the standard's, rounded to four digits.
    assert rgb[0].tolist() == pytest.approx(expected.clip(0).tolist(), abs=5e-4)
    luminance, _ = to_luminance(spectrum, FINE)
    assert float(luminance[0, 0]) == pytest.approx(float(xyz[1]), abs=1e-5)
    if expected.min() > 0:
        assert float((rgb[0] * torch.tensor(LUMINANCE)).sum()) == pytest.approx(float(xyz[1]), abs=1e-4)


def test_white_of_d65_is_the_published_one() -> None:
    _, facts = to_rgb(hump(FINE, 550, 50), FINE)
    assert facts["illuminant_xy"] == pytest.approx([0.3127, 0.3290], abs=1e-4)


def test_ten_nanometres_are_enough_for_a_smooth_spectrum() -> None:
    coarse, _ = to_rgb(hump(CORNELL, 540, 50), CORNELL)
    fine, _ = to_rgb(hump(FINE, 540, 50), FINE)
    assert torch.allclose(coarse, fine, atol=3e-3)
    assert not torch.equal(coarse, fine)


def test_primary_humps_land_on_their_channels() -> None:
    for channel, centre in enumerate((630, 535, 450)):
        rgb, _ = to_rgb(hump(CORNELL, centre, 25), CORNELL)
        assert int(rgb[0].argmax()) == channel


def test_out_of_gamut_is_clipped_and_counted() -> None:
    w = torch.tensor(CORNELL, dtype=torch.float64)
    narrow = torch.exp(-(((w - 505) / 12) ** 2))
    rgb, facts = to_rgb(torch.stack((narrow, torch.ones_like(w), narrow)), CORNELL)
    assert facts["clipped"]["R"] == 2
    assert facts["clipped"]["G"] == 0
    assert rgb[0, 0] == 0
    assert float(rgb.min()) >= 0


@pytest.mark.parametrize(
    ("wavelengths", "illuminant", "message"),
    [
        ((500, 510), "D65", "found 500-510 nm, expected them to cover 450-650 nm"),
        ((400, 700, 600), "D65", "600 nm follows 700 nm, expected rising"),
        ((400, 550, 700), "D66", "illuminant: found 'D66', expected a CIE name"),
        ((550,), "D65", "1 values for 1 wavelengths"),
    ],
)
def test_impossible_wavelengths_and_lights_are_refused(
    wavelengths: tuple[int, ...], illuminant: str, message: str
) -> None:
    with refused(message):
        to_rgb(torch.ones(1, len(wavelengths), dtype=torch.float64), wavelengths, illuminant)


def test_counts_that_disagree_are_refused() -> None:
    with refused(where="spectra"):
        to_luminance(torch.ones(1, 30, dtype=torch.float64), CORNELL)


def test_the_kept_table_is_that_of_colour_science() -> None:
    for kept, expected in zip(illuminated(ILLUMINANT), computed(ILLUMINANT), strict=True):
        np.testing.assert_allclose(kept, expected, rtol=1e-13)


@pytest.mark.slow
def test_spectra_under_d65_load_no_colour_science() -> None:
    program = (
        "import sys, torch; from homofact.brdf.spectral import to_rgb, to_luminance;"
        "to_rgb(torch.ones(1, 4), (400, 500, 600, 700)); to_luminance(torch.ones(1, 4), (400, 500, 600, 700));"
        "sys.exit('colour' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
