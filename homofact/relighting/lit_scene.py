"""Relit objects under one light, of which any camera takes pictures without new transport."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from homofact.evaluation.wording import counted
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.relighting.lit import LitObject
from homofact.relighting.map_sun import separate_sun
from homofact.relighting.picture import picture
from homofact.rendering.light import EnvironmentMap
from homofact.scene.cameras import Camera
from homofact.scene.meshes import MeshGroup


@dataclass(frozen=True)
class LitScene:
    """Objects under one light: `lit` in the order of their `meshes`, with the `background` behind them.

    `occluder` holds the meshes in this order. Default: it is built from them.
    """

    meshes: Sequence[Mesh]
    lit: Sequence[LitObject]
    background: EnvironmentMap
    occluder: Occluder | None = None

    @property
    def suns(self) -> int:
        """The number of suns beside the map."""
        beside = self.lit[0].sunlight if self.lit else None
        return 0 if beside is None else len(beside.suns)

    @property
    def has_sun_in_map(self) -> bool:
        """Whether the map has a sun: its shadows are those of texels."""
        return separate_sun(self.background)[1] is not None

    def describe(self) -> str:
        """Return the light in a few words."""
        return self.background.describe() + ("" if not self.suns else f" and {counted(self.suns, 'sun')}")

    def radiance(self, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        """Return (radiance (H, W, 3) float64, coverage of each pixel by objects (H, W)) of a camera.

        Raises MissingDependency without Embree.
        """
        occluder = MeshGroup(self.meshes).occluder if self.occluder is None else self.occluder
        colours = [each.terms(camera.eye) for each in self.lit]
        return picture(self.meshes, colours, occluder, camera, self.background, self.lit)
