"""`homofact export`: a result's textures in an engine's format, with the shaders that read them."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.text import Text

from homofact.api.exporting import SKY_SIDE, ExportResult
from homofact.cli import options as o
from homofact.cli.layout import hanging
from homofact.cli.screen import Screen
from homofact.cli.tables import appearance_tables, stored_table
from homofact.containers.format_names import FORMAT_NAMES
from homofact.errors import BadInput
from homofact.evaluation.wording import brief_figure, counted, listed

HTML, README = "html", "README.md"

# RMS of logarithms by which storing may move a fit without a word: 5% of the values.
_MUCH_MOVED = 0.05


def export(
    result: o.Result,
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder for textures and shaders.")],
    form: Annotated[
        str | None,
        typer.Option(
            "--format",
            help=f"Format of the textures: {', '.join(FORMAT_NAMES)}; or html, the page of homofact view."
            " Default: with --quantize, that format. An export of 8 or 16 bits keeps its own format. Any other fit"
            " is written as exr, or as exr16 with --engine three or godot.",
            show_default=False,
        ),
    ] = None,
    quantize: Annotated[
        str | None,
        typer.Option(
            help="png8 or png16: optimize all 8-bit or 16-bit texels together, instead of rounding each texel."
            " Texels of svd and nmf fits are always rounded.",
            show_default=False,
        ),
    ] = None,
    engine: Annotated[
        str | None,
        typer.Option(
            help="Add the files that an engine loads: three (an npm package with an example page), gltf (the"
            " metallic-roughness material that looks most like the fit), materialx (a BSDF node), godot (a material),"
            " blender (a script that makes the material), pbrt (a scene for pbrt-v4 with a table of the fit).",
            show_default=False,
        ),
    ] = None,
    prefilter: Annotated[
        Path | None,
        typer.Option(
            metavar="SKY",
            help="Also prefilter this latitude-longitude environment map (.hdr or .exr). Writes one cube map for all"
            " materials, and a table and shaders for this material. With --engine godot, the exported material"
            " reflects this map.",
            show_default=False,
        ),
    ] = None,
    prefilter_side: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help=f"Texels per side of each face of the prefiltered cube map, a power of two. More give sharper"
            f" reflections. Default: {SKY_SIDE}.",
            show_default=False,
        ),
    ] = None,
    source: o.MadeFrom = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing export.")] = False,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Write textures and the shaders that read them: GLSL, HLSL, WGSL, C.

    The folder gets the textures, brdf.glsl, brdf.hlsl, brdf.wgsl and brdf.c, each with homofact_evaluate(wi, wo),
    homofact_sample(wo, u) and homofact_density(wi, wo), and manifest.json with everything that a loader needs. The
    command prints the error of the stored texels.
    With --prefilter the folder also gets a table of the material, the prefiltered sky, and prefiltered.glsl, .hlsl,
    .wgsl and .c, each with homofact_light_reflected(n, wo). All materials share the prefiltered sky.
    """
    if form == HTML:
        for name, given in (("engine", engine), ("quantize", quantize), ("prefilter", prefilter)):
            if given is not None:
                raise BadInput(where=name, found=f"{given} with the format {HTML}", expected="a format of textures")

        from homofact.api.viewing import NAME
        from homofact.cli.view import view

        page = out if out.suffix in (".html", ".htm") else out / NAME
        view(result, source, out=page, force=force, as_json=as_json, quiet=quiet)
        return

    from homofact.api.exporting import export

    screen = Screen(as_json, quiet)
    with screen.progress() as progress:
        found = export(
            result, out, format=form, quantize=quantize, engine=engine, prefilter=prefilter,
            prefilter_side=prefilter_side, source=source, force=force, progress=progress,
        )  # fmt: skip
    for warning in _warnings(found):
        screen.note(f"homofact: {warning}")
    if not quiet:
        _show(found, out, engine, screen)
    screen.answer(found.record())


