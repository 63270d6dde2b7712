"""What plans are measured on: nodes that stand for a sphere's disc, highlights, distance, errors of pictures."""

import math

import pytest
import torch
from torch import Tensor

from homofact.brdf.analytic import BlinnPhong
from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import Source
from homofact.errors import BadInput
from homofact.planning.ladder import FitOptions
from homofact.planning.measure import Picture, RepresentationEvaluator, exposure, picture_errors, quantile
from homofact.planning.stage import SphereView, Stage, drawn_views, spots
from homofact.planning.tolerance import KINDS, MARGINS, WORDS, Errors, Tolerance
from homofact.rendering.light import DirectionalLight, EnvironmentMap
from homofact.rendering.sphere import render_sphere
from homofact.scene.lighting import Lighting, named_lighting

QUICK = FitOptions(effort=10, count=400)
# 1000 times as sharp as a pixel of a small picture.
SHARP = BlinnPhong((0.2, 0.2, 0.2), (0.3, 0.3, 0.3), exponent=20000)
BLUNT = BlinnPhong((0.2, 0.2, 0.2), (0.3, 0.3, 0.3), exponent=8000)


def source_of(model: BlinnPhong | Lambert) -> Source:
    return Source("own", "material", sample_model(model, 400), model, 1e-5, 0.0)


def reflected(nodes: int, pixels: int | None = None, light: str = "sun") -> float:
    judge = RepresentationEvaluator(source_of(SHARP), Stage.of(named_lighting(light), nodes=nodes), QUICK, pixels)
    return judge.errors(BLUNT, ("reflected",)).reflected


def test_the_nodes_stand_for_the_disc() -> None:
    for name in ("sun", "studio"):
        for view in Stage.of(named_lighting(name)).views:
            assert float(view.weights.sum()) == pytest.approx(1)
            # ∫ cosθo over the disc is 2/3, and the picture is centred.
            assert float((view.weights * view.wo[:, 2]).sum()) == pytest.approx(2 / 3, rel=0.01)
            assert float((view.weights[:, None] * view.places).sum(0).abs().max()) < 0.01
            torch.testing.assert_close(view.normals.norm(dim=1), torch.ones(len(view.normals), dtype=torch.float64))


def test_a_highlight_has_its_energy_whatever_the_number_of_nodes() -> None:
    """Against a picture of 1200 pixels; at 36 its square is luck of the pixel."""
    light = DirectionalLight((0.5, 0.5, math.sqrt(0.5)))
    picture = render_sphere(SHARP, light, 1200)
    share = picture.coverage / picture.coverage.sum()
    whole = [float((share[..., None] * picture.radiance**power).sum()) for power in (1, 2)]
    for nodes in (300, 600):
        lighting = Lighting("lamp", (light,))
        view = SphereView.of((0.0, 0.0, 1.0), lighting, nodes)
        drawn = Stage(lighting, (view,)).draw(SHARP)[0]
        found = [float((view.weights[:, None] * drawn**power).sum()) for power in (1, 2)]
        assert found == pytest.approx(whole, rel=0.03)


def test_reflected_under_the_sun_does_not_depend_on_the_number_of_pixels() -> None:
    """As many nodes as pictures of 36, 37 and 48 pixels have pixels on the sphere."""
    found = [reflected(round(math.pi / 4 * (0.94 * pixels) ** 2)) for pixels in (36, 37, 48)]
    assert max(found) / min(found) < 1.02
    assert found[0] > 0.3


def test_from_afar_an_error_changes_smoothly_with_the_pixels() -> None:
    """A highlight narrower than a pixel may fall on one of them or on four."""
    found = [reflected(400, pixels) for pixels in (36, 37, 48)]
    assert found[1] / found[0] == pytest.approx(1, abs=0.06)
    assert 1 < found[2] / found[0] < 1.5


def test_from_afar_a_highlight_is_blurred_and_less_of_it_is_needed() -> None:
    errors = [reflected(600, pixels) for pixels in (None, 100, 20, 6)]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < errors[0] / 3


