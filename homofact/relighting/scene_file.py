"""The scene of a relighting, read from strict TOML: objects with their materials, a light, cameras, stored terms.

Objects, ground, light and cameras are those of `scene.scene_file`. A named lighting must be a map. Further keys:

seed = 0
[[object]]
name = "case"                      # in tables and on the page. Default: the name of its mesh
terms = 4                          # K of its in-out factors, or one of the two rules of `factoring` for it:
error = 0.02                       # as many as leave this expected error under the scene's light
share = 0.99                       # as many as hold this of the material's energy; the rule where none is given
lobe = "auto"                      # "separate": a sharp lobe is summed for every view; "factored": it is in the terms;
                                   # "auto", the default: separate if there would be more than 32, and no rule is given
[ground]                           # name, and terms, error, share or lobe, as above
[lighting]                         # all optional, beside the map:
sun = "separate"                   # a sun in the map becomes a light of its own, the default; or it stays in "texels"
sun_radius = 0.27                  # of its disc in degrees. Default: as in the map
[[sun]]                            # none or more, beside the lighting
direction = [0.3, 0.8, 0.5]        # towards the sun, y up
irradiance = [3.1]                 # on a surface that faces it: one number, or one of red, green and blue
radius = 0.27                      # of its disc, in degrees. Default: the radius of the sun
[[lamp]]                           # none or more: glowing spheres
position = [0.8, 1.2, 0.6]         # of the middle, y up, outside all objects
radius = 0.1                       # of the sphere, in the scene's units
intensity = [3.1]                  # a surface that faces it at the distance d has the irradiance intensity/d²
[transport]                        # all optional
cube = 64                          # texels along a face of the cube map: 8, 16, 32 or 64
rays = 1                           # across a texel, 1 or 2
kept = 96                          # wavelet coefficients of a vector
tolerance = 0.05                   # or: what of a vertex's root sum square may be left out
bounces = 0                        # 1: light that reaches a surface by way of another one too
clusters = 0                       # clustered principal components; 0 is none, −1 as many as suit the vertices
components = 12
[tolerance]                        # optional, replaces error, share, kept, clusters and the tolerance above:
reflected = 0.02                   # largest relative RMS error of the light; `plan` chooses all of them to meet it
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

from homofact.errors import BadInput
from homofact.files.reading import read_toml, split_member
from homofact.relighting.clusters import COMPONENTS
from homofact.relighting.cones import RoundLight
from homofact.relighting.factored_material import AUTO, LOBES, SEPARATE
from homofact.relighting.factoring import MOST_TERMS
from homofact.relighting.lamps import Lamp, LampTable
from homofact.relighting.map_sun import separate_sun
from homofact.relighting.precompute import KEPT, TransportSettings
from homofact.relighting.sunlight import MOST_LIGHTS, RelightSunTable, Sun
from homofact.rendering.light import EnvironmentMap
from homofact.scene.cameras import Camera
from homofact.scene.lighting import LightTable
from homofact.scene.materials import MaterialTable
from homofact.scene.objects import GroundTable, ObjectTable, found_tables
from homofact.scene.scene_file import SceneTable
from homofact.settings.kinds import RELIGHTING, check_kind
from homofact.settings.options import MOST_SEED, a_name, option, required
from homofact.settings.tables import read_table

SEPARATE_SUN, TEXEL_SUN = "separate", "texels"
MAP_SUNS = (SEPARATE_SUN, TEXEL_SUN)


@dataclass(frozen=True, kw_only=True)
class _TermRule(MaterialTable):
    """The `name` of a material, and its number of in-out factors: `terms`, or one of the two rules of `factoring`."""

    name: str | None = option(None, "Its name in tables. Default: the name of its mesh", expected_instead=a_name)
    terms: int | None = option(None, "K of its in-out factors", least=1, most=MOST_TERMS)
    error: float | None = option(None, "As many terms as leave this expected error", above=0, most=0.9)
    share: float | None = option(None, "As many terms as hold this of the material's energy", above=0, most=0.9999)
    lobe: str = option(AUTO, "Whether a sharp lobe is computed separately", choices=LOBES)

    def __post_init__(self) -> None:
        """Reject more than one rule for K. Raises BadInput."""
        super().__post_init__()
        given = [name for name in ("terms", "error", "share") if _given(self, name)]
        if len(given) > 1:
            raise BadInput(found=" and ".join(given), expected="at most one of terms, error, share")
        if self.lobe == SEPARATE and self.share is not None:
            raise BadInput(where="share", found='it beside lobe = "separate"', expected="terms or an error")

    @property
    def called(self) -> str | None:
        """Return its name; None for the name of its mesh."""
        return self.name


@dataclass(frozen=True)
class RelightObjectTable(_TermRule, ObjectTable):
    """One object, with the rule for its in-out factors."""

    def part(self, mesh: str, several: bool) -> Self:
        """Return the table of a part; if there are `several`, the name of the part follows the object's."""
        found = super().part(mesh, several)
        return replace(found, name=f"{self.name} {split_member(mesh)[1]}") if self.name and several else found


@dataclass(frozen=True)
class RelightGroundTable(_TermRule, GroundTable):
    """The plane under the objects, with the same rule for its in-out factors."""


