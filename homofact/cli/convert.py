"""`homofact convert`: a source written in another format, chosen by the ending of the new file.

.csv, .npz and .dat (ALTA text) hold samples: those of the measurement, or drawn from the model. .binary (MERL)
is a full table: the source's own where it is one, else the model or the interpolated samples at its bins. With --undo
samples lose what `brdf.suspicion.undo` knows: a cosine, an encoding, a wrong angle; with --calibrate their gains.
"""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from homofact.cli import options as o
from homofact.cli.places import check_file
from homofact.cli.screen import Screen
from homofact.cli.subject import check_source, open_subject
from homofact.errors import BadInput
from homofact.files.atomic import replace_file

if TYPE_CHECKING:
    from homofact.brdf.source import Source
    from homofact.config import Config

_ENDINGS = (".binary", ".csv", ".npz", ".dat")


@o.configured("output.force", "source", "seed", but=("source.path", "source.subset", "source.clipped"))
def convert(
    settings: "Config",
    source: Annotated[str, typer.Argument(metavar="IN", help="A measurement's file, or material:NAME.")],
    target: Annotated[
        Path, typer.Argument(metavar="OUT", help="The new file: .binary (MERL), .csv, .npz or .dat (ALTA).")
    ],
    undo: Annotated[
        str,
        typer.Option(
            metavar="NAMES",
            help="Conventions to undo, with commas, as homofact info names them: cosine-o, srgb, elevation, ..."
            " (not for .binary; an unknown name lists them).",
            show_default=False,
        ),
    ] = "",
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Write a measurement or a named material in another format, by the ending of OUT."""
    settings = replace(settings, source=replace(settings.source, path=source))
    check_source(settings)
    check_file(target, *_ENDINGS)
    if target.exists() and not settings.output.force:
        raise BadInput(f"{target}: exists already, expected a new file (or --force)")
    from homofact.brdf.mending import mending_lines
    from homofact.brdf.suspicion.undo import names_in, undone

    names = names_in(undo)
    if names and target.suffix.lower() == ".binary":
        raise BadInput(f"{target}: found --undo, expected a file of samples with it (.csv, .npz or .dat)")
    screen = Screen(as_json, quiet)
    with screen.bar() as bar:
        bar.stage("reading")
        subject = open_subject(settings)
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
