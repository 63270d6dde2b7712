"""A small scene for tests of lobes on the page: an anisotropic one on a knot, an isotropic one on a ball, a ground."""

from functools import cache

import numpy as np
import relit_scene
import torch
from relit_scene import factors, sky_picture

from homofact.brdf.analytic.cook_torrance import CookTorrance
from homofact.brdf.materials import material
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.shapes import ground, sphere, torus_knot
from homofact.relighting.lobe import SeparateLobe
from homofact.relighting.lobe_table import lobe_table
from homofact.relighting.page.build import PageObject
from homofact.relighting.page.skies import page_sky
from homofact.relighting.precompute import TransportSettings, transport
from homofact.relighting.sight import VertexSight, traced_sight
from homofact.rendering.light import EnvironmentMap

# Finer than what vertices know of their surroundings.
SIZE = 64


@cache
def scene() -> relit_scene.Scene:
    """The scene, precomputed once; the sun of its first sky is more than a thousandth of all light."""
    knot, ball, plane = torus_knot(32, 8), sphere(8), ground(2.0, -1.05, 6)
    ball = Mesh(0.4 * ball.positions + np.array([0.1, 0.9, 0.9]), ball.normals, ball.triangles, "ball")
    meshes, starts = (knot, ball, plane), np.cumsum([0, len(knot.positions), len(ball.positions)])
    occluder = Occluder(
        np.concatenate([mesh.positions for mesh in meshes]),
        np.concatenate([mesh.triangles + start for mesh, start in zip(meshes, starts, strict=True)]),
    )
    settings = TransportSettings(SIZE, kept=16)
    objects = []
    # The ball's lobe is narrower than a texel.
    narrow = CookTorrance((0.1,) * 3, (0.5,) * 3, 0.03, 0.5)
    given = ((knot, material("ashikhmin-shirley-wang").model, "ashikhmin-shirley-wang"), (ball, narrow, "narrow"))
    for mesh, model, name in given:
        lobe = SeparateLobe(lobe_table(model), VertexSight.of(traced_sight(mesh, occluder, SIZE)))
        made = transport(mesh, factors(2, 3), settings, occluder)
        objects.append(PageObject(mesh.name, mesh, made, name, lobe=lobe))
    made = transport(plane, factors(1, 1), settings, occluder)
    objects.append(PageObject("ground", plane, made, "grey", (1.5, 2.0)))
    pictures = (sky_picture(0), 1 + sky_picture(1).clip(max=1.5))
    skies = [
        page_sky(name, EnvironmentMap(torch.from_numpy(each)), SIZE)
        for each, name in zip(pictures, ("sunny", "soft"), strict=True)
    ]
    return relit_scene.Scene(tuple(objects), tuple(skies), occluder)
