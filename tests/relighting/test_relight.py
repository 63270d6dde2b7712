"""Light and view changes, clusters, the ledger: against the dense sum, and against each other."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from relighting_cases import EYE, MATT, SHINY, knot, light, matt, occluder, shiny, whole
from relit_errors import errors_of

from homofact.brdf.analytic import Lambert
from homofact.errors import BadInput
from homofact.meshes.occlusion import Occluder
from homofact.meshes.shapes import sphere
from homofact.relighting.clusters import Clustered, clustered
from homofact.relighting.cube import environment_cube
from homofact.relighting.errors import STAGES, relative
from homofact.relighting.factoring import factor
from homofact.relighting.light_kernels import add_columns
from homofact.relighting.precompute import TransportSettings, transport
from homofact.relighting.relight import Relit
from homofact.relighting.seen import SeenVertices, seen_vertices, vertex_areas
from homofact.rendering.light import EnvironmentMap

SMALL = TransportSettings(8, kept=384)


def seen(most: int | None = 40) -> SeenVertices:
    return seen_vertices(knot(), SHINY, occluder(), EYE, most)


def test_everything_kept_is_the_dense_sum_of_the_factors() -> None:
    relit = Relit(whole())
    relit.relight(light(8))
    those = seen()
    dense = those.dense(light(8), 8, shiny())
    assert relative(relit.shade(EYE)[those.which], dense) < 5e-4


def test_more_terms_come_closer_to_the_material() -> None:
    those = seen()
    truth = those.dense(light(8), 8)
    errors = []
    for terms in (1, 3, 6):
        made = transport(knot(), shiny().first(terms), TransportSettings(8, kept=384), occluder())
        relit = Relit(made)
        relit.relight(light(8))
        errors.append(relative(relit.shade(EYE)[those.which], truth))
    assert errors[0] > 2 * errors[2]
    assert errors == sorted(errors, reverse=True)


def test_relighting_is_linear_in_the_light() -> None:
    relit = Relit(whole())
    found = []
    for given in (light(8, 0), light(8, 1), light(8, 0) + 3 * light(8, 1)):
        relit.relight(given)
        found.append(relit.tuples.copy())
    assert found[2] == pytest.approx(found[0] + 3 * found[1], rel=1e-3, abs=1e-4)


def test_a_change_comes_in_piece_by_piece_and_ends_exactly() -> None:
    relit, other = Relit(whole()), Relit(whole())
    relit.relight(light(8, 0))
    other.relight(light(8, 1))
    relit.ask(light(8, 1))
    distances = [np.abs(relit.tuples - other.tuples).max()]
    left = 1
    while left:
        left = relit.step(40)
        distances.append(float(np.abs(relit.tuples - other.tuples).max()))
    assert (relit.tuples == other.tuples).all()
    # The largest come first: a tenth of the coefficients brings near half of the way.
    assert distances[1] < 0.6 * distances[0]
    assert relit.step(40) == 0
    # Asked for another light on the way, it goes there.
    relit.ask(light(8, 0))
    relit.step(40)
    relit.ask(light(8, 1))
    while relit.step(100):
        pass
    assert (relit.tuples == other.tuples).all()


def test_steps_before_the_end_are_sums_of_what_is_in() -> None:
    relit = Relit(whole())
    relit.relight(light(8, 0))
    relit.ask(light(8, 1))
    assert relit.step(100) == 6 * 64 - 100
    mixed = relit._light
    fresh = Relit(whole())
    fresh._light = mixed
    fresh._sum()
    assert relit.tuples == pytest.approx(fresh.tuples, rel=1e-3, abs=2e-4)


def test_one_channel_is_grey_and_from_behind_nothing_is_seen() -> None:
    colour, grey = (
        Relit(transport(knot(), factor(Lambert((0.5,) * count, channels=names), 1, map_size=8), SMALL, occluder()))
        for count, names in ((3, ("R", "G", "B")), (1, ("Y",)))
    )
    for each in (colour, grey):
        each.relight(light(8))
    found = grey.shade(EYE)
    assert found == pytest.approx(colour.shade(EYE), rel=1e-4)
    facing = ((np.array(EYE) - knot().positions) * knot().normals).sum(1)
    assert (found[facing < 0] == 0).all()
    assert (found[facing > 0.1].sum(1) > 0).all()


def test_rows_in_parts_are_each_changed_once() -> None:
    """As threads share them: a row at a border belongs to one part alone."""
    relit = Relit(whole())
    start, rows, values, _ = relit._columns
    change = np.random.default_rng(6).normal(size=(6 * 64, 3)).astype(np.float32)
    chosen, once, parts = np.arange(6 * 64), *np.zeros((2, len(whole().scale), 3), np.float32)
    add_columns(chosen, start, rows, values, change, 0, len(once), once)
    for first, last in ((0, 1), (1, 500), (500, 501), (501, len(parts))):
        add_columns(chosen, start, rows, values, change, first, last, parts)
    assert (parts == once).all()
    assert once.any(1).all()


def test_turning_the_light_and_the_knot_together_changes_nothing() -> None:
    """A quarter turn takes the cube map's texels onto each other, and an isotropic material does not notice."""
    rng = np.random.default_rng(3)
    radiance = torch.from_numpy(rng.uniform(0, 1, (64, 128, 3)) ** 4)
    radiance[18:24, 70:76] = 40
    sky = EnvironmentMap(radiance)
    quarter = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    mesh = knot()
    turned = replace(mesh, positions=mesh.positions @ quarter.T, normals=mesh.normals @ quarter.T)
    made = transport(turned, shiny(), TransportSettings(8, kept=384), Occluder(turned.positions, turned.triangles))
    here, there = Relit(whole()), Relit(made)
    here.relight(sky)
    there.relight(sky.turned(math.pi / 2))
    eye = np.array(EYE)
    assert relative(there.shade(quarter @ eye), here.shade(eye)) < 0.02
    there.relight(sky.turned(-math.pi / 2))
    assert relative(there.shade(quarter @ eye), here.shade(eye)) > 0.1


