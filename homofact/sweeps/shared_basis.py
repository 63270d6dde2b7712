"""One basis of log textures for a database, and its gain: bytes per material at equal error, with leave-one-out.

All materials are fitted under one set of projections (`methods.search_fit.fit_shared`), by log errors. Each material is
then left out once: the textures of the others give a basis, the training samples of the material give its coefficients,
and its held-out samples give the error. Every colour channel is a separate texture with N coefficients, so the basis
covers all channels of all materials. Stored as float32, a material with C channels takes 4 C (N + 1) bytes for
coefficients and A, and its share of the N + 1 textures of one channel. For comparison, each material also gets textures
of its own under the same projections, at several sizes. The bytes at equal error are interpolated between these sizes,
linearly in the logarithms of bytes and error. Errors are those of the logarithms f̃ at samples with weights w: Σ w |f̃
− By|²/Σ w, where B interpolates the texels y.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import median
from typing import Any

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.samples import Samples
from homofact.errors import BadInput
from homofact.factor.factorization import Factorization, Term
from homofact.factor.gauge import in_gauge
from homofact.factor.layered import MOST_LAYERS, Layered
from homofact.factor.log_basis import LogBasis, of_channel
from homofact.factor.projection import layout_of
from homofact.factor.textures import LogSamples, domain_masks, inner_problem, solve_terms
from homofact.linear.arrays import as_array
from homofact.linear.layout import Shape
from homofact.linear.normal import NormalEquations
from homofact.linear.size import MOST_DENSE
from homofact.methods.fitting import MethodFit, ProgressCallback
from homofact.methods.search import Search
from homofact.methods.search_fit import fit_shared
from homofact.methods.shapes import side_of

LADDER = (1.0, 0.75, 0.5, 0.375, 0.25, 0.125)  # sides of a material's own textures, of the fit's


@dataclass(frozen=True)
class BasisMaterial:
    """One material under the shared projections: its fit, texels in the common gauge, and two normal equations."""

    name: str
    fit: Factorization
    texels: Tensor
    train: NormalEquations
    held_out: NormalEquations
    own: tuple[tuple[int, float], ...]  # (bytes, held-out error) of its own textures, the largest first


@dataclass(frozen=True)
class BasisRow:
    """A basis of `count` directions: held-out errors of materials `left_out` of it and `inside` it, and its bytes."""

    count: int
    left_out: tuple[float, ...]
    inside: tuple[float, ...]
    basis_bytes: int
    material_bytes: int

    def bytes_among(self, materials: int) -> float:
        """Return the bytes per material if this number of `materials` shares the basis."""
        return self.material_bytes + self.basis_bytes / materials

    def pays_from(self, own: float) -> int | None:
        """Return the least number of materials for less than `own` bytes per material; None if there is none."""
        saved = own - self.material_bytes
        return None if saved <= 0 else math.floor(self.basis_bytes / saved) + 1


@dataclass(frozen=True)
class SharedBasis:
    """The materials, one row per number of directions, and the basis of all materials with the most directions."""

    materials: tuple[BasisMaterial, ...]
    rows: tuple[BasisRow, ...]
    basis: LogBasis

    @property
    def ladder(self) -> tuple[tuple[float, float, float], ...]:
        """(bytes, median error, worst error) of the materials' own textures, the largest first."""
        steps = zip(*(material.own for material in self.materials), strict=True)
        return tuple(
            (median(nbytes for nbytes, _ in step), median(e for _, e in step), max(e for _, e in step))
            for step in steps
        )

    def own_bytes(self, error: float) -> tuple[float, bool]:
        """Return (bytes of own textures with this median error, whether these bytes are only an upper bound).

        If no size is as good, the result is for the largest size. If all sizes are better, it is for the smallest size
        and only an upper bound.
        """
        ladder = self.ladder
        if error <= ladder[0][1]:
            return ladder[0][0], False
        for (more, low, _), (fewer, high, _) in pairwise(ladder):
            if low < error <= high:
                part = math.log(error / low) / math.log(high / low)
                return more * (fewer / more) ** part, False
        return ladder[-1][0], True

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        count = len(self.materials)
        rows = []
        for row in self.rows:
            error = median(row.left_out)
            own, bound = self.own_bytes(error)
            rows.append(
                {
                    "directions": row.count,
                    "left_out": {"median": error, "worst": max(row.left_out)},
                    "inside": {"median": median(row.inside), "worst": max(row.inside)},
                    "bytes": row.bytes_among(count),
                    "basis_bytes": row.basis_bytes,
                    "material_bytes": row.material_bytes,
                    "own_bytes_at_equal_error": own,
                    "own_is_at_most": bound,
                    "pays_from": row.pays_from(own),
                }
            )
        ladder = [{"bytes": nbytes, "median": middle, "worst": worst} for nbytes, middle, worst in self.ladder]
        return {"materials": [material.name for material in self.materials], "own": ladder, "rows": rows}

    def layered(self) -> Layered:
        """Return the basis as layers of logarithms: the mean, then the directions. Their ε and A are placeholders."""
        first = self.materials[0].fit
        nothing = LogTransform(1.0, np.ones(1))
        one = replace(first, transform=nothing, channels=("log",), provenance={})
        return Layered(tuple(with_texels(one, texels) for texels in (self.basis.mean, *self.basis.directions)))

    def coefficients(self) -> Tensor:
        """Return every material's coefficients (M, C, N) in the basis of all, solved on its training samples."""
        return torch.stack([coefficients_of(self.basis, material.train) for material in self.materials])


