"""A small scene for tests of the page: a knot in clusters over a ground of its own transport, two skies."""

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import torch

from homofact.geometry.parabolic import from_disc
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.shapes import ground, torus_knot
from homofact.relighting.clusters import Clustered, clustered
from homofact.relighting.factors import InOutFactors, texel_points
from homofact.relighting.page.build import PageObject
from homofact.relighting.page.skies import PageSky, page_sky
from homofact.relighting.precompute import TransportSettings, WaveletTransport, transport
from homofact.relighting.relight import Relit
from homofact.rendering.light import EnvironmentMap
from homofact.scene.cameras import Camera

SIZE = 16
CAMERA = Camera((0.9, 0.8, 3.2), (0.0, -0.1, 0.0), 36.0)


@dataclass(frozen=True)
class Scene:
    """Objects and skies for `write_page`, and what hides a vertex from the eye."""

    objects: tuple[PageObject, ...]
    skies: tuple[PageSky, ...]
    occluder: Occluder


def factors(terms: int, channels: int) -> InOutFactors:
    """Smooth maps of 16 × 16 texels: a bright first term, coloured ones of both signs after it."""
    uv = texel_points(16)
    w = from_disc(uv.reshape(-1, 2) / uv.reshape(-1, 2).norm(dim=1, keepdim=True).clamp_min(1.0)).numpy()
    light = np.stack([w[:, 2] ** (2 * k) * (1 + 0.6 * np.sin(3 * k * w[:, 0] + k)) for k in range(terms)])
    view = np.stack(
        [
            np.stack([0.8 * np.sin(2 * k * w[:, 0] + c * w[:, 1]) for c in range(channels)], 1)
            if k
            else np.broadcast_to(0.3 + 0.1 * np.arange(channels), (256, channels))
            for k in range(terms)
        ]
    )
    return InOutFactors(
        light.reshape(terms, 16, 16).astype(np.float32), view.reshape(terms, 16, 16, channels).astype(np.float32),
        np.ones(terms), float(terms), tuple("RGB"[:channels]),
    )  # fmt: skip


def sky_picture(seed: int, rows: int = 64) -> np.ndarray:
    """A smooth sky (rows, 2·rows, 3) with a sun some thousand times as bright."""
    rng = np.random.default_rng(seed)
    polar, azimuth = np.meshgrid(
        (np.arange(rows) + 0.5) / rows * math.pi, (np.arange(2 * rows) + 0.5) / rows * math.pi, indexing="ij"
    )
    picture = np.stack(
        [1 + rng.uniform(0.2, 0.9) * np.cos(polar + c) * np.sin(azimuth + seed + c) for c in range(3)], -1
    )
    picture[rows // 4, (17 * (seed + 1)) % (2 * rows)] = (2000.0, 1800.0, 1500.0)
    return picture


@cache
def scene() -> Scene:
    """The scene, precomputed once."""
    knot, plane = torus_knot(48, 8), ground(2.0, -1.05, 6)
    occluder = Occluder(
        np.concatenate((knot.positions, plane.positions)),
        np.concatenate((knot.triangles, plane.triangles + len(knot.positions))),
    )
    settings = TransportSettings(SIZE, kept=64)
    made = transport(knot, factors(3, 3), settings, occluder)
    objects = (
        PageObject("knot", knot, clustered(made, 4, 128, clusters=5), "coloured lobes"),
        PageObject("ground", plane, transport(plane, factors(1, 1), settings, occluder), "grey", (1.5, 2.0)),
    )
    skies = tuple(
        page_sky(name, EnvironmentMap(torch.from_numpy(sky_picture(seed))), SIZE)
        for seed, name in enumerate(("one", "two"))
    )
    return Scene(objects, skies, occluder)


def plain(given: Scene) -> Scene:
    """The same with the ground alone, whose transport is its own."""
    return replace(given, objects=given.objects[1:])


def largest(basis: WaveletTransport, kept: int) -> WaveletTransport:
    """The vectors with their largest numbers alone, of equals those of lower places."""
    counts, places = [], []
    for first, last in zip(basis.start[:-1], basis.start[1:], strict=True):
        own = np.argsort(-np.abs(basis.number[first:last].astype(int)), kind="stable")[:kept]
        counts.append(len(own))
        places.append(first + np.sort(own))
    at = np.concatenate(places)
    start = np.concatenate(([0], np.cumsum(counts)))
    return replace(basis, start=start, index=basis.index[at], number=basis.number[at])


def tuples(given: PageObject, light: EnvironmentMap | np.ndarray, kept: int | None = None) -> np.ndarray:
    """K-tuples (V, K, 3) as the library has them, of the largest `kept` numbers where told."""
    basis = given.basis if kept is None else largest(given.basis, kept)
    relit = Relit(basis)
    relit.relight(light)
    return given.transport.mixed(relit.tuples) if isinstance(given.transport, Clustered) else relit.tuples


def whole(objects: tuple[PageObject, ...]) -> Mesh:
    """All meshes as one."""
    starts = np.cumsum([0, *(len(each.mesh.positions) for each in objects)])
    return Mesh(
        np.concatenate([each.mesh.positions for each in objects]),
        np.concatenate([each.mesh.normals for each in objects]),
        np.concatenate([each.mesh.triangles + start for each, start in zip(objects, starts, strict=False)]),
        "all",
    )
