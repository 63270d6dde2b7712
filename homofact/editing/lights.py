"""Distant light as spherical triangles of constant radiance (Ben-Artzi et al. 2006, section 5.2).

The eight faces of an octahedron are divided into four, at the middles of their edges, guided by the importance of
Agarwal et al. (2003): the triangle with the largest E · min(Ω, .01)^¼ is divided next, where E = ∫ L dω over the
triangle (mean of the channels) and Ω is its solid angle. Triangles without light are not divided, and neither are
triangles smaller than a quarter of a texel of the map, within which radiance is constant.

E is the sum over points that are spread evenly over each texel of the map; each point belongs to the triangle that
contains it. The radiance of a triangle is the mean over its points. All radiances are then scaled by one factor per
channel, close to 1, which preserves the total energy of the light. A directional light becomes one triangle of the
sun's size about its direction.
"""

import heapq
import math
from dataclasses import dataclass
from itertools import count

import numpy as np
import torch

from homofact.errors import BadInput
from homofact.rendering.light import DirectionalLight, EnvironmentMap
from homofact.scene.lighting import Lighting, ring_directions, solid_angles

LARGEST, POWER = 0.01, 0.25
SUN = 2 * math.pi * (1 - math.cos(math.radians(0.2665)))
_POINTS_A_LIGHT = 64
_CORNERS = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=np.float64)
_FACES = [(x, y, z) if (x + y + z) % 2 == 1 else (x, z, y) for x in (0, 1) for y in (2, 3) for z in (4, 5)]


