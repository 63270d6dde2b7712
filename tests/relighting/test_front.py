"""`homofact.relight` as a user calls it: the same light as by hand, shadows of others, bad input."""

from pathlib import Path

import numpy as np
import pytest
from relighting_cases import EYE, SHINY, ball, knot, light, occluder, shiny

import homofact
from homofact.brdf.analytic import Lambert
from homofact.errors import BadInput
from homofact.meshes.shapes import ground
from homofact.relighting.cube import environment_cube
from homofact.relighting.precompute import TransportSettings, transport
from homofact.relighting.relight import Relit
from homofact.scene.lighting import named_environment, open_environment

ROOT = Path(__file__).resolve().parents[2]
WHITE = Lambert((1.0,) * 3)


@pytest.mark.slow
def test_it_is_the_transport_that_the_parts_make() -> None:
    found = homofact.relight(knot(), SHINY, terms=6, map_size=32, cube=8, kept=50)
    made = Relit(transport(found.mesh, shiny(), TransportSettings(8, kept=50), occluder()))
    sky = light(8)
    for each in (found, made):
        each.relight(sky)
    assert np.array_equal(found.shade(EYE), made.shade(EYE))
    assert found.shade(EYE).shape == found.mesh.positions.shape
    found.ask("studio")
    while found.step(40):
        pass
    made.relight(named_environment("studio"))
    assert np.array_equal(found.tuples, made.tuples)


@pytest.mark.slow
def test_a_white_ball_in_white_light_is_white() -> None:
    found = homofact.relight("shape:sphere", WHITE, cube=16, tolerance=0.0)
    found.relight("uniform")
    assert found.transport.factors.terms == 1
    seen = found.mesh.positions[:, 2] > 0.5
    assert found.shade((0, 0, 50))[seen] == pytest.approx(1, abs=0.02)


@pytest.mark.slow
def test_what_stands_beside_it_throws_shadows_on_it() -> None:
    floor = ground(1.5, -1.0, 4)
    sums = []
    for among in ((), (ball(),)):
        found = homofact.relight(floor, WHITE, cube=8, among=among)
        found.relight(np.ones((6, 8, 8, 3)))
        colours = found.shade((0, 5, 0.1))[:, 0]
        sums.append((colours[len(colours) // 2], colours[0]))
    (open_middle, open_corner), (middle, corner) = sums
    assert open_middle == pytest.approx(1, abs=0.05)
    # Under a ball that touches the floor there is hardly any sky; the corner is away.
    assert middle < 0.3 * open_middle
    assert corner > 0.6 * open_corner


@pytest.mark.slow
def test_terms_are_reckoned_for_the_light_that_is_named() -> None:
    of_studio, of_uniform = (
        homofact.relight(ball(), SHINY, error=0.05, light=name, cube=8, map_size=8).transport.factors
        for name in ("studio", "uniform")
    )
    assert of_studio.terms > of_uniform.terms
    assert of_studio.expected_error <= 0.05


@pytest.mark.slow
def test_files_are_read_and_blocks_kept(tmp_path: Path) -> None:
    told = []
    arguments = {"terms": 1, "map_size": 8, "cube": 8, "folder": tmp_path / "blocks"}
    found = homofact.relight(
        str(ROOT / "data_synthetic" / "knot.ply"),
        "material:phong-10",
        **arguments,
        progress=told.append,
    )
    assert told[-1].done + 1 == told[-1].total == len(list((tmp_path / "blocks").glob("block_*.npz")))
    assert len(found.mesh.positions) == found.transport.vertices
    found.relight(ROOT / "data_synthetic" / "sky.hdr")
    sky = homofact.relight(found.mesh, "material:phong-10", **arguments)
    sky.relight(environment_cube(open_environment(ROOT / "data_synthetic" / "sky.hdr"), 8))
    assert np.array_equal(found.tuples, sky.tuples)
    with pytest.raises(BadInput, match="holds transport of"):
        homofact.relight(found.mesh, WHITE, **arguments)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"scene": "shape:cube"}, "mesh: found 'shape:cube', expected a file or one of shape:sphere, shape:knot"),
        ({"scene": "none.ply"}, "none.ply: no such file, expected an OBJ, PLY or glTF mesh"),
        ({"material": "material:gold-dust"}, "gold-dust"),
        ({"light": "fog"}, "light: found 'fog', expected an environment map or one of overcast, studio, uniform"),
        ({"light": "fog.hdr"}, "fog.hdr: no such file, expected a .hdr or .exr picture"),
        ({"terms": 2, "error": 0.1}, "found terms and error, expected one of the two"),
        ({"cube": 9}, "cube: found 9 texels along a face"),
        ({"kept": 0}, "kept: found 0 coefficients"),
        ({"keep": 9}, "relight: no such setting 'keep', expected one of terms"),
        ({"force": True}, "force: found True with a mesh and its material"),
    ],
)
def test_what_is_wrong_is_named(given: dict[str, object], expected: str) -> None:
    with pytest.raises(BadInput, match=expected) as refused:
        homofact.relight(**({"scene": ball(), "material": SHINY, "cube": 8} | given))  # type: ignore[arg-type]
    assert "\n" not in str(refused.value)


def test_what_is_no_light_is_refused_and_the_light_stays() -> None:
    found = homofact.relight(ball(), WHITE, cube=8)
    found.relight("uniform")
    before = found.tuples.copy()
    for wrong, expected in (
        (3, "light: found 3, expected an EnvironmentMap, a cube map, a file or a name"),
        ("sun", "expected an environment map or one of overcast, studio, uniform"),
        (np.ones((6, 4, 4, 3)), "expected \\(6, 8, 8, 3\\)"),
    ):
        for change in (found.relight, found.ask):
            with pytest.raises(BadInput, match=expected):
                change(wrong)  # type: ignore[arg-type]
    assert np.array_equal(found.tuples, before)
