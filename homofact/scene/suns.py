"""Suns beside the lighting of a scene: [[sun]] of its file."""

from dataclasses import dataclass

from homofact.errors import BadInput
from homofact.rendering.light import DirectionalLight
from homofact.scene.cameras import check_point


@dataclass(frozen=True, kw_only=True)
class SunTable:
    """[[sun]]: a light of the sun's size beside the lighting, `direction` towards it.

    `irradiance` is that on a surface that faces it, in the lighting's units of radiance times steradians.
    """

    direction: tuple[float, ...]
    irradiance: tuple[float, ...]

    def __post_init__(self) -> None:
        """Refuse a sun at or under the horizon, and one without light. Raises BadInput."""
        check_point("direction", self.direction)
        if not self.direction[1] > 0:
            wanted = "a sun above the horizon, y > 0"
            raise BadInput(where="direction", found=list(self.direction), expected=wanted)
        if len(self.irradiance) not in (1, 3) or not any(self.irradiance):
            wanted = "1 or 3 numbers, some above 0"
            raise BadInput(where="irradiance", found=list(self.irradiance), expected=wanted)
        self.light()

    def light(self) -> DirectionalLight:
        """Return the sun as a light. Raises BadInput for negative or unbounded irradiance."""
        x, y, z = self.direction
        levels = self.irradiance[0] if len(self.irradiance) == 1 else self.irradiance
        try:
            return DirectionalLight((x, y, z), levels)
        except BadInput as error:
            raise BadInput(where="irradiance", found=list(self.irradiance), expected=error.expected) from error
