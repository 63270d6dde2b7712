"""A relit scene on disk: relight.npz with everything that relighting reads, relight.json, and a picture a camera."""

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from homofact.errors import BadInput
from homofact.files.archive import write_archive
from homofact.files.arrays import Arrays
from homofact.files.fields import Fields
from homofact.files.kinds import RELIT
from homofact.relighting.build import RelitObject
from homofact.relighting.cube import environment_cube
from homofact.relighting.harmonic import Harmonic
from homofact.relighting.lamps import Lamp
from homofact.relighting.lit import LitObject
from homofact.relighting.lit_scene import LitScene
from homofact.relighting.map_sun import separate_sun
from homofact.relighting.page.skies import PageSky, page_sky
from homofact.relighting.plan import ObjectPlan
from homofact.relighting.relight import Light, opened_light
from homofact.relighting.saved import (
    FACTORS,
    VECTORS,
    read_cameras,
    read_objects,
    read_references,
    read_report,
    read_sky,
)  # fmt: skip
from homofact.relighting.scene_file import RelightSceneFile
from homofact.relighting.sunlight import Sun
from homofact.rendering.light import EnvironmentMap
from homofact.scene.cameras import Camera
from homofact.scene.folders import read_scene_archive, report_name, write_scene_folder

REPORT = report_name(RELIT)
_EXPECTED = "a relit scene that homofact wrote"
_FORMAT, _VERSION = "homofact relit scene", 8
_OLDEST = 8  # with the grids of lobes as they are now


