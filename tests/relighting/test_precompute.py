"""Transport vectors: what they are without shadows and with them, what is kept, blocks that survive."""

import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from relighting_cases import ball, knot, light, matt, occluder, shiny, whole

from homofact.errors import BadInput
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.shapes import ground, sphere
from homofact.relighting import cube
from homofact.relighting.haar import transformed
from homofact.relighting.kernels import keep_above, keep_largest, threshold_of, threshold_of_energy
from homofact.relighting.precompute import TransportSettings, cost, transport
from homofact.relighting.relight import Relit
from homofact.relighting.tracer import Tracer


def test_a_matt_convex_body_under_even_light_shows_its_albedo() -> None:
    """Radiance 1 from everywhere, nothing in the way: B = albedo at every vertex, from anywhere."""
    made = transport(ball(), matt(), TransportSettings(64, kept=24576), Occluder(ball().positions, ball().triangles))
    relit = Relit(made)
    relit.relight(np.ones((6, 64, 64, 3)))
    shown = relit.shade((0.0, 0.0, 50.0))
    front = ball().normals[:, 2] > 0.05
    assert shown[front] == pytest.approx(np.broadcast_to((0.6, 0.3, 0.1), shown[front].shape), rel=0.01)
    assert (shown[ball().normals[:, 2] < -0.05] == 0).all()


def test_a_plane_under_a_box_loses_the_sky_that_it_covers() -> None:
    """Right under the middle of a square lid of half width a at height h a matt point loses the lid's form factor."""
    floor, height, half = ground(1.0, 0.0, 2), 0.7, 0.5
    lid = ground(half, height, 1)
    both = Occluder(
        np.concatenate((floor.positions, lid.positions)), np.concatenate((floor.triangles, lid.triangles + 9))
    )
    made = transport(floor, matt(), TransportSettings(64, rays=2, kept=24576), both)
    relit = Relit(made)
    relit.relight(np.ones((6, 64, 64, 3)))
    # The form factor of a rectangle's quarter from below its corner, four times (Howell, configuration B-4).
    x = half / height
    covered = 4 / (2 * np.pi) * 2 * x / np.sqrt(1 + x * x) * np.arctan(x / np.sqrt(1 + x * x))
    middle = int(np.abs(floor.positions).sum(1).argmin())
    assert relit.shade((0.3, 0.5, 0.1))[middle] == pytest.approx((1 - covered) * np.array((0.6, 0.3, 0.1)), rel=0.01)


def test_a_vector_is_the_light_map_times_visibility_and_cosine() -> None:
    made, size = whole(), 8
    tracer = Tracer(knot(), occluder(), size)
    w = cube.directions(size).reshape(-1, 3)
    unit = transformed(np.eye(size * size).reshape(-1, size, size)).reshape(size * size, -1)
    for vertex in (3, 77, 150):
        rows = made.frames[vertex].astype(float)
        local = torch.from_numpy(w @ rows.T)
        seen = tracer.visible(vertex)
        # Nothing is seen under the horizon, and a knot hides something of the rest from most of its points.
        assert (seen[local[:, 2].numpy() < -1e-5] == 0).all()
        expected = np.zeros((made.factors.terms, len(w)))
        up = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64)
        for k in range(made.factors.terms):
            one = replace(made.factors, light=made.factors.light[k : k + 1], view=np.ones((1, 32, 32, 1), np.float32))
            g = one.evaluate(local, up.expand(len(w), 3))[:, 0].numpy()
            expected[k] = g * seen * np.maximum(local[:, 2].numpy(), 0) * tracer.angles
            found = (made.vector(vertex, k).reshape(6, -1) @ unit.T).reshape(-1)
            assert found == pytest.approx(expected[k], abs=2e-4 * np.abs(expected[k]).max())


