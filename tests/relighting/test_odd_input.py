"""Odd meshes and lights, and blocks that another run left: refused by one line, or lit as they are."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from homofact.brdf.analytic import Lambert
from homofact.errors import BadInput
from homofact.files.archive import write_arrays
from homofact.meshes import shapes
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.relighting.cube import environment_cube
from homofact.relighting.factoring import factor
from homofact.relighting.factors import InOutFactors
from homofact.relighting.precompute import TransportSettings, WaveletTransport, transport
from homofact.relighting.reference import Estimate
from homofact.relighting.relight import Relit
from homofact.rendering.light import EnvironmentMap

MATTE = Lambert((0.5, 0.25, 0.125))
SETTINGS = TransportSettings(cube=8, kept=16)
SPHERE = shapes.sphere(4)


@pytest.fixture(scope="module")
def factors() -> InOutFactors:
    return factor(MATTE, terms=1, map_size=8)


@pytest.fixture(scope="module")
def occluder() -> Occluder:
    pytest.importorskip("embreex", reason="Embree is missing: pip install homofact[relight]")
    return Occluder(SPHERE.positions, SPHERE.triangles)


@pytest.fixture(scope="module")
def made(factors: InOutFactors, occluder: Occluder) -> WaveletTransport:
    return transport(SPHERE, factors, SETTINGS, occluder)


def refused(words: str, call: Callable[[], object]) -> None:
    """Refused by one line that holds the words."""
    with pytest.raises(BadInput) as caught:
        call()
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_mesh_without_triangles_throws_no_shadow(occluder: Occluder) -> None:
    refused("found no triangles, expected a mesh", lambda: Occluder(SPHERE.positions, SPHERE.triangles[:0]))


def test_an_open_mesh_is_lit_from_its_front(factors: InOutFactors) -> None:
    """A lone plane: nothing is in the way of its upper hemisphere, and there is nothing to refuse."""
    plane = shapes.ground(steps=2)
    relit = Relit(
        transport(plane, factors, TransportSettings(cube=16, kept=1536), Occluder(plane.positions, plane.triangles))
    )
    relit.relight(EnvironmentMap.constant(2.0))
    assert relit.shade(np.array([0.0, 5.0, 0.0])) == pytest.approx(np.tile([1.0, 0.5, 0.25], (9, 1)), rel=0.02)


def test_normals_that_point_inwards_see_no_light(factors: InOutFactors, occluder: Occluder) -> None:
    inside = Mesh(SPHERE.positions, -SPHERE.normals, SPHERE.triangles, "inside out")
    relit = Relit(transport(inside, factors, SETTINGS, occluder))
    relit.relight(EnvironmentMap.constant())
    assert not relit.tuples.any()


@pytest.mark.parametrize(
    ("light", "words"),
    [
        (np.ones((6, 4, 4, 3)), r"a cube map of shape (6, 4, 4, 3), expected (6, 8, 8, 3)"),
        (-np.ones((6, 8, 8, 3)), "radiance that is negative or not finite"),
        (np.full((6, 8, 8, 3), np.nan), "radiance that is negative or not finite"),
        (np.full((6, 8, 8, 3), np.inf), "radiance that is negative or not finite"),
    ],
)
def test_light_that_is_none_leaves_the_one_there_is(made: WaveletTransport, light: np.ndarray, words: str) -> None:
    relit = Relit(made)
    relit.relight(EnvironmentMap.constant())
    before = relit.tuples.copy()
    refused(words, lambda: relit.relight(light))
    refused(words, lambda: relit.ask(light))
    assert np.array_equal(relit.tuples, before)


def test_a_very_bright_light_is_only_bright(made: WaveletTransport) -> None:
    relit = Relit(made)
    eye = np.array([0.0, 0.0, 4.0])
    relit.relight(EnvironmentMap.constant(1.0))
    once = relit.shade(eye)
    relit.relight(EnvironmentMap.constant(1e12))
    assert relit.shade(eye) / 1e12 == pytest.approx(once, rel=1e-5)
    assert environment_cube(EnvironmentMap.constant(1e12), 8).max() == pytest.approx(1e12)


def test_blocks_among_other_shadows_are_refused(factors: InOutFactors, occluder: Occluder, tmp_path: Path) -> None:
    first = transport(SPHERE, factors, SETTINGS, occluder, folder=tmp_path)
    smaller = Occluder(0.9 * SPHERE.positions, SPHERE.triangles)
    words = "holds transport of sphere with another mesh, material or setting, expected that of"
    refused(words, lambda: transport(SPHERE, factors, SETTINGS, smaller, folder=tmp_path))
    # What was refused has changed nothing.
    assert np.array_equal(transport(SPHERE, factors, SETTINGS, occluder, folder=tmp_path).number, first.number)


def test_blocks_of_another_size_are_named(factors: InOutFactors, occluder: Occluder, tmp_path: Path) -> None:
    def run() -> WaveletTransport:
        return transport(SPHERE, factors, SETTINGS, occluder, folder=tmp_path)

    run()
    block = tmp_path / "block_00000.npz"
    whole = block.read_bytes()
    parts = {"count": np.ones(3, np.int32), "index": np.zeros(3, np.uint16), "number": np.ones(3, np.int16)}
    write_arrays(block, parts | {"scale": np.ones(3, np.float32)})
    refused(f"{block}: not a whole block of {len(SPHERE.positions)} vertices", run)
    block.unlink()
    run()
    assert block.read_bytes() == whole


def test_nothing_seen_is_no_noise() -> None:
    nothing = Estimate(np.zeros((2, 3)), np.zeros((2, 3)), np.zeros(2, bool))
    assert nothing.noise == 0
