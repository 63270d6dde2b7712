"""The figures on which a verdict is based, in groups; `measuring` computes all of them."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from homofact.evaluation.bar.reading import SampleReading


@dataclass(frozen=True)
class SystemFigures:
    """Figures of the linear system of the fit; None if the method solves no linear system.

    Attributes
    ----------
    condition : 1-norm condition number of the normal matrix.
    determined : share of texels that samples determine, not smoothing alone.
    """

    condition: float | None
    determined: float | None


@dataclass(frozen=True)
class HeldOutFigures:
    """Errors of the fit on its held-out samples.

    Attributes
    ----------
    gap : held-out log MSE divided by training log MSE; if nothing was held out, the ratio of the search's own
        validation, or 1.
    explained : share of the variance of the logs (over the discs) that the fit explains, for the worst channel. It is
        measured on new pairs of the source if the source can be evaluated, else on the held-out samples.
    misplaced : Σ|f̂ − f| over Σ f of the held-out light.
    cut : share of the held-out light at samples where the fit is clipped to zero.
    is_held_out : whether any samples were held out; if not, the figures are measured on training samples.
    """

    gap: float
    explained: float
    misplaced: float
    cut: float
    is_held_out: bool = True


@dataclass(frozen=True)
class LightFigures:
    """The reflected light of the fit, compared with that of its source or samples.

    Attributes
    ----------
    off : the ratio of the fit's light to the source's that is farthest from 1. If the source can be evaluated
        everywhere, ratios are per channel and angle of incidence; else they are per channel and band of θi or θh of the
        samples. None if there are too few samples.
    off_where : text that names the channel and angles of `off`.
    highlight : the ratio of the fit's light to the source's in the brightest part of the light.
    texels_across : half width of the source's highlight, in texels of the finest texture; None without a highlight.
    albedo, albedo_at : largest albedo ∫ f cosθo dωo of the fit over channels and angles up to 88°, and its θi in
        degrees.
    step, step_where : the ratio of the fit's albedos at neighbouring angles up to 45° that is farthest from 1, and text
        that names these angles.
    source_albedo : largest albedo of the source at angles up to 75°; None if the source cannot be evaluated.
    reciprocity : Σ|f(ωi, ωo) − f(ωo, ωi)| divided by the sum of both, weighted by light, of the fit.
    data_reciprocity : the same for the source or, for samples, between each sample and its neighbour at the swapped
        directions, minus the usual difference of neighbours. None if too few samples have such a neighbour.
    floor : relative RMS difference of f cosθi cosθo between the source and its reciprocal part; None if the source
        cannot be evaluated.
    peak, peak_fit, peak_where : the value of the brightest sample, held out or not, in sr⁻¹ (mean of the channels), the
        value of the fit there, and text that names the angles.
    by_incidence : rows (from, to, ratio of the fit's light to that of its samples), with θi in degrees; empty if the
        source can be evaluated.
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
    """Figures of the samples.

    Attributes
    ----------
    scatter : disagreement of neighbouring training samples in log units; None for too few samples.
    noise : scatter of the darkest samples relative to the mean; None for too few samples.
    outliers : share of the light by which a few outliers differ from the fit; 0 if many samples do.
    zeros, dark : share of the samples that are exactly zero in a channel, and share of the light that is missing there
        according to their neighbours.
    black : share of a white surface's light at the samples that are zero in all channels.
    gamut : share of the samples that the file reader clipped to zero in a channel because their colour is outside sRGB.
    clipped : share of the light at samples that have the largest value of their channel.
    rounded : mean rounding error as a share of a channel's light, if its values are rounded to equal steps.
    repeated : share of the light by which samples at the same directions differ from their mean.
    ring, ring_where : the step of a ring of θi or θo against its two neighbours, as a ratio that is farthest from 1
        (light of samples/fit on the ring, divided by the same ratio on the neighbours), and text that names the ring.
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
    """Figures of the measured directions and of gaps between them.

    Attributes
    ----------
    unmeasured : share of the fit's light at pairs of directions outside the measured range.
    unresolved : share of a bright sample's value that is gone at its neighbours, as the median over the brightest
        samples (`flux.between_samples`); large if the highlight falls between samples.
    rising : exponent of the rise of the values towards the mirror direction at the innermost samples (`flux.rising`); 0
        if the source can be evaluated.
    lowest, highest : range of θ of the measured directions in degrees, without the outermost 0.1% at either end; 0 and
        90 if the source can be evaluated.
    samples : the number of samples that the fit used.
    innermost : θh in degrees within which the innermost `flux.INNERMOST` samples lie; 0 if the source can be evaluated.
    contrast : mean of these samples divided by the mean of those at θh of 20 to 30°.
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
    """The figures of all groups; `reading` is None if the source can be evaluated everywhere.

    Shares of the light are weighted by the flux f cosθi cosθo of each pair of directions.
    """

    system: SystemFigures
    errors: HeldOutFigures
    light: LightFigures
    data: DataFigures
    coverage: CoverageFigures
    reading: SampleReading | None = None

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> "Figures":
        """Return the figures of a dictionary that `record` made. Raises KeyError if an entry is missing."""

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
        """Return a JSON-able dictionary of the figures of all groups, with those of `reading` under "reading"."""
        parts = (self.system, self.errors, self.light, self.data, self.coverage)
        own = {name: value for part in parts for name, value in asdict(part).items()}
        return own | {"reading": None if self.reading is None else asdict(self.reading)}
