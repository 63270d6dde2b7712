"""Opening a SOURCE and describing it."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from refusals import refused

from homofact.brdf.analytic import Lafortune
from homofact.brdf.formats.csv import write as write_csv
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.scattered import Scattered
from homofact.brdf.source import describe, open_source

SYNTHETIC = Path(__file__).resolve().parents[2] / "data_synthetic"


def test_a_material_is_sampled_as_asked() -> None:
    source = open_source("material:lafortune-blue-paint", count=500, scheme="cosine", seed=3)
    assert (source.name, source.kind, source.default_epsilon) == ("lafortune-blue-paint", "material", 1e-5)
    assert isinstance(source.reflectance, Lafortune)
    assert len(source.samples) == 500
    assert source.samples.provenance["sampling"] == {"scheme": "cosine", "noise_free": True, "seed": 3}
    assert source.seconds_read > 0
    again = open_source("material:lafortune-blue-paint", count=500, scheme="cosine", seed=4)
    assert not torch.equal(again.samples.wi, source.samples.wi)


def test_the_default_is_the_thesiss_45000() -> None:
    assert len(open_source("material:phong-10").samples) == 45_000


def test_a_measurement_is_interpolated() -> None:
    source = open_source(str(SYNTHETIC / "synthetic_cornell.brdf"))
    assert (source.name, source.kind, source.default_epsilon) == (
        "synthetic_cornell.brdf",
        "measurement",
        1e-2,
    )
    assert isinstance(source.reflectance, Scattered)
    assert isinstance(source.reflectance, Reflectance)
    assert source.samples.channels == source.reflectance.channels == ("R", "G", "B")
    found = source.reflectance.evaluate(source.samples.wi, source.samples.wo)
    assert float((found / source.samples.values - 1).abs().median()) < 0.1


def test_embedded_models_keep_the_noise_free_epsilon() -> None:
    source = open_source(str(SYNTHETIC / "blue_paint.npz"))
    assert (source.kind, source.default_epsilon) == ("measurement", 1e-5)
    assert isinstance(source.reflectance, Scattered)
    assert source.reflectance.epsilon == 1e-5


def test_channels_reach_samples_and_reflectance() -> None:
    grey = open_source("material:phong-30", channels="luminance", count=50)
    assert grey.samples.channels == grey.reflectance.channels == ("Y",)
    found = grey.reflectance.evaluate(grey.samples.wi, grey.samples.wo)
    assert torch.allclose(found, grey.samples.values)
    spectral = open_source(str(SYNTHETIC / "synthetic_cornell.brdf"), channels="spectral")
    assert len(spectral.reflectance.channels) == 31


@pytest.mark.parametrize(
    ("text", "arguments", "message"),
    [
        ("material:blue", {}, "material: found 'blue'"),
        ("material:", {}, "material: found ''"),
        ("material:phong-10", {"channels": "spectral"}, "an RGB model, expected rgb or luminance"),
        ("material:phong-10", {"channels": "x"}, "channels: found 'x'"),
        ("material:phong-10", {"count": 0}, "sample count: found 0"),
        ("material:phong-10", {"scheme": "x"}, "sampling scheme: found 'x'"),
        ("nowhere.brdf", {}, "nowhere.brdf: no such file"),
        (str(SYNTHETIC), {}, "a folder, expected a BRDF file"),
        (str(SYNTHETIC / "manifest.json"), {}, "of no known format"),
        (str(SYNTHETIC / "plastic.npz"), {"channels": "spectral"}, "have R, G, B, expected a spectrum"),
    ],
)
def test_bad_sources_are_refused(text: str, arguments: dict, message: str) -> None:
    with refused(message):
        open_source(text, **arguments)


def test_description_of_a_measurement() -> None:
    facts = describe(open_source(str(SYNTHETIC / "synthetic_cornell.brdf")))
    assert json.loads(json.dumps(facts)) == facts
    assert facts["format"] == "cornell"
    assert facts["comments"][0] == "Synthetic measurement, not of any real surface"
    assert facts["wavelengths_nm"][:2] == [400, 410]
    assert facts["samples"] == 284
    assert facts["theta_i_degrees"] == pytest.approx([10, 70], abs=1e-3)
    assert facts["theta_o_degrees"] == pytest.approx([0, 76], abs=1e-3)
    assert facts["faults"]["exact_zeros"] > 0
    assert facts["colour"]["illuminant"] == "D65"
    assert facts["isotropic"] is True
    assert set(facts["values_per_sr"]) == {"R", "G", "B"}
    green = facts["values_per_sr"]["G"]
    assert 0 < green["min"] < green["mean"] < green["max"]
    assert green["zeros"] == 0


def test_description_of_a_material() -> None:
    facts = describe(open_source("material:ward-brushed", count=100))
    assert json.loads(json.dumps(facts)) == facts
    assert facts["format"] == "analytic model"
    assert facts["isotropic"] is False
    assert facts["material"]["model"] == "Ward"
    assert facts["material"]["parameters"]["alpha_y"] == 0.13
    assert facts["wavelengths_nm"] is None
    assert facts["sampling"]["scheme"] == "lobe"


@pytest.mark.parametrize("noise", [0.02, 0.1])
def test_the_scatter_of_a_list_is_its_noise_and_a_model_has_none(noise: float, tmp_path: Path) -> None:
    samples = open_source("material:phong-10", count=3000, scheme="discs", seed=1).samples
    random = torch.randn(samples.values.shape, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    write_csv(str(tmp_path / "list.csv"), replace(samples, values=samples.values * torch.exp(noise * random)))
    found = describe(open_source(str(tmp_path / "list.csv")))["faults"]["scatter"]
    assert noise * 0.8 < found < noise * 1.6
    assert "scatter" not in describe(open_source("material:phong-10", count=300))["faults"]
