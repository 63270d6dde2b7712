"""A plan as JSON: what was chosen, by what errors, under which lightings, and the verdict on every choice."""

import math
from dataclasses import asdict
from typing import Any

from homofact.planning.ladder import Candidate
from homofact.planning.missed import missed_by_all
from homofact.planning.neighbours import Neighbour, best_larger, far_smaller, larger, smaller
from homofact.planning.plan import MaterialPlan, ScenePlan
from homofact.planning.search import LadderOutcome
from homofact.planning.theory import colour_error, terms_needed
from homofact.planning.tolerance import MARGINS


def plan_record(plan: ScenePlan) -> dict[str, Any]:
    """Return the whole plan, JSON-able."""
    one = plan.one_size
    return {
        "scene": plan.scene.name,
        "seed": plan.scene.seed,
        "tolerance": None if plan.scene.tolerance is None else plan.scene.tolerance.record(),
        "margins": {kind: MARGINS[kind] for kind in plan.limited_kinds},
        "budget": vars(plan.scene.budget) | {"shared_out": plan.allocated, "wanted_bytes": plan.wanted_bytes},
        "lightings": [
            {
                "name": lighting.name,
                "description": lighting.words,
                "last_excited_order": lighting.last_excited,
                "energy_by_order": (lighting.energies / lighting.energies.sum()).tolist(),
            }
            for lighting in plan.scene.lightings
        ],
        "materials": [material_record(material) for material in plan.materials],
        "bytes": plan.bytes,
        "fetches_per_pixel": plan.fetches,
        "error_of_the_picture": finite(plan.error),
        "one_size_fits_all": None
        if one is None
        else asdict(one.candidate)
        | {"bytes": one.bytes, "fetches_per_pixel": one.fetches, "bytes_saved": one.bytes - plan.bytes},
        "fits": plan.planning_fits,
        "fits_with_one_size": plan.fits,
        "exhaustive_fits": plan.exhaustive_fits,
        "warnings": list(missed_by_all(plan)),
    }


def material_record(plan: MaterialPlan) -> dict[str, Any]:
    """Return one material's plan, JSON-able. Errors in units of the tolerance have its margins in them."""
    choice, outcome = plan.walk.choice, plan.outcome
    verdict = plan.verdict
    return {
        "source": plan.material.source,
        "name": plan.name,
        "share": plan.material.share,
        "pixels": plan.material.pixels,
        "tolerance": None if plan.material.tolerance is None else plan.material.tolerance.record(),
        "highlight_pixels": plan.highlight_pixels,
        "choice": None
        if choice is None or outcome is None
        else asdict(plan.walk.kept(choice)) | {"bytes": outcome.bytes, "fetches": outcome.fetches},
        "met": plan.walk.met,
        "error": None if outcome is None else finite(outcome.value),
        "error_kind": None if outcome is None else outcome.kind,
        "error_lighting": None if outcome is None else outcome.lighting,
        "trusted": _trusted(plan),
        "of_tolerance": None if outcome is None else finite(outcome.error),
        "missed_by": finite(plan.missed_by),
        "far_smaller": _step(plan, far_smaller(plan)),
        "smaller": _step(plan, smaller(plan)),
        "larger": _step(plan, larger(plan)),
        "best_larger": _step(plan, best_larger(plan)),
        "measured": {
            judge.lighting.name: {kind: finite(value) for kind, value in asdict(errors).items()}
            for judge, errors in zip(plan.judges, plan.errors, strict=False)
        },
        "opinion": None if plan.opinion is None else plan.opinion.record(),
        "needed_order": max(plan.needed_orders),
        "needed_terms": terms_needed(max(plan.needed_orders)),
        "needed_terms_any_light": plan.fits.own_terms,
        "fits": plan.walk.fits,
        "refused": {rung.label: why for rung, why in plan.fits.refused.items()},
        "asked": [_asked(plan, rung, answer) for rung, answer in plan.walk.asked.items()],
        "verdict": None if verdict is None else verdict.record(),
    }


def _step(plan: MaterialPlan, one: Neighbour | None) -> dict[str, Any] | None:
    """Return the record of a neighbour of the choice, with the textures that its fit kept."""
    return None if one is None else one.record() | asdict(plan.walk.kept(one.candidate))


def _trusted(plan: MaterialPlan) -> bool | None:
    """Return whether the choice is trusted; None if it has no verdict."""
    if plan.verdict is not None:
        return plan.verdict.trusted
    if plan.outcome is None or (plan.outcome.trusted and not plan.tolerance.trusted):
        return None
    return plan.outcome.trusted


def finite(value: float) -> float | None:
    """Return the number, or None if JSON cannot represent it (NaN or infinite)."""
    return value if math.isfinite(value) else None


def _asked(plan: MaterialPlan, rung: Candidate, answer: LadderOutcome) -> dict[str, Any]:
    facts = {name: finite(value) if isinstance(value, float) else value for name, value in vars(answer).items()}
    # Only a tolerance that asks for trust has its candidates judged, and of these only those within its limits.
    if not plan.tolerance.trusted or (answer.trusted and answer.error > 1):
        facts["trusted"] = None
    predicted = {}
    if rung.is_colour:
        # Of one colour theory is exact, over all turnings of the lighting.
        predicted["reflected_over_all_turnings"] = {
            judge.lighting.name: colour_error(rung, plan.fits.lobes, judge.lighting) for judge in plan.judges
        }
    return asdict(rung) | facts | predicted
