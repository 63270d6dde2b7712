"""Choose the next rung to measure: bisection on a probabilistic model of the errors of the whole ladder.

log(error/tolerance) of the rungs is modelled as a Gaussian process over (method, log2 textures, log2 size). It is the
sum of a level of the material, a level of each method, slopes with textures and size, a remainder that is correlated
between neighbours of one method, and the random error of a fit, which its two storages share. Every measurement updates
all predictions, so that a failed rung lowers the chances of smaller rungs of its method and, less, of the other
methods. In order of cost, the next rung to measure is the one up to which half of the total chance of success lies.
This is bisection without the assumption that errors are monotone. It ends when the chance that any cheaper rung meets
the tolerance falls below `DOUBT`.

The parameters of the prior are in units of log error, rounded from fits of analytic materials. The random error is as
large as the scatter of searches that end by their time limit: a search with three textures may be worse than one with
two. A rung counts as meeting the tolerance only after it was measured.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import torch
from torch import Tensor

from homofact.methods.search import Search
from homofact.planning.ladder import WHOLE, Candidate, fits_among

DOUBT = 0.05
# Where nothing meets the tolerance, up to this part of the ladder is asked about for the best that can be reached.
BEST_PART = 0.2
# ... and this part where the best so far misses it by less than NEAR.
NEAR_PART, NEAR = 1.0, 1.05
# Where nothing meets the tolerance, the cheapest rung is chosen whose errors are so near to the least ones.
ALIKE = 1.02
# The error of a rung within the limits whose verdict does not trust it: larger rungs are asked about next.
UNTRUSTED = 1.5
# Standard deviations of the material's level, a method's own, the slopes, the shared remainder, and the rest.
LEVEL, OWN, SLOPES, SHARED, REST = 2.0, 0.7, (0.2, 0.3), 0.5, 0.5
# How much of the rest the storages of one fit do not share, and by how much the log error of whole texels is larger.
STORED, ROUNDED = 0.15, 0.05
# Where each method starts beside one texture of 16², and how its log error falls with log2 textures (of a model, of its
# lobes) and log2 size.
MEANS = {"ggx": (0.8, -0.2, 0.0), "search": (0.0, -0.15, -0.35), "mccool": (0.8, 0.0, -0.2), "svd": (1.0, -0.2, -0.2)}
COLOUR_MEAN = 1.5


@dataclass(frozen=True)
class LadderOutcome:
    """The outcome of measuring a rung: its error, bytes and fetches, and how many textures its fit has.

    For several limits and lightings, `error` is the largest error relative to its limit; `kind` and `lighting` name it,
    and `value` is the error itself. If the tolerance requires a trusted verdict, a rung that meets all limits but is
    not `trusted` has the error `UNTRUSTED` in the search for larger rungs. It still ranks before any rung that misses a
    limit. `excess` is the sum of log(error/limit) of all missed limits, over all lightings, so that a limit that no
    rung meets does not hide the others. If it is None, it is computed from `error` alone.
    """

    error: float
    bytes: int
    fetches: int
    terms: int = 0
    kind: str = ""
    value: float = math.nan
    lighting: str = ""
    trusted: bool = True
    excess: float | None = None

    @property
    def beyond(self) -> tuple[float, float]:
        """How far it is from meeting the tolerance, for comparisons: its `excess`, then its `error`."""
        alone = math.log(max(self.error, 1.0))
        return (alone if self.excess is None else self.excess), self.error


@dataclass
class Walk:
    """A search over a ladder: the outcomes in order of measurement; `choice` is None if no rung is in the budget.

    `stepped` is true after larger rungs than the choice were measured, to find a smaller error (`planning.neighbours`).
    """

    tolerance: float
    asked: dict[Candidate, LadderOutcome] = field(default_factory=dict)
    choice: Candidate | None = None
    met: bool = False
    stepped: bool = False

    @property
    def fits(self) -> int:
        """Return the number of fits for the measured rungs."""
        return fits_among(self.asked)

    def kept(self, candidate: Candidate) -> Candidate:
        """Return the rung with the number of textures that a search used, which may be fewer than allowed."""
        answer = self.asked.get(candidate)
        if answer is None or candidate.method != Search.name or not answer.terms:
            return candidate
        return replace(candidate, textures=answer.terms)


Ask = Callable[[Candidate], LadderOutcome]


def walk(
    candidates: Sequence[Candidate],
    ask: Ask,
    tolerance: float,
    *,
    channels: int = 3,
    isotropic: bool = True,
    most_bytes: float = math.inf,
    most_fetches: float = math.inf,
    light_reads: Mapping[str, int] | None = None,
    before: Callable[[Candidate, int | None], object] = lambda candidate, most: None,
) -> Walk:
    """Return the cheapest rung that meets the tolerance within the budget, by measuring as few as possible.

    Cheapest is fewest bytes, then fewest fetches, then fewest reads of the light (`light_reads` by method). If no rung
    meets the tolerance, `met` is False, and `choice` is the rung within the budget that is nearest to it
    (`LadderOutcome.beyond`), or the cheapest of rungs that are equally near within `ALIKE`. It is None if no rung is
    within the budget. `before` is called before each measurement with the rung. Its second argument is None, or, if no
    rung is likely to meet the tolerance, the most fits that may still follow, including this one.
    """
    reads = light_reads or {}
    state = Walk(tolerance)

    def cost(candidate: Candidate) -> tuple[float, float, float]:
        outcome = state.asked[candidate]
        return outcome.bytes, outcome.fetches, reads.get(candidate.method, 0)

    def fits_budget(candidate: Candidate) -> bool:
        outcome = state.asked[candidate]
        return outcome.bytes <= most_bytes and outcome.fetches <= most_fetches

    for rung in candidates:
        if rung.is_colour:
            state.asked[rung] = ask(rung)
    while True:
        usable = [rung for rung in state.asked if fits_budget(rung)]
        passing = [rung for rung in usable if state.asked[rung].error <= tolerance]
        best = min(passing, key=cost) if passing else None
        least = min((state.asked[rung].error for rung in usable), default=math.inf)
        # So near, the luck of another search may decide.
        near = best is None and least < NEAR * tolerance
        limit = cost(best)[:2] if best is not None else (math.inf, math.inf)
        pool = [
            rung
            for rung in candidates
            if rung not in state.asked
            and (rung.most_bytes(channels), rung.most_fetches(isotropic)) < limit
            and (near or not _settled(rung, state.asked))
        ]
        # A search may come out smaller than asked, so only the sure excess of one texture is ruled out by the budget.
        pool = [rung for rung in pool if rung.most_bytes(channels) <= most_bytes or rung.method == "search"]
        # ... and a search has one fetch at least.
        fewer = most_fetches >= 1
        pool = [
            rung for rung in pool if rung.most_fetches(isotropic) <= most_fetches or (fewer and rung.method == "search")
        ]
        if not pool:
            break
        chances, most = _chances(pool, state, tolerance), None
        # Their fits take the least time and bytes, and those of textures tell little about them.
        models = [rung for rung in pool if rung.lobes]
        if models:
            question = models[0]
        elif 1 - math.prod(1 - chance for chance in chances) >= DOUBT:
            question = _next(pool, chances, channels)
        elif best is None:
            part = NEAR_PART if near else BEST_PART
            if state.fits >= part * fits_among(candidates):
                break
            most = math.ceil(part * fits_among(candidates)) - state.fits
            better = _chances(pool, state, least)
            question = pool[max(range(len(pool)), key=better.__getitem__)]
        else:
            break
        before(question, most)
        state.asked[question] = ask(question)
    usable = [rung for rung in state.asked if fits_budget(rung)]
    state.met = best is not None
    state.choice = best if best is not None else _nearest(usable, state.asked, cost)
    return state


def _nearest(
    usable: Sequence[Candidate],
    asked: Mapping[Candidate, LadderOutcome],
    cost: Callable[[Candidate], tuple[float, float, float]],
) -> Candidate | None:
    """Return the cheapest rung about as near to the tolerance as the nearest one (`ALIKE`); None if none."""
    if not usable:
        return None
    excess, error = min(asked[rung].beyond for rung in usable)
    alike = [
        rung
        for rung in usable
        if asked[rung].beyond[0] <= excess + math.log(ALIKE) and asked[rung].error <= error * ALIKE
    ]
    return min(alike, key=cost)


def _next(pool: Sequence[Candidate], chances: Sequence[float], channels: int) -> Candidate:
    """Return the likeliest rung at the size in bytes that splits the chance of success in half."""
    sizes = sorted({candidate.most_bytes(channels) for candidate in pool})
    reached: dict[int, float] = {}
    missed = 1.0
    for size in sizes:
        for candidate, chance in zip(pool, chances, strict=True):
            if candidate.most_bytes(channels) == size:
                missed *= 1 - chance
        reached[size] = 1 - missed
    total = reached[sizes[-1]]
    # Where all together are unlikely, the likeliest of all decides soonest.
    middle = next(size for size in sizes if reached[size] >= 0.5 * total) if total > 0.5 else None
    offered = [i for i, candidate in enumerate(pool) if middle is None or candidate.most_bytes(channels) == middle]
    return pool[max(offered, key=lambda i: chances[i])]


def _settled(candidate: Candidate, asked: Mapping[Candidate, LadderOutcome]) -> bool:
    """Return whether a search at this size already kept fewer textures than allowed, so more change nothing."""
    return any(
        other.method == candidate.method == "search"
        and other.size == candidate.size
        and other.fit != candidate.fit
        and outcome.terms < other.textures <= candidate.textures
        for other, outcome in asked.items()
    )


def expected_errors(pool: Sequence[Candidate], asked: Mapping[Candidate, LadderOutcome]) -> list[float]:
    """Return the median predicted errors of rungs, given the outcomes."""
    return _belief(pool, asked, 1.0)[0].exp().tolist()


def _chances(pool: Sequence[Candidate], state: Walk, level: float) -> list[float]:
    """Return P(error ≤ level) of each rung in the pool, given the measured errors."""
    if not math.isfinite(level):
        return [1.0] * len(pool)
    centre, deviation = _belief(pool, state.asked, level)
    return torch.special.ndtr(-centre / deviation).tolist()


def _belief(pool: Sequence[Candidate], asked: Mapping[Candidate, LadderOutcome], level: float) -> tuple[Tensor, Tensor]:
    """Return mean (N,) and standard deviation (N,) of log(error/level) in the pool, given measured errors."""
    known = [candidate for candidate, outcome in asked.items() if 0 < outcome.error < math.inf]
    values = torch.tensor([math.log(asked[candidate].error / level) for candidate in known], dtype=torch.float64)
    mean = torch.tensor([_mean(candidate) for candidate in known], dtype=torch.float64)
    system = _covariance(known, known) + STORED**2 * torch.eye(len(known), dtype=torch.float64)
    cross = _covariance(pool, known)
    weights = torch.linalg.solve(system, cross.T) if known else cross.T
    prior = torch.tensor([_mean(candidate) for candidate in pool], dtype=torch.float64)
    centre = prior + weights.T @ (values - mean)
    variance = torch.stack([_covariance([candidate], [candidate])[0, 0] for candidate in pool]) if pool else prior
    return centre, ((variance - (weights * cross.T).sum(0)).clamp_min(0) + STORED**2).sqrt()


def _mean(candidate: Candidate) -> float:
    if candidate.is_colour:
        return COLOUR_MEAN
    start, by_textures, by_size = MEANS[candidate.family]
    textures, size = _place(candidate)
    return start + by_textures * textures + by_size * size + (ROUNDED if candidate.storage == WHOLE else 0.0)


def _place(candidate: Candidate) -> tuple[float, float]:
    """Return log2 of the number of textures or lobes, and log2(size / 16)."""
    if not candidate.textures:
        return math.log2(max(candidate.lobes, 1)), 0.0
    return math.log2(candidate.textures), math.log2(candidate.size / 16)


def _covariance(first: Sequence[Candidate], second: Sequence[Candidate]) -> Tensor:
    table = torch.empty(len(first), len(second), dtype=torch.float64)
    for i, a in enumerate(first):
        for j, b in enumerate(second):
            (t, s), (u, v) = _place(a), _place(b)
            value = LEVEL**2
            if a.family == b.family or (a.is_colour and b.is_colour):
                near = math.exp(-((t - u) ** 2 + (s - v) ** 2) / 2)
                value += OWN**2 + SHARED**2 * near
            if a.fit == b.fit:
                value += REST**2 - STORED**2
            if not a.is_colour and not b.is_colour:
                value += SLOPES[0] ** 2 * t * u + SLOPES[1] ** 2 * s * v
            table[i, j] = value
    return table
