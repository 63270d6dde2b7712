"""What the page is made of, without a browser: skies, packed vectors, and every bad input in one line."""

import json
import math
import re
from collections import deque
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from relit_scene import CAMERA, SIZE, plain, scene, sky_picture
from unpacked import unpack, written

from homofact.errors import BadInput
from homofact.meshes.shapes import ground, sphere, torus_knot
from homofact.relighting import cube
from homofact.relighting.build import RelitObject
from homofact.relighting.clusters import Clustered
from homofact.relighting.lobe import SeparateLobe
from homofact.relighting.lobe_table import LobeTable
from homofact.relighting.page.build import PageReference, closed, page_objects, shown_name, turns, write_page
from homofact.relighting.page.order import CACHE, cached_order
from homofact.relighting.page.skies import page_sky, reduced, rounded
from homofact.relighting.sight import VertexSight, sight_words
from homofact.rendering.light import EnvironmentMap
from homofact.web.packing import halves, pack, without_repeats


def test_vectors_are_kept_number_for_number(tmp_path: Path) -> None:
    given = scene()
    size = write_page(tmp_path / "p.html", given.objects, given.skies, {})
    assert size == (tmp_path / "p.html").stat().st_size
    for packed, each in zip(written(tmp_path / "p.html")["objects"], given.objects, strict=True):
        arrays = {name: unpack(array) for name, array in packed["basis"].items()}
        coded = arrays["number"].astype(int)
        number = coded >> 1 ^ -(coded & 1)
        start = np.concatenate(([0], np.cumsum(arrays["count"].astype(int))))
        assert np.array_equal(start, each.basis.start)
        for r in range(len(arrays["count"])):
            own = slice(start[r], start[r + 1])
            assert np.array_equal(np.cumsum(arrays["place"][own], dtype=np.uint16), each.basis.index[own])
        assert np.array_equal(number, each.basis.number)


def test_arrays_of_several_objects_are_written_once(tmp_path: Path) -> None:
    given, target = scene(), tmp_path / "p.html"
    first = given.objects[0]
    write_page(target, [first], given.skies, {})
    alone = written(target)["objects"][0]
    one = target.stat().st_size
    write_page(target, [first, replace(first, name="twin")], given.skies, {})
    both = written(target)["objects"]
    assert both == [alone, alone | {"name": "twin"}]
    assert target.stat().st_size - one < 0.1 * len(json.dumps(alone))
    # Equal bytes of another kind or shape are another array.
    flat = np.arange(12, dtype=np.uint16)
    data = {"a": pack(flat), "b": [pack(flat.reshape(3, 4)), pack(flat)], "c": pack(flat.view(np.int16)), "d": None}
    assert without_repeats(data) == {
        "a": {"repeated": 0}, "b": [data["b"][0], {"repeated": 0}], "c": data["c"], "d": None, "repeated": [data["a"]]
    }  # fmt: skip


def test_the_page_is_one_file_that_asks_for_nothing(tmp_path: Path) -> None:
    given = scene()
    write_page(
        tmp_path / "p.html", given.objects, given.skies, {"A": {"b": 12345, "c": 0.0123456, "d": "<i>"}}, title="<b>"
    )
    text = (tmp_path / "p.html").read_text(encoding="utf-8")
    assert "default-src 'none'" in text
    # The namespace of SVG names a language: nothing asks for that address.
    assert not re.search(r"https?://|\bsrc=|@import|url\(", text.replace("http://www.w3.org/2000/svg", ""))
    assert "<title>&lt;b&gt;</title>" in text
    assert written(tmp_path / "p.html")["numbers"] == [["A", [["b", "12,345"], ["c", "0.0123"], ["d", "<i>"]]]]
    assert "<i>" not in text


def test_an_existing_page_stays_where_none_may_be_replaced_or_something_is_wrong(tmp_path: Path) -> None:
    given, page = plain(scene()), tmp_path / "p.html"
    page.write_text("before")
    with pytest.raises(BadInput, match=r"p\.html"):
        write_page(page, given.objects, given.skies, {}, new=True)
    with pytest.raises(BadInput):
        write_page(page, [], given.skies, {})
    assert page.read_text() == "before"
    write_page(page, given.objects, given.skies, {})
    assert page.read_text() != "before"


def test_skies_keep_the_light() -> None:
    """A reduced picture holds the light of the whole one; a cube map's own picture makes that cube map again."""
    picture = sky_picture(2, rows=256)
    small = reduced(picture, 64)
    assert small.shape == (64, 128, 3)

    def flux(values: np.ndarray) -> np.ndarray:
        edges = np.cos(np.linspace(0, math.pi, len(values) + 1))
        return ((edges[:-1] - edges[1:])[:, None] * values.mean(1)).sum(0)

    assert flux(small) == pytest.approx(flux(picture), rel=1e-12)
    assert reduced(picture[:, :500], 64).shape == (64, 125, 3)
    assert reduced(picture, 300).shape == picture.shape


def test_a_turned_light_begins_turned() -> None:
    light = EnvironmentMap(torch.from_numpy(sky_picture(1))).turned(math.radians(90))
    sky = page_sky("turned", light, SIZE)
    assert np.array_equal(sky.cube, rounded(cube.environment_cube(light, SIZE)))
    again = cube.environment_cube(sky.environment(), SIZE)
    assert again == pytest.approx(sky.cube, rel=2e-3)


def test_half_floats_hold_what_is_said() -> None:
    values = np.concatenate((np.geomspace(1e-6, 5e4, 1000), [0.0]))
    assert rounded(values) == pytest.approx(values, rel=2.0**-10, abs=1e-9 * values.max())
    stored, scale = halves(np.array([np.nan, 2.0]))
    assert np.isnan(stored[0])
    assert stored[1] * scale == pytest.approx(2.0, rel=1e-3)


