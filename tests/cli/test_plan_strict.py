"""`homofact plan --strict`: the plan is printed, then one line names why it is refused, and the exit code is 2."""

import json
from pathlib import Path

import pytest
from refusals import refused

import homofact
from homofact.api.planning import PlanRefused, PlanResult
from homofact.cli.main import main

# One colour is all that no fetch allows.
SCENE = """
[[material]]
source = "material:phong-10"
share = 1
[lighting]
named = "sun"
[tolerance]
reflected = {most}
[budget]
fetches = 0
"""
QUICK = ["--effort", "1", "--count", "300"]


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr("homofact.planning.neighbours.larger", lambda _: None)
    file = tmp_path / "scene.toml"
    file.write_text(SCENE.format(most=0.01))
    return file


def test_a_missed_tolerance_is_printed_and_written_and_then_refused(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tables = []
    for name, strict in (("lenient", []), ("strict", ["--strict"])):
        out, figure = tmp_path / name, tmp_path / f"{name}.png"
        code = main(["plan", str(scene), *QUICK, "--out", str(out), "--plot", str(figure), *strict])
        assert code == (2 if strict else 0)
        said = capsys.readouterr()
        tables.append(said.out)
        assert json.loads((out / "plan.json").read_text())["materials"][0]["met"] is False
        assert figure.is_file()
    assert tables[0] == tables[1]
    assert "closest found" in tables[1]
    last = said.err.splitlines()[-1]
    assert last.startswith("homofact: phong-10: no representation was found that meets reflected 0.01 within 0 fetches")


def test_a_fit_that_its_verdict_refuses_is_printed_and_not_written(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene.write_text(SCENE.format(most=1.9))
    out = tmp_path / "out"
    assert main(["plan", str(scene), *QUICK, "--strict", "--json", "--out", str(out)]) == 2
    said = capsys.readouterr()
    assert json.loads(said.out)["materials"][0]["met"] is True
    assert not out.exists()
    assert "The choices:" not in said.err
    assert "refused because it is" in said.err.splitlines()[-1]


def test_in_python_the_error_has_the_plan(scene: Path) -> None:
    with refused("^phong-10: no representation was found that meets reflected 0.01 ") as caught:
        homofact.plan(scene, effort=1, count=300, strict=True)
    assert isinstance(caught.value, PlanRefused)
    found = caught.value.result
    assert isinstance(found, PlanResult)
    assert not found.plan.materials[0].walk.met
