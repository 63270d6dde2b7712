// A normal map: at vertices on the processor, at pixels on the graphics card (scene/normal_map.py, tilted_view.py).

const BUMP_UNITS = { map: 11, view: 12, tilts: 13, frames: 14 };
// Bytes of a normal: 128 is 0.
const normalOf = (byte) => Math.max((byte - 128) / 127, -1);

/** Unpacks a normal map with what tilted normals make of the terms. */
async function unpackBumps(packed) {
  const names = ["texels", "uv", "tangents", "view", "tilts", "entries"];
  const arrays = await Promise.all(names.map((name) => unpack(packed[name])));
  return { ...packed, ...Object.fromEntries(names.map((name, k) => [name, arrays[k]])) };
}

/** The mapped normals (V × 3) of the vertices, whose own are `normals`. */
function mappedNormals({ width, height, texels, uv, tangents }, normals) {
  const found = new Float32Array(normals.length), around = (k, size) => ((k % size) + size) % size;
  for (let v = 0; v < normals.length / 3; v++) {
    const x = (uv[2 * v] - Math.floor(uv[2 * v])) * width - 0.5, y = (uv[2 * v + 1] - Math.floor(uv[2 * v + 1])) * height - 0.5;
    const left = Math.floor(x), top = Math.floor(y), a = x - left, b = y - top, m = [0, 0, 0];
    for (const [row, column, share] of [[top, left, (1 - a) * (1 - b)], [top, left + 1, a * (1 - b)], [top + 1, left, (1 - a) * b], [top + 1, left + 1, a * b]]) {
      const texel = 3 * (around(row, height) * width + around(column, width));
      for (let k = 0; k < 3; k++) m[k] += share * normalOf(texels[texel + k]);
    }
    const n = Array.from(normals.subarray(3 * v, 3 * v + 3)), given = Array.from(tangents.subarray(4 * v, 4 * v + 3));
    const t = normalized(minus(given, scaled(n, dot(given, n)))), s = cross(n, t), sign = tangents[4 * v + 3] < 0 ? -1 : 1;
    found.set(normalized([0, 1, 2].map((k) => m[0] * t[k] + sign * m[1] * s[k] + m[2] * n[k])), 3 * v);
  }
  return found;
}

/** A normal that is turned away from the view `w`, bent back until it is seen. */
function bentBack(normal, w) {
  return normalized(plus(Array.from(normal), scaled(w, Math.max(BENT - dot(normal, w), 0))));
}

/** The tangent that goes with a normal (meshes/tangents.py). */
function tangentOf([x, y, z]) {
  return y > -0.999999 ? normalized([(y + 1) ** 2 + z ** 2 - x ** 2, -2 * (y + 1) * x, -2 * x * z]) : [1, 0, 0];
}

/** What an object's vertices are shaded in: its own normals and tangents (V × 3), or those of a normal map, seen from the eye. */
function shadingFrames(object, eye) {
  if (!object.bumps) return object;
  const { positions, bumps: { mapped } } = object, normals = new Float32Array(mapped.length), tangents = new Float32Array(mapped.length);
  for (let p = 0; p < mapped.length; p += 3) {
    const w = normalized([0, 1, 2].map((k) => eye[k] - positions[p + k])), n = bentBack(mapped.subarray(p, p + 3), w);
    normals.set(n, p);
    tangents.set(tangentOf(n), p);
  }
  return { normals, tangents };
}

/** Bilinear shares of a place (u, v) of a square of `size` nodes: [row, column, share]. */
function bilinearParts(u, v, size) {
  const i = Math.max(Math.min(Math.floor(u), size - 2), 0), j = Math.max(Math.min(Math.floor(v), size - 2), 0), a = u - i, b = v - j;
  return [[i, j, (1 - a) * (1 - b)], [i, j + 1, (1 - a) * b], [i + 1, j, a * (1 - b)], [i + 1, j + 1, a * b]];
}