def _show(found: ExportResult, folder: Path, engine: str | None, screen: Screen) -> None:
    """What storing cost, what an evaluation takes, how the engine's material looks, and what to do next."""
    cost, looks, verdict = found.cost, found.looks or {}, found.verdict
    screen.show(
        *([] if verdict is None or _is_doubted(found) else [hanging(f"Verdict on the fit: {verdict['summary']}", 2)]),
        stored_table(found.errors, found.part),
        Text(
            f"One evaluation: {counted(cost.fetches, 'fetch')}, {cost.total} operations ({cost.scalar} if each"
            f" component of a vector counts), {cost.nbytes} bytes of textures in graphics memory."
        ),
        Text(_noise_line(found.noise)),
        *(Text(part.sentence()) for part in (found.prefiltered, found.light) if part is not None),
        *appearance_tables(looks),
        *(look["said"] for look in looks.values() if look["said"]),
        *([] if found.likeness is None else [Text(found.likeness.phrase)]),
        f"{folder}: {', '.join(found.files)}",
        "",
        *_shipped_line(found),
        _next_line(folder, engine, found.files, cost.fetches),
    )


def _is_doubted(found: ExportResult) -> bool:
    """Whether the fit has a verdict that does not trust it."""
    return found.verdict is not None and not found.verdict["trusted"]


def _shipped_line(found: ExportResult) -> list[str]:
    """Which files the engine needs, and their bytes, where these are not all."""
    if not found.shipped:
        return []
    size = sum((found.folder / name).stat().st_size for name in found.shipped)
    return [f"Ship {listed(found.shipped)}, {size} bytes; the other files are not needed at run time."]


def _next_line(folder: Path, engine: str | None, files: Sequence[str], fetches: int) -> str | Text:
    """What to do with the folder; a line with a place in it is not wrapped."""
    if engine is None:
        loaded = "; manifest.json tells a loader how to read the textures" if fetches else ""
        return Text(
            f"Call homofact_evaluate(wi, wo) of brdf.glsl, .hlsl, .wgsl or .c{loaded}. For files that an engine loads:"
            " --engine three, gltf, materialx, godot, blender or pbrt"
        )
    if README in files:
        return f"Load it: {folder / README} explains how"
    return f"Render it: pbrt {folder / 'scene.pbrt'}"


def _warnings(found: ExportResult) -> list[str]:
    """What to beware of."""
    verdict = found.verdict
    why = found.caution
    if not found.source_found:
        why = f"errors on samples are not measured: {found.caution}; --source names a file of samples"
    told = [
        f"read the verdict before you ship: {verdict['summary']}" if verdict and _is_doubted(found) else "",
        "" if found.likeness is None else found.likeness.warning_of(found.prefiltered is not None),
        "" if found.light is None else found.light.warning,
    ]
    return [each for each in (why if found.caution else "", *told, _storage_warning(found)) if each]


def _storage_warning(found: ExportResult) -> str:
    """A line on what storing moved by more than an eye may miss; "" where it did not."""
    stored = list(found.errors)[-1]
    moved = found.errors[stored]["log_difference"]
    if not moved > _MUCH_MOVED:
        return ""
    more = "the formats png16 and exr16 store more" if found.format == "png8" else ""
    if more and not stored.startswith("solved"):
        more = f"--quantize png8 solves the texels for 8 bits, and {more}"
    return f"{stored}, the logarithms are off by {moved:.2g} (RMS)" + (f": {more}" if more else "")


def _noise_line(measured: Sequence[Mapping[str, float]]) -> str:
    own, cosine = (
        ", ".join(f"{brief_figure(at[name])} at {at['angle']:.0f}°" for at in measured)
        for name in ("variance", "cosine")
    )
    return (
        f"Noise of importance sampling, relative variance per sample by the viewer's angle: homofact_sample {own};"
        f" cosine sampling {cosine}."
    )
