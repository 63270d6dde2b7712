"""Plans by what people would notice: the error under the study's light, and the named tolerance."""

import json
import math
from pathlib import Path

import pytest
import torch
from refusals import refused
from torch import Tensor

from homofact.brdf.analytic import BlinnPhong, Lambert
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import Source
from homofact.cli.main import main
from homofact.evaluation.fixed_pictures import study_difference, study_picture
from homofact.evaluation.opinion import opinion_table
from homofact.planning.ladder import CONSTANT, Candidate, FitOptions
from homofact.planning.measure import RepresentationEvaluator
from homofact.planning.stage import Stage
from homofact.planning.tolerance import Tolerance
from homofact.scene.lighting import named_lighting

MODEL = BlinnPhong((0.2, 0.1, 0.1), (0.3, 0.3, 0.3), exponent=40)
WORSE = BlinnPhong((0.2, 0.1, 0.1), (0.2, 0.2, 0.2), exponent=40)
ALONE = ("delta_e_study",)
SYNTHETIC = Path(__file__).parents[2] / "data_synthetic" / "synthetic_cornell.brdf"
QUICK = ["--effort", "1", "--budget", "60", "--count", "800"]


def judge(light: str) -> RepresentationEvaluator:
    source = Source("own", "material", sample_model(MODEL, 400), MODEL, 1e-5, 0.0)
    return RepresentationEvaluator(source, Stage.of(named_lighting(light)), FitOptions(effort=10, count=400))


def scene(folder: Path, source: str, lighting: str = "overcast", tolerance: str = "delta_e = 5") -> Path:
    file = folder / "scene.toml"
    text = (
        f'[[material]]\nsource = "{source}"\nshare = 1.0\n[lighting]\nnamed = "{lighting}"\n[tolerance]\n{tolerance}\n'
    )
    file.write_text(text, encoding="utf-8")
    return file


def test_the_scene_s_lighting_does_not_matter() -> None:
    found = {light: judge(light).errors(WORSE, ALONE).delta_e_study for light in ("sun", "overcast")}
    expected = study_difference(study_picture(MODEL), study_picture(WORSE))
    assert found == {"sun": expected, "overcast": expected}
    assert judge("sun").errors(MODEL, ALONE).delta_e_study == 0
    colour = Lambert((0.3, 0.2, 0.2))
    in_colour = judge("sun").colour_errors(Candidate(CONSTANT), colour, ALONE)
    assert in_colour.delta_e_study == study_difference(study_picture(MODEL), study_picture(colour))
    assert math.isnan(in_colour.reflected)
    assert not Tolerance.of(delta_e_study=1.0).of_light


def test_what_is_not_finite_is_infinitely_wrong() -> None:
    class Broken(Lambert):
        def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
            return torch.full((len(wi), 3), math.nan, dtype=torch.float64)

    assert judge("sun").errors(Broken((0.1,) * 3), ALONE).delta_e_study == math.inf


def test_visible_is_what_the_law_leaves_unseen() -> None:
    ((kind, limit),) = Tolerance.named("visible").limits
    assert kind == "delta_e_study"
    assert limit == pytest.approx(opinion_table().law.unseen, rel=0.01)
    with refused(where="tolerance", found="'hidden'"):
        Tolerance.named("hidden")


@pytest.mark.slow
def test_a_visible_plan_states_the_grade_and_no_light(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["plan", str(scene(tmp_path, "material:lafortune-clay")), *QUICK, "--tolerance", "visible"]
    assert main([*command, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    limit = Tolerance.named("visible").limits[0][1]
    assert found["tolerance"] == {"delta_e_study": limit}
    (clay,) = found["materials"]
    assert clay["met"]
    assert clay["error"] == clay["measured"]["overcast"]["delta_e_study"] == clay["opinion"]["delta_e_study"] <= limit
    assert clay["error_lighting"] == ""
    assert clay["opinion"] == opinion_table().law.opinion(clay["error"]).record()
    assert main(command) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "Identical pictures get 4.4 (" in printed
    assert "so the scene's lighting does not change this plan" in printed


@pytest.mark.slow
def test_a_limit_in_the_scene_s_file_is_met_by_more_bytes_where_it_is_tighter(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spent = []
    for limit in (20.0, 2.0):
        file = scene(tmp_path, "material:cook-torrance-plastic", tolerance=f"delta_e_study = {limit}")
        assert main(["plan", str(file), *QUICK, "--json"]) == 0
        (plastic,) = json.loads(capsys.readouterr().out)["materials"]
        assert plastic["met"]
        assert plastic["error"] <= limit
        spent.append(plastic["choice"]["bytes"])
    assert spent[0] < spent[1]


def test_samples_alone_are_not_graded(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = scene(tmp_path, str(SYNTHETIC))
    assert main(["plan", str(file), *QUICK, "--tolerance", "visible"]) == 2
    error = capsys.readouterr().err
    assert "delta_e_study (that of visible)" in error
    assert SYNTHETIC.name in error
    assert "Traceback" not in error


def test_another_name_and_a_scene_of_relighting_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", str(scene(tmp_path, "material:lafortune-clay")), "--tolerance", "hidden"]) == 2
    assert "tolerance: found 'hidden', expected one of visible" in capsys.readouterr().err
