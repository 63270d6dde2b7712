"""The errors of one object's transport at vertices that are seen."""

from typing import Any

from homofact.relighting.build import RelitObject
from homofact.relighting.errors import RelightErrors, measured_errors
from homofact.relighting.precompute import WaveletTransport
from homofact.relighting.seen import SeenVertices
from homofact.rendering.light import EnvironmentMap


def errors_of(
    those: SeenVertices, made: WaveletTransport, compact: Any, light: EnvironmentMap, *more: Any
) -> RelightErrors:
    """As `measured_errors` of the object with this transport."""
    return measured_errors(those, RelitObject(those.mesh, "", made, compact), light, *more)
