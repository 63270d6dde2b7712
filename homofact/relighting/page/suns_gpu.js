// Suns and lamps on the graphics card: their light at each pixel, and shadow maps. Those of suns turn with the sky.

// Samples of a shadow map per pixel; lights at most. A lamp near the objects has maps on the six faces of a cube, each a
// little wider than 90°, so that the samples round a pixel stay on one face.
const SHADOW_TAPS = 24, MOST_LIGHTS = 8, FACE = 1.2;
// Of a shadow map, where there are few layers of them, and where there are more.
const SHADOW = 2048, SHADOW_SMALL = 1024, FEW_LAYERS = 8;
const SUN_UNITS = { tables: [5, 6, 10], shadow: 7, depths: 8 };

/** `besideSky(position, normal)`; u_eye stands before it. */
const lightSum = ({ tables }, count) => `
${GRID_PLACE}uniform highp sampler2DArrayShadow u_shadow;
uniform highp sampler2DArray u_depths;
// The direction to a sun and 0, or the place of a lamp and its radius; what it sends; half of a sun's angle.
uniform vec4 u_light_at[${count}];
uniform vec3 u_light[${count}];
uniform float u_light_angle[${count}];
uniform int u_light_directions[${count}];
// Its shadow map: rows right, up and away from the light; of a sun the middle and the inverse of the radius of what casts
// shadows, of a lamp the tangent of half the field, A and B of the depth A − B/z, and the nearest caster's depth; how
// wide a penumbra is for each unit of depth; its first layer and how many there are.
uniform mat3 u_light_axes[${count}];
uniform vec4 u_light_map[${count}];
uniform float u_light_softness[${count}];
uniform ivec2 u_light_layer[${count}];
uniform float u_sun_lift;
// The width of the material's lobe.
uniform float u_light_width;
${tables.map((_, k) => `uniform highp sampler2DArray u_sun_table_${k};\nuniform vec3 u_sun_numbers_${k};`).join("\n")}
${tables.map((table, k) => tintedParts(`SUN_TINTED_${k}`, table)).join("")}

/** Points of a disc, spread evenly. */
vec2 spread(int k, float turn) {
  float angle = (float(k) + 0.5) * 2.3999632 + turn;
  return sqrt((float(k) + 0.5) / ${SHADOW_TAPS}.0) * vec2(cos(angle), sin(angle));
}

/** A direction as the face of a lamp's cube sees it, the last number away from the lamp; both of the same face. */
void toFace(inout vec3 e, inout vec3 n, inout int layer) {
  vec3 a = abs(e);
  int axis = a.x >= a.y && a.x >= a.z ? 0 : a.y >= a.z ? 1 : 2;
  float side = sign(e[axis]);
  layer += 2 * axis + (side < 0.0 ? 1 : 0);
  e = vec3(e[(axis + 1) % 3], e[(axis + 2) % 3], side * e[axis]);
  n = vec3(n[(axis + 1) % 3], n[(axis + 2) % 3], side * n[axis]);
}

/** The part of a light's disc that is seen (percentage-closer soft shadows, Fernando 2005). */
float discSeen(int q, vec3 position, vec3 n) {
  vec3 lifted = position + u_sun_lift * n, place;
  vec4 map = u_light_map[q];
  int layer = u_light_layer[q].x;
  float reach = 0.5;
  // Samples lie on the tangent plane: at one depth, a slope would lie in its own shadow.
  vec2 tilt;
  if (u_light_at[q].w == 0.0) {
    place = 0.5 * (map.w * (u_light_axes[q] * (lifted - map.xyz))) + 0.5;
    vec3 slope = u_light_axes[q] * n;
    tilt = slope.xy / max(-slope.z, 0.1);
  } else {
    vec3 e = lifted - u_light_at[q].xyz, m = n;
    // Of a plane the depth in a perspective map is linear over the map.
    float plane = min(dot(e, n), -0.1 * length(e));
    if (u_light_layer[q].y == 6) toFace(e, m, layer);
    else { e = u_light_axes[q] * e; m = u_light_axes[q] * m; }
    if (e.z <= 0.0) return 1.0;
    place = 0.5 * vec3(e.xy / (map.x * e.z), map.y - map.z / e.z) + 0.5;
    tilt = -map.z * map.x * m.xy / plane;
    reach = max(place.z - map.w, 0.0);
  }
  if (any(greaterThan(abs(place.xy - 0.5), vec2(0.5)))) return 1.0;
  // The pattern is turned from pixel to pixel, or its steps would show in wide penumbrae.
  float turn = 6.2831853 * fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
  float away = 0.0, found = 0.0, sum = 0.0;
  for (int k = 0; k < ${SHADOW_TAPS}; k++) {
    vec2 aside = reach * u_light_softness[q] * spread(k, turn);
    float depth = texture(u_depths, vec3(place.xy + aside, float(layer))).r, gap = place.z + dot(tilt, aside) - depth;
    if (gap > 0.0 && depth < 1.0) { away += gap; found += 1.0; }
  }
  if (found == 0.0) return 1.0;
  // As wide as the disc looks from where it is hidden.
  float wide = max(u_light_softness[q] * away / found, 1.0 / float(textureSize(u_depths, 0).x));
  for (int k = 0; k < ${SHADOW_TAPS}; k++) {
    vec2 aside = wide * spread(k, turn);
    sum += texture(u_shadow, vec4(place.xy + aside, float(layer), min(place.z + dot(tilt, aside), 1.0)));
  }
  return sum / ${SHADOW_TAPS}.0;
}

/** A direction at an angle round an axis, whose cosine with it is given. */
vec3 aside_(vec3 axis, float along, float angle) {
  vec3 least = abs(axis), other = least.x <= least.y && least.x <= least.z ? vec3(1.0, 0.0, 0.0) : least.y <= least.z ? vec3(0.0, 1.0, 0.0) : vec3(0.0, 0.0, 1.0);
  vec3 across = normalize(cross(axis, other));
  return along * axis + sqrt(max(1.0 - along * along, 0.0)) * (cos(angle) * across + sin(angle) * cross(axis, across));
}

vec3 besideSky(vec3 position, vec3 normal) {
  vec3 w = normalize(u_eye - position), n = normalize(normal);
  // A normal that is turned away, at an outline, is bent back until it is seen.
  n = normalize(n + max(${BENT} - dot(n, w), 0.0) * w);
  // Light arrives above the surface's own horizon.
  vec3 horizon = n;
#ifdef BUMPED
  n = mappedNormal(n, w);
#endif
  vec3 tangent = vec3((n.y + 1.0) * (n.y + 1.0) + n.z * n.z - n.x * n.x, -2.0 * (n.y + 1.0) * n.x, -2.0 * n.x * n.z);
  vec3 t = n.y > -0.999999 ? normalize(tangent) : vec3(1.0, 0.0, 0.0), b = cross(n, t);
  float oz = max(dot(n, w), ${Math.cos(STEEPEST).toFixed(9)});
  vec2 aside = vec2(dot(t, w), dot(b, w));
  float across = length(aside);
  vec2 turned = across > 1e-6 ? aside / across : vec2(1.0, 0.0);
  vec3 x = turned.x * t + turned.y * b, y = turned.x * b - turned.y * t;
  float place = placeOfView(oz), level, up, turn, over;
  int low, first, second;
  vec3 sum = vec3(0.0), f, reflected, mirror = normalize(2.0 * dot(n, w) * n - w);
  vec2 h, at;
  for (int q = 0; q < ${count}; q++) {
    if (u_light[q] == vec3(0.0)) continue;
    // The cone that the light fills, as coneAt has it.
    vec3 middle = u_light_at[q].xyz, sent = u_light[q];
    float half_ = u_light_angle[q];
    if (u_light_at[q].w > 0.0) {
      vec3 towards = middle - position;
      float distance_ = max(length(towards), u_light_at[q].w * 1.000001);
      middle = normalize(towards);
      half_ = asin(min(u_light_at[q].w / distance_, 1.0));
      sent /= distance_ * distance_;
    }
    if (dot(n, middle) <= -sin(half_)) continue;
    float seen = discSeen(q, position, horizon);
    if (seen <= 0.0) continue;
    f = vec3(0.0);
    int directions = u_light_directions[q];
    // As lightDirections has them: first those that follow the lobe, then those of the whole cone.
    int following = directions < ${FOLLOWING} ? 0 : directions, all = directions < ${FOLLOWING} ? directions : directions + ${LOBE_FEW};
    float cone = 1.0 - cos(half_), facing = ${Math.PI.toFixed(9)} * sin(half_) * sin(half_);
    float reach = min(${LOBE_REACH}.0 * u_light_width, ${LOBE_WIDEST}), whole = reach * reach / (u_light_width * u_light_width + reach * reach);
    for (int k = 0; k < all; k++) {
      bool follows = k < following;
      int place_ = follows ? k : k - following, of = follows ? following : all - following;
      float u = (float(place_) + 0.5) / float(of), angle = (float(place_) + 0.5) * 2.3999632, part;
      vec3 d = middle;
      if (directions == 1) part = 1.0;
      else if (follows) {
        float x_ = whole * u, beta = u_light_width * sqrt(x_ / (1.0 - x_));
        d = aside_(mirror, cos(beta), angle);
        if (dot(d, middle) < 1.0 - cone) continue;
        part = ${Math.PI.toFixed(9)} * sin(beta) * u_light_width * sqrt((1.0 - x_) / x_) / ((1.0 - x_) * (1.0 - x_)) * whole / (float(of) * facing);
      } else {
        d = aside_(middle, 1.0 - cone * u, angle);
        if (following > 0 && dot(d, mirror) >= cos(reach)) continue;
        part = ${(2 * Math.PI).toFixed(9)} * cone / (float(of) * facing);
      }
      float z = dot(n, d);
      if (z <= 0.0 || dot(horizon, d) <= 0.0) continue;
      h = vec2(dot(x, d) + across, dot(y, d)) / (z + oz);
      reflected = vec3(0.0);
${tables.map(tableLookUp).join("")}      f += part * reflected;
    }
    sum += seen * sent * f;
  }
  return sum / oz;
}
`;

