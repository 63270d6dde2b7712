// WebGL 2: a context, programs, textures, tones, with what is missing said in a line.

/** A WebGL 2 context, or Trouble in a line. */
function openContext(canvas) {
  const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, powerPreference: "high-performance" });
  if (!gl) {
    throw new Trouble("This page draws with WebGL 2, which is not available here.",
      "Open it in a current Chrome, Edge, Firefox or Safari with hardware acceleration switched on in its settings.");
  }
  // Without it view maps are half floats, which every WebGL 2 interpolates.
  gl.linearFloats = Boolean(gl.getExtension("OES_texture_float_linear"));
  return gl;
}

/** A program with its uniforms' places by name; `kept` names what transform feedback keeps. */
function makeProgram(gl, vertex, fragment, what, kept = null) {
  const program = gl.createProgram();
  for (const [type, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
      throw new Trouble(`The shader of ${what} does not compile on this machine.`, "Newer graphics drivers may help.", gl.getShaderInfoLog(shader));
    }
  }
  if (kept) gl.transformFeedbackVaryings(program, [kept], gl.INTERLEAVED_ATTRIBS);
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
    throw new Trouble(`The shader of ${what} does not link on this machine.`, "Newer graphics drivers may help.", gl.getProgramInfoLog(program));
  }
  const places = new Map();
  return {
    program,
    at(name) {
      if (!places.has(name)) places.set(name, gl.getUniformLocation(program, name));
      return places.get(name);
    },
  };
}

function makeTexture(gl, target, filter) {
  const texture = gl.createTexture();
  gl.bindTexture(target, texture);
  for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(target, name, filter);
  for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(target, name, gl.CLAMP_TO_EDGE);
  return texture;
}

const TONES = `
uniform float u_exposure;
uniform int u_filmic;

// render/tonemap.py: radiance times the exposure, the filmic bend where it is asked for, sRGB.
vec3 displayed(vec3 radiance) {
  vec3 x = max(radiance * u_exposure, 0.0);
  if (u_filmic == 1) x = x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14);
  x = min(x, 1.0);
  return mix(1.055 * pow(max(x, 1e-5), vec3(1.0 / 2.4)) - 0.055, 12.92 * x, lessThanEqual(x, vec3(0.0031308)));
}
`;

/** The text of a shader with its version and what it is made for. */
function shaderText(body, defines = {}) {
  const lines = Object.entries(defines).map(([name, value]) => `#define ${name} ${value}\n`).join("");
  return `#version 300 es\nprecision highp float;\nprecision highp int;\n${lines}${body}`;
}
