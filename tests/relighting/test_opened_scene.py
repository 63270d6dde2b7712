"""A scene that is opened: what stands where, the rules of its file that are followed, its pictures."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from relighting.ball_scene import GROUND, TEXT, read
from relighting_cases import light

from homofact.relighting import build
from homofact.relighting.build import RelightScene, open_relight_scene, relit_objects
from homofact.relighting.picture import picture
from homofact.relighting.precompute import cost
from homofact.relighting.relight import Relit, shaded
from homofact.rendering.light import EnvironmentMap
from homofact.scene.cameras import Camera

pytestmark = pytest.mark.usefixtures("decomposed_once")


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


def test_a_huge_sun_stays_finite(ready: RelightScene) -> None:
    made = relit_objects(ready)[0]
    sky = np.full((6, 8, 8, 3), 1e-3)
    sky[2, 4, 4] = 1e12
    found = shaded(made.transport, made.lit(sky).tuples, (0, 1.5, 3))
    assert np.isfinite(found).all()
