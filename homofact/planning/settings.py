"""Settings of a plan's fits, in a module of their own so that the command help does not load torch."""

from dataclasses import dataclass

from homofact.brdf.source_names import MOST_COUNT
from homofact.methods.search import Search
from homofact.settings.options import again, check_options, option


@dataclass(frozen=True)
class PlanSettings:
    """`effort` and `budget` of each search, and `count` pairs drawn from an analytic model."""

    effort: str | float = again(Search, "effort", "quick")
    budget: float | None = again(Search, "budget", None)
    count: int = option(
        8000, "Number of pairs of directions sampled from an analytic model", least=100, most=MOST_COUNT
    )

    def __post_init__(self) -> None:
        """Reject invalid values. Raises BadInput."""
        check_options(self)
