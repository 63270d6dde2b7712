"""Estimate the time that is left: before the first part, and from the finished parts on this machine after each.

The model gives the seconds of a fit on one thread of an AMD EPYC processor at 3 GHz. The ratio of measured to modelled
seconds of finished parts accounts for another machine or for unusual settings. The estimate multiplies the modelled
seconds of the remaining parts by this ratio. It is a range: without a finished part of a kind, its parts may take half
or twice the expected time. The range narrows with every finished part, and words name one number only if it is within
a factor of 2.
"""

import math
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

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
_ALWAYS = 0.3  # the verdict's own pictures of the fit
_POWELL = 140  # evaluations of Powell's method for a restart of a term
_EVALUATION, _SAMPLE_EVALUATED = 5e-4, 2.9e-7  # of an inner problem, for each term solved together

_UNIT = 7e-3  # of `methods.effort`
_KNOWN = {"quick": 0.3, "normal": 0.37}  # of a search among known mixes of one texture
_STEP = 7e-4  # of a network's training
_LOBE, _MODEL, _SAMPLE_MODELLED = 2.5e-5, 1.0, 1e-4  # a sample and lobe of GGX; any other model, and a sample of it

# Seconds that the model counts beside those measured, so that a first part, which also loads libraries, tells little.
_BESIDE = 1.0
# A single number is within this factor of both ends of the range together; a range is named up to this factor.
_CERTAIN, _WIDE = 2.0, 6.0


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
    if isinstance(settings, MODELS):
        return after + _MODEL
    if settings.name == "svd":
        return after + 0.9 * (size / 16) ** 3.3
    if settings.name == "nmf":
        return after + 2.8 * (size / 16) ** 4
    solve = _SAMPLE_SOLVED * samples * textures + _CUBE * (textures * size**2) ** 3
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


def training_count(source: Source, settings: Method, held_out: float, subset: int = 0) -> int:
    """Return the number of samples in the solve of a fit, including its azimuth copies.

    Raises BadInput if there are too few samples to hold some out, so that this error comes before any estimate.
    """
    total = len(source.samples)
    held = round(held_out * total)
    if held_out > 0 and held in (0, total):
        source.samples.split(held_out, settings.seed)
    count = total - held
    count = min(count, subset) if subset > 0 else count
    copies = settings.copies
    if source.samples.isotropic and not source.samples.all_azimuths and copies > 1:
        return count * copies * (2 if getattr(settings, "mirrored", False) else 1)
    return count


def verdict_seconds(samples: int) -> float:
    """Modelled seconds of the errors and the verdict of a fit, measured on so many samples."""
    return _ALWAYS + _SAMPLE_MEASURED * samples


class TimeEstimate:
    """The estimated time of a list of fits; `jobs` has (method, modelled seconds) per fit, in the order of the runs."""

    def __init__(self, jobs: Sequence[tuple[str, float]]) -> None:
        """Nothing is finished yet."""
        self._jobs = list(jobs)
        self._measured: dict[int, float] = {}
        self._skipped: set[int] = set()

    def skip(self, place: int) -> None:
        """Record that the fit with index `place` will not run."""
        self._skipped.add(place)

    def finish(self, place: int, seconds: float) -> None:
        """Record that the fit with index `place` took `seconds`, in this run or an earlier one."""
        self._measured[place] = seconds

    def finish_first(self, count: int, seconds: float) -> None:
        """Record that the first `count` fits took `seconds` in total, which are divided in proportion to the model."""
        scale = seconds / max(sum(modelled for _, modelled in self._jobs[:count]), 1e-9)
        self._measured |= {place: scale * self._jobs[place][1] for place in range(count)}

    @property
    def done(self) -> int:
        """How many fits are done."""
        return len(self._measured)

    @property
    def left(self) -> int:
        """How many fits are still to do."""
        return len(self._jobs) - len(self._measured.keys() | self._skipped)

    @property
    def seconds_left(self) -> float:
        """Seconds of the fits that are still to do."""
        return sum(
            seconds * self._factor(name)
            for place, (name, seconds) in enumerate(self._jobs)
            if place not in self._measured and place not in self._skipped
        )

    def words(self) -> str:
        """Return the remaining work as text: "27 fits, about 4 min"."""
        return f"{self.left} fit{'' if self.left == 1 else 's'}, {about(self.seconds_left)}"

    def _factor(self, name: str) -> float:
        """Seconds measured over those modelled: of the method's own fits; where it has none yet of all, within ×2."""
        own = self._ratio({name})
        return own if own is not None else min(max(self._ratio({method for method, _ in self._jobs}) or 1.0, 0.5), 2.0)

    def _ratio(self, names: Collection[str]) -> float | None:
        done = [place for place in self._measured if self._jobs[place][0] in names]
        modelled = sum(self._jobs[place][1] for place in done)
        return sum(self._measured[place] for place in done) / modelled if modelled > 0 else None


def about(seconds: float) -> str:
    """Return an approximate time as text: "about 40 s", "about 4 min", "about 2.5 h"."""
    if seconds < 10:
        return "under 10 s"
    if seconds < 90:
        return f"about {10 * math.ceil(seconds / 10)} s"
    if seconds < 90 * 60:
        return f"about {math.ceil(seconds / 60)} min"
    return f"about {seconds / 3600:.1f} h"