/** As `shade`, of an object with a normal map: the terms under the mapped normals of the vertices (tilt_kernels.py). */
function shadeTilted(object, eye, terms) {
  const { positions, normals, tangents, vertices, tuples, bumps, tinted, map: { size, channels } } = object, tints = object.tint?.vertices;
  const { view, tilts, entries, reach, nodes } = bumps, slots = tilts.length / nodes ** 2, all = view.length / size ** 2;
  const found = new Float32Array(3 * vertices), stride = 4 * object.quads, shown = shadingFrames(object, eye).normals;
  for (let v = 0, p = 0; v < vertices; v++, p += 3) {
    const w = normalized([0, 1, 2].map((k) => eye[k] - positions[p + k]));
    const n = Array.from(normals.subarray(p, p + 3)), s = Array.from(tangents.subarray(p, p + 3)), frame = [s, cross(n, s), n];
    if (dot(n, w) <= 0) continue;
    let [x, y, z] = frame.map((axis) => dot(axis, shown.subarray(p, p + 3)));
    const across = Math.hypot(x, y), short = z < 0 || across > reach ? reach / Math.max(across, 1e-12) : 1;
    x *= short;
    y *= short;
    z = Math.sqrt(Math.max(1 - x * x - y * y, 0));
    const [ox, oy, oz] = frame.map((axis) => dot(axis, w)), along = (x * ox + y * oy) / (1 + z) + oz;
    let [wx, wy, wz] = [ox - x * along, oy - y * along, x * ox + y * oy + z * oz];
    if (wz < 0) [wx, wy, wz] = [wx / Math.hypot(wx, wy), wy / Math.hypot(wx, wy), 0];
    const place = (k) => clamped((k / (1 + wz)) * 0.5 * size + 0.5 * size - 0.5, 0, size - 1);
    const seen = bilinearParts(place(wx), place(wy), size), tilt = bilinearParts(((x / reach + 1) * (nodes - 1)) / 2, ((y / reach + 1) * (nodes - 1)) / 2, nodes);
    for (let e = 0; e < entries.length; e += 3) {
      const [j, k, slot] = entries.subarray(e, e + 3);
      if (j >= terms) continue;
      let h = 0;
      for (const [a, b, share] of tilt) h += share * tilts[(a * nodes + b) * slots + slot];
      for (let c = 0; c < 3; c++) {
        let value = 0;
        for (const [a, b, share] of seen) value += share * view[(a * size + b) * all + k * channels + (channels === 3 ? c : 0)];
        found[p + c] += h * value * tuples[v * stride + 3 * j + c] * (tinted[j] && tints ? tints[p + c] : 1);
      }
    }
  }
  return found;
}

/** GLSL: `mappedNormal(n, w)`, the normal that a pixel is shaded with, of the surface's own and the view. Beside a reference that of the vertices. */
const MAPPED_NORMAL = `
#ifdef BUMPED
in vec4 v_along;
uniform sampler2D u_bumps;
#ifdef COMPARED
in vec3 v_mapped;
#endif
vec3 mappedNormal(vec3 n, vec3 w) {
#ifdef COMPARED
  vec3 found = normalize(v_mapped);
#else
  vec3 m = texture(u_bumps, v_place).xyz * (255.0 / 127.0) - 128.0 / 127.0;
  vec3 t = normalize(v_along.xyz - dot(v_along.xyz, n) * n), b = (v_along.w < 0.0 ? -1.0 : 1.0) * cross(n, t);
  vec3 found = normalize(m.x * t + m.y * b + m.z * n);
#endif
  return normalize(found + max(${BENT} - dot(found, w), 0.0) * w);
}
#endif
`;

/**
 * GLSL: `tiltedAt(vertex, share, m, w)` adds to `tiltedSum` and `tiltedTints`, which a texture multiplies, the light of the
 * terms as a vertex has it under a mapped normal m towards w. u_tuples and u_terms stand before it.
 */
