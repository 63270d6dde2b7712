"""`homofact plan` on the command line: the table, the files it leaves, the scenes it refuses."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from homofact.api.planning import PlanResult
from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.formats.csv import write as write_csv
from homofact.brdf.sampling import sample_model
from homofact.cli.main import main
from homofact.planning import ladder

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
reflected = 0.7
"""
# Work is counted, and the clock does not cut it short: every machine finds the same fits, the faulty one included.
QUICK = ["--effort", "1", "--budget", "60", "--count", "800"]


@pytest.fixture
def without_models(monkeypatch: pytest.MonkeyPatch) -> None:
    """GGX models are left out: they would meet every tolerance here, in 32 bytes."""
    monkeypatch.setattr(ladder, "LADDER", tuple(rung for rung in ladder.LADDER if not rung.lobes))


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    file = tmp_path / "scene.toml"
    file.write_text(SCENE)
    return file


@pytest.mark.usefixtures("without_models")
@pytest.mark.slow
def test_a_plan_leaves_its_choices_and_a_figure(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, figure = tmp_path / "o", tmp_path / "p.png"
    command = ["plan", str(scene), *QUICK, "--out", str(out), "--plot", str(figure), "--against", "overcast"]
    assert main([*command, "--json"]) == 0
    streams = capsys.readouterr()
    found = json.loads(streams.out)
    # The first that has textures.
    assert f"homofact export {out / '2-cook-torrance-plastic'} --out FOLDER --engine three" in streams.err
    clay, plastic = found["materials"]
    assert clay["choice"]["method"] == "constant"
    assert clay["choice"]["bytes"] == 12
    assert plastic["choice"]["method"] == "search"
    assert plastic["error"] <= 0.7
    assert plastic["of_tolerance"] <= 1
    assert plastic["error"] * found["margins"]["reflected"] / 0.7 == plastic["of_tolerance"]
    assert plastic["fits"] <= 31 / 5
    assert plastic["needed_terms"] > found["against"]["materials"][1]["needed_terms"]
    assert plastic["smaller"]["bytes"] < plastic["choice"]["bytes"] < plastic["larger"]["bytes"]
    assert plastic["smaller"]["of_tolerance"] > 1 >= plastic["of_tolerance"] > plastic["larger"]["of_tolerance"]
    assert {"summary", "findings", "trusted"} <= set(plastic["verdict"])
    assert "predicted_reflected" not in json.dumps(found)
    assert set(clay["asked"][0]["reflected_over_all_turnings"]) == {"sun"}
    assert not any("reflected_over_all_turnings" in each for each in plastic["asked"] if each["textures"])
    assert found["against"]["bytes"] < found["bytes"]
    assert found["fits"] <= found["exhaustive_fits"] / 5
    assert json.loads((out / "1-lafortune-clay" / "colour.json").read_text())["method"] == "constant"
    assert plastic["choice"]["storage"] == "png8"
    assert (out / "2-cook-torrance-plastic" / "texture_0.png").is_file()
    written = json.loads((out / "2-cook-torrance-plastic" / "manifest.json").read_text())
    assert (written["texture_format"], written["textures"][0]["storage"]) == ("png8", "unorm8")
    assert json.loads((out / "plan.json").read_text())["materials"][1]["folder"] == "2-cook-torrance-plastic"
    assert figure.stat().st_size > 5000
    assert main([*command]) == 2
    assert "found an existing plan, expected a new folder or --force" in capsys.readouterr().err


@pytest.mark.slow
def test_quiet_says_nothing_where_a_plan_is_written(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # Verdicts under the other lighting are for --json alone.
    monkeypatch.setattr(PlanResult, "record", None)
    scene.write_text(SCENE.replace("cook-torrance-plastic", "lafortune-clay"))
    assert main(["plan", str(scene), *QUICK, "--out", str(tmp_path / "o"), "-q"]) == 0
    said = capsys.readouterr()
    assert (said.out, said.err) == ("", "")
    assert (tmp_path / "o" / "plan.json").is_file()


@pytest.mark.usefixtures("without_models")
@pytest.mark.slow
def test_an_impossible_tolerance_is_a_warning_or_refused(
    scene: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("homofact.planning.neighbours.larger", lambda _: None)
    scene.write_text(SCENE.replace("0.25\n[lighting]", "0.25\n[budget]\nfetches = 0\n[lighting]"))
    assert main(["plan", str(scene), *QUICK]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    warning = (
        "cook-torrance-plastic: no representation was found that meets reflected 0.7 within 0 fetches; the closest, "
    )
    assert f"Warning: {warning}one colour, reaches reflected 0." in shown
    assert shown.index("Warning: ") < shown.index("2 materials: ")
    assert "with the margin of × 1.8 for other views)." in shown
    assert "closest: one" in shown
    # The first line says so too.
    assert "at most 0.7 under sun; missed for 1 of 2 " in shown
    assert "with the margin of" in shown
    assert main(["plan", str(scene), *QUICK, "--strict"]) == 2
    assert f"{warning}one colour, reaches" in capsys.readouterr().err


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
    assert main(["plan", str(scene), "--out", str(tmp_path / "o"), "--force"]) == 2
    assert "found thesis.txt in it" in capsys.readouterr().err


@pytest.mark.usefixtures("without_models")
@pytest.mark.slow
def test_bytes_are_shared_out_over_several_lightings(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """12 and 48 bytes would meet the tolerance."""
    text = SCENE.replace("share = 0.25", "share = 0.25\npixels = 60")
    text = text.replace("[lighting]", '[[lighting]]\nnamed = "overcast"\n[[lighting]]')
    scene.write_text(text + "[budget]\nbytes = 50\n")
    assert main(["plan", str(scene), *QUICK, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["bytes"] <= 50
    assert found["budget"] == {"bytes": 50, "fetches": None, "shared_out": True, "wanted_bytes": 60}
    assert [each["name"] for each in found["lightings"]] == ["overcast", "sun"]
    assert set(found["materials"][1]["measured"]) == {"overcast", "sun"}
    assert found["materials"][1]["highlight_pixels"] > 0
    assert "within 50 bytes for all materials together" in found["warnings"][0]


@pytest.mark.slow
def test_odd_data_are_named_beside_the_choice(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Half of the samples tripled: planned as one colour, but not without a word."""
    samples = sample_model(Lambert((0.2, 0.2, 0.2)), 1000)
    values = samples.values.clone()
    values[::2] *= 3
    write_csv(tmp_path / "odd.csv", replace(samples, values=values))
    file = tmp_path / "scene.toml"
    file.write_text(
        '[[material]]\nsource = "odd.csv"\nshare = 1\n[lighting]\nnamed = "overcast"\n[tolerance]\nreflected = 5\n'
    )
    out = tmp_path / "out"
    assert main(["plan", str(file), *QUICK, "--strict", "--out", str(out)]) == 2
    assert "refused because it is" in capsys.readouterr().err
    assert not out.exists()
    assert main(["plan", str(file), *QUICK, "--out", str(out)]) == 0
    streams = capsys.readouterr()
    assert f"homofact export {out / '1-odd'} --out FOLDER" in streams.err
    shown = " ".join(streams.out.split())
    assert re.search("warning: [0-9]+% likely to be bad .findings: [^)]*quantised", shown)
    record = json.loads((out / "plan.json").read_text())["materials"][0]
    assert record["met"]
    assert "scatter" in [each["name"] for each in record["verdict"]["findings"]]
    assert main(["plan", str(file), *QUICK, "--refuse", "scatter"]) == 2
    assert "refused because of the finding" in capsys.readouterr().err
    assert main(["plan", str(file), *QUICK, "--refuse", "scater"]) == 2
    assert "refuse: found 'scater', expected some of" in capsys.readouterr().err


@pytest.mark.usefixtures("without_models")
@pytest.mark.slow
def test_strict_refuses_a_fit_whose_fault_a_picture_shows(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", str(scene), *QUICK, "--strict"]) == 2
    error = capsys.readouterr().err
    assert "refused because it is" in error
    assert "cannot be met" not in error


RELIGHT = """
[[object]]
mesh = "shape:sphere"
albedo = [0.5]
[lighting]
named = "overcast"
[[camera]]
eye = [0, 1, 4]
[transport]
cube = 8
[tolerance]
reflected = 0.05
"""


@pytest.fixture
def relit(tmp_path: Path) -> Path:
    pytest.importorskip("embreex", reason="embreex is not installed: pip install 'homofact[relight]'")
    file = tmp_path / "relight.toml"
    file.write_text(RELIGHT)
    return file


@pytest.mark.slow
def test_a_relighting_is_planned_and_relit_as_planned(relit: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", str(relit), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    (ball,) = found["objects"]
    assert ball["met"]
    assert ball["chosen"]["form"].startswith("harmonics to order")
    assert ball["chosen"]["error"] * 1.25 <= found["reflected"] == 0.05
    assert ball["chosen"]["bytes"] == found["bytes"] == min(each["bytes"] for each in ball["choices"])
    assert "all frequencies" in [each["form"] for each in ball["choices"]]
    out = relit.parent / "out"
    assert main(["relight", str(relit), "--out", str(out), "--vertices", "20", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["plan"]["objects"] == found["objects"]
    assert record["objects"][0]["form"] == ball["chosen"]["form"]
    assert record["objects"][0]["bytes"] == found["bytes"]
    assert record["error"]["sphere"]["together"] <= 0.05
    assert record["error"]["sphere"]["harmonics"] <= record["error"]["sphere"]["together"] + 0.01


@pytest.mark.slow
def test_the_table_of_a_relighting_shows_what_was_considered(relit: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", str(relit)]) == 0
    said = capsys.readouterr()
    shown = " ".join(said.out.split())
    assert "Relative RMS of the light at most 0.05" in shown
    assert "all frequencies" in shown
    assert "harmonics to order" in shown
    assert "Of all objects:" in said.err


@pytest.mark.slow
def test_a_tolerance_that_no_terms_meet_is_a_warning_or_refused(
    relit: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    relit.write_text(RELIGHT.replace("albedo = [0.5]", 'material = "material:phong-10"\nterms = 1'))
    assert main(["plan", str(relit)]) == 0
    assert "Warning: sphere: reflected 0.05 cannot be met; the best reachable is 0." in " ".join(
        capsys.readouterr().out.split()
    )
    assert main(["plan", str(relit), "--strict"]) == 2
    said = capsys.readouterr()
    assert "Relative RMS of the light at most 0.05" in " ".join(said.out.split())
    assert said.err.splitlines()[-1].startswith("homofact: sphere: reflected 0.05 cannot be met")


@pytest.mark.parametrize(
    ("arguments", "change", "expected"),
    [
        (["--plot", "p.png"], ("", ""), "plot: relight.toml is a scene of relighting, which fits nothing"),
        (["--effort", "normal"], ("", ""), "effort: relight.toml is a scene of relighting, which fits nothing"),
        (["--refuse", "scatter"], ("", ""), "refuse: relight.toml is a scene of relighting, which fits nothing"),
        ([], ("[tolerance]\nreflected = 0.05", ""), "tolerance: found none, expected reflected = a relative RMS error"),
        ([], ("reflected = 0.05", "reflected = 2"), "tolerance.reflected: found 2, expected"),
        ([], ("reflected = 0.05", "delta_e = 2"), "tolerance.delta_e: unknown key"),
    ],
)
def test_what_is_wrong_with_the_plan_of_a_relighting_is_one_line(
    arguments: list[str],
    change: tuple[str, str],
    expected: str,
    relit: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(relit.parent)
    relit.write_text(RELIGHT.replace(*change))
    assert main(["plan", "relight.toml", *arguments]) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert error.count("\n") == 1
    assert list(relit.parent.iterdir()) == [relit]
