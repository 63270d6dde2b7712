"""The scene file and the folder of a relit scene: round trips, and everything that can be wrong with them."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damages import array_damages, header_damages
from relighting_cases import factored_once, light

from homofact.containers.exr import write_exr
from homofact.errors import BadInput
from homofact.files.archive import read_archive, write_archive
from homofact.meshes.shapes import torus_knot
from homofact.relighting import build
from homofact.relighting.build import RelightScene, open_relight_scene, relit_objects
from homofact.relighting.cube import environment_cube
from homofact.relighting.harmonic import Harmonic
from homofact.relighting.page.relit_page import write_relit_page
from homofact.relighting.picture import picture
from homofact.relighting.precompute import cost
from homofact.relighting.relight import Relit, shaded
from homofact.relighting.result import RelightResult, open_relit
from homofact.relighting.scene_file import RelightSceneFile, read_relight_scene
from homofact.rendering.light import EnvironmentMap
from homofact.scene.cameras import Camera
from homofact.scene.objects import placed_mesh

ROOT = Path(__file__).resolve().parents[2]
GROUND = """[ground]
albedo = [0.2, 0.4, 0.6]
half = 1.5
steps = 6
"""
TEXT = f"""
[[object]]
mesh = "shape:sphere"
albedo = [0.5]
size = 0.5
at = [0, 0.25, 0]
{GROUND}[lighting]
named = "studio"
[[camera]]
eye = [0, 1.5, 3]
pixels = [40, 30]
[transport]
cube = 8
kept = 40
clusters = 2
components = 3
"""


@pytest.fixture(autouse=True, scope="module")
def once() -> Iterator[None]:
    """Materials that many scenes here share are decomposed once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(build, "factored", factored_once)
        yield


def read(folder: Path, text: str = TEXT) -> RelightSceneFile:
    (folder / "scene.toml").write_text(text)
    return read_relight_scene(folder / "scene.toml")


@pytest.fixture(scope="module")
def ready(tmp_path_factory: pytest.TempPathFactory) -> RelightScene:
    return open_relight_scene(read(tmp_path_factory.mktemp("scene")))


def test_the_scene_says_what_stands_where(ready: RelightScene) -> None:
    ball, floor = ready.objects
    assert np.linalg.norm(ball.mesh.positions - (0, 0.25, 0), axis=1) == pytest.approx(0.5)
    assert floor.mesh.positions[:, 1] == pytest.approx(-0.25)
    assert len(floor.mesh.positions) == 49
    assert [ready.file.objects[0].words] == ["albedo 0.5"]
    assert [choice.material.factors.terms for choice in ready.choices] == [1, 1]
    assert ready.cost.rays == (len(ball.mesh.positions) + 49) * 192
    # The ball blocks the ground's light, and the ground the ball's from below.
    assert ready.occluder.blocked(np.array([[0.0, -0.24, 0.0]]), np.array([[0.0, 1.0, 0.0]])).all()


def test_clustering_needs_memory_for_the_largest_object(ready: RelightScene) -> None:
    """Objects are clustered one after another: the peak grows by what the largest one needs, eight times its size."""
    plain = replace(ready, file=replace(ready.file, clusters=0))
    pairs = zip(ready.objects, ready.choices, strict=True)
    sizes = [cost(len(own.mesh.positions), how.material.factors.terms, how.settings).most_bytes for own, how in pairs]
    assert max(sizes) > 2 * min(sizes)
    assert ready.cost.peak_bytes - plain.cost.peak_bytes == 8 * max(sizes)


def test_a_mesh_is_turned_scaled_and_moved_with_its_normals(tmp_path: Path) -> None:
    text = TEXT.replace("shape:sphere", "shape:knot").replace("at = [0, 0.25, 0]", "at = [0.5, 1, -2]\nturn = 90")
    mesh = placed_mesh(read(tmp_path, text).objects[0])
    plain = torus_knot()
    # About y by 90°: z goes to x, x to −z.
    for found, given in ((mesh.positions, 0.5 * plain.positions), (mesh.normals, plain.normals)):
        turned = np.stack((given[:, 2], given[:, 1], -given[:, 0]), 1)
        assert found == pytest.approx(turned + ((0.5, 1, -2) if found is mesh.positions else 0), abs=1e-12)


