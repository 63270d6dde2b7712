"""Read the triangles of a glTF scene, whole or by parts, with trimesh, after checking the counts in the file.

Buffers beside a .gltf file are read with the checks of any other file. Images are read only for `parse_parts`. The
number and depth of nodes is limited, because trimesh's time grows at least with the square of the nesting depth, and it
copies a mesh for every node that references it.
"""

import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from homofact.errors import BadInput
from homofact.files import extras
from homofact.files.reading import parsed_json, read_bytes, short_json
from homofact.meshes.parsed import Parsed

_WHOLE = "a whole glTF"
_TANGENT = "_TANGENT"  # trimesh hands on what begins with an underscore
_MOST_NODES, _DEEPEST, _MOST_CORNERS = 10_000, 64, 30_000_000


def parse_gltf(path: Path, data: bytes) -> Parsed:
    """Return all meshes of a .glb or .gltf scene, transformed and merged; also reads buffers beside a .gltf.

    Raises BadInput if trimesh is not installed or rejects the file, if the file declares more data than it can contain,
    or if it has no triangles.
    """
    parts = [parsed for parsed, _, _ in _loaded(path, data, False)]
    starts = np.cumsum([0, *(len(each.positions) for each in parts)])
    normals = [each.normals for each in parts if each.normals is not None]
    return Parsed(
        np.concatenate([each.positions for each in parts]),
        np.concatenate(normals) if len(normals) == len(parts) else None,
        np.concatenate([each.triangles + start for each, start in zip(parts, starts, strict=False)]),
    )


def parse_parts(path: Path, data: bytes) -> list[tuple[Parsed, str, Any]]:
    """Return every primitive, transformed, with its name and trimesh's visual, including pictures.

    Raises BadInput as `parse_gltf` does.
    """
    return _loaded(path, data, True)


def gltf_header(path: Path, data: bytes) -> dict[str, Any]:
    """Return the JSON of a .glb or .gltf file. Raises BadInput if there is none."""
    return _header(path, data, data[:4] == b"glTF")


def _loaded(path: Path, data: bytes, materials: bool) -> list[tuple[Parsed, str, Any]]:
    trimesh = extras.library("trimesh", f"{path}: glTF")
    header = gltf_header(path, data)
    _check(path, header, len(data))
    kind = "glb" if data[:4] == b"glTF" else "gltf"
    data = _for_parts(header, data) if materials else data
    try:
        scene = trimesh.load_scene(
            BytesIO(data), file_type=kind, resolver=_Beside(path), process=False, skip_materials=not materials
        )
        found = scene.dump(concatenate=False)
    except BadInput:
        raise
    # A damaged file raises whatever the place that was damaged leads to.
    except Exception as error:
        words = " ".join(str(error).split()) or type(error).__name__
        raise BadInput(f"not a readable glTF ({words[:200]})", where=path, expected=_WHOLE) from error
    parts = [each for each in found if isinstance(each, trimesh.Trimesh) and len(each.faces)]
    if not parts:
        raise BadInput("no triangles in it", where=path, expected="a mesh")
    return [(_parsed(path, each, scene), str(each.metadata.get("name", "")), each.visual) for each in parts]


def _for_parts(header: dict[str, Any], data: bytes) -> bytes:
    """Return the file with tangents renamed and materials named by number, so that trimesh keeps them."""
    for number, material in enumerate(_dicts(header, "materials")):
        material["name"] = str(number)
    for mesh in _dicts(header, "meshes"):
        for primitive in _dicts(mesh, "primitives"):
            attributes = primitive.get("attributes")
            if isinstance(attributes, dict) and "TANGENT" in attributes:
                attributes[_TANGENT] = attributes.pop("TANGENT")
    text = json.dumps(header).encode()
    if data[:4] != b"glTF":
        return text
    text += b" " * (-len(text) % 4)
    rest = data[20 + struct.unpack("<I", data[12:16])[0] :]
    total = 20 + len(text) + len(rest)
    return data[:8] + struct.pack("<II4s", total, len(text), b"JSON") + text + rest


def _normals(part: Any, scene: Any, count: int) -> np.ndarray | None:
    """Return a part's normals (V, 3) from the file, in the scene's frame and of any length."""
    place, name = scene.graph[part.metadata["node"]]
    # trimesh has them in the cache of what it read; a copy at its place in the scene loses them.
    given = np.asarray(scene.geometry[name]._cache.cache.get("vertex_normals", ()), np.float64)
    if given.shape != (count, 3):
        return None
    # Planes turn by the inverse transpose: n · p stays 0 for every p in the plane.
    cofactors = np.cross(place[[1, 2, 0], :3], place[[2, 0, 1], :3])
    return given @ cofactors.T * np.sign(np.linalg.det(place[:3, :3]))


def _tangents(part: Any, scene: Any, count: int) -> np.ndarray | None:
    """Return a part's tangents (V, 4) from the file, in the scene's frame."""
    given = np.asarray(part.vertex_attributes.get(_TANGENT, ()), np.float64)
    if given.shape != (count, 4):
        return None
    place = scene.graph[part.metadata["node"]][0][:3, :3]
    # A mirrored place turns the handedness over.
    return np.concatenate((given[:, :3] @ place.T, given[:, 3:] * np.sign(np.linalg.det(place))), 1)


