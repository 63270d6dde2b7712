"""What `info` says of a saved fit: what it is, and its error bars by angle, as the fit itself states them."""

import json
import math
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from goniometer import steel_rings
from pictured import small_spheres

import homofact
from homofact.api.describing import WHITE_STANDARD
from homofact.api.fit_facts import fit_facts
from homofact.api.plan_facts import plan_entry
from homofact.api.subjects import given_fit
from homofact.brdf.materials import material
from homofact.brdf.quality.faults import albedo as brdf_albedo
from homofact.brdf.sampling import sample_model
from homofact.errors import BadInput
from homofact.exporting.result import open_result
from homofact.factor.factorization import Factorization
from homofact.factor.fixed_projections import EDITED, EDITS
from homofact.files.kinds import PLAN


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("fits") / "phong"
    with small_spheres():
        homofact.factorize("material:phong-30", place, homofact.McCool(size=6))
    return place


def test_a_result_states_its_error_bars_at_every_angle(result: Path) -> None:
    found = homofact.info(result)
    fit = homofact.load(result)
    assert (found.kind, found.name) == ("fit", "phong")
    assert (found.facts["source"], found.facts["method"]) == ("phong-30", "mccool")
    assert (found.facts["bytes"], found.facts["fetches"]) == (fit.nbytes, fit.fetches)
    for bar in found.facts["bars"]["by_angle"]:
        own = fit.interval("albedo", bar["degrees"][0])
        assert (bar["low"], bar["high"]) == (own.low, own.high)
        # Of a model the error was measured, and has one value.
        ratio, *words = found.rows[f"total reflected light at {bar['degrees'][0]:.0f}°"].split()
        assert float(ratio) == pytest.approx(bar["ratio"], rel=5e-3)
        assert words[-1] == "measured"
    assert len(found.facts["bars"]["by_angle"]) == 5


def test_an_estimated_error_is_a_range(tmp_path: Path) -> None:
    samples = sample_model(material("phong-30").model, 900)
    with small_spheres():
        homofact.factorize(replace(samples, provenance={}), tmp_path / "fit", homofact.McCool(size=6))
    bars = homofact.info(tmp_path / "fit").facts["bars"]["by_angle"]
    rows = homofact.info(tmp_path / "fit").rows
    stated = [bar for bar in bars if bar["low"] is not None]
    assert stated
    for bar in stated:
        row = rows[f"total reflected light at {bar['degrees'][0]:.0f}°"]
        low, high = re.findall(r"is (\S+) to (\S+) times", row)[0]
        assert (float(low), float(high)) == pytest.approx((bar["low"], bar["high"]), rel=5e-3)


def test_a_saved_file_has_its_bars_where_it_was_saved_with_them(result: Path, tmp_path: Path) -> None:
    assert "bars" in homofact.info(result / "factorization.npz").facts
    homofact.load(result).save(tmp_path / "kept.npz")
    kept, whole = (homofact.info(place).facts for place in (tmp_path / "kept.npz", result))
    assert (kept["bars"], kept["verdict"]) == (whole["bars"], whole["verdict"])
    homofact.load(result).factorization.save(tmp_path / "alone.npz")
    alone = homofact.info(tmp_path / "alone.npz")
    assert alone.kind == "fit"
    assert "bars" not in alone.facts


def test_edits_are_named_with_what_they_leave(result: Path, tmp_path: Path) -> None:
    fit = homofact.load(result).factorization
    assert isinstance(fit, Factorization)
    record = {"angle": "theta_h", "way": "texture", "rms": 0.0123}
    edited = replace(fit, provenance=fit.provenance | {EDITS: [record, {"angle": "theta_d", "way": "texels"}]})
    edited.save(tmp_path / "edited.npz")
    found = homofact.info(tmp_path / "edited.npz")
    first, second = found.rows["edits"].split("; ")
    assert (first[:7], "1.23%" in first) == ("over θh", True)
    assert (second[:7], "%" in second) == ("over θd", False)
    assert [each["angle"] for each in found.facts["edits"]] == ["theta_h", "theta_d"]
    anew = replace(fit, provenance=fit.provenance | {"source": {EDITED: {}}})
    anew.save(tmp_path / "anew.npz")
    assert "edits" in homofact.info(tmp_path / "anew.npz").rows
    assert "edits" not in homofact.info(result).rows


def test_what_is_no_fit_is_left_to_those_that_read_it(tmp_path: Path, result: Path) -> None:
    assert fit_facts(tmp_path) is None
    assert fit_facts(tmp_path / "none.npz") is None
    (tmp_path / "x.npz").write_bytes(b"no archive")
    assert fit_facts(tmp_path / "x.npz") is None
    with pytest.raises(BadInput):
        homofact.info(tmp_path / "x.npz")
    samples = Path(__file__).parents[2] / "data_synthetic/plastic.npz"
    assert homofact.info(samples).kind == "measurement"
    with pytest.raises(BadInput):
        homofact.info(result, plot=tmp_path / "p.png")
    assert not (tmp_path / "p.png").exists()


def test_the_white_standard_is_asked_of_measurements_alone() -> None:
    measured = homofact.info(Path(__file__).parents[2] / "data_synthetic/synthetic_cornell.brdf")
    assert measured.asked == (WHITE_STANDARD,)
    assert homofact.info("material:phong-30").asked == ()


