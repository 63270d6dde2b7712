// The shader programs: what a layer's own text is put into (with lighting.js), and the layer's textures.

const HEAD = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler3D;
`;

const SPHERE = `
void main() {
  vec2 place = (gl_FragCoord.xy + u_shift - 0.5 * u_size) / u_radius;
  float from_centre = length(place), pixel = 1.0 / u_radius;
  float coverage = clamp((1.0 - from_centre) * u_radius + 0.5, 0.0, 1.0);
  if (coverage <= 0.0) { o_radiance = vec4(0.0); return; }
  // A pixel on the rim is shaded at the middle of its covered part.
  float outer = min(from_centre + 0.5 * pixel, 1.0);
  if (outer == 1.0) place *= 0.5 * (from_centre - 0.5 * pixel + 1.0) / from_centre;
  float height = sqrt(max(1.0 - dot(place, place), 0.0));
  vec3 n = u_camera * vec3(place, height), t = azimuthal(n);
  vec3 wo = vec3(dot(t, u_camera[2]), dot(cross(n, t), u_camera[2]), height);
  o_radiance = vec4(radiance(n, t, wo) * coverage, coverage);
}
`;

const CORNERS = `
in vec2 a_corner;
void main() { gl_Position = vec4(a_corner, 0.0, 1.0); }
`;

const MESH_VERTEX = OCTAHEDRAL + `
in vec3 a_position;
in vec2 a_normal;
in vec4 a_blocked_a, a_blocked_b, a_blocked_c, a_blocked_d;
uniform vec2 u_size;
uniform vec2 u_shift;
uniform float u_radius;
uniform mat3 u_camera;
out vec3 v_normal;
out vec4 v_blocked_a, v_blocked_b, v_blocked_c, v_blocked_d;
void main() {
  v_normal = octahedral(a_normal);
  v_blocked_a = a_blocked_a;
  v_blocked_b = a_blocked_b;
  v_blocked_c = a_blocked_c;
  v_blocked_d = a_blocked_d;
  vec3 seen = (a_position * 2.0 - 1.0) * u_camera;
  gl_Position = vec4((seen.xy * u_radius - u_shift) * 2.0 / u_size, -0.5 * seen.z, 1.0);
}
`;

// A normal between vertices may turn away from a viewer who sees its triangle: it is bent back to just face them.
const MESH_NORMAL = `
in vec3 v_normal;
uniform mat3 u_camera;
vec3 facing_normal() {
  vec3 n = normalize(gl_FrontFacing ? v_normal : -v_normal);
  float towards = dot(n, u_camera[2]);
  return towards < 0.01 ? normalize(n + (0.01 - towards) * u_camera[2]) : n;
}
`;

const MESH = MESH_NORMAL.replace("uniform mat3 u_camera;", "") + `
void main() {
  vec3 n = facing_normal(), t = azimuthal(n);
  vec3 wo = u_camera[2] * mat3(t, cross(n, t), n);
  o_radiance = vec4(radiance(n, t, wo), 1.0);
}
`;

const MESH_PROBE = MESH_NORMAL + `
out vec4 o_normal;
void main() { o_normal = vec4(facing_normal(), 1.0); }
`;

const EVALUATE = `
uniform sampler2D u_wi, u_wo;
out vec4 o_value;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  o_value = vec4(LAYER_evaluate(texelFetch(u_wi, at, 0).xyz, texelFetch(u_wo, at, 0).xyz), 1.0);
}
`;

// From the sums of the passes to colours: one exposure and the filmic curve, or a difference in false colours.
const DISPLAY = SKY + TONE_CURVES + `
uniform sampler2D u_here, u_there;
uniform vec2 u_size;
uniform float u_scale;     // target pixels a pixel of the picture
uniform float u_passes;
uniform float u_width;     // target pixels across that are averaged
uniform float u_exposure;
uniform vec3 u_ground;     // linear
uniform bool u_under_sky;  // the sky behind the object
uniform mat3 u_camera;
uniform int u_mode;        // 0 radiance, 1 signed, 2 absolute, 3 ratio in stops
uniform float u_range;     // what full colour stands for
uniform vec3 u_ramp[9];
out vec4 o_colour;