@pytest.mark.slow
def test_what_the_file_says_of_factors_and_clusters_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each material by its own rule for K, under the scene's light; clusters with its seed, at most one a vertex."""
    asked: list[tuple[object, ...]] = []
    made, grouped = build.factored, build.clustered

    def factored(reflectance: object, *rule: object, light: object) -> object:
        assert isinstance(light, EnvironmentMap)
        asked.append(rule)
        return made(reflectance, *rule, light=light)  # type: ignore[arg-type]

    def clustered(transport: object, components: int, *, clusters: int | None, seed: int) -> object:
        asked.append((components, clusters, seed))
        return grouped(transport, components, clusters=clusters, seed=seed)  # type: ignore[arg-type]

    monkeypatch.setattr(build, "factored", factored)
    monkeypatch.setattr(build, "clustered", clustered)
    text = "seed = 7\n" + TEXT.replace("size = 0.5", "size = 0.5\nshare = 0.5").replace("steps = 6", "steps = 2")
    objects = relit_objects(open_relight_scene(read(tmp_path, text)))
    assert asked == [("auto", None, 0.5, None), ("auto", None, None, None), (3, 2, 7), (3, 2, 7)]
    # What is used is the compact form.
    for each in objects:
        assert each.compact is not None
        plain = Relit(each.transport)
        plain.relight(light(8))
        assert not np.array_equal(each.lit(light(8)).tuples, plain.tuples)
    monkeypatch.setattr(build, "clustered", grouped)
    text = TEXT.replace("steps = 6", "steps = 2").replace("clusters = 2", "clusters = 12")
    assert (
        relit_objects(open_relight_scene(read(tmp_path, text.replace("components = 3", "components = 1"))))[1].compact
        is not None
    )


def test_a_folder_holds_everything_and_comes_back(ready: RelightScene, tmp_path: Path) -> None:
    objects = relit_objects(ready)
    shown = np.full((4, 5, 3), 77, np.uint8)
    cameras = (*ready.file.cameras, Camera((1.0, 2.0, 3.0), (0.1, 0.2, 0.3), 33.0, (31, 17)))
    scene = replace(ready.file, cameras=cameras)
    reference = [np.full((len(each.mesh.positions), 3), number + 0.5) for number, each in enumerate(objects)]
    reference[1][3] = np.nan
    RelightResult.of(scene, objects, {"bytes": 7}, [shown, shown], reference).save(tmp_path / "out")
    names = sorted(each.name for each in (tmp_path / "out").iterdir())
    assert names == ["picture_1.png", "picture_2.png", "relight.json", "relight.npz"]
    found = open_relit(tmp_path / "out")
    assert found.report == {"bytes": 7}
    assert found.cameras == cameras
    assert found.sky.name == ready.file.light.name
    assert found.sky.cube == pytest.approx(environment_cube(ready.file.light, 8), rel=1e-3, abs=1e-3)
    assert found.reference is not None
    for before, after in zip(reference, found.reference, strict=True):
        assert np.array_equal(after, before, equal_nan=True)
    for before, after in zip(objects, found.objects, strict=True):
        assert after.material == before.material
        assert after.transport.factors.energy == before.transport.factors.energy
        assert after.transport.factors.channels == before.transport.factors.channels
        assert after.transport.settings == before.transport.settings
        assert after.mesh.name == before.mesh.name
        for name in ("positions", "normals", "triangles"):
            assert np.array_equal(getattr(after.mesh, name), getattr(before.mesh, name))
        assert (after.lit(light(8)).tuples == before.lit(light(8)).tuples).all()
        mine, theirs = Relit(before.transport), Relit(after.transport)
        mine.relight(light(8))
        theirs.relight(light(8))
        assert (mine.shade((0, 1, 3)) == theirs.shade((0, 1, 3))).all()
    with pytest.raises(BadInput, match="found an existing relit scene, expected a new folder or `force=True`"):
        RelightResult.of(ready.file, objects, {}).save(tmp_path / "out")
    assert [each.name for each in tmp_path.iterdir() if not each.name.startswith(".")] == ["out"]
    assert open_relit(tmp_path / "out").report == {"bytes": 7}


