"""Print a program with a table and prefiltered cube maps as C99; the code contains the table but not the cube maps.

A cube map is an array with four floats per texel. The largest level comes first; each level has the faces +x, −x, +y,
−y, +z, −z, row by row. These are the levels of a KTX2 file in the order of its index, converted to floats. Lookups are
those of `rendering.cube`.
"""

import numpy as np

from homofact.geometry.expression import component
from homofact.shading.c_code import LOOKUP, render, statement_lines, texels_in_c
from homofact.shading.languages import remark
from homofact.shading.program import Program

_CUBE = """
static int {prefix}_face(const float d[3], float *s, float *t)
{{
    const float a = fabsf(d[0]), b = fabsf(d[1]), c = fabsf(d[2]);
    if (a >= b && a >= c) {{
        *s = d[0] > 0.0f ? -d[2] / a : d[2] / a;
        *t = -d[1] / a;
        return d[0] > 0.0f ? 0 : 1;
    }}
    if (b >= c) {{
        *s = d[0] / b;
        *t = d[1] > 0.0f ? d[2] / b : -d[2] / b;
        return d[1] > 0.0f ? 2 : 3;
    }}
    *s = d[2] > 0.0f ? d[0] / c : -d[0] / c;
    *t = -d[1] / c;
    return d[2] > 0.0f ? 4 : 5;
}}

/* A texel, also one column or row beyond an edge: that of the face on the other side. */
static const float *{prefix}_texel(const float *level, int side, int face, int column, int row)
{{
    if (column < 0 || column >= side || row < 0 || row >= side) {{
        const float most = 1.0001f;
        float s = fminf(fmaxf((2.0f * (float)column + 1.0f) / (float)side - 1.0f, -most), most);
        float t = fminf(fmaxf((2.0f * (float)row + 1.0f) / (float)side - 1.0f, -most), most);
        const float d[6][3] = {{
            {{1.0f, -t, -s}}, {{-1.0f, -t, s}}, {{s, 1.0f, t}}, {{s, -1.0f, -t}}, {{s, -t, 1.0f}}, {{-s, -t, -1.0f}}
        }};
        face = {prefix}_face(d[face], &s, &t);
        column = (int)((s + 1.0f) * 0.5f * (float)side);
        row = (int)((t + 1.0f) * 0.5f * (float)side);
        column = column < 0 ? 0 : column < side ? column : side - 1;
        row = row < 0 ? 0 : row < side ? row : side - 1;
    }}
    return level + 4 * ((face * side + row) * side + column);
}}

/* Beyond a corner the mean of the three texels that meet there. */
static float {prefix}_value(const float *level, int side, int face, int column, int row, int c)
{{
    const int x = column < 0 ? 0 : column < side ? column : side - 1, y = row < 0 ? 0 : row < side ? row : side - 1;
    if (x != column && y != row)
        return ({prefix}_texel(level, side, face, x, y)[c] + {prefix}_texel(level, side, face, column, y)[c]
            + {prefix}_texel(level, side, face, x, row)[c]) / 3.0f;
    return {prefix}_texel(level, side, face, column, row)[c];
}}

static void {prefix}_cube(const float *sky, int side, int last, const float d[3], float level, float *value)
{{
    const float whole = fminf(fmaxf(level, 0.0f), (float)last);
    float s, t;
    const int low = (int)whole, face = {prefix}_face(d, &s, &t);
    for (int k = 0; k < low; k++, side /= 2)
        sky += 24 * side * side;
    for (int c = 0; c < 3; c++)
        value[c] = 0.0f;
    for (int k = 0; k < 2; k++) {{
        const float part = whole - (float)low, share = k ? part : 1.0f - part;
        const float x = (s + 1.0f) * 0.5f * (float)side - 0.5f, y = (t + 1.0f) * 0.5f * (float)side - 0.5f;
        const int column = (int)floorf(x), row = (int)floorf(y);
        const float u = x - (float)column, v = y - (float)row;
        if (share == 0.0f)
            continue;
        for (int c = 0; c < 3; c++) {{
            const float lower = (1.0f - u) * {prefix}_value(sky, side, face, column, row, c)
                + u * {prefix}_value(sky, side, face, column + 1, row, c);
            const float upper = (1.0f - u) * {prefix}_value(sky, side, face, column, row + 1, c)
                + u * {prefix}_value(sky, side, face, column + 1, row + 1, c);
            value[c] += share * ((1.0f - v) * lower + v * upper);
        }}
        sky += 24 * side * side;
        side /= 2;
    }}
}}
"""


def c_light(program: Program, table: np.ndarray, prefix: str) -> str:
    """Return a C99 file with `PREFIX_FUNCTION(texture_1, …, a, b, out)`: two parameters, and out with three floats.

    Texture 0 of the program is the `table` (rows, columns, 4). The others are cube maps, whose texels the caller
    passes.
    """
    title = "".join(f"/* {remark(line)} */\n" for line in program.title)
    given = ", ".join(f"const float {name}[3]" for name in program.parameters)
    body = "\n".join(
        [
            *statement_lines(program.statements, prefix, program),
            *(f"    out[{c}] = {render(component(program.result, c), prefix)};" for c in range(3)),
        ]
    )
    cubes = ", ".join(f"const float *{prefix}_texture_{k}" for k in range(1, len(program.shapes)))
    return (
        f"{title}#include <math.h>\n\n{texels_in_c(prefix, 0, table)}{LOOKUP.format(prefix=prefix, channels=4)}"
        f"{_CUBE.format(prefix=prefix)}\n"
        "/* The cube maps' texels, four floats each, largest level first. */\n"
        f"void {prefix}_{program.function}({cubes}, {given}, float out[3])\n{{\n{body}\n}}\n"
    )
