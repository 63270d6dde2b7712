"""`McCool`: fixed projections, one linear solve (see `mccool_fit`)."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from homofact.factor.names import FIXED_PROJECTIONS
from homofact.methods import shared
from homofact.options import check_options, option

if TYPE_CHECKING:
    from homofact.brdf.samples import Samples
    from homofact.methods.fitting import Fit, ProgressCallback

GRIDS = ("better", "plain", "centred")


def _expected_projections(value: Any) -> str | None:
    return None if value else "at least one"


@dataclass(frozen=True, kw_only=True)
class McCool:
    """Settings of a fit with fixed projections: how many textures there are is how many `projections` are named.

    The usual list is that of McCool, Ang and Ahmad 2001: p(ωi) q(h) p(ωo), reciprocal, has the textures wi and h.
    On a `grid` that is "centred" a parabolic map of an even size n has n + 1 rows of n − 1 texels, and a texel at the
    normal, where the highlight is; on a "plain" one it lies between four. "better" takes the one that is nearer to the
    training samples.
    """

    name: ClassVar[str] = "mccool"

    projections: tuple[str, ...] = option(
        ("wi", "h"), "The fixed projections, joined by +, one a texture", choices=FIXED_PROJECTIONS, separators="+,",
        metavar="A+B", expected_instead=_expected_projections,
    )  # fmt: skip
    size: int = shared.size()
    grid: str = option(
        "better", "Where texels of parabolic maps lie: a texel in the middle, none, or what comes nearer", choices=GRIDS
    )
    epsilon: float | str | None = shared.epsilon()
    reciprocal: bool = shared.reciprocal()
    solver: str = shared.solver()
    smoothing: float = shared.smoothing(shared.DEFAULT_SMOOTHING)
    copies: int = shared.copies()
    mirrored: bool = shared.mirrored()
    robust: bool = shared.robust()
    confidence: bool = shared.confidence()
    quantize: str = shared.quantize()
    seed: int = shared.seed()

    def __post_init__(self) -> None:
        """Refuse what cannot be meant. Raises BadInput naming the setting, what was found and what is expected."""
        check_options(self)

    def fit(self, samples: "Samples", progress: "ProgressCallback | None" = None) -> "Fit":
        """Factor `samples`, the training samples as measured; one solve, so `progress` is never called."""
        from homofact.methods.fitting import with_whole_texels
        from homofact.methods.mccool_fit import fit_mccool

        return with_whole_texels(fit_mccool(samples, self), samples, self)
