"""Places of another kind than the one that is asked for: each is told what it is, and what to name instead."""

import json
from pathlib import Path

import pytest
from refusals import refused

import homofact
from homofact.api.places import check_measurement, check_result


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    """A plan's folder with one choice of floats, one of 8 bits, and something else."""
    place = tmp_path / "plan"
    for name, mark in (("1-paint", "factorization.npz"), ("2-clay", "brdf.glsl"), ("notes", "read.me")):
        (place / name).mkdir(parents=True)
        (place / name / mark).touch()
    (place / "plan.json").write_text(json.dumps({}))
    return place


def test_a_plan_is_told_from_its_choices(plan: Path) -> None:
    with refused("plan: found a plan, expected the folder of one of its choices: .*1-paint, .*2-clay$"):
        check_result(plan)
    check_result(plan / "1-paint")


@pytest.mark.parametrize(("name", "kind"), [("1-paint", "result"), ("2-clay", "export")])
def test_a_fit_is_no_measurement(name: str, kind: str, plan: Path) -> None:
    with refused(rf"{name}: found the folder of a fit \({kind}\), expected a BRDF file or material:NAME"):
        check_measurement(str(plan / name))
    with refused(rf"{name}: found the folder of a fit \({kind}\)"):
        homofact.compare(plan / name)
