"""A method of a user: a function that fits samples, to be compared with the methods of this package."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from homofact.errors import BadInput
from homofact.methods.method import Method

if TYPE_CHECKING:
    from homofact.brdf.samples import Samples


@dataclass(frozen=True, kw_only=True)
class OwnMethod(Method):
    """A method of your own, for `homofact.compare` beside the others.

    Parameters
    ----------
    function : callable
        Called with the training samples (`homofact.Samples`) and the seed. It returns a function f(wi, wo) of unit
        vectors (N, 3), with values (N, C) in sr⁻¹ without the cosine, or a reflectance.
    nbytes, fetches : int, optional
        Bytes and texture lookups of one evaluation, for tables.
    epsilon : float, optional
        ε of the logarithms by which errors are measured. Default: the source's.
    seed : int, optional
        Given to the function; `compare` sets it.

    Raises
    ------
    BadInput
        For a function that cannot be called.

    Examples
    --------
    >>> def lambert(samples, seed):
    ...     mean = samples.values.mean(0).numpy()
    ...     return lambda wi, wo: 0 * wi[:, :1] + mean
    >>> ours = homofact.OwnMethod(function=lambert, nbytes=12)
    >>> found = homofact.compare("material:lafortune-clay", {"ours": ours, "mccool": homofact.McCool(size=4)})
    >>> list(found.rows)
    ['ours', 'mccool']
    """

    name: ClassVar[str] = "own"
    implementation: ClassVar[str] = "homofact.methods.own_fit:fit_own"
    size = 0

    function: Callable[["Samples", int], Any]
    nbytes: int = 0
    fetches: int = 0
    epsilon: float | str | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the function."""
        if not callable(self.function):
            raise BadInput(where="function", found=repr(self.function), expected="a function of samples and a seed")

    @property
    def most_textures(self) -> int:
        """0: such a fit has no textures."""
        return 0
