// A measured BRDF as a three.js material: three's physical material, its light replaced by that of the fit.
//
//     import { BrdfMaterial } from "...";
//     mesh.material = new BrdfMaterial();
//
// The fit reflects directional, point and spot lights, with their shadows: radiance is f cosθ times three's light colour
// times intensity, an irradiance. It also reflects environments: a table over the viewer's angle gives the levels of
// three's own filtered environment to read, their directions and their weights. If three filters otherwise, color,
// metalness and roughness reflect them, the glTF material that looks most like the fit, and the console shows a warning.
// With vertexTangents = true the surface frame follows the geometry's tangents, otherwise the direction of increasing
// longitude around the object's y axis.
import * as THREE from "three";

const DATA = @DATA@;

const TYPES = { half: THREE.HalfFloatType, float: THREE.FloatType, byte: THREE.UnsignedByteType };
const ARRAYS = { half: Uint16Array, float: Float32Array, byte: Uint8Array };

function texture({ columns, rows, kind, texels }) {
  const bytes = Uint8Array.from(atob(texels), (letter) => letter.charCodeAt(0));
  const made = new THREE.DataTexture(new ARRAYS[kind](bytes.buffer), columns, rows, THREE.RGBAFormat, TYPES[kind]);
  made.minFilter = made.magFilter = THREE.LinearFilter;
  made.wrapS = made.wrapT = THREE.ClampToEdgeWrapping;
  made.needsUpdate = true;
  return made;
}

// The fit's textures, shared by all its materials.
export const textures = DATA.textures.map(texture);
// homofact_evaluate(wi, wo) in GLSL ES 3.00, with its samplers homofact_texture_0 ...
export const glsl = DATA.glsl;
// homofact_light_reflected(n, wo), which environments are reflected by, and how far off a sphere is under three skies.
export const light = { glsl: DATA.light.glsl, errors: DATA.light.errors };
// Whether the fit has a grain, which needs tangents.
export const anisotropic = DATA.anisotropic;
// What a three of other environments shows in its place.
export const lookalike = DATA.lookalike;

const table = texture(DATA.light.table);
const GIVEN = "const in vec3 geometryPosition, const in vec3 geometryNormal, const in vec3 geometryViewDir, "
  + "const in vec3 geometryClearcoatNormal, const in PhysicalMaterial material, inout ReflectedLight reflectedLight";

const DIRECT = `
varying vec3 vHomofactAlong;
${DATA.glsl}
mat3 homofactFrame(const in vec3 n) {
  #ifdef HOMOFACT_TANGENTS
    vec3 across = vHomofactAlong - dot(vHomofactAlong, n) * n;
  #else
    vec3 across = cross(vHomofactAlong, n);
  #endif
  float size = length(across);
  vec3 t = size > 1e-6 ? across / size : normalize(cross(vec3(0.0, 0.0, 1.0), n) + vec3(1e-6, 0.0, 0.0));
  return mat3(t, cross(n, t), n);
}
void RE_Direct_Homofact(const in IncidentLight directLight, ${GIVEN}) {
  mat3 frame = homofactFrame(geometryNormal);
  vec3 wi = directLight.direction * frame;
  vec3 wo = geometryViewDir * frame;
  reflectedLight.directSpecular += vec3(homofact_evaluate(wi, wo)) * max(wi.z, 0.0) * directLight.color;
}
#undef RE_Direct
#define RE_Direct RE_Direct_Homofact
`;