def _parsed(path: Path, part: Any, scene: Any) -> Parsed:
    points, faces = np.asarray(part.vertices), np.asarray(part.faces)
    if points.ndim != 2 or points.shape[1] != 3 or faces.shape[1:] != (3,):
        raise BadInput(f"points of shape {points.shape}", where=path, expected="three coordinates a point")
    if faces.min() < 0 or faces.max() >= len(points):
        raise BadInput(f"a face names vertex {faces.max()} of {len(points)}", where=path, expected="one of its mesh")
    uv = getattr(part.visual, "uv", None)
    if uv is not None:
        # trimesh has v upwards.
        uv = np.asarray(uv, np.float64)[:, :2] * (1, -1) + (0, 1)
        uv = uv if uv.shape == (len(points), 2) and np.isfinite(uv).all() else None
    return Parsed(
        np.asarray(points, np.float64),
        _normals(part, scene, len(points)),
        np.asarray(faces, np.int64),
        uv,
        _tangents(part, scene, len(points)),
    )


@dataclass(frozen=True)
class _Beside:
    """The resolver through which trimesh reads the files that a .gltf references: only regular files beside it."""

    path: Path

    def __getitem__(self, name: str) -> bytes:
        """Return the bytes of a file."""
        return read_bytes(self.path.parent / unquote(name), f"a buffer of {self.path.name}")


def _header(path: Path, data: bytes, binary: bool) -> dict[str, Any]:
    """The JSON of the file. Raises BadInput where there is none."""
    text = data
    if binary:
        try:
            size, kind = struct.unpack("<I4s", data[12:20])
        except struct.error:
            size, kind = 0, b""
        if kind != b"JSON" or 20 + size > len(data):
            raise BadInput("not a readable glTF (no JSON in it)", where=path, expected=_WHOLE)
        text = data[20 : 20 + size]
    try:
        found = parsed_json(text.decode("utf-8"))
    except ValueError as error:
        raise BadInput(f"not a readable glTF ({error})", where=path, expected=_WHOLE) from error
    if not isinstance(found, dict):
        raise BadInput(f"not a readable glTF ({short_json(found)})", where=path, expected=_WHOLE)
    return found


def _check(path: Path, header: dict[str, Any], size: int) -> None:
    """Reject nodes that are too many or not trees, and counts that exceed the buffers. Raises BadInput."""
    nodes, accessors = _dicts(header, "nodes"), _dicts(header, "accessors")
    room = size + sum(_whole(each, "byteLength") for each in _dicts(header, "buffers"))
    for number, each in enumerate(accessors):
        if _whole(each, "count") > room:
            raise BadInput(
                f"accessors[{number}] of {short_json(each['count'])} elements", where=path, expected="what buffers hold"
            )
    if len(nodes) > _MOST_NODES:
        raise BadInput(f"{len(nodes)} nodes", where=path, expected=f"at most {_MOST_NODES}")
    parents: dict[int, int] = {}
    for number, each in enumerate(nodes):
        for child in _numbers(each.get("children"), len(nodes)):
            if parents.setdefault(child, number) != number or child == number:
                raise BadInput(f"node {child} has two parents", where=path, expected="trees of nodes")
    corners = 0
    for number, each in enumerate(nodes):
        place, depth = number, 0
        while place in parents and depth <= _DEEPEST:
            place, depth = parents[place], depth + 1
        if depth > _DEEPEST:
            raise BadInput(f"node {number} lies in more than {_DEEPEST} others", where=path, expected="fewer")
        corners += _corners(header, each, accessors)
    if corners > _MOST_CORNERS:
        raise BadInput(f"{corners} corners of triangles", where=path, expected=f"at most {_MOST_CORNERS}")


def _corners(header: dict[str, Any], node: dict[str, Any], accessors: list[dict[str, Any]]) -> int:
    """Return an upper bound of the number of corners of a node's mesh."""
    meshes = _dicts(header, "meshes")
    total = 0
    for number in _numbers([node.get("mesh")], len(meshes)):
        for primitive in _dicts(meshes[number], "primitives"):
            attributes = primitive.get("attributes")
            places = attributes.get("POSITION") if isinstance(attributes, dict) else None
            for which in (primitive.get("indices"), places):
                total += sum(_whole(accessors[k], "count") for k in _numbers([which], len(accessors)))
    return total


def _dicts(found: dict[str, Any], name: str) -> list[dict[str, Any]]:
    """Return a list of JSON objects; an entry of another type becomes {}, and trimesh rejects it later."""
    value = found.get(name)
    return [each if isinstance(each, dict) else {} for each in value] if isinstance(value, list) else []


def _numbers(value: Any, below: int) -> Iterator[int]:
    """Yield the entries of a list that are valid indices below `below`."""
    for each in value if isinstance(value, list) else ():
        if isinstance(each, int) and not isinstance(each, bool) and 0 <= each < below:
            yield each


def _whole(found: dict[str, Any], name: str) -> int:
    value = found.get(name, 0)
    return max(value, 0) if isinstance(value, int) else 0
