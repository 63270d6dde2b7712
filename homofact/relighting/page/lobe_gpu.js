// A separate lobe on the graphics card: the sum of lobe.js in a shader, and the textures that it reads.

// Levels of cells: 8 × 8 to 256 × 256 a face, the parts of texels included (texel_pattern.py).
const MOST_LEVELS = 6;
// The least cosine to the eye of a normal between vertices.
const BENT = 0.02;
const LOBE_UNITS = { cells: 2, table: 3, sight: 4 };

/**
 * `lobe(position, normal, tangent)`; u_eye stands before it. For a vertex, NUMBER; `between` the corners of a triangle,
 * v_corners, by its shares, v_share.
 */
const lobeSum = ({ levels, turns, along, around, whole, words, tinted }, between = false) => `
${GRID_PLACE}uniform highp sampler2D u_cells;
uniform highp sampler2DArray u_lobe;
uniform highp usampler2D u_sight;
uniform float u_lobe_scale;
uniform float u_lobe_width;
uniform float u_lobe_period;
uniform int u_starts[${MOST_LEVELS}];
uniform int u_top;
uniform int u_finer;
uniform int u_divisions;
uniform int u_least;

const float STEEPEST = ${STEEPEST.toFixed(9)};

vec4 cellPart(int cell, int part) {
  return texelFetch(u_cells, ivec2(2 * (cell % ${CELLS_ACROSS}) + part, cell / ${CELLS_ACROSS}), 0);
}

uint sightWord(int vertex, int at) {
  int number = vertex * ${words} + (at >> 5), width = textureSize(u_sight, 0).x;
  return texelFetch(u_sight, ivec2(number % width, number / width), 0).r;
}

uint bitsSet(uint word) {
  word -= (word >> 1u) & 0x55555555u;
  word = (word & 0x33333333u) + ((word >> 2u) & 0x33333333u);
  word = (word + (word >> 4u)) & 0x0f0f0f0fu;
  return (word * 0x01010101u) >> 24u;
}

/** The part that a vertex sees of \`size\` texels, a power of 4, 64 at most. */
float seenBy(int vertex, int at, int size) {
  if (size == 64) return float(bitsSet(sightWord(vertex, at)) + bitsSet(sightWord(vertex, at + 32))) / 64.0;
  return float(bitsSet((sightWord(vertex, at) >> uint(at & 31)) & ((1u << uint(size)) - 1u))) / float(size);
}

float seenPart(int at, int size) {
${between ? `  ivec3 corners = ivec3(v_corners);
  return dot(v_share, vec3(seenBy(corners.x, at, size), seenBy(corners.y, at, size), seenBy(corners.z, at, size)));`
    : "  return seenBy(NUMBER, at, size);"}
}

/** The grids of the turns lie one under the other, those of the levels are layers. */
vec3 tableAt(vec2 at, int turn, int level) {
  vec2 place = vec2(at.x + 0.5, at.y + 0.5 + float(turn * ${along})) / vec2(${around}.0, ${along * turns}.0);
  return textureLod(u_lobe, vec3(place, float(level)), 0.0).rgb;
}

${tinted ? `${tintedParts("LOBE_TINTED", { tinted })}// The part of the lobe that a texture tints.
vec3 lobeTinted = vec3(0.0);
` : ""}
vec3 lobe(vec3 position, vec3 normal, vec3 tangent) {
  vec3 n = normalize(normal), s = normalize(tangent - dot(tangent, n) * n), b = cross(n, s), w = normalize(u_eye - position);
  // Seen from behind: as at the horizon, as the terms are. Farther behind than a triangle at the outline reaches: not at all.
  // A view beyond the table's last angle is raised to it.
  float facing = dot(n, w), oz = max(facing, cos(STEEPEST));
  if (facing < -0.5) return vec3(0.0);
  vec2 aside = vec2(dot(s, w), dot(b, w));
  float across = length(aside);
  vec2 turned = across > 1e-6 ? aside / across : vec2(1.0, 0.0);
  if (facing < cos(STEEPEST)) across = sin(STEEPEST);
  // The frame is turned so that the viewer's azimuth is 0.
  vec3 x = turned.x * s + turned.y * b, y = turned.x * b - turned.y * s;
  float level = placeOfView(oz) * ${levels - 1}.0;
  int low = min(int(level), ${levels - 2});
  float up = min(level - float(low), 1.0);
${tinted ? "  lobeTinted = mix(LOBE_TINTED[low], LOBE_TINTED[low + 1], up);\n" : ""}${turns === 1 ? "" : `  float turn = fract(atan(turned.y, turned.x) / u_lobe_period) * ${turns}.0, over = fract(turn);
  int first = int(turn) % ${turns}, second = (first + 1) % ${turns};
