"""The file of a scene with objects in their places, read from strict TOML: what relighting and editing have alike."""

from dataclasses import dataclass

from homofact.errors import BadInput
from homofact.scene.cameras import Camera
from homofact.scene.lighting import LightTable
from homofact.scene.objects import GroundTable, ObjectTable


@dataclass(frozen=True, kw_only=True)
class SceneTable:
    """The whole file; a kind of scene has its own objects and ground, and says what else there is."""

    object: tuple[ObjectTable, ...]
    ground: GroundTable | None = None
    lighting: LightTable
    camera: tuple[Camera, ...]

    def __post_init__(self) -> None:
        """Refuse no object and no camera. Raises BadInput."""
        for name, found in (("object", self.object), ("camera", self.camera)):
            if not found:
                raise BadInput(where=name, found="none", expected="at least one")
