// The WebGL 2 context, and what is drawn into.

/** A float picture to draw into, with depth where it is for meshes. */
class Target {
  constructor(gl, format, depth) {
    this.gl = gl;
    this.format = format;
    this.texture = gl.createTexture();
    this.frame = gl.createFramebuffer();
    this.depth = depth ? gl.createRenderbuffer() : null;
    this.width = this.height = 0;
  }

  resize(width, height) {
    if (width === this.width && height === this.height) return;
    const gl = this.gl;
    [this.width, this.height] = [width, height];
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    const type = this.format === gl.RGBA16F ? gl.HALF_FLOAT : gl.FLOAT;
    gl.texImage2D(gl.TEXTURE_2D, 0, this.format, width, height, 0, gl.RGBA, type, null);
    parameters(gl, gl.TEXTURE_2D, gl.NEAREST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.texture, 0);
    if (this.depth) {
      gl.bindRenderbuffer(gl.RENDERBUFFER, this.depth);
      gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, this.depth);
    }
    if (gl.checkFramebufferStatus(gl.FRAMEBUFFER) !== gl.FRAMEBUFFER_COMPLETE && !gl.isContextLost()) {
      throw new Trouble("This machine cannot draw into float pictures.",
        "The page gathers light in them. Another browser or newer graphics drivers may be able to.");
    }
  }

  bind() {
    this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, this.frame);
    this.gl.viewport(0, 0, this.width, this.height);
  }
}

/** A context that can draw into float pictures, or Trouble that says what is missing. */
function openFloatContext(canvas) {
  const gl = openContext(canvas);
  if (!gl.getExtension("EXT_color_buffer_float")) {
    throw new Trouble("This machine cannot draw into float pictures (EXT_color_buffer_float).",
      "The page gathers light in them. Another browser or newer graphics drivers may be able to.");
  }
  return gl;
}
