"""The fit of a user's own method: what its function returns, measured as any other fit."""

import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from torch import Tensor

from homofact.brdf.function import FunctionReflectance
from homofact.brdf.in_kind import answering_in_kind
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.errors import BadInput, Report, Status
from homofact.factor.fitted import QuantizationGrid, Texture
from homofact.methods.common import transform_of
from homofact.methods.fitting import MethodFit, ProgressCallback
from homofact.methods.own import OwnMethod


@dataclass(frozen=True)
class OwnFit:
    """A `Fitted` without textures: the `reflectance` of a user, which only the user can store."""

    reflectance: Reflectance
    channels: tuple[str, ...]
    transform: LogTransform
    nbytes: int
    fetches: int
    provenance: dict[str, Any] = field(default_factory=dict)
    terms: tuple[()] = ()
    textures: tuple[Texture, ...] = ()
    evaluation: None = None

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return BRDF values (N, C) in sr⁻¹ without the cosine, 0 under the horizon."""
        above = (wi[:, 2:] >= 0) & (wo[:, 2:] >= 0)
        return self.reflectance.evaluate(wi, wo).to(wi) * above

    def with_textures(
        self,
        texels: Sequence[Any],
        grids: Sequence[QuantizationGrid | None] | None = None,
        facts: Mapping[str, Any] | None = None,
    ) -> "OwnFit":
        """Raise BadInput, because the fit has no textures."""
        raise _refused("no textures")

    def describe(self) -> dict[str, Any]:
        """Return its kind."""
        return {"kind": OwnMethod.name}

    def save(self, path: str | os.PathLike[str]) -> None:
        """Raise BadInput, because homofact cannot store a user's function."""
        raise _refused("a function of yours")


def fit_own(samples: Samples, settings: OwnMethod, progress: ProgressCallback | None = None) -> MethodFit:
    """Fit with the function in `settings`. Raises BadInput if it does not return a suitable reflectance."""
    began = time.perf_counter()
    made = settings.function(samples, settings.seed)
    reflectance = made if hasattr(made, "evaluate") else FunctionReflectance(made)
    if len(reflectance.channels) != len(samples.channels):
        found = f"{len(reflectance.channels)} channels"
        raise BadInput(where="function", found=found, expected=f"those of the samples, {', '.join(samples.channels)}")
    facts = {"method": settings.name, "seed": settings.seed}
    transform = transform_of(samples, settings)
    fitted = OwnFit(reflectance, samples.channels, transform, settings.nbytes, settings.fetches, facts)
    report = Report(Status.DIRECT, 1, 1, time.perf_counter() - began, 0.0, settings.seed)
    return MethodFit(fitted, report)


def _refused(found: str) -> BadInput:
    return BadInput(where="a fit of your own method", found=found, expected="a fit of a method of this package")
