"""The tables of `homofact plan`: the choices, the next smaller and larger representations, and the evidence."""

from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

from homofact.cli.layout import add_figures, add_names, plain_table
from homofact.evaluation.wording import brief_figure, counted, figure, part_of_limit, used_of_limit
from homofact.planning.tolerance import WORDS

if TYPE_CHECKING:
    from homofact.planning.neighbours import Neighbour
    from homofact.planning.plan import MaterialPlan, ScenePlan

# In place of the part of the limit: within it, but for its verdict.
_UNTRUSTED = "not trusted"


def choice_table(found: "ScenePlan") -> Table:
    """Return one line per material: the choice, bytes and fetches, and the worst error as a share of the limit.

    If no choice meets the tolerance, it is the closest one that was found.
    """
    table = plain_table(headline(found))
    add_names(table, longest=max(len(name_of(each)) for each in found.materials))
    met = [each.walk.met for each in found.materials]
    table.add_column("ship" if all(met) else "choice" if any(met) else "closest found", min_width=18)
    add_figures(table, "bytes", "fetches")
    several = len(found.scene.lightings) > 1
    table.add_column("worst error", overflow="fold")
    add_figures(table, "of limit")
    for each in found.materials:
        choice, outcome = each.walk.choice, each.outcome
        if choice is None or outcome is None:
            table.add_row(name_of(each), Text("nothing fits the budget", "bold red"), "–", "–", "–", "–")
            continue
        part = part_of_limit(outcome.error) if outcome.trusted else _UNTRUSTED
        used = Text(part, "bold" if each.walk.met else "bold red")
        under = f" under {outcome.lighting}" if several and outcome.lighting else ""
        worst = f"{WORDS[outcome.kind].removeprefix('error of ')} {figure(outcome.value)}{under}"
        words = each.walk.kept(choice).words
        words = words if each.walk.met or not any(met) else f"closest: {words}"
        table.add_row(name_of(each), words, str(outcome.bytes), str(outcome.fetches), worst, used)
    return table


def headline(found: "ScenePlan") -> str:
    """Return the bytes, textures and fetches of the whole scene, with its tolerance and lighting."""
    textures = sum(
        0 if plan.walk.choice is None else plan.walk.kept(plan.walk.choice).textures
        for plan in found.distinct
        if plan.outcome
    )
    lightings = " and ".join(each.name for each in found.scene.lightings)
    missed = sum(not plan.walk.met for plan in found.distinct)
    miss = f"; missed for {missed} of {len(found.distinct)}" if missed else ""
    return (
        f"{counted(len(found.distinct), 'material')}: {counted(found.bytes, 'byte')} in"
        f" {counted(textures, 'texture')}, {fetches_in_words(found.fetches)} per pixel on average; tolerance:"
        f" {found.tolerance_words} under {lightings}{miss}"
    )


def fetches_in_words(fetches: float) -> str:
    """Return the mean number of fetches with its noun: "1 fetch", "1.7 fetches"."""
    return f"{fetches:.2g} {'fetch' if fetches == 1 else 'fetches'}"


def step_table(found: "ScenePlan") -> Table | None:
    """Return the errors of smaller and larger representations of each material; None if there are none."""
    from homofact.planning.neighbours import best_larger, far_smaller, larger, smaller, sufficient

    table = plain_table("One step smaller or larger")
    add_names(table, longest=max(len(name_of(each)) for each in found.materials))
    table.add_column("step")
    table.add_column("representation")
    add_figures(table, "bytes", "of limit")
    for each in found.distinct:
        name: str | Text = name_of(each)
        up, enough = larger(each), sufficient(each)
        down, far = smaller(each), far_smaller(each)
        steps = [("far smaller", far)] if far is not None and far != down else []
        steps += [("smaller", down), ("larger", up)]
        # The budget may rule out what would meet the tolerance.
        if enough is not None and enough != up:
            steps.append(("within the limit", enough))
        for step, one in steps:
            if one is None:
                if step == "larger" and each.outcome is not None and each.outcome.error > 0:
                    table.add_row(name, step, *_no_better(each, best_larger(each)))
                continue
            words = each.walk.kept(one.candidate).words
            if one == enough:
                # Perhaps it is the fetches that the budget rules it out by.
                words += f", {counted(each.walk.asked[one.candidate].fetches, 'fetch')}"
            table.add_row(name, step, words, str(one.bytes), _used(one))
            name = ""
    return table if table.row_count else None


def _used(one: "Neighbour") -> str:
    if not one.trusted:
        return _UNTRUSTED
    return part_of_limit(one.error) if one.measured else f"about {part_of_limit(one.error)}"


def _no_better(plan: "MaterialPlan", best: "Neighbour | None") -> tuple[str, str, str]:
    """Representation, bytes and error of a larger step that gains nothing, with the best of those tried in words."""
    from homofact.planning.neighbours import NEAR

    if best is None:
        return "there is no larger candidate", "–", "–"
    if not best.measured:
        return f"none helps: no candidate of up to {NEAR} × the bytes is expected to err clearly less", "–", "–"
    assert plan.outcome is not None
    tried = sum(answer.bytes > plan.outcome.bytes for answer in plan.walk.asked.values())
    less = "a barely smaller" if best.error < plan.outcome.error else "no smaller"
    used = used_of_limit(best.error) if best.trusted else _UNTRUSTED
    own = f"{plan.walk.kept(best.candidate).words} ({best.bytes} bytes, {used})"
    if tried == 1:
        words = (
            f"none helps: {own} has {less} error, and others of up to {NEAR} × the bytes are expected to gain little"
        )
    else:
        words = f"none helps: {tried} were tried and have {less} error, the best of them {own}"
    return words, "–", "–"


def evidence_table(found: "ScenePlan") -> Table:
    """List each choice under each lighting: the order that its lobe needs, and all errors, without margins."""
    from homofact.planning.theory import terms_needed

    table = plain_table("Errors of the choices, and what theory predicts")
    add_names(table, longest=max(len(name_of(each)) for each in found.materials))
    several = len(found.materials[0].judges) > 1
    if several:
        table.add_column("under", overflow="fold", min_width=8)
    add_figures(table, "order", "terms", "reflected", "ΔE", "p95", "peak", "cole")
    for each in found.materials:
        for k, (judge, order) in enumerate(zip(each.judges, each.needed_orders, strict=True)):
            row: list[str | Text] = [name_of(each) if k == 0 else ""]
            row += [judge.lighting.name] if several else []
            row += [str(order), str(terms_needed(order))]
            if each.errors:
                errors = each.errors[k]
                kinds = ("reflected", "delta_e", "delta_e_p95", "delta_e_peak", "cole")
                row += [brief_figure(errors.of(kind)) for kind in kinds]
            else:
                row += ["–"] * 5
            table.add_row(*row)
    return table


def name_of(each: "MaterialPlan") -> Text:
    """Return the material's name, with the width of its object where the scene gives one."""
    pixels = each.material.pixels
    return Text(each.name if pixels is None else f"{each.name}, {pixels} pixels")
