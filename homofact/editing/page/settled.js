// The picture once nothing moves: as many pixels as the window has, with smooth outlines and the sky behind (enlarged.py).

// As enlarged.py has them: the reach of a precomputed pixel, how alike normals are, how far off the plane, in pixels.
const REACH = 0.5, ALIKE = 0.05, OFF = 2.0, UNLIKE = 1e-6, OTHER = 1e-12;
const LARGEST_SIDE = 2048, LARGEST_HALF = 60000;

const CAMERA = `
uniform vec3 u_eye, u_right, u_up, u_forward;
uniform vec2 u_half;
`;

const SURFACE_VERTEX = `
layout(location = 0) in vec3 a_position;
layout(location = 1) in vec3 a_normal;
uniform vec2 u_range;
centroid out vec3 v_position;
centroid out vec3 v_normal;
${CAMERA}
void main() {
  v_position = a_position;
  v_normal = a_normal;
  vec3 d = a_position - u_eye;
  float w = dot(d, u_forward), near = u_range.x, far = u_range.y;
  gl_Position = vec4(dot(d, u_right) / u_half.x, dot(d, u_up) / u_half.y, ((far + near) * w - 2.0 * far * near) / (far - near), w);
}
`;

// Radiance of precomputed pixels with the number of the object that each sees, and their normals and distances.
const SURFACE_FRAGMENT = `
centroid in vec3 v_position;
centroid in vec3 v_normal;
uniform highp sampler2D u_now, u_before, u_surface;
uniform vec2 u_size;
uniform float u_cut, u_thing;
uniform vec2 u_fade;
out vec4 colour;
${CAMERA}
${TONES}
vec3 taken(highp sampler2D radiance, vec3 n, vec3 p) {
  ivec2 size = textureSize(u_surface, 0);
  vec2 at = gl_FragCoord.xy / u_size;
  at = vec2(at.x, 1.0 - at.y) * vec2(size) - 0.5;
  ivec2 first = ivec2(floor(at)) - 1;
  float width = distance(p, u_eye) * 2.0 * u_half.y / float(size.y);
  vec4 total = vec4(0.0);
  for (int tap = 0; tap < 16; tap++) {
    ivec2 place = first + ivec2(tap & 3, tap >> 2);
    if (any(lessThan(place, ivec2(0))) || any(greaterThanEqual(place, size))) continue;
    vec4 own = texelFetch(radiance, place, 0);
    if (own.a < 0.0) continue;
    vec4 surface = texelFetch(u_surface, place, 0);
    vec2 away = vec2(place) - at, side = (vec2(place) + 0.5) / vec2(size) * 2.0 - 1.0;
    vec3 ray = normalize(u_forward + side.x * u_half.x * u_right - side.y * u_half.y * u_up);
    float off = dot(n, p - (u_eye + surface.w * ray)) / (${OFF.toFixed(1)} * width);
    float alike = exp(-(1.0 - dot(n, surface.xyz)) / ${ALIKE.toFixed(3)} - off * off) + ${UNLIKE.toExponential(1)};
    float weight = exp(-dot(away, away) / ${(2 * REACH ** 2).toFixed(3)}) * (own.a == u_thing ? alike : ${OTHER.toExponential(1)});
    total += weight * vec4(own.rgb, 1.0);
  }
  return total.rgb / max(total.a, 1e-30);
}

void main() {
  vec3 n = normalize(v_normal), own = gl_FragCoord.x < u_cut ? taken(u_before, n, v_position) : taken(u_now, n, v_position);
#ifdef FADES
  float alpha = 1.0 - smoothstep(u_fade.x, u_fade.y, length(v_position.xz));
#else
  float alpha = 1.0;
#endif
  colour = vec4(displayed(own) * alpha, alpha);
}
`;

const BEHIND_VERTEX = `
layout(location = 0) in vec2 a_corner;
out vec2 v_side;
void main() {
  v_side = a_corner;
  gl_Position = vec4(a_corner, 1.0, 1.0);
}
`;

const BEHIND_FRAGMENT = `
in vec2 v_side;
uniform highp sampler2D u_sky;
out vec4 colour;
${CAMERA}
${TONES}
void main() {
  vec3 d = u_forward + v_side.x * u_half.x * u_right + v_side.y * u_half.y * u_up;
  float u = atan(d.x, -d.z) / ${(2 * Math.PI).toFixed(9)} + 0.5, v = atan(length(d.xz), d.y) / ${Math.PI.toFixed(9)};
  colour = vec4(displayed(texture(u_sky, vec2(u, v)).rgb), 1.0);
}
`;

