"""A Python script for Blender: it builds the fit as a group of math nodes, and drivers pass the lamps to the nodes.

Closures of Cycles and EEVEE cannot read the light, but nodes can read the direction of a lamp. The material emits f
cosθ times the irradiance of each lamp. The Principled BSDF reflects all other light, with the parameters of the glTF
material most similar to the fit. The first lines of the script give the error of this glTF material
(`exporting.look_alike`).
"""

import base64
import math
from typing import Any

import numpy as np

from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.exporting.as_source import knows_no_azimuth
from homofact.exporting.engines.base import Added, Engine, check_colour, template
from homofact.exporting.exported import Exported
from homofact.exporting.gltf_fit import ANISOTROPY, CLEARCOAT, fit_metallic_roughness
from homofact.exporting.look_alike import AddedLookAlike, likeness
from homofact.shading.encoding import as_floats
from homofact.shading.node_graph import node_graph
from homofact.shading.program import name_of, program_of
from homofact.version import __version__

NAME = "brdf_blender.py"
# Blender's aspect of a lobe is √(1 − .9 anisotropic).
_ASPECT = 0.9
_LINE = 100


def _files(made: Exported) -> Added:
    check_colour(made, "blender")
    # Blender's Principled BSDF reflects all at grazing angles: it lacks what glTF's specular extension adds.
    look = fit_metallic_roughness(made.stored, knows_no_azimuth(made.stored), extensions=(CLEARCOAT, ANISOTROPY))
    found = likeness(look, made.stored, lamps=False)
    return AddedLookAlike({NAME: script(made, look, found.phrase)}, {"look-alike": look}, likeness=found)


def script(made: Exported, look: MetallicRoughness, note: str = "look-alike only") -> str:
    """Return the text of the script, whose texels are decoded: a texture of bytes is written as its values.

    The `note` describes how similar the look-alike is to the fit.
    """
    textures = [as_floats(texture.texels) for texture in made.stored.textures]
    graph = node_graph(program_of(made.stored, textures))
    called = name_of(made.stored.provenance)
    return template(
        "brdf_blender.py.txt",
        # What ends a docstring, or begins an escape in it, is left out.
        NAME=called.replace("\\", "/").replace('"', "'"),
        VERSION=__version__,
        NOTE=note,
        NAME_TEXT=ascii(f"homofact {called}"),
        LOOKALIKE=_lines(principled(look).items(), "{}", lambda item: f"{item[0]!r}: {item[1]!r}"),
        TEXTURES=_lines([_texels(texture.stored) for texture in textures], "[]", _wrapped),
        PROGRAM=_lines(graph.nodes, "[]", repr),
        RESULT=repr(graph.result),
    )


def principled(look: MetallicRoughness) -> dict[str, Any]:
    """Blender's Principled BSDF for a glTF material, by socket.

    glTF stretches a lobe to αt = α + (1 − α) s² along the tangent and keeps α across it; Blender shares α and divides
    and multiplies it by an aspect, so its α is √(αt αb) and its aspect² αb/αt. Its rotation counts turns.
    """
    colour = look.base_colour if len(look.base_colour) == 3 else look.base_colour * 3
    across = look.roughness**2
    along = across + (1 - across) * look.anisotropy**2
    parameters: dict[str, Any] = {
        "Base Color": (*colour, 1.0),
        "Metallic": look.metallic,
        "Roughness": (along * across) ** 0.25,
        "IOR": 1.5,
        "Coat Weight": look.clearcoat,
        "Coat Roughness": look.clearcoat_roughness,
        "Anisotropic": min((1 - across / along) / _ASPECT, 1.0) if along > 0 else 0.0,
        "Anisotropic Rotation": look.rotation / (2 * math.pi),
    }
    return {
        name: tuple(round(x, 6) for x in value) if isinstance(value, tuple) else round(value, 6)
        for name, value in parameters.items()
    }


def _texels(values: np.ndarray) -> tuple[int, int, str]:
    """(columns, rows, little-endian floats in base64) of texels (rows, columns, 1 or 3)."""
    rows, columns, _ = values.shape
    return columns, rows, base64.b64encode(values.astype("<f4").tobytes()).decode()


def _wrapped(texture: tuple[int, int, str]) -> str:
    columns, rows, text = texture
    lines = [f'        "{text[k : k + _LINE]}"' for k in range(0, len(text), _LINE)]
    return f"({columns}, {rows},\n" + "\n".join(lines) + ")"


def _lines(entries: Any, brackets: str, write: Any) -> str:
    """A list or a dict, an entry a line."""
    inner = "".join(f"    {write(entry)},\n" for entry in entries)
    return f"{brackets[0]}\n{inner}{brackets[1]}"


BLENDER = Engine("blender", ("exr", "exr16", "png8", "png16", "ktx2", "dds", "bc6h"), _files)
