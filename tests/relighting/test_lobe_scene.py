"""Scenes with separate lobes: what the file says, the ledger, plans, the folder, and pictures."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from coarse import coarse_shapes
from relighting_cases import light

from homofact.errors import BadInput
from homofact.files.archive import read_archive, write_archive
from homofact.meshes.shapes import ground, torus_knot
from homofact.relighting.build import RelightScene, open_relight_scene, relit_objects
from homofact.relighting.cube import environment_cube
from homofact.relighting.errors import scene_errors
from homofact.relighting.lobe_table import Rest
from homofact.relighting.picture import picture
from homofact.relighting.result import RelightResult, open_relit
from homofact.relighting.scene_file import RelightSceneFile, read_relight_scene
from homofact.relighting.seen import SeenPixels, seen_pixels
from homofact.rendering.light import EnvironmentMap
from homofact.scene.cameras import Camera
from homofact.scene.lighting import named_environment
from homofact.scene.meshes import MeshGroup, faded

TEXT = """
[[object]]
mesh = "shape:sphere"
material = "material:blinn-phong-50"
size = 0.5
lobe = "separate"
terms = 2
[lighting]
named = "studio"
[[camera]]
eye = [0, 0.6, 3]
pixels = [40, 30]
[transport]
cube = 16
kept = 400
"""


def read(folder: Path, text: str = TEXT) -> RelightSceneFile:
    (folder / "scene.toml").write_text(text)
    return read_relight_scene(folder / "scene.toml")


@pytest.fixture(scope="module")
def ready(tmp_path_factory: pytest.TempPathFactory) -> RelightScene:
    return open_relight_scene(read(tmp_path_factory.mktemp("scene")))


@pytest.mark.slow
def test_the_ledger_is_of_the_whole_picture(ready: RelightScene) -> None:
    """`picture` within 1.3 of a sum that is written apart: the lobe at pixels, the rest mixed between vertices."""
    relit = relit_objects(ready)
    found = scene_errors(ready, relit, 100, ("lobe", "interpolation", "together", "picture"))[0]
    assert found is not None
    assert found.errors["lobe"] < 0.01
    assert found.errors["together"] < 0.03
    assert found.errors["interpolation"] < 0.03
    material, camera = ready.objects[0].material.reflectance, ready.file.cameras[0]
    pixels: SeenPixels = seen_pixels([relit[0].mesh], 0, material, ready.occluder, camera, 10_000)
    radiance = environment_cube(ready.file.light, 16)
    exact = pixels.points.dense(radiance, 16)
    shown = relit[0].lit(radiance).between(pixels.mixture, camera.eye)
    own = float(np.linalg.norm(shown - exact) / np.linalg.norm(exact))
    assert own / 1.3 < found.errors["picture"] < 1.3 * own
    assert own < 0.05
    # What is left without the lobe is far from it.
    assert relit[0].lobe is not None
    rest = pixels.points.dense(radiance, 16, Rest(material, relit[0].lobe.table))
    assert np.linalg.norm(rest - exact) > 0.3 * np.linalg.norm(exact)


@pytest.mark.slow
def test_a_folder_holds_the_lobe_to_the_bit(ready: RelightScene, tmp_path: Path) -> None:
    relit = relit_objects(ready)
    assert relit[0].form == "all frequencies, separate lobe"
    lobe = relit[0].lobe
    assert lobe is not None
    assert relit[0].nbytes == relit[0].transport.nbytes + relit[0].transport.factors.view.nbytes + lobe.nbytes
    made = RelightResult.of(ready.file, relit, {})
    made.save(tmp_path / "out")
    back = open_relit(tmp_path / "out")
    eye = (0.3, 0.6, 2.5)
    assert np.array_equal(back.shade(light(16), eye)[0], made.shade(light(16), eye)[0])
    assert back.objects[0].transport.factors.beside == relit[0].transport.factors.beside
    file = tmp_path / "out" / "relight.npz"
    arrays, header = read_archive(file)
    for name, other in (
        ("lobe_sight", arrays["object_0_lobe_sight"][:, :-1]),
        ("lobe_values", arrays["object_0_lobe_values"][:1]),
        ("lobe_values", np.full_like(arrays["object_0_lobe_values"], np.nan)),
    ):
        write_archive(file, header, arrays | {f"object_0_{name}": other})
        with pytest.raises(BadInput, match=name):
            open_relit(tmp_path / "out")


def test_the_cost_counts_the_lobe_and_what_vertices_see(ready: RelightScene) -> None:
    """A bit a texel of every vertex on disk; in the result 20 bytes a face more, and the table."""
    (choice,) = ready.choices
    material = choice.material
    plain = replace(ready, choices=(replace(choice, material=replace(material, lobe=None)),)).cost
    bits = 6 * 16**2 * len(ready.objects[0].mesh.positions)
    assert material.lobe is not None
    most = bits // 8 + 6 * 20 * len(ready.objects[0].mesh.positions) + material.lobe.nbytes
    assert ready.cost.most_bytes - plain.most_bytes == most
    assert ready.cost.peak_bytes - plain.peak_bytes == most + bits // 8
    assert ready.cost.disk_bytes - plain.disk_bytes == bits // 8
    assert ready.cost.most_bytes >= relit_objects(ready)[0].nbytes
    # The transport takes the rays of the lobe; with several rays a texel it sends its own.
    assert ready.cost.rays == plain.rays
    several = replace(ready, choices=(replace(choice, settings=replace(choice.settings, rays=2)),))
    assert several.cost.rays == 4 * plain.rays + bits // 2


def test_blocks_of_a_stopped_run_keep_what_vertices_see(ready: RelightScene, tmp_path: Path) -> None:
    first = relit_objects(ready, tmp_path)
    assert (tmp_path / "object_0" / "sight.npz").is_file()
    again = relit_objects(ready, tmp_path)
    assert first[0].lobe is not None
    assert again[0].lobe is not None
    assert np.array_equal(first[0].lobe.sight.plain, again[0].lobe.sight.plain)


@pytest.mark.parametrize(
    ("said", "where"),
    [('lobe = "near"', "lobe"), ('lobe = "separate"\nshare = 0.9', "share")],
)
def test_what_a_file_says_wrong_of_a_lobe_is_named(tmp_path: Path, said: str, where: str) -> None:
    with pytest.raises(BadInput) as caught:
        read(tmp_path, TEXT.replace('lobe = "separate"\nterms = 2', said))
    assert where in f"{caught.value.where}"


@pytest.mark.slow
def test_a_tolerance_is_met_with_the_lobe_apart_where_terms_alone_do_not(tmp_path: Path) -> None:
    """Of a narrow lobe: few terms, the error that is measured within the tolerance, fewer bytes than the terms take."""
    text = (
        TEXT.replace('lobe = "separate"\nterms = 2', "").replace("kept = 400", "") + "[tolerance]\nreflected = 0.04\n"
    )
    text = text.replace("blinn-phong-50", "car-paint-red").replace("cube = 16", "cube = 8")
    with coarse_shapes():
        planned = open_relight_scene(read(tmp_path, text))
    plan = planned.plans[0]
    assert plan.chosen.of_lobe is not None
    assert plan.chosen.form.endswith("separate lobe")
    assert plan.factored.lobe is not None
    assert plan.chosen.terms <= 9
    relit = relit_objects(planned)
    found = scene_errors(planned, relit, 100, ("together",))[0]
    assert found is not None
    assert found.errors["together"] < 0.04
    assert relit[0].nbytes == pytest.approx(plan.chosen.bytes, rel=0.5)
    with coarse_shapes():
        alone = open_relight_scene(read(tmp_path, text.replace("size = 0.5", 'size = 0.5\nlobe = "factored"')))
    terms = alone.plans[0]
    assert terms.factored.lobe is None
    assert terms.chosen.of_lobe is None
    assert not terms.met
    assert "lobe" not in terms.chosen.form


def test_a_level_plane_ends_softly() -> None:
    """In a picture it becomes the sky between the two distances, and covers nothing beyond."""
    flat = ground(2.0, -0.5, 10)
    assert faded(flat) == pytest.approx((1.1, 1.96))
    assert faded(torus_knot(24, 8)) is None
    camera, occluder = Camera((0, 3, 0.01), (0, 0, 0), field=70, pixels=(60, 60)), MeshGroup([flat]).occluder
    sky = EnvironmentMap(named_environment("uniform").radiance * 3.0, name="even")
    shown, cover = picture([flat], [np.ones((len(flat.positions), 3))], occluder, camera, sky)
    assert (shown[30, 30] == 1).all()
    assert cover[30, 30] == 1
    # The corner of the plane lies beyond 1.96 from the axis.
    assert shown[1, 1] == pytest.approx([3, 3, 3])
    assert cover[1, 1] == 0
    between = (cover > 0.05) & (cover < 0.95)
    assert between.any()
    assert shown[between][:, 0] == pytest.approx(3 - 2 * cover[between])