@dataclass(frozen=True)
class TriangleLights:
    """M spherical triangles, float64, in the world's frame (y up).

    `vertices` (V, 3) are unit vectors, shared by neighbours. `triangles` (M, 3) are indices of the corners, and
    `middles` (M, 3) indices of the edges' midpoints; midpoint k is opposite to corner k. `sizes` (M, 4) are the shares
    of the solid angle of the three triangles at the corners and of the one between the midpoints. `centres` (M, 3) are
    unit vectors, `solid_angles` (M,) are in sr, and `radiance` (M, C) is the mean over each triangle.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    middles: np.ndarray
    sizes: np.ndarray
    centres: np.ndarray
    solid_angles: np.ndarray
    radiance: np.ndarray

    @property
    def count(self) -> int:
        """M."""
        return len(self.triangles)

    @property
    def channels(self) -> int:
        """C."""
        return int(self.radiance.shape[1])

    @property
    def energy(self) -> np.ndarray:
        """∫ L dω (C,)."""
        return self.solid_angles @ self.radiance


def triangle_lights(lighting: Lighting, number: int, channels: int | None = None) -> TriangleLights:
    """The lighting as about `number` triangles (400 for a preview, 4000), in as many channels as it has, or `channels`.

    Triangles without light are left out, so there may be fewer. Raises BadInput for a number below 8, and for coloured
    light whose channels differ from `channels`.
    """
    if number < 8:
        raise BadInput(where="triangles", found=number, expected="at least 8")
    maps = [each for each in lighting.lights if isinstance(each, EnvironmentMap)]
    widest = max(int(each.radiance.shape[2]) if isinstance(each, EnvironmentMap) else len(each.levels())
                 for each in lighting.lights)  # fmt: skip
    wanted = channels or widest
    if widest not in (1, wanted):
        found = f"light of {widest} channels"
        raise BadInput(where="lighting", found=found, expected=f"{wanted}, as the materials have, or grey")
    tree = _Tree()
    radiances: list[np.ndarray] = []
    if maps:
        points, weights, smallest = _points(maps, max(number * _POINTS_A_LIGHT, 1), wanted)
        radiances = _divide(tree, points, weights, smallest, number, maps)
    for light in lighting.lights:
        if isinstance(light, DirectionalLight) and any(light.levels()):
            tree.add_small(light.unit().numpy(), SUN)
            radiances.append(np.broadcast_to(np.asarray(light.levels()), (wanted,)) / SUN)
    return tree.lights(np.array(radiances))


def even_triangles(number: int, channels: int) -> TriangleLights:
    """Divide all directions into at most `number` triangles of similar size, with radiance 1."""
    tree = _Tree()
    tree.leaves = [*_FACES]
    while 4 * len(tree.leaves) <= number:
        tree.leaves = [child for leaf in tree.leaves for child in tree.children(leaf)]
    return tree.lights(np.ones((len(tree.leaves), channels)))


class _Tree:
    """A subdivision into triangles, stored as indices of shared corners."""

    def __init__(self) -> None:
        self.vertices: list[np.ndarray] = [*_CORNERS]
        self.middle_of: dict[tuple[int, int], int] = {}
        self.leaves: list[tuple[int, int, int]] = []

    def middle(self, a: int, b: int) -> int:
        """Return the index of an edge's midpoint, adding it if necessary."""
        key = (min(a, b), max(a, b))
        if key not in self.middle_of:
            total = self.vertices[a] + self.vertices[b]
            self.middle_of[key] = len(self.vertices)
            self.vertices.append(total / np.linalg.norm(total))
        return self.middle_of[key]

    def children(self, triangle: tuple[int, int, int]) -> list[tuple[int, int, int]]:
        """Return the four parts of a triangle, the middle one last."""
        a, b, c = triangle
        ab, bc, ca = self.middle(a, b), self.middle(b, c), self.middle(c, a)
        return [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]

    def corners(self, triangle: tuple[int, int, int]) -> np.ndarray:
        """Return the corners (3, 3) of a triangle."""
        return np.stack([self.vertices[k] for k in triangle])

    def add_small(self, axis: np.ndarray, solid_angle: float) -> None:
        """Add a small equilateral leaf triangle about a direction."""
        # Of radius r, an equilateral triangle has (3√3/4) r².
        radius = math.sqrt(solid_angle / (3 * math.sqrt(3) / 4))
        across = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
        across /= np.linalg.norm(across)
        other = np.cross(axis, across)
        first = len(self.vertices)
        for k in range(3):
            turn = 2 * math.pi * k / 3
            corner = axis + math.tan(radius) * (math.cos(turn) * across + math.sin(turn) * other)
            self.vertices.append(corner / np.linalg.norm(corner))
        self.leaves.append((first, first + 1, first + 2))

    def lights(self, radiance: np.ndarray) -> TriangleLights:
        """Return the leaves with nonzero radiance (M, C) as triangle lights."""
        lit = np.asarray(radiance.any(1))
        leaves = [leaf for leaf, each in zip(self.leaves, lit, strict=True) if each]
        middles = [(self.middle(b, c), self.middle(c, a), self.middle(a, b)) for a, b, c in leaves]
        used, numbers = np.unique(np.array([leaves, middles]), return_inverse=True)
        numbers = numbers.reshape(2, -1, 3)
        vertices = np.stack(self.vertices)[used]
        corners = vertices[numbers[0]]
        centres = corners.sum(1)
        between = vertices[numbers[1]]
        parts = [np.stack((corners[:, k], between[:, (k + 1) % 3], between[:, (k + 2) % 3]), 1) for k in range(3)] + [
            between
        ]
        sizes = np.stack([triangle_solid_angles(part) for part in parts], 1)
        return TriangleLights(
            vertices,
            numbers[0].astype(np.int64),
            numbers[1].astype(np.int64),
            sizes / sizes.sum(1, keepdims=True),
            centres / np.linalg.norm(centres, axis=1, keepdims=True),
            triangle_solid_angles(corners),
            radiance[lit],
        )


