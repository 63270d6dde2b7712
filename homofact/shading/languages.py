"""Print the shading program as GLSL ES 3.00, HLSL and WGSL, and in the dialects of MaterialX, Godot and three.js.

All are functions to paste into a shader: `PREFIX_evaluate(wi, wo)` and the declarations of its textures. A fetch
specifies its level, so it is valid in any control flow and any stage. The value is a vector with one component per
channel, or a scalar for one channel.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from homofact.files.words import on_one_line
from homofact.geometry.expression import INFIX, Expression, Let, Tables
from homofact.shading.program import Program

_RANK = {"+": 1, "-": 1, "*": 2, "/": 2}


@dataclass(frozen=True)
class Language:
    """Templates with which a language writes types, constants, function names, statements, fetches and the shader.

    `widen` is True if a function of a vector and a scalar requires both as vectors (WGSL). `layered` is the fetch from
    a texture array, and `cube` the fetch from a cube map at a level. `table` is the declaration of a table with one
    vector of constants per layer. `sampler` is the name of the shared sampler, for languages in which textures have no
    sampler of their own.
    """

    name: str
    suffix: str
    types: tuple[str, str, str, str]
    functions: dict[str, str]
    let: str
    fetch: str
    layered: str
    cube: str
    table: str
    swizzles: tuple[str, str, str, str]
    widen: bool
    frame: Callable[[Program, str, str], str]
    sampler: str = "{prefix}_sampler"


def number(value: float) -> str:
    """Return a constant as the shortest text that reads back as the same float32."""
    single = np.float32(value)
    # str() obeys numpy's print options, which colour-science sets to an older style of fewer digits.
    if single == 0 or 1e-4 <= abs(single) < 1e16:
        return np.format_float_positional(single, unique=True, trim="0")
    return np.format_float_scientific(single, unique=True, trim="-")


def remark(text: str) -> str:
    """Return comment text on one line without comment delimiters, which names of files and channels may contain.

    If the text ends with a backslash, a full stop is appended, since the backslash would extend a line comment to the
    next line of code.
    """
    line = on_one_line(text).replace("*/", "* /").replace("/*", "/ *")
    return f"{line} ." if line.endswith("\\") else line


def infix(expression: Expression, left: str, right: str) -> str:
    """Return the text of an infix operator on printed operands, with parentheses if needed."""
    kind, operands = expression.kind, expression.operands
    if _RANK.get(operands[0].kind, 3) < _RANK[kind]:
        left = f"({left})"
    # a − (b + c) and a / (b c) keep theirs.
    rank = _RANK.get(operands[1].kind, 3)
    if (
        rank < _RANK[kind]
        or (rank == _RANK[kind] and (kind in "-/" or operands[1].kind in "-/"))
        or right.startswith("-")
    ):
        right = f"({right})"
    return f"{left} {kind} {right}"


def render(expression: Expression, language: Language, prefix: str, layered: bool = False) -> str:
    """Return the text of an expression with minimal parentheses; `layered` selects fetches from texture arrays."""
    kind, operands = expression.kind, expression.operands
    if kind == "constant":
        inner = [number(value) for value in expression.values]
        kind_of = language.types[expression.dimension - 1]
        return inner[0] if expression.dimension == 1 else f"{kind_of}({', '.join(inner)})"
    if kind == "name":
        return expression.text
    if kind == "swizzle":
        inner = render(operands[0], language, prefix, layered)
        return f"({inner}).{expression.text}" if operands[0].kind in INFIX else f"{inner}.{expression.text}"
    if kind == "vector":
        parts = ", ".join(render(operand, language, prefix, layered) for operand in operands)
        return f"{language.types[expression.dimension - 1]}({parts})"
    if kind == "fetch":
        uv = render(operands[0], language, prefix, layered)
        texture = f"{prefix}_texture_{expression.text}"
        way = language.layered if layered else language.fetch
        read = way.format(texture=texture, sampler=language.sampler.format(prefix=prefix), uv=uv)
        return read + language.swizzles[expression.dimension - 1]
    if kind == "cube":
        direction, level = (render(operand, language, prefix, layered) for operand in operands)
        texture, sampler = f"{prefix}_texture_{expression.text}", language.sampler.format(prefix=prefix)
        asked = {"texture": texture, "sampler": sampler, "direction": direction, "level": level}
        read = language.cube.format(**asked, prefix=prefix, number=expression.text)
        return read + language.swizzles[expression.dimension - 1]
    if kind == "table":
        return f"{prefix}_{expression.text}[layer]"
    if kind in INFIX:
        return infix(expression, *(render(operand, language, prefix, layered) for operand in operands))
    if kind == "asinh" and language.name == "HLSL":
        y = render(operands[0], language, prefix, layered)
        y = f"({y})" if operands[0].kind in INFIX else y
        return f"log({y} + sqrt({y} * {y} + 1.0))"
    arguments = []
    for operand in operands:
        text = render(operand, language, prefix, layered)
        if language.widen and operand.dimension < expression.dimension and kind != "dot":
            text = f"{language.types[expression.dimension - 1]}({text})"
        arguments.append(text)
    return f"{language.functions.get(kind, kind)}({', '.join(arguments)})"


def shader(program: Program, language: Language, prefix: str = "homofact") -> str:
    """Return the text of a program: declarations, one function, comments. All global names start with `prefix`."""
    body = body_text(program.statements, program.result, language, prefix, program.layers > 0)
    title = "\n".join(f"// {remark(line)}" for line in program.title)
    return f"{title}\n{tables_text(program.tables, language, prefix)}" + language.frame(program, body, prefix)


def body_text(
    statements: Sequence[Let], result: Expression, language: Language, prefix: str, layered: bool = False
) -> str:
    """Return the body lines of a function that returns `result`, without signature and braces."""
    lines = []
    for statement in statements:
        if statement.comment:
            lines.append(f"    // {remark(statement.comment)}")
        kind = language.types[statement.expression.dimension - 1]
        begin = language.let.format(type=kind, name=statement.name)
        lines.append(f"    {begin} = {render(statement.expression, language, prefix, layered)};")
    lines.append(f"    return {render(result, language, prefix, layered)};")
    return "\n".join(lines)


def tables_text(tables: Tables, language: Language, prefix: str) -> str:
    """Return the declarations of the tables of the layers' constants."""
    lines = []
    for name, rows in tables:
        kind = language.types[len(rows[0]) - 1]
        values = ", ".join(f"{kind}({', '.join(map(number, row))})" for row in rows)
        lines.append(language.table.format(type=kind, name=f"{prefix}_{name}", count=len(rows), values=values) + "\n")
    return "".join(lines)


