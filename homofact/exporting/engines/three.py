"""A three.js material as an npm package: one module with texels and shader, and an example page.

The material extends three's physical material. The fit's program replaces the direct light (`RE_Direct` of the shader).
The fit's table for three's filtered environments (`engine_light`) replaces the indirect light. If a version of three
filters environments differently, they are reflected by the glTF material that looks most like the fit (`gltf_fit`,
without extensions).
"""

import base64
import html
import json
import math
import re
from typing import Any

import numpy as np

from homofact.exporting.as_source import knows_no_azimuth
from homofact.exporting.engine_light import engine_light
from homofact.exporting.engines.base import Added, Engine, check_colour, fit_notes, rgba, template, template_text
from homofact.exporting.exported import Exported
from homofact.exporting.gltf_fit import fit_metallic_roughness
from homofact.files.template import source_digest
from homofact.files.words import in_markdown
from homofact.rendering.chain_kernels import ggx_kernels
from homofact.shading.languages import GLSL, THREE_SKY, shader
from homofact.shading.program import name_of
from homofact.version import __version__

_KINDS = {"float16": "half", "float32": "float", "unorm8": "byte"}
# three's chain of faces of 256 texels: level k of 5 is filtered for roughness 1 − √(1 − k/5), the first is the sky.
LEVELS = 6
KERNELS = ggx_kernels(tuple(1 - math.sqrt(1 - k / (LEVELS - 1)) for k in range(LEVELS)), 0.004)


def _files(made: Exported) -> Added:
    check_colour(made, "three")
    isotropic = knows_no_azimuth(made.stored)
    look = fit_metallic_roughness(made.stored, isotropic, extensions=False)
    colour = look.base_colour if len(look.base_colour) == 3 else look.base_colour * 3
    light = engine_light(made.stored, KERNELS)
    frame = "frame[2]" if light.table.across is None else "frame[2], frame[0], frame[1]"
    data = {
        "textures": [_texture(rgba(texture), _KINDS[texture.storage]) for texture in made.textures],
        "glsl": shader(made.program, GLSL),
        "anisotropic": not isotropic,
        "light": {
            "table": _texture(light.texels, "half"),
            "glsl": light.code(THREE_SKY),
            "given": f"{frame}, geometryViewDir",
            "levels": LEVELS,
            "errors": {name: round(error, 4) for name, error in light.errors.items()},
        },
        "lookalike": {"color": list(colour), "metalness": look.metallic, "roughness": look.roughness},
    }
    called = name_of(made.stored.provenance)
    package = {
        "name": package_name(called, str(made.stored.provenance.get("method", ""))),
        "version": "1.0.0",
        "description": f"The BRDF of {called} as a three.js material, by homofact {__version__}",
        "type": "module",
        "main": "index.js",
        "exports": {".": "./index.js"},
        "files": ["index.js"],
        "peerDependencies": {"three": ">=0.160.0"},
    }
    names = {
        "NAME": in_markdown(called), "PACKAGE": package["name"], "VERSION": __version__, "ERRORS": light.off(),
        "NOTES": fit_notes(made), "TANGENTS": "" if isotropic else _TANGENTS,
        "CONTENTS": _CONTENTS if made.names else _CONTENTS_OF_MODEL,
    }  # fmt: skip
    return Added(
        {
            # A script would end at "</script>", a comment at "*/": neither stands in JSON that is escaped like this.
            "index.js": template("three.js", DATA=json.dumps(data, indent=1).replace("<", "\\u003c")),
            "index.html": page(called),
            "package.json": json.dumps(package, indent=2, ensure_ascii=False) + "\n",
            "README.md": template("three.md", **names),
        },
        light=light,
        shipped=("index.js", "package.json"),
    )


_CONTENTS = (
    "`index.js` contains the shader and the texels. The textures, `manifest.json` and `brdf.*` are for loaders of your"
    " own."
)
_CONTENTS_OF_MODEL = (
    "`index.js` contains the shader with the parameters of the model. `manifest.json` and `brdf.*` are for loaders of"
    " your own."
)
_TANGENTS = """
The fit is anisotropic. It has the x axis of its source (azimuth φ = 0) along the tangent t, and its y axis (φ = 90°)
along n × t. The tangent is the direction of increasing longitude around the object's y axis. To use the tangents of the
geometry, write `new BrdfMaterial({ vertexTangents: true })`. If a model has texture coordinates but no tangents, the
example page computes them with three's `computeTangents`.
"""


def _texture(texels: np.ndarray, kind: str) -> dict[str, Any]:
    """What the module makes a texture of, from texels (rows, columns, 4)."""
    rows, columns, _ = texels.shape
    return {"columns": columns, "rows": rows, "kind": kind, "texels": base64.b64encode(texels.tobytes()).decode()}


def page(called: str) -> str:
    """Return the example page; its Content-Security-Policy contains the digests of its style and scripts."""
    text = template_text("three.html")
    return template(
        "three.html",
        NAME=html.escape(called),
        STYLES=" ".join(map(source_digest, re.findall(r"<style>(.*?)</style>", text, re.DOTALL))),
        SCRIPTS=" ".join(map(source_digest, re.findall(r"<script [^>]*>(.*?)</script>", text, re.DOTALL))),
    )


def package_name(called: str, method: str = "") -> str:
    """Return a valid npm package name: lowercase letters, digits and hyphens, with the method unless it is a search."""
    words = called if method in ("", "search") else f"{called} {method}"
    return "homofact-" + (re.sub("[^a-z0-9]+", "-", words.lower()).strip("-") or "brdf")[:100]


THREE = Engine(
    "three", ("exr16", "exr", "png8"), _files, "fitting three.js's material and the table for its filtered skies"
)
