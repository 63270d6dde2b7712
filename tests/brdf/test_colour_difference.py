"""Colours of spectra under several illuminants against colour-science and published numbers."""

import colour
import numpy as np
import pytest
from refusals import refused

from homofact.brdf.cielab import ciede2000
from homofact.brdf.colour_difference import ILLUMINANTS, lab_of, lab_of_xyz, lab_slopes
from homofact.brdf.spectral import OBSERVER, xyz_weights

FINE = tuple(range(360, 781))
CORNELL = tuple(range(400, 701, 10))
NAMES = {"D65": "D65", "A": "A", "F11": "FL11"}


def spectra(wavelengths: tuple[int, ...], count: int = 12) -> np.ndarray:
    """Smooth spectra in sr⁻¹, some of them of highlights above the perfect diffuser, some nearly black."""
    drawn = np.random.default_rng(3)
    centres, widths, heights = (drawn.uniform(*ends, (count, 1)) for ends in ((420, 680), (20, 90), (0.01, 1.5)))
    return 1e-4 + heights * np.exp(-(((np.array(wavelengths) - centres) / widths) ** 2))


@pytest.mark.parametrize("illuminant", ILLUMINANTS)
def test_lab_is_that_of_colour_science(illuminant: str) -> None:
    light = colour.SDS_ILLUMINANTS[NAMES[illuminant]]
    power = colour.SpectralDistribution(np.interp(FINE, light.wavelengths, light.values), FINE)
    observer = colour.MSDS_CMFS[OBSERVER].copy().align(colour.SpectralShape(360, 780, 1))
    flat = colour.SpectralDistribution(np.ones(len(FINE)), FINE)
    white = np.asarray(colour.sd_to_XYZ(flat, observer, power, method="Integration"))
    found = lab_of(spectra(FINE), FINE, illuminant)
    for own, spectrum in zip(found, spectra(FINE), strict=True):
        reflected = colour.SpectralDistribution(np.pi * spectrum, FINE)
        xyz = np.asarray(colour.sd_to_XYZ(reflected, observer, power, method="Integration"))
        assert own == pytest.approx(np.asarray(colour.XYZ_to_Lab(xyz / white[1], colour.XYZ_to_xy(white))), abs=1e-6)


@pytest.mark.parametrize(("illuminant", "x", "y"), [("A", 0.44758, 0.40745), ("F11", 0.38052, 0.37713)])
def test_whites_are_the_published_ones(illuminant: str, x: float, y: float) -> None:
    """CIE 15:2018, tables T.3 and T.8.1."""
    white = xyz_weights(FINE, illuminant).sum(0)
    assert white[1] == pytest.approx(1, abs=1e-12)
    assert (white[:2] / white.sum()).tolist() == pytest.approx([x, y], abs=2e-4)


@pytest.mark.parametrize("illuminant", ILLUMINANTS)
def test_the_perfect_diffuser_is_white(illuminant: str) -> None:
    assert lab_of(np.full((1, 31), 1 / np.pi), CORNELL, illuminant)[0] == pytest.approx([100, 0, 0], abs=1e-9)
    white = xyz_weights(CORNELL, illuminant).sum(0)
    assert lab_of_xyz(white / np.pi, white) == pytest.approx([100, 0, 0], abs=1e-9)


@pytest.mark.parametrize("illuminant", ILLUMINANTS)
def test_slopes_are_derivatives(illuminant: str) -> None:
    values = spectra(CORNELL)
    slopes = lab_slopes(values, CORNELL, illuminant)
    for k in range(len(CORNELL)):
        step = np.zeros(len(CORNELL))
        step[k] = 1e-6
        difference = lab_of(values + step, CORNELL, illuminant) - lab_of(values - step, CORNELL, illuminant)
        assert slopes[:, :, k] == pytest.approx(difference / 2e-6, rel=1e-3, abs=2e-3)


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        ((50, 2.6772, -79.7751), (50, 0, -82.7485), 2.0425),
        ((50, -1.3802, -84.2814), (50, 0, -82.7485), 1.0),
        ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
        ((2.0776, 0.0795, -1.1350), (0.9033, -0.0636, -0.5514), 0.9082),
    ],
)
def test_differences_are_the_published_ones(
    first: tuple[float, ...], second: tuple[float, ...], expected: float
) -> None:
    """Sharma, Wu and Dalal 2005, table 1."""
    assert float(ciede2000(np.array(first), np.array(second))) == pytest.approx(expected, abs=5e-5)


def test_other_wavelengths_and_illuminants_are_refused() -> None:
    with refused(where="wavelengths", found="900-1700 nm"):
        lab_of(np.ones((1, 2)), (900, 1700), "D65")
    with refused(where="wavelengths", found="550 nm alone"):
        lab_of(np.ones((1, 1)), (550,), "D65")
    with refused(where="wavelengths", found="none"):
        xyz_weights(())
    with refused(where="wavelengths", found="400 nm follows 700 nm"):
        lab_slopes(np.ones((1, 2)), (700, 400), "D65")
    with refused(where="illuminant", found="'F99'"):
        lab_of(np.ones((1, 31)), CORNELL, "F99")
