#include "libraries/pbrlib/genglsl/lib/mx_closure_type.glsl"
#include "libraries/pbrlib/genglsl/lib/mx_microfacet_specular.glsl"
#include "libraries/stdlib/genglsl/lib/$fileTransformUv"

@PROGRAM@
// The environment averaged by GGX as seen from the direction itself; levels are even steps of roughness.
vec3 @NAME@_light_sky_1(vec3 direction, float level)
{
    vec3 towards = normalize(direction);
    vec3 across = abs(towards.y) < 0.9 ? vec3(0.0, 1.0, 0.0) : vec3(1.0, 0.0, 0.0);
    float roughness = clamp(level / @STEPS@, 0.0, 1.0);
    vec2 alpha = clamp(vec2(roughness * roughness), M_FLOAT_EPS, 1.0);
    FresnelData white = mx_init_fresnel_schlick(vec3(1.0), vec3(1.0), vec3(1.0), 5.0, 0.0, 1.5);
    return mx_environment_radiance(towards, towards, across, alpha, 0, white)
        / mx_ggx_dir_albedo(1.0, alpha.x, vec3(1.0), vec3(1.0));
}
vec3 @NAME@_light_sky_2(vec3 n, float level)
{
    return mx_environment_irradiance(n);
}
@LIGHT@
void mx_@NAME@(ClosureData closureData, float weight, @SAMPLERS@vec3 N, vec3 X, inout BSDF bsdf)
{
    bsdf.throughput = vec3(0.0);
    if (weight < M_FLOAT_EPS)
    {
        return;
    }
    N = mx_forward_facing_normal(N, closureData.V);
    vec3 t = normalize(X - dot(X, N) * N);
    vec3 b = cross(N, t);
    if (closureData.closureType == CLOSURE_TYPE_REFLECTION)
    {
        vec3 wi = vec3(dot(closureData.L, t), dot(closureData.L, b), dot(closureData.L, N));
        vec3 wo = vec3(dot(closureData.V, t), dot(closureData.V, b), dot(closureData.V, N));
        bsdf.response = vec3(@NAME@_evaluate(wi, wo@GIVEN@)) * max(wi.z, 0.0) * closureData.occlusion * weight;
    }
    else if (closureData.closureType == CLOSURE_TYPE_INDIRECT)
    {
        bsdf.response = @NAME@_light_reflected(@FRAME@, closureData.V, @TABLE@) * weight;
    }
}
