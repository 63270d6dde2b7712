"""The task of a searched fit: materials in logarithms, sizes, candidate kinds of textures, and the granted work."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.quality.extrapolation import Extrapolation
from homofact.brdf.samples import Samples
from homofact.errors import BadInput
from homofact.factor.search.gradient import Gradient
from homofact.factor.search.minimize import Minimizer
from homofact.factor.search.nlopt import Nlopt
from homofact.factor.search.one_at_a_time import OneAtATime
from homofact.methods.common import coarse_size, transform_of, trusted_samples
from homofact.methods.effort import units
from homofact.methods.kinds import ANISOTROPIC_CANDIDATES, ISOTROPIC_CANDIDATES, is_isotropic
from homofact.methods.known_mixes import DESCENDING, NONE, known_mixes
from homofact.methods.materials import Materials
from homofact.methods.memory import refuse_too_large
from homofact.methods.search import Search
from homofact.methods.search_data import FOLDS, SearchData
from homofact.methods.shapes import SmoothingFor, texels_in
from homofact.methods.trials import StructureSettings


def search_named(name: str) -> Minimizer:
    """Return the optimizer of the projections by name: "gradient", "powell", or "nlopt-" and nlopt's algorithm."""
    if name == "gradient":
        return Gradient()
    if name == "powell":
        return OneAtATime()
    if name.startswith("nlopt-"):
        return Nlopt(name.removeprefix("nlopt-"))
    raise BadInput(where="search", found=repr(name), expected="gradient, powell, or nlopt-NAME such as nlopt-PRAXIS")


def candidates_of(isotropic: bool, settings: Search) -> tuple[tuple[str, ...], ...]:
    """Return the candidate kinds: all that suit the material, or those in `projections` (one, or one per texture)."""
    if settings.projections is None:
        return (ISOTROPIC_CANDIDATES if isotropic else ANISOTROPIC_CANDIDATES,)
    return tuple((kind,) for kind in settings.projections)


@dataclass(frozen=True)
class TextureSizes:
    """Texels per side of a texture, and of a texture in the search; `texels` of all textures if bytes are given."""

    side: int
    coarse: int
    texels: int | None

    @classmethod
    def of(cls, settings: Search, channels: int) -> "TextureSizes":
        """Return the sizes that settings ask for. Raises BadInput for too few bytes."""
        if settings.bytes is None:
            return cls(settings.size, coarse_size(settings), None)
        texels = texels_in(settings.bytes, channels)
        coarse = min(settings.search_size or texels, max(2, math.isqrt(texels // 2)))
        return cls(max(2, math.isqrt(texels // settings.most_textures)), coarse, texels)


@dataclass(frozen=True)
class FittedMaterial:
    """One material: its samples as given, their share of outliers, and the data made of the other samples."""

    given: Samples
    outliers: float
    transform: LogTransform
    extrapolation: Extrapolation
    data: SearchData


@dataclass(frozen=True)
class SearchTask:
    """The materials to fit, the sizes and kinds of textures, the granted work, and the deadline."""

    settings: Search
    materials: tuple[FittedMaterial, ...]
    sizes: TextureSizes
    candidates: tuple[tuple[str, ...], ...]
    granted: float
    deadline: float

    @classmethod
    def of(cls, several: Sequence[Samples], settings: Search, began: float) -> "SearchTask":
        """Return the task of fitting these materials, started at `began`. Raises BadInput as `fit_shared`."""
        _check_samples(several, settings)
        sizes = TextureSizes.of(settings, len(several[0].channels))
        candidates = candidates_of(all(samples.isotropic for samples in several), settings)
        materials = _prepared(several, settings, sizes, candidates)
        granted = len(several) * units(settings.effort, settings.most_textures)
        deadline = math.inf if settings.budget is None else began + settings.budget
        return cls(settings, materials, sizes, candidates, granted, deadline)

    @cached_property
    def full(self) -> Materials:
        """All samples of all materials."""
        return Materials(tuple(material.data.material for material in self.materials))

    @property
    def drawn(self) -> Materials:
        """The samples that the search uses."""
        return self.full.drawn(self.settings.search_samples, self.settings.seed)

    @property
    def structure(self) -> StructureSettings:
        """The settings of the search over mixes."""
        settings = self.settings
        descending = DESCENDING.get(str(settings.effort), 0)
        return StructureSettings(
            self.sizes.coarse,
            settings.reciprocal,
            settings.bound,
            settings.restarts,
            search_named(settings.search),
            settings.smoothing,
            settings.seed,
            known_mixes() if descending else NONE,
            descending,
            settings.bytes is not None,
        )

    @property
    def smoothing_for(self) -> SmoothingFor:
        """The conversion of the search's λ to other texture sizes; with more samples, λ is smaller."""
        drawn = len(self.materials) * self.settings.search_samples
        fewer = min(1.0, drawn / self.full.samples) if drawn > 0 else 1.0
        return SmoothingFor(self.sizes.coarse, fewer, self.settings.smoothing)


def _check_samples(several: Sequence[Samples], settings: Search) -> None:
    """Raise BadInput for materials of different channels, too few samples, or a spectral basis of several materials."""
    channels = several[0].channels
    if len(several) > 1 and settings.spectral_tolerance is not None:
        raise BadInput(where="spectral_tolerance", found=f"it for {len(several)} materials", expected="one material")
    for number, samples in enumerate(several):
        if samples.channels != channels:
            own, expected = ", ".join(samples.channels), ", ".join(channels)
            raise BadInput(
                where=f"material {number}", found=f"the channels {own}", expected=f"{expected} as material 0 has"
            )
        if len(samples) < 2 * FOLDS:
            raise BadInput(where="samples", found=len(samples), expected=f"at least {2 * FOLDS} for a searched fit")


def _prepared(
    several: Sequence[Samples], settings: Search, sizes: TextureSizes, candidates: tuple[tuple[str, ...], ...]
) -> tuple[FittedMaterial, ...]:
    """Return the materials' logarithms without outliers. Raises BadInput if the fit exceeds the memory."""
    trusted = [trusted_samples(samples, settings) for samples in several]
    textures = settings.most_textures
    searched = max(textures * sizes.coarse**2, len(candidates[0]) * (sizes.coarse // 2) ** 2)
    # A reciprocal texture has two lookups; a search holds the equations of every material.
    lookups = 2 * textures * sum(len(samples) for samples, _ in trusted)
    shapes = ((sizes.side, sizes.side),) * textures
    refuse_too_large(settings, shapes, lookups, searched * math.isqrt(len(several)))
    knows_azimuth = not all(is_isotropic(kind) for kinds in candidates for kind in kinds)
    materials = []
    for given, (samples, outliers) in zip(several, trusted, strict=True):
        transform, extrapolation = transform_of(samples, settings), Extrapolation(samples)
        data = SearchData.of(samples, transform, settings, knows_azimuth).with_more(
            extrapolation.carried_on(), transform
        )
        materials.append(FittedMaterial(given, outliers, transform, extrapolation, data))
    return tuple(materials)
