"""The folder for an engine: textures in a format of its choice, shaders that read them, a manifest.

`shading.encoding` encodes the texels. The shaders are generated from the fit (`shading`), and contain its constants and
the scale and bias of its textures. The manifest repeats all of this as JSON, so a loader need not parse shader text.
With the manifest, `exported_reader` also reads the folder back as a fit with the values of the stored textures.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch

from homofact.brdf.reflectance import Reflectance
from homofact.containers.exr import exr_channel_names
from homofact.containers.formats import Format
from homofact.evaluation.split import without_places
from homofact.exporting.check_table import CHECK, check_table
from homofact.exporting.exported_reader import FORMAT, FORMAT_VERSION, MANIFEST
from homofact.exporting.manifest import conventions, write_json
from homofact.exporting.prefiltered import PrefilteredExport
from homofact.factor.fitted import Fitted
from homofact.files.atomic import write_bytes, write_text
from homofact.files.folder import check_new_folder, write_folder
from homofact.files.kinds import ENGINE_MARK, EXPORT
from homofact.geometry.directions import draw_cosine_weighted
from homofact.shading.c_code import c_source
from homofact.shading.cost import EvaluationCost, cost_of
from homofact.shading.encoding import Encoded, as_floats, encode_texture
from homofact.shading.functions import functions_in_c, functions_text, sampling_functions
from homofact.shading.languages import GLSL, HLSL, WGSL, shader
from homofact.shading.lobe_mixture import LobeMixture
from homofact.shading.noise import MEANING, noise_at_angles
from homofact.shading.program import Program, check_count, program_of
from homofact.version import __version__

STORAGE = (
    "value = scale * t + bias per channel, t the sampled texel: a float as it is, a whole number over 255 (unorm8) or"
    " 65535 (unorm16), linear, not sRGB; the shaders have it in their constants"
)
SAMPLER = (
    "bilinear, clamped to the edge, no mipmaps; the first row of the file is row 0 at v = 0, a texel's centre is at"
    " ((column + 1/2)/columns, (row + 1/2)/rows)"
)
SAMPLING = ["homofact_sample", "homofact_density"]
# How engines call the stored texels.
_WORDS = {
    "float32": "32-bit float", "float16": "16-bit float", "unorm8": "8-bit UNORM, not sRGB",
    "unorm16": "16-bit UNORM", "bc6h": "BC6H_SF16",
}  # fmt: skip


@dataclass(frozen=True)
class Exported:
    """A fit as it will be stored: `stored` is the fit with its texels as a sampler reads them.

    `textures` are in the order of the shaders' texture numbers. `cost` is the cost of one evaluation, with the bytes of
    the texels on the GPU. With `sampling`, the shaders also contain sampling functions. With `prefiltered`, the export
    also contains shaders and textures of a split sum. `verdict` contains "trusted" and "summary" of the verdict on the
    fit before it was stored; it is None for a fit without a verdict.
    """

    stored: Fitted
    textures: tuple[Encoded, ...]
    program: Program
    cost: EvaluationCost
    format: Format
    sampling: LobeMixture | None = None
    prefiltered: PrefilteredExport | None = None
    verdict: Mapping[str, Any] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """The textures' file names."""
        return tuple(f"texture_{k}{self.format.suffix}" for k in range(len(self.textures)))


def exported(fitted: Fitted, form: Format) -> Exported:
    """Return the fit in a texture format.

    Raises BadInput, with the number of the texture, if the format does not support a texture, and for more than four
    channels.
    """
    channels = len(fitted.channels)
    check_count(channels)
    for k, texture in enumerate(fitted.textures):
        form.check(*texture.size, channels, f"texture {k}")
    textures = tuple(encode_texture(texture, form.storage) for texture in fitted.textures)
    stored = fitted.with_textures([texture.decoded() for texture in textures])
    program = program_of(fitted, textures)
    nbytes = sum(form.bytes_of(*texture.size, channels) for texture in fitted.textures)
    return Exported(stored, textures, program, cost_of(program, nbytes), form)


def log_difference(before: Fitted, after: Reflectance) -> float:
    """Return the RMS difference of log((f + εA)/A) between two fits, with ε and A of the first.

    The mean is over 20,000 random pairs of directions with cosine-weighted density.
    """
    wi, wo = draw_cosine_weighted(20_000, torch.Generator().manual_seed(0))
    logs = [before.transform.forward(fit.evaluate(wi, wo)) for fit in (before, after)]
    return float((logs[0] - logs[1]).square().mean().sqrt())