@dataclass(frozen=True)
class _Transport:
    cube: int = 64
    rays: int = 1
    kept: int | None = None
    tolerance: float | None = None
    bounces: int = option(0, "Bounces of light between surfaces: none, or one", least=0, most=1)
    clusters: int | None = option(None, "Clustered principal components; 0 is none, -1 as many as suit", least=-1)
    components: int = option(COMPONENTS, "Components per cluster", least=1, most=64)


@dataclass(frozen=True)
class _Tolerance:
    reflected: float = required("Relative RMS of the light", above=0, most=0.9)


@dataclass(frozen=True)
class RelightLightTable(LightTable):
    """The lighting, and what becomes of a sun in its map: a light of its own, or it stays in the texels."""

    sun: str = option(SEPARATE_SUN, "Whether a sun in the map becomes a light of its own", choices=MAP_SUNS)
    sun_radius: float | None = option(None, "Radius of its disc in degrees. Default: as in the map", above=0, most=20)

    def __post_init__(self) -> None:
        """Reject `sun_radius` if suns stay in the map. Raises BadInput."""
        super().__post_init__()
        if self.sun != SEPARATE_SUN and self.sun_radius is not None:
            raise BadInput(where="sun_radius", found=f'it beside sun = "{self.sun}"', expected="one of the two")


@dataclass(frozen=True, kw_only=True)
class RelightSceneTable(SceneTable):
    """The whole file."""

    object: tuple[RelightObjectTable, ...]
    lighting: RelightLightTable
    ground: RelightGroundTable | None = None
    sun: tuple[RelightSunTable, ...] = ()
    lamp: tuple[LampTable, ...] = ()
    transport: _Transport = _Transport()
    tolerance: _Tolerance | None = None
    seed: int = option(0, "Seed of the clusters and of the vertices where errors are measured", least=0, most=MOST_SEED)

    def __post_init__(self) -> None:
        """Reject a tolerance together with settings that it would choose. Raises BadInput."""
        super().__post_init__()
        if self.tolerance is None:
            return
        given = [f"transport.{name}" for name in ("kept", "tolerance", "clusters") if _given(self.transport, name)]
        tables = [(f"object[{place}]", each) for place, each in enumerate(self.object)]
        tables += [] if self.ground is None else [("ground", self.ground)]
        given += [f"{where}.{name}" for where, each in tables for name in ("error", "share") if _given(each, name)]
        if given:
            found = "it beside tolerance.reflected, which chooses it"
            raise BadInput(where=given[0], found=found, expected="one of the two")


@dataclass(frozen=True)
class RelightSceneFile:
    """The scene to relight, as in its file; paths of sources and meshes are relative to the working folder."""

    name: str
    objects: tuple[RelightObjectTable, ...]
    ground: RelightGroundTable | None
    light: EnvironmentMap
    cameras: tuple[Camera, ...]
    settings: TransportSettings
    clusters: int
    components: int
    seed: int
    reflected: float | None = None
    suns: tuple[Sun, ...] = ()
    notes: tuple[str, ...] = ()
    bounces: int = 0
    lamps: tuple[Lamp, ...] = ()

    @property
    def lights(self) -> tuple[RoundLight, ...]:
        """Return the lights beside the sky: suns, then lamps."""
        return (*self.suns, *self.lamps)


def read_relight_scene(path: str | Path) -> RelightSceneFile:
    """The scene in a TOML file.

    Raises BadInput for a file that cannot be read, unknown keys, wrong types and values, meshes, sources and
    environments that are not there, and a lighting that is no map.
    """
    file = Path(path)
    given = read_toml(file, "a scene in TOML")
    check_kind(given, RELIGHTING, file)
    found = read_table(RelightSceneTable, given, f"{file}: ")
    asked = found.transport
    try:
        objects, ground = found_tables(found.object, found.ground, file.parent)
        try:
            kept = KEPT if asked.kept is None else asked.kept
            settings = TransportSettings(asked.cube, asked.rays, kept, asked.tolerance)
        except BadInput as error:
            raise error.at("transport", ".") from error
        light = found.lighting.map(file.parent)
        suns, notes = [each.sun() for each in found.sun], []
        if found.lighting.sun == SEPARATE_SUN:
            radius = found.lighting.sun_radius
            light, own = separate_sun(light, None if radius is None else math.radians(radius))
            if own is not None:
                suns.append(own)
                notes.append(f"{light.name}: its brightest spot becomes a separate light, {own.describe()}")
        if len(suns) + len(found.lamp) > MOST_LIGHTS:
            where, words = ("lamp", "suns and lamps") if found.lamp else ("sun", "with that of the map")
            found_lights = f"{len(suns) + len(found.lamp)} {words}"
            raise BadInput(where=where, found=found_lights, expected=f"at most {MOST_LIGHTS}")
    except BadInput as error:
        raise error.at(file) from error
    return RelightSceneFile(
        found.name or file.stem, objects, ground, light, found.camera, settings, asked.clusters or 0, asked.components,
        found.seed,
        None if found.tolerance is None else found.tolerance.reflected, tuple(suns), tuple(notes), asked.bounces,
        tuple(each.lamp() for each in found.lamp),
    )  # fmt: skip


def _given(table: object, name: str) -> bool:
    return getattr(table, name) is not None
