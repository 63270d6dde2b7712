"""What is in the folder of a plan: the choice for each material, its bytes, its errors and its verdict."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from homofact.errors import BadInput
from homofact.evaluation.wording import counted, figure, listed, used_of_limit
from homofact.files.kinds import PLAN


def plan_facts(place: Path) -> tuple[str, dict[str, Any], dict[str, Any]] | None:
    """Return (title, readable rows, JSON form) of a plan's folder or its plan.json; None for anything else.

    Raises BadInput where plan.json is damaged.
    """
    if not PLAN.is_at(place):
        return None

    from homofact.files.fields import Fields

    file = place / PLAN.mark if place.is_dir() else place
    found = Fields.read(file, "a plan").found
    try:
        return str(found["scene"]), plan_rows(found), {"folder": str(file.parent), "kind": PLAN.what, **found}
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise BadInput(f"damaged ({error!r})", where=file, expected="a plan that `plan` wrote") from error


def plan_entry(place: Path) -> dict[str, Any] | None:
    """Return plan.json's entry on the choice in this folder, or None if the folder belongs to no plan.

    A damaged plan.json is ignored, because the choice can be read without it.
    """
    from homofact.files.fields import Fields

    mark = place.absolute().parent / PLAN.mark
    if not place.is_dir() or not mark.is_file():
        return None
    try:
        entries = Fields.read(mark, "a plan").found["materials"]
        return next((each for each in entries if each["folder"] == place.absolute().name), None)
    except (BadInput, KeyError, TypeError, AttributeError):
        return None


def plan_rows(found: Mapping[str, Any]) -> dict[str, Any]:
    """Return readable rows of a plan's JSON form: names and values."""
    from homofact.planning.tolerance import Tolerance

    distinct = {
        (each["source"], each["pixels"], str(each.get("tolerance"))): each for each in found["materials"]
    }.values()
    names = [
        each["name"] if each["pixels"] is None else f"{each['name']}, {each['pixels']} pixels" for each in distinct
    ]
    met = sum(bool(each["met"]) for each in distinct)
    rows: dict[str, Any] = {
        "kind": PLAN.what,
        "tolerance": None if found["tolerance"] is None else Tolerance.of(**found["tolerance"]).describe(),
        "lighting": listed([each["name"] for each in found["lightings"]]),
        "met": f"for {met} of {counted(len(names), 'material')}",
        "bytes": found["bytes"],
        "fetches": f"{found['fetches_per_pixel']:.2g} per pixel",
    }
    for name, each in zip(names, distinct, strict=True):
        rows[f"material {name}"] = _choice(each)
        for step in ("far_smaller", "smaller", "larger"):
            # Plans of earlier versions do not have them.
            if each.get(step) is not None:
                rows[f"{step.replace('_', ' ')} {name}"] = _step(each[step])
            elif step == "larger" and each.get("best_larger") is not None:
                rows[f"larger {name}"] = "none helps: no larger one is clearly better, as measured or expected"
    for name, each in zip(names, distinct, strict=True):
        if each["verdict"] is not None:
            rows[f"verdict on {name}"] = each["verdict"]["summary"]
    return rows | {"missed": list(found["warnings"])}


def _step(one: Mapping[str, Any]) -> str:
    """Describe a representation smaller or larger than the choice, and the part of its limit that it uses."""
    from homofact.planning.ladder import Candidate

    words = Candidate(one["method"], one["textures"], one["size"], one["storage"]).words
    return (
        f"{words}; {counted(one['bytes'], 'byte')}, {'' if one['measured'] else 'about '}{_used(one['of_tolerance'])}"
    )


def _used(part: float | None) -> str:
    """Return the part of its limit that an error uses; None is an error without a finite value."""
    return "more than can be measured" if part is None else used_of_limit(part)


def _choice(each: Mapping[str, Any]) -> str:
    """Describe a material's chosen representation, its cost, and the error that uses most of its limit."""
    from homofact.planning.ladder import Candidate
    from homofact.planning.tolerance import WORDS, Tolerance

    choice = each["choice"]
    if choice is None:
        return "no representation fits the budget"
    candidate = Candidate(choice["method"], choice["textures"], choice["size"], choice["storage"])
    size = f"{counted(choice['bytes'], 'byte')}, {counted(choice['fetches'], 'fetch')}"
    under = f" under {each['error_lighting']}" if each["error_lighting"] else ""
    part = _used(each["of_tolerance"]) if each.get("trusted", True) else "within the limit, but not trusted"
    error = f"{WORDS[each['error_kind']]} {figure(each['error'])}{under}, {part}"
    where = f"; in {each['folder']}" if each.get("folder") else ""
    if each.get("tolerance"):
        error += f", its own: {Tolerance.of(**each['tolerance']).describe()}"
    return f"{'' if each['met'] else 'closest: '}{candidate.words}; {size}; {error}{where}"
