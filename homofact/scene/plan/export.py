"""The chosen representations of a plan on disk: a folder a material, and plan.json that names them."""

import math
from pathlib import Path
from typing import Any

from homofact.export.manifest import write_json
from homofact.export.result import write_result
from homofact.files.folder import check_new_folder
from homofact.files.kinds import PLAN
from homofact.scene.plan.plan import MaterialPlan, ScenePlan

COLOUR = "colour.json"


def check_plan_folder(folder: Path, force: bool) -> None:
    """Raise BadInput where `write_plan` could not put a plan: refused as `files.folder.check_new_folder` says."""
    check_new_folder(folder, PLAN, force)


def write_plan(folder: Path, plan: ScenePlan, force: bool = False) -> dict[str, str]:
    """Write every choice to its folder, plan.json last; the folders' names by source.

    A fit is written as `export.result` does, one colour as colour.json: `f` per channel in sr⁻¹, and for lambert-9
    the lighting's 9 terms. Raises BadInput as `check_plan_folder`, and for places that cannot be written.
    """
    check_plan_folder(folder, force)
    folder.mkdir(parents=True, exist_ok=True)
    names: dict[str, str] = {}
    for place, each in enumerate({each.material.source: each for each in plan.materials}.values(), 1):
        if each.walk.choice is None:
            continue
        stem = "".join(c if c.isalnum() or c in "-_" else "-" for c in Path(each.bench.source.name).stem)
        names[each.material.source] = f"{place}-{stem}"
        _write_choice(folder / names[each.material.source], each, force)
    record = plan.record()
    for entry in record["materials"]:
        entry["folder"] = names.get(entry["source"])
    write_json(folder / PLAN.mark, record)
    return names


def _write_choice(folder: Path, each: MaterialPlan, force: bool) -> None:
    choice = each.walk.choice
    if choice is None:
        return
    if not choice.is_colour:
        fit, report = each.bench.fitted(choice)
        facts: dict[str, Any] = each.record() | {"fit": {"status": report.status.value, "seconds": report.seconds}}
        write_result(folder, factorization=fit, report=facts, force=force)
        return
    model = each.judge.colour(each.tolerance.kind)
    folder.mkdir(parents=True, exist_ok=True)
    record: dict[str, Any] = {
        "method": choice.method,
        "channels": list(model.channels),
        "f_per_sr": [float(x) / math.pi for x in model.diffuse],
    }
    if choice.method != "constant":
        record["lighting_terms"] = each.judge.lighting.coefficients[:9].tolist()
    write_json(folder / COLOUR, record)
