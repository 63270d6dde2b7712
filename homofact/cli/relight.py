"""`homofact relight`: objects under an environment map with their shadows, precomputed, rendered, and judged."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from homofact.cli import options as o
from homofact.cli.layout import add_figures, add_names, plain_table
from homofact.cli.plan_relight import choice_table, name_with_material
from homofact.cli.screen import Screen
from homofact.evaluation.wording import counted, figure, listed

if TYPE_CHECKING:
    from homofact.relighting.build import RelitObject


def relight(
    scene: Annotated[Path, typer.Argument(metavar="SCENE.toml", help="Objects, light, cameras and precision.")],
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder for the relit scene.")],
    vertices: Annotated[
        int, typer.Option(metavar="N", help="Number of vertices per object at which the error is measured; 0 for none.")
    ] = 64,
    whole: Annotated[
        bool,
        typer.Option(
            "--ledger",
            help="Measure the error of every stage of the approximation, including the cube map. This takes minutes.",
        ),
    ] = False,
    reference: Annotated[
        bool,
        typer.Option(
            "--reference",
            help="Also compute the exact sum over all texels for every visible vertex."
            " The page can then show the difference.",
        ),
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing relit scene.")] = False,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Precompute objects with their shadows, so that you can change their light.

    The method is that of Wang, Tran and Luebke 2004: in-out factors of each material, visibility at every vertex,
    and Haar wavelets. If you stop a run, the same command continues it. Open FOLDER/view.html in a browser to
    rotate or replace the sky.
    """
    from homofact.api.relighting import relight as relit
    from homofact.api.viewing import NAME

    screen = Screen(as_json, quiet)
    with screen.progress() as progress:
        found = relit(
            scene, to=out, vertices=vertices, every_stage=whole, reference=reference, page=True, force=force,
            progress=progress,
        )  # fmt: skip
    if not quiet:
        if found.plans:
            screen.show(choice_table(found.plans, found.plans[0].reflected))
        screen.show(object_table(found.objects), *(error_tables(found.report["objects"]) if vertices else []))
        screen.show(*map(Text, interpolation_lines(found.report["objects"])))
        if found.report["picture"] is not None:
            screen.note(likeness_line(found.report["picture"]))
    pictures = counted(len(found.pictures), "picture")
    screen.note(f"The relit scene: {out} ({pictures}); open {out / NAME} in a browser to relight it")
    screen.answer({"folder": str(out), **found.report})


def likeness_line(found: Mapping[str, Any]) -> str:
    """Return a line with the errors of the whole picture."""
    width, height = found["pixels"]
    looks = [f"PSNR {found['psnr']:.1f} dB"] if "psnr" in found else []
    looks += [f"FLIP {found['flip']:.3f}"] if "flip" in found else []
    looks += [f"under the {found['curve']} curve"] if looks and "curve" in found else []
    parts = ", ".join([f"relative RMS {found['error']:.2%}", *looks])
    return f"The whole picture at {width} × {height}: {parts}"


def interpolation_lines(objects: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return a line on objects whose error is mostly interpolation between vertices; empty if there are none."""
    errors = {entry["mesh"]: entry["error"] or {} for entry in objects}
    coarse = [name for name, own in errors.items() if own.get("picture", 0.0) > _COARSE * own.get("together", math.inf)]
    if not coarse:
        return []
    line = "Most of the picture's error is interpolation between vertices; a finer mesh lowers it"
    return [f"{line} ({listed(coarse)})."]


# The total error of the picture over that at the vertices, from which most of its square is between them.
_COARSE = math.sqrt(2)
_ASIDE = ("psnr", "below_zero", "vertices")
_BESIDE = 4  # objects of a table of errors
_ERRORS = (
    'Relative RMS error of the light towards the first camera. "picture": all errors, measured at pixels. "together":'
    " all errors but the interpolation between vertices, measured at vertices; as these are other points, it can be"
    ' larger. "rim": "together" at vertices with cosθo below 0.2. "below'
    ' zero": share of negative light. Other errors: one stage alone. The reference uses the same fits, so these errors'
    " do not include the errors of the fits. Run `homofact info FOLDER` on a fit to print them"
)


def object_table(objects: "tuple[RelitObject, ...]") -> Table:
    """Return one line per object: vertices, form, terms K, mean coefficients N per vector, and stored kB."""
    from homofact.relighting.harmonic import Harmonic

    table = plain_table("Transport of each object (K: terms; N: mean coefficients per vector)")
    add_names(table)
    add_figures(table, "vertices", "form", "K", "N", "kB")
    for relit in objects:
        made = relit.transport
        kept = relit.compact.number.shape[2] if isinstance(relit.compact, Harmonic) else None
        table.add_row(
            name_with_material(relit.mesh.name, relit.material),
            str(made.vertices),
            relit.form,
            str(made.factors.terms),
            f"{made.mean_kept if kept is None else kept:.0f}",
            f"{relit.nbytes / 1000:.0f}",
        )
    return table


def error_tables(objects: Sequence[Mapping[str, Any]]) -> list[Table]:
    """Return one line per stage: relative RMS errors of each object's light, as seen from the first camera.

    If the objects do not fit into a narrow terminal, there are several tables.
    """
    from homofact.rendering.tonemap import DEFAULT_CURVE

    tables = []
    for first in range(0, len(objects), _BESIDE):
        some = objects[first : first + _BESIDE]
        errors = [entry["error"] for entry in some]
        stages = list(dict.fromkeys(name for found in errors for name in found or () if name not in _ASIDE))
        stages.sort(key=lambda name: name != "picture")  # the total, to be read first
        table = plain_table(_ERRORS if first == 0 else None)
        table.add_column("", no_wrap=True)
        for entry in some:
            table.add_column(entry["mesh"], justify="right", overflow="fold", min_width=8)
        for stage in stages:
            table.add_row(stage, *[figure(found[stage]) if found and stage in found else "–" for found in errors])
            if stage == "picture":
                ratios = [f"{found['psnr']:.1f} dB" if found and "psnr" in found else "–" for found in errors]
                table.add_row(f"PSNR, {DEFAULT_CURVE}", *ratios)
        table.add_row("below zero", *[f"{found['below_zero']:.2%}" if found else "not seen" for found in errors])
        tables.append(table)
    return tables