def test_fewer_coefficients_are_the_largest() -> None:
    few = transport(knot(), shiny(), TransportSettings(8, kept=20), occluder())
    assert few.mean_kept <= 20
    for vertex, term in ((0, 0), (100, 3)):
        all_, kept = whole().vector(vertex, term), few.vector(vertex, term)
        there = np.flatnonzero(kept)
        assert len(there) <= 20
        assert np.abs(all_[there]).min() >= np.delete(np.abs(all_), there).max() - 1e-6
        left_out = np.delete(np.abs(all_), there).max()
        assert np.abs(kept[there] - all_[there]).max() <= 0.126 * left_out


@pytest.mark.parametrize("tolerance", [0.3, 0.1, 0.02])
def test_a_tolerance_bounds_what_is_left_out(tolerance: float) -> None:
    made = transport(knot(), shiny(), TransportSettings(8, tolerance=tolerance), occluder())
    weights = made.factors.weights
    worst = 0.0
    for vertex in range(0, made.vertices, 17):
        all_ = np.stack([whole().vector(vertex, k) for k in range(6)]) * weights[:, None]
        kept = np.stack([made.vector(vertex, k) for k in range(6)]) * weights[:, None]
        lost = np.sqrt((all_[kept == 0] ** 2).sum() / (all_**2).sum())
        assert lost <= tolerance * 1.001
        worst = max(worst, lost)
    assert worst > 0.5 * tolerance


def test_thresholds_are_those_of_sorting() -> None:
    rng = np.random.default_rng(0)
    values = (rng.normal(size=4000) * np.exp(rng.normal(size=4000) * 3)).astype(np.float32)
    values[::7] = 0
    index, number = np.empty(4000, np.uint16), np.empty(4000, np.int16)
    for kept in (1, 50, 999):
        expected = np.sort(np.abs(values))[-kept]
        assert threshold_of(values, kept) == expected.view(np.int32)
        count, scale = keep_largest(values, kept, index, number)
        left_out = np.sort(np.abs(values))[-kept - 1]
        assert scale == pytest.approx(max(np.abs(values).max() / 32767, left_out / 4))
        largest = set(np.argsort(-np.abs(values), kind="stable")[:kept].tolist())
        assert set(index[:count].tolist()) <= largest
        assert number[:count] * scale == pytest.approx(values[index[:count]], abs=0.5001 * scale)
    square = threshold_of_energy(values[None], np.ones(1, np.float32), 0.1)
    lost = (values[values**2 < square].astype(float) ** 2).sum() / (values.astype(float) ** 2).sum()
    assert 0.002 < lost <= 0.01


def test_of_equals_only_as_many_as_asked_are_kept() -> None:
    values = np.ones(64, np.float32)
    index, number = np.empty(64, np.uint16), np.empty(64, np.int16)
    assert keep_largest(values, 10, index, number)[0] == 10
    assert index[:10].tolist() == list(range(10))
    assert keep_largest(np.zeros(64, np.float32), 10, index, number) == (0, 0.0)


def test_numbers_are_as_fine_as_what_is_left_out_asks_for() -> None:
    values = np.array([8, -4, 2, 1, 0.5, 0, 0, 0], np.float32)
    index, number = np.empty(8, np.uint16), np.empty(8, np.int16)
    # A quarter of the largest one left out: 1 here.
    count, scale = keep_largest(values, 3, index, number)
    assert (count, scale, number[:3].tolist()) == (3, 0.25, [32, -16, 8])
    # Of equals at the threshold, one that is left out counts as the others.
    even = np.array([3, 2, 2, 1], np.float32)
    assert keep_largest(even, 2, index, number)[1] == 0.5
    # Where nothing is left out, the numbers have all 16 bits.
    for all_kept in (keep_largest(values, 5, index, number), keep_above(values, 1.0, 0.0, index, number)):
        assert all_kept[1] == pytest.approx(8 / 32767)
    # The weight of a term is in what is left out, not in the step.
    count, scale = keep_above(values, 2.0, 15.0, index, number)
    assert (count, scale, index[:3].tolist()) == (3, 0.25, [0, 1, 2])


