"""Converting: write a source or a fit in another format, which the extension of the new file selects.

.csv, .npz and .dat (ALTA text) contain samples: those of the measurement, or samples drawn from the model. .binary
(MERL) and .bsdf (RGL) are full tables. If the source is such a table, homofact copies it; otherwise homofact evaluates
the model, or interpolates the samples, at the nodes. The formats of lighting and optics are full tables too: .xml
(WINDOW and Radiance), .brdf and .anisotropicbsdf (Ansys Speos), and Zemax's .bsdf, which needs `form` because RGL's
files have the same ending.
"""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.api.places import check_file, check_result
from homofact.api.progress import Progress, ProgressSteps
from homofact.api.subjects import Place, given_source, open_given
from homofact.brdf.source_names import DEFAULT_CALIBRATE, DEFAULT_COUNT, DEFAULT_SCHEME, as_names
from homofact.errors import Advice, BadInput
from homofact.files.atomic import replace_file
from homofact.sections import SourceSettings

if TYPE_CHECKING:
    from homofact.brdf.source import Source

# The formats of each ending, its own first.
FORMATS = {
    ".binary": ("merl",),
    ".bsdf": ("rgl", "zemax"),
    ".csv": ("csv",),
    ".npz": ("npz",),
    ".dat": ("alta",),
    ".xml": ("klems", "tree"),
    ".brdf": ("speos",),
    ".anisotropicbsdf": ("speos",),
}
ENDINGS = tuple(FORMATS)
_SAMPLES = (".csv", ".npz", ".dat")
# Pairs at which a written table is compared with its source.
_PAIRS = 5000
_FAR_OFF = 0.1  # of the samples' light: from here on a fit is advised instead of an interpolation


@dataclass(frozen=True)
class ConvertResult:
    """A file that was written.

    Attributes
    ----------
    source : str
        What was converted.
    file : Path
        The new file.
    size : int
        Its bytes.
    format : str
        Its format: "merl", "rgl", "zemax", "csv", "npz", "alta", "klems", "tree" or "speos".
    notes : tuple of str
        What was lost, interpolated or repaired, in sentences.
    facts : dict
        The rest of the JSON form: samples, channels, and the error of a table against its source.
    """

    source: str
    file: Path
    size: int
    format: str
    notes: tuple[str, ...]
    facts: dict[str, Any] = field(repr=False)

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {"source": self.source, "out": str(self.file), "bytes": self.size, **self.facts}


def convert(
    source: Any,
    to: Place,
    *,
    form: str | None = None,
    undo: Sequence[str] | str = (),
    channels: str = "rgb",
    count: int = DEFAULT_COUNT,
    scheme: str = DEFAULT_SCHEME,
    calibrate: Sequence[str] | str = DEFAULT_CALIBRATE,
    seed: int = 0,
    force: bool = False,
    progress: Progress | None = None,
) -> ConvertResult:
    """Write a measurement, a model or a fit in another format, by the ending of the new file.

    Parameters
    ----------
    source : source, Fit or path
        What is converted, as for `fit`; or a fit, its folder or its .npz file.
    to : path
        The new file: .binary (MERL), .bsdf (RGL, Mitsuba's measured), .csv, .npz, .dat (ALTA), .xml (WINDOW and
        Radiance), .brdf or .anisotropicbsdf (Ansys Speos).
    form : str, optional
        Selects the format if two formats share an extension: "zemax" for .bsdf, "tree" (tensor tree) for .xml. Default:
        RGL for .bsdf, Klems bands for .xml.
    undo : str or sequence of str, optional
        Conventions to undo, as `info` names them: "cosine-o", "srgb", "elevation" and others. Not for tables.
    channels : str, optional
        "rgb", "luminance", "spectral", or one channel's name.
    count, scheme : int and str, optional
        Number of pairs of directions to draw from a model or a fit, and the sampling scheme.
    calibrate : str or sequence of str, optional
        Faults of the instrument to undo, as for `read`.
    seed : int, optional
        Seed of the drawn pairs.
    force : bool, optional
        Replace a file that is there.
    progress : callable, optional
        Called with a `ProgressStep` on the way.

    Returns
    -------
    ConvertResult
        The file, its format, and what got lost.

    Raises
    ------
    BadInput
        For a source that cannot be read, an unknown extension, a `form` that does not suit the extension, and an
        existing file without `force`.

    Examples
    --------
    >>> found = homofact.convert("material:phong-30", "phong.csv", count=100)
    >>> found.format, len(homofact.read("phong.csv").samples)
    ('csv', 100)
    """
    settings = SourceSettings(None, channels, count, scheme, as_names(calibrate))
    given = _given(source)
    target = Path(to)
    check_file(target, *ENDINGS)
    kind = _format(target, form)
    if target.exists() and not force:
        raise BadInput("exists already", where=target, expected=f"a new file or {Advice('force', True)}")

    from homofact.brdf.quality.mending import mending_lines
    from homofact.brdf.quality.suspicion.undo import names_in, undone

    names = names_in(undo if isinstance(undo, str) else ",".join(undo))
    if names and target.suffix.lower() not in _SAMPLES:
        raise BadInput(where="undo", found=f"it with {target}", expected="a file of samples (.csv, .npz or .dat)")
    steps = ProgressSteps(progress)
    steps.stage("reading")
    subject = _opened(given, settings, seed)
    read = len(subject.samples)
    subject = replace(subject, samples=undone(subject.samples, names))
    steps.stage("writing")
    target.parent.mkdir(parents=True, exist_ok=True)
    facts: dict[str, Any] = {}
    replace_file(target, lambda made: facts.update(_write(made, subject, kind, steps)), new=not force)
    if names:
        lost = read - len(subject.samples)
        facts["undone"] = list(names)
        facts["notes"].append(
            f"undone: {', '.join(names)}" + (f"; {lost} samples at the horizon left out" if lost else "")
        )
    facts["notes"] += mending_lines(subject.samples.provenance)
    size = target.stat().st_size
    return ConvertResult(subject.name, target, size, facts["format"], tuple(facts["notes"]), facts)


