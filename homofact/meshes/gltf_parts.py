"""Read a glTF scene as parts: one mesh for each primitive, with its material and texture coordinates.

From a metallic-roughness material, homofact reads the factors, the pictures of base colour and normals, and the mean
values of the metallic-roughness texture. `left_out` names all other properties, such as emission and extensions.
"""

import math
import os
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from homofact.errors import BadInput
from homofact.files import extras
from homofact.files.reading import read_bytes, split_member
from homofact.meshes.gltf import gltf_header, parse_parts
from homofact.meshes.mesh import Mesh, mesh_of
from homofact.meshes.tangent_space import with_tangents
from homofact.meshes.texture_transform import NAME as TRANSFORM
from homofact.meshes.texture_transform import TextureTransform, coordinate_set

ENDINGS = (".gltf", ".glb")
MOST_PARTS, _LARGEST_SIDE = 256, 1024
_LEFT_OUT = {
    "emissiveTexture": "its emission",
    "emissiveFactor": "its emission",
    "occlusionTexture": "its occlusion map",
    "metallicRoughnessTexture": "the detail of its metallic-roughness texture",
}


@dataclass(frozen=True)
class GltfMaterial:
    """A material's factors, `base_colour` in linear RGB; `picture` (H, W, 3), row 0 at v = 0, multiplies the colour.

    The picture's values, from 0 to 1, are sRGB-encoded, as in the file. `normals` (H, W, 3) float32 are the unit
    normals of a normal map in tangent space, after its scale; None if all are (0, 0, 1). `left_out` names the
    properties that homofact does not use. `placed` is False if the mesh lacks the picture's texture coordinates; then
    only the picture's mean is used.
    """

    base_colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
    metallic: float = 1.0
    roughness: float = 1.0
    picture: np.ndarray | None = field(default=None, compare=False)
    normals: np.ndarray | None = field(default=None, compare=False)
    left_out: tuple[str, ...] = ()
    placed: bool = True


@dataclass(frozen=True)
class GltfPart:
    """A primitive: a name that is unique in the file, its mesh, and its material, if any."""

    name: str
    mesh: Mesh
    material: GltfMaterial | None


def is_gltf(text: str) -> bool:
    """Return whether a path, or FILE in "FILE#PART", has the extension of a glTF file."""
    return split_member(text)[0].lower().endswith(ENDINGS)


def gltf_parts(path: str | os.PathLike[str]) -> tuple[GltfPart, ...]:
    """Return all parts of a glTF file by name, scaled together into the unit sphere as by `read_mesh`.

    Raises BadInput as `read_mesh` does, and for missing or unreadable pictures, for textures on a mesh without texture
    coordinates, and for more than 256 parts.
    """
    target = Path(path)
    try:
        state = target.stat()
    except OSError:
        state = None
    return _parts(str(target), None if state is None else (state.st_mtime_ns, state.st_size))


def gltf_part(text: str) -> GltfPart:
    """Return the part that "FILE#PART" names.

    Raises BadInput as `gltf_parts` does, and if no part has this name; the message lists the names.
    """
    file, name = split_member(text)
    parts = gltf_parts(file)
    for part in parts:
        if part.name == name:
            return part
    raise BadInput(f"no part {name!r}", where=file, expected=f"one of {', '.join(part.name for part in parts)[:300]}")


