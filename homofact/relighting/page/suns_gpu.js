// Suns on the graphics card: their light at each pixel, and shadow maps that turn with the sky.

// Of a shadow map; samples of it a pixel; suns at most.
const SHADOW = 2048, SHADOW_TAPS = 24, MOST_SUNS = 8;
const SUN_UNITS = { tables: [5, 6, 10], shadow: 7, depths: 8 };

/** `sunlight(position, normal)`; u_eye stands before it. */
const sunSum = ({ tables }, count) => `
uniform highp sampler2DArrayShadow u_shadow;
uniform highp sampler2DArray u_depths;
uniform mat4 u_sun_camera[${count}];
uniform vec3 u_sun[${count}];
uniform vec3 u_sun_light[${count}];
uniform float u_sun_lift;
uniform float u_sun_softness[${count}];
uniform vec3 u_sun_across[${count}];
uniform int u_sun_directions[${count}];
${tables.map((_, k) => `uniform highp sampler2DArray u_sun_table_${k};\nuniform vec3 u_sun_numbers_${k};`).join("\n")}
${tables.map((table, k) => tintedParts(`SUN_TINTED_${k}`, table)).join("")}

/** Points of a disc, spread evenly. */
vec2 spread(int k, float turn) {
  float angle = (float(k) + 0.5) * 2.3999632 + turn;
  return sqrt((float(k) + 0.5) / ${SHADOW_TAPS}.0) * vec2(cos(angle), sin(angle));
}

/** The part of a sun's disc that is seen (percentage-closer soft shadows, Fernando 2005). */
float sunSeen(int q, vec3 position, vec3 n) {
  vec3 place = 0.5 * (u_sun_camera[q] * vec4(position + u_sun_lift * n, 1.0)).xyz + 0.5;
  if (any(greaterThan(abs(place.xy - 0.5), vec2(0.5)))) return 1.0;
  // Samples lie on the tangent plane: at one depth, a slope would lie in its own shadow.
  vec3 slope = normalize(mat3(u_sun_camera[q]) * n);
  vec2 tilt = slope.xy / max(-slope.z, 0.1);
  // The pattern is turned from pixel to pixel, or its steps would show in wide penumbrae.
  float turn = 6.2831853 * fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
  float away = 0.0, found = 0.0, sum = 0.0;
  for (int k = 0; k < ${SHADOW_TAPS}; k++) {
    vec2 aside = 0.5 * u_sun_softness[q] * spread(k, turn);
    float gap = place.z + dot(tilt, aside) - texture(u_depths, vec3(place.xy + aside, float(q))).r;
    if (gap > 0.0) { away += gap; found += 1.0; }
  }
  if (found == 0.0) return 1.0;
  // As wide as the disc looks from where it is hidden.
  float wide = max(u_sun_softness[q] * away / found, ${(1 / SHADOW).toFixed(6)});
  for (int k = 0; k < ${SHADOW_TAPS}; k++) {
    vec2 aside = wide * spread(k, turn);
    sum += texture(u_shadow, vec4(place.xy + aside, float(q), min(place.z + dot(tilt, aside), 1.0)));
  }
  return sum / ${SHADOW_TAPS}.0;
}

vec3 sunlight(vec3 position, vec3 normal) {
  vec3 w = normalize(u_eye - position), n = normalize(normal);
  // A normal that is turned away, at an outline, is bent back until it is seen.
  n = normalize(n + max(${BENT} - dot(n, w), 0.0) * w);
  vec3 tangent = vec3((n.y + 1.0) * (n.y + 1.0) + n.z * n.z - n.x * n.x, -2.0 * (n.y + 1.0) * n.x, -2.0 * n.x * n.z);
  vec3 t = n.y > -0.999999 ? normalize(tangent) : vec3(1.0, 0.0, 0.0), b = cross(n, t);
  float oz = max(dot(n, w), ${Math.cos(STEEPEST).toFixed(9)});
  vec2 aside = vec2(dot(t, w), dot(b, w));
  float across = length(aside);
  vec2 turned = across > 1e-6 ? aside / across : vec2(1.0, 0.0);
  vec3 x = turned.x * t + turned.y * b, y = turned.x * b - turned.y * t;
  float place = 1.0 - sqrt(max(1.0 - acos(min(oz, 1.0)) / ${STEEPEST.toFixed(9)}, 0.0)), level, up, turn, over;
  int low, first, second;
  vec3 sum = vec3(0.0), f;
  vec2 h, at;
  for (int q = 0; q < ${count}; q++) {
    if (dot(n, u_sun[q]) <= -u_sun_softness[q]) continue;
    float seen = sunSeen(q, position, n);
    if (seen <= 0.0) continue;
    f = vec3(0.0);
    int directions = u_sun_directions[q];
    for (int k = 0; k < directions; k++) {
      float angle = (float(k) + 0.5) * 2.3999632, out_ = directions == 1 ? 0.0 : u_sun_softness[q] * sqrt((float(k) + 0.5) / float(directions));
      vec3 d = normalize(u_sun[q] + out_ * (cos(angle) * u_sun_across[q] + sin(angle) * cross(u_sun[q], u_sun_across[q])));
      float z = dot(n, d);
      if (z <= 0.0) continue;
      h = vec2(dot(x, d) + across, dot(y, d)) / (z + oz);
${tables.map(tableLookUp).join("")}    }
    sum += seen * u_sun_light[q] * f / float(directions);
  }
  return sum / oz;
}
`;