def _format(target: Path, form: str | None) -> str:
    """Return `form`, or the default format of the file's extension. Raises BadInput if they do not match."""
    known = FORMATS[target.suffix.lower()]
    if form is not None and form not in known:
        raise BadInput(where="form", found=f"{form!r} with {target.name}", expected=f"one of {', '.join(known)}")
    return form or known[0]


def _given(source: Any) -> Any:
    """Return a fit, or a checked source. Raises BadInput."""
    if isinstance(source, str | os.PathLike) and Path(source).is_dir():
        check_result(Path(source))
        return os.fspath(source)
    return source if _fitted(source) is not None else given_source(source)


def _fitted(source: Any) -> Any:
    """Return the fit in memory; None if the source is anything else."""
    found = getattr(source, "factorization", source)
    return found if callable(getattr(found, "with_textures", None)) else None


def _opened(source: Any, settings: SourceSettings, seed: int) -> "Source":
    """Return the opened source, or a fit as a source. Raises BadInput."""
    from homofact.exporting.as_source import as_source, fit_as_source, is_fit

    fitted = _fitted(source)
    if fitted is None and not (isinstance(source, str) and is_fit(source)):
        return open_given(replace(settings, path=source) if isinstance(source, str) else source, seed)
    if settings.channels != "rgb" or settings.calibrate != DEFAULT_CALIBRATE:
        name = "channels" if settings.channels != "rgb" else "calibrate"
        raise BadInput(where=name, found="it with a fit", expected="it with a measurement or a material")
    if fitted is None:
        return fit_as_source(source, settings.count, settings.scheme, seed)
    return as_source(fitted, "fit", settings.count, settings.scheme, seed)


