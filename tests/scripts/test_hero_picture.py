"""The picture that the README opens with: what it needs, and that its parts are where they should be."""

import importlib
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import torch

from homofact.rendering.light import EnvironmentMap
from homofact.rendering.sphere import SphereImage


@pytest.fixture
def hero(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    return importlib.import_module("scripts.pictures.hero_picture")


def test_without_the_measurements_it_says_which_file_is_missing(
    hero: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert hero.main(["--data", str(tmp_path), "--out", str(tmp_path / "hero.jpg")]) == 2
    assert capsys.readouterr().err.startswith(f"nothing is drawn: no {tmp_path / 'envmaps'}")
    assert list(tmp_path.iterdir()) == []


def ball(side: int, level: float) -> SphereImage:
    distance = np.hypot(*(np.mgrid[:side, :side] - (side - 1) / 2))
    coverage = torch.from_numpy((distance < 0.94 * side / 2).astype(float))
    return SphereImage(level * torch.ones(side, side, 3, dtype=torch.float64), coverage)


@pytest.mark.slow
def test_the_left_half_is_the_source_and_the_right_half_the_fit(hero: ModuleType) -> None:
    side = hero.FINER * hero.SIDE
    pair = hero.Pair("a paint", "a kind", ball(side, 0.2), ball(side, 2.0), 9216)
    picture = np.asarray(hero.drawn(EnvironmentMap(torch.ones(8, 16, 3, dtype=torch.float64)), [pair], side))
    assert picture.shape == (hero.HEIGHT, hero.WIDTH, 3)
    row = picture[hero.LEVEL].astype(int).sum(1)
    middle = hero.WIDTH // 2
    assert row[middle + 40] > row[middle - 40] + 100
    assert row[middle - 100] == row[middle - 40]
    # The captions' ground is dark.
    assert picture[-3:].max() < 60


def test_decibels_are_those_of_the_picture(hero: ModuleType) -> None:
    pair = hero.Pair("a", "b", ball(32, 0.2), ball(32, 0.2), 1)
    shown = [float(hero.encoded(hero.filmic(np.array([level])))[0]) for level in (0.2, 0.3)]
    assert hero.decibels(pair._replace(fit=ball(32, 0.3)), 1.0) == pytest.approx(-20 * np.log10(shown[1] - shown[0]))