def test_clusters_hold_transport_ever_better() -> None:
    relit = Relit(whole())
    relit.relight(light(8))
    exact, errors = relit.shade(EYE), []
    for count, components in ((1, 2), (4, 4), (8, 12)):
        compact = clustered(whole(), components, 384, count)
        basis = Relit(compact.basis)
        basis.relight(light(8))
        relit.tuples = compact.mixed(basis.tuples)
        errors.append(relative(relit.shade(EYE), exact))
        assert compact.nbytes > compact.weights.nbytes
        assert len(compact.steps) <= count
    assert errors == sorted(errors, reverse=True)
    assert errors[2] < 0.12 < errors[0] / 2


def test_as_many_components_as_vertices_are_exact() -> None:
    compact = clustered(whole(), 191, 384, 1)
    basis, relit = Relit(compact.basis), Relit(whole())
    basis.relight(light(8))
    relit.relight(light(8))
    assert relative(compact.mixed(basis.tuples), relit.tuples) < 0.01


def test_equal_seed_equal_clusters() -> None:
    first, second, other = (clustered(whole(), 4, 64, 4, seed) for seed in (0, 0, 1))
    assert (first.cluster == second.cluster).all()
    assert (first.weights == second.weights).all()
    assert (first.basis.number == second.basis.number).all()
    assert not (len(first.steps) == len(other.steps) and (first.cluster == other.cluster).all())


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ((0, 10, 1), "components: found 0, expected 1 to 192"),
        ((193, 10, 1), "components: found 193, expected 1 to 192"),
        ((4, 0, 1), "kept: found 0, expected 1 to 384"),
        ((4, 10, 193), "clusters: found 193, expected 1 to 192"),
    ],
)
def test_numbers_of_clusters_that_are_no_choice(arguments: tuple[int, int, int], expected: str) -> None:
    with pytest.raises(BadInput, match=expected):
        clustered(whole(), *arguments)


def sky() -> EnvironmentMap:
    rng = np.random.default_rng(5)
    radiance = torch.from_numpy(rng.uniform(0.1, 1, (32, 64, 3)))
    radiance[8, 30] = 100
    return EnvironmentMap(radiance)


@pytest.mark.slow
def test_the_ledger_names_each_stage_by_itself() -> None:
    made = transport(knot(), shiny(), TransportSettings(8, kept=24), occluder())
    compact = clustered(made, 4, 100, 3)
    those = seen(12)
    found = errors_of(those, made, compact, sky())
    absent = {"harmonics", "normals", "lobe", "suns", "lamps", "bounce", "rim", "picture"}
    assert set(found.errors) == set(STAGES) - absent
    assert found.vertices == 12
    assert found.errors["truncation"] > 1e-3
    assert found.errors["quantisation"] < 0.2 * found.errors["truncation"]
    assert 0 < found.errors["maps"] < 0.05
    assert found.errors["clusters"] > 0.01
    # Together is no sum, but not less than half of the largest of its stages.
    largest = max(found.errors[each] for each in ("terms", "truncation", "clusters"))
    assert found.errors["together"] > 0.5 * largest
    # With everything kept and no clusters only terms and maps are left.
    exact = errors_of(those, whole(), None, sky(), ("terms", "truncation", "together"))
    assert exact.errors["truncation"] < 1e-4
    assert exact.errors["together"] == pytest.approx(exact.errors["terms"], rel=0.1)


