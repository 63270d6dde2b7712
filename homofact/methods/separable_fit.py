"""Separable fits: decompose a BRDF matrix that is made from samples, and store its factors as textures.

`svd` (Kautz and McCool 1999; Wang, Tran and Luebke 2004, 3.2) takes the leading terms in one of the ways of
`decompositions`; `nmf` (after Lawrence, Rusinkiewicz and Ramamoorthi 2004) takes non-negative ones. The matrix is dense
and samples are scattered, so every entry is resampled from them (`resampling`) at texel directions. This resampling
error is part of these methods' error; for noise-free samples of a sharp highlight, it is the larger part.
`separable_of` evaluates a reflectance instead of resampling. Isotropic measurements need no azimuth copies: their
resampling does not change with azimuth. In the fits, the weight of a matrix entry is the product of the projected solid
angles of its two texels. The papers weight all entries equally; for a BRDF that grows towards the horizon, the first
terms then represent only grazing light. `separable_of` supports both weights.
"""

import time
from dataclasses import dataclass, replace
from typing import Any

import torch
from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.errors import BadInput, Report, Status
from homofact.linear.threads import one_thread
from homofact.methods.common import provenance_of, refuse_bounds, transform_of, with_whole_texels
from homofact.methods.fitting import MethodFit, ProgressCallback
from homofact.methods.nmf import Nmf
from homofact.methods.svd import Svd
from homofact.separable.decomposition_names import SYMMETRIC
from homofact.separable.decompositions import Factors, eigen, imputed, normalized, power, svd
from homofact.separable.maps import direction_map
from homofact.separable.matrix import BrdfMatrix, brdf_matrix
from homofact.separable.nmf import nmf
from homofact.separable.resampling import resampled
from homofact.separable.separable import Separable, SeparableTerm

# Of an entry under the horizon in a non-negative fit: it says little, but leaves no texel undetermined.
_FILLED_WEIGHT = 1e-2


@dataclass(frozen=True)
class _DecomposedTerms:
    """The result of a decomposition: the `terms` of a separable sum, its status, and its iterations."""

    terms: tuple[SeparableTerm, ...]
    status: Status
    iterations: int


def _svd_terms(
    matrix: BrdfMatrix, count: int, decomposition: str, generator: torch.Generator, weighted: bool
) -> _DecomposedTerms:
    """Return `count` terms of a matrix M by a named decomposition, each channel separately.

    If `weighted`, √wi Mij √wj is decomposed and its factors are divided by √w, where w are the projected solid angles
    of the texels. Missing entries are imputed from the terms themselves, except by the decomposition `normalized`.
    Raises BadInput for an unknown decomposition.
    """
    roots = matrix.weights.sqrt() if weighted else torch.ones_like(matrix.weights)

    def factors(channel: Tensor) -> Factors:
        weighed = channel * roots[:, None] * roots if weighted else channel
        parts = of_weighted(weighed if decomposition == "normalized" else imputed(weighed, matrix.valid, count))
        right = None if parts.right is None else parts.right / roots[:, None]
        return replace(parts, left=parts.left / roots[:, None], right=right)

    def of_weighted(channel: Tensor) -> Factors:
        if decomposition == "svd":
            return svd(channel, count)
        if decomposition == "eigen":
            return eigen(channel, count)
        if decomposition == "power":
            return power(channel, count, generator)
        if decomposition == "normalized":
            return normalized(channel)
        raise BadInput(where="decomposition", found=repr(decomposition), expected="svd, eigen, power or normalized")

    factored: list[Factors] = []
    for c in range(matrix.values.shape[2]):
        channel = matrix.values[..., c]
        # A grey material is decomposed once.
        same = c > 0 and torch.equal(channel, matrix.values[..., c - 1])
        factored.append(factored[-1] if same else factors(channel.contiguous()))
    converged = all(part.converged for part in factored)
    iterated = sum(part.iterations for part in factored)
    status = Status.DIRECT if iterated == 0 else Status.CONVERGED if converged else Status.BUDGET
    return _DecomposedTerms(_terms(matrix, factored), status, max(iterated, 1))


def _nmf_terms(matrix: BrdfMatrix, count: int) -> _DecomposedTerms:
    """Return `count` non-negative terms of a matrix, weighted by solid angles, each channel separately.

    Entries below the horizon have a small weight.
    """
    weights = torch.outer(matrix.weights, matrix.weights) * torch.where(matrix.valid, 1.0, _FILLED_WEIGHT)
    factored = [nmf(matrix.values[..., c].contiguous(), count, weights) for c in range(matrix.values.shape[2])]
    factors = [Factors(channel.left, channel.right, torch.ones_like(channel.left[0])) for channel in factored]
    status = Status.CONVERGED if all(channel.converged for channel in factored) else Status.BUDGET
    return _DecomposedTerms(_terms(matrix, factors), status, sum(len(channel.objectives) - 1 for channel in factored))