@dataclass(frozen=True)
class RelightResult:
    """A relit scene: its objects with their transport, its sky, pictures and errors.

    Attributes
    ----------
    name : str
        The scene's name.
    objects : tuple of RelitObject
        The objects with their transport, the ground last.
    sky : PageSky
        The light of the scene.
    cameras : tuple of Camera
        The cameras that the pictures are of.
    report : dict
        The JSON form, as in the folder's relight.json.
    reference : tuple of ndarray or None
        Each object's radiance (V, 3) towards the first camera, summed over all texels, NaN at invisible vertices.
    pictures : tuple of ndarray
        8-bit sRGB (H, W, 3) of every camera; none where the scene was read from its folder.
    plans : tuple of ObjectPlan
        How each object's transport was chosen, where the scene has a tolerance.
    notes : tuple of str
        Remarks on the scene, one line each.
    light : EnvironmentMap or None
        The scene's environment map; None where the scene was read from its folder.
    """

    name: str
    objects: tuple[RelitObject, ...] = field(repr=False)
    sky: PageSky = field(repr=False)
    cameras: tuple[Camera, ...]
    report: dict[str, Any] = field(repr=False)
    reference: tuple[np.ndarray, ...] | None = field(default=None, repr=False)
    pictures: tuple[np.ndarray, ...] = field(default=(), repr=False)
    plans: tuple[ObjectPlan, ...] = field(default=(), repr=False)
    notes: tuple[str, ...] = ()
    light: EnvironmentMap | None = field(default=None, repr=False)

    @classmethod
    def of(
        cls,
        file: RelightSceneFile,
        objects: Sequence[RelitObject],
        report: dict[str, Any],
        pictures: Sequence[np.ndarray] = (),
        reference: Sequence[np.ndarray] | None = None,
    ) -> "RelightResult":
        """Make the result of a scene's file from the objects, report and pictures computed for it."""
        sky = page_sky(file.light.name, file.light, file.settings.cube)
        sums = None if reference is None else tuple(reference)
        return cls(
            file.name, tuple(objects), sky, file.cameras, report, sums, tuple(pictures), light=file.light
        )  # fmt: skip

    def record(self) -> dict[str, Any]:
        """Return the JSON form, the report."""
        return self.report

    @property
    def nbytes(self) -> int:
        """Return the bytes of all objects that relighting reads."""
        return sum(thing.nbytes for thing in self.objects)

    @property
    def suns(self) -> tuple[Sun, ...]:
        """The suns beside the sky."""
        lit = self.objects[0].sunlight if self.objects else None
        return () if lit is None else lit.suns

    @property
    def lamps(self) -> tuple[Lamp, ...]:
        """The lamps beside the sky."""
        lit = self.objects[0].sunlight if self.objects else None
        return () if lit is None else lit.lamps

    def shade(self, light: Light, eye: Sequence[float], suns: bool = False, lamps: bool = True) -> list[np.ndarray]:
        """Return the radiance (V, 3) of each object's vertices towards the point `eye`, under another light.

        A light is an `EnvironmentMap`, a cube map of radiance, a .hdr or .exr file, or the name of a built-in one. If
        `suns`, the suns of the scene's own sky are added; its `lamps` shine under every sky unless they are off. Raises
        BadInput for other lights and points.
        """
        return [each.shade(eye) for each in self._lit(opened_light(light), suns, lamps)]

    def lit(self, light: EnvironmentMap | None = None) -> LitScene:
        """Return the scene under its own light with its suns, or under another one without them.

        The scene's lamps shine in both. A sun in the other map becomes a light of its own, if the scene has suns or
        lamps and so the tables for them. A scene from a folder has its environment map at the folder's resolution,
        which is lower behind the objects. Raises BadInput for a map that cannot light the scene.

        Examples
        --------
        >>> scene = homofact.relight("configs/scenes/relight.toml", vertices=0)
        >>> radiance, coverage = scene.lit().radiance(scene.cameras[0])
        """
        meshes = [each.mesh for each in self.objects]
        if light is not None:
            rest, sun = separate_sun(light)
            if sun is None or any(each.sunlight is None for each in self.objects):
                return LitScene(meshes, self._lit(light, suns=False), light)
            return LitScene(meshes, replace(self, objects=self._under(sun))._lit(rest, suns=True), rest)
        background = self.sky.environment() if self.light is None else self.light
        return LitScene(meshes, self._lit(self.sky.cube.astype(float), suns=True), background)

    def _under(self, sun: Sun) -> tuple[RelitObject, ...]:
        """Return the objects under another sun. Of its shadows only those of pictures are right: they are traced."""
        found = []
        for each in self.objects:
            own = each.sunlight
            assert own is not None
            lamps = own.seen[:, len(own.suns) :]
            seen = np.concatenate((np.zeros_like(lamps, shape=(len(lamps), 1)), lamps), 1)
            found.append(replace(each, sunlight=replace(own, suns=(sun,), seen=seen)))
        return tuple(found)

    def _lit(self, light: EnvironmentMap | np.ndarray, suns: bool, lamps: bool = True) -> list[LitObject]:
        """Return each object under a light."""
        sizes = [each.transport.settings.cube for each in self.objects]
        cubes = {size: light if isinstance(light, np.ndarray) else environment_cube(light, size) for size in {*sizes}}
        return [each.lit(cubes[size], suns, lamps) for each, size in zip(self.objects, sizes, strict=True)]

    def save(self, folder: str | os.PathLike[str], force: bool = False) -> None:
        """Write the folder that `homofact view` shows, whole or not at all; `force` replaces one that is there.

        Raises BadInput as `files.folder.write_folder`.
        """

        def archive(file: Path) -> None:
            save_scene(file, self)

        fits = {each.fit.name: each.fit for each in self.objects if each.fit is not None}
        write_scene_folder(Path(folder), RELIT, archive, self.report, self.pictures, self.cameras, force, fits.values())


def distinct_names(names: Sequence[str]) -> list[str]:
    """Return the names, with a counter after repeated names: "ball (1)", "ball (2)"."""
    return [
        name if names.count(name) == 1 else f"{name} ({names[: place + 1].count(name)})"
        for place, name in enumerate(names)
    ]


