"""Estimate the time that is left: before the first part, and from the finished parts on this machine after each.

The model gives the seconds of a fit on one thread of an AMD EPYC processor at 3 GHz. The ratio of measured to modelled
seconds of finished parts accounts for another machine or for unusual settings. The estimate multiplies the modelled
seconds of the remaining parts by this ratio. It is a range: without a finished part of a kind, its parts may take half
or twice the expected time. The range narrows with every finished part.
"""

import math
import time
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

from homofact.evaluation.time_left import BESIDE, TimeLeft, between, spread
from homofact.evaluation.wording import counted
from homofact.linear.size import is_dense
from homofact.methods.cole import Cole
from homofact.methods.effort import units
from homofact.methods.mccool import McCool
from homofact.methods.method import Method
from homofact.methods.models import MODELS, Ggx, Nbrdf
from homofact.methods.search import Search

if TYPE_CHECKING:
    from homofact.brdf.source import Source

# Seconds of the parts of a fit, measured on the blue paint.
_SAMPLE_SOLVED = 3e-6  # a sample and texture in a solve
_CUBE, _TEXEL = 4e-11, 6e-4  # unknowns³ of a dense solve, an unknown of a sparse one
_SAMPLE_MEASURED = 7e-6  # a sample in errors and verdict
_ALWAYS = 0.7  # the verdict's own pictures of the fit
_POWELL = 140  # evaluations of Powell's method for a restart of a term
_EVALUATION, _SAMPLE_EVALUATED = 5e-4, 2.9e-7  # of an inner problem, for each term solved together

_UNIT = 7e-3  # of `methods.effort`
_KNOWN = {"quick": 0.3, "normal": 0.37}  # of a search among known mixes of one texture
_STEP = 7e-4  # of a network's training
_LOBE, _MODEL, _SAMPLE_MODELLED = 2.5e-5, 1.0, 1e-4  # a sample and lobe of GGX; any other model, and a sample of it


