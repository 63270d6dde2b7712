"""Prepare sources for a fit under shared projections: check that there is one method, and open the sources."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from homofact.brdf.source import Source
from homofact.errors import BadInput
from homofact.methods.search import Search
from homofact.sweeps.sweep_file import AskedSweep


def one_search(asked: AskedSweep, what: str) -> Search:
    """Return the sweep's only method, a search; messages name its purpose `what` ("svbrdf").

    Raises BadInput for more than one method, size or seed, another method, and settings that shared fits do not have.
    """
    fits = asked.fits()
    if len(fits) != 1:
        wanted = "one method, at most one size, one seed"
        raise BadInput(where=what, found=f"{len(fits)} fits of a source", expected=wanted)
    settings = fits[0][1]
    if not isinstance(settings, Search):
        wanted = "search: it alone shares projections"
        raise BadInput(where="method[0].method", found=repr(settings.name), expected=wanted)
    for name, usual in (("quantize", "none"), ("confidence", False)):
        if getattr(settings, name) != usual:
            found = f"{getattr(settings, name)!r}, which shared fits do not have yet"
            raise BadInput(where=f"method[0].{name}", found=found, expected=usual)
    return settings


def open_together(
    asked: AskedSweep, settings: Search, notify: Callable[[str], object] = lambda words: None
) -> tuple[Source, ...]:
    """Open all sources, in their order; `notify` receives the name of each.

    Raises BadInput if their channels differ.
    """
    sources = []
    for words in asked.sources:
        notify(words)
        sources.append(asked.source.opening(settings.seed, words).open())
    first = sources[0].samples.channels
    for source in sources[1:]:
        channels = source.samples.channels
        if channels != first:
            words = f"{len(channels)} ({', '.join(channels[:4])}{' …' * (len(channels) > 4)})"
            wanted = f"the {len(first)} of {sources[0].name}"
            raise BadInput(where=source.name, found=f"the channels {words}", expected=wanted)
    return tuple(sources)


def with_epsilon(settings: Search, sources: Sequence[Source]) -> Search:
    """Return settings with one ε for all: the given ε, or the largest default ε of the sources."""
    if settings.epsilon is not None:
        return settings
    return replace(settings, epsilon=max(source.default_epsilon for source in sources))
