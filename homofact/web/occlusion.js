// How far a mesh stands in its own light: for each vertex, which directions the mesh itself blocks.
//
// Depth maps from evenly spread directions say what is blocked at each vertex. Below the tangent plane, where nothing
// is lit, a vertex gets the mirror image of what is above. Sixteen real spherical harmonics (bands 0 to 3, in the
// world's frame) keep it, so that shadows are about 40° soft. A convex body blocks nothing: all its numbers are 0.

const DEPTH_SIDE = 256;            // texels of a depth map, which is 2 across
const MOST_DIRECTIONS = 128, LEAST_DIRECTIONS = 32;
const TRIANGLES = 8e6;             // about as many are drawn for all directions of a large mesh
const HARMONICS_SCALE = 4;         // what a stored 1 stands for; a vertex that is wholly blocked has √(4π) = 3.5

/** The sixteen harmonics in a shader, four by four, and the share of light that passes by their sum. */
const HARMONICS = `
void harmonics(vec3 w, out vec4 a, out vec4 b, out vec4 c, out vec4 d) {
  float x = w.x, y = w.y, z = w.z, z2 = z * z;
  a = vec4(0.28209479, 0.48860251 * y, 0.48860251 * z, 0.48860251 * x);
  b = vec4(1.09254843 * x * y, 1.09254843 * y * z, 0.31539157 * (3.0 * z2 - 1.0), 1.09254843 * x * z);
  c = vec4(0.54627422 * (x * x - y * y), 0.59004359 * y * (3.0 * x * x - y * y), 2.89061144 * x * y * z,
    0.45704580 * y * (5.0 * z2 - 1.0));
  d = vec4(0.37317633 * z * (5.0 * z2 - 3.0), 0.45704580 * x * (5.0 * z2 - 1.0), 1.44530572 * z * (x * x - y * y),
    0.59004359 * x * (x * x - 3.0 * y * y));
}
`;

/** The share of light from a direction that reaches a surface: all of it on the sphere, which is convex. */
const OPEN_SPHERE = `
float open_towards(vec3 w) { return 1.0; }
`;

/** On a mesh by its harmonics; the back of a sheet, for which there are none, is lit as if nothing were in the way. */
const OPEN_MESH = HARMONICS + `
in vec4 v_blocked_a, v_blocked_b, v_blocked_c, v_blocked_d;
float open_towards(vec3 w) {
  if (!gl_FrontFacing) return 1.0;
  vec4 a, b, c, d;
  harmonics(w, a, b, c, d);
  float blocked = dot(v_blocked_a, a) + dot(v_blocked_b, b) + dot(v_blocked_c, c) + dot(v_blocked_d, d);
  return clamp(1.0 - ${HARMONICS_SCALE}.0 * blocked, 0.0, 1.0);
}
`;

/** An octahedral normal, not yet of length 1. */
const OCTAHEDRAL = `
vec3 octahedral(vec2 place) {
  vec3 n = vec3(place, 1.0 - abs(place.x) - abs(place.y));
  if (n.z < 0.0) n.xy = (1.0 - abs(n.yx)) * vec2(n.x < 0.0 ? -1.0 : 1.0, n.y < 0.0 ? -1.0 : 1.0);
  return n;
}
`;

// A depth map from a direction: u_frame's columns are right, up and towards it.
const DEPTH_VERTEX = `
in vec3 a_position;
uniform mat3 u_frame;
void main() {
  vec3 seen = (a_position * 2.0 - 1.0) * u_frame;
  gl_Position = vec4(seen.xy, -0.5 * seen.z, 1.0);
}
`;
const DEPTH_FRAGMENT = `
void main() {}
`;

// A point for each vertex. It is looked up two texels above the surface, which no slope of its own plane then hides.
const BLOCKED_VERTEX = OCTAHEDRAL + `
in vec3 a_position;
in vec2 a_normal;
uniform mat3 u_frame;
uniform sampler2D u_depth;
uniform ivec2 u_places;    // columns and rows of the vertices' picture
flat out vec3 v_mirrored;  // the direction mirrored at the tangent plane
flat out float v_blocked;
void main() {
  vec3 n = normalize(octahedral(a_normal));
  float texel = 2.0 / float(${DEPTH_SIDE}), above = dot(n, u_frame[2]);
  vec3 seen = (a_position * 2.0 - 1.0 + 2.0 * texel * n) * u_frame;
  ivec2 at = ivec2(floor((1.0 + seen.xy) / texel));
  // Beside the map is nothing: the mesh is within the unit sphere.
  bool reached = above > 0.0 && min(at.x, at.y) >= 0 && max(at.x, at.y) < ${DEPTH_SIDE};
  v_blocked = reached && texelFetch(u_depth, at, 0).r < 0.5 - 0.25 * (seen.z + 0.5 * texel) ? 1.0 : 0.0;
  v_mirrored = u_frame[2] - 2.0 * above * n;
  vec2 place = vec2(gl_VertexID % u_places.x, gl_VertexID / u_places.x) + 0.5;
  gl_Position = vec4(2.0 * place / vec2(u_places) - 1.0, 0.0, 1.0);
  gl_PointSize = 1.0;
}
`;
const BLOCKED_FRAGMENT = HARMONICS + `
flat in vec3 v_mirrored;
flat in float v_blocked;
uniform mat3 u_frame;
uniform float u_weight;
layout(location = 0) out vec4 o_a;
layout(location = 1) out vec4 o_b;
layout(location = 2) out vec4 o_c;
layout(location = 3) out vec4 o_d;
void main() {
  vec4 a, b, c, d, e, f, g, h;
  harmonics(u_frame[2], a, b, c, d);
  harmonics(v_mirrored, e, f, g, h);
  float weight = v_blocked * u_weight;
  o_a = weight * (a + e);
  o_b = weight * (b + f);
  o_c = weight * (c + g);
  o_d = weight * (d + h);
}
`;

