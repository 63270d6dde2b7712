"""`homofact research terms`: the number of in-out terms for a material, and what a homomorphic fit costs instead."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from homofact.cli import options as o
from homofact.cli.screen import Screen, say_ending
from homofact.cli.subject import source_of
from homofact.cli.tables import facts_table

if TYPE_CHECKING:
    from homofact.config import Config
    from homofact.evaluation.compare import ComparisonRow
    from homofact.theory.term_costs import TermCosts


@o.configured("source.path", "source", "evaluate", "seed")
def terms(
    settings: "Config",
    share: Annotated[float, typer.Option(help="Share of the energy, Σσ², that the terms must represent.")] = 0.99,
    limit: Annotated[float, typer.Option(help="Largest angle from the normal, in degrees.")] = 85.0,
    fit: Annotated[
        bool,
        typer.Option(
            "--fit",
            help="Also fit the material with the method of the configuration, and"
            " compare the costs of the fit with those of the in-out terms.",
        ),
    ] = False,
    as_json: o.AsJson = False,
    quiet: o.Quiet = False,
) -> None:
    """Predict and count the in-out terms (SVD) that a material needs.

    The predicted number of terms is (l* + 1)²/4, where l* is the highest order of spherical harmonics in the
    material's curve over the half angle. The counted number follows from the singular values of the BRDF (Mahajan
    et al. 2008).
    """
    source = source_of(settings)
    method = settings.fit.method_alone()

    from homofact.api.terms import terms

    screen = Screen(as_json, quiet)
    with screen.progress() as progress:
        result = terms(
            source, share=share, limit=limit, method=method if fit else None, held_out=settings.evaluate.held_out,
            seed=settings.seed, progress=progress,
        )  # fmt: skip
    found, stored = result.count, result.nbytes
    if not found.settled:
        screen.note(
            f"homofact: {found.measured} terms are a rough count: the highlight is too sharp for the finest grid,"
            f" {found.grid[0]} rings of {found.grid[1]}"
        )
    facts: dict[str, Any] = {
        "energy": f"terms keep {share:.4g} of Σσ² (singular values), θ ≤ {limit:g}°",
        "l*": f"{'' if found.l_star_settled else 'at least '}{found.l_star:.1f}, the order of the half-angle curve",
        "terms predicted": f"{'' if found.l_star_settled else 'at least '}{found.predicted} = (l* + 1)²/4",
        "terms measured": f"{'' if found.settled else 'about '}{found.measured} by SVD",
        "as 32² maps": f"{stored} bytes, 2 maps per term ({stored // 2} if reciprocal), {2 * found.measured} fetches",
    }
    if result.row is not None and result.costs is not None:
        facts |= _compared(result.row, result.costs)
        say_ending(screen, result.row.report)
    screen.show(facts_table(result.source, facts))
    screen.answer(result.record())


def _compared(row: "ComparisonRow", beside: "TermCosts") -> dict[str, str]:
    """The lines of a fit beside those of the SVD, Cole errors held out and within the limit."""
    own, match, fitted = beside.counted, beside.matching, row.factorization
    return {
        "Cole error": f"of {beside.samples} held-out samples within the limit, ε = {fitted.transform.epsilon:g}",
        f"{own.terms} terms": f"{own.error:.4g} with {own.bytes} bytes; {own.negative:.2%} of the values negative",
        f"fit ({row.settings.name})": f"{beside.fit_error:.4g} with {fitted.nbytes} bytes, {fitted.fetches} fetches",
        "terms as good as the fit": (
            "no number of them on this grid"
            if match is None
            else f"{match.terms}: {match.error:.4g} with {match.bytes} bytes, {match.fetches} fetches"
        ),
    }
