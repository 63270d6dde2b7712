"""The scene of a relighting, read from strict TOML: objects with their materials, a light, cameras, what is kept.

seed = 0
[[object]]                         # one or more
mesh = "bunny.ply"                 # OBJ, PLY or glTF, relative to the scene's file; or shape:sphere, shape:knot
material = "material:phong-30"     # a file, relative to the scene's; a result of `factorize`; or a material's name
albedo = [0.5]                     # or this: matt (Lambert), one number or one of red, green and blue
terms = 4                          # K of its in-out factors; as many as hold `share` of the energy unless given
share = 0.99
size = 1.0                         # radius of the sphere round it
at = [0, 0, 0]                     # the middle of that sphere; y is up
turn = 0                           # degrees about y
[ground]                           # optional: a square plane under the objects
albedo = [0.5]                     # or material, as above
half = 2.5                         # half of its width
steps = 64                         # squares along a side
[lighting]                         # one of the two: an environment map, or one of `scene.lighting.NAMED` that is a map
environment = "sky.hdr"
named = "studio"
turn = 0                           # degrees about y
[[camera]]                         # one or more: what is rendered
eye = [0, 1, 4]
target = [0, 0, 0]
field = 40                         # degrees from top to bottom
pixels = [480, 360]                # width, height
[transport]                        # all optional
cube = 64                          # texels along a face of the cube map: 8, 16, 32 or 64
rays = 1                           # across a texel, 1 or 2
kept = 96                          # wavelet coefficients of a vector
tolerance = 0.05                   # or: what of a vertex's root sum square may be left out
clusters = 0                       # clustered principal components; 0 is none, −1 as many as suit the vertices
components = 12
"""

import math
from dataclasses import dataclass, field, replace
from pathlib import Path

from homofact.errors import BadInput
from homofact.files.reading import read_toml
from homofact.files.tables import limits, read_table
from homofact.options import MOST_SEED
from homofact.render.environment import read_environment
from homofact.render.light import EnvironmentMap
from homofact.scene.lighting import NAMED, named_lighting
from homofact.scene.placed import Camera, GroundPlane, LightTable, PlacedObject, found_material, found_mesh
from homofact.scene.transport.clusters import COMPONENTS
from homofact.scene.transport.factors import MOST_TERMS
from homofact.scene.transport.precompute import KEPT, TransportSettings


@dataclass(frozen=True)
class SceneObject(PlacedObject):
    """One object: `terms` K of its in-out factors, or as many as hold `share` of the energy."""

    terms: int | None = field(default=None, metadata=limits(least=1, most=MOST_TERMS))
    share: float = field(default=0.99, metadata=limits(above=0, most=0.9999))


@dataclass(frozen=True)
class Ground(GroundPlane):
    """The plane under the objects, with its in-out factors as of an object."""

    terms: int | None = field(default=None, metadata=limits(least=1, most=MOST_TERMS))
    share: float = field(default=0.99, metadata=limits(above=0, most=0.9999))


@dataclass(frozen=True)
class _Transport:
    cube: int = 64
    rays: int = 1
    kept: int = KEPT
    tolerance: float | None = None
    clusters: int = field(default=0, metadata=limits(least=-1))
    components: int = field(default=COMPONENTS, metadata=limits(least=1, most=64))


@dataclass(frozen=True)
class _Table:
    object: tuple[SceneObject, ...]
    lighting: LightTable
    camera: tuple[Camera, ...]
    transport: _Transport = _Transport()
    ground: Ground | None = None
    seed: int = field(default=0, metadata=limits(least=0, most=MOST_SEED))

    def __post_init__(self) -> None:
        for name, found in (("object", self.object), ("camera", self.camera)):
            if not found:
                raise BadInput(f"{name}: found none, expected at least one")


@dataclass(frozen=True)
class RelightScene:
    """What is relit. Sources and meshes are findable from the working folder; `clusters` as in the file."""

    name: str
    objects: tuple[SceneObject, ...]
    ground: Ground | None
    light: EnvironmentMap
    cameras: tuple[Camera, ...]
    settings: TransportSettings
    clusters: int
    components: int
    seed: int


def read_relight_scene(path: str | Path) -> RelightScene:
    """The scene in a TOML file.

    Raises BadInput for a file that cannot be read, unknown keys, wrong types and values, meshes, sources and
    environments that are not there, and a lighting that is no map.
    """
    file = Path(path)
    found = read_table(_Table, read_toml(file, "a scene in TOML"), f"{file}: ")
    asked = found.transport
    try:
        objects = tuple(
            replace(
                each,
                mesh=found_mesh(each.mesh, file.parent, f"object[{place}].mesh"),
                material=found_material(each.material, file.parent, f"object[{place}].material"),
            )
            for place, each in enumerate(found.object)
        )
        ground = found.ground
        if ground is not None:
            ground = replace(ground, material=found_material(ground.material, file.parent, "ground.material"))
        try:
            settings = TransportSettings(asked.cube, asked.rays, asked.kept, asked.tolerance)
        except BadInput as error:
            raise BadInput(f"transport.{error}") from error
        light = _light(found.lighting, file.parent)
    except BadInput as error:
        raise BadInput(f"{file}: {error}") from error
    return RelightScene(
        file.stem, objects, ground, light, found.camera, settings, asked.clusters, asked.components, found.seed
    )


def _light(table: LightTable, folder: Path) -> EnvironmentMap:
    turn = math.radians(table.turn)
    if table.environment is not None:
        return read_environment(folder / table.environment, turn)
    found = named_lighting(str(table.named)).lights
    if len(found) != 1 or not isinstance(found[0], EnvironmentMap):
        maps = [name for name, (make, _) in NAMED.items() if isinstance(make()[0], EnvironmentMap)]
        raise BadInput(f"lighting.named: {table.named} is no environment map, expected one of {', '.join(maps)}")
    return found[0].turned(turn)