@lru_cache(maxsize=8)
def _parts(path: str, _state: tuple[int, int] | None) -> tuple[GltfPart, ...]:
    target = Path(path)
    data = read_bytes(target, "a glTF scene")
    header = gltf_header(target, data)
    if header.get("images"):
        extras.library("PIL", f"{target}: textures")
        _check_pictures(target, header)
    # trimesh has them in no order that lasts.
    parsed = sorted(parse_parts(target, data), key=lambda part: (part[1], len(part[0].positions)))
    if len(parsed) > MOST_PARTS:
        raise BadInput(f"{len(parsed)} parts", where=target, expected=f"at most {MOST_PARTS}")
    used = np.concatenate([each.positions[np.unique(each.triangles)] for each, _, _ in parsed])
    if not np.isfinite(used).all():
        raise BadInput("a position that is not finite", where=target, expected="finite numbers")
    middle = (used.min(0) + used.max(0)) / 2
    radius = float(np.linalg.norm(used - middle, axis=1).max()) or 1.0
    found, written = [], _written(header)
    for own, name, visual in parsed:
        taken = {part.name for part in found}
        first = name.replace("#", "_").strip() or "part"
        chosen, k = first, 1
        while chosen in taken:
            k += 1
            chosen = f"{first} {k}"
        mesh = mesh_of(own, target, fitted=False)
        mesh = replace(mesh, positions=(mesh.positions - middle) / radius, name=chosen)
        material, moved = _material(f"{target}: {chosen}", visual, mesh, written)
        mesh = mesh if mesh.uv is None else replace(mesh, uv=moved.applied(mesh.uv))
        bumpy = material is not None and material.normals is not None
        mesh = with_tangents(mesh) if bumpy else replace(mesh, tangents=None)
        found.append(GltfPart(chosen, mesh, material))
    return tuple(found)


def _check_pictures(path: Path, header: dict[str, Any]) -> None:
    """Reject a file whose external pictures are missing. Raises BadInput."""
    images = header["images"] if isinstance(header["images"], list) else []
    for each in images:
        uri = each.get("uri") if isinstance(each, dict) else None
        if isinstance(uri, str) and not uri.startswith("data:"):
            read_bytes(path.parent / unquote(uri), f"a picture of {path.name}")