// The mean of width x width target pixels round this one, linear between places. Of 2 x 2 this is the first: half a pixel
// further on, the mean would be of 3 x 3 whose samples do not complete each other, which shows as a grid of dots.
vec4 sums(sampler2D picture, float width) {
  ivec2 last = max(ivec2(floor(u_size * u_scale)), 1) - 1;
  vec2 at = gl_FragCoord.xy * u_scale - 0.5 - (width > 2.0 ? 0.5 * (width - 1.0) : 0.0);
  ivec2 low = ivec2(floor(at));
  vec2 part = at - vec2(low);
  int count = int(width);
  vec4 total = vec4(0.0);
  for (int j = 0; j <= count; j++) {
    float down = j == 0 ? 1.0 - part.y : j == count ? part.y : 1.0;
    if (down == 0.0) continue;
    for (int i = 0; i <= count; i++) {
      float across = i == 0 ? 1.0 - part.x : i == count ? part.x : 1.0;
      if (across == 0.0) continue;
      total += across * down * texelFetch(picture, clamp(low + ivec2(i, j), ivec2(0), last), 0);
    }
  }
  return total / (width * width);
}

// Behind the object: grey, or the sky as a wide lens would show it, which the object's own parallel rays do not.
vec3 behind() {
  if (!u_under_sky) return u_ground;
  vec2 place = (gl_FragCoord.xy - 0.5 * u_size) / min(u_size.x, u_size.y);
  return clamp(filmic(sky_radiance(u_camera * normalize(vec3(1.3 * place, -1.0))) * u_exposure), 0.0, 1.0);
}

vec3 ramp(float x) {
  float place = clamp(x, 0.0, 1.0) * 8.0;
  int below = int(min(place, 7.0));
  return mix(u_ramp[below], u_ramp[below + 1], place - float(below));
}