// Ambient light is a sky that is the same everywhere. The chain that the table is for is three's of
// faces of 256; of larger faces it is one or two levels longer.
const ENVIRONMENT = `
vec3 homofactAmbient = vec3(0.0);
vec3 homofactSky(const in vec3 direction, const in float level) {
  #if defined(USE_ENVMAP) && defined(ENVMAP_TYPE_PMREM)
    vec3 world = envMapRotation * transformDirectionByInverseViewMatrix(direction, viewMatrix);
    return homofactAmbient + textureLod(envMap, world, level * ENVMAP_MAX_LOD).rgb * envMapIntensity;
  #else
    return homofactAmbient;
  #endif
}
vec3 homofact_light_sky_1(const in vec3 direction, const in float level) {
  return homofactSky(direction, level / ${(DATA.light.levels - 1).toFixed(1)});
}
vec3 homofact_light_sky_2(const in vec3 n, const in float level) {
  return homofactSky(n, 1.0);
}
${DATA.light.glsl}
void RE_IndirectDiffuse_Homofact(const in vec3 irradiance, ${GIVEN}) {
  homofactAmbient = irradiance * RECIPROCAL_PI;
}
void RE_IndirectSpecular_Homofact(
  const in vec3 radiance, const in vec3 iblIrradiance, const in vec3 clearcoatRadiance, ${GIVEN}
) {
  mat3 frame = homofactFrame(geometryNormal);
  reflectedLight.indirectSpecular += homofact_light_reflected(${DATA.light.given});
}
#undef RE_IndirectDiffuse
#define RE_IndirectDiffuse RE_IndirectDiffuse_Homofact
#undef RE_IndirectSpecular
#define RE_IndirectSpecular RE_IndirectSpecular_Homofact
`;

const CHUNK = "#include <lights_physical_pars_fragment>";
// A three whose environments are cube maps filtered by GGX.
const KNOWN = (THREE.ShaderChunk.envmap_physical_pars_fragment ?? "").includes("ENVMAP_TYPE_PMREM");
if (!KNOWN)
  console.warn(`three ${THREE.REVISION}: environments are filtered otherwise than in 187, and shown by a look-alike`);
// One program for all materials of this fit, none with another fit's.
const KEY = `homofact ${DATA.glsl} ${DATA.light.glsl}`;

export class BrdfMaterial extends THREE.MeshPhysicalMaterial {
  constructor({ vertexTangents = false, ...parameters } = {}) {
    super();
    this.color.setRGB(...DATA.lookalike.color, THREE.LinearSRGBColorSpace);
    this.metalness = DATA.lookalike.metalness;
    this.roughness = DATA.lookalike.roughness;
    this.setValues(parameters);
    this.vertexTangents = vertexTangents;
    this.type = "MeshPhysicalMaterial";
  }

  onBeforeCompile(shader) {
    if (!shader.fragmentShader.includes(CHUNK)) throw new Error(`three ${THREE.REVISION}: no ${CHUNK} to replace`);
    textures.forEach((each, k) => (shader.uniforms[`homofact_texture_${k}`] = { value: each }));
    if (KNOWN) shader.uniforms.homofact_light_texture_0 = { value: table };
    const along = this.vertexTangents
      ? "(modelViewMatrix * vec4(tangent.xyz, 0.0)).xyz"
      : "normalize(normalMatrix * vec3(0.0, 1.0, 0.0))";
    const declared = this.vertexTangents ? "#ifndef USE_TANGENT\nattribute vec4 tangent;\n#endif\n" : "";
    shader.vertexShader =
      `varying vec3 vHomofactAlong;\n${declared}` +
      shader.vertexShader.replace("#include <project_vertex>", `#include <project_vertex>\n  vHomofactAlong = ${along};`);
    const tangents = this.vertexTangents ? "#define HOMOFACT_TANGENTS\n" : "";
    // A function, whose text is put in as it stands: "$'" in the fit's name would bring in the shader's rest.
    shader.fragmentShader = tangents + shader.fragmentShader.replace(CHUNK, () => CHUNK + DIRECT + (KNOWN ? ENVIRONMENT : ""));
  }

  customProgramCacheKey() {
    return `${KEY} ${this.vertexTangents}`;
  }

  copy(source) {
    super.copy(source);
    this.vertexTangents = source.vertexTangents;
    return this;
  }
}