def test_frames_become_quaternions_and_back() -> None:
    from scipy.spatial.transform import Rotation

    frames = scene().objects[0].transport.frames
    again = Rotation.from_quat(turns(frames).astype(float)).as_matrix()
    assert np.abs(again - frames).max() < 1e-4


def misses(triangles: np.ndarray) -> float:
    """Vertices processed for each triangle where the last `CACHE` of them are kept, first in, first out."""
    kept: deque[int] = deque(maxlen=CACHE)
    processed = 0
    for v in triangles.reshape(-1).tolist():
        if v not in kept:
            kept.append(v)
            processed += 1
    return processed / len(triangles)


def test_triangles_in_an_order_that_keeps_vertices() -> None:
    mesh = torus_knot(96, 16)
    shuffled = mesh.triangles[np.random.default_rng(0).permutation(len(mesh.triangles))]
    ordered = cached_order(shuffled)
    assert sorted(map(tuple, ordered.tolist())) == sorted(map(tuple, mesh.triangles.tolist()))
    assert misses(shuffled) > 2.5
    # Half a vertex a triangle is the least that there is of a closed mesh.
    assert 0.5 <= misses(ordered) < 0.85
    # By hand: two triangles with an edge in common touch four vertices.
    assert misses(np.array([[0, 1, 2], [2, 1, 3]])) == 2


def test_closed_surfaces_are_known() -> None:
    assert closed(sphere(8).triangles)
    assert closed(torus_knot(24, 6).triangles)
    assert not closed(ground().triangles)


def test_a_relit_scene_s_objects_in_their_compact_form_and_a_ground_that_fades() -> None:
    knot, plane = scene().objects
    compact = knot.transport
    assert isinstance(compact, Clustered)
    apart = lobe(len(knot.mesh.positions))
    relit = [
        RelitObject(knot.mesh, "paint", compact.basis, compact, lobe=apart),
        RelitObject(plane.mesh, "grey", plane.basis, None),
    ]
    found = page_objects(relit)
    assert [each.lobe for each in found] == [apart, None]
    assert [each.transport for each in found] == [compact, plane.basis]
    assert [each.fade for each in found] == [None, (1.1, 1.96)]


def lobe(vertices: int) -> SeparateLobe:
    """One of no light, and vertices that see nothing."""
    table = LobeTable(np.zeros((2, 1, 2, 2, 3), np.float32), 1.0, 2 * math.pi, whole=False)
    return SeparateLobe(table, VertexSight.of(np.zeros((vertices, sight_words(SIZE)), np.uint64)))


def refused(tmp_path: Path, **given: Any) -> str:
    known = plain(scene())
    all_of = {"objects": known.objects, "skies": known.skies, "numbers": {}, "camera": CAMERA, **given}
    with pytest.raises(BadInput) as error:
        write_page(tmp_path / "p.html", **all_of)
    assert not (tmp_path / "p.html").exists()
    assert "\n" not in str(error.value)
    return str(error.value)


def test_bad_input_is_named(tmp_path: Path) -> None:
    given = plain(scene())
    plane, sky = given.objects[0], given.skies[0]
    assert refused(tmp_path, objects=[]) == "page: found 0 objects and 2 skies, expected at least one of each"
    other = replace(plane, mesh=scene().objects[0].mesh)
    assert refused(tmp_path, objects=[other]).startswith(
        "ground: found transport of another mesh, expected that of torus"
    )
    moved = replace(plane, mesh=replace(plane.mesh, positions=plane.mesh.positions + 0.1))
    assert "another mesh" in refused(tmp_path, objects=[moved])
    finer = replace(plane.basis, settings=replace(plane.basis.settings, cube=32))
    said = refused(tmp_path, objects=[plane, replace(plane, transport=finer)])
    assert said == "ground: found a cube map of 32 texels, expected 16 as the others"
    said = refused(tmp_path, objects=[replace(plane, lobe=lobe(vertices=3))])
    assert said == "ground: found what vertices see of shape (3, 24), expected (49, 24)"
    bad = replace(sky, cube=sky.cube[:, :8, :8])
    assert refused(tmp_path, skies=[bad]) == "sky one: found a cube map of shape (6, 8, 8, 3), expected (6, 16, 16, 3)"
    for value in (np.nan, -1.0):
        wrong = sky.picture.copy()
        wrong[3, 4] = value
        assert "negative or not finite" in refused(tmp_path, skies=[replace(sky, picture=wrong)])


def test_bad_references_are_named(tmp_path: Path) -> None:
    vertices = len(plain(scene()).objects[0].mesh.positions)
    good = np.ones((vertices, 3))
    for colours, sky, said in (
        ([good, good], 0, "found colours of shape"),
        ([good[:3]], 0, "found colours of shape [(3, 3)]"),
        ([good], 2, "found sky 2, expected 0 to 1"),
        ([good * np.inf], 0, "infinite radiance"),
        ([good * np.nan], 0, "found no light at any vertex"),
    ):
        assert said in refused(tmp_path, reference=PageReference(colours, sky))


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("knot.ply", "knot"),
        ("material:lafortune-blue-paint", "lafortune-blue-paint"),
        ("/data/rgl/chm_light_blue_rgb.bsdf", "chm_light_blue_rgb.bsdf"),
        ("albedo 0.45, 0.42, 0.38", "albedo 0.45, 0.42, 0.38"),
        ("skies/Evening.HDR", "Evening"),
        ("torus knot 2,3", "torus knot 2,3"),
    ],
)
def test_names_are_shown_without_what_a_program_needs(text: str, shown: str) -> None:
    assert shown_name(text) == shown
