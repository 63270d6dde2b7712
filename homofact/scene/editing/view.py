"""What a fixed view sees: one surface point a pixel, with its frame and the direction to the viewer."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from homofact.errors import BadInput
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.tangents import frames

MOST_PIXELS = 2048


@dataclass(frozen=True)
class View:
    """A pinhole camera at `position` that looks at `target`, world frame (y up).

    `width` × `height` pixels; `degrees` is the vertical field of view. Raises BadInput for sizes outside 8 … 2048, an
    angle outside 1 … 170, and for places that are not finite or the same.
    """

    name: str
    position: tuple[float, float, float]
    target: tuple[float, float, float] = (0.0, 0.0, 0.0)
    width: int = 512
    height: int = 512
    degrees: float = 35.0

    def __post_init__(self) -> None:
        """Refuse what is no camera."""
        for what, value in (("width", self.width), ("height", self.height)):
            if not 8 <= value <= MOST_PIXELS:
                raise BadInput(f"{what}: found {value}, expected 8 to {MOST_PIXELS} pixels")
        if not 1 <= self.degrees <= 170:
            raise BadInput(f"degrees: found {self.degrees}, expected 1 to 170")
        forward = np.subtract(self.target, self.position)
        if not np.isfinite(forward).all() or not np.linalg.norm(forward) > 0:
            raise BadInput(f"position: found {self.position} and the target {self.target}, expected two finite places")

    def rays(self) -> tuple[np.ndarray, np.ndarray]:
        """Origin (3,) and unit directions (H·W, 3) through the pixels' centres, row by row from the top left."""
        forward = np.subtract(self.target, self.position).astype(np.float64)
        forward /= np.linalg.norm(forward)
        # Straight up or down there is no horizon: x is to the right.
        across = np.cross(forward, (0.0, 1.0, 0.0))
        right = across / np.linalg.norm(across) if np.linalg.norm(across) > 1e-9 else np.array([1.0, 0.0, 0.0])
        up = np.cross(right, forward)
        half = math.tan(math.radians(self.degrees) / 2)
        x = ((np.arange(self.width) + 0.5) / self.width * 2 - 1) * half * self.width / self.height
        y = (1 - (np.arange(self.height) + 0.5) / self.height * 2) * half
        rays = forward + x[None, :, None] * right + y[:, None, None] * up
        rays = rays.reshape(-1, 3)
        return np.array(self.position, np.float64), rays / np.linalg.norm(rays, axis=1, keepdims=True)


@dataclass(frozen=True)
class Pixels:
    """The P pixels of a view that see something, float64.

    `numbers` (P,) row by row from the top left; `objects` (P,) which mesh each sees; `points` (P, 3) in the world;
    `frames` (P, 3, 3), rows t, b, n; `wo` (P, 3) unit, in the frame.
    """

    numbers: np.ndarray
    objects: np.ndarray
    points: np.ndarray
    frames: np.ndarray
    wo: np.ndarray

    def __len__(self) -> int:
        """P."""
        return len(self.numbers)

    def some(self, rows: np.ndarray) -> "Pixels":
        """Those of the given rows."""
        return Pixels(*(getattr(self, name)[rows] for name in ("numbers", "objects", "points", "frames", "wo")))


class Solids:
    """Several meshes as one that blocks light. Raises BadInput as `meshes.occlusion.Occluder`."""

    def __init__(self, meshes: Sequence[Mesh]) -> None:
        starts = np.cumsum([0, *(len(mesh.positions) for mesh in meshes)])
        self._positions = np.concatenate([mesh.positions for mesh in meshes])
        self._normals = np.concatenate([mesh.normals for mesh in meshes])
        pairs = zip(meshes, starts, strict=False)
        self._triangles = np.concatenate([mesh.triangles + start for mesh, start in pairs])
        self._owners = np.repeat(np.arange(len(meshes)), [len(mesh.triangles) for mesh in meshes])
        self.occluder = Occluder(self._positions, self._triangles)

    def seen(self, view: View) -> Pixels:
        """What is nearest through each pixel; normals are interpolated.

        A pixel whose interpolated normal is turned away from the viewer, as happens on coarse rims, is not covered.
        """
        origin, rays = view.rays()
        triangle, weights = self.occluder.first(np.broadcast_to(origin, rays.shape), rays)
        hit = np.flatnonzero(triangle >= 0)
        corners, weights = self._triangles[triangle[hit]], weights[hit, :, None]
        points = (self._positions[corners] * weights).sum(1)
        normals = (self._normals[corners] * weights).sum(1)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        frame = frames(normals)
        wo = np.einsum("pij,pj->pi", frame, -rays[hit])
        kept = wo[:, 2] > 0
        owners = self._owners[triangle[hit]]
        return Pixels(hit[kept], owners[kept], points[kept], frame[kept], wo[kept])
