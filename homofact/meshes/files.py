"""Read the triangles of an OBJ file, line by line, and of a PLY file, with the library plyfile.

Polygons become triangle fans. Texture coordinates, colours, groups and materials are ignored.
"""

import warnings
from collections.abc import Sequence
from io import BytesIO
from itertools import chain

import numpy as np

from homofact.errors import BadInput
from homofact.files import extras
from homofact.meshes.parsed import Parsed

_INDEX_NAMES = ("vertex_indices", "vertex_index")


def _fans(polygons: list[tuple[int, ...]]) -> np.ndarray:
    """Return triangles (T, 3) int64 of polygons with three or more corners."""
    corners = chain.from_iterable((p[0], p[k], p[k + 1]) for p in polygons for k in range(1, len(p) - 1))
    return np.fromiter(corners, np.int64).reshape(-1, 3)


def parse_obj(data: bytes, name: str) -> Parsed:
    """Parse the lines v, vn and f into a mesh with a vertex for each used pair of position and normal.

    Raises BadInput with the line number.
    """
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise BadInput("neither text nor a PLY file", where=name, expected="an OBJ, PLY or glTF mesh") from error
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
                raise BadInput(f"a face of {len(polygon)} corners", where=where, expected="at least 3")
            polygons.append(polygon)
            continue
        try:
            vector = tuple(float(word) for word in words[1:4])
        except ValueError:
            vector = ()
        if len(vector) != 3:
            raise BadInput(where=where, found=repr(line.strip()[:60]), expected="three numbers")
        (points if words[0] == "v" else normals).append(vector)
    if not points and not polygons:
        raise BadInput("no vertices in it", where=name, expected="an OBJ, PLY or glTF mesh")
    used = np.array(list(corners), np.int64).reshape(-1, 2)
    positions = np.array(points, np.float64).reshape(-1, 3)[used[:, 0]]
    directions = None
    if normals and (used[:, 1] >= 0).any():
        directions = np.array([*normals, (0.0, 0.0, 0.0)], np.float64)[used[:, 1]]
    return Parsed(positions, directions, _fans(polygons))


def _corner(word: str, points: int, normals: int, where: str) -> tuple[int, int]:
    """Return 0-based indices (position, normal) of v, v/vt, v//vn or v/vt/vn; −1 for a missing normal."""
    parts = word.split("/")
    found = []
    for what, part, count in (("vertex", parts[0], points), ("normal", parts[2] if len(parts) > 2 else "", normals)):
        if what == "normal" and not part:
            found.append(-1)
            continue
        try:
            index = int(part)
        except ValueError:
            raise BadInput(where=where, found=f"{word[:40]!r} in a face", expected="indices as in 1/1/1") from None
        # Counted from 1, or backwards from the last one so far.
        if not (1 <= index <= count or -count <= index <= -1):
            raise BadInput(f"a face names {what} {index} of {count}", where=where, expected=f"1 to {count}")
        found.append(index - 1 if index > 0 else count + index)
    return found[0], found[1]


def parse_ply(data: bytes, name: str) -> Parsed:
    """Parse the elements vertex and face of a PLY file. Raises BadInput for a file that plyfile rejects."""
    plyfile = extras.library("plyfile", name)
    try:
        with warnings.catch_warnings():
            # Of an element without rows it says so; what that leads to is refused below.
            warnings.simplefilter("ignore")
            found = plyfile.PlyData.read(BytesIO(data))
    except (plyfile.PlyParseError, ValueError, OverflowError, MemoryError, UnicodeDecodeError) as error:
        raise BadInput(
            f"not a readable PLY ({' '.join(str(error).split())})", where=name, expected="a whole one"
        ) from error
    if "vertex" not in found:
        raise BadInput("no element vertex", where=name, expected="one with x, y and z")
    vertices = found["vertex"].data
    columns = vertices.dtype.names or ()
    if not all(axis in columns for axis in "xyz"):
        raise BadInput(f"vertices have {', '.join(columns)}", where=name, expected="x, y and z")
    positions = _vectors(vertices, ("x", "y", "z"), name)
    normals = None
    if all(axis in columns for axis in ("nx", "ny", "nz")):
        normals = _vectors(vertices, ("nx", "ny", "nz"), name)
    faces = found["face"].data if "face" in found else None
    key = next((key for key in _INDEX_NAMES if faces is not None and key in (faces.dtype.names or ())), None)
    if faces is None or key is None:
        raise BadInput("no faces with vertex_indices", where=name, expected="a mesh and not a cloud of points")
    polygons = [_polygon(np.atleast_1d(polygon), key, name) for polygon in faces[key]]
    short = min((len(polygon) for polygon in polygons), default=3)
    if short < 3:
        raise BadInput(f"a face of {short} corners", where=name, expected="at least 3")
    return Parsed(positions, normals, _fans(polygons))


def _vectors(vertices: np.ndarray, names: Sequence[str], name: str) -> np.ndarray:
    """Return three properties as an array (V, 3). Raises BadInput if one is a list."""
    for each in names:
        if vertices.dtype[each].kind not in "iuf":
            raise BadInput(f"the vertices' {each} is a list", where=name, expected="a number")
    return np.stack([np.asarray(vertices[each], np.float64) for each in names], 1)


def _polygon(corners: np.ndarray, key: str, name: str) -> tuple[int, ...]:
    """Return a face's indices. Raises BadInput if they are not whole numbers."""
    if corners.dtype.kind not in "iu":
        raise BadInput(f"{key} of type {corners.dtype}", where=name, expected="whole numbers")
    return tuple(corners.tolist())