def test_files_that_are_none_are_refused(ready: RelightScene, tmp_path: Path) -> None:
    RelightResult.of(ready.file, relit_objects(ready), {}).save(tmp_path / "out")
    file = tmp_path / "out" / "relight.npz"
    whole = file.read_bytes()
    file.write_bytes(whole[:2000])
    with pytest.raises(BadInput, match=r"relight\.npz"):
        open_relit(tmp_path / "out")
    file.write_bytes(whole)
    arrays, header = read_archive(file)
    arrays.pop("header")
    # What a compiled loop would read past the end of.
    for name, bad in (("object_0_index", 384), ("object_0_basis_index", 500)):
        spoiled = arrays | {name: np.full_like(arrays[name], bad)}
        write_archive(file, header, spoiled)
        with pytest.raises(BadInput, match=rf"{name} holds {bad}, expected numbers from 0 to 383"):
            open_relit(tmp_path / "out")
    write_archive(file, header, arrays | {"object_0_start": arrays["object_0_start"][:-1]})
    with pytest.raises(BadInput, match="object_0_start is int64 of shape"):
        open_relit(tmp_path / "out")
    late, short = arrays["object_1_start"].copy(), arrays["object_0_cluster"].copy()
    late[0] = 1
    short[2] = 60000
    fewer = arrays["object_0_frames"][:-1]
    for name, other in (("object_1_start", late), ("object_0_cluster", short), ("object_0_frames", fewer)):
        write_archive(file, header, arrays | {name: other})
        with pytest.raises(BadInput, match=name):
            open_relit(tmp_path / "out")
    write_archive(file, header, {name: each for name, each in arrays.items() if name != "object_1_scale"})
    with pytest.raises(BadInput, match="holds no object_1_scale"):
        open_relit(tmp_path / "out")
    write_archive(file, header | {"version": 9}, arrays)
    with pytest.raises(BadInput, match="format version 9, expected at most 7"):
        open_relit(tmp_path / "out")


def small_scene(folder: Path, text: str) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """The archive of a scene with a report and a reference: (arrays, header)."""
    corners = [f"v {x} {y} {z}" for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    sides = ("1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4")
    (folder / "box.obj").write_text("\n".join([*corners, *(f"f {side}" for side in sides)]) + "\n")
    text = text.replace("shape:sphere", "box.obj").replace("steps = 6", "steps = 2")
    file = read(folder, text)
    objects = relit_objects(open_relight_scene(file))
    reference = [np.full((len(each.mesh.positions), 3), 0.5) for each in objects]
    own = {
        "mesh": "sphere",
        "material": "albedo 0.5",
        "vertices": 9,
        "terms": 1,
        "bytes": 7,
        "error": {"together": 0.1},
    }
    report = {"objects": [own | {"coefficients_per_vector": 3.5}]}
    RelightResult.of(file, objects, report, (), reference).save(folder / "out")
    arrays, header = read_archive(folder / "out" / "relight.npz")
    arrays.pop("header")
    return arrays, header


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["clusters", "harmonics", "neither"])
def test_a_damaged_scene_is_refused_in_a_line_or_shown(kind: str, tmp_path: Path) -> None:
    """Every array and every entry of the header, each damaged in every way."""
    text = {
        "clusters": TEXT,
        "harmonics": PLANNED.replace("studio", "overcast").replace("0.1", "0.03"),
        "neither": TEXT.replace("clusters = 2\ncomponents = 3\n", ""),
    }[kind]
    arrays, header = small_scene(tmp_path, text)
    file, shown = tmp_path / "out" / "relight.npz", 0
    damages = [(what, header, each) for what, each in array_damages(arrays)]
    damages += [(what, each, arrays) for what, each in header_damages(header)] if kind == "clusters" else []
    for what, head, each in damages:
        np.savez(file, allow_pickle=False, header=np.array(json.dumps(head)), **each)
        problem = ""
        try:
            opened = open_relit(tmp_path / "out")
            shown += 1
            for thing in opened.objects:
                problem = (
                    "" if np.isfinite(thing.lit(light(thing.transport.settings.cube)).tuples).all() else "no number"
                )
            # A page takes a while: of every twelfth.
            if shown % 12 == 1:
                write_relit_page(tmp_path / "page.html", opened)
        except BadInput as error:
            problem = str(error) if "\n" in str(error) or "relight.npz" not in str(error) else ""
        except Exception as error:
            problem = repr(error)
        assert not problem, what
    assert shown < len(damages) / 4


