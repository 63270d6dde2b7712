"""The setting `spectral_tolerance`: fits of a spectrum by few basis vectors, and where it is refused."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from refusals import refused

import homofact
from homofact.brdf.samples import Samples
from homofact.brdf.wavelengths import spectral_names
from homofact.factor.spectral_fit import SpectralFit
from homofact.geometry.directions import draw_in_discs
from homofact.methods.method import Method
from homofact.methods.search_fit import fit_shared

BANDS = np.arange(400.0, 701.0, 10.0)


def paint(count: int = 1500, channels: tuple[str, ...] = spectral_names(BANDS.tolist())) -> Samples:
    """A green ground under a lobe whose blue is stronger, each a function of one angle: log spectra of rank 2."""
    wi, wo = draw_in_discs(count, torch.Generator().manual_seed(2))
    half = torch.nn.functional.normalize(wi + wo, dim=1)
    lobe = 2 * torch.exp(-(((1 - half[:, 2]) / 0.1) ** 2))
    slope = torch.cos(torch.acos((wi * half).sum(1).clamp(-1, 1)) * 2)
    bands = torch.from_numpy(BANDS[: len(channels)])
    ground = torch.exp(-(((bands - 540) / 60) ** 2))
    logs = lobe[:, None] * (1 + (550 - bands) / 300) + slope[:, None] * ground
    return Samples(wi, wo, 0.05 * logs.exp(), torch.ones(count, dtype=torch.float64), channels)


METHODS = {
    "mccool": homofact.McCool(projections=("theta_h-theta_d", "wi"), size=10, epsilon=1e-6),
    "cole": homofact.Cole(textures=1, size=8, restarts=1, search_samples=200, search_size=4, epsilon=1e-6),
    "search": homofact.Search(textures=1, size=10, effort="quick", epsilon=1e-6, objective="log"),
}


@pytest.mark.parametrize("name", METHODS)
def test_spectra_of_rank_two_take_two_vectors(name: str) -> None:
    """A fit of logarithms is linear in them: whatever it errs by, it stays of their rank."""
    method = METHODS[name]
    whole = method.fit(paint()).factorization
    found = replace(method, spectral_tolerance=0.01).fit(paint())
    made = found.factorization
    assert isinstance(made, SpectralFit)
    assert made.basis.rank == 2
    assert found.report.details["spectral"]["rank"] == 2
    assert "2 basis vectors store 31 bands" in found.report.notes[-1]
    assert made.nbytes < whole.nbytes / 8
    wi, wo = draw_in_discs(300, torch.Generator().manual_seed(9))
    assert torch.allclose(made.evaluate(wi, wo), whole.evaluate(wi, wo), rtol=0.02)


def test_without_it_a_fit_stores_all_bands() -> None:
    assert METHODS["mccool"].fit(paint()).factorization.textures[0].texels.shape[2] == 31


@pytest.mark.parametrize("storage", ["png8", "png16"])
def test_whole_numbers_are_those_of_the_coordinates(storage: str) -> None:
    method = replace(METHODS["mccool"], spectral_tolerance=0.1)
    plain, whole = (each.fit(paint()).factorization for each in (method, replace(method, quantize=storage)))
    assert isinstance(whole, SpectralFit)
    assert whole.basis.rank == plain.textures[0].texels.shape[2]
    for texture in whole.textures:
        assert texture.grid is not None
        steps = ((texture.texels - texture.grid.low) / texture.grid.step)[texture.mask]
        assert steps == pytest.approx(np.round(steps), abs=1e-6)
    wi, wo = draw_in_discs(300, torch.Generator().manual_seed(9))
    off = (whole.evaluate(wi, wo) / plain.evaluate(wi, wo)).log().abs()
    assert float(off.median()) < {"png8": 0.02, "png16": 2e-4}[storage]


@pytest.mark.parametrize(
    ("channels", "where", "found"),
    [
        (("R", "G", "B"), "spectral_tolerance: channels", "R, G, B"),
        (("550nm",), "spectral_tolerance: wavelengths", "550 nm alone"),
        (("900nm", "1300nm", "1700nm"), "spectral_tolerance: wavelengths", "900-1700 nm"),
        (("400nm", "700nm", "550nm"), "spectral_tolerance: wavelengths", "550 nm follows 700 nm"),
        (("400nm", "550nm", "700nm"), "spectral_tolerance: channels", "3 bands"),
    ],
)
@pytest.mark.parametrize("method", ["mccool", "search"])
def test_other_channels_are_refused_before_the_fit(
    method: str, channels: tuple[str, ...], where: str, found: str
) -> None:
    with refused(where=where, found=found) as caught:
        replace(METHODS[method], spectral_tolerance=0.5).fit(paint(400, channels))
    assert caught.value.hint


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_a_tolerance_is_a_number_above_zero(value: float) -> None:
    with refused(where="spectral_tolerance"):
        homofact.McCool(spectral_tolerance=value)


@pytest.mark.parametrize("beside", [{"bytes": 4096}, {"confidence": True}])
def test_it_is_refused_beside_what_it_cannot_keep(beside: dict[str, Any]) -> None:
    with refused(where="spectral_tolerance", found=f"it beside {next(iter(beside))}"):
        homofact.Search(spectral_tolerance=0.5, **beside)


def test_several_materials_under_one_search_are_refused() -> None:
    method = replace(METHODS["search"], spectral_tolerance=0.5)
    with refused(where="spectral_tolerance", found="it for 2 materials"):
        fit_shared((paint(400), paint(400)), method)


@pytest.mark.slow
def test_a_front_fit_answers_on_arrays_and_trains_in_all_bands(tmp_path: Path) -> None:
    method: Method = replace(METHODS["mccool"], spectral_tolerance=0.1)
    fit = homofact.fit(paint(), method)
    wi, wo = draw_in_discs(50, torch.Generator().manual_seed(9))
    expected = fit.evaluate(wi, wo)
    assert fit.evaluate(wi.numpy(), wo.numpy()) == pytest.approx(expected.numpy(), rel=1e-9)
    assert torch.allclose(fit.module()(wi, wo), expected, rtol=1e-9)
    fit.save(tmp_path / "fit.npz")
    assert torch.equal(homofact.load(tmp_path / "fit.npz").evaluate(wi, wo), expected)


@pytest.mark.slow
def test_an_export_for_engines_says_what_is_possible(tmp_path: Path) -> None:
    fit = homofact.fit(paint(), replace(METHODS["mccool"], spectral_tolerance=0.1))
    with refused(where="channels", found="31"):
        fit.export(tmp_path / "engine")
    assert not (tmp_path / "engine").exists()
