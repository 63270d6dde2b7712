// WebGL 2: a context, programs, textures, with what is missing said in a line.

/** A WebGL 2 context, with smooth outlines where they are asked for, or Trouble that says what is missing. */
function openContext(canvas, antialias = false) {
  const gl = canvas.getContext("webgl2", { alpha: false, antialias, powerPreference: "high-performance" });
  if (!gl) {
    throw new Trouble("This page draws with WebGL 2, which is not available here.",
      "Open it in a current Chrome, Edge, Firefox or Safari with hardware acceleration switched on in its settings. "
      + "On a machine without a graphics card, Chromium can draw in software: start it with "
      + "--use-angle=swiftshader --enable-unsafe-swiftshader.",
      typeof WebGL2RenderingContext === "undefined" ? "The browser knows no WebGL 2, or has it disabled."
        : "The browser knows WebGL 2, but gave no context for it.");
  }
  // Without it float textures are half floats, which every WebGL 2 interpolates.
  gl.linearFloats = Boolean(gl.getExtension("OES_texture_float_linear"));
  return gl;
}

/**
 * A program with its uniforms' places by name; `kept` names what transform feedback keeps, `attributes` fixes the places
 * of attributes.
 */
function makeProgram(gl, vertex, fragment, what, { kept = null, attributes = {} } = {}) {
  const program = gl.createProgram(), report = "Please report the text below together with the browser's name and the"
    + " graphics card. Newer graphics drivers or another browser may do.";
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
      throw new Trouble(`The shader of ${what} does not compile on this machine.`, report,
        (gl.getShaderInfoLog(shader) || "no message from the compiler").trim());
    }
    gl.attachShader(program, shader);
    gl.deleteShader(shader);
  }
  for (const [name, place] of Object.entries(attributes)) gl.bindAttribLocation(program, place, name);
  if (kept) gl.transformFeedbackVaryings(program, [kept].flat(), gl.INTERLEAVED_ATTRIBS);
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
    throw new Trouble(`The shader of ${what} does not link on this machine.`, report,
      (gl.getProgramInfoLog(program) || "no message from the linker").trim());
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

/** A triangle that covers the whole picture, as attribute 0, bound. */
function wholePicture(gl) {
  const square = gl.createVertexArray();
  gl.bindVertexArray(square);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 3, -1, -1, 3]), gl.STATIC_DRAW);
  gl.enableVertexAttribArray(0);
  gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
  return square;
}

/** The text of a shader with its version and what it is made for. */
function shaderText(body, defines = {}) {
  const lines = Object.entries(defines).map(([name, value]) => `#define ${name} ${value}\n`).join("");
  return `#version 300 es\nprecision highp float;\nprecision highp int;\n${lines}${body}`;
}
