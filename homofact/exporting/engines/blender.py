"""A Python script for Blender: it builds the fit as a group of math nodes, and drivers pass the lamps to the nodes.

Closures of Cycles and EEVEE cannot read the light, but nodes can read the direction of a lamp. The material emits f
cosθ times the irradiance of each lamp. A sum of closures (`rendering.closures`) reflects all other light. The first
lines of the script give its error (`exporting.engine_light`).
"""

import base64
import textwrap
from typing import Any

import numpy as np

from homofact.exporting.engine_light import ClosureLight, closure_light
from homofact.exporting.engines.base import Added, Engine, check_colour, fit_notes, template
from homofact.exporting.exported import Exported
from homofact.files.words import in_markdown
from homofact.rendering.closures import Closures
from homofact.shading.encoding import as_floats
from homofact.shading.node_graph import node_graph
from homofact.shading.program import name_of, program_of
from homofact.version import __version__

NAME, README = "brdf_blender.py", "README.md"
_LINE = 100


def _files(made: Exported) -> Added:
    check_colour(made, "blender")
    light = closure_light(made.stored)
    called = in_markdown(name_of(made.stored.provenance))
    words = template("blender.md", NAME=called, OFF=light.off(), VERSION=__version__, NOTES=fit_notes(made))
    return Added({NAME: script(made, light), README: words}, light=light)


def script(made: Exported, light: ClosureLight) -> str:
    """Return the text of the script, with decoded texels: the values, not the bytes, of an 8-bit texture."""
    textures = [as_floats(texture.texels) for texture in made.stored.textures]
    graph = node_graph(program_of(made.stored, textures))
    called = name_of(made.stored.provenance)
    return template(
        "brdf_blender.py.txt",
        # What ends a docstring, or begins an escape in it, is left out.
        NAME=called.replace("\\", "/").replace('"', "'"),
        VERSION=__version__,
        NOTE=textwrap.fill(light.off(), 120),
        LOBES=("no", "one", "two", "three")[light.closures.lobes.shape[1]],
        NAME_TEXT=ascii(f"homofact {called}"),
        TURN=repr(light.closures.turn),
        CLOSURES=_lines(map(_texels, tables_of(light.closures)), "[]", _wrapped),
        TEXTURES=_lines([_texels(texture.stored) for texture in textures], "[]", _wrapped),
        PROGRAM=_lines(graph.nodes, "[]", repr),
        RESULT=repr(graph.result),
    )


def tables_of(closures: Closures) -> list[np.ndarray]:
    """Return tables (T or 1, COLUMNS, 1 or 3): the Lambertian weights, then the shape and weights of each lobe."""
    weights = closures.weights.numpy()
    tables = [weights[:, :, 0]]
    for k in range(closures.lobes.shape[1]):
        tables += [closures.lobes[None, :, k].numpy(), weights[:, :, k + 1]]
    return tables


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


BLENDER = Engine(
    "blender",
    ("exr", "exr16", "png8", "png16", "ktx2", "dds", "bc6h"),
    _files,
    "fitting Blender's closures, for its world",
)
