"""Describing: the contents of a file or folder, the properties of a source, or the command that reads a TOML file."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.api.fit_facts import fit_facts
from homofact.api.places import check_file
from homofact.api.plan_facts import plan_facts
from homofact.api.progress import Progress, ProgressSteps
from homofact.api.scene_facts import scene_facts
from homofact.api.subjects import Place, given_source, open_given
from homofact.api.toml_facts import toml_facts
from homofact.brdf.source_names import DISMISSED
from homofact.errors import BadInput
from homofact.evaluation.wording import figure
from homofact.sections import SourceSettings

if TYPE_CHECKING:
    from homofact.brdf.quality.suspicion.check import Suspicion
    from homofact.brdf.source import Source

# An offset, a gamma and a factor of π keep every symmetry that the checks rest on (docs/verdict.md).
WHITE_STANDARD = (
    "Does a white standard, measured in the same way, give 1/π = 0.318 sr⁻¹ in all channels? No check can find a factor"
    " (often π), an offset or a gamma in the values."
)

_NO_TILT = "a tilt of the sample was not looked for: the material is anisotropic"
# Of the spread along the normal: less is noise, and not told.
_LEAST_SPREAD = 0.15


@dataclass(frozen=True)
class InfoResult:
    """The description of a source, a fit or a scene.

    Attributes
    ----------
    name : str
        Its name.
    kind : str
        "material", "measurement" or "drawn"; "fit"; "plan", "relit scene" or "prepared scene"; of a TOML file "a
        sweep", "a configuration", or "a scene for planning", "relighting" or "editing".
    facts : dict
        The JSON form.
    rows : dict
        The same facts in readable form: names and values.
    mended : tuple of str
        How the data were repaired, and what was looked for and not found, in sentences.
    suspected : tuple of Suspicion
        Units and conventions that the data seem to violate.
    asked : tuple of str
        Questions that only the person who measured can answer; none where the source was not measured.
    """

    name: str
    kind: str
    facts: dict[str, Any] = field(repr=False)
    rows: dict[str, Any] = field(repr=False)
    mended: tuple[str, ...] = ()
    suspected: "tuple[Suspicion, ...]" = field(default=(), repr=False)
    asked: tuple[str, ...] = ()

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        return self.facts

    def __str__(self) -> str:
        """Return the rows in lines, with the remarks and suspicions below them."""
        lines = [
            f"{name.replace('_', ' ')}: {_in_a_line(value)}" for name, value in self.rows.items() if value is not None
        ]
        return "\n".join([self.name, *lines, *self.mended, *(each.line() for each in self.suspected), *self.asked])


def _in_a_line(value: Any) -> str:
    """Return a value of a row as text, with the parts of a dictionary or list one after the other."""
    if isinstance(value, dict):
        return "; ".join(f"{name.replace('_', ' ')} {_in_a_line(own)}" for name, own in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(_in_a_line, value))
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def info(source: Any, *, plot: Place | None = None, seed: int = 0, progress: Progress | None = None) -> InfoResult:
    """Describe a measurement file, a source, a saved fit, or the folder of a scene.

    Parameters
    ----------
    source : source or path
        A source, as for `fit`. Or a saved fit, a result folder or an export, which is described with error bars by
        angle. Or a folder that `plan`, `relight` or `edit` wrote. Or a TOML file (configuration, sweep or scene); the
        result then names the command that reads it.
    plot : path, optional
        A .png to draw: a slice, lobes and a lit sphere.
    seed : int, optional
        Seed of a model's samples.
    progress : callable, optional
        Called with a `ProgressStep` on the way.

    Returns
    -------
    InfoResult
        The kind and the facts, and suspicions about units and conventions.

    Raises
    ------
    BadInput
        For what cannot be read, and a picture that cannot be written.

    Examples
    --------
    >>> found = homofact.info("material:phong-30")
    >>> found.kind, found.facts["channels"]
    ('material', ['R', 'G', 'B'])
    """
    place = source.path if isinstance(source, SourceSettings) else source
    found = None
    if isinstance(place, str | os.PathLike):
        readers = (scene_facts, plan_facts, toml_facts, fit_facts)
        found = next((each for each in (read(Path(place)) for read in readers) if each is not None), None)
    if found is not None:
        title, rows, facts = found
        if plot is not None:
            raise BadInput(f"{place} is no source ({rows['kind']})", where="plot", expected="none")
        return InfoResult(title, str(rows["kind"]), facts, rows)
    given = given_source(source)
    picture = None if plot is None else Path(plot)
    if picture is not None:
        check_file(picture, ".png")

    from homofact.brdf.pair_density import scheme_of
    from homofact.brdf.quality.mending import mending_lines
    from homofact.brdf.quality.suspicion.suspects import suspicions
    from homofact.brdf.source import describe, with_tilt_looked_at

    steps = ProgressSteps(progress)
    steps.stage("reading")
    subject = open_given(given, seed)
    if subject.kind == "measurement":
        steps.stage("looking for a tilt of the sample")
        subject = with_tilt_looked_at(subject)
    facts = describe(subject)
    suspected: list[Suspicion] = []
    asked: tuple[str, ...] = ()
    # Of pairs that were drawn of a table the checks know nothing: they look for rings and steps of an instrument.
    if scheme_of(subject.samples) is None:
        steps.stage("checking units and conventions")
        suspected = list(suspicions(subject.samples))
        facts["suspected"] = [suspicion.record() for suspicion in suspected]
        asked = (WHITE_STANDARD,)
    if picture is not None:
        steps.stage("drawing")
        facts |= _draw(picture, subject)
    # A model's name and parameters read better as rows of their own.
    apart = ("material", "suspected", "gains", "clipped", "tilt", DISMISSED)
    rows = {name: value for name, value in facts.items() if name not in apart} | (facts.get("material") or {})
    rows["faults"] = _faults_in_words(facts["faults"])
    rows["spread_degrees"] = {"quantiles": "5%, 50%, 95%"} | facts["spread_degrees"]
    if subject.kind == "drawn":
        rows["kind"] = "table or network; homofact draws the samples from it"
    mended = mending_lines(subject.samples.provenance, looked_for=True)
    if subject.kind == "measurement" and not subject.samples.isotropic and "tilt" not in subject.samples.provenance:
        mended.append(_NO_TILT)
    return InfoResult(subject.name, subject.kind, facts, rows, tuple(mended), tuple(suspected), asked)


def _faults_in_words(faults: dict[str, Any]) -> dict[str, Any]:
    """Return the faults of a source, with albedo, holes, spread and reciprocity error in words."""
    holes = faults["holes"]
    found = {
        "reciprocity_error": _reciprocity_in_words(faults["reciprocity_error"]),
        "spread_along_the_normal": _spread_in_words(faults["spread_along_the_normal"]),
        "albedo_by_degrees": ", ".join(f"{value:.4g} at {at}°" for at, value in faults["albedo_by_degrees"].items())
        + " (largest channel)",
        "scatter": f"{faults['scatter']:.1%} between neighbouring samples: noise, and how much the BRDF curves there"
        if "scatter" in faults
        else "",
        "holes": f"{holes['empty']} of {holes['cells']} cells of 15° × 15° × 30° ({holes['share']:.0%})",
    }
    names = {
        "albedo_by_degrees": "albedo",
        "energy_above_one": "albedo_above_1",
        "spread_along_the_normal": "along_the_normal",
    }
    words = {names.get(name, name): found.get(name, value) for name, value in faults.items()}
    return {name: value for name, value in words.items() if value != ""}


def _spread_in_words(spread: float | None) -> str:
    """Return in words how samples along the normal contradict isotropy; "" if they do not."""
    if spread is None or spread < _LEAST_SPREAD:
        return ""
    return (
        f"values differ by {spread:.0%} with the azimuth of the other direction, on which those of an isotropic"
        " material do not depend: average them, or state that the material is anisotropic"
    )


def _reciprocity_in_words(error: dict[str, float] | None) -> str:
    """Return in words the difference of values when light and view are exchanged."""
    if error is None:
        return "not measured: fewer than ten pairs of samples with light and view exchanged"
    pairs = f" of {int(error['pairs'])} pairs of samples" if "pairs" in error else ""
    median, most = (figure(100 * error[name]) for name in ("median", "p95"))
    return f"{median}% in the median{pairs}, 95% within {most}%"


def _draw(picture: Path, subject: "Source") -> dict[str, Any]:
    """Draw the picture; return its file, exposure and share of clipped pixels."""
    from homofact.brdf.channels import display_of
    from homofact.figures.info_picture import info_picture

    picture.parent.mkdir(parents=True, exist_ok=True)
    report = info_picture(
        picture,
        subject.name,
        subject.reflectance,
        measured=subject.samples if subject.kind == "measurement" else None,
        to_rgb=display_of(subject.samples.channels),
    )
    return {"plot": {"file": str(picture), "exposure": report.exposure, "clipped": report.clipped}}
