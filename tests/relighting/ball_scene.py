"""A ball over a ground, as a scene's file: what tests of scene files, of opened scenes and of their folders share."""

from pathlib import Path

from homofact.relighting.scene_file import RelightSceneFile, read_relight_scene

GROUND = """[ground]
albedo = [0.2, 0.4, 0.6]
half = 1.5
steps = 6
"""
TEXT = f"""
[[object]]
mesh = "shape:sphere"
albedo = [0.5]
size = 0.5
at = [0, 0.25, 0]
{GROUND}[lighting]
named = "studio"
[[camera]]
eye = [0, 1.5, 3]
pixels = [40, 30]
[transport]
cube = 8
kept = 40
clusters = 2
components = 3
"""
PLANNED = TEXT.replace("kept = 40\nclusters = 2\ncomponents = 3\n", "[tolerance]\nreflected = 0.1\n")


def read(folder: Path, text: str = TEXT) -> RelightSceneFile:
    """The scene of a text, from a file in the folder."""
    (folder / "scene.toml").write_text(text)
    return read_relight_scene(folder / "scene.toml")