def _written(header: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the materials of the file's JSON by number; `parse_parts` uses the numbers as their names."""
    materials = header.get("materials")
    found = materials if isinstance(materials, list) else []
    return {str(number): each for number, each in enumerate(found) if isinstance(each, dict)}


def _material(
    where: str, visual: Any, mesh: Mesh, written: dict[str, dict[str, Any]]
) -> tuple[GltfMaterial | None, TextureTransform]:
    """Return the material, and the transform of the texture coordinates for its pictures."""
    given = getattr(visual, "material", None)
    if given is None or not hasattr(given, "baseColorFactor"):
        return None, TextureTransform()
    colour = given.baseColorFactor
    red, green, blue = (1.0, 1.0, 1.0) if colour is None else _factors(np.asarray(colour)[:3])
    metallic = 1.0 if given.metallicFactor is None else float(given.metallicFactor)
    roughness = 1.0 if given.roughnessFactor is None else float(given.roughnessFactor)
    picture, placed, left = None, True, list[str]()
    own = written.get(str(given.name), {})
    model = own.get("pbrMetallicRoughness")
    if given.baseColorTexture is None and isinstance(model, dict) and "baseColorTexture" in model:
        raise BadInput("a texture that cannot be read", where=where, expected="a PNG or JPEG")
    if given.baseColorTexture is not None:
        if mesh.uv is None:
            raise BadInput("a texture on a mesh without texture coordinates", where=where, expected="TEXCOORD_0")
        picture = _pixels(given.baseColorTexture, where)
        place = coordinate_set(model.get("baseColorTexture") if isinstance(model, dict) else None)
        if place != 0:
            # A mesh has one set of coordinates. Of the picture, as of one of metallic and roughness, the mean is left.
            placed, left = False, [f"the detail of its texture, on TEXCOORD_{place}"]
    if given.metallicRoughnessTexture is not None:
        means = _pixels(given.metallicRoughnessTexture, where).mean((0, 1))
        roughness, metallic = roughness * float(means[1]), metallic * float(means[2])
    normals, remarks = _normals(given, own, mesh, where)
    left += [words for key, words in _LEFT_OUT.items() if _is_there(getattr(given, key, None))]
    left += remarks
    moved, remarks = _moved(own, picture is not None and placed, normals is not None, where)
    left += remarks
    extensions = own.get("extensions")
    left += sorted(extensions) if isinstance(extensions, dict) else []
    remarks = tuple(dict.fromkeys(left))
    found = GltfMaterial((red, green, blue), metallic, roughness, picture, normals, remarks, placed)
    return found, moved


def _moved(own: dict[str, Any], coloured: bool, bumpy: bool, where: str) -> tuple[TextureTransform, tuple[str, ...]]:
    """Return the transform of the texture coordinates for the used pictures, and remarks on ignored transforms.

    A mesh has one set of texture coordinates. If its two pictures have different transforms, neither is applied.
    """
    model = own.get("pbrMetallicRoughness")
    colour = model.get("baseColorTexture") if isinstance(model, dict) else None
    used = {"its texture": colour} if coloured else {}
    used |= {"its normal map": own.get("normalTexture")} if bumpy else {}
    none = TextureTransform()
    moves = {words: TextureTransform.of(info, where) for words, info in used.items()}
    if len(set(moves.values())) > 1:
        return none, tuple(f"{TRANSFORM} of {words}" for words, move in moves.items() if move != none)
    return next(iter(moves.values()), none), ()


def _normals(given: Any, own: dict[str, Any], mesh: Mesh, where: str) -> tuple[np.ndarray | None, list[str]]:
    """Return the normals (H, W, 3) of a normal map, None if it is missing or flat, and remarks on ignored parts."""
    written = own.get("normalTexture")
    if given.normalTexture is None:
        if isinstance(written, dict):
            raise BadInput("a normal map that cannot be read", where=where, expected="a PNG or JPEG")
        return None, []
    if mesh.uv is None:
        raise BadInput("a normal map on a mesh without texture coordinates", where=where, expected="TEXCOORD_0")
    info = written if isinstance(written, dict) else {}
    scale, place = info.get("scale", 1.0), coordinate_set(info)
    if isinstance(scale, bool) or not isinstance(scale, int | float) or not math.isfinite(scale):
        raise BadInput(f"a normal map of scale {scale!r}", where=where, expected="a finite number")
    if place != 0:
        return None, [f"its normal map, on TEXCOORD_{place}"]
    # Bytes of 128 are 0, so that the usual flat map is flat.
    x, y, z = ((255 * _pixels(given.normalTexture, where) - 128) / 127).clip(-1, 1).transpose(2, 0, 1)
    normals = np.stack((x * scale, y * scale, z.clip(0)), -1)
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    normals = np.where(length > 1e-6, normals / length.clip(1e-6), (0.0, 0.0, 1.0)).astype(np.float32)
    extensions = info.get("extensions")
    names = [name for name in extensions if name != TRANSFORM] if isinstance(extensions, dict) else []
    left = [f"{name} of its normal map" for name in names]
    return (normals if normals[..., :2].any() else None), left


def _factors(values: np.ndarray) -> list[float]:
    """Return factors from 0 to 1; trimesh may give them as bytes."""
    return np.clip(values / 255 if values.dtype.kind == "u" else values, 0, 1).astype(float).tolist()


def _is_there(value: Any) -> bool:
    """Return whether a value is a picture or a nonzero factor."""
    return value is not None and (hasattr(value, "convert") or bool(np.any(value)))


def _pixels(picture: Any, where: str) -> np.ndarray:
    """Return pixels (H, W, 3) from 0 to 1, at most 1024 a side. Raises BadInput for unreadable pictures."""
    try:
        found = picture.convert("RGB")
        if max(found.size) > _LARGEST_SIDE:
            found.thumbnail((_LARGEST_SIDE, _LARGEST_SIDE))
        return np.asarray(found, np.float64) / 255
    # A damaged picture raises whatever the place that was damaged leads to.
    except Exception as error:
        raise BadInput(f"a texture that cannot be read ({error})", where=where, expected="a PNG or JPEG") from error
