"""From a scene to relit objects: meshes placed, materials opened and factored, transport precomputed."""

from collections.abc import Callable
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
from homofact.scene.transport.factors import InOutFactors, factor
from homofact.scene.transport.precompute import Cost, Transport, cost, transport
from homofact.scene.transport.relight import Relit
from homofact.scene.transport.scene import Ground, RelightScene, SceneObject

Stage = Callable[[str], object]


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
        """What all of its transport will take, at most."""
        each = [cost(len(o.mesh.positions), o.factors.terms, self.scene.settings) for o in self.objects]
        stored = sum(c.most_bytes for c in each)
        peak = max(c.peak_bytes - c.most_bytes for c in each) + stored
        return Cost(sum(c.rays for c in each), stored, peak)


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
    opened: dict[str, Reflectance] = {}
    factored: dict[tuple[str, int | None, float], InOutFactors] = {}
    objects = []
    for mesh, table in zip(meshes, tables, strict=True):
        text, terms, share = key = (material_words(table), table.terms, table.share)
        if text not in opened:
            told(f"opening {Path(text).name}")
            opened[text] = Lambert(three(table.albedo)) if table.albedo else open_reflectance(str(table.material))
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
