"""`homofact measure`: rounds by files, the order, the stop rule, and all that is refused."""

import json
import math
from pathlib import Path

import pytest
import torch
from refusals import refused

import homofact
from homofact.api.measuring import measure
from homofact.cli.main import main
from homofact.geometry.directions import draw_in_discs
from homofact.measuring.goniometer import Goniometer
from homofact.measuring.prior import VERSION, read_prior

MATERIAL = "material:cook-torrance-plastic"


def fill(plan: Path, to: Path) -> None:
    """Measure what a plan asks for, with the model as the goniometer."""
    model = homofact.read(MATERIAL, count=10).reflectance
    lines = plan.read_text(encoding="utf-8").splitlines()
    filled = []
    for line in lines:
        words = line.split(",")
        if line.startswith("#") or words[0] == "theta_i_deg":
            filled.append(line)
            continue
        theta_i, _, theta_o, phi = (torch.tensor([float(word)], dtype=torch.float64).deg2rad() for word in words[:4])
        wi = torch.stack((theta_i.sin(), 0 * theta_i, theta_i.cos()), 1)
        wo = torch.stack((theta_o.sin() * phi.cos(), theta_o.sin() * phi.sin(), theta_o.cos()), 1)
        values = model.evaluate(wi, wo)[0].tolist()
        filled.append(",".join([*words[:4], *map(repr, values)]))
    to.write_text("\n".join(filled) + "\n", encoding="utf-8")


@pytest.mark.slow
def test_round_after_round_by_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files: list[str] = []
    answers = []
    for number in range(3):
        plan, whole = tmp_path / f"plan{number}.csv", tmp_path / f"whole{number}.csv"
        line = ["measure", *files, "--directions", "6", "--out", str(plan), "--complete", str(whole), "--json"]
        assert main(line) == 0
        out, err = capsys.readouterr()
        assert err == ""
        answers.append(json.loads(out))
        filled = tmp_path / f"round{number}.csv"
        fill(plan, filled)
        files.append(str(filled))
    assert [each["samples"] for each in answers] == [0, 6, 12]
    assert [len(each["angles_degrees"]) for each in answers] == [6, 6, 6]
    # Samples lower what others can change, and no direction is asked for again.
    changes = [each["change_by_three_rings"] for each in answers]
    assert changes[0] > 3 * max(changes[1:])
    assert len({tuple(row) for each in answers for row in each["angles_degrees"]}) == 18
    # The completed table can be fitted.
    known = homofact.read(str(tmp_path / "whole2.csv"))
    assert len(known.samples) == 12_000
    truth = homofact.read(MATERIAL, count=10).reflectance.evaluate(known.samples.wi, known.samples.wo)
    apart = ((known.samples.values + 0.01) / (truth + 0.01)).log().abs().median()
    assert float(apart) < 0.25


def test_the_plan_is_in_the_order_of_short_moves(tmp_path: Path) -> None:
    found = measure(directions=12, to=tmp_path / "a.csv", goniometer=Goniometer(settle=2))
    assert found.seconds <= found.seconds_unordered
    rows = [line for line in (tmp_path / "a.csv").read_text(encoding="utf-8").splitlines() if line[0].isdigit()]
    assert [tuple(float(word) for word in row.split(",")[::2][:2]) for row in rows] == [
        (theta_i, theta_o) for theta_i, theta_o, _ in found.angles
    ]
    assert all(row.endswith(",,,") for row in rows)


def test_incidences_are_measured_as_wholes(tmp_path: Path) -> None:
    goniometer = Goniometer(rings=20, azimuths=45)
    found = measure(incidences=2, goniometer=goniometer, channels=("550nm",))
    assert len(found.incidences) == 2
    expected = {tuple(row) for angle in found.incidences for row in goniometer.ring(angle).tolist()}
    assert set(found.angles) == expected
    assert {angle for angle, _, _ in found.angles} == set(found.incidences)
    assert found.estimate.channels == ("550nm",)


def test_samples_in_memory_and_the_estimate_as_a_source() -> None:
    model = homofact.read(MATERIAL, count=10).reflectance
    wi, wo = draw_in_discs(200, torch.Generator().manual_seed(0), 0.7)
    wi = torch.stack((wi[:, :2].norm(dim=1), 0 * wi[:, 0], wi[:, 2]), 1)
    found = measure((wi.numpy(), wo.numpy(), model.evaluate(wi, wo).numpy()), directions=1)
    assert found.samples is not None
    assert len(found.samples) == 200
    assert found.highest == pytest.approx(max(float(w[:, 2].acos().max()) for w in (wi, wo)) * 180 / math.pi)
    assert found.record()["highest_theta_degrees"] == found.highest
    value = found.estimate.evaluate(wi[:20], wo[:20])
    assert torch.allclose(value, model.evaluate(wi[:20], wo[:20]), rtol=0.25, atol=0.02)
    assert bool((found.estimate.evaluate(-wi[:2], wo[:2]) == 0).all())