def with_texels(fit: Factorization, texels: Tensor) -> Factorization:
    """Return the fit with other texels (T, C), all of them inside the mask."""
    layout = layout_of(tuple(term.projection for term in fit.terms), tuple(term.size for term in fit.terms))
    parts = zip(fit.terms, layout.split(texels), strict=True)
    terms = (Term(term.projection, as_array(own), np.ones(term.size, bool)) for term, own in parts)
    return replace(fit, terms=tuple(terms))


def expanded(basis: Layered, coefficients: Tensor, transform: LogTransform, channels: tuple[str, ...]) -> Factorization:
    """Reconstruct a material's fit from the layers of `SharedBasis.layered` and its coefficients (C, N)."""
    mean, *directions = basis.layers
    terms = []
    for j, term in enumerate(mean.terms):
        layers = torch.cat([torch.from_numpy(layer.terms[j].texture) for layer in directions], 2)
        texture = torch.from_numpy(term.texture) + layers @ coefficients.T
        terms.append(replace(term, texture=as_array(texture)))
    return Factorization(tuple(terms), transform, channels)


def coefficients_of(basis: LogBasis, equations: NormalEquations) -> Tensor:
    """Return the coefficients (C, N) that solve accumulated normal equations best, channel by channel."""
    return torch.stack([basis.solved(of_channel(equations, c)) for c in range(equations.rhs.shape[1])])


def judged(basis: LogBasis, material: BasisMaterial) -> float:
    """Return the held-out log error of a material, with coefficients from its training samples."""
    chosen = coefficients_of(basis, material.train)
    return material.held_out.error(torch.cat([basis.texels(own) for own in chosen], 1))


