"""The message about a material that misses its tolerance: each limit, the value reached, and the budget."""

from homofact.brdf.scattered import made_of_samples
from homofact.evaluation.wording import counted, listed
from homofact.planning.material_fits import rungs_for
from homofact.planning.plan import MaterialPlan, ScenePlan
from homofact.planning.scene import Budget
from homofact.planning.tolerance import MARGINS, UNLIT, Used


def missed_by_all(found: ScenePlan) -> tuple[str, ...]:
    """Return what a plan's materials miss: a sentence for each that misses a limit, which begins with its name."""
    lines = (missed_words(plan, found.scene.budget, found.allocated) for plan in found.distinct)
    return tuple(line for line in lines if line)


def missed_limits(plan: MaterialPlan) -> tuple[tuple[Used, str], ...]:
    """Return each limit that the choice misses with the worst lighting, "" if the lighting does not matter."""
    by_lighting = [plan.tolerance.uses(errors) for errors in plan.errors]
    found = []
    for each in zip(*by_lighting, strict=True):
        worst = max(range(len(each)), key=lambda k: each[k].ratio)
        if each[worst].ratio > 1:
            found.append((each[worst], "" if each[worst].kind in UNLIT else plan.judges[worst].lighting.name))
    return tuple(found)


def bound_by(plan: MaterialPlan, budget: Budget, shared: bool = False) -> str:
    """Name the limits of a budget that rule out some representation, such as " within 50 bytes"; "" for none.

    If `shared`, the bytes were distributed over the materials, which rules out more representations.
    """
    samples, rungs = plan.fits.source.samples, rungs_for(plan.fits, plan.tolerance)
    named = []
    if budget.bytes is not None:
        if shared:
            named.append(f"{counted(budget.bytes, 'byte')} for all materials together")
        elif max(rung.most_bytes(len(samples.channels)) for rung in rungs) > budget.bytes:
            named.append(counted(budget.bytes, "byte"))
    if budget.fetches is not None and max(rung.most_fetches(samples.isotropic) for rung in rungs) > budget.fetches:
        named.append(counted(budget.fetches, "fetch"))
    return f" within {listed(named)}" if named else ""


def missed_words(plan: MaterialPlan, budget: Budget, shared: bool = False) -> str:
    """Return every limit that the choice misses, with what it reaches; "" where it meets all.

    `shared` as `bound_by` has it.
    """
    choice = plan.walk.choice
    if choice is None:
        return f"{plan.name}: no representation fits the budget"
    if plan.walk.met:
        return ""
    outcome, words = plan.walk.asked[choice], plan.walk.kept(choice).words
    if not outcome.trusted:
        return (
            f"{plan.name}: no representation was found that meets the limits and has a trusted"
            f" verdict{bound_by(plan, budget, shared)}; the closest, {words}, meets the limits"
        )
    limits = dict(plan.tolerance.limits)
    wanted, reached = [], []
    for used, lighting in missed_limits(plan):
        where = f" under {lighting}" if lighting and len(plan.judges) > 1 else ""
        margin = MARGINS[used.kind]
        with_margin = f" ({used.error * margin:.3g} with the margin of × {margin:g} for other views)"
        wanted.append(f"{used.kind} {limits[used.kind]:g}{where}")
        reached.append(f"{used.kind} {used.error:.3g}{with_margin if margin > 1 else ''}")
    of_light = any(used.kind not in UNLIT for used, _ in missed_limits(plan))
    compared = of_light and made_of_samples(plan.fits.source.reflectance)
    against = " against an interpolation of the samples" if compared else ""
    return (
        f"{plan.name}: no representation was found that meets {listed(wanted)}{bound_by(plan, budget, shared)};"
        f" the closest, {words}, reaches {listed(reached)}{against}"
    )
