"""A material under an engine's own sky: which levels of the chain that the engine has made to read, and how far off.

The table (`rendering.prefilter.LevelTable`) is fitted for the engine's kernels (`rendering.chain_kernels`). Its error
is measured on a sphere under skies that it never saw (`rendering.made_skies`), the kernels integrated themselves: what
the few texels of an engine's levels add is not in it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from homofact.brdf.reflectance import Reflectance
from homofact.exporting.prefiltered import compared, picture
from homofact.rendering.chain_kernels import ChainKernels
from homofact.rendering.filtered import FilteredMaterial, Surroundings
from homofact.rendering.made_skies import MADE_SKIES, made_sky
from homofact.rendering.prefilter import LevelTable, Prefiltered, level_table
from homofact.rendering.sky_chain import FilteredSky
from homofact.rendering.split_sum import response_of
from homofact.shading.languages import Language, shader
from homofact.shading.program import Program

PREFIX = "homofact_light"
LOBES = 3
SIZE = 48  # pixels of the sphere whose picture is compared
_ROWS = 128  # of the skies
POOR = 0.1  # an error above this is warned of
_TITLE = (
    "The fit under the engine's own sky, filtered by GGX: radiance towards wo, linear, on the sky's own scale.",
    "sky_1(direction, level) is the sky at a level of its chain, sky_2(n, 0.0) the irradiance over pi.",
    "Table: bilinear, clamped to the edge, no mipmaps.",
)


@dataclass(frozen=True)
class EngineLight:
    """A `table` as half floats hold it, for `kernels`; `errors` are the relative RMS of a sphere by sky."""

    table: LevelTable
    kernels: ChainKernels
    errors: Mapping[str, float]

    @property
    def worst(self) -> float:
        """The largest error."""
        return max(self.errors.values())

    @property
    def texels(self) -> np.ndarray:
        """The table (rows, columns, 4) in half floats."""
        return self.table.table.numpy().astype(np.float16)

    def code(self, language: Language, prefix: str = PREFIX) -> str:
        """`PREFIX_reflected(n, wo)`, of an anisotropic material (n, t, b, wo), its one texture the table."""
        return shader(self.program(), language, prefix)

    def program(self) -> Program:
        """What `code` prints."""
        return self.table.program(((len(self.kernels.alphas), 6, 0, 0), (1, 6, 0, 0)), _TITLE)

    def record(self) -> dict[str, Any]:
        """JSON-able, for the report of the export."""
        return {
            "reads": self.table.lobes + 1,
            "bytes": self.texels.nbytes,
            "relative_rms": dict(self.errors),
            "meaning": "root mean square difference of a sphere's picture from the exact integration of the exported"
            " fit under skies that were not fitted to, over that picture's root mean square",
        }

    def off(self) -> str:
        """A sentence: how far a sphere is off."""
        shown = ", ".join(f"{error:.1%} ({name})" for name, error in self.errors.items())
        return f"A sphere is off by {shown}, relative RMS against the exact integration."

    def sentence(self) -> str:
        """What the screen says."""
        reads, size = self.table.lobes + 1, self.texels.nbytes
        return f"Environments: {reads} reads of the engine's own filtered sky by a table of {size} bytes. {self.off()}"

    @property
    def warning(self) -> str:
        """What to beware of; empty where the errors are small."""
        if self.worst <= POOR:
            return ""
        return (
            f"under small bright lights the engine's own sky holds this material's lobes within {self.worst:.0%} only;"
            " `prefilter='SKY'` filters a sky for it"
        )


def engine_light(reflectance: Reflectance, kernels: ChainKernels) -> EngineLight:
    """The table of a fit for an engine's kernels, and its errors.

    Raises BadInput for channels that are no picture's, and values that are not finite.
    """
    stored = level_table(response_of(reflectance, kernels, LOBES)).rounded(np.float16)
    material, errors = FilteredMaterial.of(reflectance), {}
    for name in MADE_SKIES:
        light = made_sky(name, _ROWS)
        shown = picture(Prefiltered(stored, FilteredSky.of(light, kernels)), SIZE)
        errors[name] = compared(shown, material.under(Surroundings.of(light, SIZE)))
    return EngineLight(stored, kernels, errors)
