"""Select the layer of a material by label: an integer texture has the layer number for each texel.

Labels cannot be interpolated. So the lookup reads the texel that contains (u, v) in [0, 1]² without a sampler; row 0 is
at v = 0. To blend materials at their borders, evaluate each material and mix the values.
"""

from homofact.shading.languages import GLSL, HLSL, WGSL, Language

_LOOKUPS = {
    GLSL.name: """uniform highp usampler2D {prefix}_labels;

int {prefix}_layer(vec2 uv) {{
    ivec2 size = textureSize({prefix}_labels, 0);
    ivec2 texel = clamp(ivec2(floor(uv * vec2(size))), ivec2(0), size - 1);
    return int(texelFetch({prefix}_labels, texel, 0).r);
}}
""",
    HLSL.name: """Texture2D<uint> {prefix}_labels : register(t{next});

int {prefix}_layer(float2 uv)
{{
    float2 size;
    {prefix}_labels.GetDimensions(size.x, size.y);
    int2 texel = int2(clamp(floor(uv * size), 0.0, size - 1.0));
    return asint({prefix}_labels.Load(int3(texel, 0)));
}}
""",
    WGSL.name: """@group(0) @binding({after}) var {prefix}_labels: texture_2d<u32>;

fn {prefix}_layer(uv: vec2<f32>) -> i32 {{
    let size = vec2<i32>(textureDimensions({prefix}_labels));
    let texel = clamp(vec2<i32>(floor(uv * vec2<f32>(size))), vec2<i32>(0), size - 1);
    return i32(textureLoad({prefix}_labels, texel, 0).r);
}}
""",
}
_C = """
/* The layer at uv in [0, 1]^2 of rows x columns labels, row 0 at v = 0. */
int {prefix}_layer(const unsigned char *labels, int rows, int columns, const float uv[2])
{{
    const int x = (int)floorf(uv[0] * (float)columns), y = (int)floorf(uv[1] * (float)rows);
    const int column = x < 0 ? 0 : x < columns ? x : columns - 1, row = y < 0 ? 0 : y < rows ? y : rows - 1;
    return labels[row * columns + column];
}}
"""


def label_lookup(language: Language, textures: int) -> str:
    """Return `PREFIX_layer(uv)` and the declaration of the label texture, to append to a shader."""
    return "\n" + _LOOKUPS[language.name].format(prefix="homofact", next=textures, after=textures + 1)


def label_lookup_in_c() -> str:
    """Return `PREFIX_layer(labels, rows, columns, uv)` to append to the C code of a shader."""
    return _C.format(prefix="homofact")