def test_a_table_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["measure", "--directions", "2"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    words = (
        "Where to measure next",
        "in nine of ten cases",
        "three rings more",
        "within a factor of",
        "another round pays",
    )
    for each in (*words, "theta_i", "time of moves"):
        assert each in shown


def rows(*lines: str, head: str = "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,R,G,B") -> str:
    return "\n".join(["# isotropic: true", head, *lines]) + "\n"


CONTRADICT = rows("30,0,40,180,0.5,0.4,0.3", "10,0,20,90,0.1,0.1,0.1", "30,0,40,180,0.1,0.1,0.1")
BAD_FILES = {
    "contradict": (CONTRADICT, "samples 1 and 3 contradict each other: 0.4 and 0.1 sr⁻¹"),
    "contradict in three": (
        CONTRADICT + "30,0,40,180,0.9,0.9,0.9\n",
        "samples 3 and 4, and 2 other pairs, contradict each other: 0.1 and 0.9 sr⁻¹",
    ),
    "black": (rows("30,0,40,180,0,0,0", "10,0,20,90,0,0,0"), "samples: found values that are all 0"),
    "not filled in": (rows("30,0,40,180,,,"), "bad.csv: line 3: found an empty cell in column R, expected a"),
    "anisotropic": (
        rows("30,0,40,180,1,1,1", "30,90,40,180,1,1,1").replace("true", "false"),
        "samples: found an anisotropic material, expected an isotropic one",
    ),
}


@pytest.mark.parametrize("case", BAD_FILES)
def test_samples_that_say_nothing_are_refused_in_a_line(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, expected = BAD_FILES[case]
    file, plan = tmp_path / "bad.csv", tmp_path / "plan.csv"
    file.write_text(text, encoding="utf-8")
    assert main(["measure", str(file), "--out", str(plan)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert expected in err
    assert err.count("\n") == 1
    assert not plan.exists()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--theta-i", "70,80", "--theta-o", "0,5", "--phi", "0,10", "--separation", "90"],
         "goniometer: no direction with theta_i 70 to 80, theta_o 0 to 5, phi 0 to 10 and directions 90 degrees apart"),
        (["--incidences", "2", "--theta-o", "0,0", "--theta-i", "0,0"], "goniometer: no direction with"),
        (["--theta-i", "80,10"], "theta_i: found 80 to 10, expected rising degrees from 0 to 90"),
        (["--phi", "x"], "phi: found 'x', expected two degrees such as 0,80"),
        (["--separation", "100"], "separation: found 100.0, expected a number from 0 to 90"),
        (["--speed", "0"], "speed: found 0.0"),
        (["--rings", "nan"], "rings: found nan"),
        (["--directions", "0"], "directions: found 0, expected a whole number from 1 to 500"),
        (["--incidences", "99"], "incidences: found 99, expected a whole number from 1 to 40"),
        (["--directions", "3", "--incidences", "3"], "incidences: found it beside directions"),
        (["--stop", "1"], "stop: found 1.0, expected a share between 0 and 1"),
        (["nowhere.csv"], "nowhere.csv: no such file"),
        (["--out", "a.txt"], "a.txt"),
    ],
)  # fmt: skip
def test_one_line_names_what_is_wrong(
    arguments: list[str],
    expected: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["measure", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert expected in err
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_plan_that_is_there_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = tmp_path / "plan.csv"
    plan.write_text("mine", encoding="utf-8")
    assert main(["measure", "--directions", "1", "--out", str(plan)]) == 2
    assert "exists already, expected a new file or --force" in capsys.readouterr().err
    assert plan.read_text(encoding="utf-8") == "mine"
    assert main(["measure", "--directions", "1", "--out", str(plan), "--force", "-q"]) == 0
    assert plan.read_text(encoding="utf-8").startswith("# isotropic: true\n")


def test_files_of_other_channels_are_refused(tmp_path: Path) -> None:
    for name, head in (("a.csv", "R,G,B"), ("b.csv", "R,G,X")):
        text = rows("30,0,40,180,1,1,1", head=f"theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,{head}")
        (tmp_path / name).write_text(text, encoding="utf-8")
    with refused(where="b.csv"):
        measure([str(tmp_path / "a.csv"), str(tmp_path / "b.csv")])


def test_a_table_of_all_directions_needs_no_measuring(tmp_path: Path) -> None:
    homofact.convert(MATERIAL, tmp_path / "a.bsdf", count=100)
    with refused("a table of all directions"):
        measure(str(tmp_path / "a.bsdf"))


def test_a_table_that_is_damaged_or_of_another_version_is_named(tmp_path: Path) -> None:
    place = tmp_path / "prior.json"
    for text, found in (("{", "missing or damaged"), (f'{{"version": {VERSION + 1}}}', f"version {VERSION + 1}")):
        place.write_text(text, encoding="utf-8")
        read_prior.cache_clear()
        with refused(where="prior.json", match=found):
            read_prior(place)
    read_prior.cache_clear()
