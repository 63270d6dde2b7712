"""`Cole`: the procedure of the thesis, terms one by one (see `cole_fit`)."""

from dataclasses import dataclass
from typing import ClassVar

from homofact.errors import BadInput
from homofact.methods import shared
from homofact.methods.method import Method
from homofact.settings.documented import documented
from homofact.settings.options import option


@documented
@dataclass(frozen=True, kw_only=True)
class Cole(Method):
    """Settings of the thesis's procedure.

    Projections are searched on `coordinates`, one term at a time. After each new term, the last `joint_terms` terms are
    solved jointly (thesis 3.2.2: 2); 0 means all terms.

    Examples
    --------
    >>> homofact.Cole(textures=3).joint_terms
    2
    """

    name: ClassVar[str] = "cole"
    implementation: ClassVar[str] = "homofact.methods.cole_fit:fit_cole"
    on_devices = True

    textures: int = shared.textures()
    size: int = shared.size()
    epsilon: float | str | None = shared.epsilon()
    coordinates: str = shared.coordinates("half-diff")
    reciprocal: bool = shared.reciprocal()
    solver: str = shared.solver()
    smoothing: float = shared.smoothing(shared.DEFAULT_SMOOTHING)
    joint_terms: int = option(2, "Number of last textures to solve jointly; 0 for all", least=0)
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
    spectral_tolerance: float | None = shared.spectral_tolerance()
    seed: int = shared.seed()

    def __post_init__(self) -> None:
        """Check the settings. Raises BadInput naming the setting, what was found and what is expected."""
        super().__post_init__()
        if self.confidence and 0 < self.joint_terms < self.textures:
            raise BadInput(
                where="confidence",
                found=f"joint_terms {self.joint_terms} for {self.textures} textures with it",
                expected="0 (all at once)",
            )

    @property
    def most_textures(self) -> int:
        """How many there are."""
        return self.textures
