"""Plans that ask for a trusted verdict: which representations are judged, what is chosen, and what is said of it."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from judged import TRAIN, verdict
from plan_cases import PAINT, QUICK, WHITE, fits_of, stage_of

import homofact
from homofact.api.plan_facts import plan_facts
from homofact.brdf.analytic.lambert import Lambert
from homofact.cli.plan import doubt_lines, finding_lines
from homofact.cli.plan_tables import choice_table, step_table
from homofact.exporting.result import open_result
from homofact.planning.export import write_plan
from homofact.planning.ladder import Candidate
from homofact.planning.material_fits import MaterialFits
from homofact.planning.missed import missed_words
from homofact.planning.plan import MaterialPlan, ScenePlan, plan_material, plan_scene
from homofact.planning.scene import Budget, Scene, SceneMaterial
from homofact.planning.search import UNTRUSTED
from homofact.planning.tolerance import Tolerance
from homofact.scene.lighting import named_lighting

WIDE = Tolerance.of(reflected=9.0, trusted=True)


class Judged(MaterialFits):
    """Fits whose verdict trusts representations from so many bytes on, and that notes what it was asked about."""

    least: int = 0
    about: list[Candidate]

    def verdict(self, candidate: Candidate, colour: Lambert | None = None) -> Any:
        self.about.append(candidate)
        return SimpleNamespace(trusted=candidate.most_bytes(3) >= self.least)


@pytest.fixture(scope="module")
def fits() -> MaterialFits:
    return fits_of(PAINT)


def judged(fits: MaterialFits, least: int) -> Judged:
    made = Judged(fits.text, QUICK, made=fits.made, stored=fits.stored)
    made.__dict__ |= {"source": fits.source}
    made.least, made.about = least, []
    return made


def planned(fits: MaterialFits, tolerance: Tolerance, budget: Budget | None = None) -> MaterialPlan:
    return plan_material(SceneMaterial("own", 1.0), fits, (stage_of("overcast"),), tolerance, budget or Budget())


def test_the_smallest_representation_that_is_trusted_is_chosen(fits: MaterialFits) -> None:
    found = planned(judged(fits, 150), WIDE)
    assert found.walk.met
    assert found.walk.choice is not None
    assert found.walk.choice.most_bytes(3) >= 150
    smaller = {each: one for each, one in found.walk.asked.items() if each.most_bytes(3) < 150}
    assert smaller
    assert {(one.error, one.trusted, one.excess) for one in smaller.values()} == {(UNTRUSTED, False, 0.0)}
    without = planned(judged(fits, 150), replace(WIDE, trusted=False))
    assert without.walk.choice is not None
    assert without.walk.choice.is_colour


def test_a_tilt_that_is_left_in_is_named_with_the_way_out() -> None:
    tilt = {"left_in": True, "found": "the sample was tilted by +0.1°", "effect": "it can be undone"}
    lines = finding_lines({"paint": verdict(train=replace(TRAIN, provenance={"tilt": tilt}))})
    assert any("the sample was tilted by +0.1°" in line for line in lines)
    assert "--calibrate tilt" in lines[-1]
    assert not any("tilt" in line for line in finding_lines({"paint": verdict()}))


def test_only_what_meets_the_limits_is_judged_and_each_once(fits: MaterialFits) -> None:
    asked = judged(fits, 0)
    found = planned(asked, Tolerance.of(reflected=0.3, trusted=True))
    assert asked.about == [each for each, one in found.walk.asked.items() if one.error <= 1]
    assert any(one.error > 1 for one in found.walk.asked.values())
    assert all(one.trusted for one in found.walk.asked.values())
    unasked = judged(fits, 0)
    planned(unasked, Tolerance.of(reflected=0.3))
    assert unasked.about == []


def test_a_verdict_is_computed_once(fits: MaterialFits, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr(MaterialFits, "_verdict", lambda self, candidate, colour: asked.append(candidate) or "it")
    own = fits_of(PAINT)
    rung = Candidate("search", 1, 4)
    assert [own.verdict(rung), own.verdict(rung), own.verdict(Candidate("search", 1, 8))] == ["it"] * 3
    assert asked == [rung, Candidate("search", 1, 8)]


def test_it_is_said_that_no_representation_is_trusted(fits: MaterialFits, tmp_path: Path) -> None:
    # No fetch leaves one colour alone.
    budget = Budget(fetches=0)
    found = planned(judged(fits, 10**9), WIDE, budget)
    assert not found.walk.met
    said = missed_words(found, budget)
    assert "trusted" in said
    assert "within 0 fetches" in said
    assert "margin" not in said
    lightings = (named_lighting("overcast"),)
    scene = Scene("one", (SceneMaterial("own", 1.0),), lightings, WIDE)
    plan = ScenePlan(scene, (found,), None, 1, 1, 1)
    assert list(choice_table(plan).columns[-1].cells)[-1].plain == "not trusted"  # pyright: ignore
    met = ScenePlan(scene, (planned(judged(fits, 150), WIDE),), None, 1, 1, 1)
    steps = step_table(met)
    assert steps is not None
    assert "not trusted" in [str(each) for each in steps.columns[-1].cells]


def test_info_of_a_plan_names_a_choice_without_trust(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(MaterialFits, "_verdict", lambda self, candidate, colour: verdict())
    scene = Scene("one", (SceneMaterial("own", 1.0),), (named_lighting("overcast"),), WIDE)
    fits = fits_of(PAINT)
    write_plan(tmp_path / "plan", plan_scene(scene, QUICK, {"own": fits}))
    record = json.loads((tmp_path / "plan" / "plan.json").read_text())
    assert record["tolerance"] == {"reflected": 9.0, "trusted": True}
    (entry,) = record["materials"]
    assert entry["trusted"] == entry["met"]
    (tmp_path / "plan" / "plan.json").write_text(
        json.dumps(record | {"materials": [entry | {"trusted": False, "met": False}]})
    )
    found = plan_facts(tmp_path / "plan")
    assert found is not None
    assert "not trusted" in found[1]["material own"]
    assert "trusted verdict" in found[1]["tolerance"]


def test_one_colour_is_written_as_a_fit_beside_its_values(tmp_path: Path) -> None:
    scene = Scene("one", (SceneMaterial("own", 1.0),), (named_lighting("overcast"),), Tolerance.of(reflected=9.0))
    fits = fits_of(WHITE)
    plan = plan_scene(scene, QUICK, {"own": fits})
    assert plan.materials[0].colour is not None
    folder = tmp_path / "plan" / write_plan(tmp_path / "plan", plan)["own"]
    values = json.loads((folder / "colour.json").read_text())["f_per_sr"]
    wi, wo = fits.source.samples.wi, fits.source.samples.wo
    torch.testing.assert_close(
        open_result(folder).evaluate(wi, wo), torch.tensor(values, dtype=torch.float64).expand(len(wi), -1)
    )
    assert homofact.export(folder, tmp_path / "engine", source=fits.source).format == "exr"


def test_doubts_name_only_choices_that_are_not_trusted() -> None:
    good, bad = (SimpleNamespace(trusted=each) for each in (True, False))
    assert doubt_lines({"paint": good}) == []  # pyright: ignore
    (line,) = doubt_lines({"paint": good, "chrome": bad})  # pyright: ignore
    assert "chrome" in line
    assert "paint" not in line