/** Right, up, forward and half the field's tangents across and up of a view's camera. */
function cameraOf({ camera: { eye, target, field }, width, height }) {
  const forward = normalized(minus(target, eye)), level = cross(forward, [0, 1, 0]);
  const right = Math.hypot(...level) > 1e-9 ? normalized(level) : [1, 0, 0], half = Math.tan((field * DEGREE) / 2);
  return { eye, right, up: cross(right, forward), forward, half: [(half * width) / height, half] };
}

/** What is behind the objects in a small picture: the sky at each pixel (W·H × 3), and what is left of each covered one. */
class Surroundings {
  constructor(view, meshes, sky) {
    const { width, height, numbers, objects, depth } = view, { eye, right, up, forward, half } = cameraOf(view);
    const ray = (number) => {
      const x = (((number % width) + 0.5) / width) * 2 - 1, y = 1 - ((Math.floor(number / width) + 0.5) / height) * 2;
      return normalized(forward.map((f, k) => f + x * half[0] * right[k] + y * half[1] * up[k]));
    };
    this.behind = new Float32Array(3 * width * height);
    if (sky) for (let p = 0; p < width * height; p++) lookUp(sky, ...ray(p), 1, this.behind, 3 * p);
    this.opaque = Float32Array.from(numbers, (number, p) => {
      const { fade } = meshes[objects[p]];
      if (!fade) return 1;
      const at = plus(eye, scaled(ray(number), depth[p])), x = clamped((Math.hypot(at[0], at[2]) - fade[0]) / (fade[1] - fade[0]), 0, 1);
      return 1 - x * x * (3 - 2 * x);
    });
  }

  /** The whole picture (W·H × 3) of radiance (P × C) of the covered pixels. */
  filled({ numbers, channels }, radiance, picture) {
    const { behind, opaque } = this;
    picture.set(behind);
    for (let p = 0; p < numbers.length; p++) {
      const to = 3 * numbers[p], share = opaque[p];
      for (let k = 0; k < 3; k++) picture[to + k] += share * (radiance[p * channels + (channels === 3 ? k : 0)] - behind[to + k]);
    }
    return picture;
  }
}

class Settled {
  /** Throws Trouble without WebGL 2. */
  constructor(canvas, meshes, sky) {
    this.canvas = canvas;
    this.gl = openContext(canvas, true);
    const { gl } = this;
    this.square = wholePicture(gl);
    this.programs = {
      whole: makeProgram(gl, shaderText(SURFACE_VERTEX), shaderText(SURFACE_FRAGMENT), "the picture"),
      fades: makeProgram(gl, shaderText(SURFACE_VERTEX), shaderText(SURFACE_FRAGMENT, { FADES: 1 }), "the ground"),
      behind: makeProgram(gl, shaderText(BEHIND_VERTEX), shaderText(BEHIND_FRAGMENT), "the sky"),
    };
    this.surfaces = meshes.map((mesh) => this.surface(mesh));
    this.textures = Object.fromEntries(["now", "before", "surface"].map((name) => [name, makeTexture(gl, gl.TEXTURE_2D, gl.NEAREST)]));
    this.sky = this.skyTexture(sky ?? { values: new Float32Array(3), rows: 1, columns: 1 });
    this.view = null;
  }

