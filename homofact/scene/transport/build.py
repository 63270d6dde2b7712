"""From a scene to relit objects: meshes placed, materials opened and factored, transport precomputed."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.names import MATERIAL_PREFIX
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.source import open_source
from homofact.export.result import open_result
from homofact.files.kinds import FACTORIZATION
from homofact.meshes.mesh import Mesh, read_mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.prepare import prepared
from homofact.meshes.shapes import ground, sphere, torus_knot
from homofact.scene.transport.clusters import Clustered, clustered
from homofact.scene.transport.factors import InOutFactors, factor
from homofact.scene.transport.precompute import Cost, Transport, cost, transport
from homofact.scene.transport.relight import Relit
from homofact.scene.transport.scene import SHAPE_PREFIX, Ground, RelightScene, SceneObject

Stage = Callable[[str], object]
# Bytes of memory of a vertex and a triangle: the object's mesh, that of all, Embree's with its tree.
_PLACE_BYTES, _TRIANGLE_BYTES = 200, 300
# Clustering works on all of an object's transport in memory: a sparse matrix of it takes so many times as much.
_CLUSTERED = 8
_SHAPES = {"sphere": sphere, "knot": torus_knot}


@dataclass(frozen=True)
class Placed:
    """An object before its transport: its mesh in the world, the material and the material's factors."""

    mesh: Mesh
    material: str
    reflectance: Reflectance
    factors: InOutFactors


@dataclass(frozen=True)
class RelitObject:
    """An object with its transport, and the compact form where it was asked for."""

    mesh: Mesh
    material: str
    transport: Transport
    compact: Clustered | None

    @property
    def nbytes(self) -> int:
        """What relighting reads: the compact form where there is one, and the view maps."""
        stored = self.transport.nbytes if self.compact is None else self.compact.nbytes
        return stored + self.transport.factors.view.nbytes

    def tuples(self, light: np.ndarray) -> np.ndarray:
        """K-tuples (V, K, 3) under a cube map of radiance, by the form that is used."""
        relit = Relit(self.transport if self.compact is None else self.compact.basis)
        relit.relight(light)
        return relit.tuples if self.compact is None else self.compact.mixed(relit.tuples)


@dataclass(frozen=True)
class Stand:
    """A scene ready for transport: placed objects, what blocks light among them, what was found on the way."""

    scene: RelightScene
    objects: tuple[Placed, ...]
    occluder: Occluder
    notes: tuple[str, ...]

    @property
    def cost(self) -> Cost:
        """What all of its transport will take, at most, with its blocks on disk; memory that of the meshes too."""
        each = [cost(len(o.mesh.positions), o.factors.terms, self.scene.settings, on_disk=True) for o in self.objects]
        positions, triangles = self.occluder.arrays
        peak = sum(c.peak_bytes for c in each) + len(positions) * _PLACE_BYTES + len(triangles) * _TRIANGLE_BYTES
        if self.scene.clusters:
            peak += _CLUSTERED * max(c.most_bytes for c in each)
        stored = sum(c.most_bytes for c in each)
        return Cost(sum(c.rays for c in each), stored, peak, sum(c.disk_bytes for c in each))


def stand(scene: RelightScene, stage: Stage | None = None) -> Stand:
    """Read and place everything. Raises BadInput for what cannot be read or has more channels than three."""
    told = stage or (lambda _: None)
    meshes, notes = [], []
    for each in scene.objects:
        told(f"reading {Path(each.mesh).name}")
        mesh, found = prepared(_placed(each))
        meshes.append(mesh)
        notes += found
    tables: list[SceneObject | Ground] = list(scene.objects)
    if scene.ground is not None:
        lowest = min(float(mesh.positions[np.unique(mesh.triangles), 1].min()) for mesh in meshes)
        meshes.append(ground(scene.ground.half, lowest, scene.ground.steps))
        tables.append(scene.ground)
    opened: dict[str, Reflectance] = {}
    factored: dict[tuple[str, int | None, float], InOutFactors] = {}
    objects = []
    for mesh, table in zip(meshes, tables, strict=True):
        text, terms, share = key = (material_words(table), table.terms, table.share)
        if text not in opened:
            told(f"opening {Path(text).name}")
            opened[text] = Lambert(_three(table.albedo)) if table.albedo else open_reflectance(str(table.material))
        if key not in factored:
            told(f"factoring {Path(text).name}")
            factored[key] = factor(opened[text], terms, share)
        objects.append(Placed(mesh, text, opened[text], factored[key]))
    starts = np.cumsum([0, *(len(mesh.positions) for mesh in meshes)])
    occluder = Occluder(
        np.concatenate([mesh.positions for mesh in meshes]),
        np.concatenate([mesh.triangles + start for mesh, start in zip(meshes, starts, strict=False)]),
    )
    return Stand(scene, tuple(objects), occluder, tuple(notes))


def relit(
    ready: Stand, blocks: Path | None = None, progress: Callable[[str, int, int], object] | None = None
) -> tuple[RelitObject, ...]:
    """The transport of every object; `blocks` is where finished blocks are kept for a later run.

    `progress` is told (object, blocks done, blocks). Raises BadInput for a folder of another scene's blocks.
    """
    scene, found = ready.scene, []
    for number, each in enumerate(ready.objects):

        def told(done: int, count: int, name: str = each.mesh.name) -> None:
            if progress is not None:
                progress(name, done, count)

        folder = None if blocks is None else blocks / f"object_{number}"
        made = transport(each.mesh, each.factors, scene.settings, ready.occluder, folder, told)
        compact = None
        if scene.clusters:
            count = None if scene.clusters < 0 else min(scene.clusters, made.vertices)
            compact = clustered(made, scene.components, clusters=count, seed=scene.seed)
        found.append(RelitObject(each.mesh, each.material, made, compact))
    return tuple(found)


def material_words(table: SceneObject | Ground) -> str:
    """The material as tables and reports name it."""
    return table.material if table.material is not None else f"albedo {', '.join(f'{x:g}' for x in table.albedo or ())}"


def _three(albedo: tuple[float, ...]) -> tuple[float, ...]:
    return albedo * 3 if len(albedo) == 1 else albedo


def open_reflectance(text: str) -> Reflectance:
    """A material's name, a measurement's file, or a fit: the folder or the file that `factorize` wrote."""
    place = Path(text)
    if not text.startswith(MATERIAL_PREFIX) and (place.is_dir() or place.name == FACTORIZATION):
        return open_result(place)
    return open_source(text).reflectance


def _placed(each: SceneObject) -> Mesh:
    """The object's mesh, turned about y, scaled and moved."""
    if each.mesh.startswith(SHAPE_PREFIX):
        mesh = _SHAPES[each.mesh.removeprefix(SHAPE_PREFIX)]()
    else:
        mesh = read_mesh(each.mesh)
    angle = math.radians(each.turn)
    turn = np.array([[math.cos(angle), 0, math.sin(angle)], [0, 1, 0], [-math.sin(angle), 0, math.cos(angle)]])
    return replace(
        mesh, positions=mesh.positions @ turn.T * each.size + np.array(each.at), normals=mesh.normals @ turn.T
    )
