"""`homofact export`: a result's textures in an engine's format, with the shaders that read them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer
from rich.text import Text

from homofact.cli import options as o
from homofact.cli.places import check_result
from homofact.cli.screen import Screen
from homofact.cli.tables import appearance_tables, stored_table
from homofact.containers.names import FORMAT_NAMES
from homofact.errors import BadInput
from homofact.files.kinds import ENGINE_MARK
from homofact.files.lock import claimed

if TYPE_CHECKING:
    from collections.abc import Mapping

    from homofact.brdf.reflectance import Reflectance
    from homofact.brdf.samples import Samples
    from homofact.evaluate.reopening import Reopened
    from homofact.export.exported import Exported
    from homofact.factor.fitted import Fitted

HTML = "html"
SKY_SIDE = 256  # as `render.sky_chain.SIDE`, which help must not load


def export(
    result: o.Result,
    to: Annotated[Path, typer.Option("--to", metavar="FOLDER", help="Where textures and shaders go.")],
    form: Annotated[
        str | None,
        typer.Option(
            "--format",
            help=f"Of the textures: {', '.join(FORMAT_NAMES)}; or html, the page of homofact view."
            " exr, or what --quantize asks for, unless given.",
            show_default=False,
        ),
    ] = None,
    quantize: Annotated[
        str | None,
        typer.Option(
            help="png8 or png16: solve for the best texels of 8 or 16 bits, instead of rounding each by itself"
            " (of a sum of products they are rounded).",
            show_default=False,
        ),
    ] = None,
    engine: Annotated[
        str | None,
        typer.Option(
            help="Add what an engine loads: three (an npm package with an example page), gltf (the"
            " metallic-roughness material that looks most like it), materialx (a BSDF node), godot (a material),"
            " blender (a script that makes the material), pbrt (a scene for pbrt-v4 with the fit tabulated).",
            show_default=False,
        ),
    ] = None,
    prefilter: Annotated[
        Path | None,
        typer.Option(
            metavar="SKY",
            help="Filter this lat-long .hdr or .exr too: a cube map with levels for all materials, this one's table and"
            " shaders of a split sum.",
            show_default=False,
        ),
    ] = None,
    prefilter_side: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help=f"Texels a side of the filtered sky's faces, a power of two, {SKY_SIDE} unless given: how sharp"
            " reflections get.",
            show_default=False,
        ),
    ] = None,
    source: o.MadeFrom = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an export that is there.")] = False,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Write textures and the shaders that read them: GLSL, HLSL, WGSL, C.

    The folder gets the textures, brdf.glsl, brdf.hlsl, brdf.wgsl and
    brdf.c, each with homofact_evaluate(wi, wo), homofact_sample(wo, u) and
    homofact_density(wi, wo), and manifest.json with all that a loader
    needs. The error is that of the stored texels.
    With --prefilter there are prefiltered.glsl, .hlsl, .wgsl and .c as
    well, each with homofact_light_reflected(n, wo), the material's table
    and the sky, which is the same for every material.
    """
    if engine is not None and form == HTML:
        raise BadInput(f"format: found {HTML} with --engine {engine}, expected a format of textures")
    name = form or quantize or "exr"
    if quantize is not None and quantize not in ("png8", "png16"):
        raise BadInput(f"quantize: found {quantize!r}, expected png8 or png16")
    if quantize is not None and quantize != name:
        raise BadInput(f"format: found {name!r} with --quantize {quantize}, expected {quantize}")
    if prefilter_side is not None and prefilter is None:
        raise BadInput("prefilter-side: found it without --prefilter, expected a sky to filter")
    if name == HTML and prefilter is not None:
        raise BadInput("prefilter: found --format html, expected a format of textures")
    if name == HTML:
        from homofact.cli.view import NAME, view

        page = to if to.suffix in (".html", ".htm") else to / NAME
        view(result, source, out=page, force=force, as_json=as_json, quiet=quiet)
        return

    if name not in FORMAT_NAMES:
        raise BadInput(f"texture format {name!r}, expected one of {', '.join(FORMAT_NAMES)}")
    check_result(result)

    from homofact.containers.formats import format_named
    from homofact.evaluate.reopening import NotReopened, Reopened, reopen
    from homofact.export.exported import check_export_folder, exported, write_exported
    from homofact.export.prefiltered import prefiltered_export
    from homofact.export.result import open_result
    from homofact.factor.quantize import is_solved
    from homofact.render.environment import read_environment
    from homofact.render.sky_chain import check_side
    from homofact.shading.mixture_fit import fitted_mixture

    of_engine = None
    if engine is not None:
        from homofact.export.engines.table import engine_named

        of_engine, name = engine_named(engine, form or quantize)
    chosen = format_named(name)
    check_export_folder(to, force)
    side = SKY_SIDE if prefilter_side is None else prefilter_side
    check_side(side)
    light = None if prefilter is None else read_environment(prefilter)
    screen = Screen(as_json, quiet)
    with claimed(to), screen.bar() as bar:
        bar.stage("reading")
        fitted = open_result(result)
        made = exported(fitted, chosen)
        folder = result if result.is_dir() else result.parent
        found: Reopened | str
        try:
            found = reopen(fitted, source, (folder,))
        except NotReopened as error:
            found = str(error)
        samples = found if isinstance(found, str) else found.parts
        rows: dict[str, Exported | Fitted] = {"as fitted": fitted, f"stored as {name}": made}
        if quantize is not None:
            bar.stage("solving for whole texels")
            best = exported(_quantized(fitted, found, quantize), chosen)
            rows = {"as fitted": fitted, "each texel rounded": made}
            if is_solved(fitted):
                rows[f"solved for {name}"] = best
            made = best
        bar.stage("fitting lobes to draw from")
        made = replace(made, sampling=fitted_mixture(made.stored))
        if light is not None:
            bar.stage("filtering the environment")
            made = replace(made, prefiltered=prefiltered_export(made.stored, light, chosen, side))
        bar.stage("measuring and writing")
        errors = {label: _errors(each, fitted, samples) for label, each in rows.items()}
        more: dict[str, str | bytes] = {}
        looks: dict[str, Any] = {}
        if of_engine is not None:
            bar.stage(f"making what {of_engine.name} loads")
            added = of_engine.add(made)
            more = dict(added.files)
            looks = _looks(made, added.looks, found)
        of_looks = {label: each["errors"] for label, each in looks.items() if label != "fit"}
        description = write_exported(to, made, errors | of_looks, force, engine or "", more)
    if isinstance(found, str):
        screen.note(f"homofact: no error on samples: {found}; --source names it")
    elif not found.held_out:
        screen.note("homofact: the fit has, or may have, seen the samples that its errors are on")
    if not quiet:
        beside = [*more, ENGINE_MARK] if more else []
        files = [*made.names, *description["code"]["files"], *_light_files(made), "manifest.json", *beside]
        cost = made.cost
        screen.show(
            stored_table(errors, "held_out" if isinstance(found, str) else found.part),
            Text(
                f"One evaluation: {cost.fetches} fetches, {cost.total} operations on vectors and scalars"
                f" ({cost.scalar} on scalars), {cost.nbytes} bytes of texels."
            ),
            Text(_noise_line(description["sampling"]["measured"])),
            *([] if made.prefiltered is None else [Text(made.prefiltered.sentence())]),
            *appearance_tables(looks),
            *(each["said"] for each in looks.values() if each["said"]),
            f"{to}: {', '.join(files)}",
        )
    answer = {"result": str(result), "out": str(to), "errors": errors, "cost": made.cost.record(), "format": name}
    if made.prefiltered is not None:
        answer["prefiltered"] = made.prefiltered.record()
    screen.answer(answer | ({"engine": engine, "looks": looks} if engine else {}))


