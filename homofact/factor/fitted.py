"""What every fit ends in, whatever its method: a reflectance that can be measured, written and read back."""

import os
from collections.abc import Sequence
from typing import Any, Protocol

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.reflectance import Reflectance


class Fitted(Reflectance, Protocol):
    """A `Reflectance` made by a fit: a product of textures (`Factorization`), or a sum of products of them."""

    @property
    def terms(self) -> Sequence[Any]:
        """The terms; how many there are is what reports call the number of textures."""
        ...

    @property
    def transform(self) -> LogTransform:
        """The fit's ε and A, by which its error in log space is measured."""
        ...

    @property
    def provenance(self) -> dict[str, Any]:
        """What it was made from and by (method, seed, settings, version), JSON-able."""
        ...

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the one .npz file that reads back bit-identical. Raises BadInput for an unwritable place."""
        ...
