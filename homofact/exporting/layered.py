"""Export labelled materials for an engine: texture arrays, shaders that read one layer of them, and the label texture.

A texture array is one file: a KTX2 or DDS with the number of layers in its header, or an image with its layers stacked
vertically, layer 0 on top. The rows of the image have the same order as an array in memory, so a loader uploads it in
one piece. All layers of an array have one scale and one bias; the shaders contain ε and A of each layer.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from homofact.containers.exr import exr_channel_names
from homofact.containers.formats import Format
from homofact.containers.png import write_png
from homofact.evaluation.split import without_places
from homofact.exporting.exported import MANIFEST, SAMPLER, SAMPLING, STORAGE, sampling_record, texture_records
from homofact.exporting.manifest import conventions, write_json
from homofact.factor.layered import Layered
from homofact.files.atomic import write_text
from homofact.shading.c_code import c_source
from homofact.shading.cost import EvaluationCost, cost_of
from homofact.shading.encoding import Encoded, as_floats, encode
from homofact.shading.functions import functions_in_c, functions_text, sampling_of_layers
from homofact.shading.labels import label_lookup, label_lookup_in_c
from homofact.shading.languages import GLSL, HLSL, WGSL, shader
from homofact.shading.lobe_mixture import LobeMixture
from homofact.shading.mixture_fit import fitted_mixtures
from homofact.shading.program import Program, check_count, program_of
from homofact.version import __version__

FORMAT = "homofact layered export"
FORMAT_VERSION = 1
LABELS = "labels.png"
ARRAY = "the layers follow each other, layer 0 first, each of `rows` rows; in EXR and PNG as one tall image"
LABEL = "8-bit whole numbers, the layer at each texel; read the texel that (u, v) falls into, row 0 at v = 0"


@dataclass(frozen=True)
class LayeredExport:
    """Layers as they will be stored: `stored` has the texels as a sampler reads them, `textures` are the arrays.

    `sampling` contains one lobe mixture per layer. With it, the shaders also contain sampling functions.
    """

    stored: Layered
    textures: tuple[Encoded, ...]
    program: Program
    cost: EvaluationCost
    format: Format
    sampling: tuple[LobeMixture, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The arrays' file names."""
        return tuple(f"texture_{k}{self.format.suffix}" for k in range(len(self.textures)))


def exported_layers(fit: Layered, form: Format) -> LayeredExport:
    """Return the layers in a texture format. Raises BadInput as `exporting.exported.exported`."""
    channels, count = len(fit.layers[0].channels), len(fit.layers)
    check_count(channels)
    arrays = [list(parts) for parts in zip(*(layer.textures for layer in fit.layers), strict=True)]
    textures = []
    for k, parts in enumerate(arrays):
        tall = np.concatenate([part.texels for part in parts])
        rows, columns, _ = tall.shape
        form.check(rows // count, columns, channels, f"texture {k}")
        textures.append(encode(tall, np.concatenate([part.mask for part in parts]), form.storage))
    decoded = [texture.decoded().chunk(count) for texture in textures]
    stored = Layered(
        tuple(layer.with_textures([layers[k] for layers in decoded]) for k, layer in enumerate(fit.layers))
    )
    program = program_of(fit.layers[0], textures, layers=fit.transforms)
    nbytes = sum(form.bytes_of(len(texture.stored), texture.stored.shape[1], channels) for texture in textures)
    return LayeredExport(stored, tuple(textures), program, cost_of(program, nbytes), form)


def with_sampling(made: LayeredExport) -> LayeredExport:
    """Return the export with a sampling mixture fitted to the stored texels of each layer."""
    return replace(made, sampling=fitted_mixtures(made.stored.layers))


def codes(made: LayeredExport) -> dict[str, str]:
    """Return the text of each program by file name.

    The programs define `homofact_evaluate(wi, wo, layer)` and `homofact_layer(uv)`. With `sampling`, they also define
    `homofact_sample(wo, u, layer)` and `homofact_density(wi, wo, layer)`.
    """
    lines = (f"Labels: {LABELS}, 8-bit whole numbers, not normalised; no sampler.",)
    program = replace(made.program, title=(*made.program.title, *lines))
    count = len(made.textures)
    more = sampling_of_layers(made.sampling) if made.sampling else ()
    texts = {
        f"brdf{language.suffix}": shader(program, language)
        + label_lookup(language, count)
        + functions_text(more, language)
        for language in (GLSL, HLSL, WGSL)
    }
    plain = [as_floats(texture.decoded()) for texture in made.textures]
    decoded = program_of(made.stored.layers[0], plain, layers=made.stored.transforms)
    code = c_source(decoded, [texture.stored for texture in plain])
    return texts | {"brdf.c": code + label_lookup_in_c() + functions_in_c(more)}


def put_layers(place: Path, made: LayeredExport, labels: np.ndarray) -> dict[str, Any]:
    """Write arrays, shaders, labels (rows, columns) and manifest to an existing folder; return the manifest."""
    for name, texture in zip(made.names, made.textures, strict=True):
        made.format.write(
            place / name,
            texture.stored,
            exr_channel_names(made.stored.layers[0].channels),
            layers=len(made.stored.layers),
        )
    texts = codes(made)
    for name, text in texts.items():
        write_text(place / name, text)
    write_png(place / LABELS, labels.astype(np.uint8)[..., None])
    description = _manifest(made, labels, list(texts))
    write_json(place / MANIFEST, description)
    return description


def _manifest(made: LayeredExport, labels: np.ndarray, files: list[str]) -> dict[str, Any]:
    layers = made.stored.layers
    described = [layer.describe() for layer in layers]
    textures = texture_records(made.names, made.textures, made.program.shapes, layers=len(layers))
    terms = [{key: value for key, value in term.items() if key != "mask"} for term in described[0]["terms"]]
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "homofact_version": __version__,
        "texture_format": made.format.name,
        "channels": list(layers[0].channels),
        "textures": textures,
        "terms": terms,
        "layers": [
            {
                "epsilon": layer.transform.epsilon,
                "A": layer.transform.mean.tolist(),
                "masks": [term["mask"] for term in own["terms"]],
                "provenance": without_places(layer.provenance),
                **({"sampling": sampling_record(layer, made.sampling[k])} if made.sampling else {}),
            }
            for k, (layer, own) in enumerate(zip(layers, described, strict=True))
        ],
        "labels": {"file": LABELS, "rows": int(labels.shape[0]), "columns": int(labels.shape[1]), "meaning": LABEL},
        "code": {"functions": ["homofact_evaluate", "homofact_layer"], "files": files}
        | ({"sampling": SAMPLING} if made.sampling else {}),
        "cost": made.cost.record(),
        "conventions": conventions(described[0]) | {"storage": STORAGE, "sampler": SAMPLER, "arrays": ARRAY},
    }
