"""The ladder of representations, from one colour to five textures, and how each is fitted.

Bytes are the material's own, as float32. The 9 terms of "lambert-9" belong to the lighting (108 bytes in three
channels, once a scene); it stores the same colour as "constant" and saves the sum over the lights.
"""

from dataclasses import dataclass, field, replace

from homofact.brdf.source import Source
from homofact.evaluate.compare import HELD_OUT
from homofact.methods.fitting import Fit, Method, ProgressCallback
from homofact.methods.mccool import McCool
from homofact.methods.search import Search
from homofact.methods.svd import Svd

CONSTANT, LAMBERT = "constant", "lambert-9"
COLOURS = (CONSTANT, LAMBERT)
SIZES = (8, 16, 32)
SEARCH_SIZES = (4, 8, 16, 32)
SEARCH_TEXTURES = (1, 2, 3, 5)
SVD_TERMS = (1, 2, 5)
MCCOOL_TEXTURES = 2
# Of the coarse search: a rung is asked for its error, and most are turned down, so each is to take seconds.
SEARCHED_AT, SEARCHED_FROM = 8, 3000


@dataclass(frozen=True, order=True)
class Candidate:
    """One rung: `method` ("constant", "lambert-9", "mccool", "search", "svd"), `textures` or terms, texels per side."""

    method: str
    textures: int = 0
    size: int = 0

    @property
    def label(self) -> str:
        """As in tables: "search 2 × 16²"."""
        return self.method if self.is_colour else f"{self.method} {self.textures} × {self.size}²"

    @property
    def is_colour(self) -> bool:
        """Whether it is one colour, which takes no fit."""
        return self.method in COLOURS

    def most_bytes(self, channels: int) -> int:
        """Bytes at most: a search may find fewer textures, or flat ones, enough."""
        return 4 * channels * (1 if self.is_colour else self.textures * self.size**2)

    def most_fetches(self, isotropic: bool) -> int:
        """Fetches expected: one a texture, two a term of an SVD or where conjugates are looked up."""
        if self.is_colour:
            return 0
        if self.method == "mccool":
            return 3
        return self.textures * (2 if self.method == "svd" or not isotropic else 1)


@dataclass(frozen=True)
class FitOptions:
    """How the rungs are fitted: effort of a search, its guard in seconds, samples drawn from a model, part held out."""

    effort: str | float = "quick"
    budget: float | None = None
    count: int = 8000
    held_out: float = HELD_OUT
    seed: int = 0
    progress: ProgressCallback | None = field(default=None, compare=False)


LADDER: tuple[Candidate, ...] = (
    *(Candidate(name) for name in COLOURS),
    *(Candidate("mccool", MCCOOL_TEXTURES, size) for size in SIZES),
    *(Candidate("search", count, size) for count in SEARCH_TEXTURES for size in SEARCH_SIZES),
    *(Candidate("svd", count, size) for count in SVD_TERMS for size in SIZES),
)


def ladder(channels: int = 3, isotropic: bool = True) -> tuple[Candidate, ...]:
    """`LADDER` by rising bytes, fetches breaking ties."""
    return tuple(sorted(LADDER, key=lambda each: (each.most_bytes(channels), each.most_fetches(isotropic), each)))


def method_of(candidate: Candidate, options: FitOptions) -> Method:
    """The fit that a rung with textures stands for."""
    if candidate.method == "mccool":
        return McCool(size=candidate.size, seed=options.seed)
    if candidate.method == "svd":
        return Svd(textures=candidate.textures, size=candidate.size, seed=options.seed)
    return Search(
        textures=candidate.textures,
        size=candidate.size,
        effort=options.effort,
        budget=options.budget,
        search_size=SEARCHED_AT,
        search_samples=SEARCHED_FROM,
        seed=options.seed,
    )


def fit_candidate(candidate: Candidate, source: Source, options: FitOptions) -> Fit:
    """Fit a rung with textures to the source's training samples; raises what the method raises."""
    method = replace(method_of(candidate, options), epsilon=source.default_epsilon)
    return method.fit(source.samples.split(options.held_out, options.seed)[0], options.progress)
