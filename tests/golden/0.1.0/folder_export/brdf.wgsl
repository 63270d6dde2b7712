// BRDF of synthetic_cornell.brdf, by homofact 0.1.0: 2 log textures, 2 fetches.
// epsilon = 0.01, A = (0.327278, 0.412529, 0.322794) 1/sr.
// wi, wo: unit, to the light and to the viewer, in the surface frame (z normal, x tangent).
// The value is the BRDF in 1/sr, linear, without the cosine.
// Textures: bilinear, clamped to the edge, no mipmaps; row 0 is at v = 0; a texel's centre is at (k + 1/2)/n.
// Texture 0: texture_0.exr, 4 x 4, 32-bit float.
// Texture 1: texture_1.exr, 4 x 4, 32-bit float.
@group(0) @binding(0) var homofact_texture_0: texture_2d<f32>;  // 4 x 4
@group(0) @binding(1) var homofact_texture_1: texture_2d<f32>;  // 4 x 4
@group(0) @binding(2) var homofact_sampler: sampler;  // linear, clamp-to-edge

fn homofact_evaluate(wi: vec3<f32>, wo: vec3<f32>) -> vec3<f32> {
    // s points along the half vector, at right angles to e
    let s: vec3<f32> = wi + wo;
    let e: vec3<f32> = wi - wo;
    // of s, s.xy, e
    let lengths: vec3<f32> = sqrt(vec3<f32>(dot(s, s), dot(s.xy, s.xy), dot(e, e)));
    // theta_h, theta_d, phi_d
    let angle: vec3<f32> = atan2(vec3<f32>(lengths.y, lengths.z, abs(s.x * e.y - s.y * e.x)), vec3<f32>(s.z, lengths.x, abs(e.z) * lengths.x) + 1e-20);
    // r = theta_h/(pi/2) stretched to asinh(r/0.03)/asinh(1/0.03)
    let warped_0: f32 = asinh(angle.x * 21.22066);
    // texture 0: theta_h-theta_d on isotropic-half-diff, 4 x 4 texels
    let uv_0: vec2<f32> = vec2<f32>(warped_0, angle.y) * vec2<f32>(0.1785744, 0.47746482) + vec2<f32>(0.125, 0.125);
    let p_0: vec3<f32> = textureSampleLevel(homofact_texture_0, homofact_sampler, uv_0, 0.0).rgb;
    // r = theta_h/(pi/2) stretched to asinh(r/0.03)/asinh(1/0.03)
    let warped_1: f32 = asinh(angle.x * 21.22066);
    let x_1: vec4<f32> = vec4<f32>(warped_1, angle.yz, 1.0);
    // texture 1: searched on isotropic-half-diff, 4 x 4 texels
    let uv_1: vec2<f32> = vec2<f32>(dot(vec4<f32>(0.049518656, 0.15396665, -0.19109726, 0.4251749), x_1), dot(vec4<f32>(0.105101466, -0.008997291, 0.1874516, 0.13913292), x_1));
    let p_1: vec3<f32> = textureSampleLevel(homofact_texture_1, homofact_sampler, uv_1, 0.0).rgb;
    // the sum of logarithms; the constant is log A and the textures' biases
    let log_f: vec3<f32> = p_0 + p_1 + vec3<f32>(-1.1169462, -0.8854499, -1.1307396);
    // 0 under the horizon
    let above: f32 = step(0.0, min(wi.z, wo.z));
    // epsilon A was added before the logarithm
    let f: vec3<f32> = max(exp(log_f) - vec3<f32>(0.003272777, 0.0041252854, 0.0032279443), vec3<f32>(0.0));
    return f * above;
}
