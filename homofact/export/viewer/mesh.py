"""A mesh to show a material on: Wavefront OBJ and PLY (ASCII, binary little-endian), told apart by content.

Positions are moved and scaled so that the smallest box round the mesh is centred and the mesh's farthest corner
lies on the unit sphere. Normals that the file has are kept; else each vertex gets the sum of its triangles' normals,
weighted by their areas, over all vertices at the same place (an OBJ splits them along texture seams). A mesh wound
inside out, which encloses a negative volume, is turned, and every triangle is wound so that it faces the side of its
normals. Polygons become fans. Texture coordinates, colours, groups and materials are passed over.
"""

import os
import struct
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from homofact.errors import BadInput

_PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
_INDEX_NAMES = ("vertex_indices", "vertex_index")


@dataclass(frozen=True)
class Mesh:
    """`positions` (V, 3) and unit `normals` (V, 3) float64, `triangles` (T, 3) int64 into them; `name` for captions."""

    positions: np.ndarray
    normals: np.ndarray
    triangles: np.ndarray
    name: str


class _Parsed(NamedTuple):
    positions: np.ndarray
    normals: np.ndarray | None
    triangles: np.ndarray


def read_mesh(path: str | os.PathLike[str]) -> Mesh:
    """The mesh in an OBJ or PLY file, as the module's head says.

    Raises BadInput, one line, for a file that cannot be read, is neither, is damaged or truncated, has no triangles,
    indices that name no vertex, or coordinates that are not finite.
    """
    target = Path(path)
    try:
        data = target.read_bytes()
    except OSError as error:
        raise BadInput(f"{target}: cannot be read ({error.strerror}), expected an OBJ or PLY mesh") from error
    parsed = _ply(data, str(target)) if data[:4] in (b"ply\n", b"ply\r") else _obj(data, str(target))
    positions, normals, triangles = parsed
    if not len(triangles):
        raise BadInput(f"{target}: no triangles in it, expected a mesh")
    for what, values in (("position", positions), ("normal", normals)):
        if values is not None and not np.isfinite(values).all():
            row = int(np.argwhere(~np.isfinite(values))[0, 0])
            raise BadInput(f"{target}: {what} {row + 1} is not finite, expected finite numbers")
    if triangles.min() < 0 or triangles.max() >= len(positions):
        wrong = int(triangles.min() if triangles.min() < 0 else triangles.max())
        raise BadInput(f"{target}: a face names vertex {wrong}, expected 0 to {len(positions) - 1}")
    used = positions[np.unique(triangles)]
    low, high = used.min(0), used.max(0)
    if not (high - low).any():
        raise BadInput(f"{target}: all vertices are at one place, expected a mesh with an extent")
    # Before anything is squared: coordinates may be of any size.
    positions = (positions - (low + high) / 2) / (high - low).max()
    positions /= np.linalg.norm(positions[np.unique(triangles)], axis=1).max()
    if normals is None or not np.linalg.norm(normals, axis=1).all():
        triangles = _outward(positions, triangles)
        computed = _vertex_normals(positions, triangles)
        given = np.zeros(len(positions), bool) if normals is None else np.linalg.norm(normals, axis=1) > 0
        normals = computed if normals is None else np.where(given[:, None], normals, computed)
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(positions, normals, _facing(positions, normals, triangles), target.name)