`}  int texels = ${ROOT_CELLS} << (2 * u_top), sights = texels >> (2 * u_finer);
  vec3 sum = vec3(0.0);
  for (int face = 0; face < ${FACES}; face++) {
    int place = 0, k = u_top;
    bool bright = false;
    while (place < texels) {
      int cell = u_starts[k] + ((face * texels + place) >> (2 * k));
      vec4 d = cellPart(cell, 0);
      float z = dot(n, d.xyz), extent = abs(d.w);
      bool divided = false;
      // Of the parts of a texel, which come after it, too.
      if (k >= u_divisions) bright = d.w < 0.0;
      if (z > -0.5 * extent - 0.25 * extent * extent) {
        float unit = 1.0 / (max(z, 0.0) + oz);
        vec2 h = vec2(dot(x, d.xyz) + across, dot(y, d.xyz)) * unit;
        float slope = length(h);
        float within = extent * unit, own = max(u_lobe_width, slope + ${(1 - CORE).toFixed(3)} * u_lobe_width);
        if (bright && k <= u_divisions && slope < ${NEAR.toFixed(1)} * u_lobe_width + within) own = u_lobe_width;
        divided = k > u_least && ((bright && k > u_divisions) || within > ${WIDEST} * own);
        if (!divided && z > 0.0) {
          float seen = seenPart(face * sights + (place >> (2 * u_finer)), 1 << (2 * max(k - u_finer, 0)));
          if (seen > 0.0) {
            vec2 at = gridPlace(h, u_lobe_width, ${whole}) * vec2(${around - 1}.0, ${along - 1}.0);
${turns === 1 ? `            vec3 f = mix(tableAt(at, 0, low), tableAt(at, 0, low + 1), up);
` : `            vec3 f = mix(mix(tableAt(at, first, low), tableAt(at, first, low + 1), up),
              mix(tableAt(at, second, low), tableAt(at, second, low + 1), up), over);
`}            int lit = k < u_divisions ? u_starts[u_divisions] + ((face * texels + place) >> (2 * u_divisions)) : cell;
            sum += seen * extent * extent * f * cellPart(lit, 1).rgb;
          }
        }
      }
      if (divided) {
        k -= 1;
      } else {
        place += 1 << (2 * k);
        while (k < u_top && ((place >> (2 * k)) & 3) == 0) k += 1;
      }
    }
  }
  return sum * u_lobe_scale / oz;
}
`;

/** The corners of a pixel's triangle and their shares, and what a separate lobe adds to them. */
const cornersOf = (lobe) => `
flat in highp uvec3 v_corners;
centroid in vec3 v_share;
${lobe ? lobeBetween(lobe) : ""}`;

