"""What a command works on: the sources that the configuration names, with how they are read."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from homofact.errors import BadInput

if TYPE_CHECKING:
    from homofact.config import Config
    from homofact.sections import SourceSettings


def source_of(settings: "Config") -> "SourceSettings":
    """Return the configured source. Raises BadInput where there is none."""
    if settings.source.path is None:
        raise BadInput("none given", where="SOURCE", expected="a file or material:NAME (or path under [source])")
    return settings.source


def sources_of(settings: "Config", paths: Sequence[str]) -> "list[SourceSettings]":
    """Several sources, read alike; the configured one where there are no paths. Raises BadInput where there is none."""
    return [replace(settings.source, path=path) for path in paths] or [source_of(settings)]
