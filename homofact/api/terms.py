"""Terms: the number of in-out terms for a material, and what a homomorphic fit costs instead."""

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from homofact.api.progress import Progress, ProgressSteps
from homofact.api.subjects import check_held_out, given_source, open_given, subset_of
from homofact.brdf.source_names import HELD_OUT
from homofact.errors import BadInput

if TYPE_CHECKING:
    from homofact.evaluation.compare import ComparisonRow
    from homofact.methods.method import Method
    from homofact.theory.term_costs import TermCosts
    from homofact.theory.terms import InOutCount


@dataclass(frozen=True)
class TermsResult:
    """How many in-out terms a source needs.

    Attributes
    ----------
    source : str
        The source's name.
    count : InOutCount
        The predicted and the measured number of terms.
    nbytes : int
        Bytes of the measured terms as maps.
    row : ComparisonRow or None
        The fit for comparison, if the call had a `method`.
    costs : TermCosts or None
        What the terms and that fit cost.
    """

    source: str
    count: "InOutCount"
    nbytes: int
    row: "ComparisonRow | None" = field(default=None, repr=False)
    costs: "TermCosts | None" = None

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        answer = {"source": self.source} | self.count.record() | {"bytes": self.nbytes}
        if self.row is not None and self.costs is not None:
            answer |= {"fit": self.row.record(), "within_limit": self.costs.record()}
        return answer


def terms(
    source: Any,
    *,
    share: float = 0.99,
    limit: float = 85.0,
    method: "Method | None" = None,
    held_out: float = HELD_OUT,
    seed: int = 0,
    progress: Progress | None = None,
) -> TermsResult:
    """Predict and count the in-out terms (SVD) that a source needs.

    Parameters
    ----------
    source : source or path
        As for `fit`.
    share : float, optional
        The share of the energy, Σσ² over the singular values σ, that the terms must contain.
    limit : float, optional
        The greatest angle from the normal, in degrees.
    method : Method, optional
        A method for a fit to compare the costs with.
    held_out : float, optional
        The part of the samples that is held out of that fit.
    seed : int, optional
        Seed of a model's samples.
    progress : callable, optional
        Called with a `ProgressStep` on the way.

    Returns
    -------
    TermsResult
        The number of terms predicted from the half-angle curve, and the number counted in the decomposition.

    Raises
    ------
    BadInput
        For a source that cannot be read, and a share or limit out of range.

    References
    ----------
    Mahajan, Tseng and Ramamoorthi (2008), An analysis of the in-out BRDF factorization for view-dependent relighting.

    Examples
    --------
    >>> found = homofact.terms("material:phong-10")
    >>> found.count.predicted, found.count.measured
    (29, 23)
    """
    given = given_source(source)
    check_held_out(held_out)
    if not 0 < share < 1:
        raise BadInput(where="share", found=share, expected="between 0 and 1")
    if not 0 < limit <= 90:
        raise BadInput(where="limit", found=f"{limit:g} degrees", expected="above 0 and at most 90")

    from homofact.theory.term_costs import against_fit, map_bytes
    from homofact.theory.terms import predicted_terms

    steps = ProgressSteps(progress)
    steps.stage("reading")
    subject = open_given(given, seed)
    steps.stage("counting terms")
    found = predicted_terms(subject.reflectance, share, math.radians(limit))
    nbytes = map_bytes(found.measured, len(subject.reflectance.channels))
    if method is None:
        return TermsResult(subject.name, found, nbytes)

    from homofact.evaluation.compare import fit_and_measure

    steps.warm_up()
    steps.stage("fitting")
    row = fit_and_measure(subject, method, held_out, steps, subset_of(given))
    steps.stage("comparing")
    return TermsResult(subject.name, found, nbytes, row, against_fit(subject, row, found, held_out))
