"""Cost and error of the in-out terms, compared with a homomorphic fit of the same samples."""

import math
from dataclasses import asdict, dataclass
from typing import Any

from homofact.brdf.source import Source
from homofact.brdf.symmetry import find_symmetry
from homofact.errors import BadInput
from homofact.evaluation.compare import ComparisonRow, held_out_samples
from homofact.evaluation.metrics import measure, six_errors
from homofact.theory.in_out import DirectionGrid, decompose
from homofact.theory.terms import InOutCount

_MAP_SIDE = 32


def map_bytes(terms: int, channels: int) -> int:
    """Return the bytes of `terms` in-out terms: two maps each (g of ωi, h of ωo), 32² float32 texels per channel.

    If f is reciprocal, the two maps are equal up to sign, and half of the bytes are enough.
    """
    return terms * 2 * _MAP_SIDE**2 * channels * 4


@dataclass(frozen=True)
class SvdError:
    """`terms` in-out terms on the held-out samples: Cole error, bytes at 32², fetches, share of negative values."""

    terms: int
    error: float
    bytes: int
    fetches: int
    negative: float

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        return asdict(self)


@dataclass(frozen=True)
class TermCosts:
    """A fit and in-out terms on the same held-out samples; `samples` is the number of those within the limit.

    `fit_error` is the fit's Cole error there; `counted` are the terms that contain the share of the energy. `matching`
    is the smallest of 1, 2, 4 … terms with an error no larger than the fit's; None if not even all terms reach it.
    """

    samples: int
    fit_error: float
    counted: SvdError
    matching: SvdError | None

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        return asdict(self)


def against_fit(source: Source, row: ComparisonRow, count: InOutCount, held_out: float) -> TermCosts:
    """Compare the fit of `row` with the in-out terms of `count`.

    Every channel has its own terms, evaluated from the decomposition itself: no map's resolution adds to the error.
    The terms approximate the source's reflectance. For a measurement, this reflectance is interpolated from all
    samples, including the held-out ones. Values below 0 are clamped to 0, as in rendering. Raises BadInput where no
    held-out sample is within the limit.
    """
    reflectance = source.reflectance
    decomposition = decompose(
        reflectance, DirectionGrid(*count.grid, count.limit), find_symmetry(reflectance, count.limit)
    )
    samples = held_out_samples(source, held_out, row.settings.seed)
    least = math.cos(count.limit)
    inside = (samples.wi[:, 2] >= least) & (samples.wo[:, 2] >= least)
    if not bool(inside.any()):
        raise BadInput(
            f"no held-out sample within {math.degrees(count.limit):g} degrees", where="limit", expected="some"
        )
    samples = samples.select(inside)
    transform = row.factorization.transform
    fit_error = measure(row.factorization, samples, transform).log_mse

    def error_of(terms: int) -> SvdError:
        cut = decomposition.truncated(terms)
        values = cut.signed(samples.wi, samples.wo)
        error = six_errors(values.clamp_min(0), samples.values, transform).log_mse
        channels = len(reflectance.channels)
        return SvdError(terms, error, map_bytes(terms, channels), cut.fetches, float((values < 0).double().mean()))

    total = int(decomposition.multiplicity[0].sum())
    terms, match = 1, None
    while match is None and terms < 2 * total:
        tried = error_of(min(terms, total))
        match = tried if tried.error <= fit_error else None
        terms *= 2
    return TermCosts(len(samples), fit_error, error_of(count.measured), match)
