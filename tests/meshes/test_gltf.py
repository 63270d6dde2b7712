"""glTF that claims more than it holds: refused in a line, soon, and without waiting for what never comes."""

import base64
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refused

from homofact.errors import BadInput
from homofact.meshes.mesh import read_mesh

pytest.importorskip("trimesh", reason="trimesh is not installed: pip install 'homofact[relight]'")
BUFFER = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes() + np.array([0, 1, 2], "<u4").tobytes()
INSIDE = "data:application/octet-stream;base64," + base64.b64encode(BUFFER).decode()
Nodes = list[dict[str, Any]]


def triangle(nodes: Nodes, uri: str = INSIDE, **more: Any) -> dict[str, Any]:
    """A triangle as every node of mesh 0 has it; the first node is the scene's."""
    positions = {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [positions, {"bufferView": 1, "componentType": 5125, "count": 3, "type": "SCALAR"}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 12},
        ],
        "buffers": [{"byteLength": 48, "uri": uri}],
    } | more


def written(folder: Path, found: dict[str, Any]) -> Path:
    (folder / "m.gltf").write_text(json.dumps(found), encoding="utf-8")
    return folder / "m.gltf"


def chain(count: int) -> Nodes:
    return [{"children": [k + 1]} for k in range(count - 1)] + [{"mesh": 0}]


def test_a_triangle_is_read_from_inside_and_from_a_file_beside(tmp_path: Path) -> None:
    (tmp_path / "its buffer.bin").write_bytes(BUFFER)
    for found in (triangle(chain(20)), triangle([{"mesh": 0}], "its%20buffer.bin")):
        assert len(read_mesh(written(tmp_path, found)).triangles) == 1


@pytest.mark.parametrize("place", [{}, {"scale": [1, 2, -4]}, {"rotation": [0.5, 0.5, 0.5, 0.5], "scale": [3, 1, 1]}])
def test_normals_of_the_file_are_kept_at_their_place_in_the_scene(place: dict[str, Any], tmp_path: Path) -> None:
    """Normals lean from the triangle's own; they stay normal to the planes that they were normal to in the file."""
    given = np.array([[0.6, 0, 0.8], [0, -0.6, 0.8], [0, 0, 1]])
    data = BUFFER + given.astype("<f4").tobytes()
    found = triangle([{"mesh": 0} | place])
    found["buffers"] = [{"byteLength": 84, "uri": INSIDE.split(",")[0] + "," + base64.b64encode(data).decode()}]
    found["bufferViews"].append({"buffer": 0, "byteOffset": 48, "byteLength": 36})
    found["accessors"].append({"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC3"})
    found["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = 2
    mesh = read_mesh(written(tmp_path, found))
    turn = np.roll(np.eye(3), 1, 0) if "rotation" in place else np.eye(3)
    frame = turn @ np.diag(place.get("scale", [1, 1, 1]))
    for normal, expected in zip(mesh.normals, given, strict=True):
        for along in np.linalg.svd(expected[None])[2][1:]:
            assert normal @ frame @ along == pytest.approx(0, abs=1e-6)
        assert normal @ frame @ expected > 0


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_a_buffer_that_is_a_pipe_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.bin")
    with refused(where="pipe.bin"):
        read_mesh(written(tmp_path, triangle([{"mesh": 0}], "pipe.bin")))


def test_images_are_not_opened(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    more = {
        "images": [{"uri": "pipe.png"}],
        "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
    }
    found = triangle([{"mesh": 0}], **more)
    found["meshes"][0]["primitives"][0]["material"] = 0
    assert len(read_mesh(written(tmp_path, found)).triangles) == 1


@pytest.mark.parametrize(
    "nodes",
    [
        chain(5000),
        [*chain(3), {"children": [1]}],
        [{"children": [1, 2]}, {"children": [2]}, {"mesh": 0}],
        [{"children": [0], "mesh": 0}],
        [{"children": [1]}, {"children": [2]}, {"children": [1], "mesh": 0}],
        [{"mesh": 0}] * 20_000,
    ],
    ids=["deep", "two parents", "one shared", "its own", "a ring", "many"],
)
def test_nodes_that_are_no_trees_or_too_many_are_refused(nodes: Nodes, tmp_path: Path) -> None:
    with refused(where="m.gltf"):
        read_mesh(written(tmp_path, triangle(nodes)))


@pytest.mark.parametrize("count", [10**12, 2**31, 10**18])
@pytest.mark.parametrize("which", [0, 1])
def test_more_elements_than_bytes_are_refused(count: int, which: int, tmp_path: Path) -> None:
    for view in (True, False):
        found = triangle([{"mesh": 0}])
        found["accessors"][which]["count"] = count
        if not view:
            del found["accessors"][which]["bufferView"]
        with refused(where="m.gltf"):
            read_mesh(written(tmp_path, found))


def test_entries_of_any_kind_end_in_a_line(tmp_path: Path) -> None:
    from damages import header_damages

    for what, found in header_damages(triangle([{"mesh": 0}])):
        problem = ""
        try:
            read_mesh(written(tmp_path, found))
        except BadInput as error:
            problem = str(error) if "\n" in str(error) else ""
        except Exception as error:
            problem = repr(error)
        assert not problem, what