def triangle_solid_angles(corners: np.ndarray) -> np.ndarray:
    """Return steradians (M,) of spherical triangles with unit corners (M, 3, 3) (Van Oosterom and Strackee 1983)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    volume = np.abs((a * np.cross(b, c)).sum(1))
    return 2 * np.arctan2(volume, 1 + (a * b).sum(1) + (b * c).sum(1) + (c * a).sum(1))


def _divide(
    tree: _Tree, points: np.ndarray, weights: np.ndarray, smallest: float, number: int, maps: list[EnvironmentMap]
) -> list[np.ndarray]:
    """Fill the tree's leaves; return their radiances. `weights` (P, 1 + C) are the points' solid angle and energy."""
    order, heap, done = count(), [], []

    def put(triangle: tuple[int, int, int], own: np.ndarray) -> None:
        angle = float(triangle_solid_angles(tree.corners(triangle)[None])[0])
        energy = float(weights[own, 1:].mean(1).sum())
        if energy > 0 and angle > smallest:
            heapq.heappush(heap, (-energy * min(angle, LARGEST) ** POWER, next(order), triangle, own))
        else:
            done.append((triangle, own))

    inside = _sorted_into([tree.corners(face) for face in _FACES], points)
    for k, face in enumerate(_FACES):
        put(face, np.flatnonzero(inside == k))
    while heap and len(heap) + len(done) + 3 <= number:
        _, _, triangle, own = heapq.heappop(heap)
        children = tree.children(triangle)
        # The middle child last: what no corner's child holds is in it.
        inside = _sorted_into([tree.corners(child) for child in children[:3]], points[own])
        for k, child in enumerate(children):
            put(child, own[inside == (k if k < 3 else -1)])
    found = [(triangle, own) for _, _, triangle, own in heap] + done
    tree.leaves = [triangle for triangle, _ in found]
    corners = np.stack([tree.corners(triangle) for triangle in tree.leaves])
    angles = triangle_solid_angles(corners)
    radiances = np.zeros((len(found), weights.shape[1] - 1))
    for k, (_, own) in enumerate(found):
        share = weights[own, 0].sum()
        if share > 0:
            radiances[k] = weights[own, 1:].sum(0) / share
        else:
            centre = torch.from_numpy(corners[k].sum(0) / np.linalg.norm(corners[k].sum(0)))
            radiances[k] = sum(each.look_up(centre)[0].numpy() for each in maps)
    total = angles @ radiances
    return list(radiances * np.where(total > 0, weights[:, 1:].sum(0) / np.where(total > 0, total, 1), 0))


def _sorted_into(corners: list[np.ndarray], points: np.ndarray) -> np.ndarray:
    """Return the index of the triangle, of either winding, that contains each point, or −1."""
    found = np.full(len(points), -1)
    for k, (a, b, c) in enumerate(corners):
        sides = np.stack((points @ np.cross(a, b), points @ np.cross(b, c), points @ np.cross(c, a)))
        turned = sides if np.dot(a, np.cross(b, c)) > 0 else -sides
        found[(turned >= 0).all(0) & (found < 0)] = k
    return found


def _points(maps: list[EnvironmentMap], wanted: int, channels: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Return points (P, 3), their solid angles and energies (P, 1 + C), and the triangles' least solid angle.

    All maps are sampled on the grid of the finest one. Each texel gets at least 4 points, and more if necessary for
    `wanted` points in total.
    """
    rows = max(int(each.radiance.shape[0]) for each in maps)
    columns = max(int(each.radiance.shape[1]) for each in maps)
    times = max(2, math.ceil(math.sqrt(wanted / (rows * columns))))
    edges = torch.cos(torch.arange(rows * times + 1, dtype=torch.float64) * (math.pi / (rows * times)))
    # In the middle of each point's own solid angle.
    y = (edges[:-1] + edges[1:]) / 2
    points = ring_directions(y, torch.sqrt(1 - y**2), columns * times, maps[0].turn)
    radiance = np.zeros((len(points), channels))
    for each in maps:
        radiance += each.look_up(points)[0].numpy()
    angle = solid_angles(rows * times, columns * times).numpy()
    smallest = float(solid_angles(rows, columns).max()) / 4
    return points.numpy(), np.concatenate((angle[:, None], angle[:, None] * radiance), 1), smallest
