"""The best number and shapes of textures for a given number of bytes.

A search of mixes gives the best mix of one texture, of two, and so on. Cross-validation judges each of these mixes with
textures of equal size; an additional texture must lower the error enough to justify its fetch. Then the aspect ratios
of the textures and their shares of the texels are changed, one texture at a time, as long as the left-out error falls.

Few samples make the left-out error noisy, and the smallest of many noisy errors often does not belong to the best fit.
With few samples, all folds are therefore used instead of one, and another texture or layout must lower the error more
(scripts/accuracy/bytes_on_few_samples.py).
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from homofact.errors import BadInput
from homofact.factor.projection import Projection
from homofact.linear.layout import Axis, Shape
from homofact.linear.size import MOST_DENSE
from homofact.methods.effort import FitBudget, cost_of_solve
from homofact.methods.materials import Materials
from homofact.methods.mix import Mix

_FEW = 1000  # samples of a material, copies not counted
# One more texture is taken where it leaves less than this share of the error, and another layout where it leaves less
# than that: with many samples, and with few.
_WORTH_A_FETCH, _WORTH_A_FETCH_OF_FEW = 0.97, 0.75
_WORTH_A_MOVE, _WORTH_A_MOVE_OF_FEW = 0.995, 0.9
_ASPECTS = (2.0, 0.5)  # columns over rows, times this at a move
SHARES = (1.5,)  # a texture's share of the texels, times this
_LEAST, _STRETCH = 2, 16.0


def texels_in(nbytes: int, channels: int) -> int:
    """Return the float32 texels in this number of bytes. Raises BadInput for fewer than 2 × 2 texels."""
    texels = nbytes // (4 * channels)
    if texels < _LEAST**2:
        raise BadInput(
            where="bytes", found=nbytes, expected=f"at least {16 * channels}: a 2 × 2 texture of {channels} channels"
        )
    return texels


@dataclass(frozen=True)
class Layout:
    """Each texture's share of the texels, and its aspect ratio (columns divided by rows)."""

    shares: tuple[float, ...]
    aspects: tuple[float, ...]

    @classmethod
    def even(cls, count: int) -> "Layout":
        """Square textures of one size."""
        return cls((1.0,) * count, (1.0,) * count)

    def shapes(self, projections: tuple[Projection, ...], texels: int) -> tuple[Shape, ...]:
        """Return (rows, columns) of each texture: the largest that together store at most `texels`.

        A texture with one row is as long as the side of a square texture with the same share. The line that a periodic
        axis repeats is counted.
        """
        low, high = 0.0, float(texels + 1) ** 2
        for _ in range(80):
            middle = (low + high) / 2
            shapes = self._scaled(projections, middle)
            low, high = (middle, high) if stored(projections, shapes) <= texels else (low, middle)
        return self._scaled(projections, low)

    def moved(self) -> Iterator["Layout"]:
        """Yield the layouts a step away from this one, texture by texture."""
        for j in range(len(self.shares)):
            for factor in _ASPECTS:
                aspect = self.aspects[j] * factor
                if 1 / _STRETCH <= aspect <= _STRETCH:
                    yield replace(self, aspects=(*self.aspects[:j], aspect, *self.aspects[j + 1 :]))
            for factor in SHARES if len(self.shares) > 1 else ():
                yield replace(self, shares=(*self.shares[:j], self.shares[j] * factor, *self.shares[j + 1 :]))

    def _scaled(self, projections: tuple[Projection, ...], unit: float) -> tuple[Shape, ...]:
        whole = sum(self.shares)
        shapes = []
        for projection, share, aspect in zip(projections, self.shares, self.aspects, strict=True):
            side = math.sqrt(unit * share / whole)
            columns = max(_LEAST, int(side * math.sqrt(aspect) + 1e-9))
            flat = bool((projection.matrix[1] == 0).all())
            shapes.append(
                (1, max(_LEAST, int(side))) if flat else (max(_LEAST, int(side / math.sqrt(aspect))), columns)
            )
        return tuple(shapes)


def stored(projections: tuple[Projection, ...], shapes: tuple[Shape, ...]) -> int:
    """Return the number of stored texels for these shapes; a periodic axis repeats a line."""
    total = 0
    for projection, (rows, columns) in zip(projections, shapes, strict=True):
        across, along = (int(axis is Axis.PERIODIC) for axis in projection.axes)
        total += (rows + across) * (columns + along)
    return total


