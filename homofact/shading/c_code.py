"""Print the shading program as C99, without vector types and with math.h only; the texels are part of the file.

A vector becomes an array, and each of its components one expression. The lookup is that of a GPU sampler: bilinear
between texel centres at (k + 1/2)/n, clamped to the edge. The texels are the stored texels after decoding, so the
compiled function returns the same values as the other languages with the exported textures.
"""

from collections.abc import Sequence

import numpy as np

from homofact.geometry.expression import INFIX, Expression, Let, Tables, component
from homofact.shading.languages import infix, number, remark
from homofact.shading.program import Program

_FUNCTIONS = {
    "sqrt": "sqrtf", "abs": "fabsf", "exp": "expf", "log": "logf", "asinh": "asinhf",
    "cos": "cosf", "sin": "sinf", "atan2": "atan2f", "max": "fmaxf", "min": "fminf", "floor": "floorf",
}  # fmt: skip
LOOKUP = """static void {prefix}_lookup(const float *texels, int rows, int columns, const float uv[2], float *value)
{{
    const float x = fminf(fmaxf(uv[0] * (float)columns - 0.5f, 0.0f), (float)(columns - 1));
    const float y = fminf(fmaxf(uv[1] * (float)rows - 0.5f, 0.0f), (float)(rows - 1));
    const int column = (int)x, row = (int)y;
    const int right = column + 1 < columns ? column + 1 : column, above = row + 1 < rows ? row + 1 : row;
    const float u = x - (float)column, v = y - (float)row;
    for (int c = 0; c < {channels}; c++) {{
        const float low = (1.0f - u) * texels[(row * columns + column) * {channels} + c]
            + u * texels[(row * columns + right) * {channels} + c];
        const float high = (1.0f - u) * texels[(above * columns + column) * {channels} + c]
            + u * texels[(above * columns + right) * {channels} + c];
        value[c] = (1.0f - v) * low + v * high;
    }}
}}
"""


def c_source(program: Program, textures: Sequence[np.ndarray], prefix: str = "homofact") -> str:
    """Return one file of C99: texels (rows, columns, C) as floats, the lookup, and `PREFIX_evaluate(wi, wo, f)`.

    For layers, the texels of all layers are stacked along the rows, and the function is `PREFIX_evaluate(wi, wo, layer,
    f)`.
    """
    channels = len(program.channels)
    title = "".join(f"/* {remark(line)} */\n" for line in program.title)
    data = "".join(texels_in_c(prefix, k, texels) for k, texels in enumerate(textures))
    data += tables_in_c(program.tables, prefix)
    # Nothing calls it without textures, and compilers warn of that.
    lookup = f"{LOOKUP.format(prefix=prefix, channels=channels)}\n" if textures else ""
    layer = ", int layer" * (program.layers > 0)
    lines = statement_lines(program.statements, prefix, program)
    lines += [f"    f_out[{c}] = {render(component(program.result, c), prefix)};" for c in range(channels)]
    body = "\n".join(lines)
    return (
        f"{title}#include <math.h>\n\n{data}{lookup}"
        f"/* f_out[{channels}]: {remark(', '.join(program.channels))} */\n"
        f"void {prefix}_evaluate(const float wi[3], const float wo[3]{layer}, float f_out[{channels}])\n"
        f"{{\n{body}\n}}\n"
    )


def statement_lines(statements: Sequence[Let], prefix: str, program: Program | None = None) -> list[str]:
    """Return the lines of a function's statements; `program` defines the textures that they fetch."""
    layer = program is not None and program.layers > 0
    lines = []
    for statement in statements:
        if statement.comment:
            lines.append(f"    /* {remark(statement.comment)} */")
        name, expression = statement.name, statement.expression
        if expression.kind == "fetch":
            assert program is not None, "a function with textures needs their sizes"
            rows, columns = program.shapes[int(expression.text)]
            channels = expression.dimension
            uv = render(expression.operands[0])
            texture = f"{prefix}_texture_{expression.text}" + f" + layer * {rows * columns * channels}" * layer
            lines.append(f"    float {name}{'' if channels == 1 else f'[{channels}]'};")
            address = f"&{name}" if channels == 1 else name
            lines.append(f"    {prefix}_lookup({texture}, {rows}, {columns}, {uv}, {address});")
        elif expression.kind == "cube":
            direction, level = (render(operand, prefix) for operand in expression.operands)
            lines.append(f"    float {name}[{expression.dimension}];")
            assert program is not None, "a function with textures needs their sizes"
            levels, _, side, _ = program.shapes[int(expression.text)]
            texture = f"{prefix}_texture_{expression.text}"
            lines.append(f"    {prefix}_cube({texture}, {side}, {levels - 1}, {direction}, {level}, {name});")
        else:
            parts = ", ".join(render(component(expression, k), prefix) for k in range(expression.dimension))
            lines.append(
                f"    const float {name} = {parts};"
                if expression.dimension == 1
                else f"    const float {name}[{expression.dimension}] = {{{parts}}};"
            )
    return lines


def render(expression: Expression, prefix: str = "homofact") -> str:
    """Return the text of a scalar expression, or of a variable of any dimension."""
    kind, operands = expression.kind, expression.operands
    if kind == "constant":
        return f"{number(expression.values[0])}f"
    if kind == "name":
        return expression.text
    if kind == "swizzle":
        return f"{operands[0].text}[{'xyzw'.index(expression.text)}]"
    if kind == "table":
        return f"{prefix}_{expression.text}[layer][{int(expression.values[0])}]"
    if kind in INFIX:
        return infix(expression, *(render(operand, prefix) for operand in operands))
    parts = [render(operand, prefix) for operand in operands]
    if kind == "fract":
        return f"({parts[0]} - floorf({parts[0]}))"
    if kind == "step":
        return f"({parts[1]} >= {parts[0]} ? 1.0f : 0.0f)"
    return f"{_FUNCTIONS[kind]}({', '.join(parts)})"


def texels_in_c(prefix: str, number_of: int, texels: np.ndarray) -> str:
    """Return texels (rows, columns, C) as the array PREFIX_texture_NUMBER."""
    rows, columns, channels = texels.shape
    flat = [f"{number(value)}f" for value in texels.reshape(-1)]
    lines = [", ".join(flat[k : k + 3 * 3]) for k in range(0, len(flat), 9)]
    inner = ",\n    ".join(lines)
    return (
        f"/* {rows} rows of {columns} texels of {channels} channels */\n"
        f"static const float {prefix}_texture_{number_of}[{rows * columns * channels}] = {{\n    {inner}\n}};\n\n"
    )


def tables_in_c(tables: Tables, prefix: str) -> str:
    """Return the definitions of the tables of the layers' constants."""
    texts = []
    for name, rows in tables:
        inner = ",\n    ".join(f"{{{', '.join(f'{number(value)}f' for value in row)}}}" for row in rows)
        head = f"static const float {prefix}_{name}[{len(rows)}][{len(rows[0])}]"
        texts.append(f"{head} = {{\n    {inner}\n}};\n\n")
    return "".join(texts)
