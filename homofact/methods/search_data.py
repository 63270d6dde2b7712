"""The data of one material for a searched fit: its log samples, their flux, and the folds for validation."""

from dataclasses import dataclass, replace
from functools import cached_property

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.samples import Samples
from homofact.factor.energy import Flux
from homofact.factor.textures import LogSamples
from homofact.methods.common import at_azimuths
from homofact.methods.materials import TrainingMaterial
from homofact.methods.search import Search
from homofact.methods.validation import BEYOND, Partition, partitions_of

FOLDS = 4


@dataclass(frozen=True)
class SearchData:
    """The data of a fit: log samples with their own weights, their flux (None if only logs are fitted), and folds.

    Copies of one measurement are in one fold. Extrapolated samples beyond the measurement come last, have no flux and
    are never left out.
    """

    logs: LogSamples
    flux: Flux | None
    partitions: tuple[Partition, ...]

    @classmethod
    def of(cls, samples: Samples, transform: LogTransform, settings: Search, knows_azimuth: bool) -> "SearchData":
        """Return the data of `samples`, with azimuth copies where kinds need them."""
        partitions = partitions_of(samples, FOLDS, settings.seed, rings=settings.validation == "rings")
        copied = at_azimuths(samples, settings, knows_azimuth)
        times = len(copied) // len(samples)
        flux = None if settings.objective == "log" else Flux.of(copied, transform, settings.objective)
        logs = LogSamples.of(copied, transform)
        if flux is not None:
            # The log squares beside the flux are those of the pairs as drawn: lobes and discs alike.
            logs = replace(logs, weights=copied.weights)
        return cls(logs, flux, tuple(partition.repeated(times) for partition in partitions))

    def with_more(self, more: Samples | None, transform: LogTransform) -> "SearchData":
        """Return the data with extrapolated samples added."""
        if more is None:
            return self
        flux = None if self.flux is None else self.flux.with_none(len(more))
        partitions = tuple(partition.with_more(len(more)) for partition in self.partitions)
        return SearchData(self.logs.with_more(LogSamples.of(more, transform)), flux, partitions)

    @cached_property
    def judged(self) -> LogSamples:
        """Return the log samples with the weights that approximate the objective near the data."""
        return self.logs if self.flux is None else replace(self.logs, weights=self.flux.weights_of(self.logs))

    @property
    def material(self) -> TrainingMaterial:
        """The data for trying mixes."""
        return TrainingMaterial(self.judged, self.partitions)

    @property
    def measured(self) -> LogSamples:
        """The log samples without extrapolated ones."""
        return self.logs.select((self.partitions[0].folds != BEYOND).nonzero()[:, 0])