def test_stages_without_transport_are_what_they_say() -> None:
    """The cube map's against one of four times as many texels; nothing that is hidden from the eye is asked."""
    those = seen(12)
    found = errors_of(those, whole(), None, sky(), ("cube",))
    coarse, fine = (those.dense(environment_cube(sky(), size), size) for size in (8, 32))
    assert found.errors == {"cube": pytest.approx(relative(coarse, fine))}
    every = seen(None).which
    towards = np.array(EYE) - knot().positions
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    hidden = occluder().blocked(knot().positions + occluder().offset * knot().normals, towards)
    along = (towards * knot().normals).sum(1)
    assert not hidden[every].any()
    assert (along[every] > 0).all()
    # Missing are those alone whose every triangle is turned away.
    missing = set(np.flatnonzero((along > 0) & ~hidden)) - set(every.tolist())
    assert (vertex_areas(knot(), np.array(EYE))[sorted(missing)] == 0).all()
    assert ((along > 0) & hidden).any()


def test_between_vertices_light_is_mixed_from_all_corners() -> None:
    """On a ball under a smooth sky the mix of three corners is off by 1.4%; one of them would be by 6%."""
    mesh = sphere(16)
    around = Occluder(mesh.positions, mesh.triangles)
    made = transport(mesh, matt(), TransportSettings(8, kept=384), around)
    smooth = EnvironmentMap(torch.linspace(2, 0, 16, dtype=torch.float64)[:, None, None].expand(16, 32, 1))
    those = seen_vertices(mesh, MATT, around, EYE, 40)
    assert errors_of(those, made, None, smooth, ("interpolation",)).errors["interpolation"] < 0.04


def test_clusters_are_part_of_all_together() -> None:
    made = transport(knot(), shiny(), TransportSettings(8, kept=64), occluder())
    compact, those = clustered(made, 1, 40, 2), seen(12)
    rough = errors_of(those, made, compact, sky(), ("together", "clusters"))
    fine = errors_of(those, made, None, sky(), ("together",))
    assert rough.errors["clusters"] > 0.1
    assert rough.errors["together"] > 1.2 * fine.errors["together"]


def test_light_below_zero_is_a_share_of_all_light() -> None:
    """Half of the view maps of the wrong sign: what is below zero is counted against what is on both sides."""
    wrong = shiny().view.copy()
    wrong[1:] *= -3
    made = replace(whole(), factors=replace(shiny(), view=wrong))
    found = errors_of(seen(40), made, None, sky(), ("together",))
    relit = Relit(made)
    relit.relight(sky())
    shown = relit.shade(EYE)[seen(40).which]
    assert (shown < 0).mean() > 0.02
    assert found.below_zero == pytest.approx(np.maximum(-shown, 0).sum() / np.abs(shown).sum(), rel=1e-3)


def test_light_below_zero_is_measured() -> None:
    found = errors_of(seen(40), whole(), None, sky(), ("together",))
    relit = Relit(whole())
    relit.relight(sky())
    shown = relit.shade(EYE)[seen(40).which]
    assert found.below_zero == pytest.approx(np.maximum(-shown, 0).sum() / np.abs(shown).sum(), rel=1e-3, abs=1e-9)


def test_what_cannot_be_judged_is_refused() -> None:
    with pytest.raises(BadInput, match="stage: found 'colour', expected one of terms, maps"):
        errors_of(seen(4), whole(), None, sky(), ("colour",))
    mesh = sphere(8)
    around = Occluder(mesh.positions, mesh.triangles)
    with pytest.raises(BadInput, match=r"no vertex is seen from \(0\.0, 0\.0, 0\.0\)"):
        seen_vertices(mesh, SHINY, around, (0, 0, 0), 5)


def test_each_cluster_has_steps_of_its_own() -> None:
    lit = np.zeros((4, 1, 3))
    lit[:, 0, 0] = (10, 1, 20, 1)  # two clusters: a mean and a component each
    parts = {"cluster": np.array([0, 1, 1]), "weights": np.array([[3], [3], [-2]]), "steps": np.array([[0.5], [2.0]])}
    unused: Any = None
    found = Clustered(unused, unused, unused, unused, **parts).mixed(lit)
    assert found[:, 0, 0].tolist() == [10 + 1.5, 20 + 6, 20 - 4]