def test_a_picture_shows_the_sphere_where_it_is(ready: RelightScene) -> None:
    camera = Camera((0.0, 0.25, 4.0), (0.0, 0.25, 0.0), 30.0, (60, 60))
    meshes = [each.mesh for each in ready.objects]
    colours = [np.full((len(mesh.positions), 3), level) for mesh, level in zip(meshes, (2.0, 1.0), strict=True)]
    shown, covered = picture(meshes, colours, ready.occluder, camera, ready.file.light)
    w = camera.rays(2)[:, :, 0]
    assert w[30, 30] == pytest.approx([0, 0, -1], abs=0.02)
    assert w[0, 30, 1] > 0 > w[-1, 30, 1]
    assert w[30, -1, 0] > 0
    assert shown[30, 30] == pytest.approx(2)
    # The sphere's outline is at asin(.5/4) from the axis.
    row = shown[30, :, 0] == 2
    assert row.sum() == pytest.approx(60 * np.tan(np.arcsin(0.125)) / np.tan(np.radians(15)), abs=3)
    assert covered[30, 30] == 1
    assert covered[0, 0] == 0
    assert (shown[58, 30] == pytest.approx(1)) or covered[58, 30] < 1


def test_the_embedded_scene_is_readable() -> None:
    found = read_relight_scene(ROOT / "configs" / "scenes" / "relight.toml")
    assert found.objects[0].material == "material:car-paint-red"
    assert found.light.name == "sky.hdr"


