"""Pictures of relit objects: the first triangle along each pixel's rays, its vertices' light mixed over it.

As a graphics card does with colours at vertices, and as Wang et al. show their results. Four rays a pixel; what is
behind the objects is the environment itself.
"""

from collections.abc import Sequence

import numpy as np
import torch

from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.sphere import SphereImage
from homofact.rendering.tonemap import choose_exposure, tonemap
from homofact.scene.cameras import Camera
from homofact.scene.meshes import MeshGroup

_RAYS = 2


def picture(
    meshes: Sequence[Mesh], colours: Sequence[np.ndarray], occluder: Occluder, camera: Camera, light: EnvironmentMap
) -> tuple[np.ndarray, np.ndarray]:
    """(radiance (H, W, 3) float64, the part of each pixel that objects cover (H, W)).

    `colours` are the vertices' radiance (V, 3) towards the camera; `occluder` holds the meshes in this order.
    """
    w = camera.rays(_RAYS)
    shape = w.shape[:3]
    flat = w.reshape(-1, 3)
    triangle, weights = occluder.first(np.array(camera.eye)[None], flat)
    corners = MeshGroup(meshes).triangles
    values = np.concatenate(colours).astype(np.float64)
    hit = triangle >= 0
    found = np.array(np.broadcast_to(light.look_up(torch.from_numpy(flat))[0].numpy(), flat.shape))
    found[hit] = (values[corners[triangle[hit]]] * weights[hit][..., None]).sum(1)
    return found.reshape(*shape, 3).mean(2), hit.reshape(shape).mean(2)


def displayed_picture(radiance: np.ndarray, coverage: np.ndarray, exposure: float | None = None) -> np.ndarray:
    """8-bit sRGB (H, W, 3) of a picture, at the exposure that suits its objects unless one is given."""
    shown = torch.from_numpy(np.maximum(radiance, 0))
    chosen = choose_exposure(SphereImage(shown, torch.from_numpy(coverage))) if exposure is None else exposure
    whole = SphereImage(shown, torch.ones(coverage.shape, dtype=torch.float64))
    return tonemap(whole, chosen).pixels.numpy()
