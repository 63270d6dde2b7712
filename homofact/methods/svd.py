"""`Svd`: the BRDF matrix decomposed (see `separable_fit`)."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from homofact.errors import BadInput
from homofact.methods import shared
from homofact.options import check_options, option
from homofact.separable.names import DECOMPOSITIONS, SYMMETRIC

if TYPE_CHECKING:
    from homofact.brdf.samples import Samples
    from homofact.methods.fitting import Fit, ProgressCallback


@dataclass(frozen=True, kw_only=True)
class Svd:
    """Settings of a sum of products: `textures` is the number of its terms.

    `decomposition` finds them: "eigen", "svd", "power", or "normalized" (one term, never negative); None is "eigen"
    for a reciprocal in-out fit and "svd" elsewhere.
    """

    name: ClassVar[str] = "svd"

    textures: int = shared.terms()
    size: int = shared.size()
    epsilon: float | str | None = shared.epsilon()
    coordinates: str = shared.coordinates("in-out")
    reciprocal: bool = shared.reciprocal()
    map: str = shared.direction_map()
    decomposition: str | None = option(
        None, "How the terms are found", choices=DECOMPOSITIONS, none="by the matrix's symmetry"
    )
    quantize: str = shared.quantize()
    seed: int = shared.seed()

    def __post_init__(self) -> None:
        """Refuse what cannot be meant. Raises BadInput naming the setting, what was found and what is expected."""
        check_options(self)
        if self.decomposition in SYMMETRIC and not self.symmetric:
            raise BadInput(
                f"decomposition: found {self.decomposition!r}, which needs the symmetry of a reciprocal in-out matrix;"
                " expected svd or normalized"
            )

    @property
    def symmetric(self) -> bool:
        """Whether the matrix is: in-out, with reciprocity enforced."""
        return self.coordinates == "in-out" and self.reciprocal

    @property
    def chosen_decomposition(self) -> str:
        """The decomposition that is taken."""
        if self.decomposition is None:
            return "eigen" if self.symmetric else "svd"
        return self.decomposition

    def fit(self, samples: "Samples", progress: "ProgressCallback | None" = None) -> "Fit":
        """Decompose the matrix resampled from `samples`; `progress` is never called."""
        from homofact.methods.fitting import with_whole_texels
        from homofact.methods.separable_fit import fit_svd

        return with_whole_texels(fit_svd(samples, self), samples, self)
