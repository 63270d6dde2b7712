"""Build relit objects from a scene's file: place them, factor their materials and precompute transport."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from homofact.brdf.analytic import Lambert
from homofact.brdf.tinted import Tinted
from homofact.meshes.buried import with_open_origins
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.relighting.clusters import Clustered, clustered
from homofact.relighting.expected import factoring_seconds, planning_seconds
from homofact.relighting.factored_material import AUTO, SEPARATE, FactoredMaterial, factored, in_parts
from homofact.relighting.harmonic import Harmonic, harmonic
from homofact.relighting.interreflection import ORDER, BounceColours, Interreflection
from homofact.relighting.lamps import check_lamps
from homofact.relighting.lit import LitObject
from homofact.relighting.lobe import SeparateLobe
from homofact.relighting.lobe_table import LobeTable, sun_tables
from homofact.relighting.plan import ObjectPlan, plan_object
from homofact.relighting.precompute import TransportCost, TransportSettings, WaveletTransport, cost, transport
from homofact.relighting.scene_file import RelightGroundTable, RelightObjectTable, RelightSceneFile
from homofact.relighting.sight import most_sight_bytes, sight_words
from homofact.relighting.smooth_response import mean_albedo, smooth_response
from homofact.relighting.sunlight import Sunlight
from homofact.relighting.texel_pattern import texel_note
from homofact.relighting.tilted_view import TiltedView
from homofact.scene.file_fits import FileFit, FileFits
from homofact.scene.materials import Stage
from homofact.scene.meshes import MeshGroup
from homofact.scene.normal_map import SurfaceNormals
from homofact.scene.objects import SceneObject, bounce_note, edge_note, place_objects
from homofact.scene.tint import SurfaceTint

TimedStage = Callable[..., object]

# Bytes of memory of a vertex and a triangle: the object's mesh, that of all, Embree's with its tree.
_PLACE_BYTES, _TRIANGLE_BYTES = 200, 300
# Clustering works on all of an object's transport in memory: a sparse matrix of it takes so many times as much.
_CLUSTERED = 8


@dataclass(frozen=True)
class TransportChoice:
    """The inputs of an object's transport: its material's factors and lobe, and the settings for storage.

    `plan` records the planner's choice if the scene has a tolerance. `sun_tables` are the tables of the material for
    suns and lamps, if the scene has any.
    """

    material: FactoredMaterial
    settings: TransportSettings
    plan: ObjectPlan | None = None
    sun_tables: tuple[LobeTable, ...] = ()

    @property
    def table_bytes(self) -> int:
        """Return the bytes of the view maps and of the tables of the lobe and of suns."""
        lobe = () if self.material.lobe is None else (self.material.lobe,)
        return self.material.factors.view.nbytes + sum(table.nbytes for table in (*lobe, *self.sun_tables))


@dataclass(frozen=True)
class RelitObject:
    """An object with its transport, and its compact form if requested.

    `fit` replaces the material if that is a file of measurements, `lobe` is its separate lobe, `sunlight` the light of
    the scene's suns and lamps, and `tint` the effect of a base-colour texture on the material. `bumps` is its normal
    map, and `tilted` the effect of mapped normals on the terms.
    """

    mesh: Mesh
    material: str
    transport: WaveletTransport
    compact: Clustered | Harmonic | None
    fit: FileFit | None = None
    lobe: SeparateLobe | None = None
    sunlight: Sunlight | None = None
    tint: SurfaceTint | None = None
    bumps: SurfaceNormals | None = None
    tilted: TiltedView | None = None

    @property
    def form(self) -> str:
        """Return the form in which the transport is stored, in words for tables."""
        held = "all frequencies" if self.compact is None else "all frequencies, clustered"
        if isinstance(self.compact, Harmonic):
            held = f"harmonics to order {self.compact.order}"
        return held if self.lobe is None else f"{held}, separate lobe"

    @property
    def nbytes(self) -> int:
        """Return the bytes that relighting reads: transport, view maps, and data of lobe, lights and textures."""
        stored = self.transport.nbytes if self.compact is None else self.compact.nbytes
        parts = (self.lobe, self.sunlight, self.tint, self.bumps, self.tilted)
        beside = sum(each.nbytes for each in parts if each is not None)
        return stored + self.transport.factors.view.nbytes + beside

    def lit(self, light: np.ndarray, suns: bool = True, lamps: bool = True) -> LitObject:
        """Return the object lit by a cube map of radiance, suns and lamps, from its compact form if it has one."""
        lit = None if self.sunlight is None else self.sunlight.only(suns, lamps)
        return LitObject.of(
            self.transport, self.compact, self.lobe, light, lit, self.tint, self.bumps, self.tilted
        )  # fmt: skip


@dataclass(frozen=True)
class RelightScene:
    """A scene ready for transport: objects in their places, and how the transport of each is made.

    `occluder` holds all meshes in this order; `notes` has one line per remark on the scene. `bounces` has the colours
    of the interreflected light if the scene enables it.
    """

    file: RelightSceneFile
    objects: tuple[SceneObject, ...]
    choices: tuple[TransportChoice, ...]
    occluder: Occluder
    notes: tuple[str, ...]
    bounces: BounceColours | None = None

    @property
    def plans(self) -> tuple[ObjectPlan, ...]:
        """The objects' plans, where the scene has a tolerance."""
        return tuple(choice.plan for choice in self.choices if choice.plan is not None)

    @property
    def cost(self) -> TransportCost:
        """Return upper bounds for all transport, with blocks on disk; the memory includes the meshes."""
        costs = [
            cost(len(placed.mesh.positions), choice.material.factors.terms, choice.settings, on_disk=True)
            for placed, choice in zip(self.objects, self.choices, strict=True)
        ]
        positions, triangles = self.occluder.arrays
        peak = sum(c.peak_bytes for c in costs) + len(positions) * _PLACE_BYTES + len(triangles) * _TRIANGLE_BYTES
        if self.file.clusters:
            peak += _CLUSTERED * max(c.most_bytes for c in costs)
        # Of a separate lobe what every vertex sees: a bit a texel, and half of them are under the horizon.
        separate = [
            (choice.settings, len(placed.mesh.positions))
            for placed, choice in zip(self.objects, self.choices, strict=True)
            if choice.material.lobe is not None
        ]
        bits = [64 * sight_words(settings.cube) * vertices for settings, vertices in separate]
        sight = sum(most_sight_bytes(settings.cube) * vertices for settings, vertices in separate)
        beside = sight + sum(choice.table_bytes for choice in self.choices)
        # The transport takes these rays too, if it sends one to a texel.
        own = sum(count // 2 for count, (settings, _) in zip(bits, separate, strict=True) if settings.rays > 1)
        rays, disk = sum(c.rays for c in costs) + own, sum(c.disk_bytes for c in costs) + sum(bits) // 8
        if self.bounces is not None:
            memory, more = Interreflection.cost(len(positions))
            peak, rays = peak + memory, rays + more
        return TransportCost(rays, sum(c.most_bytes for c in costs) + beside, peak + sum(bits) // 8 + beside, disk)


def open_relight_scene(
    file: RelightSceneFile, stage: TimedStage | None = None, fits: FileFits | None = None
) -> RelightScene:
    """Read the scene and place its objects; `fits` has the fits that replace files of measurements.

    `stage` is called at the start of each step with a description and, if known, the expected seconds.

    Raises BadInput if a file cannot be read or has more than three channels, and for a lamp that touches an object.
    """

    def check(meshes: Sequence[Mesh], plane: Mesh | None) -> None:
        check_lamps(file.lamps, meshes, plane, file.cameras)

    objects, notes = place_objects(file.objects, file.ground, file.cameras, stage, fits, check, normal_maps=True)
    notes = (
        *file.notes,
        *notes,
        *bounce_note(file.ground, file.bounces, "transport"),
        *edge_note(file.ground, file.light),
    )
    occluder = MeshGroup([placed.mesh for placed in objects]).occluder
    if stage is not None:
        stage("looking for vertices inside other parts")
    objects = tuple(replace(placed, mesh=with_open_origins(placed.mesh, occluder)) for placed in objects)
    tables = [*file.objects, *([] if file.ground is None else [file.ground])]
    known: dict[tuple[object, ...], FactoredMaterial] = {}
    choices = []
    for placed, table in zip(objects, tables, strict=True):
        mesh, words, reflectance = placed.mesh, placed.material.words, placed.reflectance
        if file.reflected is not None:
            if stage is not None:
                stage(f"planning {mesh.name}", planning_seconds(reflectance))
            plan = plan_object(
                mesh, words, reflectance, occluder, file.light, file.cameras[0].eye, file.reflected, file.settings,
                table.terms, file.seed, _lobe_of(placed, table),
            )  # fmt: skip
            made = plan.factored
            if isinstance(reflectance, Tinted):
                error = plan.chosen.of_terms if table.terms is None else None
                made = in_parts(reflectance, made, table.terms, error=error, light=file.light)
            made = made if placed.bumps is None else made.with_normals(placed.bumps.sines)
            choices.append(TransportChoice(made, plan.settings(file.settings), plan))
            continue
        # A mesh without texture coordinates has no texture, whatever its material. Textures may have the same mean.
        name = reflectance if isinstance(reflectance, Tinted) and placed.bumps is None else words
        key = (name, placed.tint is None, placed.bumps is None, table.lobe, table.terms, table.error, table.share)
        if key not in known:
            if stage is not None:
                stage(f"factoring {Path(words).name}", factoring_seconds(reflectance))
            rule = (table.terms, table.share, table.error)
            made = factored(reflectance, _lobe_of(placed, table), *rule, light=file.light)
            known[key] = made if placed.bumps is None else made.with_normals(placed.bumps.sines)
        choices.append(TransportChoice(known[key], file.settings))
    for placed, choice in zip(objects, choices, strict=True):
        if choice.material.lobe is not None:
            notes += texel_note(placed.mesh.name, choice.material.lobe.half_width, choice.settings.cube)
    if file.lights:
        choices = _with_sun_tables(objects, choices, stage)
    bounces = None
    if file.bounces:
        bounces, choices = _with_bounces(objects, choices, stage)
    return RelightScene(file, objects, tuple(choices), occluder, notes, bounces)


def _lobe_of(placed: SceneObject, table: RelightObjectTable | RelightGroundTable) -> str:
    """Return the table's choice of lobe; the default under a normal map is a separate lobe.

    Under a normal map, each term of a factored lobe would need several terms for the tilted normals.
    """
    plain = placed.bumps is None or isinstance(placed.reflectance, Lambert) or table.share is not None
    return table.lobe if plain or table.lobe != AUTO else SEPARATE


def _with_sun_tables(
    objects: Sequence[SceneObject], choices: Sequence[TransportChoice], stage: Stage | None
) -> list[TransportChoice]:
    """Return the choices with the tables for light from suns; each material is tabulated once."""
    known: dict[tuple[str, bool, int], tuple[LobeTable, ...]] = {}
    found = []
    for placed, choice in zip(objects, choices, strict=True):
        words, lobe = placed.material.words, choice.material.lobe
        key = (words, placed.tint is None, id(lobe))
        if key not in known:
            if stage is not None:
                stage(f"tabulating {Path(words).name}")
            known[key] = sun_tables(placed.reflectance, lobe)
        found.append(replace(choice, sun_tables=known[key]))
    return found


def _with_bounces(
    objects: Sequence[SceneObject], choices: Sequence[TransportChoice], stage: Stage | None
) -> tuple[BounceColours, list[TransportChoice]]:
    """Return the colours of light between surfaces, and the choices with terms for this light."""
    known: dict[tuple[str, bool, int], tuple[np.ndarray, list[np.ndarray]]] = {}
    albedos = []
    for placed, choice in zip(objects, choices, strict=True):
        key = (placed.material.words, placed.tint is None, choice.material.factors.view.shape[1])
        if key not in known:
            if stage is not None:
                stage(f"summing the response of {Path(placed.material.words).name}")
            reflectance = placed.reflectance
            tinted = isinstance(reflectance, Tinted)
            parts = (reflectance.tinted, reflectance.plain) if tinted else (reflectance,)
            known[key] = mean_albedo(reflectance), [smooth_response(part, ORDER, key[2]) for part in parts]
        albedos.append(known[key])
    colours = BounceColours.of([mean for mean, _ in albedos])
    found = []
    for choice, (_, view) in zip(choices, albedos, strict=True):
        held = choice.material
        material = replace(held, factors=colours.terms(held.factors, view, held.tilted is not None))
        if material.tilted is not None and material.factors.bounced:
            made = material.tilted.with_bounce(material.factors, len(colours.colours))
            material = replace(material, tilted=made)
        found.append(replace(choice, material=material))
    return colours, found


def relit_objects(
    scene: RelightScene, blocks: Path | None = None, progress: Callable[[str, int, int], object] | None = None
) -> tuple[RelitObject, ...]:
    """The transport of every object; `blocks` is where finished blocks are kept for a later run.

    `progress` is called with (work in words, blocks done, blocks). Raises BadInput for blocks of another scene.
    """
    file, objects, between = scene.file, [], None
    if scene.bounces is not None:

        def traced(done: int, count: int) -> None:
            if progress is not None:
                progress("light between surfaces", done, count)

        meshes = [placed.mesh for placed in scene.objects]
        between = Interreflection.traced(meshes, scene.bounces, scene.occluder, traced)
    for number, (placed, choice) in enumerate(zip(scene.objects, scene.choices, strict=True)):

        def tell(done: int, count: int, name: str = placed.mesh.name) -> None:
            if progress is not None:
                progress(f"transport of {name}", done, count)

        def tell_shadows(done: int, count: int, name: str = placed.mesh.name) -> None:
            if progress is not None:
                progress(f"shadows on {name}", done, count)

        folder = None if blocks is None else blocks / f"object_{number}"
        where = (placed.mesh, scene.occluder, choice.settings.cube, folder)
        lobe = SeparateLobe.traced(choice.material.lobe, *where, tell_shadows)
        sight = None if lobe is None else lobe.sight
        made = transport(
            placed.mesh, choice.material.factors, choice.settings, scene.occluder, folder, tell, between, sight
        )
        compact = None
        if choice.plan is not None and choice.plan.chosen.order is not None:
            compact = harmonic(made, choice.plan.chosen.order)
        elif file.clusters:
            count = None if file.clusters < 0 else min(file.clusters, made.vertices)
            compact = clustered(made, file.components, clusters=count, seed=file.seed)
        lit = None
        if file.lights:
            lit = Sunlight.traced(file.suns, choice.sun_tables, placed.mesh, scene.occluder, file.lamps)
            if between is not None and file.lamps:
                lit = replace(lit, bounced=between.from_lamps(placed.mesh, made.factors, file.lamps))
        words, fit = placed.material.words, placed.material.fit
        more = (placed.tint, placed.bumps, choice.material.tilted)
        objects.append(RelitObject(placed.mesh, words, made, compact, fit, lobe, lit, *more))
    return tuple(objects)
