"""`Nmf`: the BRDF matrix in non-negative factors (see `separable_fit`)."""

from dataclasses import dataclass
from typing import ClassVar

from homofact.methods import shared
from homofact.methods.method import Method
from homofact.settings.documented import documented


@documented
@dataclass(frozen=True, kw_only=True)
class Nmf(Method):
    """Settings of a non-negative sum of products: `textures` is the number of its terms.

    The fit is deterministic; `seed` is only the seed of the split.

    Examples
    --------
    >>> homofact.Nmf(textures=2).coordinates
    'half-diff'
    """

    name: ClassVar[str] = "nmf"
    implementation: ClassVar[str] = "homofact.methods.separable_fit:fit_nmf"

    textures: int = shared.terms()
    size: int = shared.size()
    epsilon: float | str | None = shared.epsilon()
    coordinates: str = shared.coordinates("half-diff")
    reciprocal: bool = shared.reciprocal()
    map: str = shared.direction_map()
    quantize: str = shared.quantize()
    seed: int = shared.seed()

    @property
    def most_textures(self) -> int:
        """How many terms there are."""
        return self.textures

    @property
    def stored_textures(self) -> int:
        """Two textures per term."""
        return 2 * self.textures