CASES = {
    "no object": ('[[object]]\nmesh = "shape:sphere"\nalbedo = [0.5]\nsize = 0.5\nat = [0, 0.25, 0]\n', "", "object"),
    "no mesh": ("shape:sphere", "none.obj", r"object\[0\]\.mesh: no file .*none\.obj, expected a mesh"),
    "no shape": (
        "shape:sphere",
        "shape:cow",
        r"object\[0\]\.mesh: found 'shape:cow', expected a file or one of shape:sphere",
    ),
    "no material": ("albedo = [0.5]\n", "", "expected exactly one of material, albedo"),
    "two materials": (
        "albedo = [0.5]\n",
        'albedo = [0.5]\nmaterial = "material:phong-10"\n',
        "exactly one of material, albedo",
    ),
    "an albedo of 2": (
        "albedo = [0.5]",
        "albedo = [2]",
        r"albedo: found \[2\.0\], expected 1 or 3 numbers from 0 to 1",
    ),
    "a missing file": ("albedo = [0.5]", 'material = "none.bsdf"', r"object\[0\]\.material: no file"),
    "no size": ("size = 0.5", "size = 0", r"size: found 0, expected a number above 0"),
    "a flat place": ("at = [0, 0.25, 0]", "at = [0, 1]", r"at: found \[0\.0, 1\.0\], expected three numbers"),
    "a far place": ("at = [0, 0.25, 0]", "at = [0, 1e9, 0]", "at: .* expected three numbers below a million"),
    "terms of 0": ("size = 0.5", "terms = 0", "terms: found 0, expected a whole number from 1 to 256"),
    "terms of 1000": ("size = 0.5", "terms = 1000", "terms: found 1000, expected a whole number from 1 to 256"),
    "two lights": ('named = "studio"', 'named = "studio"\nenvironment = "x.hdr"', "exactly one of environment, named"),
    "the sun": (
        'named = "studio"',
        'named = "sun"',
        "lighting.named: found 'sun', expected an environment map or one of overcast, studio, uniform",
    ),
    "no sky": ('named = "studio"', 'environment = "none.hdr"', r"none\.hdr: no such file"),
    "a blind camera": ("eye = [0, 1.5, 3]", "eye = [0, 0, 0]", "eye: found the target's place, expected another"),
    "a small picture": (
        "pixels = [40, 30]",
        "pixels = [4, 30]",
        r"pixels: found \[4, 30\], expected width and height of 8",
    ),
    "no camera": ("[[camera]]\neye = [0, 1.5, 3]\npixels = [40, 30]\n", "", "camera"),
    "kept of 0": ("kept = 40", "kept = 0", "transport.kept: found 0 coefficients, expected 1 to 384"),
    "kept too many": ("kept = 40", "kept = 385", "transport.kept: found 385 coefficients, expected 1 to 384"),
    "another cube": ("cube = 8", "cube = 9", "transport.cube: found 9 texels along a face, expected one of 8, 16"),
    "two rules for K": (
        "albedo = [0.5]",
        "albedo = [0.5]\nterms = 2\nshare = 0.9",
        "found terms and share, expected at most one of terms, error, share",
    ),
    "two rules for the ground": (
        "half = 1.5",
        "half = 1.5\nerror = 0.1\nshare = 0.9",
        "found error and share, expected at most one of terms, error, share",
    ),
    "an error of 0": ("albedo = [0.5]", "albedo = [0.5]\nerror = 0", r"error: found 0, expected a number above 0"),
    "a tolerance of 0": (
        "[transport]\ncube = 8\nkept = 40\nclusters = 2\ncomponents = 3",
        "[tolerance]\nreflected = 0",
        "reflected: found 0, expected a number above 0",
    ),
    "a tolerance and kept": (
        "clusters = 2\ncomponents = 3",
        "[tolerance]\nreflected = 0.1",
        r"transport\.kept: found it beside tolerance\.reflected, which chooses it, expected one of the two",
    ),
    "a tolerance and clusters": (
        "kept = 40\nclusters = 2\ncomponents = 3",
        "clusters = 2\n[tolerance]\nreflected = 0.1",
        r"transport\.clusters: found it beside tolerance\.reflected",
    ),
    "a tolerance and a share of the ground": (
        "half = 1.5\nsteps = 6\n[lighting]",
        "half = 1.5\nsteps = 6\nshare = 0.9\n[tolerance]\nreflected = 0.1\n[lighting]",
        r"transport\.kept: found it beside",
    ),
    "a scene for editing": (TEXT, "[[object]]\nbands = [32]\n", "found a scene for editing, expected a scene for reli"),
    "an unknown key": ("kept = 40", "keep = 40", r"transport.keep: unknown key \(nearest: transport.kept\)"),
}


@pytest.mark.parametrize("name", CASES)
def test_what_is_wrong_with_a_scene_is_named_in_one_line(name: str, tmp_path: Path) -> None:
    old, new, expected = CASES[name]
    assert old in TEXT
    with pytest.raises(BadInput, match=expected) as refused:
        read(tmp_path, TEXT.replace(old, new, 1))
    assert "scene.toml" in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("pixel", "expected"), [(-1.0, "is negative"), (0.0, "every pixel is 0")])
def test_an_environment_without_light_is_refused(pixel: float, expected: str, tmp_path: Path) -> None:
    write_exr(tmp_path / "sky.exr", np.full((4, 8, 3), pixel, np.float32), ("R", "G", "B"))
    with pytest.raises(BadInput, match=expected):
        read(tmp_path, TEXT.replace('named = "studio"', 'environment = "sky.exr"'))


