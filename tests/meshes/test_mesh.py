"""Meshes for the viewer: OBJ and PLY, their normals and winding, and everything that can be wrong with a file."""

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from refusals import refused

from homofact.errors import BadInput
from homofact.meshes.mesh import Mesh, read_mesh

CORNERS = [(x, y, z) for x in (0, 2) for y in (0, 2) for z in (0, 2)]
# Quads, counter-clockwise from outside, into CORNERS.
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def obj(quads: list[tuple[int, ...]] = QUADS) -> str:
    vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)
    return vertices + "".join("f " + " ".join(str(k + 1) for k in quad) + "\n" for quad in quads)


def ply_ascii() -> str:
    head = (
        "ply\nformat ascii 1.0\ncomment a cube\nelement vertex 8\nproperty float x\nproperty float y\n"
        "property float z\nproperty uchar red\nelement face 6\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = "".join(f"{x} {y} {z} 7\n" for x, y, z in CORNERS)
    return head + rows + "".join("4 " + " ".join(map(str, quad)) + "\n" for quad in QUADS)


def ply_binary(faces: list[tuple[int, ...]] = QUADS, before: bytes = b"", head: str = "") -> bytes:
    """A binary cube; `head` and `before` put an element in front of the faces."""
    text = (
        "ply\nformat binary_little_endian 1.0\nelement vertex 8\nproperty double x\nproperty float y\n"
        f"property float z\n{head}element face {len(faces)}\nproperty uchar flag\n"
        "property list uchar uint vertex_index\nend_header\n"
    )
    rows = b"".join(struct.pack("<dff", *corner) for corner in CORNERS)
    lists = b"".join(struct.pack(f"<BB{len(face)}I", 9, len(face), *face) for face in faces)
    return text.encode() + rows + before + lists


@pytest.fixture
def mesh(tmp_path: Path) -> Callable[..., Mesh]:
    def read(content: str | bytes, name: str = "m.obj") -> Mesh:
        path = tmp_path / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return read_mesh(path)

    return read


def check_cube(found: Mesh) -> None:
    assert len(found.triangles) == 12
    # Centred, the corners on the unit sphere, and each corner's normal along it: all three faces weigh alike...
    corners = np.array(CORNERS, float) - 1
    order = [int(np.abs(corners / 3**0.5 - p).sum(1).argmin()) for p in found.positions]
    assert np.allclose(found.positions, corners[order] / 3**0.5)
    # ...up to how quads are cut: a corner has one or two triangles of a face.
    assert np.allclose(np.linalg.norm(found.normals, axis=1), 1)
    assert ((found.normals * found.positions).sum(1) > 0.9).all()
    a, b, c = (found.positions[found.triangles[:, k]] for k in range(3))
    assert ((np.cross(b - a, c - a) * (a + b + c)).sum(1) > 0).all()


RAGGED = [*QUADS[:5], (1, 5, 7), (1, 7, 3)]
CUBES: dict[str, str | bytes] = {
    "obj": obj(),
    "obj, counted backwards": obj([tuple(k - 8 - 1 for k in quad) for quad in QUADS]),
    "obj, inside out": obj([quad[::-1] for quad in QUADS]),
    "obj with texture coordinates and more": "mtllib a.mtl\no cube\nvt 0 0\ng x\nusemtl b\ns 1\n# f 1 2\n"
    + obj().replace("f 1 2 4 3", "f 1/1 2/1 \\\n4/1 3/1"),
    "obj with carriage returns": obj().replace("\n", "\r\n"),
    "obj with weights": obj().replace("v 0 0 0", "v 0 0 0 1.0"),
    "ply ascii": ply_ascii(),
    "ply ascii with carriage returns": ply_ascii().replace("\n", "\r\n"),
    "ply binary": ply_binary(),
    "ply binary, triangles and quads": ply_binary(RAGGED),
    "ply binary, another element": ply_binary(
        QUADS, struct.pack("<Bf", 1, 2.5) * 3, "element camera 3\nproperty uchar a\nproperty float b\n"
    ),
    "ply big-endian": b"".join(
        (
            ply_binary()[: ply_binary().index(b"end_header\n") + 11].replace(b"little", b"big"),
            *(struct.pack(">dff", *corner) for corner in CORNERS),
            *(struct.pack(">BB4I", 9, 4, *quad) for quad in QUADS),
        )
    ),
    "obj, tiny": obj().replace(" 2", " 2e-200"),
    "obj, huge": obj().replace(" 2", " 2e200"),
}
# Only coordinates are of another size, not the indices of faces.
for _size in ("tiny", "huge"):
    _lines = str(CUBES[f"obj, {_size}"]).splitlines()
    CUBES[f"obj, {_size}"] = "\n".join(
        line if line.startswith("v") else plain for line, plain in zip(_lines, obj().splitlines(), strict=True)
    )


@pytest.mark.parametrize("name", CUBES)
def test_a_cube_is_a_cube_however_it_is_written(name: str, mesh: Callable[..., Mesh]) -> None:
    # Carriage returns are part of the bytes.
    check_cube(mesh(CUBES[name], f"{name[:3]}.any"))


def test_a_mesh_is_known_by_its_content(mesh: Callable[..., Mesh]) -> None:
    assert mesh(ply_ascii(), "cube.obj").name == "cube.obj"
    check_cube(mesh(obj(), "cube.ply"))


def test_the_files_own_normals_are_kept_and_made_unit(mesh: Callable[..., Mesh]) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 5\nvn 0 3 4\nf 1//1 2//2 3//1\n"
    found = mesh(text)
    assert np.allclose(found.normals, [(0, 0, 1), (0, 0.6, 0.8), (0, 0, 1)])
    # A vertex with two normals is two vertices; a face turned away from its normals is turned to them.
    found = mesh(text.replace("f 1//1 2//2 3//1", "f 1//1 3//1 2//2\nf 1//2 2//2 3//2"))
    assert len(found.positions) == 5
    a, b, c = (found.positions[found.triangles[:, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


def test_normals_are_smooth_over_seams_and_weighted_by_area(mesh: Callable[..., Mesh]) -> None:
    # Two triangles that meet at the edge y = 0, the upper one three times as large; the edge is split as by textures.
    text = "v 0 0 0\nv 1 0 0\nv 0 3 0\nv 0 0 0\nv 1 0 0\nv 0 0 -1\nvt 0 0\nvt 1 1\nf 1/1 2/1 3/1\nf 5/2 4/2 6/2\n"
    found = mesh(text)
    expected = np.array((0, -1, 3)) / 10**0.5
    shared = (found.positions[:, 1] == found.positions[:, 1].min()) & (
        found.positions[:, 2] == found.positions[:, 2].max()
    )
    assert shared.sum() == 4
    # An open sheet has no outside: either of its sides will do.
    assert np.allclose(found.normals[shared] * np.sign(found.normals[shared][:1, 2:]), expected)


def test_a_vertex_without_area_still_has_a_normal(mesh: Callable[..., Mesh]) -> None:
    found = mesh("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 0 0\nf 1 2 3\nf 4 4 4\n")
    assert np.allclose(np.linalg.norm(found.normals, axis=1), 1)


CASES: dict[str, tuple[str | bytes, str]] = {
    "empty": ("", r"the file is empty, expected an OBJ, PLY or glTF mesh"),
    "a text": ("Dear reader,\nno mesh.\n", r"no vertices in it, expected an OBJ, PLY or glTF mesh"),
    "a picture": (b"\x89PNG\r\n\x1a\n\x00\xff", r"neither text nor a PLY file, expected"),
    "points alone": ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", r"no triangles in it, expected a mesh"),
    "a word for a number": ("v 0 zero 0\n", r"line 1: found 'v 0 zero 0', expected three numbers"),
    "two numbers": ("v 0 0\n", r"line 1: found 'v 0 0', expected three numbers"),
    "not finite": (obj().replace("v 2 2 2", "v 2 inf 2"), r"position \d+ is 2, inf, 2, expected finite numbers"),
    "beyond a box": (obj().replace("v 2 2 2", "v 2 1e308 2"), r"position \d+ is 2, 1e\+308, 2, expected finite"),
    "an index of doubles": (
        ply_ascii().replace("uchar int vertex", "uchar double vertex"),
        "vertex_indices of type float64, expected whole numbers",
    ),
    "an index that is no number": (
        ply_ascii().replace("uchar int vertex", "uchar float vertex").replace("4 0 ", "4 nan ", 1),
        "vertex_indices of type float32, expected whole numbers",
    ),
    "coordinates that are lists": (
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty list uchar float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n1 0 0 0\n1 1 0 0\n1 0 1 0\n3 0 1 2\n",
        "the vertices' x is a list, expected a number",
    ),
    "an index that is no list": (
        ply_ascii().replace("property list uchar int vertex_indices", "property int vertex_indices"),
        "not a readable PLY|a face of 1 corners",
    ),
    "a normal not finite": (
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn nan 0 1\nf 1//1 2//1 3//1\n", r"normal 1 is nan, 0, 1, expected finite numbers",
    ),
    "a vertex too far": (obj() + "f 1 2 9\n", r"line 15: a face names vertex 9 of 8, expected 1 to 8"),
    "vertex 0": (obj() + "f 0 1 2\n", r"line 15: a face names vertex 0 of 8"),
    "too far back": (obj() + "f -9 1 2\n", r"line 15: a face names vertex -9 of 8"),
    "a normal too far": (obj() + "f 1//1 2//1 3//1\n", r"line 15: a face names normal 1 of 0"),
    "an index that is none": (obj() + "f a 2 3\n", r"line 15: found 'a' in a face, expected indices as in 1/1/1"),
    "a face of two": (obj() + "f 1 2\n", r"line 15: a face of 2 corners, expected at least 3"),
    "one place": ("v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n", r"all vertices are at one place, expected .* an extent"),
    "ply without an end": (b"ply\nformat ascii 1.0\n", r"not a readable PLY \(.*early end"),
    "ply of no format": (b"ply\nelement vertex 0\nend_header\n", r"not a readable PLY \("),
    "ply of a negative count": (
        b"ply\nformat ascii 1.0\nelement vertex -1\nproperty float x\nend_header\n", r"not a readable PLY \(",
    ),
    "ply of an unknown type": (ply_ascii().replace("float x", "half x"), r"not a readable PLY \(.*half"),
    "ply property of nothing": (b"ply\nformat ascii 1.0\nproperty int x\nend_header\n", r"not a readable PLY \("),
    "ply without vertices": (b"ply\nformat ascii 1.0\nend_header\n", r"no element vertex, expected one with x, y"),
    "ply without z": (ply_ascii().replace("float z", "float depth"), r"vertices have x, y, depth, red, expected"),
    "ply cloud": (
        ply_ascii().split("element face")[0].encode() + b"end_header\n" + b"0 0 0 7\n" * 8,
        r"no faces with vertex_indices, expected a mesh and not a cloud of points",
    ),
    "ply, lines missing": ("\n".join(ply_ascii().splitlines()[:-1]) + "\n", r"element 'face': row 5: early end"),
    "ply, a short line": (ply_ascii()[:-6] + "\n", r"element 'face': row 5.*early end"),
    "ply, a word": (ply_ascii().replace("4 0 1 3 2", "4 0 1 x 2"), r"element 'face': row 0.*malformed"),
    "ply, a face of two": (ply_binary([(0, 1)] * 6), r"a face of 2 corners, expected at least 3"),
    "ply, one face of two": (ply_binary([*QUADS[:5], (0, 1)]), r"a face of 2 corners, expected at least 3"),
    "ply, no faces": (ply_binary([]), r"no triangles in it, expected a mesh|no faces"),
    "ply, an index too far": (ply_binary([*QUADS[:5], (0, 1, 3, 8)]), r"a face names vertex 8, expected 0 to 7"),
    "ply cut in its vertices": (ply_binary()[:250], r"element 'vertex': row 3: .*early end-of-file"),
    "ply cut in its faces": (ply_binary()[:-1], r"element 'face': row 5: .*early end-of-file"),
    "ply cut in ragged faces": (ply_binary(RAGGED)[:-3], r"element 'face': row 6: .*early end-of-file"),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_what_is_wrong_with_a_file_is_named_in_one_line(name: str, mesh: Callable[..., Mesh], tmp_path: Path) -> None:
    content, expected = CASES[name]
    with pytest.raises(BadInput, match=expected) as refused:
        mesh(content, "bad.mesh")
    assert str(refused.value).startswith(f"{tmp_path / 'bad.mesh'}: ")
    assert "\n" not in str(refused.value)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    for path, found in ((tmp_path / "none.obj", "no such file"), (tmp_path, "a folder")):
        with refused(f"{found}, expected an OBJ, PLY or glTF mesh"):
            read_mesh(path)


@pytest.mark.parametrize(("name", "triangles"), [("bunny.ply", 69_451), ("spot.obj", 5_856), ("teapot_wdas.obj", None)])
def test_scanned_and_modelled_meshes(name: str, triangles: int | None, real_data: Path) -> None:
    found = read_mesh(real_data / "meshes" / name)
    if triangles is not None:
        assert len(found.triangles) == triangles
    used = found.positions[np.unique(found.triangles)]
    assert np.linalg.norm(used, axis=1).max() == pytest.approx(1)
    assert np.allclose(used.min(0), -used.max(0))
    assert np.allclose(np.linalg.norm(found.normals, axis=1), 1)
    # Most of a closed shape's surface faces away from its middle.
    a, b, c = (found.positions[found.triangles[:, k]] for k in range(3))
    n = np.cross(b - a, c - a)
    out = (n * (a + b + c)).sum(1) > 0
    assert np.linalg.norm(n[out], axis=1).sum() > 0.75 * np.linalg.norm(n, axis=1).sum()
