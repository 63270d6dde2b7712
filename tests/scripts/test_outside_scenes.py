"""The script that relights and edits glTF files made elsewhere."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
from textured import written

from homofact.editing.scene_file import read_edit_scene
from homofact.relighting.scene_file import read_relight_scene

Script = Callable[[str], ModuleType]
NAME = "relighting.outside_scenes"


def test_scenes_of_a_file_are_read_at_the_asked_size(script: Script, tmp_path: Path) -> None:
    module, ball = script(NAME), written(tmp_path / "ball.glb", 0.0, 0.9)
    for more, read in ((module.GROUND, read_relight_scene), (module.EDIT.format(triangles=40), read_edit_scene)):
        scene = read(module.scene_of(ball, tmp_path / "scene.toml", "studio", 3.0, more, (48, 36)))
        (camera,) = scene.cameras
        assert camera.pixels == (48, 36)
        assert camera.eye == pytest.approx((3.3, 3.9, 7.8))
        assert [each.size for each in scene.objects] == [3.0]
        assert (scene.ground is not None) == (more is module.GROUND)


@pytest.mark.slow
def test_a_file_is_relit_and_edited_to_its_end(
    script: Script, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ball, kept = written(tmp_path / "ball.glb", 0.0, 0.9), tmp_path / "kept"
    assert script(NAME).main(["--short", str(ball), "--results", str(kept)]) == 0
    line = capsys.readouterr().out.splitlines()[-3]
    cells = [cell.strip() for cell in line.strip("|").split("|")]
    assert cells[1] == "2"
    assert 0 < float(cells[2].rstrip("%")) < 10
    assert 0 < float(cells[7].rstrip("%")) < 2
    name = f"0-{tmp_path.name}"
    assert all((kept / f"{name}.{kind}" / "view.html").is_file() for kind in ("relit", "edited"))
