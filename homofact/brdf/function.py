"""Use a user's function f(wi, wo) as a reflectance."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.in_kind import answering_in_kind
from homofact.brdf.symmetry import find_symmetry
from homofact.errors import BadInput

_CHANNELS = {1: ("Y",), 3: ("R", "G", "B")}
_TRIED = ((0.0, 0.0, 1.0), (0.6, 0.0, 0.8))


@dataclass(frozen=True)
class FunctionReflectance:
    """A `Reflectance` that calls `function` with unit vectors wi and wo (N, 3).

    The function receives directions above the horizon, as float64 NumPy arrays, or as torch tensors if it fails on
    arrays. It returns values (N, C) or (N,) in sr⁻¹ without the cosine. Raises BadInput if the function cannot be
    called in this way or returns anything else.
    """

    function: Callable[[Any, Any], Any]
    takes_tensors: bool = field(init=False)
    channels: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        """Find out what the function takes and returns."""
        pairs = torch.tensor(_TRIED, dtype=torch.float64)
        failed: Exception | None = None
        for takes_tensors in (False, True):
            object.__setattr__(self, "takes_tensors", takes_tensors)
            try:
                values = self._values(pairs, pairs)
            except BadInput:
                raise
            except Exception as error:
                failed = failed or error
                continue
            count = values.shape[1]
            names = _CHANNELS.get(count, tuple(f"c{k}" for k in range(count)))
            object.__setattr__(self, "channels", names)
            return
        words = " ".join(str(failed).split())
        raise BadInput(
            f"the function failed ({type(failed).__name__}: {words})", where="source", expected="f(wi, wo) of (N, 3)"
        )

    @property
    def nbytes(self) -> int:
        """0, since the storage that the function reads is unknown."""
        return 0

    @property
    def fetches(self) -> int:
        """0, since the lookups of the function are unknown."""
        return 0

    @cached_property
    def isotropic(self) -> bool:
        """Whether values stay the same if both directions rotate about the normal, tested at random pairs."""
        return find_symmetry(self).isotropic

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return BRDF values (N, C) in sr⁻¹ without the cosine; 0 where a direction is below the horizon."""
        above = (wi[:, 2] >= 0) & (wo[:, 2] >= 0)
        normal = wi.new_tensor([0, 0, 1])
        wi, wo = (torch.where(above[:, None], w, normal) for w in (wi, wo))
        return torch.where(above[:, None], self._values(wi, wo), 0.0)

    def _values(self, wi: Tensor, wo: Tensor) -> Tensor:
        if self.takes_tensors:
            found = self.function(wi, wo)
        else:
            found = self.function(wi.detach().cpu().numpy().astype(np.float64), wo.detach().cpu().numpy())
        values = torch.as_tensor(found).to(wi)
        values = values[:, None] if values.ndim == 1 else values
        if values.ndim != 2 or len(values) != len(wi) or values.shape[1] == 0:
            raise BadInput(
                f"the function returns values of shape {tuple(values.shape)} for {len(wi)} pairs",
                where="source",
                expected=f"({len(wi)}, channels)",
            )
        return values
