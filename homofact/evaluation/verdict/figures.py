"""The figures that a verdict is made of, in groups: all are measured in `measuring`."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from homofact.evaluation.bar.reading import SampleReading


@dataclass(frozen=True)
class SystemFigures:
    """The linear system that was solved; None where none was.

    Attributes
    ----------
    condition : 1-norm condition number of the normal matrix.
    determined : share of texels that samples hold rather than smoothing.
    """

    condition: float | None
    determined: float | None


@dataclass(frozen=True)
class HeldOutFigures:
    """How well the fit meets the samples that were held out of it.

    Attributes
    ----------
    gap : held-out over training log MSE; where nothing was held out, that of the search's own validation, or 1.
    explained : share of the variance of the logs, over the discs, that the fit explains, of its worst channel: of the
        source's at new pairs if it can be evaluated, else of the held-out ones.
    misplaced : Σ|f̂ − f| over Σ f of the held-out light.
    cut : share of the held-out light that is cut at zero.
    is_held_out : whether any samples were held out; if not, the figures are of samples that the fit has seen.
    """

    gap: float
    explained: float
    misplaced: float
    cut: float
    is_held_out: bool = True


@dataclass(frozen=True)
class LightFigures:
    """The light of the fit, and that of its source if this can be evaluated.

    Attributes
    ----------
    off : the fit's light over the source's, farthest from 1: of a channel at an angle of incidence if the source can be
        evaluated everywhere, else of the samples in a band of θi or θh; None if there are too few samples.
    off_where : where that is, in words.
    highlight : the same of the brightest part of the light.
    texels_across : half width of the source's highlight in texels of the finest texture; None where there is none.
    albedo, albedo_at : largest ∫ f cosθo dωo of the fit over channels and angles up to 88°; at which θi in degrees.
    step, step_where : its albedo at an angle up to 45° over that at the next, farthest from 1; which.
    source_albedo : that of the source at up to 75°, None if it cannot be evaluated.
    reciprocity : Σ|f(ωi, ωo) − f(ωo, ωi)| over the sum of both, of the fit's light.
    data_reciprocity : of the source's light, or of samples and their swapped neighbours beyond what neighbours differ
        by anyway; None where too few have one.
    floor : relative RMS of f cosθi cosθo between the source and its own reciprocal part, None if the source cannot be
        evaluated.
    peak, peak_fit, peak_where : the brightest sample of all, held out or not, in sr⁻¹ (mean of the channels), what the
        fit has there, and at which angles.
    by_incidence : (from, to, light of the fit over that of its samples) by θi in degrees; empty where the source can be
        evaluated.
    """

    off: float | None
    off_where: str
    highlight: float | None
    texels_across: float | None
    albedo: float
    albedo_at: float
    step: float
    step_where: str
    source_albedo: float | None
    reciprocity: float
    data_reciprocity: float | None
    floor: float | None
    peak: float = 0.0
    peak_fit: float = 0.0
    peak_where: str = ""
    by_incidence: tuple[tuple[float, float, float], ...] = ()


@dataclass(frozen=True)
class DataFigures:
    """The samples themselves.

    Attributes
    ----------
    scatter : disagreement of neighbouring training samples in log units, None for too few.
    noise : scatter of the darkest samples over the mean, None likewise.
    outliers : light by which a few samples stand out.
    zeros, dark : share of the samples that are exactly zero in a channel, and of the light that their neighbours
        say is missing there.
    black : share of the light of a white surface that falls where they are zero in all channels.
    gamut : share of the samples that their reader cut at zero in a channel, their colour being outside sRGB.
    clipped : share of the light at samples that share their channel's largest value.
    rounded : share of the light of a channel that rounding to equal steps misses, on average.
    repeated : light by which samples of the same directions differ from each other.
    ring, ring_where : light of a ring of θi or θo over that of its neighbours under the fit, farthest from 1; which.
    """

    scatter: float | None
    noise: float | None
    outliers: float
    zeros: float
    dark: float
    black: float
    gamut: float
    clipped: float
    rounded: float
    repeated: float
    ring: float
    ring_where: str


@dataclass(frozen=True)
class CoverageFigures:
    """What was not measured.

    Attributes
    ----------
    unmeasured : share of the fit's light at pairs of directions that lie beyond the measurement.
    unresolved : share of the brightest part of a measurement's light that stands between samples, as `flux` says.
    rising : exponent at which a measurement still rises towards the mirror direction where its samples end, as `flux`
        says; 0 if the source can be evaluated.
    lowest, highest : θ in degrees of the directions that were measured, a thousandth left out at either end; 0 and 90
        if the source can be evaluated.
    samples : how many the fit was made from.
    innermost : θh in degrees within which a handful of samples lie; 0 if the source can be evaluated.
    contrast : how much brighter these are than those at 20 to 30°.
    """

    unmeasured: float
    unresolved: float
    rising: float
    lowest: float
    highest: float
    samples: int
    innermost: float
    contrast: float


@dataclass(frozen=True)
class Figures:
    """All groups; `reading` is None if the source can be evaluated everywhere.

    "Of the light" means weighted by the flux f cosθi cosθo of each pair of directions.
    """

    system: SystemFigures
    errors: HeldOutFigures
    light: LightFigures
    data: DataFigures
    coverage: CoverageFigures
    reading: SampleReading | None = None

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> "Figures":
        """Return the figures of a record, as `record` makes it. Raises KeyError for what is none."""

        def own(group: type[Any], found: Mapping[str, Any]) -> Any:
            values = {each.name: found[each.name] for each in fields(group)}
            return group(**{name: tuple(value) if isinstance(value, list) else value for name, value in values.items()})

        reading = record["reading"]
        return cls(
            own(SystemFigures, record),
            own(HeldOutFigures, record),
            own(LightFigures, record),
            own(DataFigures, record),
            own(CoverageFigures, record),
            None if reading is None else own(SampleReading, reading),
        )

    def record(self) -> dict[str, Any]:
        """Return a JSON-able dictionary of the figures of all groups except `reading`."""
        parts = (self.system, self.errors, self.light, self.data, self.coverage)
        own = {name: value for part in parts for name, value in asdict(part).items()}
        return own | {"reading": None if self.reading is None else asdict(self.reading)}