/** Lines that add a table's value at the slopes h to `reflected`. Its numbers are its scale, width and period. */
function tableLookUp({ levels, turns, along, around, whole, cosine, tinted }, k) {
  const rows = along * turns, from = (turn, layer) =>
    `textureLod(u_sun_table_${k}, vec3((at.x + 0.5) / ${around}.0, (at.y + 0.5 + float(${turn} * ${along})) / ${rows}.0, float(${layer})), 0.0).rgb`;
  const between = (turn) => `mix(${from(turn, "low")}, ${from(turn, "low + 1")}, up)`;
  const value = turns === 1 ? between("0") : `mix(${between("first")}, ${between("second")}, over)`;
  return `    level = place * ${levels - 1}.0;
    low = min(int(level), ${levels - 2});
    up = min(level - float(low), 1.0);
    at = gridPlace(h, u_sun_numbers_${k}.y, ${whole}) * vec2(${around - 1}.0, ${along - 1}.0);
${turns === 1 ? "" : `    turn = fract(atan(turned.y, turned.x) / u_sun_numbers_${k}.z) * ${turns}.0;
    over = fract(turn);
    first = int(turn) % ${turns};
    second = (first + 1) % ${turns};
`}    reflected += u_sun_numbers_${k}.x * ${cosine ? "" : "z * "}${tinted ? `(1.0 + mix(SUN_TINTED_${k}[low], SUN_TINTED_${k}[low + 1], up) * (tint - 1.0)) * ` : ""}${value};
`;
}

