"""Choosing channels: spectra, RGB and what is neither."""

import pytest
import torch
from refusals import refused

from homofact.brdf.channels import LuminanceOf, OneChannel, as_channels, display_of
from homofact.brdf.materials import material
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import open_source
from homofact.brdf.spectral import LUMINANCE
from homofact.brdf.wavelengths import spectral_names, wavelengths_of

WAVELENGTHS = (400.0, 500.0, 600.0, 700.0)


def spectral() -> Samples:
    paint = sample_model(material("lafortune-blue-paint").model, 20)
    return Samples(
        paint.wi,
        paint.wo,
        paint.values[:, :1].expand(20, 4),
        channels=spectral_names(WAVELENGTHS),
        isotropic=True,
        provenance={"format": "made up"},
    )


def test_names_and_wavelengths_round_trip() -> None:
    assert spectral_names(WAVELENGTHS) == ("400nm", "500nm", "600nm", "700nm")
    assert wavelengths_of(("400nm", "512.5nm")) == (400, 512.5)
    assert wavelengths_of(("R", "G", "B")) is None
    assert wavelengths_of(("400nm", "G")) is None
    assert wavelengths_of(("400nm", "7")) is None
    assert wavelengths_of(("shortnm",)) is None
    assert wavelengths_of(()) is None


def test_a_grey_spectrum_becomes_grey() -> None:
    samples = spectral()
    rgb = as_channels(samples, "rgb")
    assert rgb.channels == ("R", "G", "B")
    assert torch.allclose(rgb.values, samples.values[:, :3], atol=1e-12)
    assert rgb.provenance["format"] == "made up"
    assert rgb.provenance["colour"]["illuminant"] == "D65"
    assert rgb.provenance["colour"]["space"] == "linear sRGB"
    luminance = as_channels(samples, "luminance")
    assert luminance.channels == ("Y",)
    assert torch.allclose(luminance.values, samples.values[:, :1], atol=1e-12)
    assert as_channels(samples, "spectral") is samples


def test_rgb_becomes_luminance_and_never_a_spectrum() -> None:
    paint = sample_model(material("lafortune-blue-paint").model, 20)
    luminance = as_channels(paint, "luminance")
    assert torch.allclose(luminance.values[:, 0], paint.values @ torch.tensor(LUMINANCE).double(), atol=1e-7)
    assert as_channels(paint, "rgb") is paint
    with refused(where="channels"):
        as_channels(paint, "spectral")


def test_unknown_choice_is_refused() -> None:
    with refused(where="channels", found="'grey'"):
        as_channels(spectral(), "grey")


def test_luminance_of_a_reflectance() -> None:
    model = material("lafortune-blue-paint").model
    grey = LuminanceOf(model)
    assert (grey.channels, grey.fetches, grey.nbytes) == (("Y",), 0, model.nbytes)
    samples = sample_model(model, 20)
    assert torch.allclose(grey.evaluate(samples.wi, samples.wo), as_channels(samples, "luminance").values)


def test_bands_without_a_colour_show_as_their_mean() -> None:
    values = torch.tensor([[0.1, 0.2, 0.6], [1.0, 2.0, 0.0]], dtype=torch.float64)
    for names in (("900nm", "1100nm", "1700nm"), ("400nm", "450nm", "500nm")):
        shown = display_of(names)
        assert shown is not None
        assert torch.allclose(shown(values), torch.tensor([[0.3], [1.0]]).double().expand(2, 3))
    coloured = display_of(("450nm", "550nm", "650nm"))
    assert coloured is not None
    assert float(coloured(values).std(1).min()) > 0.01


def test_luminance_weights_are_srgbs() -> None:
    import colour

    space = colour.RGB_COLOURSPACES["sRGB"]
    row = colour.normalised_primary_matrix(space.primaries, space.whitepoint)[1]
    assert list(LUMINANCE) == pytest.approx(list(row), abs=1e-8)


def test_one_channel_reflects_as_that_column() -> None:
    source = open_source("material:lafortune-blue-paint", count=50)
    one = OneChannel(source.reflectance, "G")
    wi, wo = source.samples.wi, source.samples.wo
    assert (one.channels, one.nbytes, one.fetches) == (
        ("G",), source.reflectance.nbytes, source.reflectance.fetches,
    )  # fmt: skip
    assert torch.equal(one.evaluate(wi, wo), source.reflectance.evaluate(wi, wo)[:, 1:2])
