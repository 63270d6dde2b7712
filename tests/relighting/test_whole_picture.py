"""How near a whole relit picture is to the sum over every texel: against a sum of its own, and what makes it worse."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from relighting_cases import factored_once

from homofact.relighting import build, whole_picture
from homofact.relighting.build import RelightScene, RelitObject, open_relight_scene, relit_objects
from homofact.relighting.scene_file import read_relight_scene
from homofact.relighting.whole_picture import PictureLikeness, picture_likeness
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.tonemap import DEFAULT_CURVE

SCENE = """
[[object]]
mesh = "shape:sphere"
albedo = [0.6, 0.5, 0.4]
size = 0.5
[lighting]
named = "uniform"
[[sun]]
direction = [0.6, 0.8, 0]
irradiance = [2.0, 1.0, 0.5]
[[camera]]
eye = [0, 0, 3]
field = 24
pixels = [64, 48]
[transport]
cube = 8
kept = 384
"""
Made = tuple[RelightScene, tuple[RelitObject, ...]]


def made(folder: Path, text: str = SCENE) -> Made:
    (folder / "scene.toml").write_text(text)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(build, "factored", factored_once)
        scene = open_relight_scene(read_relight_scene(folder / "scene.toml"))
        return scene, relit_objects(scene)


@pytest.fixture(scope="module")
def ball(tmp_path_factory: pytest.TempPathFactory) -> Made:
    return made(tmp_path_factory.mktemp("ball"))


def likeness(given: Made) -> PictureLikeness:
    found = picture_likeness(*given, rows=24)
    assert found is not None
    return found


def test_a_convex_matt_ball_is_nearly_exact(ball: Made) -> None:
    found = likeness(ball)
    assert found.pixels == (32, 24)
    assert 0 < found.error < 0.03
    assert found.psnr > 40
    assert found.flip is not None
    assert 0 < found.flip < 0.06
    assert set(found.record()) == {"pixels", "error", "curve", "psnr", "flip"}
    assert found.record()["curve"] == DEFAULT_CURVE


def test_the_error_is_that_of_the_light(ball: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    """Material and sun a fifth too bright err by a fifth, of pixels that see the object, whatever is behind."""
    scene, (relit,) = ball
    assert relit.sunlight is not None
    brighter = replace(relit.transport, scale=relit.transport.scale * np.float32(1.2))
    suns = tuple(replace(sun, irradiance=sun.irradiance * 1.2) for sun in relit.sunlight.suns)
    wrong = replace(relit, transport=brighter, sunlight=replace(relit.sunlight, suns=suns))
    bright = likeness((scene, (wrong,)))
    assert bright.error == pytest.approx(0.2, abs=0.02)
    assert bright.flip is not None
    exact = likeness(ball)
    assert exact.flip is not None
    assert bright.flip > 2 * exact.flip
    assert bright.psnr < exact.psnr - 10
    # The tone curve is of the exact picture: light of another unit looks the same.
    sky = EnvironmentMap(100 * scene.file.light.radiance, name="bright")
    suns = tuple(replace(sun, irradiance=100 * sun.irradiance) for sun in scene.file.suns)
    file = replace(scene.file, light=sky, suns=suns)
    lit = replace(relit, sunlight=replace(relit.sunlight, suns=suns))
    other = likeness((replace(scene, file=file), (lit,)))
    assert other.error == pytest.approx(exact.error, rel=1e-3)
    assert other.psnr == pytest.approx(exact.psnr, abs=0.1)


def test_without_the_library_there_is_no_flip(ball: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    from homofact.errors import MissingDependency

    def missing(*_: torch.Tensor) -> float:
        raise MissingDependency("no flip_evaluator")

    monkeypatch.setattr(whole_picture, "flip", missing)
    found = likeness(ball)
    assert found.flip is None
    assert "flip" not in found.record()
    assert math.isfinite(found.psnr)


def test_a_camera_that_sees_nothing_has_no_likeness(tmp_path: Path) -> None:
    given = made(tmp_path, SCENE.replace("eye = [0, 0, 3]", "eye = [0, 0, 3]\ntarget = [0, 0, 9]"))
    assert picture_likeness(*given, rows=12) is None
