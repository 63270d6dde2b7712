"""`factorize --channels spectral --spectral-tolerance`: what it writes, and spectra that it cannot use."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
import torch
from ran import Ran

import homofact
from homofact.brdf.formats import cornell
from homofact.factor.spectral_fit import SpectralFit

BANDS = tuple(float(w) for w in range(400, 701, 20))
FAST = ("--method", "mccool", "--size", 6, "--channels", "spectral")


def measured(path: Path, wavelengths: Sequence[float], value: str = "") -> Path:
    """A Cornell file of a red paint with a highlight; `value` stands instead of its last number."""
    drawn = np.random.default_rng(6)
    angles = drawn.uniform(0.05, 1.3, (300, 4)) * (1, 0, 1, 2)
    ramp = np.linspace(0, 1, len(wavelengths)) ** 2
    lobe = np.exp(-(((angles[:, 0] - angles[:, 2]) / 0.2) ** 2) - (np.pi - angles[:, 3]) ** 2)
    spectra = 0.05 + 0.2 * ramp * np.cos(angles[:, :1]) + lobe[:, None]
    cornell.write(path, torch.from_numpy(angles), torch.from_numpy(spectra), wavelengths)
    if value:
        text = path.read_text()
        path.write_text(text[: text.rstrip().rindex(" ")] + f" {value}\n")
    return path


@pytest.mark.slow
def test_it_writes_a_fit_with_a_basis(run: Callable[..., Ran], tmp_path: Path) -> None:
    paint = measured(tmp_path / "paint.brdf", BANDS)
    ran = run("factorize", paint, *FAST, "--spectral-tolerance", 0.5, "--out", tmp_path / "out", "--json")
    assert ran.code == 0
    said = json.loads(ran.out)
    fit = homofact.load(tmp_path / "out").factorization
    assert isinstance(fit, SpectralFit)
    assert said["bytes"] == fit.nbytes
    assert f"{fit.basis.rank} basis vectors store {len(BANDS)} bands" in ran.err
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert np.array_equal(manifest["basis"]["vectors"], fit.basis.vectors)
    facts = manifest["provenance"]["spectral"]
    assert set(facts["delta_e"]) == {"D65", "A", "F11"}
    assert max(facts["delta_e"].values()) <= 0.5
    smaller = run("factorize", paint, *FAST, "--spectral-tolerance", 50, "--out", tmp_path / "one", "--json")
    assert json.loads(smaller.out)["bytes"] < said["bytes"]


@pytest.mark.parametrize(
    ("wavelengths", "value", "words"),
    [
        ((900, 1100, 1300, 1500, 1700), "", "found 900-1700 nm, expected them to cover 450-650 nm"),
        ((400, 550, 700), "", "found 3 bands, expected at least 5"),
        (BANDS, "nan", "expected"),
        (BANDS, "inf", "expected"),
    ],
)
def test_spectra_that_it_cannot_use_are_refused_in_a_line(
    run: Callable[..., Ran], tmp_path: Path, wavelengths: Sequence[float], value: str, words: str
) -> None:
    paint = measured(tmp_path / "paint.brdf", wavelengths, value)
    ran = run("factorize", paint, *FAST, "--spectral-tolerance", 0.5, "--out", tmp_path / "out")
    assert ran.code == 2
    (line,) = [line for line in ran.err.splitlines() if "starting" not in line and "reading" not in line]
    assert words in line
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_infrared_spectra_are_fitted_in_all_bands(run: Callable[..., Ran], tmp_path: Path) -> None:
    """What the refusals say is possible: without a basis, and read as spectra."""
    paint = measured(tmp_path / "paint.brdf", (900, 1100, 1300, 1500, 1700))
    refused = run("factorize", paint, *FAST[:-2], "--out", tmp_path / "rgb")
    assert refused.code == 2
    assert "keep the spectra with --channels spectral" in refused.err
    assert run("factorize", paint, *FAST, "--out", tmp_path / "out").code == 0
    assert homofact.load(tmp_path / "out").channels == ("900nm", "1100nm", "1300nm", "1500nm", "1700nm")
    assert (tmp_path / "out" / "compare.png").is_file()


def test_wavelengths_that_fall_are_refused(run: Callable[..., Ran], tmp_path: Path) -> None:
    paint = measured(tmp_path / "paint.brdf", BANDS)
    paint.write_text(paint.read_text().replace("400 420", "420 400"))
    ran = run("factorize", paint, *FAST, "--spectral-tolerance", 0.5, "--out", tmp_path / "out")
    assert ran.code == 2
    assert "wavelength 400" in ran.err


@pytest.mark.parametrize("channels", ["rgb", "550nm", "luminance"])
def test_other_channels_are_told_what_is_possible(run: Callable[..., Ran], tmp_path: Path, channels: str) -> None:
    wavelengths = tuple(float(w) for w in range(400, 701, 10))
    paint = measured(tmp_path / "paint.brdf", wavelengths)
    options = (*FAST[:-1], channels, "--spectral-tolerance", 0.5)
    ran = run("factorize", paint, *options, "--out", tmp_path / "out")
    assert ran.code == 2
    assert "spectral-tolerance" in ran.err.replace("_", "-")
    assert ("--channels spectral" in ran.err) == (channels != "550nm")
    assert not (tmp_path / "out").exists()