def _face_normals(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(T, 3), twice the triangle's area long."""
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def _outward(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The triangles, all turned where they enclose a negative volume."""
    volume = (positions[triangles[:, 0]] * _face_normals(positions, triangles)).sum()
    return triangles if volume >= 0 else triangles[:, ::-1].copy()


def _vertex_normals(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(V, 3), not 0: the sum of the triangles' normals over all vertices at the same place; z where there is none."""
    _, place = np.unique(positions, axis=0, return_inverse=True)
    place = place.reshape(-1)
    total = np.zeros((place.max() + 1, 3))
    faces = _face_normals(positions, triangles)
    for corner in range(3):
        np.add.at(total, place[triangles[:, corner]], faces)
    total[np.linalg.norm(total, axis=1) == 0] = (0, 0, 1)
    return total[place]


def _facing(positions: np.ndarray, normals: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The triangles, each wound so that its own normal is on the side of its vertices'."""
    away = (_face_normals(positions, triangles) * normals[triangles].sum(1)).sum(1) < 0
    return np.where(away[:, None], triangles[:, ::-1], triangles)


def _fans(polygons: list[tuple[int, ...]]) -> np.ndarray:
    """(T, 3) int64 of polygons of three or more corners."""
    corners = chain.from_iterable((p[0], p[k], p[k + 1]) for p in polygons for k in range(1, len(p) - 1))
    return np.fromiter(corners, np.int64).reshape(-1, 3)


def _obj(data: bytes, name: str) -> _Parsed:
    """Lines v, vn and f; a vertex for each pair of position and normal that the faces use."""
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise BadInput(f"{name}: neither text nor a PLY file, expected an OBJ or PLY mesh") from error
    points: list[tuple[float, ...]] = []
    normals: list[tuple[float, ...]] = []
    corners: dict[tuple[int, int], int] = {}
    polygons: list[tuple[int, ...]] = []
    for number, line in enumerate(text.replace("\\\r\n", " ").replace("\\\n", " ").splitlines(), 1):
        words = line.split()
        if not words or words[0] not in ("v", "vn", "f"):
            continue
        where = f"{name}: line {number}"
        if words[0] == "f":
            polygon = tuple(
                corners.setdefault(_corner(word, len(points), len(normals), where), len(corners)) for word in words[1:]
            )
            if len(polygon) < 3:
                raise BadInput(f"{where}: a face of {len(polygon)} corners, expected at least 3")
            polygons.append(polygon)
            continue
        try:
            vector = tuple(float(word) for word in words[1:4])
        except ValueError:
            vector = ()
        if len(vector) != 3:
            raise BadInput(f"{where}: found {line.strip()[:60]!r}, expected three numbers")
        (points if words[0] == "v" else normals).append(vector)
    if not points and not polygons:
        raise BadInput(f"{name}: no vertices in it, expected an OBJ or PLY mesh")
    used = np.array(list(corners), np.int64).reshape(-1, 2)
    positions = np.array(points, np.float64).reshape(-1, 3)[used[:, 0]]
    directions = None
    if normals and (used[:, 1] >= 0).any():
        directions = np.array([*normals, (0.0, 0.0, 0.0)], np.float64)[used[:, 1]]
    return _Parsed(positions, directions, _fans(polygons))


def _corner(word: str, points: int, normals: int, where: str) -> tuple[int, int]:
    """(position, normal) of v, v/vt, v//vn or v/vt/vn, counted from 0; the normal is −1 where there is none."""
    parts = word.split("/")
    found = []
    for what, part, count in (("vertex", parts[0], points), ("normal", parts[2] if len(parts) > 2 else "", normals)):
        if what == "normal" and not part:
            found.append(-1)
            continue
        try:
            index = int(part)
        except ValueError:
            raise BadInput(f"{where}: found {word[:40]!r} in a face, expected indices as in 1/1/1") from None
        # Counted from 1, or backwards from the last one so far.
        if not (1 <= index <= count or -count <= index <= -1):
            raise BadInput(f"{where}: a face names {what} {index} of {count}, expected 1 to {count}")
        found.append(index - 1 if index > 0 else count + index)
    return found[0], found[1]


class _Element(NamedTuple):
    """`properties`: name, type of the length for a list else "", type."""

    name: str
    count: int
    properties: list[tuple[str, str, str]]


def _ply(data: bytes, name: str) -> _Parsed:
    """Elements vertex and face; others are passed over."""
    end = data.find(b"end_header")
    if end < 0:
        raise BadInput(f"{name}: no end_header line, expected a whole PLY header")
    kind, elements = _ply_header(data[:end].decode("latin-1"), name)
    body = data[data.find(b"\n", end) + 1 :]
    rows = _ascii_rows(body, elements, name) if kind == "ascii" else _binary_rows(body, elements, name)
    if "vertex" not in rows:
        raise BadInput(f"{name}: no element vertex, expected one with x, y and z")
    columns = rows["vertex"]
    if not all(axis in columns for axis in "xyz"):
        raise BadInput(f"{name}: vertices have {', '.join(columns)}, expected x, y and z")
    positions = np.stack([np.asarray(columns[axis], np.float64) for axis in "xyz"], 1)
    normals = None
    if all(axis in columns for axis in ("nx", "ny", "nz")):
        normals = np.stack([np.asarray(columns[axis], np.float64) for axis in ("nx", "ny", "nz")], 1)
    faces = rows.get("face", {})
    lists = next((faces[key] for key in _INDEX_NAMES if key in faces), None)
    if lists is None:
        raise BadInput(f"{name}: no faces with vertex_indices, expected a mesh and not a cloud of points")
    if isinstance(lists, np.ndarray):
        polygons = lists.astype(np.int64)
        if polygons.shape[1] < 3:
            raise BadInput(f"{name}: faces of {polygons.shape[1]} corners, expected at least 3")
        fans = [polygons[:, [0, k, k + 1]] for k in range(1, polygons.shape[1] - 1)]
        return _Parsed(positions, normals, np.concatenate(fans))
    short = min((len(polygon) for polygon in lists), default=3)
    if short < 3:
        raise BadInput(f"{name}: a face of {short} corners, expected at least 3")
    return _Parsed(positions, normals, _fans(lists))


def _ply_header(text: str, name: str) -> tuple[str, list[_Element]]:
    kind, elements = "", []
    for line in text.splitlines()[1:]:
        words = line.split()
        try:
            match words:
                case [] | ["comment", *_] | ["obj_info", *_]:
                    continue
                case ["format", "ascii" | "binary_little_endian" as kind, "1.0"]:
                    continue
                case ["element", element, count]:
                    elements.append(_Element(element, int(count), []))
                case ["property", "list", length, entry, key]:
                    elements[-1].properties.append((key, _PLY_TYPES[length], _PLY_TYPES[entry]))
                case ["property", entry, key]:
                    elements[-1].properties.append((key, "", _PLY_TYPES[entry]))
                case _:
                    raise ValueError
        except (ValueError, KeyError, IndexError):
            expected = "format ascii or binary_little_endian 1.0, elements and their properties"
            raise BadInput(f"{name}: the header has {line.strip()[:60]!r}, expected {expected}") from None
    if not kind or any(element.count < 0 for element in elements):
        raise BadInput(f"{name}: the header names no format or a negative count, expected a whole PLY header")
    return kind, elements


_Rows = dict[str, dict[str, np.ndarray | list]]


def _ascii_rows(body: bytes, elements: list[_Element], name: str) -> _Rows:
    lines = [line for line in body.split(b"\n") if line.strip()]
    rows: _Rows = {}
    start = 0
    for element in elements:
        part = lines[start : start + element.count]
        start += element.count
        columns: dict[str, list] = {key: [] for key, _, _ in element.properties}
        try:
            if len(part) < element.count:
                raise IndexError
            for line in part:
                words, at = line.split(), 0
                for key, length, kind in element.properties:
                    take = int(words[at]) if length else 1
                    at += 1 if length else 0
                    if take < 0 or at + take > len(words):
                        raise IndexError
                    values = tuple((float if kind[0] == "f" else int)(word) for word in words[at : at + take])
                    columns[key].append(values if length else values[0])
                    at += take
        except (ValueError, IndexError):
            found = f"{len(part)} of {element.count} lines of element {element.name}, or a damaged one"
            raise BadInput(f"{name}: {found}, expected what the header says") from None
        rows[element.name] = dict(columns)
    return rows


def _binary_rows(body: bytes, elements: list[_Element], name: str) -> _Rows:
    rows: _Rows = {}
    at = 0
    for element in elements:
        try:
            columns, at = _binary_element(body, at, element)
        except (struct.error, ValueError, IndexError):
            what = f"the file ends within element {element.name}, or it is damaged"
            raise BadInput(f"{name}: {what}, expected {element.count} of them as the header says") from None
        rows[element.name] = columns
    return rows


def _binary_element(body: bytes, at: int, element: _Element) -> tuple[dict[str, np.ndarray | list], int]:
    """The columns of one element and where the next begins; raises where the bytes do not suffice."""
    fields: list[tuple] = []
    look = at
    for key, length, kind in element.properties:
        if length and element.count:
            # Taken to be as long everywhere as in the first row; checked below.
            take = int(np.frombuffer(body, "<" + length, 1, look)[0])
            fields += [(f"{key} count", "<" + length), (key, "<" + kind, (take,))]
            look += np.dtype(length).itemsize + take * np.dtype(kind).itemsize
        else:
            fields.append((key, "<" + kind))
            look += np.dtype(kind).itemsize
    row = np.dtype(fields)
    if element.count == 0 or row.itemsize == 0:
        return {key: [] for key, _, _ in element.properties}, at
    if at + row.itemsize * element.count <= len(body):
        table = np.frombuffer(body, row, element.count, at)
        counts = [field for field in row.names or () if field.endswith(" count")]
        if all((table[field] == table[field][0]).all() for field in counts):
            columns: dict[str, np.ndarray | list] = {key: table[key] for key, _, _ in element.properties}
            return columns, at + row.itemsize * element.count
    return _ragged_element(body, at, element)


def _ragged_element(body: bytes, at: int, element: _Element) -> tuple[dict[str, np.ndarray | list], int]:
    codes = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "f4": "f", "f8": "d"}
    lists: dict[str, list] = {key: [] for key, _, _ in element.properties}
    for _ in range(element.count):
        for key, length, kind in element.properties:
            take = 1
            if length:
                (take,) = struct.unpack_from("<" + codes[length], body, at)
                at += np.dtype(length).itemsize
            if take < 0:
                raise ValueError
            values = struct.unpack_from(f"<{take}{codes[kind]}", body, at)
            at += take * np.dtype(kind).itemsize
            lists[key].append(values if length else values[0])
    return dict(lists), at
