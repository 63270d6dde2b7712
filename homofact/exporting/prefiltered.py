"""The prefiltered sky of an export and a material's table for it: a cube map with levels, shaders, and the error."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from homofact.containers.dds import write_dds_cube
from homofact.containers.formats import Format, format_named
from homofact.containers.ktx2 import write_ktx2_cube
from homofact.factor.fitted import Fitted
from homofact.files.atomic import write_text
from homofact.files.words import harmless
from homofact.rendering.filtered import render_filtered
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.prefilter import Prefiltered, prefiltered
from homofact.rendering.sky_chain import SIDE, SkyChain, chain_of, own_kernels
from homofact.rendering.sphere import SphereImage
from homofact.rendering.split_sum import response_of
from homofact.rendering.surface import seen_surface
from homofact.shading.cube_code import c_light
from homofact.shading.languages import GLSL, HLSL, WGSL, shader
from homofact.version import __version__

PREFIX = "homofact_light"
SIZE = 96  # pixels of the sphere whose picture is compared
_RGBA = ("R", "G", "B", "A")
_TITLE = (
    "n, wo: unit, the normal and the direction to the viewer, both in the world (y up).",
    "The value is the radiance towards wo, linear, on the environment's own scale.",
    "Table: bilinear, clamped to the edge, no mipmaps. Cube map: linear in its faces, across them and between levels.",
)
MEANING = (
    "root mean square difference of the sphere's picture from the exact integration of the exported fit under this"
    " environment, over that picture's root mean square"
)


@dataclass(frozen=True)
class PrefilteredExport:
    """`data` rounded as in its files, with the table in `form`; `error` is the relative RMS defined in `MEANING`.

    The sky is a DDS file if the export's textures are DDS files (`dds`), else a KTX2 file.
    """

    data: Prefiltered[SkyChain]
    form: Format
    dds: bool
    error: float

    @property
    def names(self) -> tuple[str, str, str]:
        """The files of the table, of the sky and of its irradiance."""
        suffix = ".dds" if self.dds else ".ktx2"
        return f"prefiltered_table{self.form.suffix}", f"prefiltered{suffix}", f"prefiltered_irradiance{suffix}"

    @property
    def nbytes(self) -> int:
        """Bytes of the table on a GPU."""
        rows, columns, channels = self.data.material.table.shape
        return self.form.bytes_of(rows, columns, channels)

    @property
    def files(self) -> list[str]:
        """All files."""
        return [*self.names, *(f"prefiltered{language.suffix}" for language in (GLSL, HLSL, WGSL)), "prefiltered.c"]

    def put(self, place: Path, first: int) -> None:
        """Write textures and shaders into a folder; the shaders number their textures from `first`."""
        table, light, lit = self.names
        self.form.write(place / table, self.data.material.table.numpy().astype(np.float32), _RGBA)
        write_sky(place / light, self.data.sky.levels)
        write_sky(place / lit, [self.data.sky.irradiance])
        rows, columns = self.data.material.table.shape[:2]
        title = (
            f"Light of {self.data.sky.name} for one material (split sum), relative RMS error {self.error:.3g}.",
            *_TITLE,
            *["t, b: unit, tangent and binormal."] * (self.data.material.across is not None),
            f"Texture 0: {table}, {columns} x {rows}. Texture 1: {light}, a cube map of {self.data.sky.side} texels"
            f" per side, {len(self.data.sky.levels)} levels. Texture 2: {lit}, a cube map. Both are the same for every"
            " material.",
        )
        program = self.data.program(title, first)
        for language in (GLSL, HLSL, WGSL):
            write_text(place / f"prefiltered{language.suffix}", shader(program, language, PREFIX))
        write_text(
            place / "prefiltered.c", c_light(program, self.data.material.table.numpy().astype(np.float32), PREFIX)
        )

    def record(self) -> dict[str, Any]:
        """Return the record for the manifest, JSON-able."""
        table, light, lit = self.names
        sky, material = self.data.sky, self.data.material
        return {
            "environment": sky.name,
            "function": f"{PREFIX}_reflected",
            "files": self.files,
            "table": {
                "file": table,
                "columns": "even steps of the viewer's cosine from 0 to 1",
                "rows": [
                    *(f"lobe {k}: its shares, and its level" for k in range(material.lobes)),
                    "the share of the irradiance over pi",
                    "each lobe's lean t: it stands round r + t n, r the mirror direction",
                    *["each lobe's spread a: r mirrors at the half vector n + a g"] * (material.across is not None),
                ],
                "bytes": self.nbytes,
            }
            | ({} if material.across is None else {"across": material.across}),
            "sky": {
                "file": light,
                "side": sky.side,
                "levels": [
                    {"side": int(level.shape[1]), "power": alpha**-2}
                    for level, alpha in zip(sky.levels, sky.kernels.alphas, strict=True)
                ],
                "meaning": "a cube map, +x -x +y -y +z -z, y up; each level the light averaged by cos^power of the"
                " angle round a direction, the last one irradiance/pi; the same for every material",
                "factor": sky.factor,
                "bytes": sky.nbytes,
            },
            "irradiance_over_pi": {
                "file": lit,
                "side": int(sky.irradiance.shape[1]),
                "over": "1, x, y, z, xy, yz, zx, 3zz - 1, xx - yy",
                "values": sky.harmonics.tolist(),
            },
            "relative_rms": self.error,
            "meaning": MEANING,
        }

    def sentence(self) -> str:
        """Return the sentence that the command prints."""
        sky = self.data.sky
        return (
            f"Split sum under {harmless(sky.name)}: a cube map of {sky.side} texels per side with {len(sky.levels)}"
            f" levels, {sky.nbytes / 2**20:.2f} MiB for all materials, and {self.nbytes} bytes for this one;"
            f" the sphere is off by {self.error:.1%} (relative RMS)."
        )


def prefiltered_export(fitted: Fitted, light: EnvironmentMap, form: Format, side: int = SIDE) -> PrefilteredExport:
    """Compute a fit's table and the sky; the table is stored in `form` if that has floats, else as half-float EXR.

    Raises BadInput for unsupported channels, and for an unsupported side of the cube map.
    """
    held = form if form.storage in ("float32", "float16") else format_named("exr16")
    data = prefiltered(response_of(fitted, own_kernels(side)), in_halves(chain_of(light, side)))
    stored = replace(data, material=data.material.rounded(held.dtype))
    return PrefilteredExport(stored, held, form.suffix == ".dds", relative_rms(stored, fitted, light))


def in_halves(sky: SkyChain) -> SkyChain:
    """Return the sky rounded to half floats, as its file stores it."""
    levels = [level.to(torch.float16).to(torch.float64) for level in (*sky.levels, sky.irradiance)]
    return replace(sky, levels=tuple(levels[:-1]), irradiance=levels[-1])


def write_sky(path: Path, sky: Sequence[Tensor]) -> None:
    """Write levels (6, N, N, 3) as a cube map of RGBA16F, as DDS if the path ends in .dds, else as KTX2.

    Raises BadInput as `write_dds_cube` and `write_ktx2_cube`.
    """
    levels = with_alpha(sky)
    if path.suffix == ".dds":
        write_dds_cube(path, levels)
    else:
        write_ktx2_cube(path, levels, {"KTXorientation": "rd", "KTXwriter": f"homofact {__version__}"})


def with_alpha(sky: Sequence[Tensor]) -> list[np.ndarray]:
    """Return levels (6, N, N, 3) as (6, N, N, 4), alpha 1."""
    return [np.concatenate((level, np.ones_like(level[..., :1])), -1) for level in (faces.numpy() for faces in sky)]


def relative_rms(data: Prefiltered, fitted: Fitted, light: EnvironmentMap) -> float:
    """Return the error defined in `MEANING`, for a sphere of `SIZE` pixels."""
    exact = render_filtered(fitted, light, SIZE)
    return compared(picture(data, SIZE), exact)


def picture(data: Prefiltered, size: int, view: Sequence[float] = (0.0, 0.0, 1.0)) -> SphereImage:
    """Render the sphere by the split sum, with the layout of `rendering.sphere`."""
    x, y, z = view
    coverage, surface = seen_surface(size, (x, y, z))
    n = surface.frame[:, 2].contiguous()
    radiance = torch.zeros(coverage.numel(), 3, dtype=torch.float64)
    t = surface.frame[:, 0].contiguous()
    radiance[surface.pixels] = data.radiance(n, surface.axes[2].expand_as(n).contiguous(), t)
    return SphereImage(radiance.reshape(*coverage.shape, 3), coverage)


def compared(found: SphereImage, exact: SphereImage) -> float:
    """Return √(Σ difference²/Σ exact²) over the sphere's pixels, weighted by their coverage."""
    weight = exact.coverage[..., None]
    difference = (found.radiance - exact.radiance).square() * weight
    return float((difference.sum() / (exact.radiance.square() * weight).expand_as(difference).sum()).sqrt())
