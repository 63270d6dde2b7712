"""The file of a scene with placed objects, read from strict TOML: the keys that relighting and editing share.

name = "showroom"                  # of the scene, on pages and in reports. Default: the file's
[[object]]                         # one or more
mesh = "knot.ply"                  # OBJ, PLY or glTF, relative to the scene's file; or shape:sphere, shape:knot. A glTF
                                   # file without material and albedo is an object for each part, with its own material;
                                   # "scene.glb#lamp" is only the part "lamp"
material = "material:phong-30"     # a file, relative to the scene's; a result of `factorize`; or a material's name
albedo = [0.5]                     # or this: matt (Lambert), one number or one of red, green and blue
size = 1.0                         # radius of the sphere round it
at = [0, 0, 0]                     # the middle of that sphere; y is up
turn = 0                           # degrees about y
[ground]                           # optional: a square plane under the objects
albedo = [0.5]                     # or material
half = 2.5                         # half of its width; 100 reaches the horizon, with smaller squares in the middle
steps = 64                         # squares along a side
[lighting]                         # one of the two: an environment map, or one of `scene.lighting.NAMED`
environment = "sky.hdr"
named = "studio"
turn = 0                           # degrees about y
[[camera]]                         # one or more: the fixed views, or what is rendered
name = "front"                     # Default: "view 1" and so on
eye = [0, 1, 4]
target = [0, 0, 0]
field = 40                         # degrees from top to bottom
pixels = [480, 360]                # width, height
"""

from dataclasses import dataclass

from homofact.errors import BadInput
from homofact.scene.cameras import Camera
from homofact.scene.lighting import LightTable
from homofact.scene.objects import GroundTable, ObjectTable
from homofact.settings.options import a_name, option


@dataclass(frozen=True, kw_only=True)
class SceneTable:
    """The whole file. Each kind of scene defines its own object and ground tables and its further keys."""

    object: tuple[ObjectTable, ...]
    ground: GroundTable | None = None
    lighting: LightTable
    camera: tuple[Camera, ...]
    name: str | None = option(None, "Name of the scene. Default: that of the file", expected_instead=a_name)

    def __post_init__(self) -> None:
        """Refuse no object and no camera. Raises BadInput."""
        for name, found in (("object", self.object), ("camera", self.camera)):
            if not found:
                raise BadInput(where=name, found="none", expected="at least one")
