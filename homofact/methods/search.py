"""`Search`: mix, projections, warp and λ found from the data (see `search_fit`)."""

from dataclasses import dataclass
from typing import Any, ClassVar

from homofact.errors import BadInput
from homofact.factor.fixed_projections import KINDS
from homofact.factor.search.algorithms import expected_search
from homofact.methods import shared
from homofact.methods.method import Method
from homofact.settings.documented import documented
from homofact.settings.options import nearest, option

_OBJECTIVES = ("both", "log", "energy")
_VALIDATIONS = ("rings", "random")
_MOST_TEXTURES = 3  # that a number of bytes is spent on, unless `textures` is more
_EFFORTS = ("quick", "normal", "thorough")


def _expected_effort(value: Any) -> str | None:
    if value in _EFFORTS or (not isinstance(value, str) and value > 0):
        return None
    near = nearest(value, _EFFORTS) if isinstance(value, str) else ""
    return f"{', '.join(_EFFORTS)}, or a number above 0{f' ({near})' if near else ''}"


@documented
@dataclass(frozen=True, kw_only=True)
class Search(Method):
    """Settings of the searched fit.

    `projections` sets the projections of the textures, one name for all or one per texture: a fixed projection, or
    coordinates on which a projection is searched. If it is None, the fit chooses them. `search` refines projections:
    "gradient", "powell", or "nlopt-" and an nlopt algorithm's name. `validation` selects how mixes and λ are judged on
    measurements that lie on rings of θ: by left-out "rings", or by "random" samples, which favours fits that reproduce
    the faults of each ring. `effort` limits the search: "quick" and "normal" descend from the best one or three of the
    mixes that often win (`known_mixes`); "thorough" and a number of equivalent inner evaluations try every mix.
    `budget` is a time limit in seconds. If `reciprocal` is None, the fit is reciprocal unless the data are clearly
    fitted better without it, and always if `projections` are set. `objective` is the error to minimize: squared logs
    ("log", the thesis's error), the divergence of flux ("energy"), or both. `bytes` replaces `size`: the textures are
    as large as the bytes allow, and cross-validation chooses their shapes.

    Examples
    --------
    >>> homofact.Search(bytes=4096).most_textures
    3
    """

    name: ClassVar[str] = "search"
    implementation: ClassVar[str] = "homofact.methods.search_fit:fit_search"
    on_devices = True

    textures: int = shared.textures()
    size: int = shared.size()
    epsilon: float | str | None = shared.epsilon()
    projections: tuple[str, ...] | None = option(
        None, "Projections that index the textures: one name for all, or one per texture, joined by +",
        choices=KINDS, separators="+,",
        none="found from the data", metavar="A+B",
    )  # fmt: skip
    bytes: int | None = option(
        None,
        "Bytes of all textures as float32, instead of a size. The"
        " search then chooses up to three textures, or more if you allow more, with their rows and columns",
        above=0, none="given by the number of textures and their size", everyday=True,
    )  # fmt: skip
    reciprocal: bool | None = option(None, "Enforce f(wi, wo) = f(wo, wi)", none="decided by the data")
    solver: str = shared.solver()
    smoothing: float | None = shared.smoothing(None)
    restarts: int = shared.restarts()
    search: str = option(
        "gradient",
        "Optimizer of the projections: gradient, powell, or nlopt-NAME such as nlopt-PRAXIS",
        expected_instead=expected_search,
    )
    validation: str = option(
        "rings", "Samples to validate on: left-out rings of a goniometer, or random samples", choices=_VALIDATIONS
    )
    effort: str | float = option(
        "normal",
        "Search effort. quick and normal try only projections that were best for many other materials; thorough, or"
        " a number of evaluations, tries all",
        expected_instead=_expected_effort,
        everyday=True,
    )
    budget: float | None = shared.budget()
    objective: str = option("both", "Errors to minimize: of logarithms, of energy, or both", choices=_OBJECTIVES)
    # Measured data judged on 12² textures picks other mixes than on 16².
    search_size: int = shared.search_size(16)
    search_samples: int = shared.search_samples()
    copies: int = shared.copies()
    mirrored: bool = shared.mirrored()
    bound: str = shared.bound()
    robust: bool = shared.robust()
    confidence: bool = shared.confidence()
    quantize: str = shared.quantize()
    spectral_tolerance: float | None = shared.spectral_tolerance()
    seed: int = shared.seed()

    def __post_init__(self) -> None:
        """Check the settings. Raises BadInput naming the setting, what was found and what is expected."""
        super().__post_init__()
        if self.projections is not None and len(self.projections) not in (1, self.textures):
            raise BadInput(
                where="projections",
                found=f"{len(self.projections)} for {self.textures} textures",
                expected="one, or one each",
            )
        if self.bytes is not None and self.projections is not None:
            raise BadInput(
                where="bytes", found="it beside projections", expected="one of them: the search chooses the mix"
            )

    @property
    def most_textures(self) -> int:
        """The maximum number of textures: `textures`, but at least three if `bytes` is set."""
        return self.textures if self.bytes is None else max(self.textures, _MOST_TEXTURES)
