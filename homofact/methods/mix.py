"""A mix: which kinds of textures, their projections, λs and validation error."""

import math
from dataclasses import dataclass, replace

from homofact.factor.projection import Projection, Warp
from homofact.methods.kinds import is_searched, loosened

FIRST_SMOOTHING = 1e-3


@dataclass(frozen=True)
class Mix:
    """Chosen projections with their kinds, the λ of every texture, and their validation error."""

    kinds: tuple[str, ...]
    projections: tuple[Projection, ...]
    smoothing: tuple[float, ...]
    error: float = math.inf

    @property
    def warp(self) -> Warp | None:
        """The stretch of the half vector that its textures share."""
        return next((p.warp for p in self.projections if p.warp is not None), None)

    def with_one_more(self, kind: str, projection: Projection) -> "Mix":
        """Return the mix with one more texture, its λ that of the last one; not judged yet."""
        last = self.smoothing[-1] if self.smoothing else FIRST_SMOOTHING
        return Mix((*self.kinds, kind), (*self.projections, projection), (*self.smoothing, last))

    def without(self, place: int) -> "Mix":
        """Return the mix without one texture; not judged yet."""

        def rest(values: tuple) -> tuple:
            return (*values[:place], *values[place + 1 :])

        return Mix(rest(self.kinds), rest(self.projections), rest(self.smoothing))


EMPTY = Mix((), (), ())


def is_movable(mix: Mix) -> bool:
    """Return whether some projection of the mix has a rotation to search."""
    return any(projection.rotation is not None for projection in mix.projections)


def freed(mix: Mix) -> Mix:
    """Return the mix with projections that need not be reciprocal; its `error` is still that of the old mix."""
    return replace(mix, projections=tuple(replace(projection, reciprocal=False) for projection in mix.projections))


def with_all_loose(mix: Mix) -> Mix | None:
    """Return the mix with its fixed projections as searched ones at the same place; None if none can be searched."""
    kinds, projections = [], []
    for kind, projection in zip(mix.kinds, mix.projections, strict=True):
        loose = None if is_searched(kind) else loosened(projection)
        kinds.append(kind if loose is None else loose.coordinates)
        projections.append(projection if loose is None else loose)
    loosened_mix = Mix(tuple(kinds), tuple(projections), mix.smoothing)
    return loosened_mix if loosened_mix.kinds != mix.kinds else None


def scale_of(smoothing: tuple[float, ...]) -> float:
    """Return one λ for all textures: the geometric mean, rounded down to a whole decade; 0 if one λ is 0."""
    if min(smoothing) <= 0:
        return 0.0
    return 10.0 ** math.floor(sum(math.log10(value) for value in smoothing) / len(smoothing) + 1e-9)
