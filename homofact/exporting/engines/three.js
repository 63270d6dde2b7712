// A measured BRDF as a three.js material: three's physical material with its direct light replaced.
//
//     import { BrdfMaterial } from "...";
//     mesh.material = new BrdfMaterial();
//
// Lights are exact (directional, point and spot, with their shadows; radiance is f cosθ times three's light colour times
// intensity, an irradiance). Environments and ambient light are reflected by color, metalness and roughness, the glTF
// material that looks most like the fit. The surface frame is the geometry's tangents where the material has
// vertexTangents = true, else the direction of increasing longitude about the object's y axis.
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
// What environments see.
export const lookalike = DATA.lookalike;

const DIRECT = `
varying vec3 vHomofactAlong;
${DATA.glsl}
void RE_Direct_Homofact(
  const in IncidentLight directLight, const in vec3 geometryPosition, const in vec3 geometryNormal,
  const in vec3 geometryViewDir, const in vec3 geometryClearcoatNormal, const in PhysicalMaterial material,
  inout ReflectedLight reflectedLight
) {
  vec3 n = geometryNormal;
  #ifdef HOMOFACT_TANGENTS
    vec3 across = vHomofactAlong - dot(vHomofactAlong, n) * n;
  #else
    vec3 across = cross(vHomofactAlong, n);
  #endif
  float size = length(across);
  vec3 t = size > 1e-6 ? across / size : normalize(cross(vec3(0.0, 0.0, 1.0), n) + vec3(1e-6, 0.0, 0.0));
  vec3 b = cross(n, t);
  vec3 wi = vec3(dot(directLight.direction, t), dot(directLight.direction, b), dot(directLight.direction, n));
  vec3 wo = vec3(dot(geometryViewDir, t), dot(geometryViewDir, b), dot(geometryViewDir, n));
  reflectedLight.directSpecular += vec3(homofact_evaluate(wi, wo)) * max(wi.z, 0.0) * directLight.color;
}
#undef RE_Direct
#define RE_Direct RE_Direct_Homofact
`;

const CHUNK = "#include <lights_physical_pars_fragment>";
// One program for all materials of this fit, none with another fit's.
const KEY = `homofact ${DATA.glsl}`;

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
    const along = this.vertexTangents
      ? "(modelViewMatrix * vec4(tangent.xyz, 0.0)).xyz"
      : "normalize(normalMatrix * vec3(0.0, 1.0, 0.0))";
    const declared = this.vertexTangents ? "#ifndef USE_TANGENT\nattribute vec4 tangent;\n#endif\n" : "";
    shader.vertexShader =
      `varying vec3 vHomofactAlong;\n${declared}` +
      shader.vertexShader.replace("#include <project_vertex>", `#include <project_vertex>\n  vHomofactAlong = ${along};`);
    const tangents = this.vertexTangents ? "#define HOMOFACT_TANGENTS\n" : "";
    // A function, whose text is put in as it stands: "$'" in the fit's name would bring in the shader's rest.
    shader.fragmentShader = tangents + shader.fragmentShader.replace(CHUNK, () => CHUNK + DIRECT);
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