/** Unit vectors spread evenly over the sphere, along a spiral of Fibonacci's. */
function spreadDirections(count) {
  return Array.from({ length: count }, (_, k) => {
    const y = 1 - (2 * k + 1) / count, around = Math.sqrt(1 - y * y), turn = k * Math.PI * (3 - Math.sqrt(5));
    return [around * Math.cos(turn), y, around * Math.sin(turn)];
  });
}

/**
 * The harmonics of what a mesh blocks, 16 numbers for each of its `vertices`; `array` is its vertex array and `count`
 * how many indices are drawn. `format` is that of float pictures that can be blended.
 */
function blockedHarmonics(gl, { array, count, vertices }, format) {
  const columns = Math.min(vertices, 1024), rows = Math.ceil(vertices / columns);
  const [depth, blocked] = [[DEPTH_VERTEX, DEPTH_FRAGMENT], [BLOCKED_VERTEX, BLOCKED_FRAGMENT]].map(([vertex, fragment]) => (
    makeProgram(gl, HEAD + vertex, HEAD + fragment, "the mesh's shadow", { attributes: { a_position: 0, a_normal: 1 } })));
  const map = emptyTexture(gl, gl.DEPTH_COMPONENT24, DEPTH_SIDE, DEPTH_SIDE), mapFrame = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, mapFrame);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, map, 0);
  gl.drawBuffers([gl.NONE]);
  const sums = [0, 1, 2, 3].map(() => emptyTexture(gl, format, columns, rows)), sumFrame = gl.createFramebuffer();
  const places = sums.map((_, k) => gl.COLOR_ATTACHMENT0 + k);
  gl.bindFramebuffer(gl.FRAMEBUFFER, sumFrame);
  sums.forEach((texture, k) => gl.framebufferTexture2D(gl.FRAMEBUFFER, places[k], gl.TEXTURE_2D, texture, 0));
  gl.drawBuffers(places);
  gl.clearColor(0, 0, 0, 0);
  gl.clear(gl.COLOR_BUFFER_BIT);
  gl.bindVertexArray(array);
  gl.blendFunc(gl.ONE, gl.ONE);
  const number = clamped(Math.round(TRIANGLES / (count / 3)), LEAST_DIRECTIONS, MOST_DIRECTIONS);
  for (const towards of spreadDirections(number)) {
    const right = azimuthal(towards), frame = [...right, ...cross(towards, right), ...towards];
    gl.bindFramebuffer(gl.FRAMEBUFFER, mapFrame);
    gl.viewport(0, 0, DEPTH_SIDE, DEPTH_SIDE);
    gl.enable(gl.DEPTH_TEST);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.useProgram(depth.program);
    gl.uniformMatrix3fv(depth.at("u_frame"), false, frame);
    gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 0);
    gl.disable(gl.DEPTH_TEST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, sumFrame);
    gl.viewport(0, 0, columns, rows);
    gl.enable(gl.BLEND);
    gl.useProgram(blocked.program);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, map);
    gl.uniform1i(blocked.at("u_depth"), 0);
    gl.uniform2i(blocked.at("u_places"), columns, rows);
    gl.uniformMatrix3fv(blocked.at("u_frame"), false, frame);
    gl.uniform1f(blocked.at("u_weight"), (4 * Math.PI) / number);
    gl.drawArrays(gl.POINTS, 0, vertices);
    gl.disable(gl.BLEND);
  }
  gl.bindVertexArray(null);
  const found = new Float32Array(16 * vertices), read = new Float32Array(4 * columns * rows);
  places.forEach((place, k) => {
    gl.readBuffer(place);
    gl.readPixels(0, 0, columns, rows, gl.RGBA, gl.FLOAT, read);
    for (let i = 0; i < vertices; i++) found.set(read.subarray(4 * i, 4 * i + 4), 16 * i + 4 * k);
  });
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  for (const texture of [map, ...sums]) gl.deleteTexture(texture);
  for (const frame of [mapFrame, sumFrame]) gl.deleteFramebuffer(frame);
  for (const { program } of [depth, blocked]) gl.deleteProgram(program);
  return found;
}

/** A texture to draw into, bound to unit 0. */
function emptyTexture(gl, format, columns, rows) {
  gl.activeTexture(gl.TEXTURE0);
  const id = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, id);
  gl.texStorage2D(gl.TEXTURE_2D, 1, format, columns, rows);
  parameters(gl, gl.TEXTURE_2D, gl.NEAREST);
  return id;
}
