"""A small scene for the tests of the page: every kind of curve, two views, a pattern, an anisotropic material."""

from functools import lru_cache
from typing import Any

import torch
from editing.scenes import BRUSHED, FLOOR, PAINT, checks
from torch import Tensor

from homofact.editing import models
from homofact.editing.curves import Formula, flat
from homofact.editing.material import Editable, EditableTerm, Slot
from homofact.editing.precompute import prepare
from homofact.editing.scene import EditObject, EditScene, PreparedScene
from homofact.meshes.mesh import Mesh
from homofact.meshes.shapes import ground, sphere
from homofact.scene.cameras import Camera
from homofact.scene.lighting import named_lighting


def both_ends() -> Editable:
    """A curve at both ends, as P of HF, and one over θh; the quotient has a direction of its own."""

    def quotient(wi: Tensor, wo: Tensor) -> Tensor:
        return (0.2 + 0.1 * wi[:, :1] * wo[:, :1]) * torch.tensor([1.0, 0.6, 0.3], dtype=wi.dtype)

    half = Formula(lambda gamma: (0.3 + torch.exp(-((gamma / 0.4) ** 2)))[:, None].expand(-1, 3), 3)
    slots = (Slot("half", "theta_h", half, 32), Slot("directions", "theta_i", flat(3), 32, also_outgoing=True))
    return Editable("clay", ("R", "G", "B"), (EditableTerm("whole", quotient, slots),), ("made for a test",))


def moved(x: float, z: float) -> Mesh:
    """A ball of half the size."""
    mesh = sphere(12)
    return Mesh(0.5 * mesh.positions + [x, -0.5, z], mesh.normals, mesh.triangles, "ball")


def page_scene() -> EditScene:
    """Three balls on a floor, seen twice."""
    things = (
        EditObject(moved(-1.1, 0.3), models.cook_torrance(PAINT, "paint", (64, 32))),
        EditObject(moved(0.0, 0.6), models.ashikhmin_shirley(BRUSHED, "steel", (32, 64))),
        EditObject(moved(1.1, 0.2), both_ends()),
        EditObject(ground(2.0, -1.0, 8), models.light_view(FLOOR, "floor"), {"diffuse": checks}),
    )
    front = Camera((0.0, 1.2, 4.0), (0.0, -0.3, 0.0), 40, (28, 20), "front")
    side = Camera((3.0, 1.5, 2.0), (0.0, -0.3, 0.0), 40, (16, 20), "side")
    return EditScene(things, named_lighting("overcast"), (front, side))


@lru_cache(maxsize=1)
def page_prepared() -> PreparedScene:
    """The scene with 120 lights, at low rank."""
    return prepare(page_scene(), 120)


def materials() -> list[Editable]:
    """The materials of the scene, in the order of its objects."""
    return [thing.material for thing in page_prepared().scene.objects]


def quiet(driver: Any) -> None:
    """Wait until the page has drawn what it was asked for, all columns are in, and no pointer is down."""
    driver.execute_async_script(
        "const done = arguments[0];"
        # On a busy machine the page may not have made its view yet.
        "(function wait() { const p = globalThis.homofact?.page;"
        " p?.view && p.pending === null && !p.view.pending && !p.todo.size && !p.hands.drag"
        " ? done() : setTimeout(wait, 15); })();"
    )