  surface({ positions, normals, triangles, fade }) {
    const { gl } = this, drawing = gl.createVertexArray();
    gl.bindVertexArray(drawing);
    [positions, normals].forEach((values, place) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
    });
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    return { drawing, count: triangles.length, fade };
  }

  skyTexture({ values, rows, columns }) {
    const { gl } = this, texture = makeTexture(gl, gl.TEXTURE_2D, gl.LINEAR), texels = new Float32Array(4 * rows * columns);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.REPEAT);
    for (let i = 0; i < rows * columns; i++) for (let k = 0; k < 3; k++) texels[4 * i + k] = Math.min(values[3 * i + k], LARGEST_HALF);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA16F, columns, rows, 0, gl.RGBA, gl.FLOAT, texels);
    return texture;
  }

  /** Brings values of the covered pixels over: `width` numbers each from `from(p, k)`, −1 in the fourth elsewhere. */
  upload(name, view, from) {
    const { gl } = this, { width, height, numbers } = view, texels = new Float32Array(4 * width * height);
    for (let i = 3; i < texels.length; i += 4) texels[i] = -1;
    for (let p = 0; p < numbers.length; p++) for (let k = 0; k < 4; k++) texels[4 * numbers[p] + k] = from(p, k);
    gl.bindTexture(gl.TEXTURE_2D, this.textures[name]);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, width, height, 0, gl.RGBA, gl.FLOAT, texels);
  }

  /** Draws radiance `now`, and `before` left of the share `cut` of the width, in so many pixels. */
  draw(view, now, before, cut, [width, height], exposure, curve) {
    const { gl, canvas } = this, { channels } = view, scale = Math.min(1, LARGEST_SIDE / Math.max(width, height));
    [canvas.width, canvas.height] = [width, height].map((side) => Math.max(Math.round(scale * side), 1));
    gl.activeTexture(gl.TEXTURE0);
    if (this.view !== view) this.upload("surface", view, (p, k) => (k < 3 ? view.normals[3 * p + k] / 32767 : view.depth[p]));
    this.view = view;
    const shown = (radiance) => (p, k) => (k < 3 ? radiance[p * channels + (channels === 3 ? k : 0)] : view.objects[p]);
    this.upload("now", view, shown(now));
    if (before) this.upload("before", view, shown(before));
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const camera = cameraOf(view), begin = (program) => this.begin(program, camera, exposure, curve);
    gl.disable(gl.DEPTH_TEST);
    begin(this.programs.behind);
    gl.bindTexture(gl.TEXTURE_2D, this.sky);
    gl.uniform1i(this.programs.behind.at("u_sky"), 0);
    gl.bindVertexArray(this.square);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.enable(gl.DEPTH_TEST);
    // What ends softly comes last, over the others.
    for (const soft of [false, true]) this.drawSurfaces(soft, begin, before ? cut * canvas.width : 0, view);
    gl.disable(gl.BLEND);
    gl.bindVertexArray(null);
  }

  begin({ program, at }, { eye, right, up, forward, half }, exposure, curve) {
    const { gl } = this;
    gl.useProgram(program);
    for (const [name, value] of Object.entries({ u_eye: eye, u_right: right, u_up: up, u_forward: forward })) gl.uniform3f(at(name), ...value);
    gl.uniform2f(at("u_half"), ...half);
    gl.uniform1f(at("u_exposure"), exposure);
    gl.uniform1i(at("u_filmic"), curve === "filmic" ? 1 : 0);
  }

  drawSurfaces(soft, begin, cut, view) {
    const { gl, canvas } = this, program = this.programs[soft ? "fades" : "whole"], { at } = program;
    begin(program);
    ["now", "before", "surface"].forEach((name, unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, this.textures[name]);
      gl.uniform1i(at(`u_${name}`), unit);
    });
    gl.activeTexture(gl.TEXTURE0);
    gl.uniform2f(at("u_size"), canvas.width, canvas.height);
    gl.uniform1f(at("u_cut"), cut);
    gl.uniform2f(at("u_range"), ...view.range);
    gl[soft ? "enable" : "disable"](gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    this.surfaces.forEach(({ drawing, count, fade }, thing) => {
      if (Boolean(fade) !== soft) return;
      if (fade) gl.uniform2f(at("u_fade"), ...fade);
      gl.uniform1f(at("u_thing"), thing);
      gl.bindVertexArray(drawing);
      gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 0);
    });
  }
}

/** The meshes, unpacked, and the sky; null where the light has no map. */
async function unpackMeshes(data) {
  const meshes = await Promise.all(data.meshes.map(async ({ low, step, positions, normals, triangles, fade }) => {
    const [places, turned, corners] = await Promise.all([unpack(positions), unpack(normals), unpack(triangles)]);
    accumulate(corners, 1, corners.length);
    return {
      positions: Float32Array.from(places, (code, i) => low[i % 3] + step[i % 3] * code), normals: Float32Array.from(turned, (code) => code / 32767),
      triangles: new Uint32Array(corners), fade,
    };
  }));
  const { sky } = data;
  if (!sky) return [meshes, null];
  return [meshes, softened({ values: fromHalves(await unpack(sky.values), sky.scale), rows: sky.rows, columns: sky.columns })];
}

/** The nearest and farthest that a camera sees of meshes, with room. */
function rangeOf(view, meshes) {
  const { eye, forward } = cameraOf(view);
  let near = Infinity, far = 0;
  for (const { positions } of meshes) {
    for (let i = 0; i < positions.length; i += 3) {
      const w = (positions[i] - eye[0]) * forward[0] + (positions[i + 1] - eye[1]) * forward[1] + (positions[i + 2] - eye[2]) * forward[2];
      near = Math.min(near, w);
      far = Math.max(far, w);
    }
  }
  return [Math.max(0.9 * near, 1e-3 * far, 1e-6), 1.1 * far];
}
