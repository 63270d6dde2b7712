"""From a scene to relit objects: meshes placed, materials opened and factored, transport precomputed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.reflectance import Reflectance
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.prepare import prepared
from homofact.meshes.shapes import ground
from homofact.scene.placed import lowest, material_words, open_reflectance, placed_mesh, three
from homofact.scene.transport.clusters import Clustered, clustered
from homofact.scene.transport.compact import lit_tuples
from homofact.scene.transport.factoring import SHARE, factor
from homofact.scene.transport.factors import InOutFactors
from homofact.scene.transport.harmonic import Harmonic, harmonic
from homofact.scene.transport.plan import ObjectPlan, plan_object
from homofact.scene.transport.precompute import Cost, Transport, TransportSettings, cost, transport
from homofact.scene.transport.scene import Ground, RelightScene, SceneObject

Stage = Callable[[str], object]
# Bytes of memory of a vertex and a triangle: the object's mesh, that of all, Embree's with its tree.
_PLACE_BYTES, _TRIANGLE_BYTES = 200, 300
# Clustering works on all of an object's transport in memory: a sparse matrix of it takes so many times as much.
_CLUSTERED = 8


@dataclass(frozen=True)
class Placed:
    """An object before its transport: its mesh in the world, the material, its factors and how it will be held.

    `plan` says why, where the scene has a tolerance.
    """

    mesh: Mesh
    material: str
    reflectance: Reflectance
    factors: InOutFactors
    settings: TransportSettings
    plan: ObjectPlan | None = None


@dataclass(frozen=True)
class RelitObject:
    """An object with its transport, and the compact form where it was asked for."""

    mesh: Mesh
    material: str
    transport: Transport
    compact: Clustered | Harmonic | None

    @property
    def form(self) -> str:
        """How its transport is held: for tables."""
        if isinstance(self.compact, Harmonic):
            return f"harmonics to order {self.compact.order}"
        return "all frequencies" if self.compact is None else "all frequencies, clustered"

    @property
    def nbytes(self) -> int:
        """What relighting reads: the compact form where there is one, and the view maps."""
        stored = self.transport.nbytes if self.compact is None else self.compact.nbytes
        return stored + self.transport.factors.view.nbytes

    def tuples(self, light: np.ndarray) -> np.ndarray:
        """K-tuples (V, K, 3) under a cube map of radiance, by the form that is used."""
        return lit_tuples(self.transport, self.compact, light)


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
        each = [cost(len(o.mesh.positions), o.factors.terms, o.settings, on_disk=True) for o in self.objects]
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
        mesh, found = prepared(placed_mesh(each))
        meshes.append(mesh)
        notes += found
    tables: list[SceneObject | Ground] = list(scene.objects)
    if scene.ground is not None:
        meshes.append(ground(scene.ground.half, lowest(meshes), scene.ground.steps))
        tables.append(scene.ground)
    occluder = Occluder(*together(meshes))
    opened: dict[str, Reflectance] = {}
    factored: dict[tuple[object, ...], InOutFactors] = {}
    objects = []
    for mesh, table in zip(meshes, tables, strict=True):
        text = material_words(table)
        if text not in opened:
            told(f"opening {Path(text).name}")
            opened[text] = Lambert(three(table.albedo)) if table.albedo else open_reflectance(str(table.material))
        if scene.reflected is not None:
            told(f"planning {mesh.name}")
            plan = plan_object(
                mesh, text, opened[text], occluder, scene.light, scene.cameras[0].eye, scene.reflected, scene.settings,
                table.terms, scene.seed,
            )  # fmt: skip
            objects.append(Placed(mesh, text, opened[text], plan.factors, plan.settings(scene.settings), plan))
            continue
        key = (text, table.terms, table.error, table.share)
        if key not in factored:
            told(f"factoring {Path(text).name}")
            share = SHARE if table.share is None else table.share
            factored[key] = factor(opened[text], table.terms, share, error=table.error, light=scene.light)
        objects.append(Placed(mesh, text, opened[text], factored[key], scene.settings))
    return Stand(scene, tuple(objects), occluder, tuple(notes))


def together(meshes: Sequence[Mesh]) -> tuple[np.ndarray, np.ndarray]:
    """Positions and triangles of all meshes as one."""
    starts = np.cumsum([0, *(len(mesh.positions) for mesh in meshes)])
    return (
        np.concatenate([mesh.positions for mesh in meshes]),
        np.concatenate([mesh.triangles + start for mesh, start in zip(meshes, starts, strict=False)]),
    )


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
        made = transport(each.mesh, each.factors, each.settings, ready.occluder, folder, told)
        compact = None
        if each.plan is not None and each.plan.chosen.order is not None:
            compact = harmonic(made, each.plan.chosen.order)
        elif scene.clusters:
            count = None if scene.clusters < 0 else min(scene.clusters, made.vertices)
            compact = clustered(made, scene.components, clusters=count, seed=scene.seed)
        found.append(RelitObject(each.mesh, each.material, made, compact))
    return tuple(found)