/** `lobeBetween(position, normal)`: the lobe at a pixel of a triangle (picture.py, tangents.py). */
const lobeBetween = (lobe) => `
${lobeSum(lobe, true)}
vec3 lobeBetween(vec3 position, vec3 normal) {
  vec3 w = normalize(u_eye - position), n = normalize(normal);
  // A normal that is turned away, at an outline, is bent back until it is seen.
  n = normalize(n + max(${BENT} - dot(n, w), 0.0) * w);
#ifdef BUMPED
  n = mappedNormal(n, w);
#endif
  vec3 tangent = vec3((n.y + 1.0) * (n.y + 1.0) + n.z * n.z - n.x * n.x, -2.0 * (n.y + 1.0) * n.x, -2.0 * n.x * n.z);
  return lobe(position, n, n.y > -0.999999 ? normalize(tangent) : vec3(1.0, 0.0, 0.0));
}
`;

// The cells of the light, for all objects.
class CellsOnGpu {
  constructor(gl) {
    this.gl = gl;
    this.texture = makeTexture(gl, gl.TEXTURE_2D, gl.NEAREST);
    this.made = false;
  }

  upload(cells) {
    const { gl } = this, rows = cells.begin / CELLS_ACROSS, more = Math.ceil(cells.parts.count / CELLS_ACROSS);
    this.cells = cells;
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    const write = (values, from, count) => {
      const padded = new Float32Array(CELL * CELLS_ACROSS * count);
      padded.set(values);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, from, 2 * CELLS_ACROSS, count, gl.RGBA, gl.FLOAT, padded);
    };
    if (!this.made) {
      gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, 2 * CELLS_ACROSS, rows + more);
      if (more) write(cells.parts.values, rows, more);
      this.made = true;
    }
    write(cells.values, 0, rows);
  }
}

/** A table's grids: those of the turns lie one under the other, those of the levels are layers. */
function tableTexture(gl, { levels, turns, along, around, halves }) {
  const texture = makeTexture(gl, gl.TEXTURE_2D_ARRAY, gl.LINEAR);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 2);
  gl.texImage3D(gl.TEXTURE_2D_ARRAY, 0, gl.RGB16F, around, along * turns, levels, 0, gl.RGB, gl.HALF_FLOAT, halves);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
  return texture;
}

// One object's table, and what its vertices see.
class LobeOnGpu {
  constructor(gl, lobe) {
    this.gl = gl;
    this.lobe = lobe;
    const { sight } = lobe;
    this.table = tableTexture(gl, lobe);
    const width = Math.min(sight.length, gl.getParameter(gl.MAX_TEXTURE_SIZE), 4096), height = Math.ceil(sight.length / width);
    const padded = new Uint32Array(width * height);
    padded.set(sight);
    this.sight = makeTexture(gl, gl.TEXTURE_2D, gl.NEAREST);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32UI, width, height, 0, gl.RED_INTEGER, gl.UNSIGNED_INT, padded);
  }

  /** Binds what `lobe` reads. */
  bind(program, { texture, cells }) {
    const { gl, lobe } = this;
    const place = (unit, target, what, name) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(target, what);
      gl.uniform1i(program.at(name), unit);
    };
    place(LOBE_UNITS.cells, gl.TEXTURE_2D, texture, "u_cells");
    place(LOBE_UNITS.table, gl.TEXTURE_2D_ARRAY, this.table, "u_lobe");
    place(LOBE_UNITS.sight, gl.TEXTURE_2D, this.sight, "u_sight");
    gl.activeTexture(gl.TEXTURE0);
    gl.uniform1f(program.at("u_lobe_scale"), lobe.scale);
    gl.uniform1f(program.at("u_lobe_width"), lobe.width);
    gl.uniform1f(program.at("u_lobe_period"), lobe.period);
    const starts = Int32Array.from({ length: MOST_LEVELS }, (_, k) => cells.starts[k] ?? 0);
    gl.uniform1iv(program.at("u_starts"), starts);
    gl.uniform1i(program.at("u_top"), cells.starts.length - 1);
    gl.uniform1i(program.at("u_finer"), finerLevels(lobe.words, cells));
    gl.uniform1i(program.at("u_divisions"), cells.divisions);
    gl.uniform1i(program.at("u_least"), cells.divisions - lobe.divisions);
  }
}
