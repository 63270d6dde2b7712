"""`Cole`: the procedure of the thesis, terms one by one (see `cole_fit`)."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from homofact.errors import BadInput
from homofact.methods import shared
from homofact.options import check_options, option

if TYPE_CHECKING:
    from homofact.brdf.samples import Samples
    from homofact.methods.fitting import Fit, ProgressCallback


@dataclass(frozen=True, kw_only=True)
class Cole:
    """Settings of the thesis's procedure.

    Projections are searched on `coordinates`, a term at a time; as each arrives, the last `joint_terms` are solved
    jointly (thesis 3.2.2: 2), 0 being all of them.
    """

    name: ClassVar[str] = "cole"

    textures: int = shared.textures()
    size: int = shared.size()
    epsilon: float | str | None = shared.epsilon()
    coordinates: str = shared.coordinates("half-diff")
    reciprocal: bool = shared.reciprocal()
    solver: str = shared.solver()
    smoothing: float = shared.smoothing(shared.DEFAULT_SMOOTHING)
    joint_terms: int = option(2, "How many of the last textures are solved jointly; 0 is all", least=0)
    restarts: int = shared.restarts()
    budget: float | None = shared.budget()
    search_size: int = shared.search_size(12)
    search_samples: int = shared.search_samples()
    copies: int = shared.copies()
    mirrored: bool = shared.mirrored()
    bound: str = shared.bound()
    robust: bool = shared.robust()
    confidence: bool = shared.confidence()
    quantize: str = shared.quantize()
    seed: int = shared.seed()

    def __post_init__(self) -> None:
        """Refuse what cannot be meant. Raises BadInput naming the setting, what was found and what is expected."""
        check_options(self)
        if self.confidence and 0 < self.joint_terms < self.textures:
            raise BadInput(
                f"confidence: found joint_terms {self.joint_terms} for {self.textures} textures with it,"
                " expected 0 (all at once)"
            )

    def fit(self, samples: "Samples", progress: "ProgressCallback | None" = None) -> "Fit":
        """Factor `samples`, the training samples as measured. An interrupt or the guard keeps what is found."""
        from homofact.methods.cole_fit import fit_cole
        from homofact.methods.fitting import with_whole_texels

        return with_whole_texels(fit_cole(samples, self, progress), samples, self)
