"""Measuring: choose the directions that a goniometer should measure next, from the samples so far."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.api.places import check_file
from homofact.api.progress import Progress, ProgressSteps
from homofact.api.subjects import Place
from homofact.brdf.source_names import MATERIAL_PREFIX
from homofact.errors import Advice, BadInput
from homofact.sections import SourceSettings

if TYPE_CHECKING:
    from homofact.brdf.samples import Samples
    from homofact.measuring.completed import CompletedBrdf
    from homofact.measuring.foretelling import Foretold
    from homofact.measuring.goniometer import Goniometer

DEFAULT_DIRECTIONS = 5
COMPLETED_COUNT = 12_000
STOP = 0.01
_COLUMNS = ("theta_i_deg", "phi_i_deg", "theta_o_deg", "phi_o_deg")


@dataclass(frozen=True)
class MeasureResult:
    """What to measure next.

    Attributes
    ----------
    samples : Samples or None
        All samples so far.
    goniometer : Goniometer
        The limits, steps and times that the directions are chosen for.
    angles : list of tuple
        θi, θo and φ between them in degrees, in the order of measuring; the light is at φ = 0.
    incidences : tuple of float
        The θi that were chosen, best first; empty for single directions.
    seconds, seconds_unordered : float
        Time of the moves in seconds, in the order of `angles` and in the order in which the directions were chosen.
    foretold : Foretold
        The expected error of the estimate from the samples so far.
    remaining : float
        The share of the expected squared error that remains after these measurements.
    change, change_by_rings : float
        The expected change of rendered pictures, relative to their light: after these measurements, and after the three
        best rings.
    stop : bool
        Whether `change_by_rings` is below the limit.
    highest : float or None
        The largest θ of the samples in degrees, of light or view. Above it, the estimate follows the prior alone.
    misfit : float
        The factor by which errors are wider than usual because the material differs from those of the prior; 1 without
        samples.
    estimate : CompletedBrdf
        The material estimated from the samples and the prior. You can pass it as a source to `fit`, `render` and the
        other functions.
    files : list of Path
        What was written.
    """

    samples: "Samples | None" = field(repr=False)
    goniometer: "Goniometer"
    angles: list[tuple[float, float, float]] = field(repr=False)
    incidences: tuple[float, ...]
    seconds: float
    seconds_unordered: float
    foretold: "Foretold" = field(repr=False)
    remaining: float
    change: float
    change_by_rings: float
    stop: bool
    highest: float | None
    misfit: float
    estimate: "CompletedBrdf" = field(repr=False)
    files: list[Path]

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "samples": 0 if self.samples is None else len(self.samples),
            "angles_degrees": [list(row) for row in self.angles],
            "incidences_degrees": list(self.incidences),
            "seconds": self.seconds,
            "seconds_unordered": self.seconds_unordered,
            "foretold": self.foretold.record(),
            "remaining": self.remaining,
            "change": self.change,
            "change_by_three_rings": self.change_by_rings,
            "stop": self.stop,
            "highest_theta_degrees": self.highest,
            "misfit": self.misfit,
            "files": [str(file) for file in self.files],
        }


def measure(
    samples: Any = None,
    *,
    directions: int | None = None,
    incidences: int | None = None,
    goniometer: "Goniometer | Mapping[str, Any] | None" = None,
    to: Place | None = None,
    complete: Place | None = None,
    channels: Sequence[str] = ("R", "G", "B"),
    stop: float = STOP,
    seed: int = 0,
    force: bool = False,
    progress: Progress | None = None,
) -> MeasureResult:
    """Choose the directions to measure next, from the samples so far and a prior of materials.

    Measure these directions, add the values, and call the function again with all samples.

    Parameters
    ----------
    samples : Samples, path, or list of these, optional
        All samples so far, of an isotropic material. None for the first round.
    directions : int, optional
        How many single directions to choose; 5 unless `incidences` is given.
    incidences : int, optional
        Number of incidence angles to choose instead of single directions. Each is measured at all views of
        `Goniometer.ring`.
    goniometer : Goniometer or dict, optional
        Limits, steps and times of the goniometer; a dictionary sets some of them. Without other limits, light and
        detector reach 80°, or the largest angle of the samples if this is larger.
    to : path, optional
        A CSV for the directions, with an empty column for each channel. Fill it in and pass it to the next round.
    complete : path, optional
        A CSV file to write, with 12,000 samples of the estimated material, which you can fit with `factorize`.
    channels : sequence of str, optional
        Names of the empty columns. If there are samples, homofact uses their channels.
    stop : float, optional
        Measuring may stop if three more rings are expected to change the pictures by less than this.
    seed : int, optional
        Seed of the pairs in `complete`, and of the subset that is used if there are more than 2,000 samples.
    force : bool, optional
        Replace files that are there.
    progress : callable, optional
        Called with a `ProgressStep` on the way.

    Returns
    -------
    MeasureResult
        The directions in an order with short moves, the expected error, and whether to stop.

    Raises
    ------
    BadInput
        For files that cannot be read, samples that contradict each other, anisotropic samples, limits that leave no
        direction, and files that are there.

    References
    ----------
    Nielsen, Jensen and Ramamoorthi (2015), On optimal, minimal BRDF sampling for reflectance acquisition.

    Examples
    --------
    >>> first = homofact.measure(directions=4, to="round1.csv")
    >>> len(first.angles), first.stop
    (4, False)
    """
    if directions is not None and incidences is not None:
        raise BadInput(where="incidences", found="it beside directions", expected="one of the two")
    if directions is None and incidences is None:
        directions = DEFAULT_DIRECTIONS
    for name, value, most in (("directions", directions, 500), ("incidences", incidences, 40)):
        if value is not None and not 1 <= value <= most:
            raise BadInput(where=name, found=value, expected=f"a whole number from 1 to {most}")
    if not 0 < stop < 1:
        raise BadInput(where="stop", found=stop, expected="a share between 0 and 1")
    places = [None if place is None else Path(place) for place in (to, complete)]
    for place in places:
        if place is not None:
            check_file(place, ".csv")
            if place.exists() and not force:
                raise BadInput("exists already", where=place, expected=f"a new file or {Advice('force', True)}")

    from homofact.measuring.completed import CompletedBrdf
    from homofact.measuring.goniometer import Goniometer
    from homofact.measuring.prior import read_prior
    from homofact.measuring.rounds import check_samples, next_round, posterior_of

    steps = ProgressSteps(progress)
    steps.stage("reading")
    known = _gathered(samples)
    if known is not None:
        check_samples(known)
        channels = known.channels
    used = goniometer if isinstance(goniometer, Goniometer) else Goniometer.reaching(known, **(goniometer or {}))
    steps.stage("choosing")
    prior = read_prior()
    posterior = posterior_of(prior, known, len(channels), seed)
    found = next_round(prior, posterior, used, directions=directions or 0, incidences=incidences or 0)
    estimate = CompletedBrdf(prior.grid, posterior, tuple(channels))
    angles = [(float(one), float(two), float(three)) for one, two, three in found.angles]
    steps.stage("writing")
    if places[0] is not None:
        _write_plan(places[0], angles, channels)
    if places[1] is not None:
        _write_completed(places[1], estimate, known, seed)
    return MeasureResult(
        known, used, angles, found.incidences, found.seconds, found.seconds_unordered, found.foretold, found.remaining,
        found.change, found.change_by_rings, found.change_by_rings < stop,
        None if known is None else known.largest_angle, max(posterior.scale, 1.0) ** 0.5, estimate,
        [place for place in places if place is not None],
    )  # fmt: skip


def _gathered(samples: Any) -> "Samples | None":
    """Return all given samples concatenated. Raises BadInput if their channels differ."""
    if samples is None:
        return None
    import torch

    from homofact.api.subjects import given_source
    from homofact.brdf.samples import Samples

    several = samples if isinstance(samples, list) else [samples]
    if not several:
        return None
    opened = [each if isinstance(each, Samples) else _opened(given_source(each)) for each in several]
    first = opened[0]
    for each, given in zip(opened, several, strict=True):
        if each.channels != first.channels:
            name = given if isinstance(given, str | Path) else "samples"
            raise BadInput(
                where=name, found=f"channels {', '.join(each.channels)}", expected=f"{', '.join(first.channels)}"
            )
    if len(opened) == 1:
        return first
    parts = {name: torch.cat([getattr(each, name) for each in opened]) for name in ("wi", "wo", "values", "weights")}
    isotropic = all(each.isotropic for each in opened)
    return replace(first, **parts, isotropic=isotropic, provenance={}, clipped=None)


def _opened(given: Any) -> "Samples":
    """Return the measured samples of a source. Raises BadInput for a source that is not a measurement."""
    from homofact.brdf.formats import open_file
    from homofact.brdf.samples import Samples
    from homofact.brdf.source import Source

    if isinstance(given, Source):
        return given.samples
    if isinstance(given, tuple):
        return Samples(*given)
    if not isinstance(given, str | SourceSettings):
        raise BadInput(where="samples", found=type(given).__name__, expected="files, Samples or (wi, wo, values)")
    path, channels = (given, "rgb") if isinstance(given, str) else (str(given.path), given.channels)
    if path.startswith(MATERIAL_PREFIX):
        raise BadInput(where=path, found="a model", expected="samples of a measurement")
    reading = open_file(path, channels)
    if reading.reflectance is not None and "sampling" in reading.samples.provenance:
        raise BadInput(where=path, found="a table of all directions", expected="samples of a measurement")
    return reading.samples


def _write_plan(place: Path, angles: Sequence[tuple[float, float, float]], channels: Sequence[str]) -> None:
    from homofact.files.atomic import write_text

    task = "measure these pairs of directions in this order, and write f in sr^-1 without the cosine"
    head = f"# isotropic: true\n# {task}\n"
    empty = "," * len(channels)
    rows = [f"{theta_i:g},0,{theta_o:g},{phi:g}{empty}" for theta_i, theta_o, phi in angles]
    write_text(place, head + "\n".join([",".join([*_COLUMNS, *channels]), *rows]) + "\n")


def _write_completed(place: Path, estimate: "CompletedBrdf", known: "Samples | None", seed: int) -> None:
    from homofact.brdf.formats import csv
    from homofact.brdf.sampling import sample_model

    count = 0 if known is None else len(known)
    drawn = sample_model(estimate, COMPLETED_COUNT, "lobe", seed, noise_free=False)
    csv.write(place, drawn, (f"completed from {count} samples by a prior of materials, not measured",))