@pytest.fixture(scope="module")
def choice(result: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A choice of 8 bits in a plan, whose source lies in another folder."""
    plan = tmp_path_factory.mktemp("plans") / "plan"
    plan.mkdir()
    homofact.export(open_result(result), plan / "1-paint", format="png8")
    entry = {"folder": "1-paint", "source": "/lab/paint.csv", "verdict": {"trusted": False, "summary": "not trusted"}}
    (plan / PLAN.mark).write_text(json.dumps({"materials": [{"folder": "2-clay"}, entry]}))
    return plan / "1-paint"


def test_a_choice_of_a_plan_has_the_verdict_and_the_place_of_its_source(choice: Path) -> None:
    found = homofact.info(choice)
    assert found.facts["verdict"] == {"trusted": False, "summary": "not trusted"}
    assert found.rows["verdict"] == "not trusted"
    assert given_fit(choice).near == (choice, Path("/lab"))
    assert given_fit(choice / "manifest.json").near == (choice, Path("/lab"))


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        "{}",
        '{"materials": 3}',
        '{"materials": [3]}',
        '{"materials": [{}]}',
        '{"materials": [{"folder": "x"}]}',
    ],
)
def test_a_plan_that_is_damaged_or_names_other_folders_is_passed_over(choice: Path, tmp_path: Path, text: str) -> None:
    shutil.copytree(choice, tmp_path / "1-paint")
    (tmp_path / PLAN.mark).write_text(text)
    assert plan_entry(tmp_path / "1-paint") is None
    assert "verdict" not in homofact.info(tmp_path / "1-paint").facts
    assert given_fit(tmp_path / "1-paint").near == (tmp_path / "1-paint",)


def test_an_export_carries_the_verdict_on_its_fit(result: Path, tmp_path: Path) -> None:
    homofact.export(result, tmp_path / "engine", engine="three")
    verdict = homofact.info(result).facts["verdict"]
    assert json.loads((tmp_path / "engine" / "manifest.json").read_text())["verdict"] == verdict
    assert homofact.info(tmp_path / "engine").facts["verdict"] == verdict
    readme = (tmp_path / "engine" / "README.md").read_text()
    assert verdict["summary"].split(";")[0] in readme
    # A fit without a verdict has none.
    homofact.export(open_result(result), tmp_path / "bare", engine="three")
    assert "verdict" not in json.loads((tmp_path / "bare" / "manifest.json").read_text())
    assert "homofact's verdict" not in (tmp_path / "bare" / "README.md").read_text()


def test_a_result_in_no_plan_has_no_entry(result: Path) -> None:
    assert plan_entry(result) is None
    assert plan_entry(result / "manifest.json") is None


def test_the_albedo_of_a_fit_is_given_by_angle_and_channel(result: Path) -> None:
    found = homofact.info(result)
    albedo, fit = found.facts["albedo"], homofact.load(result)
    assert list(albedo) == ["0", "15", "30", "45", "60", "75"]
    for degrees, own in albedo.items():
        assert list(own) == ["R", "G", "B", "Y"]
        # McCool's textures depend on the azimuth: light along x and along y.
        sides = [float(brdf_albedo(fit.factorization, float(degrees), turn)[0]) for turn in (0.0, math.pi / 2)]
        assert own["R"] == pytest.approx(sum(sides) / 2, rel=0.01)
        assert own["Y"] == pytest.approx(0.2126 * own["R"] + 0.7152 * own["G"] + 0.0722 * own["B"], rel=1e-3)
    assert f"30°: R {albedo['30']['R']:.3g}, G" in found.rows["albedo"]
    # Of a source that can be evaluated the error was measured; there is no light of samples beside it.
    assert "light_over_samples" not in found.facts


def test_the_light_over_that_of_the_samples_is_given(tmp_path: Path) -> None:
    samples = steel_rings(steps=(5, 15))
    with small_spheres():
        homofact.factorize(samples, tmp_path / "fit", homofact.McCool(size=12))
    found = homofact.info(tmp_path / "fit")
    light = found.facts["light_over_samples"]
    assert [row[:2] for row in light] == [[angle, angle] for angle in (5, 20, 35, 50, 65)]
    assert found.rows["light over that of the samples, by θi"].startswith(f"5° {light[0][2]:.0%}, 20° ")
    report = tmp_path / "fit" / "report.json"
    record = json.loads(report.read_text())
    record["verdict"]["by_incidence"] = [[5, "a"]]
    report.write_text(json.dumps(record))
    assert "light_over_samples" not in homofact.info(tmp_path / "fit").facts


def test_printed_facts_are_lines_of_the_rows(tmp_path: Path) -> None:
    found = homofact.info("material:phong-10")
    first, *lines = str(found).splitlines()
    assert first == found.name
    names = [name.replace("_", " ") for name, value in found.rows.items() if value is not None]
    assert [line.partition(":")[0] for line in lines[: len(names)]] == names
    assert all("{" not in line for line in lines)
    (tmp_path / "scene.toml").write_text(
        '[[material]]\nsource = "material:phong-10"\nshare = 1.0\n[lighting]\nnamed = "overcast"\n'
        "[tolerance]\nreflected = 0.5\n"
    )
    plan = homofact.plan(tmp_path / "scene.toml")
    chosen = plan.record()["materials"][0]
    line = next(line for line in str(plan).splitlines() if line.startswith("material phong-10: "))
    assert f"{chosen['choice']['bytes']} bytes" in line
    assert any(line.startswith("verdict on phong-10: ") for line in str(plan).splitlines())


def test_the_errors_of_a_fit_are_those_of_its_report(tmp_path: Path) -> None:
    found = homofact.factorize("material:phong-10", tmp_path / "fit", homofact.McCool(size=4))
    rows = homofact.info(tmp_path / "fit").rows
    for part, words in (("held_out", "held out"), ("train", "training")):
        assert f"log mse {found.report['error'][part]['log_mse']:.3g}" in rows[f"error, {words}"]
    found.fit.save(tmp_path / "alone.npz")
    assert not any(name.startswith("error") for name in homofact.info(tmp_path / "alone.npz").rows)
