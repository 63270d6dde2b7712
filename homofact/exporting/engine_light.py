"""How an engine lights a material by its own sky: the table or closures that it uses, and their error.

An engine with prefiltered skies gets a table (`rendering.prefilter.LevelTable`), fitted for the kernels of its levels
(`rendering.chain_kernels`). An engine that integrates skies itself gets closures (`rendering.closures`). The error is
measured on a sphere under skies that are not used for the fit (`rendering.made_skies`). homofact integrates the kernels
exactly, so the error does not include the low resolution of an engine's levels.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from homofact.brdf.reflectance import Reflectance
from homofact.exporting.prefiltered import compared, picture
from homofact.rendering.chain_kernels import ChainKernels
from homofact.rendering.closure_fit import LOBES as CLOSURE_LOBES
from homofact.rendering.closure_fit import closures_of
from homofact.rendering.closures import Closures
from homofact.rendering.filtered import FilteredMaterial, Surroundings
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.lobe_patches import FULL
from homofact.rendering.made_skies import MADE_SKIES, made_sky
from homofact.rendering.prefilter import LevelTable, Prefiltered, level_table
from homofact.rendering.sky_chain import FilteredSky
from homofact.rendering.sphere import SphereImage
from homofact.rendering.split_sum import response_of
from homofact.shading.languages import Language, shader
from homofact.shading.program import Program

PREFIX = "homofact_light"
LOBES = 3
SIZE = 48  # pixels of the sphere whose picture is compared
_ROWS = 128  # of the skies
# Of so small a picture, half as many azimuths change no error by more than a thousandth of the picture.
_FINENESS = FULL._replace(azimuths=96)
POOR = 0.1  # an error above this is warned of
_TITLE = (
    "The fit under the engine's own sky, filtered by GGX: radiance towards wo, linear, on the sky's own scale.",
    "sky_1(direction, level) is the sky at a level of its chain, sky_2(n, 0.0) the irradiance over pi.",
    "Table: bilinear, clamped to the edge, no mipmaps.",
)


class UnderSkies(ABC):
    """How an engine reflects its own sky. `errors` are relative RMS errors of a sphere, one per sky.

    `poor` is the text of the warning if the largest error exceeds `POOR`; {worst} marks the place of that error.
    """

    errors: Mapping[str, float]
    poor: str

    @property
    def worst(self) -> float:
        """The largest error."""
        return max(self.errors.values())

    @property
    def warning(self) -> str:
        """Return the warning; empty if no error exceeds `POOR`."""
        return "" if self.worst <= POOR else self.poor.format(worst=f"{self.worst:.0%}")

    @abstractmethod
    def record(self) -> dict[str, Any]:
        """Return a JSON-able dictionary for the report of the export."""

    @abstractmethod
    def sentence(self) -> str:
        """Return the lines for the terminal."""

    def off(self) -> str:
        """Return a sentence with the error of a sphere under each sky."""
        shown = ", ".join(f"{error:.1%} ({name})" for name, error in self.errors.items())
        return f"A sphere under a sky differs from the fit by {shown}, relative RMS; the fit's own error comes on top."

    def measured(self) -> dict[str, Any]:
        """Return the errors and their meaning, JSON-able."""
        return {
            "relative_rms": dict(self.errors),
            "meaning": "root mean square difference of a sphere's picture from the exact integration of the exported"
            " fit under skies that were not fitted to, over that picture's root mean square",
        }


@dataclass(frozen=True)
class EngineLight(UnderSkies):
    """A `table` rounded to half floats, for `kernels`; `errors` as in `UnderSkies`."""

    table: LevelTable
    kernels: ChainKernels
    errors: Mapping[str, float]
    poor = (
        "under a sky with small bright lights, this material errs by up to {worst} in the engine: put such lights into"
        " the scene as lamps, whose light the fit itself reflects"
    )

    @property
    def texels(self) -> np.ndarray:
        """The table (rows, columns, 4) in half floats."""
        return self.table.table.numpy().astype(np.float16)

    def code(self, language: Language, prefix: str = PREFIX) -> str:
        """Return the code of `PREFIX_reflected(n, wo)`, or (n, t, b, wo) if anisotropic, which reads the table."""
        return shader(self.program(), language, prefix)

    def program(self) -> Program:
        """Return the program that `code` writes."""
        return self.table.program(((len(self.kernels.alphas), 6, 0, 0), (1, 6, 0, 0)), _TITLE)

    def record(self) -> dict[str, Any]:
        """Return a JSON-able dictionary for the report of the export."""
        return {"reads": self.table.lobes + 1, "bytes": self.texels.nbytes, **self.measured()}

    def sentence(self) -> str:
        """Return the lines for the terminal."""
        reads, size = self.table.lobes + 1, self.texels.nbytes
        return (
            f"Under an environment, the shader reads the engine's own filtered sky {reads} times and a table"
            f" of {size} bytes. {self.off()}"
        )


@dataclass(frozen=True)
class ClosureLight(UnderSkies):
    """The `closures` of an engine that integrates skies itself; `errors` as of `UnderSkies`."""

    closures: Closures
    errors: Mapping[str, float]
    poor = (
        "under small bright lights the closures hold this material's lobes within {worst} only;"
        " the Mitsuba plugin shows the fit itself under skies"
    )

    def record(self) -> dict[str, Any]:
        """Return a JSON-able dictionary for the report of the export."""
        return {"closures": self.closures.weights.shape[2], "bytes": self.closures.nbytes, **self.measured()}

    def sentence(self) -> str:
        """Return the lines for the terminal."""
        count, size = self.closures.weights.shape[2], self.closures.nbytes
        return f"World and other objects: a sum of {count} closures with tables of {size} bytes. {self.off()}"


def engine_light(reflectance: Reflectance, kernels: ChainKernels) -> EngineLight:
    """Fit the table of a reflectance for an engine's kernels, and measure its errors.

    Raises BadInput for unsupported channels, and for values that are not finite.
    """
    stored = level_table(response_of(reflectance, kernels, LOBES)).rounded(np.float16)

    def shown(light: EnvironmentMap, around: Surroundings) -> SphereImage:
        return picture(Prefiltered(stored, FilteredSky.of(light, kernels)), SIZE)

    return EngineLight(stored, kernels, errors_of(reflectance, shown))


def closure_light(reflectance: Reflectance, lobes: int = CLOSURE_LOBES) -> ClosureLight:
    """Fit a Lambertian closure and `lobes` lobes to a reflectance, and measure their errors.

    Raises BadInput for unsupported channels, values that are not finite, and a reflectance that is 0 everywhere.
    """
    closures = closures_of(reflectance, lobes)
    material = FilteredMaterial.of(closures, fineness=_FINENESS)
    return ClosureLight(closures, errors_of(reflectance, lambda light, around: material.under(around)))


def errors_of(
    reflectance: Reflectance, shown: Callable[[EnvironmentMap, Surroundings], SphereImage]
) -> dict[str, float]:
    """Return the relative RMS error of the sphere picture `shown` (`SIZE` pixels), for each sky."""
    material, errors = FilteredMaterial.of(reflectance, fineness=_FINENESS), {}
    for name in MADE_SKIES:
        light = made_sky(name, _ROWS)
        around = Surroundings.of(light, SIZE, fineness=_FINENESS)
        errors[name] = compared(shown(light, around), material.under(around))
    return errors
