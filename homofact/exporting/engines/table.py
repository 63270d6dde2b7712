"""The engines that an export is made for."""

from homofact.errors import BadInput
from homofact.exporting.engines.base import Engine
from homofact.exporting.engines.blender import BLENDER
from homofact.exporting.engines.gltf import GLTF
from homofact.exporting.engines.godot import GODOT_ENGINE
from homofact.exporting.engines.materialx import MATERIALX_ENGINE
from homofact.exporting.engines.pbrt import PBRT
from homofact.exporting.engines.three import THREE
from homofact.settings.options import nearest

ENGINES = {engine.name: engine for engine in (THREE, GLTF, MATERIALX_ENGINE, GODOT_ENGINE, BLENDER, PBRT)}


def engine_named(name: str, form: str | None) -> tuple[Engine, str]:
    """Return the engine, and the requested texture format or the engine's default.

    Raises BadInput for an unknown engine, and for a format that the engine does not support.
    """
    if name not in ENGINES:
        raise BadInput(
            where="engine",
            found=repr(name),
            expected=f"one of {', '.join(ENGINES)}; other engines read brdf.hlsl or brdf.glsl of a plain export",
            hint=nearest(name, ENGINES),
        )
    engine = ENGINES[name]
    if form is not None and form not in engine.formats:
        raise BadInput(
            where="format", found=f"{form!r} with engine {name}", expected=f"one of {', '.join(engine.formats)}"
        )
    return engine, form or engine.formats[0]