def _size(program: Program, shape: tuple[int, ...]) -> str:
    """Return a texture's size for a comment: columns, rows, layers; for a cube map its faces and levels."""
    if _is_cube(shape):
        levels, faces, rows, columns = shape
        return f"{faces} faces of {columns} x {rows}, {levels} levels"
    return " x ".join(map(str, shape[::-1])) + f", {program.layers} layers" * (program.layers > 0)


def _is_cube(shape: tuple[int, ...]) -> bool:
    return len(shape) == 4


def _glsl(program: Program, body: str, prefix: str) -> str:
    kind, layered = GLSL.types[program.result.dimension - 1], program.layers > 0
    textures = "".join(
        f"uniform highp sampler{'Cube' if _is_cube(shape) else f'{len(shape)}D' + 'Array' * layered}"
        f" {prefix}_texture_{k};"
        f"  // {_size(program, shape)}\n"
        for k, shape in enumerate(program.shapes)
    )
    given = ", ".join(f"vec3 {name}" for name in program.parameters) + ", int layer" * layered
    return f"{textures}\n{kind} {prefix}_{program.function}({given}) {{\n{body}\n}}\n"


def _hlsl(program: Program, body: str, prefix: str) -> str:
    kind, layered = HLSL.types[program.result.dimension - 1], program.layers > 0
    textures = "".join(
        f"Texture{'Cube' if _is_cube(shape) else '2D' + 'Array' * layered}<float4> {prefix}_texture_{k}"
        f" : register(t{program.first + k});"
        f"  // {_size(program, shape)}\n"
        for k, shape in enumerate(program.shapes)
    )
    # A second program in a shader has its own.
    slot = min(program.first, 1)
    name = HLSL.sampler.format(prefix=prefix)
    sampler = f"SamplerState {name} : register(s{slot});  // MIN_MAG_MIP_LINEAR, CLAMP\n"
    given = ", ".join(f"float3 {name}" for name in program.parameters) + ", int layer" * layered
    return f"{textures}{sampler}\n{kind} {prefix}_{program.function}({given})\n{{\n{body}\n}}\n"


def _wgsl(program: Program, body: str, prefix: str) -> str:
    kind, layered = WGSL.types[program.result.dimension - 1], program.layers > 0
    textures = "".join(
        f"@group(0) @binding({program.first + k}) var {prefix}_texture_{k}:"
        f" texture_{'cube' if _is_cube(shape) else '2d' + '_array' * layered}<f32>;"
        f"  // {_size(program, shape)}\n"
        for k, shape in enumerate(program.shapes)
    )
    last = program.first + len(program.shapes)
    between = ", also between levels" * any(map(_is_cube, program.shapes))
    sampler = f"@group(0) @binding({last}) var {prefix}_sampler: sampler;  // linear{between}, clamp-to-edge\n"
    given = ", ".join(f"{name}: vec3<f32>" for name in program.parameters) + ", layer: i32" * layered
    return f"{textures}{sampler}\nfn {prefix}_{program.function}({given}) -> {kind} {{\n{body}\n}}\n"


