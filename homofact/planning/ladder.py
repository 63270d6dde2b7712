"""The ladder of representations, from one colour and GGX models to five textures, and how each is fitted.

Every fit with textures has two rungs: with float32 texels, and with 8-bit texels ("png8", as `homofact export` writes
them), which need no second fit. A model has no texels. Bytes count only the data of the material: 4 or 1 per channel of
a texel, 4 per parameter of a model. The 9 terms of "lambert-9" belong to the lighting (108 bytes for three channels,
once per scene). "lambert-9" stores the same colour as "constant" and saves the sum over the lights at run time.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from homofact.brdf.source import Source
from homofact.brdf.source_names import HELD_OUT
from homofact.evaluation.wording import counted
from homofact.methods.fitting import MethodFit, ProgressCallback
from homofact.methods.mccool import McCool
from homofact.methods.method import Method
from homofact.methods.models import Ggx
from homofact.methods.search import Search
from homofact.methods.svd import Svd
from homofact.planning.settings import PlanSettings

CONSTANT, LAMBERT = "constant", "lambert-9"
ONE_COLOUR = "one colour"
COLOURS = (CONSTANT, LAMBERT)
FLOATS, WHOLE = "float32", "png8"
STORAGES = (WHOLE, FLOATS)
SIZES = (8, 16, 32)
SEARCH_SIZES = (4, 8, 16, 32)
# A search of two textures of 64² takes 85 s, an SVD of that size 65 s: too long for a rung that is mostly turned down.
LARGE = (("mccool", 2, 64), ("search", 1, 64))
SEARCH_TEXTURES = (1, 2, 3, 5)
SVD_TERMS = (1, 2, 5)
MCCOOL_TEXTURES = 2
# Of the coarse search: a rung is asked for its error, and most are turned down, so each is to take seconds.
SEARCHED_AT, SEARCHED_FROM = 8, 3000


@dataclass(frozen=True, order=True)
class Candidate:
    """One rung: `method` ("constant", "lambert-9", "ggx", "ggx:2", "mccool", "search", "svd"), `textures` or terms,
    texels per side.

    `storage` is "float32" or "png8".
    """

    method: str
    textures: int = 0
    size: int = 0
    storage: str = FLOATS

    @property
    def label(self) -> str:
        """Return the name for records: "search 2 × 16²", "search 2 × 16², 8 bits"."""
        if not self.textures:
            return self.method
        bits = ", 8 bits" if self.storage == WHOLE else ""
        return f"{self.method} {self.textures} × {self.size}²{bits}"

    @property
    def words(self) -> str:
        """Return the name for users: "one colour", "GGX model, 1 lobe", "2 textures of 16², 8 bits (search)"."""
        if self.is_colour:
            return ONE_COLOUR
        if self.lobes:
            return f"GGX model, {counted(self.lobes, 'lobe')}"
        bits = "8 bits" if self.storage == WHOLE else "floats"
        unit = "term" if self.method == "svd" else "texture"
        return f"{counted(self.textures, unit)} of {self.size}², {bits} ({self.method})"

    @property
    def fit(self) -> "Candidate":
        """Return the rung of its underlying fit: the same with float texels."""
        return replace(self, storage=FLOATS)

    @property
    def texel_bytes(self) -> int:
        """Return the bytes of one channel of a texel."""
        return 1 if self.storage == WHOLE else 4

    @property
    def is_colour(self) -> bool:
        """Whether it is one colour, which takes no fit."""
        return self.method in COLOURS

    @property
    def family(self) -> str:
        """The method without its number of lobes: "ggx" of "ggx:2"."""
        return self.method.partition(":")[0]

    @property
    def lobes(self) -> int:
        """Lobes of a GGX model; 0 of any other rung."""
        return int(self.method.partition(":")[2] or 1) if self.family == Ggx.name else 0

    def most_bytes(self, channels: int) -> int:
        """Return the most bytes; a search may need fewer, if fewer or constant textures are enough."""
        if self.lobes:
            # A diffuse colour, and of each lobe a colour, its roughness and its reflectance.
            return self.texel_bytes * (channels + self.lobes * (channels + 2))
        return self.texel_bytes * channels * (1 if self.is_colour else self.textures * self.size**2)

    def most_fetches(self, isotropic: bool) -> int:
        """Return the expected fetches: one per texture, two per SVD term or if conjugates are looked up."""
        if not self.textures:
            return 0
        if self.method == "mccool":
            return 3
        return self.textures * (2 if self.method == "svd" or not isotropic else 1)


@dataclass(frozen=True)
class FitOptions(PlanSettings):
    """How the rungs are fitted: `held_out` is the share of held-out samples."""

    held_out: float = HELD_OUT
    seed: int = 0
    progress: ProgressCallback | None = field(default=None, compare=False)


MODELS: tuple[Candidate, ...] = (Candidate("ggx"), Candidate("ggx:2"))
FITS: tuple[Candidate, ...] = (
    *(Candidate("mccool", MCCOOL_TEXTURES, size) for size in SIZES),
    *(Candidate("search", count, size) for count in SEARCH_TEXTURES for size in SEARCH_SIZES),
    *(Candidate("svd", count, size) for count in SVD_TERMS for size in SIZES),
    *(Candidate(*facts) for facts in LARGE),
)
LADDER: tuple[Candidate, ...] = (
    *(Candidate(name) for name in COLOURS),
    *MODELS,
    *(replace(candidate, storage=storage) for candidate in FITS for storage in STORAGES),
)


def ladder(channels: int = 3, isotropic: bool = True) -> tuple[Candidate, ...]:
    """Return `LADDER` by rising bytes, fetches breaking ties."""
    return tuple(sorted(LADDER, key=lambda rung: (rung.most_bytes(channels), rung.most_fetches(isotropic), rung)))


def fits_among(candidates: Iterable[Candidate]) -> int:
    """Return how many fits these rungs take."""
    return len({candidate.fit for candidate in candidates if not candidate.is_colour})


def method_of(candidate: Candidate, options: FitOptions, epsilon: float | None = None) -> Method:
    """Return the method that fits a rung, any but one colour, with the source's ε."""
    size, shared = candidate.size, {"seed": options.seed, "epsilon": epsilon}
    if candidate.lobes:
        return Ggx(lobes=candidate.lobes, **shared)
    if candidate.method == "mccool":
        return McCool(size=size, **shared)
    if candidate.method == "svd":
        return Svd(textures=candidate.textures, size=size, **shared)
    searched = {"search_size": SEARCHED_AT, "search_samples": SEARCHED_FROM}
    effort = {"effort": options.effort, "budget": options.budget}
    return Search(textures=candidate.textures, size=size, **effort, **searched, **shared)


def fit_candidate(candidate: Candidate, source: Source, options: FitOptions) -> MethodFit:
    """Fit a rung to the source's training samples, texels as floats; raises what the method raises."""
    method = method_of(candidate, options, source.default_epsilon)
    return method.fit(source.samples.split(options.held_out, options.seed)[0], options.progress)
