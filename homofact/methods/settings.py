"""What a fit may be told: one frozen set of settings, checked when it is made."""

from dataclasses import dataclass

from homofact.errors import BadInput
from homofact.factor.projection import BOUNDS
from homofact.linear.solvers import SOLVERS

REFINEMENTS = ("none", "looks")
VALIDATIONS = ("rings", "random")
QUANTIZATIONS = ("none", "png8", "png16")
MAPS = ("parabolic", "orthographic", "polar")
DECOMPOSITIONS = ("eigen", "svd", "power", "normalized")
DEFAULT_SMOOTHING = 1e-3


@dataclass(frozen=True)
class FitSettings:
    """Settings of one fit. A method ignores what it has no use for.

    Attributes
    ----------
    method : name of the method ("search", "cole", "mccool", "svd", "nmf").
    textures : how many textures at most; McCool's own list has two. For `svd` and `nmf` the number of terms.
    size : texels on a side of a texture.
    epsilon : ε of the log transform; None takes the source's default.
    parameterization : for `cole` the coordinates that a projection acts on ("in-out" or "half-diff", None is
        half-diff), as for `svd` (None is in-out) and `nmf` (half-diff); for `search` the kind of every texture,
        or of each one joined by "+" (None: it chooses).
    reciprocal : enforce reciprocity through the conjugate projections (thesis 3.2.3).
    solver : linear solver of the inner problem, a name in `linear.solvers.SOLVERS`.
    smoothing : λ of the Laplacian, in units of samples a texel; None is found from the data by `search`,
        and 1e-3 elsewhere.
    together : how many of the last terms are solved together; 0 is all of them (thesis 3.2.2: 2).
    restarts : random starts of the search for each term.
    search : how `search` refines projections: "gradient", "powell", or "nlopt-" and an nlopt algorithm's name.
    validation : how `search` judges a mix and λ on measurements that lie on rings of θ: by left-out "rings", or at
        "random", which rewards the faults of each ring. Other samples are left out at random.
    budget : seconds that `search` may take, but for its last solve.
    refine : "none", or "looks" for a last descent on the linear, cosine-weighted error.
    search_size, search_samples : size and sample count of the coarse search; 0 is the full one. The size's None
        is 16 for `search` and 12 for `cole`.
    copies, mirrored : azimuth copies of isotropic measurements, and whether mirrored ones stand beside them.
    bound : how a projection is scaled to its texture, by the "disc" or the thesis's 4-"cube".
    map : direction map of `svd` and `nmf`: "parabolic", "orthographic" or "polar".
    decomposition : how `svd` finds its terms: "eigen", "svd", "power", or "normalized" (one term, never negative); None
        is "eigen" for a reciprocal in-out fit and "svd" elsewhere.
    projections : fixed projections by name for `mccool`; empty is McCool's own list.
    robust : give outliers little weight in the last solve (Huber's weights, `linear.robust`).
    confidence : leave the standard deviation of every texel with the textures (`factor.confidence`).
    quantize : "none", or "png8" or "png16": texels that 8 or 16 bits hold exactly, the best of these
        (`factor.quantize`).
    seed : of every random choice in the fit.
    """

    method: str = "search"
    textures: int = 2
    size: int = 16
    epsilon: float | None = None
    parameterization: str | None = None
    reciprocal: bool = True
    solver: str = "cholesky"
    smoothing: float | None = None
    together: int = 2
    restarts: int = 6
    search: str = "gradient"
    validation: str = "rings"
    effort: str | float = "normal"
    budget: float | None = None
    refine: str = "none"
    search_size: int | None = None
    search_samples: int = 8000
    copies: int = 8
    mirrored: bool = True
    bound: str = "disc"
    projections: tuple[str, ...] = ()
    map: str = "parabolic"
    decomposition: str | None = None
    robust: bool = False
    confidence: bool = False
    quantize: str = "none"
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse what cannot be meant, naming the setting, what was found and what is expected."""
        for name, least in (
            ("textures", 1),
            ("size", 2),
            ("together", 0),
            ("restarts", 1),
            ("search_samples", 0),
            ("copies", 1),
            ("seed", 0),
        ):
            value = getattr(self, name)
            if not isinstance(value, int) or value < least:
                raise BadInput(f"{name}: found {value!r}, expected a whole number of at least {least}")
        if self.epsilon is not None and not 0 < self.epsilon < float("inf"):
            raise BadInput(f"epsilon: found {self.epsilon!r}, expected a number above 0")
        if self.smoothing is not None and not 0 <= self.smoothing < float("inf"):
            raise BadInput(f"smoothing: found {self.smoothing!r}, expected a number of at least 0")
        if self.budget is not None and not 0 < self.budget < float("inf"):
            raise BadInput(f"budget: found {self.budget!r}, expected seconds above 0")
        if self.search_size is not None and (self.search_size < 0 or self.search_size == 1):
            raise BadInput(f"search_size: found {self.search_size}, expected 0 (the full size) or at least 2")
        for name, value, known in (
            ("refine", self.refine, REFINEMENTS),
            ("validation", self.validation, VALIDATIONS),
            ("quantize", self.quantize, QUANTIZATIONS),
            ("solver", self.solver, tuple(SOLVERS)),
            ("bound", self.bound, BOUNDS),
            ("map", self.map, MAPS),
            ("decomposition", DECOMPOSITIONS[0] if self.decomposition is None else self.decomposition, DECOMPOSITIONS),
        ):
            if value not in known:
                raise BadInput(f"{name}: found {value!r}, expected one of {', '.join(known)}")

    def coarse_size(self, usual: int) -> int:
        """Texels a side in a coarse search, never above `size`; `usual` where the settings do not say."""
        wanted = usual if self.search_size is None else self.search_size
        return self.size if wanted == 0 else min(self.size, wanted)

    @property
    def fixed_smoothing(self) -> float:
        """λ for the methods that do not look for it."""
        return DEFAULT_SMOOTHING if self.smoothing is None else self.smoothing
