"""A plan as JSON: what was chosen, by what errors, under which lightings, and the verdict on every choice."""

import math
from dataclasses import asdict
from typing import Any

from homofact.scene.plan.ladder import Candidate
from homofact.scene.plan.plan import MaterialPlan, ScenePlan
from homofact.scene.plan.search import Outcome
from homofact.scene.plan.theory import colour_error, terms_needed
from homofact.scene.plan.tolerance import MARGINS


def plan_record(plan: ScenePlan) -> dict[str, Any]:
    """The whole plan, JSON-able."""
    one = plan.one_size
    return {
        "scene": plan.scene.name,
        "seed": plan.scene.seed,
        "tolerance": dict(plan.scene.tolerance.limits),
        "margins": {kind: MARGINS[kind] for kind in plan.scene.tolerance.kinds},
        "budget": vars(plan.scene.budget) | {"shared_out": plan.allocated},
        "lightings": [
            {
                "name": each.name,
                "description": each.words,
                "last_excited_order": each.last_excited,
                "energy_by_order": (each.energies / each.energies.sum()).tolist(),
            }
            for each in plan.scene.lightings
        ],
        "materials": [material_record(each) for each in plan.materials],
        "bytes": plan.bytes,
        "fetches_per_pixel": plan.fetches,
        "error_of_the_picture": finite(plan.error),
        "one_size_fits_all": None
        if one is None
        else {**_rung(one.candidate), "bytes": one.bytes}
        | {"fetches_per_pixel": one.fetches, "bytes_saved": one.bytes - plan.bytes},
        "fits": plan.planning_fits,
        "fits_with_one_size": plan.fits,
        "exhaustive_fits": plan.exhaustive_fits,
        "warnings": list(plan.warnings),
    }


def material_record(each: MaterialPlan) -> dict[str, Any]:
    """One material's plan, JSON-able. Errors in units of the tolerance have its margins in them."""
    choice, found = each.walk.choice, each.outcome
    verdict = each.verdict
    return {
        "source": each.material.source,
        "name": each.name,
        "share": each.material.share,
        "pixels": each.material.pixels,
        "highlight_pixels": each.highlight_pixels,
        "choice": None
        if choice is None or found is None
        else {**_rung(choice), "bytes": found.bytes} | {"fetches": found.fetches},
        "met": each.walk.met,
        "error": None if found is None else finite(found.value),
        "error_kind": None if found is None else found.kind,
        "error_lighting": None if found is None else found.lighting,
        "of_tolerance": None if found is None else finite(found.error),
        "missed_by": finite(each.missed_by),
        "measured": {
            judge.lighting.name: {kind: finite(value) for kind, value in asdict(errors).items()}
            for judge, errors in zip(each.judges, each.errors, strict=False)
        },
        "needed_order": max(each.needed_orders),
        "needed_terms": terms_needed(max(each.needed_orders)),
        "needed_terms_any_light": each.bench.own_terms,
        "fits": each.walk.fits,
        "refused": {rung.label: why for rung, why in each.bench.refused.items()},
        "asked": [_asked(each, rung, answer) for rung, answer in each.walk.asked.items()],
        "verdict": None if verdict is None else verdict.record(),
    }


def finite(value: float) -> float | None:
    """None for what JSON has no number for."""
    return value if math.isfinite(value) else None


def _asked(each: MaterialPlan, rung: Candidate, answer: Outcome) -> dict[str, Any]:
    told = {name: finite(value) if isinstance(value, float) else value for name, value in vars(answer).items()}
    predicted = {}
    if rung.is_colour:
        # Of one colour theory is exact, over all turnings of the lighting.
        predicted["reflected_over_all_turnings"] = {
            judge.lighting.name: colour_error(rung, each.bench.lobes, judge.lighting) for judge in each.judges
        }
    return _rung(rung) | told | predicted


def _rung(candidate: Candidate) -> dict[str, Any]:
    return asdict(candidate)
