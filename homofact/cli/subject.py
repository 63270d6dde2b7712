"""What a command works on: the sources that the configuration names, with how they are read."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from homofact.errors import BadInput

if TYPE_CHECKING:
    from homofact.brdf.source import Source
    from homofact.config import Config
    from homofact.sections import SourceSettings


def source_of(settings: "Config") -> "SourceSettings":
    """The configured source. Raises BadInput where there is none."""
    if settings.source.path is None:
        raise BadInput("none given", where="SOURCE", expected="a file or material:NAME (or path under [source])")
    return settings.source


def sources_of(settings: "Config", paths: Sequence[str]) -> "list[SourceSettings]":
    """Several sources, read alike; the configured one where there are no paths. Raises BadInput where there is none."""
    return [replace(settings.source, path=path) for path in paths] or [source_of(settings)]


def check_source(settings: "Config") -> None:
    """Refuse a run without a source, or of a missing file, before anything else is done. Raises BadInput."""
    from homofact.api.subjects import given_source

    given_source(source_of(settings))


def open_subject(settings: "Config") -> "Source":
    """The configured source, read or sampled, in all its channels or in one of them. Raises BadInput."""
    from homofact.api.subjects import open_given

    check_source(settings)
    return open_given(settings.source, settings.seed)
