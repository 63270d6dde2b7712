"""`homofact convert`: a source written in another format, chosen by the ending of the new file.

.csv, .npz and .dat (ALTA text) hold samples: the measurement's, or drawn from the model. .binary (MERL) and .bsdf
(RGL) are full tables: the source's own where it is one, else the model or interpolated samples at their nodes. IN may
be a fit: a result's folder, or a saved one. With --undo samples lose what `brdf.suspicion.undo` knows: a cosine, an
encoding, a wrong angle; with --calibrate their gains.
"""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from homofact.cli import options as o
from homofact.cli.places import check_file, check_result
from homofact.cli.screen import Screen
from homofact.cli.subject import check_source, open_subject
from homofact.errors import BadInput
from homofact.files.atomic import replace_file

if TYPE_CHECKING:
    from homofact.brdf.source import Source
    from homofact.config import Config

_ENDINGS = (".binary", ".bsdf", ".csv", ".npz", ".dat")
_TABLES = (".binary", ".bsdf")
# Pairs at which a written table is compared with its source.
_PAIRS = 5000


@o.configured("output.force", "source", "seed", but=("source.path", "source.subset", "source.clipped"))
def convert(
    settings: "Config",
    source: Annotated[str, typer.Argument(metavar="IN", help="A measurement's file, material:NAME, or a result.")],
    target: Annotated[
        Path,
        typer.Argument(
            metavar="OUT",
            help="The new file: .binary (MERL), .bsdf (RGL, Mitsuba's measured), .csv, .npz or .dat (ALTA).",
        ),
    ],
    undo: Annotated[
        str,
        typer.Option(
            metavar="NAMES",
            help="Conventions to undo, with commas, as homofact info names them: cosine-o, srgb, elevation, ..."
            " (not for .binary and .bsdf; an unknown name lists them).",
            show_default=False,
        ),
    ] = "",
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Write a measurement, a named material or a fit in another format, by the ending of OUT."""
    settings = replace(settings, source=replace(settings.source, path=source))
    if Path(source).is_dir():
        check_result(Path(source))
    else:
        check_source(settings)
    check_file(target, *_ENDINGS)
    if target.exists() and not settings.output.force:
        raise BadInput(f"{target}: exists already, expected a new file (or --force)")
    from homofact.brdf.mending import mending_lines
    from homofact.brdf.suspicion.undo import names_in, undone
    from homofact.export.as_source import is_fit

    names = names_in(undo)
    if names and target.suffix.lower() in _TABLES:
        raise BadInput(f"{target}: found --undo, expected a file of samples with it (.csv, .npz or .dat)")
    screen = Screen(as_json, quiet)
    with screen.bar() as bar:
        bar.stage("reading")
        subject = _fit(settings) if is_fit(source) else open_subject(settings)
        read = len(subject.samples)
        subject = replace(subject, samples=undone(subject.samples, names))
        bar.stage("writing")
        target.parent.mkdir(parents=True, exist_ok=True)
        facts: dict[str, Any] = {}
        replace_file(target, lambda made: facts.update(_write(made, subject)), new=not settings.output.force)
    if names:
        lost = read - len(subject.samples)
        facts["undone"] = list(names)
        facts["notes"].append(
            f"undone: {', '.join(names)}" + (f"; {lost} samples at the horizon left out" if lost else "")
        )
    facts["notes"] += mending_lines(subject.samples.provenance)
    answer = {"source": subject.name, "out": str(target), "bytes": target.stat().st_size, **facts}
    if not quiet:
        screen.show(f"{target}: {facts['format']}, {answer['bytes']} bytes", *facts["notes"])
    screen.answer(answer)


def _fit(settings: "Config") -> "Source":
    """The fit that the settings name as their source."""
    from homofact.export.as_source import fit_as_source

    asked = settings.source
    if asked.channels != "rgb" or asked.calibrate:
        option = "--calibrate" if asked.calibrate else f"--channels {asked.channels}"
        raise BadInput(f"{asked.path}: found {option} with a fit, expected it with a measurement or a material")
    return fit_as_source(str(asked.path), asked.count, asked.scheme, settings.seed)


def _write(target: Path, subject: "Source") -> dict[str, Any]:
    """Write the source in the format of the file's ending; what was written, and what got lost."""
    from homofact.brdf.formats import alta, csv, merl
    from homofact.brdf.source import NOISE_FREE_EPSILON

    noise_free = subject.default_epsilon == NOISE_FREE_EPSILON
    facts_of_source = subject.samples.provenance | ({"noise_free": True} if noise_free else {})
    samples = replace(subject.samples, provenance=facts_of_source)
    comments = (f"converted from {subject.name}", *samples.provenance.get("comments", ()))
    facts: dict[str, Any] = {"samples": len(samples), "channels": list(samples.channels), "notes": []}
    ending = target.suffix.lower()
    if ending == ".binary":
        counts = merl.write(target, subject.reflectance)
        facts |= {"format": "merl", "samples": counts["written"], "channels": ["R", "G", "B"], "bins": counts}
        if not samples.isotropic:
            facts["notes"].append("an anisotropic source: the table holds the cut with h in the xz-plane")
        if not hasattr(subject.reflectance, "raw") and subject.kind == "measurement":
            facts["notes"].append("bins between and beyond the samples are interpolated")
    elif ending == ".bsdf":
        facts |= _write_adaptive(target, subject, comments)
    elif ending == ".csv":
        csv.write(target, samples, comments)
        facts["format"] = "csv"
    elif ending == ".npz":
        from homofact.brdf.formats import npz

        header = {"comments": list(comments), "noise_free": noise_free}
        npz.write(target, samples, header)
        facts["format"] = "npz"
    else:
        alta.write(target, samples, comments=comments)
        facts["format"] = "alta"
    if ending in (".npz", ".dat") and bool((samples.weights != 1).any()):
        facts["notes"].append("weights are not kept in this format")
    return facts


def _write_adaptive(target: Path, subject: "Source", comments: tuple[str, ...]) -> dict[str, Any]:
    """Write RGL's tensor file; what it is, and how far its values are from the source's."""
    from homofact.brdf.adaptive import relative_differences, tabulated
    from homofact.brdf.formats import rgl
    from homofact.brdf.rgl import AdaptiveTable

    reflectance, notes = subject.reflectance, []
    if isinstance(reflectance, AdaptiveTable):
        rgl.write(target, reflectance, comments)
        notes.append("the source's own table, every number as it was; luminance made anew")
        table = reflectance
    else:
        table = tabulated(reflectance, subject.samples.isotropic)
        rgl.write(target, table, comments)
        if subject.kind == "measurement":
            notes.append("between and beyond the samples values are interpolated")
    facts = {"format": "rgl", "channels": list(table.channels), "samples": table.table[..., 0].numel(), "notes": notes}
    if table is not reflectance:
        middle, most = relative_differences(reflectance, table, _PAIRS)
        facts["difference"] = {"median": middle, "quantile_99": most}
        notes.append(f"off the source's values by {middle:.2%} in the median, {most:.2%} at the 99th percentile")
    return facts
