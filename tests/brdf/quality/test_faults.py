"""Faults of a BRDF as a whole: laws of reciprocity and energy, on models and on samples."""

import json
import math
from pathlib import Path

import pytest

from homofact.brdf.analytic import Lambert, Phong
from homofact.brdf.quality.faults import albedo, evaluated_faults
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import describe, open_source


@pytest.mark.parametrize("degrees", [0, 40, 80])
def test_albedo_of_lambert_is_its_colour(degrees: float) -> None:
    found = albedo(Lambert((0.25, 0.5, 1.0)), degrees)
    assert found.tolist() == pytest.approx([0.25, 0.5, 1.0], rel=0.03)


def test_albedo_finds_narrow_highlights() -> None:
    # A lobe of 5°: at normal incidence its albedo is its weight.
    shiny = Phong((0.0,), (0.8,), 1000, channels=("Y",))
    assert float(albedo(shiny, 0)) == pytest.approx(0.8, rel=0.02)
    assert float(albedo(shiny, 45)) == pytest.approx(0.8 * math.cos(math.radians(45)), rel=0.1)


def test_energy_above_one_is_named() -> None:
    for colour, above in ((0.9, False), (1.2, True)):
        model = Lambert((colour,), channels=("Y",))
        facts = evaluated_faults(sample_model(model, 10), model, own=True)
        assert facts["energy_above_one"] is above
        assert facts["albedo_by_degrees"]["30"] == pytest.approx(colour, rel=0.03)
        assert json.loads(json.dumps(facts)) == facts


def test_description_carries_them(tmp_path: Path) -> None:
    facts = describe(open_source("material:ward-brushed", count=100))["faults"]
    assert facts["reciprocity_error"]["p95"] < 1e-6
    assert facts["energy_above_one"] is False
    path = tmp_path / "one.csv"
    path.write_text("theta_i,phi_i,theta_o,phi_o,Y\n" + "".join(f"0.{k},0,0.{k + 1},2,0.3\n" for k in range(1, 9)))
    facts = describe(open_source(str(path)))["faults"]
    assert facts["reciprocity_error"] is None
    # Light at .1 to .8 radians only: nothing is said of other angles.
    assert list(facts["albedo_by_degrees"]) == ["6", "11", "23", "29", "40", "46"]
    assert facts["exact_zeros"] == 0
