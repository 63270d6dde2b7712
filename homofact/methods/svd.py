"""`Svd`: the BRDF matrix decomposed (see `separable_fit`)."""

from dataclasses import dataclass
from typing import ClassVar

from homofact.errors import BadInput
from homofact.methods import shared
from homofact.methods.method import Method
from homofact.separable.decomposition_names import DECOMPOSITIONS, SYMMETRIC
from homofact.settings.documented import documented
from homofact.settings.options import option


@documented
@dataclass(frozen=True, kw_only=True)
class Svd(Method):
    """Settings of a sum of products: `textures` is the number of its terms.

    `decomposition` finds them: "eigen", "svd", "power", or "normalized" (one term, never negative); None is "eigen"
    for a reciprocal in-out fit and "svd" elsewhere.

    Examples
    --------
    >>> homofact.Svd(textures=1).chosen_decomposition
    'eigen'
    """

    name: ClassVar[str] = "svd"
    implementation: ClassVar[str] = "homofact.methods.separable_fit:fit_svd"

    textures: int = shared.terms()
    size: int = shared.size()
    epsilon: float | str | None = shared.epsilon()
    coordinates: str = shared.coordinates("in-out")
    reciprocal: bool = shared.reciprocal()
    map: str = shared.direction_map()
    decomposition: str | None = option(
        None, "Algorithm that finds the terms", choices=DECOMPOSITIONS, none="depends on the matrix's symmetry"
    )
    quantize: str = shared.quantize()
    seed: int = shared.seed()

    def __post_init__(self) -> None:
        """Check the settings. Raises BadInput naming the setting, what was found and what is expected."""
        super().__post_init__()
        if self.decomposition in SYMMETRIC and not self.symmetric:
            raise BadInput(
                where="decomposition",
                found=f"{self.decomposition!r}, which needs the symmetry of a reciprocal in-out matrix",
                expected="svd or normalized",
            )

    @property
    def symmetric(self) -> bool:
        """Whether the matrix is symmetric: in-out coordinates with reciprocity enforced."""
        return self.coordinates == "in-out" and self.reciprocal

    @property
    def chosen_decomposition(self) -> str:
        """The decomposition that the fit uses."""
        if self.decomposition is None:
            return "eigen" if self.symmetric else "svd"
        return self.decomposition

    @property
    def most_textures(self) -> int:
        """How many terms there are."""
        return self.textures

    @property
    def stored_textures(self) -> int:
        """One texture per term where both sides share it, else two; the normalized decomposition has one term."""
        if self.chosen_decomposition in SYMMETRIC:
            return self.textures
        return 2 if self.chosen_decomposition == "normalized" else 2 * self.textures
