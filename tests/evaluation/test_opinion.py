"""The law of opinions, its table, the pictures that it is asked with, and CIEDE2000 beside a colour library."""

import json
import math
from pathlib import Path

import colour
import numpy as np
import pytest
import torch
from refusals import refused

from homofact.brdf.analytic import Lambert, Ward
from homofact.brdf.cielab import ciede2000, lab_of_srgb
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import Source
from homofact.evaluation.appearance import appearance
from homofact.evaluation.fixed_pictures import PLACES, sphere_nodes, study_difference, study_picture
from homofact.evaluation.means import mean_record
from homofact.evaluation.metric_table import LIGHT
from homofact.evaluation.opinion import TABLE, UNSEEN, VERSION, OpinionLaw, digest, opinion_table
from homofact.rendering.sphere import SphereImage

LAW = OpinionLaw(0.15, 4.0, 2.0, -0.2, 0.3)
SOURCE = Ward((0.2, 0.1, 0.05), (0.1,) * 3, 0.1, 0.1)
# Sharma, Wu and Dalal 2005, table 1: pairs 1, 4, 7, 9, 10, 13, 17, 20, 25 and 34.
SHARMA = (
    ((50.0, 2.6772, -79.7751), (50.0, 0.0, -82.7485), 2.0425),
    ((50.0, -1.3802, -84.2814), (50.0, 0.0, -82.7485), 1.0),
    ((50.0, 0.0, 0.0), (50.0, -1.0, 2.0), 2.3669),
    ((50.0, 2.49, -0.001), (50.0, -2.49, 0.0009), 7.1792),
    ((50.0, 2.49, -0.001), (50.0, -2.49, 0.0010), 7.1792),
    ((50.0, -0.001, 2.49), (50.0, 0.0009, -2.49), 4.8045),
    ((50.0, 2.5, 0.0), (50.0, 0.0, -2.5), 4.3065),
    ((50.0, 2.5, 0.0), (56.0, -27.0, -3.0), 31.9030),
    ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
    ((2.0776, 0.0795, -1.1350), (0.9033, -0.0636, -0.5514), 0.9082),
)


def difference(source: Reflectance, fit: Reflectance) -> float:
    return study_difference(study_picture(source), study_picture(fit))


def test_ciede2000_is_that_of_the_published_pairs_and_of_a_colour_library() -> None:
    first, second, expected = (np.array(part) for part in zip(*SHARMA, strict=True))
    np.testing.assert_allclose(ciede2000(first, second), expected, atol=6e-5)
    np.testing.assert_allclose(ciede2000(second, first), expected, atol=6e-5)
    dice = np.random.default_rng(0)
    pictures = dice.random((2, 2000, 3))
    pictures[0, :3], pictures[1, :2], pictures[0, 3], pictures[1, 4] = 0.5, 0.2, 0.0, 1.0
    labs = [
        colour.XYZ_to_Lab(colour.sRGB_to_XYZ(each), colour.RGB_COLOURSPACES["sRGB"].whitepoint) for each in pictures
    ]
    for lab, each in zip(labs, pictures, strict=True):
        np.testing.assert_allclose(lab_of_srgb(each), lab, atol=1e-10)
    np.testing.assert_allclose(ciede2000(*labs), colour.delta_E(*labs, method="CIE 2000"), atol=1e-10)


def test_a_larger_difference_is_graded_worse() -> None:
    differences = np.linspace(0, 40, 200)
    opinions = [LAW.opinion(float(each)) for each in differences]
    assert opinions[0].score == opinions[0].best == pytest.approx(5 - 4 * 0.15)
    for name in ("score", "low", "high"):
        steps = np.diff([getattr(each, name) for each in opinions if each.low > 1 and each.delta_e > 2])
        assert (steps < 0).all()
    assert all(1 <= each.low <= each.score <= each.high <= 5 for each in opinions)
    assert LAW.opinion(math.inf).score == 1
    assert LAW.opinion(4.0).score == pytest.approx(5 - 4 * (0.15 + 0.85 / 2))


def test_the_interval_is_that_of_the_residuals() -> None:
    found = LAW.opinion(4.0)
    expected = 0.15 + 0.85 / 2
    scatter = math.sqrt(expected * (1 - expected))
    assert found.low == pytest.approx(5 - 4 * (expected + 0.3 * scatter))
    assert found.high == pytest.approx(5 - 4 * (expected - 0.2 * scatter))
    assert LAW.interval(found.score) == pytest.approx((found.low, found.high))


def test_what_is_unseen_costs_a_fifth_of_a_grade() -> None:
    assert LAW.opinion(LAW.unseen).score == pytest.approx(LAW.opinion(0.0).score - UNSEEN)
    assert 0 < opinion_table().law.unseen < 2


@pytest.mark.parametrize(
    "numbers", [(1.0, 4, 2, -0.1, 0.1), (0.1, 0, 2, -0.1, 0.1), (0.1, 4, -1, -0.1, 0.1), (0.1, 4, 2, 0.1, 0.2)]
)
def test_a_law_that_does_not_rise_is_refused(numbers: tuple[float, ...]) -> None:
    with refused(where="law of opinions"):
        OpinionLaw(*numbers)


def test_no_difference_is_negative() -> None:
    for value in (-1.0, math.nan):
        with refused(where="ΔE"):
            LAW.distance(value)