def test_rounding_adds_next_to_nothing_to_what_is_left_out() -> None:
    few = transport(knot(), shiny(), TransportSettings(8, kept=48), occluder())
    left_out = rounded = 0.0
    for vertex in range(0, few.vertices, 16):
        for term in range(few.factors.terms):
            all_, kept = whole().vector(vertex, term), few.vector(vertex, term)
            left_out += (all_[kept == 0] ** 2).sum()
            rounded += ((kept - all_)[kept != 0] ** 2).sum()
    assert 0 < rounded < 0.02 * left_out


def test_a_stopped_run_goes_on_with_its_blocks(tmp_path: Path) -> None:
    mesh = sphere(14)
    around = Occluder(mesh.positions, mesh.triangles)
    settings = TransportSettings(8, kept=12)
    seen: list[tuple[int, int]] = []
    fresh = transport(mesh, matt(), settings, around, tmp_path, lambda done, count: seen.append((done, count)))
    blocks = sorted(tmp_path.glob("block_*.npz"))
    assert len(blocks) == -(-len(mesh.positions) // 256) > 1
    assert seen[-1] == (len(blocks), len(blocks))
    blocks[1].unlink()
    kept = blocks[0].stat().st_mtime_ns
    again = transport(mesh, matt(), settings, around, tmp_path)
    assert blocks[0].stat().st_mtime_ns == kept
    for name in ("start", "index", "number", "scale"):
        assert (getattr(again, name) == getattr(fresh, name)).all()
    # Half a block, as a foreign hand may leave it: named, and nothing is overwritten.
    blocks[0].write_bytes(blocks[0].read_bytes()[:100])
    with pytest.raises(BadInput, match=r"block_00000\.npz"):
        transport(mesh, matt(), settings, around, tmp_path)


def test_blocks_of_something_else_are_refused_by_name(tmp_path: Path) -> None:
    settings = TransportSettings(8, kept=12)
    transport(knot(), matt(), settings, occluder(), tmp_path)
    moved = replace(knot(), positions=knot().positions * 1.01)
    cases: list[tuple[Mesh, TransportSettings]] = [(moved, settings), (knot(), TransportSettings(8, kept=13))]
    for mesh, chosen in cases:
        with pytest.raises(BadInput, match=r"holds transport of torus knot 2,3 with another mesh, material or setting"):
            transport(mesh, matt(), chosen, occluder(), tmp_path)
    with pytest.raises(BadInput, match="another mesh, material or setting"):
        transport(knot(), shiny(), settings, occluder(), tmp_path)
    (tmp_path / "fingerprint.npz").unlink()
    with pytest.raises(BadInput, match="blocks of transport and no fingerprint"):
        transport(knot(), matt(), settings, occluder(), tmp_path)


def test_the_cost_is_said_before_and_holds() -> None:
    settings = TransportSettings(8, kept=20)
    said = cost(len(knot().positions), 6, settings)
    made = transport(knot(), shiny(), settings, occluder())
    assert made.nbytes <= said.most_bytes <= said.peak_bytes
    assert said.rays == len(knot().positions) * 192
    assert cost(2560, 1, TransportSettings()).describe().startswith("31 million rays, ")
    assert cost(200, 1, TransportSettings(8)).describe().startswith("0.038 million rays, ")
    million = cost(1_000_000, 4, TransportSettings()).describe()
    assert million == "12288 million rays, at most 1560 MB of transport, at most" + million.split("at most")[2]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({"cube": 48}, "cube: found 48 texels"),
        ({"rays": 3}, "rays: found 3, expected 1 or 2"),
        ({"kept": 0}, r"kept: found 0 coefficients, expected 1 to 24576 \(6 × 64²\)"),
        ({"kept": 24577}, "kept: found 24577 coefficients, expected 1 to 24576"),
        ({"tolerance": 1.0}, "tolerance: found 1, expected 0 to below 1"),
    ],
)
def test_settings_that_are_no_choice(arguments: dict[str, float], expected: str) -> None:
    with pytest.raises(BadInput, match=expected):
        TransportSettings(**arguments)  # type: ignore[arg-type]


