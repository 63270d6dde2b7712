"""The engines that `homofact export --engine` knows."""

from homofact.errors import BadInput
from homofact.export.engines.base import Engine
from homofact.export.engines.blender import BLENDER
from homofact.export.engines.gltf import GLTF
from homofact.export.engines.godot import GODOT_ENGINE
from homofact.export.engines.materialx import MATERIALX_ENGINE
from homofact.export.engines.pbrt import PBRT
from homofact.export.engines.three import THREE
from homofact.options import nearest

ENGINES = {engine.name: engine for engine in (THREE, GLTF, MATERIALX_ENGINE, GODOT_ENGINE, BLENDER, PBRT)}


def engine_named(name: str, form: str | None) -> tuple[Engine, str]:
    """The engine, and the texture format asked for or its own. Raises BadInput for what it is not or does not take."""
    if name not in ENGINES:
        raise BadInput(
            f"engine: found {name!r}{nearest(name, ENGINES)}, expected one of {', '.join(ENGINES)};"
            " other engines read brdf.hlsl or brdf.glsl of a plain export"
        )
    engine = ENGINES[name]
    if form is not None and form not in engine.formats:
        raise BadInput(f"format: found {form!r} with --engine {name}, expected one of {', '.join(engine.formats)}")
    return engine, form or engine.formats[0]
