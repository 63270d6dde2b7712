"""An environment filtered for a material, in an export's folder: two textures, their shaders, the error."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from homofact.containers.formats import Format, format_named
from homofact.factor.fitted import Fitted
from homofact.files.atomic import write_text
from homofact.files.words import harmless
from homofact.render.filtered import render_filtered
from homofact.render.light import EnvironmentMap
from homofact.render.prefilter import Prefiltered, prefiltered, program_of_light
from homofact.render.sphere import SphereImage
from homofact.render.split_sum import LEVELS, response_of
from homofact.render.surface import seen_surface
from homofact.shading.languages import GLSL, HLSL, WGSL, shader

PREFIX = "homofact_light"
SIZE = 96  # pixels of the sphere whose picture is compared
_RGB, _RGBA = ("R", "G", "B"), ("R", "G", "B", "A")
_TITLE = (
    "n, wo: unit, the normal and the direction to the viewer, both in the world (y up).",
    "The value is the radiance towards wo, linear, on the environment's own scale.",
    "Textures: bilinear, clamped to the edge, no mipmaps; row 0 is at v = 0; a texel's centre is at (k + 1/2)/n.",
)
MEANING = (
    "root mean square difference of the sphere's picture from the exact integration of the exported fit under this"
    " environment, over that picture's root mean square"
)


@dataclass(frozen=True)
class PrefilteredExport:
    """`data` as its textures hold it, in the format `form`; `error` is the relative RMS that `MEANING` says."""

    data: Prefiltered
    form: Format
    error: float

    @property
    def names(self) -> tuple[str, str]:
        """The files of the table and of the map."""
        return f"prefiltered_table{self.form.suffix}", f"prefiltered{self.form.suffix}"

    @property
    def files(self) -> list[str]:
        """All files."""
        return [*self.names, *(f"prefiltered{language.suffix}" for language in (GLSL, HLSL, WGSL))]

    def put(self, place: Path, first: int) -> None:
        """Write textures and shaders into a folder; the shaders number their textures from `first`."""
        for name, texels, channels in zip(self.names, (self.data.table, self.data.map), (_RGBA, _RGB), strict=True):
            self.form.write(place / name, texels.numpy().astype(np.float32), channels)
        columns, rows = (int(self.data.map.shape[k]) for k in (1, 0))
        table, light = self.names
        title = (
            f"Light of {self.data.name} filtered for one material (split sum), relative RMS error {self.error:.3g}.",
            *_TITLE,
            f"Texture 0: {table}, {self.data.table.shape[1]} x 2. Texture 1: {light}, {columns} x {rows}.",
        )
        program = program_of_light(self.data, title, first)
        for language in (GLSL, HLSL, WGSL):
            write_text(place / f"prefiltered{language.suffix}", shader(program, language, PREFIX))

    def record(self) -> dict[str, Any]:
        """JSON-able, for the manifest."""
        table, light = self.names
        return {
            "environment": self.data.name,
            "function": f"{PREFIX}_reflected",
            "files": self.files,
            "table": {"file": table, "rows": "lobe's share and its lean; share of the irradiance", "columns": "cosine"},
            "map": {
                "file": light,
                "side": self.data.side,
                "squares": self.data.levels + 1,
                "meaning": "octahedral squares with a rim of one texel, one under another: the lobe at even steps of"
                " the viewer's cosine from 0 to 1, then irradiance/pi",
                "factor": self.data.factor,
            },
            "irradiance_over_pi": {
                "over": "1, x, y, z, xy, yz, zx, 3zz - 1, xx - yy",
                "values": self.data.harmonics.tolist(),
            },
            "relative_rms": self.error,
            "meaning": MEANING,
        }

    def sentence(self) -> str:
        """What the screen says."""
        return (
            f"Split sum under {harmless(self.data.name)}: {self.data.levels + 1} squares of"
            f" {self.data.side} x {self.data.side} texels; the sphere is off by {self.error:.1%} (relative RMS)."
        )


def prefiltered_export(fitted: Fitted, light: EnvironmentMap, form: Format, levels: int = LEVELS) -> PrefilteredExport:
    """The light for a fit: in the format where it holds floats, else in half floats of an EXR.

    Raises BadInput for channels that are no picture's.
    """
    held = form if form.storage in ("float32", "float16") else format_named("exr16")
    data = prefiltered(response_of(fitted, levels=levels), light)
    stored = replace(data, table=_held(data.table, held), map=_held(data.map, held))
    return PrefilteredExport(stored, held, relative_rms(stored, fitted, light))


def relative_rms(data: Prefiltered, fitted: Fitted, light: EnvironmentMap) -> float:
    """What `MEANING` says, of a sphere of `SIZE` pixels."""
    exact = render_filtered(fitted, light, SIZE)
    return compared(picture(data, SIZE), exact)


def picture(data: Prefiltered, size: int, view: Sequence[float] = (0.0, 0.0, 1.0)) -> SphereImage:
    """The sphere by the split sum, laid out as by `render.sphere`."""
    x, y, z = view
    coverage, surface = seen_surface(size, (x, y, z))
    n = surface.frame[:, 2].contiguous()
    radiance = torch.zeros(coverage.numel(), 3, dtype=torch.float64)
    radiance[surface.pixels] = data.radiance(n, surface.axes[2].expand_as(n).contiguous())
    return SphereImage(radiance.reshape(*coverage.shape, 3), coverage)


def compared(found: SphereImage, exact: SphereImage) -> float:
    """√(Σ difference²/Σ exact²) over the pixels that the sphere covers, weighted by how much of them."""
    weight = exact.coverage[..., None]
    difference = (found.radiance - exact.radiance).square() * weight
    return float((difference.sum() / (exact.radiance.square() * weight).expand_as(difference).sum()).sqrt())


def _held(texels: Tensor, form: Format) -> Tensor:
    """Texels as a file's type holds them."""
    return torch.from_numpy(texels.numpy().astype(form.dtype).astype(np.float64))