def test_a_mesh_must_be_one(tmp_path: Path) -> None:
    settings = TransportSettings(8, kept=12)
    nothing = replace(knot(), positions=np.zeros((0, 3)), normals=np.zeros((0, 3)))
    with pytest.raises(BadInput, match=r"torus knot 2,3: found no vertices, expected a mesh"):
        transport(nothing, matt(), settings, occluder())
    with pytest.raises(BadInput, match="positions or normals that are not finite"):
        transport(replace(knot(), positions=knot().positions * np.nan), matt(), settings, occluder())
    (tmp_path / "file").write_text("x")
    with pytest.raises(BadInput, match="file: found a file, expected a folder for blocks of transport"):
        transport(knot(), matt(), settings, occluder(), tmp_path / "file")
    with pytest.raises(BadInput, match=r"kept: found 2\.5, expected a whole number"):
        TransportSettings(8, kept=2.5)  # type: ignore[arg-type]


def test_light_must_be_light() -> None:
    relit = Relit(whole())
    with pytest.raises(BadInput, match=r"shape \(6, 4, 4, 3\), expected \(6, 8, 8, 3\)"):
        relit.relight(np.ones((6, 4, 4, 3)))
    for bad in (np.nan, -1.0):
        given = light(8)
        given[0, 0, 0, 0] = bad
        with pytest.raises(BadInput, match="negative or not finite"):
            relit.relight(given)
    with pytest.raises(BadInput, match="found a radiance of 1e\\+35, expected at most 1e\\+32"):
        relit.relight(np.full((6, 8, 8, 3), 1e35))
    with pytest.raises(BadInput, match="coefficients: found 0, expected at least 1"):
        relit.step(0)
    with pytest.raises(BadInput, match="expected a point of 3 finite numbers"):
        relit.shade((0.0, np.nan, 1.0))


@pytest.mark.slow
def test_blocks_on_disk_are_mapped_and_bound_the_memory(tmp_path: Path) -> None:
    """With a folder nothing of the long arrays is held; the bits are those of a run without one."""
    mesh = sphere(48)
    around = Occluder(mesh.positions, mesh.triangles)
    settings = TransportSettings(8, kept=384)
    held = transport(mesh, matt(), settings, around)
    traced = []
    for folder in (tmp_path, None):
        tracemalloc.start()
        made = transport(mesh, matt(), settings, around, folder)
        traced.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        for name in ("start", "index", "number", "scale"):
            assert (getattr(made, name) == getattr(held, name)).all()
    said = cost(len(mesh.positions), 1, settings, on_disk=True)
    assert traced[0] < said.peak_bytes < said.disk_bytes
    assert traced[1] > 2 * traced[0]
    assert sum(each.stat().st_size for each in tmp_path.iterdir()) < 1.05 * said.disk_bytes
    assert f"{said.disk_bytes / 1e6:.0f} MB of disk for blocks" in said.describe()
    assert cost(len(mesh.positions), 1, settings).disk_bytes == 0


def test_memory_on_disk_does_not_grow_with_what_is_kept() -> None:
    few, many = (cost(1_000_000, 4, TransportSettings(64, kept=kept), on_disk=True) for kept in (96, 960))
    assert many.most_bytes > 9 * few.most_bytes
    assert many.peak_bytes < 1.1 * few.peak_bytes


@pytest.mark.parametrize("rays", [1, 2])
def test_a_ray_goes_through_half_of_the_texels_of_every_vertex(rays: int) -> None:
    # The other half lies under the vertex's horizon.
    assert cost(10, 1, TransportSettings(16, rays=rays)).rays == 10 * 6 * 16**2 // 2 * rays**2
