"""A look-alike for viewers of glTF: the metallic-roughness material nearest to the fit, on a sphere, in one .glb.

The material's name and README.md say that it is a look-alike, and how near it comes (`exporting.look_alike`).
"""

import json
import math
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np

from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.exporting.as_source import knows_no_azimuth
from homofact.exporting.engines.base import Added, Engine, check_colour, fit_notes, template
from homofact.exporting.exported import Exported
from homofact.exporting.gltf_fit import fit_metallic_roughness
from homofact.exporting.look_alike import LEAST_PSNR, MOST_ALBEDO, MOST_HIGHLIGHT, AddedLookAlike, Likeness, likeness
from homofact.files.words import in_markdown
from homofact.meshes.shapes import sphere
from homofact.shading.program import name_of
from homofact.version import __version__

NAME, README = "lookalike.glb", "README.md"
GOOD = (
    f"These figures are good enough to pass without a warning: at least {LEAST_PSNR} dB, the albedo within"
    f" {MOST_ALBEDO} times and the highlight within {MOST_HIGHLIGHT} times."
)
POOR = """Expect visible differences: homofact found no material of this kind that comes nearer to this fit. That is
usual for metallic paints, brushed metals, mirrors and retroreflectors."""
_FLOAT, _UNSIGNED, _VERTICES, _INDICES = 5126, 5125, 34962, 34963


def _files(made: Exported) -> Added:
    check_colour(made, "gltf")
    look = fit_metallic_roughness(made.stored, knows_no_azimuth(made.stored))
    found = likeness(look, made.stored)
    name = name_of(made.stored.provenance)
    text = readme(look, name, found, fit_notes(made))
    files = {NAME: glb(look, name, note=found.phrase), README: text}
    return AddedLookAlike(files, {"look-alike": look}, likeness=found)


def readme(look: MetallicRoughness, name: str, found: Likeness, notes: str = "") -> str:
    """Return the text of README.md on the look-alike and its errors, with `notes` as from `fit_notes`."""
    rows = [f"| {label} | {value} |" for label, value in _numbers(look)]
    extensions = sorted(extensions_of(look))
    return template(
        "gltf.md",
        NAME=in_markdown(name),
        PHRASE=found.phrase,
        NOTES=notes,
        PARAMETERS="\n".join(rows),
        EXTENSIONS=f"{', '.join(extensions)}. A viewer that lacks one shows something less like the fit"
        * bool(extensions)
        or "none",
        PICTURES=found.pictures,
        HIGHLIGHT=f"{found.highlight:.2f}",
        TABLE=found.table,
        VERDICT=POOR if found.poor else GOOD,
        VERSION=__version__,
    )


def material_of(look: MetallicRoughness, name: str) -> dict[str, Any]:
    """Return the material's object in glTF's JSON."""
    colour = look.base_colour if len(look.base_colour) == 3 else look.base_colour * 3
    material: dict[str, Any] = {
        "name": name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*colour, 1.0],
            "metallicFactor": look.metallic,
            "roughnessFactor": look.roughness,
        },
    }
    more = extensions_of(look)
    return material | ({"extensions": more} if more else {})


def extensions_of(look: MetallicRoughness) -> dict[str, Any]:
    """Return the extensions of the material's object by name, without those that would change nothing."""
    more: dict[str, Any] = {}
    if look.extended_specular:
        colour = look.specular_colour or (1.0,)
        more["KHR_materials_specular"] = {
            "specularFactor": look.specular,
            "specularColorFactor": list(colour if len(colour) == 3 else colour * 3),
        }
    if look.clearcoat > 0:
        more["KHR_materials_clearcoat"] = {
            "clearcoatFactor": look.clearcoat,
            "clearcoatRoughnessFactor": look.clearcoat_roughness,
        }
    if look.anisotropy > 0:
        strength, turn = look.anisotropy, look.rotation
        more["KHR_materials_anisotropy"] = {"anisotropyStrength": strength, "anisotropyRotation": turn}
    return more


def glb(look: MetallicRoughness, name: str, rings: int = 48, note: str = "") -> bytes:
    """Return a binary glTF 2.0 file: the unit sphere with its tangents along the parallels, in this material.

    The name of the material ends with `note` in parentheses.
    """
    mesh = sphere(rings)
    normals = mesh.normals
    across = np.stack((normals[:, 2], np.zeros(len(normals)), -normals[:, 0]), 1)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    tangents = np.where(length > 1e-9, across / np.maximum(length, 1e-9), np.array([[1.0, 0.0, 0.0]]))
    arrays = [
        (mesh.positions.astype("<f4"), "VEC3", _FLOAT, _VERTICES),
        (normals.astype("<f4"), "VEC3", _FLOAT, _VERTICES),
        (np.concatenate((tangents, np.ones((len(normals), 1))), 1).astype("<f4"), "VEC4", _FLOAT, _VERTICES),
        (mesh.triangles.astype("<u4").reshape(-1, 1), "SCALAR", _UNSIGNED, _INDICES),
    ]
    views, accessors, data = [], [], b""
    for array, kind, component, target in arrays:
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes, "target": target})
        accessor = {"bufferView": len(accessors), "componentType": component, "count": len(array), "type": kind}
        if target == _VERTICES:
            accessor |= {"min": array.min(0).tolist(), "max": array.max(0).tolist()}
        accessors.append(accessor)
        data += array.tobytes()
    material = material_of(look, f"{name} ({note})" if note else name)
    scene = {
        "asset": {"version": "2.0", "generator": f"homofact {__version__}"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": name}],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1, "TANGENT": 2}, "indices": 3, "material": 0}]}
        ],
        "materials": [material],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
    }
    if "extensions" in material:
        scene["extensionsUsed"] = sorted(material["extensions"])
    text = json.dumps(scene, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    data += bytes(-len(data) % 4)
    total = 12 + 8 + len(text) + 8 + len(data)
    head = struct.pack("<4sII", b"glTF", 2, total)
    return head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data


def said(look: MetallicRoughness) -> str:
    """Return the material's numbers on one line."""
    return ", ".join(f"{label} {value}" for label, value in _numbers(look))


def _numbers(look: MetallicRoughness) -> list[tuple[str, str]]:
    """What the material's numbers are called, and what they are."""

    def colour(values: Sequence[float]) -> str:
        return f"({', '.join(f'{x:.3f}' for x in values)})"

    rows = [("baseColor", colour(look.base_colour))]
    rows += [("metallic", f"{look.metallic:.3f}"), ("roughness", f"{look.roughness:.3f}")]
    if look.extended_specular:
        reflected = colour(look.normal_reflectance)
        rows.append(("specular", f"{look.specular:.3f} with {reflected} at normal incidence"))
    if look.clearcoat > 0:
        rows.append(("clearcoat", f"{look.clearcoat:.3f} of roughness {look.clearcoat_roughness:.3f}"))
    if look.anisotropy > 0:
        rows.append(("anisotropy", f"{look.anisotropy:.3f} at {math.degrees(look.rotation):.0f} degrees"))
    return rows


GLTF = Engine("gltf", ("exr", "exr16", "png8", "png16", "ktx2", "dds", "bc6h"), _files, "fitting glTF's material")
