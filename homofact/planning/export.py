"""The chosen representations of a plan on disk: a folder a material, and plan.json that names them."""

import math
from pathlib import Path
from typing import Any

from homofact.containers.formats import format_named
from homofact.exporting.exported import exported, write_exported
from homofact.exporting.manifest import write_json
from homofact.exporting.result import write_result
from homofact.files.folder import check_new_folder
from homofact.files.kinds import PLAN, is_ours
from homofact.planning.ladder import CONSTANT, WHOLE, Candidate
from homofact.planning.material_fits import as_texture
from homofact.planning.plan import MaterialPlan, ScenePlan
from homofact.planning.record import material_record, plan_record
from homofact.planning.scene import SceneMaterial

COLOUR = "colour.json"


def check_plan_folder(folder: Path, force: bool) -> None:
    """Raise BadInput, as `files.folder.check_new_folder`, if `write_plan` cannot write to the folder."""
    check_new_folder(folder, PLAN, force)


def write_plan(folder: Path, plan: ScenePlan, force: bool = False) -> dict[str, str]:
    """Write every choice to its folder, plan.json last; the folders' names by source (and pixels and
    own tolerance, where given).

    A fit is written as `exporting.result` does, one of whole texels as `exporting.exported` does (PNG of 8 bits with
    their shaders), and one colour as a fit of one constant texture with colour.json beside it, which has `f` per
    channel in sr⁻¹ and, for lambert-9, the 9 terms of each lighting. Raises BadInput as `check_plan_folder`, and for
    places that cannot be written.
    """
    check_plan_folder(folder, force)
    folder.mkdir(parents=True, exist_ok=True)
    names: dict[str, str] = {}
    for place, chosen in enumerate(plan.distinct, 1):
        if chosen.walk.choice is None:
            continue
        stem = "".join(c if c.isalnum() or c in "-_" else "-" for c in Path(chosen.name).stem)
        names[_key(chosen.material)] = f"{place}-{stem}"
        _write_choice(folder / f"{place}-{stem}", chosen, chosen.walk.choice, force)
    record = plan_record(plan)
    for entry, material in zip(record["materials"], plan.scene.materials, strict=True):
        entry["folder"] = names.get(_key(material))
    write_json(folder / PLAN.mark, record)
    return names


def _key(material: SceneMaterial) -> str:
    at = "" if material.pixels is None else f" at {material.pixels} pixels"
    own = "" if material.tolerance is None else f", {material.tolerance.describe()}"
    return f"{material.source}{at}{own}"


def _write_choice(folder: Path, plan: MaterialPlan, choice: Candidate, force: bool) -> None:
    if force and folder.is_dir():
        # The plan before may have chosen another kind of thing.
        for entry in folder.iterdir():
            if is_ours(entry) or entry.name == COLOUR:
                entry.unlink()
    if plan.colour is not None:
        # As an even texture it can be exported, rendered and shown as any other choice.
        even = as_texture(plan.colour, plan.fits.training, plan.fits.source.default_epsilon)
        write_result(folder, factorization=even, report=material_record(plan), force=force)
        record: dict[str, Any] = {
            "method": choice.method,
            "channels": list(plan.colour.channels),
            "f_per_sr": [float(x) / math.pi for x in plan.colour.diffuse],
        }
        if choice.method != CONSTANT:
            terms = {judge.lighting.name: judge.lighting.coefficients[:9].tolist() for judge in plan.judges}
            record["lighting_terms"] = terms
        write_json(folder / COLOUR, record)
        return
    fit, report = plan.fits.fitted(choice)
    if choice.storage == WHOLE:
        write_exported(folder, exported(fit, format_named(WHOLE)), {"plan": material_record(plan)["measured"]}, force)
        return
    facts: dict[str, Any] = material_record(plan) | {"fit": {"status": report.status.value, "seconds": report.seconds}}
    write_result(folder, factorization=fit, report=facts, force=force)
