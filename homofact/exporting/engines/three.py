"""A three.js material as a folder that npm installs: one module with texels and shader in it, an example page.

The material is three's own physical one, its direct light replaced by the fit's program (`RE_Direct` of its shader).
Environments are reflected by the glTF material that looks most like the fit (`gltf_fit`, without extensions).
"""

import base64
import html
import json
import re

from homofact.exporting.as_source import knows_no_azimuth
from homofact.exporting.engines.base import Added, Engine, check_colour, rgba, template, template_text
from homofact.exporting.exported import Exported
from homofact.exporting.gltf_fit import fit_metallic_roughness
from homofact.files.template import source_digest
from homofact.files.words import in_markdown
from homofact.shading.languages import GLSL, shader
from homofact.shading.program import name_of
from homofact.version import __version__

_KINDS = {"float16": "half", "float32": "float", "unorm8": "byte"}


def _files(made: Exported) -> Added:
    check_colour(made, "three")
    look = fit_metallic_roughness(made.stored, knows_no_azimuth(made.stored), extensions=False)
    colour = look.base_colour if len(look.base_colour) == 3 else look.base_colour * 3
    textures = [
        {
            "columns": texture.stored.shape[1],
            "rows": texture.stored.shape[0],
            "kind": _KINDS[texture.storage],
            "texels": base64.b64encode(rgba(texture).tobytes()).decode(),
        }
        for texture in made.textures
    ]
    data = {
        "textures": textures,
        "glsl": shader(made.program, GLSL),
        "lookalike": {"color": list(colour), "metalness": look.metallic, "roughness": look.roughness},
    }
    called = name_of(made.stored.provenance)
    package = {
        "name": package_name(called),
        "version": "1.0.0",
        "description": f"The BRDF of {called} as a three.js material, by homofact {__version__}",
        "type": "module",
        "main": "index.js",
        "exports": {".": "./index.js"},
        "files": ["index.js", "index.html", "README.md", "manifest.json", "brdf.glsl"],
        "peerDependencies": {"three": ">=0.160.0"},
    }
    names = {"NAME": in_markdown(called), "PACKAGE": package["name"], "VERSION": __version__}
    return Added(
        {
            # A script would end at "</script>", a comment at "*/": neither stands in JSON that is escaped like this.
            "index.js": template("three.js", DATA=json.dumps(data, indent=1).replace("<", "\\u003c")),
            "index.html": page(called),
            "package.json": json.dumps(package, indent=2, ensure_ascii=False) + "\n",
            "README.md": template("three.md", **names),
        },
        {"environment": look},
    )


def page(called: str) -> str:
    """The example page, its Content-Security-Policy by the digests of the style and the scripts that it holds."""
    text = template_text("three.html")
    return template(
        "three.html",
        NAME=html.escape(called),
        STYLES=" ".join(map(source_digest, re.findall(r"<style>(.*?)</style>", text, re.DOTALL))),
        SCRIPTS=" ".join(map(source_digest, re.findall(r"<script [^>]*>(.*?)</script>", text, re.DOTALL))),
    )


def package_name(called: str) -> str:
    """A name that npm takes: small letters, digits and hyphens."""
    return "homofact-" + (re.sub("[^a-z0-9]+", "-", called.lower()).strip("-") or "brdf")[:100]


THREE = Engine("three", ("exr16", "exr", "png8"), _files)
