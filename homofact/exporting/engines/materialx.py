"""A MaterialX node of type BSDF, implemented by the generated GLSL, in a document with a material that uses it.

The fit itself reflects lights. Its table for GGX lobes (`engine_light`) reflects environments, because MaterialX's
generators for GLSL give a node only the irradiance and the light that a GGX lobe reflects from the environment. A lobe
seen from its mirror direction averages the light around that direction, with Smith's masking and shadowing. There is no
OSL implementation, because a renderer defines the OSL closures itself.
"""

import re
import tempfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from homofact.containers.formats import format_named
from homofact.exporting.engine_light import engine_light
from homofact.exporting.engines.base import Added, Engine, check_colour, fit_notes, template
from homofact.exporting.exported import Exported
from homofact.files.words import in_markdown
from homofact.rendering.chain_kernels import ggx_kernels
from homofact.shading.languages import MATERIALX, MATERIALX_SKY, shader
from homofact.shading.program import name_of
from homofact.version import __version__

DOCUMENT, CODE, TABLE = "brdf.mtlx", "brdf_materialx.glsl", "light_table.exr"
# Even steps of roughness, close enough that between two of them their mean is the lobe between.
STEPS = 16
KERNELS = ggx_kernels(tuple(k / STEPS for k in range(STEPS + 1)), 0.004, "Smith")
VERSION = "1.39"
_LONGEST = 200


def _files(made: Exported) -> Added:
    check_colour(made, "materialx")
    given = name_of(made.stored.provenance)
    # No longer than a name in GLSL can be.
    called = "homofact_" + (re.sub("[^A-Za-z0-9]+", "_", given)[:_LONGEST].strip("_") or "brdf")
    names = [f"{called}_texture_{k}" for k in range(len(made.names))]
    table = f"{called}_light_texture_0"
    light = engine_light(made.stored, KERNELS)
    code = template(
        "materialx.glsl",
        # "$" begins a token of the generator's.
        PROGRAM=shader(made.program, MATERIALX, called).replace("$", " "),
        NAME=called,
        LIGHT=light.code(MATERIALX_SKY, f"{called}_light"),
        STEPS=f"{STEPS}.0",
        SAMPLERS="".join(f"sampler2D {name}, " for name in (*names, table)),
        GIVEN="".join(f", {name}" for name in names),
        FRAME="N" if light.table.across is None else "N, t, b",
        TABLE=table,
    )
    files = dict(zip((*names, table), (*made.names, TABLE), strict=True))
    words = template(
        "materialx.md",
        NAME=in_markdown(given),
        MATERIALX=VERSION,
        CALLED=called,
        VERSION=__version__,
        ERRORS=light.off(),
        NOTES=fit_notes(made),
    )
    texels = _exr(light.texels)
    return Added({DOCUMENT: _document(made, called, files), CODE: code, TABLE: texels, "README.md": words}, light=light)


def _exr(texels: np.ndarray) -> bytes:
    """An EXR of half floats of texels (rows, columns, 4)."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / TABLE
        format_named("exr16").write(place, texels.astype(np.float32), tuple("RGBA"))
        return place.read_bytes()


def _document(made: Exported, called: str, files: dict[str, str]) -> str:
    root = ElementTree.Element("materialx", version=VERSION)
    definition = ElementTree.SubElement(root, "nodedef", name=f"ND_{called}", node=called, nodegroup="pbr", bsdf="R")
    definition.set("doc", f"The BRDF of {name_of(made.stored.provenance)}.")
    for name, kind, more in (
        ("weight", "float", {"value": "1.0", "uimin": "0.0", "uimax": "1.0"}),
        *((name, "filename", {"value": file, "uniform": "true"}) for name, file in files.items()),
        ("normal", "vector3", {"defaultgeomprop": "Nworld"}),
        ("tangent", "vector3", {"defaultgeomprop": "Tworld"}),
    ):
        ElementTree.SubElement(definition, "input", {"name": name, "type": kind, **more})
    ElementTree.SubElement(definition, "output", name="out", type="BSDF")
    ElementTree.SubElement(
        root, "implementation", name=f"IM_{called}_genglsl", nodedef=f"ND_{called}", file=CODE,
        function=f"mx_{called}", target="genglsl",
    )  # fmt: skip
    ElementTree.SubElement(root, called, name="brdf", type="BSDF")
    surface = ElementTree.SubElement(root, "surface", name="surface", type="surfaceshader")
    ElementTree.SubElement(surface, "input", name="bsdf", type="BSDF", nodename="brdf")
    material = ElementTree.SubElement(root, "surfacematerial", name="material", type="material")
    ElementTree.SubElement(material, "input", name="surfaceshader", type="surfaceshader", nodename="surface")
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


MATERIALX_ENGINE = Engine("materialx", ("exr", "exr16"), _files, "fitting the table for skies that MaterialX filters")