PLANNED = TEXT.replace("kept = 40\nclusters = 2\ncomponents = 3\n", "[tolerance]\nreflected = 0.1\n")


def test_a_share_beside_a_tolerance_is_refused(tmp_path: Path) -> None:
    for old, name in (("albedo = [0.5]", r"object\[0\]"), ("albedo = [0.2, 0.4, 0.6]", "ground")):
        with pytest.raises(BadInput, match=rf"{name}\.share: found it beside tolerance\.reflected, which chooses it"):
            read(tmp_path, PLANNED.replace(old, f"{old}\nshare = 0.9"))
    assert read(tmp_path, PLANNED.replace("albedo = [0.5]", "albedo = [0.5]\nterms = 1")).objects[0].terms == 1


@pytest.mark.slow
def test_a_planned_scene_keeps_its_forms_in_the_folder(tmp_path: Path) -> None:
    """An overcast sky over matt things: nine numbers a vertex, there and back."""
    scene = read(tmp_path, PLANNED.replace("studio", "overcast").replace("0.1", "0.03"))
    assert scene.reflected == 0.03
    made = open_relight_scene(scene)
    objects = relit_objects(made)
    RelightResult.of(scene, objects, {}).save(tmp_path / "out")
    saved = open_relit(tmp_path / "out")
    for each, plan, back in zip(objects, made.plans, saved.objects, strict=True):
        assert isinstance(each.compact, Harmonic)
        assert isinstance(back.compact, Harmonic)
        assert each.compact.order == plan.chosen.order
        assert back.transport.settings.tolerance == plan.chosen.tolerance
        assert back.form == each.form == plan.chosen.form
        assert (back.lit(light(8)).tuples == each.lit(light(8)).tuples).all()
        assert each.nbytes == plan.chosen.bytes
    size = write_relit_page(tmp_path / "page.html", saved)
    page = (tmp_path / "page.html").read_text()
    assert size == (tmp_path / "page.html").stat().st_size
    # The scene's own sky is a built-in one: it is there once.
    assert [page.count(f'"name":"{name}"') for name in ("overcast", "studio", "uniform")] == [1, 1, 1]
    file = tmp_path / "out" / "relight.npz"
    arrays, header = read_archive(file)
    name = "object_0_harmonic_number"
    for numbers in (arrays[name][:2], arrays[name][:, :, :3]):
        write_archive(file, header, arrays | {name: numbers})
        with pytest.raises(BadInput, match=name):
            open_relit(tmp_path / "out")


@pytest.mark.slow
def test_terms_follow_the_rule_that_is_named(tmp_path: Path) -> None:
    shiny = 'material = "material:phong-10"'
    counts = {}
    for rule in ("error = 0.05", "error = 0.2", "share = 0.9", ""):
        text = TEXT.replace("albedo = [0.5]", f"{shiny}\n{rule}").replace(GROUND, "")
        factors = open_relight_scene(read(tmp_path, text)).choices[0].material.factors
        counts[rule] = factors.terms
        if rule.startswith("error"):
            assert factors.expected_error <= float(rule.split("=")[1])
    assert counts["error = 0.05"] > counts["error = 0.2"]
    # 99% where no rule is named.
    assert counts[""] > counts["share = 0.9"]


def test_a_huge_sun_stays_finite(ready: RelightScene) -> None:
    made = relit_objects(ready)[0]
    sky = np.full((6, 8, 8, 3), 1e-3)
    sky[2, 4, 4] = 1e12
    found = shaded(made.transport, made.lit(sky).tuples, (0, 1.5, 3))
    assert np.isfinite(found).all()


def test_the_light_turns_by_the_degrees_that_the_file_says(tmp_path: Path) -> None:
    write_exr(tmp_path / "sky.exr", np.ones((4, 8, 3), np.float32), ("R", "G", "B"))
    for line in ('named = "studio"', 'environment = "sky.exr"'):
        found = read(tmp_path, TEXT.replace('named = "studio"', f"{line}\nturn = 90")).light
        assert found.turn == pytest.approx(np.pi / 2)
