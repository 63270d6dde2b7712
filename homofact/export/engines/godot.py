"""A spatial shader for Godot 4 whose `light()` is the fit."""

from homofact.export.engines.base import Added, Engine, check_colour, template
from homofact.export.engines.materialx import mean_albedo
from homofact.export.exported import Exported
from homofact.shading.languages import GODOT, shader

NAME = "brdf.gdshader"


def _files(made: Exported) -> Added:
    check_colour(made, "godot")
    albedo = ", ".join(f"{x:.6g}" for x in mean_albedo(made.stored))
    return Added({NAME: template("godot.gdshader", PROGRAM=shader(made.program, GODOT), ALBEDO=albedo)})


GODOT_ENGINE = Engine("godot", ("exr16", "exr", "png8"), _files)
