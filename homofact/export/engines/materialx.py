"""A MaterialX node of type BSDF with the generated GLSL as its implementation, in a document with a material of it.

Lights are reflected by the fit. Of an environment the generators for GLSL give a node its irradiance, which is
multiplied by the fit's mean albedo. For OSL there is no implementation: its closures are the renderer's own.
"""

import re
from xml.etree import ElementTree

import torch

from homofact.brdf.reflectance import Reflectance
from homofact.export.engines.base import Added, Engine, check_colour, template
from homofact.export.exported import Exported
from homofact.geometry.directions import from_spherical
from homofact.geometry.quadrature import disc_nodes, hemisphere_nodes
from homofact.shading.languages import MATERIALX, shader
from homofact.shading.program import name_of

DOCUMENT, CODE = "brdf.mtlx", "brdf_materialx.glsl"
VERSION = "1.39"
_LEVELS, _RINGS, _SPOKES = 8, 32, 16


def _files(made: Exported) -> Added:
    check_colour(made, "materialx")
    called = "homofact_" + (re.sub("[^A-Za-z0-9]+", "_", name_of(made.stored.provenance)).strip("_") or "brdf")
    names = [f"{called}_texture_{k}" for k in range(len(made.names))]
    code = template(
        "materialx.glsl",
        # "$" begins a token of the generator's.
        PROGRAM=shader(made.program, MATERIALX, called).replace("$", " "),
        NAME=called,
        SAMPLERS="".join(f"sampler2D {name}, " for name in names),
        GIVEN="".join(f", {name}" for name in names),
    )
    return Added({DOCUMENT: _document(made, called, names), CODE: code})


def _document(made: Exported, called: str, names: list[str]) -> str:
    root = ElementTree.Element("materialx", version=VERSION)
    definition = ElementTree.SubElement(root, "nodedef", name=f"ND_{called}", node=called, nodegroup="pbr", bsdf="R")
    definition.set("doc", f"The BRDF of {name_of(made.stored.provenance)}.")
    albedo = ", ".join(f"{x:.6g}" for x in mean_albedo(made.stored))
    for name, kind, more in (
        ("weight", "float", {"value": "1.0", "uimin": "0.0", "uimax": "1.0"}),
        ("ambient", "color3", {"value": albedo, "doc": "What is reflected of an environment's irradiance."}),
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


def mean_albedo(reflectance: Reflectance) -> tuple[float, float, float]:
    """What of even light from everywhere is reflected, R, G, B (one channel in all three)."""
    theta, weights = disc_nodes(_LEVELS)
    views = from_spherical(theta, torch.full_like(theta, 0.3))
    lights, solid = hemisphere_nodes(views, _RINGS, _SPOKES)
    values = reflectance.evaluate(lights.reshape(-1, 3), views[:, None].expand_as(lights).reshape(-1, 3))
    each = (values.reshape(*lights.shape[:2], -1) * (solid * lights[..., 2])[..., None]).sum(1)
    red, green, blue = (weights[:, None] * each).sum(0).expand(3).tolist()
    return red, green, blue


MATERIALX_ENGINE = Engine("materialx", ("exr", "exr16"), _files)
