"""Models that users know, fitted to be compared: `Ggx`, `Gaussians`, `Npf` and `Nbrdf` have no textures."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from homofact.methods import shared
from homofact.options import check_options, option

if TYPE_CHECKING:
    from homofact.brdf.samples import Samples
    from homofact.methods.fitting import Fit, ProgressCallback


class _Model:
    """What the models have in common: no texels, and reciprocity by their formulas."""

    @property
    def size(self) -> int:
        """0: there are no texels."""
        return 0

    @property
    def textures(self) -> int:
        """0."""
        return 0

    @property
    def reciprocal(self) -> bool:
        """True."""
        return True

    def __post_init__(self) -> None:
        """Refuse what cannot be meant. Raises BadInput naming the setting, what was found and what is expected."""
        check_options(self)

    def fit(self, samples: "Samples", progress: "ProgressCallback | None" = None) -> "Fit":
        """Fit the model to `samples`; `progress` is never called."""
        from homofact.methods.model_fits import fit_model

        return fit_model(samples, self)  # type: ignore[arg-type]


@dataclass(frozen=True, kw_only=True)
class Ggx(_Model):
    """Microfacets of Walter et al. 2007 over a diffuse base: 8 numbers with one lobe, 13 with two."""

    name: ClassVar[str] = "ggx"

    lobes: int = option(1, "How many lobes over the diffuse base", least=1, most=4)
    epsilon: float | str | None = shared.epsilon()
    seed: int = shared.seed()


@dataclass(frozen=True, kw_only=True)
class Gaussians(_Model):
    """Spherical Gaussians over a diffuse base (Wang et al. 2009): 16 numbers with three."""

    name: ClassVar[str] = "gaussians"

    lobes: int = option(3, "How many lobes over the diffuse base", least=1, most=4)
    epsilon: float | str | None = shared.epsilon()
    seed: int = shared.seed()


@dataclass(frozen=True, kw_only=True)
class Npf(_Model):
    """The non-parametric factors of Bagher et al. 2016: 272 numbers a channel."""

    name: ClassVar[str] = "npf"

    epsilon: float | str | None = shared.epsilon()
    seed: int = shared.seed()


@dataclass(frozen=True, kw_only=True)
class Nbrdf(_Model):
    """The network of Sztrajman et al. 2021, 675 weights, for materials of three channels."""

    name: ClassVar[str] = "nbrdf"

    steps: int = option(20_000, "Steps of its training, of 512 pairs each", least=1, most=10**7)
    epsilon: float | str | None = shared.epsilon()
    seed: int = shared.seed()


MODELS = (Ggx, Gaussians, Npf, Nbrdf)
