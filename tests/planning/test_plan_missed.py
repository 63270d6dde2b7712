"""What a plan says of limits that it does not meet: each of them, with the budget that rules better fits out."""

from types import SimpleNamespace
from typing import Any

import pytest

from homofact.cli.plan_tables import choice_table
from homofact.planning.ladder import FITS, ONE_COLOUR, Candidate
from homofact.planning.missed import missed_words
from homofact.planning.plan import MaterialPlan, ScenePlan
from homofact.planning.scene import Budget, SceneMaterial
from homofact.planning.search import LadderOutcome, Walk
from homofact.planning.tolerance import Errors, Tolerance

COLOUR = Candidate("constant")
TOLERANCE = Tolerance.of(reflected=0.1, delta_e=1.0, cole=0.5)
SUN, SKY = SimpleNamespace(name="sun"), SimpleNamespace(name="sky")


def planned(*errors: Errors, name: str = "paint", of_samples: bool = False) -> MaterialPlan:
    """One colour with these errors, one lighting each."""
    samples = SimpleNamespace(channels=("r", "g", "b"), isotropic=True)
    source = SimpleNamespace(samples=samples, name=name, reflectance=SimpleNamespace(of_samples=of_samples))
    fits: Any = SimpleNamespace(source=source, rungs=(COLOUR, *FITS))
    judges: Any = tuple(SimpleNamespace(lighting=each) for each in (SUN, SKY)[: len(errors)])
    used = [TOLERANCE.used(each) for each in errors]
    worst = max(used, key=lambda each: each.ratio)
    outcome = LadderOutcome(worst.ratio, 12, 0, 0, worst.kind, worst.error)
    walk = Walk(1.0, {COLOUR: outcome}, COLOUR, worst.ratio <= 1)
    plan = MaterialPlan(SceneMaterial(name, 1.0), fits, judges, TOLERANCE, walk)
    vars(plan)["errors"] = errors
    return plan


MISSED = Errors(reflected=0.2, delta_e=4.0, cole=0.4)
MET = Errors(reflected=0.05, delta_e=0.5, cole=0.4)


def test_every_missed_limit_is_named_with_what_is_reached() -> None:
    assert missed_words(planned(MISSED), Budget()) == (
        "paint: no representation was found that meets reflected 0.1 and delta_e 1; the closest, one colour, reaches"
        " reflected 0.2 (0.36 with the margin of × 1.8 for other views) and delta_e 4 (4.6 with the margin of × 1.15"
        " for other views)"
    )
    assert missed_words(planned(MET), Budget(bytes=20)) == ""


def test_what_samples_are_compared_with_is_said() -> None:
    said, of_samples = (missed_words(planned(MISSED, of_samples=each), Budget()) for each in (False, True))
    assert of_samples == f"{said} against an interpolation of the samples"
    # The Cole error is one at held-out samples.
    logs = Errors(reflected=0.01, delta_e=0.1, cole=2.0)
    said, of_samples = (missed_words(planned(logs, of_samples=each), Budget()) for each in (False, True))
    assert said == of_samples


def test_each_limit_is_of_the_lighting_that_misses_it_most() -> None:
    both = planned(Errors(reflected=0.2, delta_e=1, cole=0.6), Errors(reflected=0.1, delta_e=3, cole=0.6))
    said = missed_words(both, Budget())
    assert "meets reflected 0.1 under sun, delta_e 1 under sky and cole 0.5; the closest" in said
    assert "reaches reflected 0.2 (0.36 " in said
    assert ", delta_e 3 (3.45 " in said
    assert said.endswith("and cole 0.6")


@pytest.mark.parametrize(
    ("budget", "shared", "named"),
    [
        (Budget(bytes=40), False, " within 40 bytes;"),
        (Budget(bytes=40), True, " within 40 bytes for all materials together;"),
        (Budget(bytes=40, fetches=1), True, " within 40 bytes for all materials together and 1 fetch;"),
        (Budget(fetches=2), False, " within 2 fetches;"),
        # More than the largest representation takes: no budget is to blame.
        (Budget(bytes=10**6, fetches=99), False, " delta_e 1;"),
        (Budget(bytes=10**6), True, " within 1000000 bytes for all materials together;"),
    ],
)
def test_a_budget_is_named_where_it_rules_something_out(budget: Budget, shared: bool, named: str) -> None:
    assert named in missed_words(planned(MISSED), budget, shared)


def test_the_table_tells_the_closest_from_what_to_ship() -> None:
    def column(*plans: MaterialPlan) -> tuple[object, list[object], list[str]]:
        scene: Any = SimpleNamespace(lightings=(SUN,), tolerance=TOLERANCE)
        table = choice_table(ScenePlan(scene, plans, None, 0, 0, 0))
        return table.columns[1].header, list(table.columns[1].cells), [str(cell) for cell in table.columns[5].cells]

    bad, good = planned(Errors(reflected=9.636, delta_e=4, cole=1)), planned(MET, name="clay")
    assert column(good) == ("ship", [ONE_COLOUR], ["90%"])
    assert column(bad) == ("closest found", [ONE_COLOUR], ["173 ×"])
    assert column(good, bad) == ("choice", [ONE_COLOUR, f"closest: {ONE_COLOUR}"], ["90%", "173 ×"])