def test_the_package_s_table_is_what_its_hash_states() -> None:
    stored = json.loads(TABLE.read_text(encoding="utf-8"))
    assert stored["version"] == VERSION
    assert stored["sha256"] == digest(stored)
    table = opinion_table()
    assert table.made_from["rows"] == 300
    assert 0.1 < table.law.floor < 0.2
    assert table.law.below < 0 < table.law.above
    # No scores: the law, the lamps, and what they were made from.
    assert set(stored) == {"version", "law", "light", "made_from", "sha256"}
    lengths = table.light.lamps[:, :3].norm(dim=1)
    torch.testing.assert_close(lengths, torch.ones_like(lengths), atol=1e-4, rtol=0)


def test_a_damaged_table_is_refused(tmp_path: Path) -> None:
    stored = json.loads(TABLE.read_text(encoding="utf-8"))
    changed = {"law": {**stored["law"], "floor": 0.2}}
    for name, content in {
        "version": stored | {"version": VERSION + 1},
        "hash": stored | changed,
        "half": {"version": VERSION},
    }.items():
        path = tmp_path / f"{name}.json"
        path.write_text(json.dumps(content), encoding="utf-8")
        with refused(where=f"{name}.json"):
            opinion_table(path)
    path = tmp_path / "text.json"
    path.write_text("no table", encoding="utf-8")
    for place in (path, tmp_path / "none.json"):
        with refused(where=place.name):
            opinion_table(place)


def test_the_light_is_even_and_lamps() -> None:
    light = opinion_table().light
    towards = light.lamps[:1, :3] / light.lamps[:1, :3].norm()
    alone = type(light)(light.even, light.lamps[:1], light.white)
    torch.testing.assert_close(alone.radiance(towards)[0], light.even + light.lamps[0, 4:], rtol=1e-3, atol=0)
    # e to the power of −κ of the way round.
    across = torch.linalg.cross(towards, torch.tensor([[0.3, 0.5, -0.2]]).double())
    across = across / across.norm()
    fallen = light.even + light.lamps[0, 4:] * math.exp(-float(light.lamps[0, 3]))
    torch.testing.assert_close(alone.radiance(across)[0], fallen, rtol=1e-3, atol=1e-12)


def test_a_white_sphere_is_as_bright_as_the_table_states() -> None:
    table = opinion_table()
    white = study_picture(Lambert((1.0,) * 3))
    nodes = sphere_nodes()
    irradiance = (table.light.radiance(nodes.world) * nodes.weights[..., None]).sum(1)
    torch.testing.assert_close(white.radiance[0], irradiance / math.pi)
    assert white.radiance.shape == (1, PLACES, 3)
    # A grey of half is told from white, and what is far above white is clipped.
    grey, bright = (study_picture(Lambert((level,) * 3)) for level in (0.5, 1000.0))
    assert study_difference(white, grey) > 10
    assert study_difference(bright, SphereImage(bright.radiance * 2, bright.coverage)) < 1


def test_people_grade_identical_pictures_best_and_faults_by_their_size() -> None:
    fits = [Ward((0.2, 0.1, 0.05), (0.1 * loss,) * 3, 0.1, 0.1) for loss in (1.0, 0.97, 0.8, 0.4, 0.0)]
    found = [difference(SOURCE, fit) for fit in fits]
    assert found[0] == 0
    assert found == sorted(found)
    assert found[1] > 0
    source = Source("model", "material", sample_model(SOURCE, 50), SOURCE, 1e-5, 0.0)
    seen = [appearance(fit, source) for fit in fits]
    grades = [each.score for each in seen if each is not None]
    assert grades == sorted(grades, reverse=True)
    assert grades[0] == opinion_table().law.opinion(0.0).best
    record = seen[2].record() if seen[2] is not None else {}
    assert record["delta_e_study"] == found[2]
    assert record["opinion_low"] < record["opinion"] < record["opinion_high"] < 5


def test_grey_and_spectral_materials_are_graded_too() -> None:
    grey = [Lambert((level,), channels=("Y",)) for level in (0.3, 0.2)]
    colourful = [Lambert((level,) * 3) for level in (0.3, 0.2)]
    assert difference(*grey) == pytest.approx(difference(*colourful))
    names = tuple(f"{nm}nm" for nm in range(400, 701, 20))
    spectra = [Lambert((level,) * len(names), channels=names) for level in (0.3, 0.2)]
    assert difference(*spectra) == pytest.approx(difference(*grey), rel=0.05)


def test_several_seeds_have_the_grade_of_their_mean_difference() -> None:
    law = opinion_table().law

    def record(delta_e: float) -> dict[str, object]:
        own = {name: {"a": 1.0} for name in ("train", "held_out")}
        seen = dict.fromkeys(("rms", "opinion")) | law.opinion(delta_e).record()
        return {
            "error": own, "seconds": {"fit": 1.0}, "evaluations": 1, "bytes": 1, "fetches": 1, "status": "", "seed": 0,
            "appearance": dict.fromkeys(LIGHT) | seen,
        }  # fmt: skip

    found = mean_record([record(1.0), record(3.0)], (0, 1), (0,))["appearance"]
    assert found["delta_e_study"] == 2.0
    assert found["opinion"] == law.opinion(2.0).score
    assert (found["opinion_low"], found["opinion_high"]) == law.interval(found["opinion"])
