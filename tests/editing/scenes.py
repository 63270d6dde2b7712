"""Small scenes for the tests of editing."""

from functools import lru_cache

import numpy as np
import pytest
import torch

from homofact.brdf.analytic import AshikhminShirley, CookTorrance, Lambert
from homofact.editing import models
from homofact.editing.material import Editable
from homofact.editing.precompute import prepare
from homofact.editing.scene import EditObject, EditScene, PreparedScene
from homofact.meshes.shapes import ground, sphere
from homofact.scene.cameras import Camera
from homofact.scene.lighting import Lighting, named_lighting

pytest.importorskip("embreex", reason="embreex is not installed: pip install 'homofact[relight]'")

PAINT = CookTorrance((0.2, 0.1, 0.05), (0.5, 0.6, 0.7), 0.25, 0.05)
BRUSHED = AshikhminShirley((0.2, 0.1, 0.05), (0.3, 0.4, 0.5), 60, 10)
FLOOR = Lambert((0.5, 0.5, 0.5))
VIEW = Camera((0.0, 1.2, 4.0), (0.0, -0.1, 0.0), 40, (24, 24), "front")


def single(material: Editable, lighting: Lighting | None = None, views: tuple[Camera, ...] = (VIEW,)) -> EditScene:
    """A ball alone."""
    return EditScene((EditObject(sphere(24), material),), lighting or named_lighting("studio"), views)


def on_the_floor(material: Editable) -> EditScene:
    """A ball on a floor, which it shadows, from two sides."""
    floor = models.light_view(FLOOR, "floor")
    side = Camera((3.5, 1.5, 1.0), (0.0, -0.1, 0.0), 40, (16, 20), "side")
    things = (EditObject(sphere(24), material), EditObject(ground(2.0, -1.0, 8), floor, {"diffuse": checks}))
    return EditScene(things, named_lighting("overcast"), (VIEW, side))


def checks(points: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """A floor of squares, light and dark."""
    even = (np.floor(points[:, 0] * 2) + np.floor(points[:, 2] * 2)) % 2 == 0
    return np.where(even[:, None], 1.0, 0.4) * np.ones(3)


@lru_cache(maxsize=8)
def prepared_paint(form: str = "full") -> PreparedScene:
    """A ball of Cook-Torrance paint on a floor, in few bands."""
    return prepare(on_the_floor(models.cook_torrance(PAINT, "paint", (64, 32))), 200, form)


def relative(found: torch.Tensor, expected: torch.Tensor) -> float:
    """Relative RMS."""
    return float((found - expected).square().mean().sqrt() / expected.square().mean().sqrt())