class SmoothingFor:
    """Converts the λ of a mix to textures of other shapes, and to more samples."""

    def __init__(self, coarse: int, fewer: float, given: float | None) -> None:
        """Store how λ was found: on textures of `coarse`² with a share `fewer` of the samples, or `given`."""
        self.coarse, self._fewer, self._given = coarse, fewer, given

    def __call__(self, mix: Mix, shapes: tuple[Shape, ...]) -> tuple[float, ...]:
        """Return λ per texture, scaled with the fourth power of the textures' sides.

        Second differences of a smooth function decrease with the square of the texel distance h. λ is in units of
        samples per texel, so λ Σw h² Σ (h² y″)² penalizes the function equally if λ h⁴ is constant.
        """
        fewer = self._fewer if self._given is None else 1.0
        return tuple(
            fewer * value * (side_of(shape) / self.coarse) ** 4
            for value, shape in zip(mix.smoothing, shapes, strict=True)
        )


def side_of(shape: Shape) -> float:
    """Return the side of a square texture with as many texels, or the length of one with a single row."""
    rows, columns = shape
    return float(columns) if rows == 1 else math.sqrt(rows * columns)


@dataclass(frozen=True)
class SizedMix:
    """The result for a number of bytes: a mix, its shapes, and the left-out error by number of textures."""

    mix: Mix
    shapes: tuple[Shape, ...]
    errors: tuple[float, ...]


class _Judge:
    """Measures cross-validation errors of mixes for texture shapes; sets the least gain worth a fetch or a move."""

    def __init__(self, materials: Materials, smoothing_for: SmoothingFor, budget: FitBudget, few: bool) -> None:
        self._materials, self._smoothing_for, self.budget = materials, smoothing_for, budget
        self._folds = None if few else 1
        self.worth_a_fetch = _WORTH_A_FETCH_OF_FEW if few else _WORTH_A_FETCH
        self.worth_a_move = _WORTH_A_MOVE_OF_FEW if few else _WORTH_A_MOVE

    def error(self, mix: Mix, shapes: tuple[Shape, ...]) -> float:
        """Return the error on held-out folds of each partition: on one fold, or on all folds if samples are few."""
        folded = self._materials.folded(mix.projections, shapes, self._folds)
        lookups = sum(projection.lookups for projection in mix.projections)
        self.budget.spend(self._materials.cost(lookups, folded.unknowns))
        self.budget.spend(folded.solves(self._folds) * cost_of_solve(folded.unknowns))
        return folded.error(self._smoothing_for(mix, shapes), self._folds)


def best_within(
    texels: int,
    mixes: tuple[Mix, ...],
    materials: Materials,
    smoothing_for: SmoothingFor,
    budget: FitBudget,
    measured: int,
) -> SizedMix:
    """Return the mix and the shapes with the smallest error on left-out folds of each partition.

    `mixes` have one texture, two, and so on; each material has `measured` samples, copies not counted. No layout is
    tried once the budget is spent. If `texels` is too large for dense systems, layouts are judged with the largest
    number that dense systems allow. Raises BadInput where not even a 2 × 2 texture for each texture of the smallest mix
    fits.
    """
    judge = _Judge(materials, smoothing_for, budget, measured < _FEW)
    granted, texels = texels, min(texels, MOST_DENSE)
    judged: list[tuple[float, Mix, Layout]] = []
    for mix in mixes:
        layout = Layout.even(len(mix.kinds))
        shapes = layout.shapes(mix.projections, texels)
        if stored(mix.projections, shapes) <= texels:
            judged.append((judge.error(mix, shapes), mix, layout))
    if not judged:
        raise BadInput(where="bytes", found=f"{texels} texels", expected="enough for a texture of 2 × 2 each")
    lowest, mix, layout = judged[0]
    for error, more, even in judged[1:]:
        if error < judge.worth_a_fetch * lowest:
            lowest, mix, layout = error, more, even
    improved = True
    while improved and not budget.over:
        improved = False
        for trial in layout.moved():
            shapes = trial.shapes(mix.projections, texels)
            if budget.over or stored(mix.projections, shapes) > texels:
                continue
            error = judge.error(mix, shapes)
            if error < judge.worth_a_move * lowest:
                lowest, layout, improved = error, trial, True
    return SizedMix(mix, layout.shapes(mix.projections, granted), tuple(error for error, _, _ in judged))
