"""What a command works on: the source of the configuration, methods by label, how to show it."""

from dataclasses import replace
from typing import TYPE_CHECKING

from homofact.errors import BadInput

if TYPE_CHECKING:
    from homofact.brdf.source import Source
    from homofact.cli.screen import Screen
    from homofact.config import Config
    from homofact.methods.settings import FitSettings


def check_source(settings: "Config") -> None:
    """Refuse a run without a source, before anything else is done. Raises BadInput."""
    if settings.source.path is None:
        raise BadInput("SOURCE: none given, expected a file or material:NAME (or path under [source])")


def open_subject(settings: "Config") -> "Source":
    """The configured source, read or sampled, in all its channels or in one of them. Raises BadInput."""
    from homofact.brdf.source import open_source

    check_source(settings)
    asked = settings.source
    return open_source(
        str(asked.path), channels=asked.channels, count=asked.count, scheme=asked.scheme, seed=settings.seed
    )


def warmed_up(screen: "Screen") -> None:
    """Make the compiled kernels ready before a fit is timed, and say so once on a terminal, where it took compiling."""
    from homofact.linear.normal import warm_up

    seconds = warm_up()
    if seconds > 0 and screen.on_terminal:
        screen.note(f"homofact: compiled its kernels in {seconds:.1f} s; from now on they are loaded")


def method_settings(base: "FitSettings", label: str) -> "FitSettings":
    """The settings that a method's label stands for: `base` with its method and fixed projections.

    A label is a method's name, or `mccool:` and projections joined with "+". Raises BadInput for an
    unknown method, an unknown projection, for projections behind a method that searches its own, and for
    another setting that the method has no such value of.
    """
    from homofact.factor.projection import fixed_projection
    from homofact.methods.table import check_settings, method

    name, colon, listed = label.partition(":")
    method(name)
    projections = tuple(part.strip() for part in listed.split("+") if part.strip())
    if colon and (name != "mccool" or not projections):
        raise BadInput(f"method: found {label!r}, expected projections behind mccool only, as in mccool:wi+h")
    for each in projections:
        fixed_projection(each, base.reciprocal)
    settings = replace(base, method=name, projections=projections)
    check_settings(settings)
    return settings
