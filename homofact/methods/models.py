"""Well-known models, fitted for comparison: `Ggx`, `Gaussians`, `Npf` and `Nbrdf` have no textures."""

from dataclasses import dataclass
from typing import ClassVar

from homofact.methods import shared
from homofact.methods.method import Method
from homofact.settings.documented import documented
from homofact.settings.options import option


class _Model(Method):
    """Base class of the models, which have no texels."""

    implementation: ClassVar[str] = "homofact.methods.model_fits:fit_model"
    size = 0

    @property
    def most_textures(self) -> int:
        """0."""
        return 0


@documented
@dataclass(frozen=True, kw_only=True)
class Ggx(_Model):
    """Microfacets of Walter et al. 2007 over a diffuse base: 8 numbers with one lobe, 13 with two.

    Examples
    --------
    >>> homofact.Ggx(lobes=2).lobes
    2
    """

    name: ClassVar[str] = "ggx"

    lobes: int = option(1, "Number of lobes over the diffuse base", least=1, most=4)
    epsilon: float | str | None = shared.epsilon()
    seed: int = shared.seed()


@documented
@dataclass(frozen=True, kw_only=True)
class Gaussians(_Model):
    """Spherical Gaussians over a diffuse base (Wang et al. 2009): 16 numbers with three.

    Examples
    --------
    >>> homofact.Gaussians().lobes
    3
    """

    name: ClassVar[str] = "gaussians"

    lobes: int = option(3, "Number of lobes over the diffuse base", least=1, most=4)
    epsilon: float | str | None = shared.epsilon()
    seed: int = shared.seed()


@documented
@dataclass(frozen=True, kw_only=True)
class Npf(_Model):
    """The non-parametric factors of Bagher et al. 2016: 272 numbers per channel.

    Examples
    --------
    >>> homofact.Npf().most_textures
    0
    """

    name: ClassVar[str] = "npf"

    epsilon: float | str | None = shared.epsilon()
    seed: int = shared.seed()


@documented
@dataclass(frozen=True, kw_only=True)
class Nbrdf(_Model):
    """The network of Sztrajman et al. 2021, 675 weights, for materials of three channels.

    Examples
    --------
    >>> homofact.Nbrdf(steps=200).steps
    200
    """

    name: ClassVar[str] = "nbrdf"

    steps: int = option(20_000, "Number of training steps, of 512 pairs each", least=1, most=10**7)
    epsilon: float | str | None = shared.epsilon()
    seed: int = shared.seed()


MODELS = (Ggx, Gaussians, Npf, Nbrdf)
