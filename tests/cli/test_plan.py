"""`homofact plan` on the command line: the table, the files it leaves, the scenes it refuses."""

import json
from pathlib import Path

import pytest

from homofact.cli.main import main

SCENE = """
[[material]]
source = "material:lafortune-clay"
share = 0.75
[[material]]
source = "material:cook-torrance-plastic"
share = 0.25
[lighting]
named = "sun"
[tolerance]
reflected = 0.25
"""
# The guard: which rung is chosen does not hang on it here.
QUICK = ["--effort", "10", "--budget", "0.1", "--count", "800"]


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    file = tmp_path / "scene.toml"
    file.write_text(SCENE)
    return file


def test_a_plan_leaves_its_choices_and_a_figure(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, figure = tmp_path / "o", tmp_path / "p.png"
    command = ["plan", str(scene), *QUICK, "--write", str(out), "--plot", str(figure), "--against", "overcast"]
    assert main([*command, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    clay, plastic = found["materials"]
    assert clay["choice"]["method"] == "constant"
    assert clay["choice"]["bytes"] == 12
    assert plastic["choice"]["method"] == "search"
    assert plastic["error"] <= 0.25
    assert plastic["fits"] <= 28 / 5
    assert plastic["predicted_terms"] > found["against"]["materials"][1]["predicted_terms"]
    assert found["against"]["bytes"] < found["bytes"]
    assert found["fits"] <= found["exhaustive_fits"] / 5
    assert json.loads((out / "1-lafortune-clay" / "colour.json").read_text())["method"] == "constant"
    assert (out / "2-cook-torrance-plastic" / "factorization.npz").is_file()
    assert json.loads((out / "plan.json").read_text())["materials"][1]["folder"] == "2-cook-torrance-plastic"
    assert figure.stat().st_size > 5000
    assert main([*command]) == 2
    assert "found an existing plan, expected a new folder or --force" in capsys.readouterr().err


def test_an_impossible_tolerance_is_a_warning_or_refused(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene.write_text(SCENE.replace("0.25\n[lighting]", "0.25\n[budget]\nfetches = 0\n[lighting]"))
    assert main(["plan", str(scene), *QUICK]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "Warning: cook-torrance-plastic: reflected 0.25 cannot be met; the best reachable is 0.4" in shown
    assert "missing it by" in shown
    assert main(["plan", str(scene), *QUICK, "--strict"]) == 2
    assert "cannot be met; the best reachable is" in capsys.readouterr().err


def test_a_scene_that_cannot_be_planned(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", str(tmp_path / "none.toml")]) == 2
    assert "no such file, expected a scene in TOML" in capsys.readouterr().err
    scene.write_text(SCENE.replace("0.75", "0.7"))
    assert main(["plan", str(scene)]) == 2
    assert "the shares add up to 0.95, expected 1" in capsys.readouterr().err
    assert main(["plan", str(scene), "--plot", "p.txt"]) == 2
    assert main(["plan", str(scene), "--budget", "0"]) == 2
    assert "budget: found 0.0, expected" in capsys.readouterr().err
    assert main(["plan", str(scene), "--effort", "some"]) == 2
    assert "effort: found 'some', expected quick, normal, thorough, or a number above 0" in capsys.readouterr().err


def test_a_folder_with_something_else_is_left_alone(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "o").mkdir()
    (tmp_path / "o" / "thesis.txt").write_text("years of work")
    assert main(["plan", str(scene), "--write", str(tmp_path / "o"), "--force"]) == 2
    assert "found thesis.txt in it" in capsys.readouterr().err
