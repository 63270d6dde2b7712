"""Spheres of fits and sources under a lamp and a sky, and which sources can be asked."""

import gc
import json
import math
import weakref
from pathlib import Path

import pytest
import torch

from homofact.brdf.analytic import Lambert, Ward
from homofact.brdf.analytic.common import AnalyticModel
from homofact.brdf.materials import material
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import Source, open_source
from homofact.evaluation.appearance import Appearance, appearance, mean_figures
from homofact.evaluation.image_metrics import psnr
from homofact.evaluation.metric_table import LIGHT
from homofact.rendering.fixed_lights import sky_map
from homofact.rendering.sphere import render_sphere
from homofact.rendering.tonemap import choose_middle, displayed

SYNTHETIC = Path(__file__).parents[2] / "data_synthetic" / "synthetic_cornell.brdf"


def looks(fit: AnalyticModel, model: AnalyticModel) -> Appearance:
    samples = sample_model(model, 50)
    found = appearance(fit, Source("model", "material", samples, model, 1e-5, 0.0))
    assert found is not None
    return found


def test_a_fit_that_is_its_source_differs_nowhere() -> None:
    source = open_source("material:cook-torrance-plastic", count=200)
    found = appearance(source.reflectance, source)
    assert found is not None
    assert found.psnr_light == found.psnr_sky == math.inf
    assert found.energy.albedo_worst == 1
    record = json.loads(json.dumps(found.record(), allow_nan=False))
    assert record["psnr_sky"] is None
    assert record["highlight"] == 1


def test_more_fault_is_less_psnr() -> None:
    source = Ward((0.2, 0.1, 0.05), (0.1,) * 3, 0.1, 0.1)
    fits = [Ward((0.2, 0.1, 0.05), (0.1 * loss,) * 3, 0.1, 0.1) for loss in (0.99, 0.9, 0.6, 0.0)]
    found = [looks(fit, source) for fit in fits]
    for each in ([one.psnr_light for one in found], [one.psnr_sky for one in found]):
        assert each == sorted(each, reverse=True)
        assert each[0] > 35
        assert each[-1] < 25


@pytest.mark.parametrize("name", ["cook-torrance-plastic", "ward-brushed"])
def test_psnr_under_the_sky_is_that_of_a_rendered_picture(name: str) -> None:
    source, fit = material(name).model, Lambert((0.3, 0.2, 0.15))
    theirs, mine = (render_sphere(each, sky_map(128), 48, samples=512) for each in (source, fit))
    exposure = choose_middle(theirs)
    shown = [displayed(each, exposure, curve="filmic") for each in (theirs, mine)]
    expected = psnr(shown[0], shown[1], theirs.coverage == 1)
    assert looks(fit, source).psnr_sky == pytest.approx(expected, abs=0.6)


def test_the_source_is_asked_once_for_several_fits(monkeypatch: pytest.MonkeyPatch) -> None:
    model, asked = Lambert((0.5,), channels=("Y",)), []
    original = Lambert.evaluate

    def counted(self: Lambert, wi: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
        asked.extend([len(wi)] * (self is model))
        return original(self, wi, wo)

    monkeypatch.setattr(Lambert, "evaluate", counted)
    source = Source("model", "material", sample_model(model, 50), model, 1e-5, 0.0)
    first = appearance(Lambert((0.4,), channels=("Y",)), source)
    once = sum(asked)
    second = appearance(Lambert((0.6,), channels=("Y",)), source)
    assert sum(asked) == once > 1000
    assert first is not None
    assert second is not None
    assert (first.energy.energy_overall, second.energy.energy_overall) == pytest.approx((0.8, 1.2))
    # Another source that is equal in nothing but its name is asked anew.
    black = Lambert((0.25,), channels=("Y",))
    other = appearance(model, Source("model", "material", sample_model(black, 50), black, 1e-5, 0.0))
    assert other is not None
    assert other.energy.energy_overall == pytest.approx(2.0)


def test_no_source_is_kept_alive() -> None:
    model = Lambert((0.5,), channels=("Y",))
    source = Source("model", "material", sample_model(model, 50), model, 1e-5, 0.0)
    assert appearance(model, source) is not None
    there = weakref.ref(source)
    del source
    gc.collect()
    assert there() is None


def test_means_of_figures() -> None:
    nothing = dict.fromkeys(LIGHT)
    one, two = ({**nothing, "rms": 1.0, "floor": 2.0}, {**nothing, "rms": 2.0})
    assert mean_figures([one, two]) == {**nothing, "rms": 1.5}
    found = looks(Lambert((0.3,), channels=("Y",)), Lambert((0.6,), channels=("Y",)))
    assert set(LIGHT) <= set(found.record())
    assert found.figures["albedo_worst"] == pytest.approx(0.5)


def test_samples_alone_have_no_appearance() -> None:
    source = open_source(str(SYNTHETIC))
    assert appearance(Lambert((0.3, 0.2, 0.1)), source) is None
    single = open_source(str(SYNTHETIC), channels="luminance")
    assert appearance(Lambert((0.3,), channels=("Y",)), single) is None
