"""The settings that several methods share, each declared once; a method lists its settings and their defaults."""

from typing import Any

from homofact.factor.fixed_projections import BOUNDS
from homofact.linear.names import SOLVER_NAMES
from homofact.separable.decomposition_names import MAP_NAMES, SIDES
from homofact.settings.options import MOST_SEED, option

DEFAULT_SMOOTHING = 1e-3
_QUANTIZATIONS = ("none", "png8", "png16")


def textures() -> Any:
    """Return how many textures at most."""
    return option(2, "Maximum number of textures", least=1, everyday=True)


def terms() -> Any:
    """Return how many terms, for the methods that add them."""
    return option(2, "Number of terms", least=1, everyday=True)


def size() -> Any:
    """Return texels per side of a texture."""
    return option(16, "Texels per side of a texture", least=2, everyday=True)


def epsilon() -> Any:
    """Return ε of the log transform; None takes the source's own, or that of noise-free data for bare samples.

    "floor" takes the noise floor of the samples (`brdf.quality.noise_floor`).
    """

    def expected(value: float | str) -> str | None:
        return "a number above 0, or floor" if isinstance(value, str) and value != "floor" else None

    return option(
        None, "ε of the log transform, as a multiple of the mean; floor uses the noise of the darkest samples",
        above=0, none="depends on the source", metavar="NUMBER", expected_instead=expected,
    )  # fmt: skip


def reciprocal() -> Any:
    """Return whether f(ωi, ωo) = f(ωo, ωi) is enforced (thesis 3.2.3)."""
    return option(True, "Enforce f(wi, wo) = f(wo, wi)")


def coordinates(usual: str) -> Any:
    """Return the numbers of a pair of directions that searched projections, or the sides of a matrix, are made of."""
    return option(usual, "Coordinates that index the textures", choices=SIDES)


def solver() -> Any:
    """Return linear solver of the inner problem, a name in `linear.solvers.SOLVERS`."""
    return option(SOLVER_NAMES[0], "Linear solver of the inner problem", choices=SOLVER_NAMES)


def smoothing(usual: float | None) -> Any:
    """Declare λ of the Laplacian, in units of samples per texel; None if it is chosen from the data."""
    return option(usual, "λ, the weight of the Laplacian, in samples per texel", least=0, none="found from the data")


def restarts() -> Any:
    """Random starts of the search for each term."""
    return option(6, "Random starts of the search for each texture", least=1)


def budget() -> Any:
    """Return seconds after which a search ends with what it has: a guard, None is none."""
    return option(
        None,
        "Time limit of the search. If a fit reaches it, the fit is not reproducible",
        unit="seconds",
        above=0,
        none="none",
    )


def search_size(usual: int) -> Any:
    """Return texels per side in the coarse search, at most `size`; 0 is the full size."""

    def expected(value: int) -> str | None:
        return "0 (the full size) or at least 2" if value < 0 or value == 1 else None

    return option(usual, "Texels per side during the search; 0 for the full size", expected_instead=expected)


def search_samples() -> Any:
    """Return samples in the coarse search; 0 is all."""
    return option(8000, "Number of samples during the search; 0 for all", least=0)


def copies() -> Any:
    """Azimuth copies of isotropic measurements where a projection knows the azimuth; 1 leaves them as they are."""
    return option(8, "Azimuth copies of an isotropic measurement, if a projection depends on azimuth", least=1)


def mirrored() -> Any:
    """Declare whether mirrored copies are added to the azimuth copies."""
    return option(True, "Also add mirrored copies")


def bound() -> Any:
    """Return how a projection is scaled to its texture, by the "disc" or the thesis's 4-"cube"."""
    return option("disc", "Scaling of a projection to its texture", choices=BOUNDS)


def robust() -> Any:
    """Return whether gross errors are left out before anything is made of the samples (`brdf.quality.outliers`)."""
    return option(False, "Leave out outliers: samples far from all their neighbours")


def confidence() -> Any:
    """Return whether the standard deviation of every texel is left with the textures (`factor.confidence`)."""
    return option(False, "Save the standard deviation of every texel with the textures")


def quantize() -> Any:
    """Return texels that 8 or 16 bits hold exactly, the best of these (`factor.quantize`), or "none"."""
    return option("none", "Fit texels that png8 or png16 store exactly", choices=_QUANTIZATIONS)


def spectral_tolerance() -> Any:
    """Return the mean CIEDE2000 that a spectral basis may leave (`factor.spectral_choice`); None keeps all bands."""
    return option(
        None, "Store a spectrum by few basis vectors: as many as keep its mean CIEDE2000 to the fit of all bands within"
        " this under D65, A and F11", above=0, none="all bands are stored", metavar="DELTA-E",
    )  # fmt: skip


def direction_map() -> Any:
    """Return the map of directions to the textures of a separable fit."""
    return option("parabolic", "Map of directions to textures", choices=MAP_NAMES)


def seed() -> Any:
    """Declare the seed of every random choice in the fit."""
    return option(0, "Seed of every random choice", least=0, most=MOST_SEED)
