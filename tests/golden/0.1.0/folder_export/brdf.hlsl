// BRDF of synthetic_cornell.brdf, by homofact 0.1.0: 2 log textures, 2 fetches.
// epsilon = 0.01, A = (0.327278, 0.412529, 0.322794) 1/sr.
// wi, wo: unit, to the light and to the viewer, in the surface frame (z normal, x tangent).
// The value is the BRDF in 1/sr, linear, without the cosine.
// Textures: bilinear, clamped to the edge, no mipmaps; row 0 is at v = 0; a texel's centre is at (k + 1/2)/n.
// Texture 0: texture_0.exr, 4 x 4, 32-bit float.
// Texture 1: texture_1.exr, 4 x 4, 32-bit float.
Texture2D<float4> homofact_texture_0 : register(t0);  // 4 x 4
Texture2D<float4> homofact_texture_1 : register(t1);  // 4 x 4
SamplerState homofact_sampler : register(s0);  // MIN_MAG_MIP_LINEAR, CLAMP

float3 homofact_evaluate(float3 wi, float3 wo)
{
    // s points along the half vector, at right angles to e
    float3 s = wi + wo;
    float3 e = wi - wo;
    // of s, s.xy, e
    float3 lengths = sqrt(float3(dot(s, s), dot(s.xy, s.xy), dot(e, e)));
    // theta_h, theta_d, phi_d
    float3 angle = atan2(float3(lengths.y, lengths.z, abs(s.x * e.y - s.y * e.x)), float3(s.z, lengths.x, abs(e.z) * lengths.x) + 1e-20);
    // r = theta_h/(pi/2) stretched to asinh(r/0.03)/asinh(1/0.03)
    float warped_0 = log((angle.x * 21.22066) + sqrt((angle.x * 21.22066) * (angle.x * 21.22066) + 1.0));
    // texture 0: theta_h-theta_d on isotropic-half-diff, 4 x 4 texels
    float2 uv_0 = float2(warped_0, angle.y) * float2(0.1785744, 0.47746482) + float2(0.125, 0.125);
    float3 p_0 = homofact_texture_0.SampleLevel(homofact_sampler, uv_0, 0.0).rgb;
    // r = theta_h/(pi/2) stretched to asinh(r/0.03)/asinh(1/0.03)
    float warped_1 = log((angle.x * 21.22066) + sqrt((angle.x * 21.22066) * (angle.x * 21.22066) + 1.0));
    float4 x_1 = float4(warped_1, angle.yz, 1.0);
    // texture 1: searched on isotropic-half-diff, 4 x 4 texels
    float2 uv_1 = float2(dot(float4(0.049518656, 0.15396665, -0.19109726, 0.4251749), x_1), dot(float4(0.105101466, -0.008997291, 0.1874516, 0.13913292), x_1));
    float3 p_1 = homofact_texture_1.SampleLevel(homofact_sampler, uv_1, 0.0).rgb;
    // the sum of logarithms; the constant is log A and the textures' biases
    float3 log_f = p_0 + p_1 + float3(-1.1169462, -0.8854499, -1.1307396);
    // 0 under the horizon
    float above = step(0.0, min(wi.z, wo.z));
    // epsilon A was added before the logarithm
    float3 f = max(exp(log_f) - float3(0.003272777, 0.0041252854, 0.0032279443), 0.0);
    return f * above;
}
