"""Sources of a sweep that are fitted together, under shared projections: the one method, and the sources opened."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from homofact.brdf.source import Source, open_source
from homofact.errors import BadInput
from homofact.methods.search import Search
from homofact.sweep.sweep_file import AskedSweep


def one_search(asked: AskedSweep, what: str) -> Search:
    """The sweep's only fit of a source, which is a search; `what` asks for it ("svbrdf").

    Raises BadInput for more than one method, size or seed, another method, and settings that shared fits do not have.
    """
    fits = asked.fits()
    if len(fits) != 1:
        raise BadInput(f"{what}: found {len(fits)} fits of a source, expected one method, at most one size, one seed")
    settings = fits[0][1]
    if not isinstance(settings, Search):
        raise BadInput(f"method[0].method: found {settings.name!r}, expected search: it alone shares projections")
    for name, usual in (("quantize", "none"), ("confidence", False)):
        if getattr(settings, name) != usual:
            raise BadInput(f"method[0].{name}: found {getattr(settings, name)!r}, which shared fits do not have yet")
    return settings


def open_together(
    asked: AskedSweep, settings: Search, said: Callable[[str], object] = lambda words: None
) -> tuple[Source, ...]:
    """All sources, in their order; `said` is told which is being opened. Raises BadInput where channels differ."""
    sources, given = [], asked.source
    for words in asked.sources:
        said(words)
        sources.append(
            open_source(
                words,
                channels=given.channels,
                count=given.count,
                scheme=given.scheme,
                seed=settings.seed,
                calibrate=given.calibrate,
                clipped=given.clipped,
            )
        )
    first = sources[0].samples.channels
    for source in sources[1:]:
        found = source.samples.channels
        if found != first:
            words = f"{len(found)} ({', '.join(found[:4])}{' …' * (len(found) > 4)})"
            raise BadInput(f"{source.name}: found the channels {words}, expected the {len(first)} of {sources[0].name}")
    return tuple(sources)


def with_epsilon(settings: Search, sources: Sequence[Source]) -> Search:
    """One ε for all, where none is given: the largest that a source asks for, so that errors are comparable."""
    if settings.epsilon is not None:
        return settings
    return replace(settings, epsilon=max(source.default_epsilon for source in sources))
