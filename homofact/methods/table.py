"""Fitting methods by name: the table that the command line and the comparisons choose from."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

from homofact.brdf.samples import Samples
from homofact.errors import BadInput
from homofact.factor.fitted import Fitted
from homofact.factor.quantize import is_solved, quantize
from homofact.methods.cole_fit import PARAMETERIZATIONS, Fit, ProgressCallback, fit_cole
from homofact.methods.mccool_fit import fit_mccool
from homofact.methods.search_fit import at_azimuths, fit_search, pinned_kinds, search_named
from homofact.methods.separable_fit import fit_nmf, fit_svd, nmf_parameterization, svd_parameterization
from homofact.methods.settings import FitSettings

F = TypeVar("F", bound=Fitted)


@dataclass(frozen=True)
class Method:
    """A way to fit.

    `wants_copies`: whether isotropic measurements must be copied to other azimuths for it beforehand.
    `ignores`: the settings that it has no use for; two fits that differ in nothing else are the same fit.
    """

    fit: Callable[[Samples, FitSettings, ProgressCallback | None], Fit]
    wants_copies: bool
    ignores: frozenset[str]


# A decomposition of a matrix has neither projections to search nor a linear system to solve.
_NO_SOLVE = frozenset(
    {
        "solver", "smoothing", "together", "restarts", "search", "validation", "budget", "refine", "search_size",
        "search_samples", "copies", "mirrored", "bound", "projections", "robust", "confidence",
    }
)  # fmt: skip

METHODS: dict[str, Method] = {
    "search": Method(
        fit_search,
        wants_copies=False,
        ignores=frozenset({"together", "projections", "map", "decomposition"}),
    ),
    "cole": Method(
        fit_cole,
        wants_copies=True,
        ignores=frozenset({"search", "validation", "budget", "refine", "projections", "map", "decomposition"}),
    ),
    "mccool": Method(
        fit_mccool,
        wants_copies=True,
        ignores=frozenset(
            {
                "textures", "parameterization", "together", "restarts", "search", "validation", "budget",
                "refine", "search_size", "search_samples", "bound", "map", "decomposition",
            }
        ),
    ),
    "svd": Method(fit_svd, wants_copies=False, ignores=_NO_SOLVE),
    "nmf": Method(fit_nmf, wants_copies=False, ignores=_NO_SOLVE | {"decomposition", "seed"}),
}  # fmt: skip


def method(name: str) -> Method:
    """The method called `name`. Raises BadInput that lists the names."""
    if name not in METHODS:
        raise BadInput(f"method: found {name!r}, expected one of {', '.join(METHODS)}")
    return METHODS[name]


def run(samples: Samples, settings: FitSettings, progress: ProgressCallback | None = None) -> Fit:
    """The fit of `settings.method`, its texels rounded where `settings.quantize` asks for it. Raises BadInput."""
    fit = method(settings.method).fit(samples, settings, progress)
    if settings.quantize == "none":
        return fit
    return replace(fit, factorization=quantized(fit.factorization, samples, settings))


def quantized(fitted: F, samples: Samples, settings: FitSettings) -> F:
    """A fit of `settings` with texels that `settings.quantize` holds, from the samples that it was given itself.

    Raises BadInput for quantize "none" and as `method`.
    """
    if is_solved(fitted) and not method(settings.method).wants_copies:
        samples = at_azimuths(samples, settings, not fitted.evaluation.isotropic)
    return quantize(fitted, samples, settings.quantize)


def check_settings(settings: FitSettings) -> None:
    """Raise BadInput for what can be known to be wrong before there are samples.

    That is an unknown method, a search that does not exist, and a parameterization that is none of the method's.
    """
    ignored = method(settings.method).ignores
    if settings.method == "svd":
        svd_parameterization(settings)
    elif settings.method == "nmf":
        nmf_parameterization(settings)
    elif "search" not in ignored:
        search_named(settings.search)
        pinned_kinds(settings)
    elif "parameterization" not in ignored and settings.parameterization not in (None, *PARAMETERIZATIONS):
        raise BadInput(
            f"parameterization: found {settings.parameterization!r},"
            f" expected {' or '.join(PARAMETERIZATIONS)} for {settings.method}"
        )
