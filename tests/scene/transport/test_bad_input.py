"""What relighting refuses, one line each: meshes, materials, settings, lights, eyes, and blocks of an earlier run."""

import math
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
from homofact.render.light import EnvironmentMap
from homofact.scene.transport.clusters import clustered
from homofact.scene.transport.cube import environment_cube
from homofact.scene.transport.factors import InOutFactors, factor
from homofact.scene.transport.ledger import ledger, seen_vertices
from homofact.scene.transport.precompute import Transport, TransportSettings, transport
from homofact.scene.transport.reference import Estimate
from homofact.scene.transport.relight import Relit

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
def made(factors: InOutFactors, occluder: Occluder) -> Transport:
    return transport(SPHERE, factors, SETTINGS, occluder)


def refused(words: str, call: Callable[[], object]) -> None:
    """Refused by one line that holds the words."""
    with pytest.raises(BadInput) as caught:
        call()
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("words", "call"),
    [
        ("terms: found 0, expected 1 to 256", lambda: factor(MATTE, terms=0)),
        ("terms: found 257, expected 1 to 256", lambda: factor(MATTE, terms=257)),
        ("share: found 1.0, expected between 0 and 1", lambda: factor(MATTE, share=1.0)),
        ("map size: found 4, expected 8 to 256 texels across", lambda: factor(MATTE, map_size=4)),
        ("the reflectance is 0 everywhere", lambda: factor(Lambert((0.0, 0.0, 0.0)))),
        ("found 2 channels, expected 1 or 3", lambda: factor(Lambert((0.1, 0.1), channels=("a", "b")))),
        ("cube: found 7 texels along a face, expected one of 8, 16, 32, 64", lambda: TransportSettings(cube=7)),
        ("rays: found 3, expected 1 or 2", lambda: TransportSettings(rays=3)),
        ("kept: found 0 coefficients, expected 1 to 24576", lambda: TransportSettings(kept=0)),
        ("kept: found 385 coefficients, expected 1 to 384", lambda: TransportSettings(cube=8, kept=385)),
        ("tolerance: found 1, expected 0 to below 1", lambda: TransportSettings(tolerance=1.0)),
        ("tolerance: found nan, expected 0 to below 1", lambda: TransportSettings(tolerance=math.nan)),
    ],
)
def test_settings_that_are_none(words: str, call: Callable[[], object]) -> None:
    refused(words, call)


def test_a_mesh_without_triangles_throws_no_shadow(occluder: Occluder) -> None:
    refused("found no triangles, expected a mesh", lambda: Occluder(SPHERE.positions, SPHERE.triangles[:0]))
    away = (0.0, 0.0, 0.5)
    refused("no vertex is seen from (0.0, 0.0, 0.5)", lambda: seen_vertices(SPHERE, MATTE, occluder, away, 5))


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
def test_light_that_is_none_leaves_the_one_there_is(made: Transport, light: np.ndarray, words: str) -> None:
    relit = Relit(made)
    relit.relight(EnvironmentMap.constant())
    before = relit.tuples.copy()
    refused(words, lambda: relit.relight(light))
    refused(words, lambda: relit.ask(light))
    assert np.array_equal(relit.tuples, before)


def test_a_very_bright_light_is_only_bright(made: Transport) -> None:
    relit = Relit(made)
    eye = np.array([0.0, 0.0, 4.0])
    relit.relight(EnvironmentMap.constant(1.0))
    once = relit.shade(eye)
    relit.relight(EnvironmentMap.constant(1e30))
    assert relit.shade(eye) / 1e30 == pytest.approx(once, rel=1e-5)
    assert environment_cube(EnvironmentMap.constant(1e30), 8).max() == pytest.approx(1e30)


@pytest.mark.parametrize("eye", [np.array([np.nan, 0, 0]), np.zeros(2), np.array([0, np.inf, 0])])
def test_eyes_that_are_nowhere(made: Transport, eye: np.ndarray) -> None:
    refused("expected a point of 3 finite numbers", lambda: Relit(made).shade(eye))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"components": 0}, "components: found 0, expected 1 to 26"),
        ({"kept": 0}, "kept: found 0, expected 1 to 384"),
        ({"clusters": 0}, "clusters: found 0, expected 1 to 26"),
        ({"clusters": 1000}, "clusters: found 1000, expected 1 to 26"),
    ],
)
def test_clusters_that_are_none(made: Transport, arguments: dict[str, int], words: str) -> None:
    refused(words, lambda: clustered(made, **arguments))


def test_a_stage_that_is_none(made: Transport, occluder: Occluder) -> None:
    seen = seen_vertices(SPHERE, MATTE, occluder, (0.0, 0.0, 4.0), 3)
    refused(
        "stage: found 'glow', expected one of terms",
        lambda: ledger(seen, made, EnvironmentMap.constant(), stages=["glow"]),
    )


def test_a_run_goes_on_with_its_own_blocks_alone(factors: InOutFactors, occluder: Occluder, tmp_path: Path) -> None:
    first = transport(SPHERE, factors, SETTINGS, occluder, folder=tmp_path)
    again = transport(SPHERE, factors, SETTINGS, occluder, folder=tmp_path)
    assert np.array_equal(first.number, again.number)
    other = shapes.sphere(5)
    words = "holds transport of sphere with another mesh, material or setting, expected that of"
    refused(
        words, lambda: transport(other, factors, SETTINGS, Occluder(other.positions, other.triangles), folder=tmp_path)
    )
    refused(words, lambda: transport(SPHERE, factors, TransportSettings(cube=8, kept=17), occluder, folder=tmp_path))
    smaller = Occluder(0.9 * SPHERE.positions, SPHERE.triangles)
    refused(words, lambda: transport(SPHERE, factors, SETTINGS, smaller, folder=tmp_path))
    brighter = factor(Lambert((0.6, 0.25, 0.125)), terms=1, map_size=8)
    refused(words, lambda: transport(SPHERE, brighter, SETTINGS, occluder, folder=tmp_path))
    # What was refused has changed nothing.
    assert np.array_equal(transport(SPHERE, factors, SETTINGS, occluder, folder=tmp_path).number, first.number)


def test_damaged_blocks_are_named(factors: InOutFactors, occluder: Occluder, tmp_path: Path) -> None:
    def run() -> Transport:
        return transport(SPHERE, factors, SETTINGS, occluder, folder=tmp_path)

    run()
    block = tmp_path / "block_00000.npz"
    whole = block.read_bytes()
    block.write_bytes(whole[:100])
    refused(f"{block}: a damaged archive", run)
    with np.load(tmp_path / "fingerprint.npz") as mark:
        assert {"digest", "mesh"} <= set(mark.files)
    parts = {"count": np.ones(3, np.int32), "index": np.zeros(3, np.uint16), "number": np.ones(3, np.int16)}
    write_arrays(block, parts | {"scale": np.ones(3, np.float32)})
    refused(f"{block}: not a whole block of {len(SPHERE.positions)} vertices", run)
    block.unlink()
    run()
    assert block.read_bytes() == whole
    (tmp_path / "fingerprint.npz").unlink()
    refused("holds blocks of transport and no fingerprint, expected an empty folder", run)


def test_nothing_seen_is_no_noise() -> None:
    nothing = Estimate(np.zeros((2, 3)), np.zeros((2, 3)), np.zeros(2, bool))
    assert nothing.noise == 0