def _looks(made: "Exported", looks: "Mapping[str, Reflectance]", found: "Reopened | str") -> dict[str, Any]:
    """How each of an engine's look-alikes, and the fit beside them, compares with the source, or else with the fit."""
    from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
    from homofact.brdf.source import made_of_samples
    from homofact.evaluate.appearance import appearance
    from homofact.evaluate.metrics import measure
    from homofact.export.as_source import as_source
    from homofact.export.engines.gltf import said
    from homofact.export.exported import log_difference

    if not looks:
        return {}
    whole = None if isinstance(found, str) or made_of_samples(found.source.reflectance) else found.source
    against = whole or as_source(made.stored, "the fit")
    rows = dict(looks) if whole is None else {"fit": made.stored, **looks}
    answer = {}
    for label, each in rows.items():
        figures = appearance(each, against)
        six = measure(each, against.samples, made.stored.transform).record()
        numbers = f"{said(each)}; " if isinstance(each, MetallicRoughness) else ""
        answer[label] = {
            "against": against.name,
            "appearance": None if figures is None else figures.record(),
            "errors": six | {"log_difference": log_difference(made.stored, each)},
            "said": "" if label == "fit" else f"{label}: {numbers}log_mse {six['log_mse']:.3g}",
        }
    return answer


def _light_files(made: "Exported") -> list[str]:
    return [] if made.prefiltered is None else made.prefiltered.files


def _noise_line(measured: Sequence[Mapping[str, float]]) -> str:
    angles = ", ".join(f"{each['angle']:.0f}°: {each['variance']:.2g} ({each['cosine']:.2g})" for each in measured)
    return f"Relative variance of one direction drawn by homofact_sample (by the cosine), viewer at {angles}."


def _quantized(fitted: "Fitted", source: "Reopened | str", storage: str) -> "Fitted":
    """The fit with whole texels; a product's are solved on the samples that it was made from."""
    from homofact.evaluate.reopening import settings_of
    from homofact.factor.quantize import is_solved, rounded
    from homofact.methods.fitting import Copying, quantized

    if not is_solved(fitted):
        return rounded(fitted, storage)
    if isinstance(source, str):
        raise BadInput(f"quantize: {source}, expected the samples to solve on: name them by --source")
    return quantized(fitted, source.training, cast("Copying", settings_of(fitted)), storage)


def _errors(each: "Exported | Fitted", fitted: "Fitted", samples: "dict[str, Samples] | str") -> dict[str, Any]:
    """What a fit's values are off: from the samples where there are some, and from the fit as it was."""
    from homofact.evaluate.metrics import measure
    from homofact.export.exported import Exported, log_difference

    values = each.stored if isinstance(each, Exported) else each
    errors: dict[str, Any] = {"log_difference": log_difference(fitted, values)}
    if not isinstance(samples, str):
        errors |= {part: measure(values, each, fitted.transform).record() for part, each in samples.items()}
    return errors
