"""Fitting methods by name: the table that the command line and the comparisons choose from."""

from collections.abc import Callable
from dataclasses import dataclass

from homofact.baselines.mccool import fit_mccool
from homofact.brdf.samples import Samples
from homofact.errors import BadInput
from homofact.factor.fit import Fit, ProgressCallback, fit_cole
from homofact.factor.search_fit import fit_search
from homofact.factor.settings import FitSettings


@dataclass(frozen=True)
class Method:
    """A way to fit, and whether isotropic measurements must be copied to other azimuths for it beforehand."""

    fit: Callable[[Samples, FitSettings, ProgressCallback | None], Fit]
    wants_copies: bool


METHODS: dict[str, Method] = {
    "search": Method(fit_search, wants_copies=False),
    "cole": Method(fit_cole, wants_copies=True),
    "mccool": Method(fit_mccool, wants_copies=True),
}


def method(name: str) -> Method:
    """The method called `name`. Raises BadInput that lists the names."""
    if name not in METHODS:
        raise BadInput(f"method: found {name!r}, expected one of {', '.join(METHODS)}")
    return METHODS[name]