/** Lines that add a table's value at the slopes h to f. Its numbers are its scale, width and period. */
function tableLookUp({ levels, turns, nodes, cosine, tinted }, k) {
  const rows = nodes * turns, from = (turn, layer) =>
    `textureLod(u_sun_table_${k}, vec3((at.y + 0.5) / ${nodes}.0, (at.x + 0.5 + float(${turn} * ${nodes})) / ${rows}.0, float(${layer})), 0.0).rgb`;
  const between = (turn) => `mix(${from(turn, "low")}, ${from(turn, "low + 1")}, up)`;
  const value = turns === 1 ? between("0") : `mix(${between("first")}, ${between("second")}, over)`;
  return `    level = place * ${levels - 1}.0;
    low = min(int(level), ${levels - 2});
    up = min(level - float(low), 1.0);
    at = (h / (u_sun_numbers_${k}.y + length(h)) + 1.0) * ${((nodes - 1) / 2).toFixed(1)};
${turns === 1 ? "" : `    turn = fract(atan(turned.y, turned.x) / u_sun_numbers_${k}.z) * ${turns}.0;
    over = fract(turn);
    first = int(turn) % ${turns};
    second = (first + 1) % ${turns};
`}    f += u_sun_numbers_${k}.x * ${cosine ? "" : "z * "}${tinted ? `(1.0 + mix(SUN_TINTED_${k}[low], SUN_TINTED_${k}[low + 1], up) * (tint - 1.0)) * ` : ""}${value};
`;
}

const SHADOW_VERTEX = `
layout(location = 0) in vec3 a_position;
uniform mat4 u_sun_camera;
void main() {
  gl_Position = u_sun_camera * vec4(a_position, 1.0);
}
`;

