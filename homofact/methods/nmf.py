"""`Nmf`: the BRDF matrix in non-negative factors (see `separable_fit`)."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from homofact.methods import shared
from homofact.options import check_options

if TYPE_CHECKING:
    from homofact.brdf.samples import Samples
    from homofact.methods.fitting import Fit, ProgressCallback


@dataclass(frozen=True, kw_only=True)
class Nmf:
    """Settings of a non-negative sum of products: `textures` is the number of its terms.

    Nothing in it is left to chance; `seed` is that of the split.
    """

    name: ClassVar[str] = "nmf"

    textures: int = shared.terms()
    size: int = shared.size()
    epsilon: float | str | None = shared.epsilon()
    coordinates: str = shared.coordinates("half-diff")
    reciprocal: bool = shared.reciprocal()
    map: str = shared.direction_map()
    quantize: str = shared.quantize()
    seed: int = shared.seed()

    def __post_init__(self) -> None:
        """Refuse what cannot be meant. Raises BadInput naming the setting, what was found and what is expected."""
        check_options(self)

    def fit(self, samples: "Samples", progress: "ProgressCallback | None" = None) -> "Fit":
        """Decompose the matrix resampled from `samples`; `progress` is never called."""
        from homofact.methods.fitting import with_whole_texels
        from homofact.methods.separable_fit import fit_nmf

        return with_whole_texels(fit_nmf(samples, self), samples, self)
