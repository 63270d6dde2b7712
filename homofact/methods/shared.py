"""The settings that several methods share, each declared once; a method lists its settings and their defaults."""

from typing import Any

from homofact.factor.fixed_projections import BOUNDS
from homofact.linear.names import SOLVER_NAMES
from homofact.separable.decomposition_names import MAP_NAMES, SIDES
from homofact.settings.options import MOST_SEED, option

DEFAULT_SMOOTHING = 1e-3
_QUANTIZATIONS = ("none", "png8", "png16")


def textures() -> Any:
    """Declare the maximum number of textures."""
    return option(2, "Maximum number of textures", least=1, everyday=True)


def terms() -> Any:
    """Declare the number of terms, for the methods that add terms."""
    return option(2, "Number of terms", least=1, everyday=True)


def size() -> Any:
    """Declare the texels per side of a texture."""
    return option(16, "Texels per side of a texture", least=2, everyday=True)


def epsilon() -> Any:
    """Declare ε of the log transform; None means the source's ε, or that of noise-free data for bare samples.

    "floor" means the noise floor of the samples (`brdf.quality.noise_floor`).
    """

    def expected(value: float | str) -> str | None:
        return "a number above 0, or floor" if isinstance(value, str) and value != "floor" else None

    return option(
        None, "ε of the log transform, as a multiple of the mean; floor uses the noise of the darkest samples",
        above=0, none="depends on the source", metavar="NUMBER", expected_instead=expected,
    )  # fmt: skip


def reciprocal() -> Any:
    """Declare whether f(ωi, ωo) = f(ωo, ωi) is enforced (thesis 3.2.3)."""
    return option(True, "Enforce f(wi, wo) = f(wo, wi)")


def coordinates(usual: str) -> Any:
    """Declare the coordinates of the searched projections, or of the sides of a matrix."""
    return option(usual, "Coordinates that index the textures", choices=SIDES)


def solver() -> Any:
    """Declare the linear solver of the inner problem, a name in `linear.solvers.SOLVERS`."""
    return option(SOLVER_NAMES[0], "Linear solver of the inner problem", choices=SOLVER_NAMES)


def smoothing(usual: float | None) -> Any:
    """Declare λ of the Laplacian, in units of samples per texel; None if it is chosen from the data."""
    return option(usual, "λ, the weight of the Laplacian, in samples per texel", least=0, none="found from the data")


def restarts() -> Any:
    """Declare the number of random starts of the search for each term."""
    return option(6, "Random starts of the search for each texture", least=1)


def budget() -> Any:
    """Declare the time limit of a search in seconds; None means no limit."""
    return option(
        None,
        "Time limit of the search. If a fit reaches it, the fit is not reproducible",
        unit="seconds",
        above=0,
        none="none",
    )


def search_size(usual: int) -> Any:
    """Declare the texels per side in the coarse search, at most `size`; 0 is the full size."""

    def expected(value: int) -> str | None:
        return "0 (the full size) or at least 2" if value < 0 or value == 1 else None

    return option(usual, "Texels per side during the search; 0 for the full size", expected_instead=expected)


def search_samples() -> Any:
    """Declare the number of samples in the coarse search; 0 means all."""
    return option(8000, "Number of samples during the search; 0 for all", least=0)


def copies() -> Any:
    """Declare the azimuth copies of isotropic samples, if a projection depends on azimuth; 1 makes no copies."""
    return option(8, "Azimuth copies of an isotropic measurement, if a projection depends on azimuth", least=1)


def mirrored() -> Any:
    """Declare whether mirrored copies are added to the azimuth copies."""
    return option(True, "Also add mirrored copies")


def bound() -> Any:
    """Declare how a projection is scaled to its texture, by the "disc" or the thesis's 4-"cube"."""
    return option("disc", "Scaling of a projection to its texture", choices=BOUNDS)


def robust() -> Any:
    """Declare whether outliers are removed before the samples are used (`brdf.quality.outliers`)."""
    return option(False, "Leave out outliers: samples far from all their neighbours")


def confidence() -> Any:
    """Declare whether the standard deviation of every texel is stored with the textures (`factor.confidence`)."""
    return option(False, "Save the standard deviation of every texel with the textures")


def quantize() -> Any:
    """Declare 8-bit or 16-bit texels, which the fit then optimizes (`factor.quantize`), or "none"."""
    return option("none", "Fit texels that png8 or png16 store exactly", choices=_QUANTIZATIONS)


def spectral_tolerance() -> Any:
    """Declare the largest mean CIEDE2000 of a spectral basis (`factor.spectral_choice`); None keeps all bands."""
    return option(
        None, "Store a spectrum by few basis vectors: as many as keep its mean CIEDE2000 to the fit of all bands within"
        " this under D65, A and F11", above=0, none="all bands are stored", metavar="DELTA-E",
    )  # fmt: skip


def direction_map() -> Any:
    """Declare the map of directions to the textures of a separable fit."""
    return option("parabolic", "Map of directions to textures", choices=MAP_NAMES)


def seed() -> Any:
    """Declare the seed of every random choice in the fit."""
    return option(0, "Seed of every random choice", least=0, most=MOST_SEED)