def separable_of(
    reflectance: Reflectance,
    terms: int,
    size: int,
    *,
    map: str = "orthographic",
    parameterization: str = "in-out",
    decomposition: str = "eigen",
    weighted: bool = False,
    isotropic: bool = False,
    seed: int = 0,
) -> Separable:
    """Return the separable approximation of a reflectance that can be evaluated everywhere, without samples.

    `weighted` weights the matrix entries by the projected solid angles of their texels. `isotropic` saves evaluations
    (`matrix.brdf_matrix`), and `seed` is the seed of the power iteration. The log transform of the result has A = mean
    of the valid matrix entries and ε = 1e-5. Raises BadInput for invalid arguments.
    """
    reciprocal = parameterization == "in-out" and decomposition in SYMMETRIC
    matrix = brdf_matrix(
        reflectance, direction_map(map), size, parameterization, isotropic=isotropic, reciprocal=reciprocal
    )
    decomposed = _svd_terms(matrix, terms, decomposition, torch.Generator().manual_seed(seed), weighted)
    transform = LogTransform(1e-5, matrix.values[matrix.valid].mean(0))
    made = {"method": "svd", "decomposition": decomposition, "samples": None, "seed": seed}
    return _separable(matrix, decomposed, transform, tuple(reflectance.channels), made)


def fit_svd(samples: Samples, settings: Svd, progress: ProgressCallback | None = None) -> MethodFit:
    """Return `settings.textures` terms (one if normalized) on `settings.size`² maps.

    The report's residual is the Cole error of `samples`, its details are the share of values that are clamped at zero
    at these samples (`clipped`) and the share of matrix entries without a value (`filled`). `progress` is never called.
    """
    return with_whole_texels(_fit_by_decomposition(samples, settings), samples, settings)


def fit_nmf(samples: Samples, settings: Nmf, progress: ProgressCallback | None = None) -> MethodFit:
    """Fit like `fit_svd`, with non-negative factors; reciprocity applies only to the matrix, not to the factors."""
    return with_whole_texels(_fit_nonnegative(samples, settings), samples, settings)


@one_thread
def _fit_by_decomposition(samples: Samples, settings: Svd) -> MethodFit:
    began = time.perf_counter()
    matrix = _resampled_matrix(samples, settings)
    generator = torch.Generator().manual_seed(settings.seed)
    decomposition = settings.chosen_decomposition
    terms = _svd_terms(matrix, settings.textures, decomposition, generator, weighted=True)
    return _fitted(samples, settings, matrix, terms, {"decomposition": decomposition}, began)


@one_thread
def _fit_nonnegative(samples: Samples, settings: Nmf) -> MethodFit:
    began = time.perf_counter()
    matrix = _resampled_matrix(samples, settings)
    return _fitted(samples, settings, matrix, _nmf_terms(matrix, settings.textures), {}, began)


def _resampled_matrix(samples: Samples, settings: Svd | Nmf) -> BrdfMatrix:
    refuse_bounds(samples, settings)
    return brdf_matrix(
        resampled(samples, settings.reciprocal),
        direction_map(settings.map),
        settings.size,
        settings.coordinates,
        isotropic=samples.isotropic,
        reciprocal=settings.reciprocal,
    )


def _fitted(
    samples: Samples,
    settings: Svd | Nmf,
    matrix: BrdfMatrix,
    decomposed: _DecomposedTerms,
    made: dict[str, Any],
    began: float,
) -> MethodFit:
    transform = transform_of(samples, settings)
    made = provenance_of(samples, settings) | made
    result = _separable(matrix, decomposed, transform, samples.channels, made)
    signed = result.evaluate_signed(samples.wi, samples.wo)
    logs = transform.forward(signed.clamp_min(0)) - transform.forward(samples.values)
    clipped = float((signed < 0).double().mean())
    filled = 1 - float(matrix.valid.double().mean())
    notes = (f"{clipped:.2%} of the values at the training samples were negative and cut at zero",) if clipped else ()
    report = Report(
        decomposed.status,
        decomposed.iterations,
        1,
        time.perf_counter() - began,
        float((logs**2).mean()),
        settings.seed,
        notes=notes,
        details={"clipped": clipped, "filled": filled},
    )
    return MethodFit(result, report)


def _separable(
    matrix: BrdfMatrix,
    decomposed: _DecomposedTerms,
    transform: LogTransform,
    channels: tuple[str, ...],
    made: dict[str, Any],
) -> Separable:
    read = matrix.read.reshape(matrix.size, matrix.size)
    return Separable(decomposed.terms, matrix.map.name, matrix.parameterization, read, transform, channels, made)


def _terms(matrix: BrdfMatrix, factored: list[Factors]) -> tuple[SeparableTerm, ...]:
    """Return the channels' factors as textures; missing terms of a channel are 0."""
    count = max(channel.left.shape[1] for channel in factored)

    def texture(factors: list[Tensor], k: int) -> Tensor:
        zero = torch.zeros_like(matrix.values[:, 0, 0])
        return torch.stack([matrix.texture(f[:, k] if k < f.shape[1] else zero) for f in factors], 2)

    terms = []
    for k in range(count):
        first = texture([channel.left for channel in factored], k)
        rights = [channel.right for channel in factored if channel.right is not None]
        second = texture(rights, k) if rights else None
        signs = [channel.signs[k] if k < len(channel.signs) else matrix.values.new_ones(()) for channel in factored]
        terms.append(SeparableTerm(first, second, torch.stack(signs)))
    return tuple(terms)