def save_scene(file: Path, scene: RelightResult) -> None:
    """Write one archive of everything but the pictures."""
    sky = scene.sky
    arrays: dict[str, np.ndarray] = {"sky_cube": sky.cube, "sky_picture": sky.picture}
    arrays |= {f"reference_{k}": colours.astype(np.float32) for k, colours in enumerate(scene.reference or ())}
    entries = []
    for number, each in enumerate(scene.objects):
        made, factors = each.transport, each.transport.factors
        own = {"positions": each.mesh.positions, "normals": each.mesh.normals, "triangles": each.mesh.triangles}
        own |= {"frames": made.frames} | {name: getattr(made, name) for name in VECTORS}
        own |= {f"factors_{name}": getattr(factors, name) for name in FACTORS}
        if isinstance(each.compact, Harmonic):
            own |= {"harmonic_number": each.compact.number, "harmonic_step": each.compact.step}
        elif each.compact is not None:
            own |= {f"basis_{name}": getattr(each.compact.basis, name) for name in VECTORS}
            own |= {name: getattr(each.compact, name) for name in ("cluster", "weights", "steps")}
        if each.lobe is not None:
            own |= {"lobe_values": each.lobe.table.values, "lobe_sight": each.lobe.sight.plain}
        if each.sunlight is not None:
            own |= {f"sun_values_{k}": table.values for k, table in enumerate(each.sunlight.tables)}
            own["sun_seen"] = each.sunlight.seen
            if each.sunlight.bounced is not None:
                own["lamp_bounced"] = each.sunlight.bounced
        if each.tint is not None:
            own |= {"tints": each.tint.tints, "uv": each.tint.uv}
        if each.bumps is not None and each.tilted is not None:
            own |= {"normal_map": each.bumps.vectors, "uv": each.bumps.uv, "tangents": each.bumps.tangents}
            own |= {"tilt_view": each.tilted.view, "tilts": each.tilted.tilts, "tilt_entries": each.tilted.entries}
        arrays |= {f"object_{number}_{name}": array for name, array in own.items()}
        entries.append(
            {
                "name": each.mesh.name,
                "material": each.material,
                "channels": list(factors.channels),
                "energy": factors.energy,
                "beside": factors.beside,
                "bounced": factors.bounced,
                "tinted": factors.tinted,
                "reach": None if each.tilted is None else each.tilted.reach,
                "lobe": None if each.lobe is None else each.lobe.table.record(),
                "sun_tables": [] if each.sunlight is None else [table.record() for table in each.sunlight.tables],
                "compact": "harmonic" if isinstance(each.compact, Harmonic) else each.compact is not None,
                "settings": asdict(made.settings),
            }
        )
    header = {
        "format": _FORMAT,
        "version": _VERSION,
        "name": scene.name,
        "sky": sky.name,
        "suns": [sun.record() for sun in scene.suns],
        "lamps": [lamp.record() for lamp in scene.lamps],
        "objects": entries,
        "cameras": [_camera_record(camera) for camera in scene.cameras],
        "report": scene.report,
    }  # fmt: skip
    write_archive(file, header, arrays)


def _camera_record(camera: Camera) -> dict[str, Any]:
    record = {"eye": list(camera.eye), "target": list(camera.target), "field": camera.field}
    return record | {"pixels": list(camera.pixels)} | ({} if camera.name is None else {"name": camera.name})


def open_relit(place: Path) -> RelightResult:
    """The scene in a folder that `relight` wrote, or in its relight.npz. Raises BadInput where there is none."""
    file = place / RELIT.mark if place.is_dir() else place
    stored, header = read_scene_archive(file, _EXPECTED)
    fields, arrays = Fields(f"{file}: ", header), Arrays(str(file), stored)
    fields.text("format", (_FORMAT,))
    fields.version("version", _VERSION)
    if header["version"] < _OLDEST:
        found, wanted = f"version {header['version']}", f"version {_OLDEST} or later"
        raise BadInput(where=file, found=found, expected=wanted, hint="relight it again")
    objects = read_objects(arrays, fields)
    sky, references = read_sky(arrays, fields.text("sky")), read_references(arrays, objects)
    return RelightResult(fields.text("name"), objects, sky, read_cameras(fields), read_report(fields), references)