def _write(target: Path, subject: "Source", kind: str, steps: ProgressSteps) -> dict[str, Any]:
    """Write the source in a format of `FORMATS`; return the facts and notes on lost data."""
    from homofact.brdf.formats import alta, csv, merl
    from homofact.brdf.source import NOISE_FREE_EPSILON

    noise_free = subject.default_epsilon == NOISE_FREE_EPSILON
    facts_of_source = subject.samples.provenance | ({"noise_free": True} if noise_free else {})
    samples = replace(subject.samples, provenance=facts_of_source)
    comments = (f"converted from {subject.name}", *samples.provenance.get("comments", ()))
    facts: dict[str, Any] = {"samples": len(samples), "channels": list(samples.channels), "notes": []}
    if kind == "merl":
        counts = merl.write(target, subject.reflectance)
        facts |= {"format": "merl", "samples": counts["written"], "channels": ["R", "G", "B"], "bins": counts}
        if not samples.isotropic:
            facts["notes"].append("an anisotropic source: the table holds the cut with h in the xz-plane")
        if not hasattr(subject.reflectance, "raw") and subject.kind == "measurement":
            facts["notes"].append("bins between and beyond the samples are interpolated")
    elif kind == "rgl":
        facts |= _write_adaptive(target, subject, comments)
    elif kind in ("klems", "tree", "zemax", "speos"):
        facts |= _write_lighting(target, subject, kind, comments, steps)
    elif kind == "csv":
        csv.write(target, samples, comments)
        facts["format"] = "csv"
    elif kind == "npz":
        from homofact.brdf.formats import npz

        header = {"comments": list(comments), "noise_free": noise_free}
        npz.write(target, samples, header)
        facts["format"] = "npz"
    else:
        alta.write(target, samples, comments=comments)
        facts["format"] = "alta"
    if kind in ("npz", "alta") and bool((samples.weights != 1).any()):
        facts["notes"].append("weights are not kept in this format")
    return facts


def _write_adaptive(target: Path, subject: "Source", comments: tuple[str, ...]) -> dict[str, Any]:
    """Write RGL's tensor file; return its facts and the differences from the source."""
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
        notes += _interpolated(subject)
    facts = {"format": "rgl", "channels": list(table.channels), "samples": table.table[..., 0].numel(), "notes": notes}
    if table is not reflectance:
        middle, most = relative_differences(reflectance, table, _PAIRS)
        facts["difference"] = {"median": middle, "quantile_99": most}
        notes.append(f"error against the source: median {middle:.2%}, 99th percentile {most:.2%}")
    return facts


def _interpolated(subject: "Source") -> list[str]:
    """Return a note on values between samples, with their light relative to the samples at measured angles."""
    from homofact.brdf.quality.faults import light_over_rings

    if subject.kind != "measurement":
        return []
    said = "between and beyond the samples values are interpolated"
    rows = light_over_rings(subject.samples, subject.reflectance)
    if not rows:
        return [said]
    off = max(rows, key=lambda row: abs(math.log(max(row[1], 1e-9))))
    said += f"; at {off[0]:g}° incidence they have {off[1]:.0%} of the light of the samples, elsewhere they are nearer"
    return [f"{said}. To be nearer, convert a fit of the samples" if abs(off[1] - 1) > _FAR_OFF else said]


def _write_lighting(
    target: Path, subject: "Source", kind: str, comments: tuple[str, ...], steps: ProgressSteps
) -> dict[str, Any]:
    """Write a lighting or optics format; return its content, lost data, and difference from the source."""
    from homofact.brdf.adaptive import relative_differences
    from homofact.brdf.formats import open_file, speos_writer, window_writer, zemax
    from homofact.brdf.tristimulus import CieY

    reflectance, isotropic, channels = subject.reflectance, subject.samples.isotropic, subject.samples.channels
    notes = []
    if kind == "klems":
        found = window_writer.write_klems(target, reflectance, isotropic, subject.name, comments, steps.part)
        count = int(found["values"])
        notes.append(f"means over 145 x 145 bands, known to {found['error']:.2%} at the 99th percentile")
    elif kind == "tree":
        found = window_writer.write_tree(target, reflectance, isotropic, subject.name, comments, steps.part)
        count = int(found["values"])
        notes.append(f"a tree of {count} values, means over its leaves")
    elif kind == "zemax":
        count = zemax.write(target, reflectance, isotropic, comments)
    elif target.suffix.lower() == ".brdf":
        count = speos_writer.write_brdf(target, reflectance, isotropic, comments)
    else:
        count = speos_writer.write_anisotropic(target, reflectance, isotropic, comments)
        if len(channels) > 1:
            notes.append("one spectrum for all directions: colours that change with direction are lost")
    if kind in ("klems", "tree"):
        notes.append("the same reflection on both sides, no transmission")
    notes += _interpolated(subject)
    facts: dict[str, Any] = {"format": kind, "samples": count, "notes": notes}
    written = open_file(f"{target}#back" if kind == "tree" else target).reflectance if kind != "klems" else None
    if written is not None:
        middle, most = relative_differences(CieY(reflectance), CieY(written), _PAIRS)
        facts["difference"] = {"median": middle, "quantile_99": most}
        notes.append(f"luminance error against the source: median {middle:.2%}, 99th percentile {most:.2%}")
    return facts