def test_blurring_keeps_the_light() -> None:
    view = Stage.of(named_lighting("sun"), views=1).views[0]
    radiance = torch.rand(len(view.weights), 3, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    near = (view.weights[:, None] * radiance).sum(0)
    for pixels in (2, 9, 50):
        seen, weights = view.blurred(radiance, pixels)
        assert len(weights) <= 4 * (pixels + 1) ** 2
        torch.testing.assert_close((weights[:, None] * seen).sum(0), near)


def test_small_suns_in_a_map_are_found() -> None:
    pixels = torch.full((32, 64, 1), 0.01, dtype=torch.float64)
    assert spots(Lighting("sky", (EnvironmentMap(pixels),))) == []
    pixels[10, 48] = 1000.0
    found = spots(Lighting("sky", (EnvironmentMap(pixels),)))
    assert len(found) == 1
    assert float(found[0][0]) > 0.5 < float(found[0][1]) + 0.2
    assert len(spots(named_lighting("sun"))) == 1


def test_views_are_drawn_by_their_seed_and_lie_all_round() -> None:
    assert drawn_views(8, 3) == drawn_views(8, 3) != drawn_views(8, 4)
    for seed in range(5):
        w = torch.tensor(drawn_views(8, seed), dtype=torch.float64)
        torch.testing.assert_close(w.norm(dim=1), torch.ones(8, dtype=torch.float64))
        assert float(w.sum(0).norm()) < 0.8
        nearest = (w @ w.T - 2 * torch.eye(8, dtype=torch.float64)).max(1).values
        assert float(nearest.max()) < math.cos(math.radians(40))


def test_overlapping_lamps_share_their_nodes() -> None:
    lamps = tuple(DirectionalLight((x, 0.5, 0.7)) for x in (0.5, 0.4, 0.0))
    view = SphereView.of((0.0, 0.0, 1.0), Lighting("lamps", lamps))
    # Within 8° of where the first is mirrored, the share of the disc is that of a cap.
    half = lamps[0].unit() + torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)
    half = half / half.norm()
    inside = view.normals @ half > math.cos(math.radians(8))
    assert float(view.weights[inside].sum()) == pytest.approx(math.sin(math.radians(8)) ** 2 * float(half[2]), rel=0.1)


def test_what_is_not_finite_is_infinitely_wrong_and_darkness_is_refused() -> None:
    class Broken:
        channels = ("R", "G", "B")
        nbytes = fetches = 0

        def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
            return torch.full((len(wi), 3), math.nan, dtype=torch.float64)

    judge = RepresentationEvaluator(source_of(SHARP), Stage.of(named_lighting("sun")), QUICK)
    broken: Reflectance = Broken()
    assert judge.errors(broken) == Errors(*(math.inf,) * len(KINDS))
    black = RepresentationEvaluator(source_of(Lambert((0.0, 0.0, 0.0))), Stage.of(named_lighting("sun")), QUICK)
    with pytest.raises(BadInput, match="own reflects none of sun, expected some light"):
        black.errors(SHARP, ("reflected",))


def test_errors_of_pictures() -> None:
    weights = torch.tensor([0.7, 0.2, 0.1], dtype=torch.float64)
    one = Picture(torch.tensor([[0.2], [0.4], [0.8]], dtype=torch.float64), weights)
    other = Picture(torch.tensor([[0.2], [0.4], [0.4]], dtype=torch.float64), weights)
    found = picture_errors([one], [other], 1.0, KINDS[1:])
    lost, whole = 0.1 * 0.16, 0.7 * 0.04 + 0.2 * 0.16 + 0.1 * 0.64
    assert found["reflected"] == pytest.approx(math.sqrt(lost / whole))
    assert found["delta_e"] == pytest.approx(0.1 * found["delta_e_peak"])
    assert found["delta_e_p95"] == found["delta_e_peak"] > 10
    # Of several views the worst, but of the light all together.
    both = picture_errors([one, one], [one, other], 1.0, KINDS[1:])
    assert both["delta_e"] == found["delta_e"]
    assert both["reflected"] == pytest.approx(found["reflected"] / math.sqrt(2))
    # A dim view counts as much as a bright one.
    dim = [Picture(each.radiance / 100, weights) for each in (one, other)]
    assert picture_errors([one, dim[0]], [one, dim[1]], 1.0, ("reflected",)) == {"reflected": both["reflected"]}
    assert set(picture_errors([one], [other], 1.0, ("delta_e_p95",))) == {"delta_e_p95"}
    assert exposure([one]) == pytest.approx(0.9 / 0.8)


def test_quantiles_go_by_weight() -> None:
    values = torch.tensor([3.0, 1.0, 2.0], dtype=torch.float64)
    weights = torch.tensor([0.1, 0.6, 0.3], dtype=torch.float64)
    assert [quantile(values, weights, part) for part in (0.5, 0.85, 0.95, 1.0)] == [1.0, 2.0, 3.0, 3.0]


def test_a_tolerance_is_used_by_its_worst_kind_with_the_margin() -> None:
    tolerance = Tolerance.of(delta_e=2.0, reflected=0.1)
    used = tolerance.used(Errors(delta_e=1.0, reflected=0.09))
    assert (used.kind, used.error) == ("reflected", 0.09)
    assert used.ratio == pytest.approx(0.9 * MARGINS["reflected"])
    assert tolerance.describe() == "mean ΔE at most 2 and error of reflected light at most 0.1"
    assert not Tolerance.of(cole=0.1).of_light
    assert set(MARGINS) == set(KINDS) == set(WORDS)