// The shadow maps of all suns: layers of a texture of depths, drawn anew where the sky was turned.
class ShadowsOnGpu {
  constructor(gl, suns, objects) {
    Object.assign(this, { gl, suns, turn: null });
    // A plane under the objects shades nothing.
    this.casters = objects.filter(({ object }) => !object.fade);
    Object.assign(this, enclosing(this.casters.map(({ object }) => object.positions)));
    this.program = makeProgram(gl, shaderText(SHADOW_VERTEX), shaderText(NOTHING), "the shadows");
    this.texture = makeTexture(gl, gl.TEXTURE_2D_ARRAY, gl.LINEAR);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.DEPTH_COMPONENT24, SHADOW, SHADOW, suns.length);
    // One texture is read in two ways: compared, and as it is.
    this.compared = gl.createSampler();
    gl.samplerParameteri(this.compared, gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE);
    gl.samplerParameteri(this.compared, gl.TEXTURE_COMPARE_FUNC, gl.LEQUAL);
    this.plain = gl.createSampler();
    for (const [sampler, filter] of [[this.compared, gl.LINEAR], [this.plain, gl.NEAREST]]) {
      for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.samplerParameteri(sampler, name, filter);
      for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.samplerParameteri(sampler, name, gl.CLAMP_TO_EDGE);
    }
    gl.bindSampler(SUN_UNITS.shadow, this.compared);
    gl.bindSampler(SUN_UNITS.depths, this.plain);
    this.frame = gl.createFramebuffer();
    // Points of flat triangles are lifted, or they would lie in the shadow of their neighbours.
    this.lift = Math.max((4 * this.radius) / SHADOW, ...this.casters.map(({ object }) => lifted(object)));
  }

  /** Brings the maps in line with the turn of the sky. */
  draw(turn) {
    if (turn === this.turn) return;
    const { gl } = this;
    this.turn = turn;
    this.directions = this.suns.map((sun) => sunDirection(sun, turn));
    this.cameras = this.directions.map((direction) => this.camera(direction));
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.viewport(0, 0, SHADOW, SHADOW);
    gl.useProgram(this.program.program);
    gl.enable(gl.DEPTH_TEST);
    this.cameras.forEach((camera, q) => {
      gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, this.texture, 0, q);
      gl.clear(gl.DEPTH_BUFFER_BIT);
      gl.uniformMatrix4fv(this.program.at("u_sun_camera"), false, camera);
      for (const each of this.casters) {
        gl.bindVertexArray(each.whole.drawing);
        gl.drawElements(gl.TRIANGLES, each.whole.indices, gl.UNSIGNED_INT, 0);
      }
    });
    gl.bindVertexArray(null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  /** The matrix (by columns) that takes the sphere round all casters to the cube of clip space, seen from a sun. */
  camera(direction) {
    const right = normalized(cross(Math.abs(direction[1]) < 0.99 ? [0, 1, 0] : [1, 0, 0], direction)), up = cross(direction, right);
    const rows = [right, up, scaled(direction, -1)].map((axis) => scaled(axis, 1 / this.radius));
    return Float32Array.from([0, 1, 2].flatMap((c) => [...rows.map((row) => row[c]), 0]).concat(rows.map((row) => -dot(row, this.middle)), 1));
  }

  /** Binds what `sunlight` reads of an object's `tables` at so many `directions` of each disc; dark suns where they are not `shining`. */
  bind(program, tables, directions, shining) {
    const { gl, suns } = this;
    const place = (unit, target, what, name) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(target, what);
      gl.uniform1i(program.at(name), unit);
    };
    tables.forEach(({ texture, scale, width, period }, k) => {
      place(SUN_UNITS.tables[k], gl.TEXTURE_2D_ARRAY, texture, `u_sun_table_${k}`);
      gl.uniform3f(program.at(`u_sun_numbers_${k}`), scale, width, period);
    });
    place(SUN_UNITS.shadow, gl.TEXTURE_2D_ARRAY, this.texture, "u_shadow");
    place(SUN_UNITS.depths, gl.TEXTURE_2D_ARRAY, this.texture, "u_depths");
    gl.activeTexture(gl.TEXTURE0);
    gl.uniformMatrix4fv(program.at("u_sun_camera"), false, Float32Array.from(this.cameras.flatMap((camera) => [...camera])));
    gl.uniform3fv(program.at("u_sun"), Float32Array.from(this.directions.flat()));
    gl.uniform3fv(program.at("u_sun_light"), Float32Array.from(suns.flatMap(({ irradiance }) => (shining ? irradiance : [0, 0, 0]))));
    gl.uniform1f(program.at("u_sun_lift"), this.lift);
    gl.uniform3fv(program.at("u_sun_across"), Float32Array.from(this.directions.flatMap((direction) => discAxes(direction)[0])));
    gl.uniform1iv(program.at("u_sun_directions"), Int32Array.from(directions));
    gl.uniform1fv(program.at("u_sun_softness"), Float32Array.from(suns, ({ radius }) => Math.tan(radius)));
  }
}

/** The middle of the box round some positions, and the radius of a sphere about it that holds them. */
function enclosing(all) {
  const low = [0, 0, 0].fill(Infinity), high = [0, 0, 0].fill(-Infinity);
  for (const positions of all) {
    positions.forEach((x, p) => { low[p % 3] = Math.min(low[p % 3], x); high[p % 3] = Math.max(high[p % 3], x); });
  }
  const middle = low.map((x, k) => (x + high[k]) / 2);
  return all.length ? { middle, radius: Math.hypot(...minus(high, middle)) } : { middle: [0, 0, 0], radius: 1 };
}

/** How far the middles of nineteen in twenty triangles lie under the tangent planes of their corners, at most. */
function lifted({ positions, normals, triangles }) {
  const count = triangles.length / 3, step = Math.max(1, Math.floor(count / 2000)), found = [];
  const at = (values, v) => [values[3 * v], values[3 * v + 1], values[3 * v + 2]];
  for (let t = 0; t < count; t += step) {
    const corners = [0, 1, 2].map((k) => triangles[3 * t + k]), places = corners.map((v) => at(positions, v));
    const middle = scaled(plus(plus(...places.slice(0, 2)), places[2]), 1 / 3);
    found.push(corners.reduce((sum, v, k) => sum + Math.max(0, dot(minus(places[k], middle), at(normals, v))), 0) / 3);
  }
  found.sort((a, b) => a - b);
  return found[Math.floor(0.95 * found.length)] ?? 0;
}
