"""The sources of a command, from the configuration, with the settings for reading them."""

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
    """Return the sources at `paths`, or the configured source. Raises BadInput if there is neither."""
    return [replace(settings.source, path=path) for path in paths] or [source_of(settings)]
