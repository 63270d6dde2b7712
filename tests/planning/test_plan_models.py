"""GGX models among the representations of a plan: their sizes, their words, where they are chosen, what is written."""

from pathlib import Path

import pytest

import homofact
from homofact.api.planning import PlanResult
from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.sampling import sample_model
from homofact.methods.models import Ggx
from homofact.parametric.model_fit import ModelFit
from homofact.planning.ladder import LADDER, Candidate, FitOptions, fits_among, ladder, method_of

GREY = GgxBrdf((0.3,), (GgxLobe((0.5,), 0.2, 0.1),), channels=("Y",))
LACQUER = GgxBrdf((0.05, 0.2, 0.4), (GgxLobe((1.0, 1.0, 1.0), 0.12, 0.05),))
MODELS = {"ggx": 1, "ggx:2": 2}


@pytest.mark.parametrize(("name", "lobes"), MODELS.items())
def test_a_models_bytes_are_those_of_its_fit(name: str, lobes: int) -> None:
    rung = Candidate(name)
    assert rung in LADDER
    method = method_of(rung, FitOptions())
    assert isinstance(method, Ggx)
    assert (method.lobes, rung.lobes) == (lobes, lobes)
    for model in (LACQUER, GREY):
        fit = method.fit(sample_model(model, 400, "lobe", 0))
        assert rung.most_bytes(len(model.channels)) == fit.factorization.nbytes
        assert rung.most_fetches(True) == fit.factorization.fetches == 0


def test_a_model_comes_after_a_colour_and_before_textures() -> None:
    rungs = [each.method for each in ladder()]
    assert rungs[:3] == ["constant", "lambert-9", "ggx"]
    assert all(rungs.count(name) == 1 for name in MODELS)
    assert fits_among([Candidate("ggx"), Candidate("ggx:2"), Candidate("constant")]) == 2


def test_a_material_that_is_a_lobe_is_planned_as_one_and_can_be_exported(tmp_path: Path) -> None:
    samples = sample_model(LACQUER, 1500, "lobe", 0)
    place = tmp_path / "lacquer.npz"
    homofact.convert(samples, place)
    scene = tmp_path / "scene.toml"
    scene.write_text(
        f'[[material]]\nsource = "{place}"\nshare = 1.0\n\n'
        '[lighting]\nnamed = "overcast"\n\n[tolerance]\ndelta_e = 1.0\n'
    )
    found = homofact.plan(scene, tmp_path / "plan", effort=1)
    assert isinstance(found, PlanResult)
    chosen = found.plan.materials[0]
    assert chosen.walk.met
    assert chosen.walk.choice == Candidate("ggx")
    assert Candidate("ggx").words == "GGX model, 1 lobe"
    assert chosen.outcome is not None
    assert (chosen.outcome.bytes, chosen.outcome.fetches) == (32, 0)
    assert found.folders is not None
    folder = tmp_path / "plan" / next(iter(found.folders.values()))
    fit = homofact.load(folder)
    assert isinstance(fit.factorization, ModelFit)
    assert homofact.export(folder, tmp_path / "engine", engine="three").cost.fetches == 0