def fit_seconds(settings: Method, samples: int, known_terms: int = 0) -> float:
    """Return the modelled seconds of a fit to `samples` samples (with azimuth copies), including errors and verdict.

    `known_terms` is the number of textures of a Cole fit whose search an earlier fit has already done
    (`methods.cole_search`).
    """
    size, textures = settings.size, settings.most_textures
    if isinstance(settings, Search) and settings.bytes is not None:
        size = math.isqrt(max(settings.bytes // (12 * textures), 1))
    after = verdict_seconds(samples)
    if isinstance(settings, Nbrdf):
        return after + _STEP * settings.steps
    if isinstance(settings, Ggx):
        return after + _LOBE * settings.lobes * samples
    if isinstance(settings, MODELS):
        return after + _MODEL + _SAMPLE_MODELLED * samples
    if settings.name == "svd":
        return after + 0.9 * (size / 16) ** 3.3
    if settings.name == "nmf":
        return after + 2.8 * (size / 16) ** 4
    unknowns = textures * size**2
    solve = _SAMPLE_SOLVED * samples * textures
    solve += _CUBE * unknowns**3 if is_dense(unknowns) else _TEXEL * unknowns
    if isinstance(settings, Search):
        if settings.effort in _KNOWN and settings.projections is None:
            searched = _KNOWN[str(settings.effort)] * textures**1.2
        else:
            # Its own count of work is in units of one inner evaluation; refining takes about a quarter as much again.
            searched = 1.25 * units(settings.effort, textures) * _UNIT
        return after + solve + _guarded(searched, settings)
    if isinstance(settings, Cole):
        searched = min(samples, settings.search_samples or samples)
        joint = settings.joint_terms or textures
        solved = sum(min(term, joint) for term in range(known_terms + 1, textures + 1))
        seconds = _POWELL * settings.restarts * solved * (_EVALUATION + _SAMPLE_EVALUATED * searched)
        return after + solve + _guarded(seconds, settings)
    return after + solve


def _guarded(seconds: float, settings: Search | Cole) -> float:
    """Seconds of a search, no more than its guard lets it take."""
    return seconds if settings.budget is None else min(seconds, settings.budget)


def training_count(source: "Source", settings: Method, held_out: float, subset: int = 0) -> int:
    """Return the number of samples in the solve of a fit, including its azimuth copies.

    Raises BadInput if there are too few samples to hold some out, and if the fit needs more than the machine's memory,
    so that these errors come before any estimate.
    """
    total = len(source.samples)
    if held_out > 0 and round(held_out * total) in (0, total):
        source.samples.split(held_out, settings.seed)
    _refuse_too_large(source, settings, _fitted_samples(source, held_out, subset))
    return solved_samples(source, settings, held_out, subset)


def _fitted_samples(source: "Source", held_out: float, subset: int) -> int:
    """Return the number of samples that a fit gets, without azimuth copies."""
    count = len(source.samples) - round(held_out * len(source.samples))
    return min(count, subset) if subset > 0 else count


def solved_samples(source: "Source", settings: Method, held_out: float, subset: int = 0) -> int:
    """Return the number of samples as `training_count`, without its checks."""
    count = _fitted_samples(source, held_out, subset)
    copies = settings.copies
    if source.samples.isotropic and not source.samples.all_azimuths and copies > 1:
        return count * copies * (2 if getattr(settings, "mirrored", False) else 1)
    return count


def _refuse_too_large(source: "Source", settings: Method, count: int) -> None:
    """Raise BadInput for textures that never fit into memory, before anything is estimated.

    The memory is a lower bound, with one lookup per texture and no azimuth copies. The fit itself checks the rest.
    """
    if not isinstance(settings, Search | Cole | McCool):
        return
    from homofact.factor.projection import fixed_projection
    from homofact.factor.textures import texture_shape
    from homofact.methods.memory import refuse_too_large
    from homofact.methods.search_task import TextureSizes

    textures, side = settings.most_textures, settings.size
    if isinstance(settings, Search):
        side = TextureSizes.of(settings, len(source.samples.channels)).side
    shapes = ((side, side),) * textures
    if isinstance(settings, McCool):
        shapes = tuple(
            texture_shape(fixed_projection(name, settings.reciprocal), side) for name in settings.projections
        )
    refuse_too_large(settings, shapes, textures * count)


def verdict_seconds(samples: int, first: bool = False) -> float:
    """Modelled seconds of the errors and the verdict of a fit, measured on so many samples.

    The `first` verdict on a source also renders the source.
    """
    return (2 if first else 1) * _ALWAYS + _SAMPLE_MEASURED * samples


class TimeEstimate:
    """The estimated time of a list of parts; `jobs` has (kind, modelled seconds) per part, in the order of the runs."""

    def __init__(self, jobs: Sequence[tuple[str, float]] = ()) -> None:
        """Nothing is finished yet."""
        self._jobs = list(jobs)
        self._measured: dict[int, float] = {}
        self._skipped: set[int] = set()
        self._running: tuple[int, float] | None = None

    def add(self, kind: str, seconds: float) -> int:
        """Add a part and return its index."""
        self._jobs.append((kind, seconds))
        return len(self._jobs) - 1

    def begin(self, place: int | None = None) -> None:
        """End the part that runs, and begin the one with index `place`, or else the next one."""
        self.end()
        following = self._rest()[:1] if place is None else [place]
        self._running = (following[0], time.monotonic()) if following else None

    def end(self) -> None:
        """Record that the part that runs is finished, if one runs."""
        if self._running is not None:
            place, begun = self._running
            self.finish(place, time.monotonic() - begun)
            self._running = None

    def skip(self, place: int) -> None:
        """Record that the part with index `place` will not run."""
        self._skipped.add(place)

    def finish(self, place: int, seconds: float) -> None:
        """Record that the part with index `place` took `seconds`, in this run or an earlier one."""
        self._measured[place] = seconds

    @property
    def done(self) -> int:
        """How many parts are done."""
        return len(self._measured)

    @property
    def left(self) -> int:
        """How many parts are still to do."""
        return len(self._rest())

    @property
    def seconds_left(self) -> float:
        """The expected seconds of the parts that are still to do."""
        return self.time_left().seconds

    def time_left(self, further: Sequence[tuple[str, float, float, float]] = (), workers: int = 1) -> TimeLeft:
        """Return the time of the parts that are still to do, by so many workers at once.

        `further` has (kind, expected, least and most modelled seconds) of parts whose number is not known yet. The
        next parts to do are those that run now.
        """
        rest = [self._jobs[place] for place in self._rest()]
        workers = max(min(workers, len(rest)), 1)
        ranges = [self._range(kind, *(seconds,) * 3) for kind, seconds in rest]
        ranges += [self._range(*one) for one in further]
        expected, least, most = (sum(each) for each in zip(*ranges, strict=True)) if ranges else (0.0, 0.0, 0.0)
        if workers > 1:
            # The other workers may be about to finish, or have just begun, the longest part.
            _, longest_least, longest_most = map(max, zip(*ranges, strict=True))
            least = max(least - (workers - 1) * longest_least, 0.0)
            most += (workers - 1) * longest_most
        running = max(own for _, _, own in ranges[:workers]) if rest else 0.0
        known = BESIDE + sum(self._measured[place] for place in self._of({kind for kind, _ in rest[:1]}))
        passed = 0.0 if self._running is None else time.monotonic() - self._running[1]
        left = TimeLeft(expected / workers, least / workers, most / workers, running, known, whole=True)
        return left.after(passed)

    def words(self) -> str:
        """Return the remaining work as text: "27 fits, about 1 to 4 min"."""
        return ", ".join(filter(None, (counted(self.left, "fit"), between(*self.time_left().now))))

    def _rest(self) -> list[int]:
        return [place for place in range(len(self._jobs)) if place not in self._measured and place not in self._skipped]

    def _range(self, kind: str, expected: float, least: float, most: float) -> tuple[float, float, float]:
        """Seconds on this machine: by the finished parts of the same kind, or else by all of them, within ×3."""
        own = self._of({kind})
        factor = self._ratio(own) if own else min(max(self._ratio(self._measured), 1 / 3), 3.0)
        wide = spread(len(own))
        return factor * expected, factor * least / wide, factor * most * wide

    def _of(self, kinds: Collection[str]) -> list[int]:
        """The finished parts of some kinds."""
        return [place for place in self._measured if self._jobs[place][0] in kinds]

    def _ratio(self, places: Collection[int]) -> float:
        """Seconds measured over those modelled."""
        modelled = sum(self._jobs[place][1] for place in places)
        return (sum(self._measured[place] for place in places) + BESIDE) / (modelled + BESIDE)