function tiltedTerms({ bumps: { entries, tilts, nodes }, tinted, quads }) {
  const layers = Math.ceil(tilts.length / nodes ** 2 / 4), views = new Map(), component = (k) => "xyzw"[k & 3];
  for (let e = 0; e < entries.length; e += 3) {
    const [j, k, slot] = entries.subarray(e, e + 3);
    views.set(k, [...(views.get(k) ?? []), [j, slot]]);
  }
  const number = (k) => `t[${k >> 2}].${component(k)}`;
  const lines = [...views].map(([k, parts]) => `  h = textureLod(u_tilt_view, vec3(at, ${k}.0), 0.0).rgb * share;
${parts.map(([j, slot]) => `  if (u_terms > ${j}) ${tinted[j] ? "tiltedTints" : "tiltedSum"} += h * tilt[${slot >> 2}].${component(slot)} * vec3(${number(3 * j)}, ${number(3 * j + 1)}, ${number(3 * j + 2)});`).join("\n")}`);
  return `
uniform highp sampler2D u_frames;
uniform highp sampler2DArray u_tilt_view;
uniform highp sampler2DArray u_tilts;
uniform float u_reach;
vec3 tiltedSum = vec3(0.0), tiltedTints = vec3(0.0);

vec3 frameAxis(int vertex, int part) {
  int width = textureSize(u_frames, 0).x, at = 2 * vertex + part;
  return texelFetch(u_frames, ivec2(at % width, at / width), 0).xyz;
}

void tiltedAt(int vertex, float share, vec3 m, vec3 w) {
  vec3 n = frameAxis(vertex, 0), s = frameAxis(vertex, 1), b = cross(n, s);
  vec3 local = vec3(dot(s, m), dot(b, m), dot(n, m)), o = vec3(dot(s, w), dot(b, w), dot(n, w));
  float across = length(local.xy);
  // No farther than the farthest tilt.
  if (local.z < 0.0 || across > u_reach) local.xy *= u_reach / max(across, 1e-12);
  local.z = sqrt(max(1.0 - dot(local.xy, local.xy), 0.0));
  float along = dot(local.xy, o.xy) / (1.0 + local.z) + o.z;
  vec3 view = vec3(o.xy - local.xy * along, dot(local, o));
  vec2 disc = view.z > 0.0 ? view.xy / (1.0 + view.z) : view.xy / max(length(view.xy), 1e-6);
  // The first axis of the maps is their rows.
  vec2 at = 0.5 * disc.yx + 0.5, place = ((0.5 * local.yx / u_reach + 0.5) * ${nodes - 1}.0 + 0.5) / ${nodes}.0;
  vec4 tilt[${layers}], t[QUADS];
  for (int q = 0; q < ${layers}; q++) tilt[q] = textureLod(u_tilts, vec3(place, float(q)), 0.0);
  int width = textureSize(u_tuples, 0).x;
  for (int q = 0; q < QUADS; q++) t[q] = texelFetch(u_tuples, ivec2((vertex * QUADS + q) % width, (vertex * QUADS + q) / width), 0);
  vec3 h;
${lines.join("\n")}
}
`;
}

// A normal map on the graphics card, the functions of tilt, and the frames of the vertices.
class BumpsOnGpu {
  constructor(gl, object) {
    const { bumps, normals, tangents, map: { size, channels } } = object, { width, height, texels, view, tilts, nodes } = bumps;
    Object.assign(this, { gl, reach: bumps.reach });
    this.map = repeatedTexture(gl, gl.RGBA8, width, height, texels);
    const kind = gl.linearFloats ? gl.RGBA32F : gl.RGBA16F, layered = (side, count, values) => {
      const texture = makeTexture(gl, gl.TEXTURE_2D_ARRAY, gl.LINEAR);
      gl.texImage3D(gl.TEXTURE_2D_ARRAY, 0, kind, side, side, count, 0, gl.RGBA, gl.FLOAT, values);
      return texture;
    };
    this.view = layered(size, view.length / channels / size ** 2, viewLayers(view, size, channels));
    const slots = tilts.length / nodes ** 2, layers = Math.ceil(slots / 4), values = new Float32Array(4 * layers * nodes ** 2);
    for (let at = 0; at < nodes ** 2; at++) {
      for (let slot = 0; slot < slots; slot++) values[4 * ((slot >> 2) * nodes ** 2 + at) + (slot & 3)] = tilts[at * slots + slot];
    }
    this.tilts = layered(nodes, layers, values);
    const count = (2 * normals.length) / 3, across = Math.min(count, 2048), rows = Math.ceil(count / across), frames = new Float32Array(4 * across * rows);
    for (let v = 0; v < normals.length / 3; v++) {
      frames.set(normals.subarray(3 * v, 3 * v + 3), 8 * v);
      frames.set(tangents.subarray(3 * v, 3 * v + 3), 8 * v + 4);
    }
    this.frames = makeTexture(gl, gl.TEXTURE_2D, gl.NEAREST);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, across, rows, 0, gl.RGBA, gl.FLOAT, frames);
  }

  /** Binds what `mappedNormal` and `tiltedAt` read. */
  bind(program) {
    const { gl } = this;
    const place = (unit, target, what, name) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(target, what);
      gl.uniform1i(program.at(name), unit);
    };
    place(BUMP_UNITS.map, gl.TEXTURE_2D, this.map, "u_bumps");
    place(BUMP_UNITS.view, gl.TEXTURE_2D_ARRAY, this.view, "u_tilt_view");
    place(BUMP_UNITS.tilts, gl.TEXTURE_2D_ARRAY, this.tilts, "u_tilts");
    place(BUMP_UNITS.frames, gl.TEXTURE_2D, this.frames, "u_frames");
    gl.activeTexture(gl.TEXTURE0);
    gl.uniform1f(program.at("u_reach"), this.reach);
  }
}