void main() {
  vec4 here = sums(u_here, u_width);
  // The silhouette stays sharp.
  float coverage = (u_width > 1.0 ? sums(u_here, 1.0).a : here.a) / u_passes;
  vec3 radiance = here.rgb / max(here.a, 1e-9);
  vec3 ground = encode(u_ground);
  if (u_mode == 0) {
    vec3 shown = clamp(filmic(max(radiance, 0.0) * u_exposure), 0.0, 1.0);
    o_colour = vec4(encode(shown * coverage + behind() * (1.0 - coverage)), 1.0);
    return;
  }
  vec4 there = sums(u_there, u_width);
  const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722);
  float y = dot(radiance, LUMINANCE) * u_exposure;
  float reference = dot(there.rgb / max(there.a, 1e-9), LUMINANCE) * u_exposure;
  float value = y - reference;
  if (u_mode == 3) value = log2((y + 1e-6) / (reference + 1e-6));
  value /= u_range;
  vec3 colour = ramp(u_mode == 2 ? abs(value) : 0.5 + 0.5 * value);
  o_colour = vec4(mix(ground, colour, coverage), 1.0);
}
`;

/** A program; the attributes' places are fixed: 0 a_corner or a_position, 1 a_normal, from 2 what is blocked. */
function compileProgram(gl, vertex, fragment, what) {
  const attributes = {
    [vertex === MESH_VERTEX ? "a_position" : "a_corner"]: 0, a_normal: 1, a_blocked_a: 2, a_blocked_b: 3, a_blocked_c: 4,
    a_blocked_d: 5,
  };
  return makeProgram(gl, HEAD + vertex, HEAD + fragment, what, { attributes });
}

/** A layer on the GPU: its textures, and its programs, each compiled when it is first needed. */
class LayerOnGpu {
  constructor(gl, layer) {
    this.gl = gl;
    this.layer = layer;
    this.programs = {};
    this.textures = layer.textures.map((texture) => ({ name: texture.name, target: gl.TEXTURE_2D, id: upload2D(gl, texture) }));
    if (layer.volume) {
      this.textures.push({ name: layer.volume.name, target: gl.TEXTURE_3D, id: upload3D(gl, layer.volume) });
    }
  }

  /** The program of one kind ("sphere", "mesh" or "evaluate"), in use, its textures bound from unit 2 up. */
  use(kind) {
    const gl = this.gl;
    if (!this.programs[kind]) {
      const call = (text) => text.replaceAll("LAYER_evaluate", `${this.layer.prefix}_evaluate`);
      const [vertex, rest] = {
        sphere: [CORNERS, OPEN_SPHERE + LIGHTING + SPHERE], mesh: [MESH_VERTEX, OPEN_MESH + LIGHTING + MESH],
        evaluate: [CORNERS, EVALUATE],
      }[kind];
      this.programs[kind] = compileProgram(gl, vertex, this.layer.glsl + "\n" + call(rest), `“${this.layer.title}”`);
    }
    const found = this.programs[kind];
    gl.useProgram(found.program);
    this.textures.forEach((texture, k) => {
      gl.activeTexture(gl.TEXTURE2 + k);
      gl.bindTexture(texture.target, texture.id);
      gl.uniform1i(found.at(texture.name), 2 + k);
    });
    return found;
  }
}

function parameters(gl, target, filter) {
  gl.texParameteri(target, gl.TEXTURE_MIN_FILTER, filter);
  gl.texParameteri(target, gl.TEXTURE_MAG_FILTER, filter);
  gl.texParameteri(target, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
  gl.texParameteri(target, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  if (target === gl.TEXTURE_3D) gl.texParameteri(target, gl.TEXTURE_WRAP_R, gl.CLAMP_TO_EDGE);
}

function upload2D(gl, texture) {
  // Float textures are filtered only with an extension; without it they are kept as half floats.
  const wide = gl.getExtension("OES_texture_float_linear");
  const [inside, type] = {
    float32: [wide ? gl.RGBA32F : gl.RGBA16F, gl.FLOAT], float16: [gl.RGBA16F, gl.HALF_FLOAT],
    uint8: [gl.RGBA8, gl.UNSIGNED_BYTE],
  }[texture.type];
  const id = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, id);
  gl.texImage2D(gl.TEXTURE_2D, 0, inside, texture.columns, texture.rows, 0, gl.RGBA, type, texture.texels);
  parameters(gl, gl.TEXTURE_2D, gl.LINEAR);
  return id;
}

/** Four floats a texel that are read as they are. */
function uploadExactly(gl, width, height, values) {
  const id = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, id);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, width, height, 0, gl.RGBA, gl.FLOAT, values);
  parameters(gl, gl.TEXTURE_2D, gl.NEAREST);
  return id;
}

function upload3D(gl, volume) {
  const wide = gl.getExtension("OES_texture_float_linear");
  const id = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_3D, id);
  const [depth, height, width] = volume.size;
  if (Math.max(depth, height, width) > gl.getParameter(gl.MAX_3D_TEXTURE_SIZE)) {
    throw new Trouble("The source's table is larger than this machine's 3D textures.",
      "Make the page without the source, or use another browser.", `${width} × ${height} × ${depth} nodes`);
  }
  gl.texImage3D(gl.TEXTURE_3D, 0, wide ? gl.RGBA32F : gl.RGBA16F, width, height, depth, 0, gl.RGBA, gl.FLOAT, volume.texels);
  parameters(gl, gl.TEXTURE_3D, gl.LINEAR);
  return id;
}

/** The source's table: differences of steps become logarithms, red and blue are stored as what they differ from green. */
async function unpackVolume(packed) {
  const steps = await unpack(packed.steps);
  const [, depth, height, width] = packed.steps.shape;
  const count = depth * height * width;
  accumulate(steps, 1, width);
  accumulate(steps, width, height);
  const texels = new Float32Array(4 * count);
  for (let i = 0; i < count; i++) {
    const green = steps[i];
    texels[4 * i] = (green + steps[count + i]) * packed.step;
    texels[4 * i + 1] = green * packed.step;
    texels[4 * i + 2] = (green + steps[2 * count + i]) * packed.step;
    texels[4 * i + 3] = 1;
  }
  return { name: packed.name, size: [depth, height, width], texels };
}