const SHADOW_VERTEX = `
layout(location = 0) in vec3 a_position;
uniform mat4 u_sun_camera;
void main() {
  gl_Position = u_sun_camera * vec4(a_position, 1.0);
}
`;

// The shadow maps of all lights: layers of a texture of depths. Those of suns are drawn again where the sky was turned.
class ShadowsOnGpu {
  constructor(gl, lights, objects) {
    Object.assign(this, { gl, lights, turn: null });
    // A plane under the objects shades nothing.
    this.casters = objects.filter(({ object }) => !object.fade);
    Object.assign(this, enclosing(this.casters.map(({ object }) => object.positions)));
    this.program = makeProgram(gl, shaderText(SHADOW_VERTEX), shaderText(NOTHING), "the shadows");
    this.texture = makeTexture(gl, gl.TEXTURE_2D_ARRAY, gl.LINEAR);
    let layers = 0;
    this.maps = lights.map((light) => {
      const map = light.position ? this.lampMap(light) : { layers: 1 };
      map.first = layers;
      layers += map.layers;
      return map;
    });
    this.size = layers > FEW_LAYERS ? SHADOW_SMALL : SHADOW;
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.DEPTH_COMPONENT24, this.size, this.size, layers);
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
    this.lift = Math.max((4 * this.radius) / this.size, ...this.casters.map(({ object }) => lifted(object)));
  }

  /** Brings the maps in line with the turn of the sky. */
  draw(turn) {
    if (turn === this.turn) return;
    const { gl, lights } = this, first = this.turn === null;
    this.turn = turn;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.viewport(0, 0, this.size, this.size);
    gl.useProgram(this.program.program);
    gl.enable(gl.DEPTH_TEST);
    lights.forEach((light, q) => {
      const map = this.maps[q];
      if (!light.position) Object.assign(map, this.sunMap(sunDirection(light, turn), light.radius));
      else if (!first) return;
      map.cameras.forEach((camera, k) => this.cast(camera, map.first + k));
    });
    gl.bindVertexArray(null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  /** Draws what casts shadows, as a camera sees it, into a layer. */
  cast(camera, layer) {
    const { gl } = this;
    gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, this.texture, 0, layer);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix4fv(this.program.at("u_sun_camera"), false, camera);
    for (const each of this.casters) {
      gl.bindVertexArray(each.whole.drawing);
      gl.drawElements(gl.TRIANGLES, each.whole.indices, gl.UNSIGNED_INT, 0);
    }
  }

  /** The map of a sun: the sphere round all casters fills the cube of clip space. */
  sunMap(direction, radius) {
    const axes = axesAlong(scaled(direction, -1)), rows = axes.map((axis) => scaled(axis, 1 / this.radius));
    const camera = byColumns([...rows.map((row) => [...row, -dot(row, this.middle)]), [0, 0, 0, 1]]);
    return { at: [...direction, 0], axes, map: [...this.middle, 1 / this.radius], softness: Math.tan(radius), cameras: [camera] };
  }

  /** The map of a lamp: one round the sphere of all casters, or a cube's six where the lamp is near or within it. */
  lampMap({ position, radius }) {
    const towards = minus(this.middle, position), distance = Math.hypot(...towards), far = distance + this.radius;
    const single = distance > 1.2 * this.radius, near = single ? distance - this.radius : radius / 2;
    const field = single ? (1.02 * this.radius) / Math.sqrt(distance ** 2 - this.radius ** 2) : FACE;
    const a = (far + near) / (far - near), b = (2 * far * near) / (far - near);
    const camera = (rows) => byColumns([
      [...scaled(rows[0], 1 / field), -dot(rows[0], position) / field], [...scaled(rows[1], 1 / field), -dot(rows[1], position) / field],
      [...scaled(rows[2], a), -a * dot(rows[2], position) - b], [...rows[2], -dot(rows[2], position)],
    ]);
    const unit = [[1, 0, 0], [0, 1, 0], [0, 0, 1]], axes = axesAlong(normalized(towards));
    const faces = [0, 1, 2].flatMap((k) => [1, -1].map((side) => [unit[(k + 1) % 3], unit[(k + 2) % 3], scaled(unit[k], side)]));
    // A face's depth of a place is at most √3 less than its distance.
    const nearest = Math.max(near, Math.min(...this.casters.map(({ object }) => nearestVertex(object.positions, position))) / (single ? 1 : Math.sqrt(3)));
    return {
      at: [...position, radius], axes, map: [field, a, b, 0.5 * (a - b / nearest) + 0.5], softness: radius / (field * b),
      layers: single ? 1 : 6, cameras: (single ? [axes] : faces).map(camera),
    };
  }

  /** Binds what `besideSky` reads of an object's `tables` at so many `directions` of each disc, by a lobe's `width`; the lights as bright as they are `shining`. */
  bind(program, tables, { directions, width }, shining) {
    const { gl, lights, maps } = this;
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
    gl.uniform4fv(program.at("u_light_at"), Float32Array.from(maps.flatMap(({ at }) => at)));
    gl.uniform3fv(program.at("u_light"), Float32Array.from(lights.flatMap((light, q) => scaled(light.intensity ?? light.irradiance, shining[q]))));
    gl.uniform1fv(program.at("u_light_angle"), Float32Array.from(lights, ({ radius }) => radius));
    gl.uniform1iv(program.at("u_light_directions"), Int32Array.from(directions));
    gl.uniformMatrix3fv(program.at("u_light_axes"), false, Float32Array.from(maps.flatMap(({ axes }) => [0, 1, 2].flatMap((c) => axes.map((row) => row[c])))));
    gl.uniform4fv(program.at("u_light_map"), Float32Array.from(maps.flatMap(({ map }) => map)));
    gl.uniform1fv(program.at("u_light_softness"), Float32Array.from(maps, ({ softness }) => softness));
    gl.uniform2iv(program.at("u_light_layer"), Int32Array.from(maps.flatMap(({ first, layers }) => [first, layers])));
    gl.uniform1f(program.at("u_sun_lift"), this.lift);
    gl.uniform1f(program.at("u_light_width"), width);
  }
}

/** Directions right and up across a direction, and itself. */
function axesAlong(direction) {
  const right = normalized(cross(direction, Math.abs(direction[1]) < 0.99 ? [0, 1, 0] : [1, 0, 0]));
  return [right, cross(right, direction), direction];
}

/** Four rows of four numbers as WebGL takes a matrix. */
function byColumns(rows) {
  return Float32Array.from([0, 1, 2, 3].flatMap((c) => rows.map((row) => row[c])));
}

/** The distance of the nearest of some positions from a place. */
function nearestVertex(positions, place) {
  let least = Infinity;
  for (let p = 0; p < positions.length; p += 3) {
    least = Math.min(least, Math.hypot(positions[p] - place[0], positions[p + 1] - place[1], positions[p + 2] - place[2]));
  }
  return least;
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
