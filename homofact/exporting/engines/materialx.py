"""A MaterialX node of type BSDF with the generated GLSL as its implementation, in a document with a material of it.

Lights are reflected by the fit, environments by the metallic-roughness material that looks most like it: of these the
generators for GLSL give a node what a lobe of GGX reflects, and the irradiance. For OSL there is no implementation: its
closures are the renderer's own.
"""

import re
from xml.etree import ElementTree

from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.exporting.as_source import knows_no_azimuth
from homofact.exporting.engines.base import Added, Engine, check_colour, template
from homofact.exporting.exported import Exported
from homofact.exporting.gltf_fit import fit_metallic_roughness
from homofact.files.words import in_markdown
from homofact.shading.languages import MATERIALX, shader
from homofact.shading.program import name_of
from homofact.version import __version__

DOCUMENT, CODE = "brdf.mtlx", "brdf_materialx.glsl"
VERSION = "1.39"
_LONGEST = 200


def _files(made: Exported) -> Added:
    check_colour(made, "materialx")
    given = name_of(made.stored.provenance)
    # No longer than a name in GLSL can be.
    called = "homofact_" + (re.sub("[^A-Za-z0-9]+", "_", given)[:_LONGEST].strip("_") or "brdf")
    names = [f"{called}_texture_{k}" for k in range(len(made.names))]
    code = template(
        "materialx.glsl",
        # "$" begins a token of the generator's.
        PROGRAM=shader(made.program, MATERIALX, called).replace("$", " "),
        NAME=called,
        SAMPLERS="".join(f"sampler2D {name}, " for name in names),
        GIVEN="".join(f", {name}" for name in names),
    )
    look = fit_metallic_roughness(made.stored, knows_no_azimuth(made.stored), extensions=False)
    words = template("materialx.md", NAME=in_markdown(given), MATERIALX=VERSION, CALLED=called, VERSION=__version__)
    return Added(
        {DOCUMENT: _document(made, look, called, names), CODE: code, "README.md": words}, {"environment": look}
    )


def _document(made: Exported, look: MetallicRoughness, called: str, names: list[str]) -> str:
    root = ElementTree.Element("materialx", version=VERSION)
    definition = ElementTree.SubElement(root, "nodedef", name=f"ND_{called}", node=called, nodegroup="pbr", bsdf="R")
    definition.set("doc", f"The BRDF of {name_of(made.stored.provenance)}.")
    colour = look.base_colour if len(look.base_colour) == 3 else look.base_colour * 3
    seen = {"uimin": "0.0", "uimax": "1.0", "doc": "Of what reflects environments; lights are reflected by the fit."}
    for name, kind, more in (
        ("weight", "float", {"value": "1.0", "uimin": "0.0", "uimax": "1.0"}),
        ("base_color", "color3", {"value": ", ".join(f"{x:.6f}" for x in colour), "doc": seen["doc"]}),
        ("metallic", "float", {"value": f"{look.metallic:.6f}", **seen}),
        ("roughness", "float", {"value": f"{look.roughness:.6f}", **seen}),
        *((name, "filename", {"value": file, "uniform": "true"}) for name, file in zip(names, made.names, strict=True)),
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


MATERIALX_ENGINE = Engine("materialx", ("exr", "exr16"), _files)