def fit_basis(
    names: Sequence[str],
    trains: Sequence[Samples],
    tests: Sequence[Samples],
    settings: Search,
    count: int,
    progress: ProgressCallback | None = None,
    notify: Callable[[str, int, int], object] = lambda words, done, all: None,
) -> SharedBasis:
    """Fit the materials and a basis of up to `count` directions, and leave out each material once.

    Raises BadInput for fewer than three materials, a `count` too large for the materials without one of them, and as
    `fit_shared`.
    """
    materials = len(names)
    if materials < 3:
        wanted = "3 or more: one is left out of two others"
        raise BadInput(where="basis", found=f"{materials} materials", expected=wanted)
    most = min((materials - 1) * len(trains[0].channels) - 1, MOST_LAYERS - 1)
    if not 1 <= count <= most:
        wanted = f"1 to {most} for {materials} materials, one of them left out"
        raise BadInput(where="basis", found=count, expected=wanted)
    notify("all materials together", 0, materials + 1)
    fits = fit_shared(trains, replace(settings, objective="log"), progress)
    made = []
    for k, (name, fit, test) in enumerate(zip(names, fits, tests, strict=True)):
        notify(name, k + 1, materials + 1)
        made.append(_material(name, fit, trains[k], test, settings.solver))
    stack = torch.stack([material.texels for material in made])
    others = [_basis(torch.cat((stack[:k], stack[k + 1 :])), count) for k in range(materials)]
    whole = _basis(stack, count)
    rows = []
    # 1, 2, 4 … up to the count, and that.
    for number in sorted({2**k for k in range(count.bit_length())} | {count}):
        left_out = (judged(other.first(number), own) for other, own in zip(others, made, strict=True))
        inside = (judged(whole.first(number), own) for own in made)
        channels = len(made[0].fit.channels)
        size = made[0].fit.nbytes // channels
        rows.append(BasisRow(number, tuple(left_out), tuple(inside), (number + 1) * size, 4 * channels * (number + 1)))
    return SharedBasis(tuple(made), tuple(rows), whole)


def _material(name: str, fit: MethodFit, train: Samples, test: Samples, solver: str) -> BasisMaterial:
    own_fit = fit.factorization
    assert isinstance(own_fit, Factorization)
    projections = tuple(term.projection for term in own_fit.terms)
    shapes = tuple(term.size for term in own_fit.terms)
    if sum(rows * columns for rows, columns in shapes) > MOST_DENSE:
        found = f"more than {MOST_DENSE} texels per material"
        raise BadInput(where="size", found=found, expected="smaller textures for a basis")
    smoothing = tuple(own_fit.provenance["smoothing"])
    logs, held = (LogSamples.of(samples, own_fit.transform) for samples in (train, test))
    texels = layout_of(projections, shapes).join([torch.from_numpy(term.texture) for term in own_fit.terms])
    masks = domain_masks(projections, shapes)
    # What no pair of directions reads would count as variance.
    texels = in_gauge(texels, projections, masks) * layout_of(projections, shapes).join(masks)[:, None]

    def equations(samples: LogSamples, own: tuple[Shape, ...]) -> NormalEquations:
        return inner_problem(samples, projections, own, 0.0).data

    ladder, tried = [], []
    for share in LADDER:
        own = tuple((1 if rows == 1 else _side(rows, share), _side(columns, share)) for rows, columns in shapes)
        # As `methods.shapes.SmoothingFor`: the same penalty on the function.
        if own in tried:
            continue
        tried.append(own)
        scaled = tuple(
            weight * (side_of(small) / side_of(shape)) ** 4
            for weight, small, shape in zip(smoothing, own, shapes, strict=True)
        )
        terms = solve_terms(logs, projections, own, scaled, solver).terms
        there = layout_of(projections, own).join([term.texture for term in terms])
        nbytes = Factorization(
            tuple(term.arrays() for term in terms), own_fit.transform, own_fit.channels
        ).nbytes + 4 * len(own_fit.channels)
        ladder.append((nbytes, equations(held, own).error(there)))
    return BasisMaterial(name, own_fit, texels, equations(logs, shapes), equations(held, shapes), tuple(ladder))


def _basis(stack: Tensor, count: int) -> LogBasis:
    """The basis of textures (M, T, C), every channel by itself."""
    return LogBasis.of(stack.permute(0, 2, 1).flatten(0, 1)[..., None], count)


def _side(texels: int, share: float) -> int:
    return max(2, round(texels * share))
