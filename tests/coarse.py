"""Scenes that are quickly made, for tests whose subject is neither the mesh nor how exact a material's terms are."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import pytest

from homofact.meshes.shapes import sphere, torus_knot
from homofact.relighting import build, decomposition, moments
from homofact.relighting.factored_material import factored
from homofact.scene import meshes


@contextmanager
def coarse_shapes(around: int = 96, across: int = 16, rings: int = 16) -> Iterator[None]:
    """Within it "shape:knot" has around · across vertices, a third of its own, and "shape:sphere" `rings` bands."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(meshes._SHAPES, "knot", partial(torus_knot, around, across))
        patch.setitem(meshes._SHAPES, "sphere", partial(sphere, rings))
        yield


@contextmanager
def coarse_terms() -> Iterator[None]:
    """Within it scenes to relight have terms from half of the rings, turns and nodes, on maps of 32 texels across."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(moments, "_NODES", 12)
        patch.setattr(decomposition, "_ISOTROPIC_GRIDS", ((10, 20), (16, 32), (24, 48)))
        patch.setattr(build, "factored", partial(factored, map_size=32))
        yield
