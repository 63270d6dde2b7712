"""The file of a scene: what is read from it, and everything that can be wrong with it."""

from pathlib import Path

import numpy as np
import pytest
from relighting.ball_scene import PLANNED, TEXT, read

from homofact.containers.exr import write_exr
from homofact.errors import BadInput
from homofact.meshes.shapes import torus_knot
from homofact.relighting.scene_file import read_relight_scene
from homofact.scene.objects import placed_mesh

ROOT = Path(__file__).resolve().parents[2]


def test_the_embedded_scene_is_readable() -> None:
    found = read_relight_scene(ROOT / "configs" / "scenes" / "relight.toml")
    assert found.objects[0].material == "material:car-paint-red"
    assert found.light.name == "sky.hdr"


def test_a_mesh_is_turned_scaled_and_moved_with_its_normals(tmp_path: Path) -> None:
    text = TEXT.replace("shape:sphere", "shape:knot").replace("at = [0, 0.25, 0]", "at = [0.5, 1, -2]\nturn = 90")
    mesh = placed_mesh(read(tmp_path, text).objects[0])
    plain = torus_knot()
    # About y by 90°: z goes to x, x to −z.
    for found, given in ((mesh.positions, 0.5 * plain.positions), (mesh.normals, plain.normals)):
        turned = np.stack((given[:, 2], given[:, 1], -given[:, 0]), 1)
        assert found == pytest.approx(turned + ((0.5, 1, -2) if found is mesh.positions else 0), abs=1e-12)


def test_the_light_turns_by_the_degrees_that_the_file_says(tmp_path: Path) -> None:
    write_exr(tmp_path / "sky.exr", np.ones((4, 8, 3), np.float32), ("R", "G", "B"))
    for line in ('named = "studio"', 'environment = "sky.exr"'):
        found = read(tmp_path, TEXT.replace('named = "studio"', f"{line}\nturn = 90")).light
        assert found.turn == pytest.approx(np.pi / 2)


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
    "a name as a file": (
        'named = "studio"',
        'environment = "studio"',
        "environment: found 'studio', expected a .hdr or .exr file, or named",
    ),
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


def test_a_share_beside_a_tolerance_is_refused(tmp_path: Path) -> None:
    for old, name in (("albedo = [0.5]", r"object\[0\]"), ("albedo = [0.2, 0.4, 0.6]", "ground")):
        with pytest.raises(BadInput, match=rf"{name}\.share: found it beside tolerance\.reflected, which chooses it"):
            read(tmp_path, PLANNED.replace(old, f"{old}\nshare = 0.9"))
    assert read(tmp_path, PLANNED.replace("albedo = [0.5]", "albedo = [0.5]\nterms = 1")).objects[0].terms == 1
