"""The calibration of opinions: scores read, laws fitted and validated by leaving out, on problems of known answer."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import torch
from refusals import refused

from homofact.brdf.analytic import BlinnPhong
from homofact.evaluation.fixed_pictures import study_difference, study_picture
from homofact.evaluation.image_metrics import ciede2000
from homofact.evaluation.opinion import OpinionLaw, StudyLight, digest
from homofact.rendering.fixed_lights import directions_of_map

Script = Callable[[str], ModuleType]
TRUTH = OpinionLaw(0.15, 3.0, 1.7, -0.1, 0.1)


def problem(module: ModuleType, noise: float = 0.0, wrong: bool = False) -> Any:
    """Sixty materials by three methods; with `wrong`, the second of two readings is what method 0 was shown by."""
    dice = np.random.default_rng(5)
    material, method = np.repeat(np.arange(60), 3), np.tile(np.arange(3), 60)
    true = dice.gamma(1.5, 2.0, 180)
    score = module.distances(TRUTH, true)
    score = (score + noise * np.sqrt(score * (1 - score)) * dice.normal(size=180)).clip(0, 1)
    shown = true.copy()
    shown[method == 0] = dice.permutation(shown[method == 0]) if wrong else shown[method == 0]
    family = np.array([f"family {k % 6}" for k in material])
    return module.Judged(material, family, method, score, np.stack((shown, true), 1))


def test_scores_that_are_a_function_of_the_difference_are_foretold_exactly(script: Script) -> None:
    study = script("verdict.opinion_study")
    rows = problem(study)
    law = study.fit_law(rows.differences[:, 1], rows.distance)
    assert (law.floor, law.middle, law.power) == pytest.approx((0.15, 3.0, 1.7), rel=1e-3)
    for groups in (rows.material, rows.family, rows.method):
        found = study.left_out(rows, groups)
        np.testing.assert_allclose(found.distance, rows.distance, atol=1e-4)
        assert study.rank_correlation(found.distance, rows.distance) == pytest.approx(1)


def test_intervals_of_left_out_materials_cover_at_their_rate(script: Script) -> None:
    study = script("verdict.opinion_study")
    rows = problem(study, noise=0.15)
    found = study.left_out(rows, rows.material)
    covered = ((rows.distance >= found.low) & (rows.distance <= found.high)).mean()
    assert 0.83 <= covered <= 0.95
    assert (found.low < found.distance).all()
    assert (found.distance < found.high).all()


def test_the_reading_is_chosen_by_the_rows_that_stay(script: Script) -> None:
    study = script("verdict.opinion_study")
    rows = problem(study, wrong=True)
    assert rows.variant() == 1
    found = study.left_out(rows, rows.material)
    assert study.rank_correlation(found.distance, rows.distance) == pytest.approx(1)
    # Rows alike in all readings choose none.
    assert rows.part(rows.method > 0).variant() == 0


def test_a_left_out_group_has_no_part_in_its_law(script: Script) -> None:
    study = script("verdict.opinion_study")
    rows = problem(study)
    spoilt = study.Judged(*(getattr(rows, name) for name in ("material", "family", "method")),
                          np.where(rows.material == 7, 1 - rows.distance, rows.distance), rows.differences)  # fmt: skip
    before, after = (study.left_out(each, each.material) for each in (rows, spoilt))
    own = rows.material == 7
    np.testing.assert_array_equal(before.distance[own], after.distance[own])
    assert (before.distance[~own] != after.distance[~own]).any()


def test_the_noise_of_thirty_people_bounds_the_rank_correlation(script: Script) -> None:
    study = script("verdict.opinion_study")
    wide, narrow = (study.noise_bound(np.linspace(*ends, 100), 1) for ends in ((0.05, 0.95), (0.15, 0.2)))
    assert 0.9 < wide < 1
    assert narrow < 0.5


@pytest.mark.slow
def test_an_interval_of_a_rank_correlation_holds_it(script: Script) -> None:
    study = script("verdict.opinion_study")
    rows = problem(study, noise=0.15)

    def measure(draw: np.ndarray) -> float:
        return study.rank_correlation(rows.differences[draw, 0], rows.distance[draw])

    low, high = study.resampled(measure, rows.material, 3)
    assert low < measure(np.arange(180)) < high
    assert (low, high) == study.resampled(measure, rows.material, 3)


def test_scores_are_read_by_method_and_material(script: Script, tmp_path: Path) -> None:
    study = script("verdict.opinion_study")
    file = tmp_path / "scores.csv"
    text = '"METHOD";"BRDF";"DISTANCE"\n"SGD";"alum-bronze";0.25\n"ABC";"two_layer-gold";1\n'
    file.write_text(text, encoding="utf-8")
    assert study.read_distances(file) == {("SGD", "alumbronze"): 0.25, ("ABC", "twolayergold"): 1.0}
    for text in ("METHOD,BRDF\n", "METHOD;BRDF;DISTANCE\nSGD;a\n", "METHOD;BRDF;DISTANCE\nSGD;a;1.5\n", "\n"):
        file.write_text(text, encoding="utf-8")
        with refused():
            study.read_distances(file)
    names = {"alum-bronze": "metals", "blue_metallic_paint": "metallic paints", "pink-jasper": "others",
             "specular-red-phenolic": "phenolics", "cherry-235": "woods", "dark-blue-paint": "paints"}  # fmt: skip
    assert {name: study.family_of(name) for name in names} == names


def test_lamps_are_fitted_to_a_light_of_lamps(script: Script) -> None:
    module = script("verdict.opinions")
    lamp = torch.tensor([[0.6, 0.48, 0.64, 20.0, 4.0, 2.0, 1.0]]).double()
    light = StudyLight(torch.tensor([0.2, 0.1, 0.1]).double(), lamp, 0.3)
    found = module.fit_lamps(light.radiance(directions_of_map(64)), 1, 600)
    torch.testing.assert_close(found.even, light.even, rtol=0.02, atol=0)
    torch.testing.assert_close(found.lamps, light.lamps, rtol=0.02, atol=0)


def test_the_table_states_what_it_was_made_from(script: Script) -> None:
    module, study = script("verdict.opinions"), script("verdict.opinion_study")
    rows = problem(study)
    light = StudyLight(torch.ones(3).double(), torch.ones(1, 7).double(), 0.3)
    made = module.made_table(rows, light)
    assert made["sha256"] == digest(made)
    assert made["law"]["floor"] == pytest.approx(0.15, rel=1e-3)
    assert made["made_from"]["rows"] == 180


def test_without_the_scores_the_script_says_so(
    script: Script, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert script("verdict.opinions").main(["--short", "--data", str(tmp_path)]) == 2
    assert "distances.csv" in capsys.readouterr().err


def test_a_sphere_in_pixels_is_the_one_at_places(script: Script) -> None:
    """Mean CIEDE2000 of two materials, by rings and azimuths and by the package's places."""
    spheres = script("verdict.opinion_pictures").Spheres()
    models = [BlinnPhong((0.2, 0.1, 0.1), (level,) * 3, exponent=20) for level in (0.3, 0.2)]
    found = ciede2000(spheres.draw(models[0]), spheres.draw(models[1]), spheres.mask)
    expected = study_difference(study_picture(models[0]), study_picture(models[1]))
    assert found == pytest.approx(expected, rel=0.05)