def write_exported(
    folder: str | os.PathLike[str],
    made: Exported,
    errors: Mapping[str, Any],
    force: bool = False,
    engine: str = "",
    files: Mapping[str, str | bytes] | None = None,
) -> dict[str, Any]:
    """Write textures, shaders, manifest and a table to check shaders by to `folder`, or nothing; return the manifest.

    It also writes the `files` of an `engine` (`exporting.engines`), and lists their names in engine.json. The manifest
    contains `errors` unchanged. Raises BadInput as `files.folder.check_new_folder`, and if writing to the folder fails.
    """
    check_new_folder(folder, EXPORT, force)
    description = export_manifest(made, errors)

    def fill(place: Path) -> None:
        facts = {"homofactStorage": STORAGE}
        for name, texture in zip(made.names, made.textures, strict=True):
            made.format.write(place / name, texture.stored, exr_channel_names(made.stored.channels), facts)
        for name, text in _codes(made).items():
            write_text(place / name, text)
        for name, content in (files or {}).items():
            write_bytes(place / name, content if isinstance(content, bytes) else content.encode())
        if files:
            write_json(place / ENGINE_MARK, {"engine": engine, "files": sorted(files)})
        if made.prefiltered is not None:
            made.prefiltered.put(place, len(made.textures) + 1)
        write_text(place / CHECK, check_table(made.stored))
        write_json(place / MANIFEST, description)

    write_folder(folder, EXPORT, fill, force)
    return description


def export_manifest(made: Exported, errors: Mapping[str, Any]) -> dict[str, Any]:
    """Return all that a loader needs beside the texels, JSON-able."""
    fitted, described = made.stored, made.stored.describe()
    textures = texture_records(made.names, made.textures, [texture.stored.shape for texture in made.textures])
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "homofact_version": __version__,
        "texture_format": made.format.name,
        "channels": list(fitted.channels),
        "epsilon": fitted.transform.epsilon,
        "A": {"values": fitted.transform.mean.tolist(), "unit": "1/sr", "meaning": "mean of the training samples"},
        "textures": textures,
        **described,
        "code": {"function": "homofact_evaluate", "files": list(_codes(made)), "check": CHECK}
        | ({} if made.sampling is None else {"sampling": SAMPLING}),
        "cost": made.cost.record(),
        "errors": dict(errors),
        **({} if made.verdict is None else {"verdict": dict(made.verdict)}),
        **({} if made.sampling is None else {"sampling": sampling_record(made.stored, made.sampling)}),
        **({} if made.prefiltered is None else {"prefiltered": made.prefiltered.record()}),
        "provenance": without_places(fitted.provenance),
        "conventions": conventions(described) | {"storage": STORAGE, "sampler": SAMPLER},
    }


def texture_records(
    names: Sequence[str], textures: Sequence[Encoded], shapes: Sequence[tuple[int, ...]], **more: Any
) -> list[dict[str, Any]]:
    """Return the manifest's records of textures with these shapes (rows, columns, …), each with `more`; JSON-able."""
    return [
        {
            "file": name,
            **more,
            "rows": int(shape[0]),
            "columns": int(shape[1]),
            "storage": texture.storage,
            "scale": texture.scale.tolist(),
            "bias": texture.bias.tolist(),
        }
        for name, texture, shape in zip(names, textures, shapes, strict=True)
    ]


def sampling_record(stored: Reflectance, mixture: LobeMixture) -> dict[str, Any]:
    """Return a JSON-able record of the mixture and of its sampling noise."""
    measured = [noise.record() for noise in noise_at_angles(stored, mixture)]
    return mixture.describe() | {"measured": measured, "meaning": MEANING}


def _codes(made: Exported) -> dict[str, str]:
    """The text of each program by file name."""
    lines = []
    for k, (name, texture) in enumerate(zip(made.names, made.textures, strict=True)):
        rows, columns = texture.stored.shape[:2]
        lines.append(f"Texture {k}: {name}, {columns} x {rows}, {_WORDS[texture.storage]}.")
    program = replace(made.program, title=(*made.program.title, *lines))
    more = () if made.sampling is None else sampling_functions(made.sampling)
    texts = {
        f"brdf{language.suffix}": shader(program, language) + functions_text(more, language)
        for language in (GLSL, HLSL, WGSL)
    }
    # The C code holds the texels decoded.
    plain = [as_floats(texture.texels) for texture in made.stored.textures]
    program = program_of(made.stored, plain)
    last = (f"The texels below are those of {', '.join(made.names)}, decoded.",) if made.names else ()
    code = c_source(replace(program, title=(*program.title, *last)), [texture.stored for texture in plain])
    return texts | {"brdf.c": code + functions_in_c(more)}
