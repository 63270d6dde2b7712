"""Materials with tolerances of their own: each is planned by its own, and all that is said of a plan names them."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from plan_cases import PAINT, QUICK, fits_of

from homofact.api.plan_facts import plan_facts
from homofact.cli.plan_tables import headline
from homofact.planning.export import write_plan
from homofact.planning.plan import ScenePlan, plan_scene
from homofact.planning.scene import Scene, SceneMaterial
from homofact.planning.tolerance import Tolerance
from homofact.scene.lighting import named_lighting

LOOSE, TIGHT = Tolerance.of(reflected=9.0), Tolerance.of(cole=0.2)
MATERIALS = (
    SceneMaterial("a", 0.5, name="far"),
    SceneMaterial("a", 0.3, name="near", tolerance=TIGHT),
    SceneMaterial("a", 0.2, name="far again"),
)


@pytest.fixture(scope="module")
def found() -> ScenePlan:
    scene = Scene("shop", MATERIALS, (named_lighting("overcast"),), LOOSE)
    return plan_scene(scene, QUICK, {"a": fits_of(PAINT, "a")})


def test_each_material_is_planned_by_its_own(found: ScenePlan) -> None:
    far, near, again = found.materials
    assert (far.tolerance, near.tolerance) == (LOOSE, TIGHT)
    assert far.walk.choice is not None
    assert far.walk.choice.is_colour
    assert near.walk.choice is not None
    assert not near.walk.choice.is_colour
    assert near.outcome is not None
    assert near.outcome.kind == "cole"
    assert again.walk is far.walk
    assert [plan.name for plan in found.distinct] == ["far again", "near"]
    assert found.limited_kinds == ("reflected", "cole")


def test_a_named_tolerance_differs_by_material_in_words(found: ScenePlan) -> None:
    assert found.tolerance_words == "error of reflected light at most 9; for near, Cole error at most 0.2"
    assert found.tolerance_words in headline(found)
    # Where each has its own, the scene's holds for none.
    every = tuple(replace(plan, material=replace(plan.material, tolerance=plan.tolerance)) for plan in found.materials)
    words = replace(found, materials=every, scene=replace(found.scene, tolerance=None)).tolerance_words
    assert words == "for far again, error of reflected light at most 9; for near, Cole error at most 0.2"


def test_the_record_and_the_folders_keep_them_apart(found: ScenePlan, tmp_path: Path) -> None:
    names = write_plan(tmp_path / "plan", found)
    assert names == {"a": "1-far-again", "a, Cole error at most 0.2": "2-near"}
    record = json.loads((tmp_path / "plan" / "plan.json").read_text())
    assert [each["folder"] for each in record["materials"]] == ["1-far-again", "2-near", "1-far-again"]
    assert [each["tolerance"] for each in record["materials"]] == [None, {"cole": 0.2}, None]
    assert set(record["margins"]) == {"reflected", "cole"}
    # None was judged, since no tolerance asks for trust.
    assert {asked["trusted"] for each in record["materials"] for asked in each["asked"]} == {None}
    # Those of the choices are what their verdicts say, though none was judged while planning.
    assert [each["trusted"] for each in record["materials"]] == [
        each["verdict"]["trusted"] for each in record["materials"]
    ]
    assert not record["materials"][0]["trusted"]
    facts = plan_facts(tmp_path / "plan")
    assert facts is not None
    rows = facts[1]
    assert rows["met"] == "for 2 of 2 materials"
    assert "its own: Cole error at most 0.2" in rows["material near"]
    assert "its own" not in rows["material far again"]
    # The steps are those of the record, with what they use of the limit.
    for name, entry in (("far again", record["materials"][0]), ("near", record["materials"][1])):
        for step in ("smaller", "larger"):
            found_step = entry[step]
            helps_not = step == "larger" and found_step is None and entry["best_larger"] is not None
            assert (f"{step} {name}" in rows) == (found_step is not None or helps_not)
            if helps_not:
                assert rows[f"{step} {name}"].startswith("none helps")
            if found_step is not None:
                assert f"{found_step['bytes']} byte" in rows[f"{step} {name}"]
                assert rows[f"{step} {name}"].endswith("the limit")
