"""What a command works on: the source of the configuration, checked, then opened."""

from typing import TYPE_CHECKING

from homofact.cli.places import check_measurement
from homofact.errors import BadInput

if TYPE_CHECKING:
    from homofact.brdf.source import Source
    from homofact.cli.screen import Screen
    from homofact.config import Config


def check_source(settings: "Config") -> None:
    """Refuse a run without a source, or of a missing file, before anything else is done. Raises BadInput."""
    if settings.source.path is None:
        raise BadInput("SOURCE: none given, expected a file or material:NAME (or path under [source])")
    check_measurement(settings.source.path)


def open_subject(settings: "Config") -> "Source":
    """The configured source, read or sampled, in all its channels or in one of them. Raises BadInput."""
    from homofact.brdf.source import open_source

    check_source(settings)
    asked = settings.source
    return open_source(
        str(asked.path),
        channels=asked.channels,
        count=asked.count,
        scheme=asked.scheme,
        seed=settings.seed,
        calibrate=asked.calibrate,
        clipped=asked.clipped,
    )


def warmed_up(screen: "Screen") -> None:
    """Make the compiled kernels ready before a fit is timed, and say so once on a terminal, where it took compiling."""
    from homofact.linear.normal import warm_up

    seconds = warm_up()
    if seconds > 0 and screen.on_terminal:
        screen.note(f"homofact: compiled its kernels in {seconds:.1f} s; from now on they are loaded")
