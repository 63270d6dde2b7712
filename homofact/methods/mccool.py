"""`McCool`: fixed projections, one linear solve (see `mccool_fit`)."""

from dataclasses import dataclass
from typing import Any, ClassVar

from homofact.factor.fixed_projections import FIXED_PROJECTIONS
from homofact.methods import shared
from homofact.methods.method import Method
from homofact.settings.documented import documented
from homofact.settings.options import option

GRIDS = ("better", "plain", "centred")


def _expected_projections(value: Any) -> str | None:
    return None if value else "at least one"


@documented
@dataclass(frozen=True, kw_only=True)
class McCool(Method):
    """Settings of a fit with fixed projections, with one texture for each name in `projections`.

    The default is the reciprocal product p(ωi) q(h) p(ωo) of McCool, Ang and Ahmad (2001), with the textures wi and h.
    On a "centred" `grid`, a parabolic map of even size n has n + 1 rows of n − 1 texels, with a texel at the normal,
    where the highlight is. On a "plain" `grid`, the normal lies between four texels. "better" uses the grid with the
    smaller error on the training samples.

    Examples
    --------
    >>> homofact.McCool(size=8).projections
    ('wi', 'h')
    """

    name: ClassVar[str] = "mccool"
    implementation: ClassVar[str] = "homofact.methods.mccool_fit:fit_mccool"
    on_devices = True

    projections: tuple[str, ...] = option(
        ("wi", "h"), "Fixed projections, one per texture, joined by +", choices=FIXED_PROJECTIONS, separators="+,",
        metavar="A+B", expected_instead=_expected_projections,
    )  # fmt: skip
    size: int = shared.size()
    grid: str = option(
        "better",
        "Grid of parabolic maps: with a texel in the middle (centred), without one (plain), or the one"
        " with the smaller error (better)",
        choices=GRIDS,
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
    spectral_tolerance: float | None = shared.spectral_tolerance()
    seed: int = shared.seed()

    @property
    def most_textures(self) -> int:
        """One for every projection."""
        return len(self.projections)