def _godot(program: Program, body: str, prefix: str) -> str:
    """Godot's shading language: uniforms with hints, no precision."""
    kind = GLSL.types[program.result.dimension - 1]
    textures = "".join(
        f"uniform {'samplerCube' if _is_cube(shape) else 'sampler2D'} {prefix}_texture_{k} :"
        f" filter_linear{'_mipmap' * _is_cube(shape)}, repeat_disable;  // {_size(program, shape)}\n"
        for k, shape in enumerate(program.shapes)
    )
    given = ", ".join(f"vec3 {name}" for name in program.parameters)
    return f"{textures}\n{kind} {prefix}_{program.function}({given}) {{\n{body}\n}}\n"


def _under_a_sky(program: Program, body: str, prefix: str) -> str:
    """GLSL that reads an engine's sky by the engine's own functions, and its table as a texture."""
    flat = replace(program, shapes=program.shapes[:1])
    return _glsl(flat, body, prefix)


def _materialx(program: Program, body: str, prefix: str) -> str:
    """GLSL whose samplers are parameters: a node of MaterialX is given them."""
    kind = GLSL.types[program.result.dimension - 1]
    flat = [(k, shape) for k, shape in enumerate(program.shapes) if not _is_cube(shape)]
    sizes = "".join(f"// Texture {k}: {_size(program, shape)}\n" for k, shape in flat)
    given = [f"vec3 {name}" for name in program.parameters] + [f"sampler2D {prefix}_texture_{k}" for k, _ in flat]
    return f"{sizes}{kind} {prefix}_{program.function}({', '.join(given)})\n{{\n{body}\n}}\n"


GLSL = Language(
    "GLSL ES 3.00",
    ".glsl",
    ("float", "vec2", "vec3", "vec4"),
    {"atan2": "atan"},
    "{type} {name}",
    "textureLod({texture}, {uv}, 0.0)",
    "textureLod({texture}, vec3({uv}, float(layer)), 0.0)",
    "textureLod({texture}, {direction}, {level})",
    "const {type} {name}[{count}] = {type}[{count}]({values});",
    (".r", ".rg", ".rgb", ""),
    False,
    _glsl,
)
HLSL = Language(
    "HLSL",
    ".hlsl",
    ("float", "float2", "float3", "float4"),
    {"fract": "frac"},
    "{type} {name}",
    "{texture}.SampleLevel({sampler}, {uv}, 0.0)",
    "{texture}.SampleLevel({sampler}, float3({uv}, float(layer)), 0.0)",
    "{texture}.SampleLevel({sampler}, {direction}, {level})",
    "static const {type} {name}[{count}] = {{ {values} }};",
    (".r", ".rg", ".rgb", ""),
    False,
    _hlsl,
    # Unity reads a sampler's filter and wrapping from its name, and refuses one that has none.
    "{prefix}_trilinear_clamp_sampler",
)
WGSL = Language(
    "WGSL",
    ".wgsl",
    ("f32", "vec2<f32>", "vec3<f32>", "vec4<f32>"),
    {},
    "let {name}: {type}",
    "textureSampleLevel({texture}, {sampler}, {uv}, 0.0)",
    "textureSampleLevel({texture}, {sampler}, {uv}, layer, 0.0)",
    "textureSampleLevel({texture}, {sampler}, {direction}, {level})",
    "var<private> {name}: array<{type}, {count}> = array<{type}, {count}>({values});",
    (".r", ".rg", ".rgb", ""),
    True,
    _wgsl,
)
# Its v = 0 is an image's lowest row; mx_transform_uv turns that over where images are loaded from the top.
MATERIALX = replace(
    GLSL,
    name="MaterialX's GLSL",
    suffix="_materialx.glsl",
    fetch="textureLod({texture}, mx_transform_uv({uv}, vec2(1.0, -1.0), vec2(0.0, 1.0)), 0.0)",
    frame=_materialx,
)
# An engine's sky is read by functions PREFIX_sky_1(direction, level), its chain, and PREFIX_sky_2(n, 0), irradiance/pi.
_SKY = "{prefix}_sky_{number}({direction}, {level})"
THREE_SKY = replace(GLSL, name="three.js", cube=_SKY, frame=_under_a_sky)
MATERIALX_SKY = replace(MATERIALX, cube=_SKY)
GODOT = replace(GLSL, name="Godot's shading language", suffix=".gdshader", frame=_godot)
