"""Scenes that need more memory or disk than there is: refused before anything is traced, with a size that would do."""

import shutil
from collections import namedtuple
from dataclasses import replace
from pathlib import Path

import pytest
from refusals import refused
from relighting_cases import factored_once

from homofact.linear import size
from homofact.relighting import build
from homofact.relighting.build import RelightScene, open_relight_scene
from homofact.relighting.room import check_room
from homofact.relighting.scene_file import read_relight_scene

SCENE = """
[[object]]
mesh = "shape:sphere"
albedo = [0.5]
[lighting]
named = "uniform"
[[camera]]
eye = [0, 1, 3]
[transport]
cube = 8
kept = 40
"""
Usage = namedtuple("Usage", "total used free")
BESIDE = 0.6 * 2**30


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> RelightScene:
    monkeypatch.setattr(build, "factored", factored_once)
    (tmp_path / "ball.toml").write_text(SCENE)
    return open_relight_scene(read_relight_scene(tmp_path / "ball.toml"))


def test_memory_is_asked_for_before(scene: RelightScene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    need = scene.cost.peak_bytes
    monkeypatch.setattr(size, "memory_of_machine", lambda: BESIDE + need + 1)
    check_room(scene, tmp_path / "blocks")
    # Without a folder, blocks and what they are put together to stand in memory too.
    with refused(match="ball: transport of 1,986 vertices"):
        check_room(scene, None)
    monkeypatch.setattr(size, "memory_of_machine", lambda: BESIDE + need / 2)
    with refused(match="meshes of 990 vertices in all would fit"):
        check_room(scene, tmp_path / "blocks")
    monkeypatch.setattr(size, "memory_of_machine", lambda: None)
    check_room(scene, None)


def test_disk_is_asked_for_before(scene: RelightScene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    need = scene.cost.disk_bytes
    monkeypatch.setattr(shutil, "disk_usage", lambda place: Usage(0, 0, need))
    check_room(scene, tmp_path / "out" / "blocks")
    monkeypatch.setattr(shutil, "disk_usage", lambda place: Usage(0, 0, need // 2))
    with refused(match="transport.kept of at most 20"):
        check_room(scene, tmp_path / "out" / "blocks")
    # What a tolerance keeps is not known beforehand.
    settings = replace(scene.file.settings, tolerance=0.05)
    check_room(replace(scene, file=replace(scene.file, settings=settings)), tmp_path / "out" / "blocks")
