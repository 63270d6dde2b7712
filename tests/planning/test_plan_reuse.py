"""What a plan draws once: a white sphere a lighting, and every fit a material; with the same errors as drawn anew."""

import math
from dataclasses import astuple

import pytest
import torch

from homofact.brdf.analytic import BlinnPhong
from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.sampling import Drawable, sample_model
from homofact.brdf.source import Source
from homofact.planning.ladder import CONSTANT, Candidate, FitOptions
from homofact.planning.measure import RepresentationEvaluator
from homofact.planning.stage import Stage
from homofact.rendering.light import DirectionalLight
from homofact.scene.lighting import Lighting, named_lighting

QUICK = FitOptions(effort=10, count=400)
PAINT = BlinnPhong((0.2, 0.3, 0.4), (0.3, 0.3, 0.3), exponent=20)
GREY = BlinnPhong((0.2,), (0.3,), exponent=20, channels=("G",))
COLOURED = Lighting("coloured", (DirectionalLight((0.3, 0.2, 0.9), (1.0, 2.0, 3.0)),))


def judged_by(stage: Stage, model: Drawable = PAINT) -> RepresentationEvaluator:
    return RepresentationEvaluator(Source("own", "material", sample_model(model, 400), model, 1e-5, 0.0), stage, QUICK)


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Reflectance]:
    """What stages have drawn, one entry a drawing."""
    honest, seen = Stage.draw, []

    def counted(stage: Stage, reflectance: Reflectance) -> list[torch.Tensor]:
        seen.append(reflectance)
        return honest(stage, reflectance)

    monkeypatch.setattr(Stage, "draw", counted)
    return seen


@pytest.mark.parametrize("light", [COLOURED, named_lighting("overcast")], ids=["lamp", "sky"])
@pytest.mark.parametrize("model", [PAINT, GREY], ids=["colour", "grey"])
def test_one_colour_errs_as_it_does_when_it_is_drawn(light: Lighting, model: BlinnPhong) -> None:
    judge = judged_by(Stage.of(light, views=3), model)
    colour = Lambert((0.1, 0.5, 0.9)[: len(model.channels)], channels=model.channels)
    found, expected = judge.colour_errors(Candidate(CONSTANT), colour), judge.errors(colour)
    # Filtered light is summed in single precision.
    assert astuple(found) == pytest.approx(astuple(expected), rel=1e-5)


def test_materials_share_the_white_sphere_of_their_channels(drawn: list[Reflectance]) -> None:
    stage = Stage.of(COLOURED, views=3)
    for model in (PAINT, Lambert((0.3, 0.3, 0.3)), GREY):
        judge = judged_by(stage, model)
        names = judge.source.samples.channels
        assert judge.to_white[0].shape == (len(names),)
        judge.colour_errors(Candidate(CONSTANT), Lambert((0.5,) * len(names), channels=names))
    whites = [each for each in drawn if isinstance(each, Lambert) and set(each.diffuse) == {1.0}]
    assert [len(each.channels) for each in whites] == [3, 1]
    assert len(drawn) == 3 + 2


def test_a_fit_is_drawn_once_whatever_it_is_asked_for(drawn: list[Reflectance]) -> None:
    judge = judged_by(Stage.of(COLOURED, views=3))
    fit = BlinnPhong((0.2, 0.2, 0.2), (0.3, 0.3, 0.3), exponent=30)
    walked = judge.errors(fit, ("reflected",))
    shown = judge.errors(fit)
    assert len(drawn) == 2
    assert shown.reflected == walked.reflected
    assert math.isfinite(shown.delta_e)


def test_fits_that_come_and_go_do_not_take_each_others_place() -> None:
    """A new fit may lie where one was that is gone."""
    stage = Stage.of(COLOURED, views=3)
    judge = judged_by(stage)
    for diffuse in torch.linspace(0.1, 0.9, 12).tolist():
        found = judge.errors(BlinnPhong((diffuse,) * 3, (0.3,) * 3, exponent=30), ("reflected",))
        expected = judged_by(stage).errors(BlinnPhong((diffuse,) * 3, (0.3,) * 3, exponent=30), ("reflected",))
        assert found == expected
