#include "libraries/pbrlib/genglsl/lib/mx_closure_type.glsl"
#include "libraries/pbrlib/genglsl/lib/mx_microfacet_specular.glsl"
#include "libraries/stdlib/genglsl/lib/$fileTransformUv"

@PROGRAM@
void mx_@NAME@(ClosureData closureData, float weight, vec3 base_color, float metallic, float roughness, @SAMPLERS@vec3 N, vec3 X, inout BSDF bsdf)
{
    bsdf.throughput = vec3(0.0);
    if (weight < M_FLOAT_EPS)
    {
        return;
    }
    N = mx_forward_facing_normal(N, closureData.V);
    if (closureData.closureType == CLOSURE_TYPE_REFLECTION)
    {
        // Lights: the fit.
        vec3 t = normalize(X - dot(X, N) * N);
        vec3 b = cross(N, t);
        vec3 wi = vec3(dot(closureData.L, t), dot(closureData.L, b), dot(closureData.L, N));
        vec3 wo = vec3(dot(closureData.V, t), dot(closureData.V, b), dot(closureData.V, N));
        bsdf.response = vec3(@NAME@_evaluate(wi, wo@GIVEN@)) * max(wi.z, 0.0) * closureData.occlusion * weight;
    }
    else if (closureData.closureType == CLOSURE_TYPE_INDIRECT)
    {
        // Environments: the metallic-roughness material that looks most like it.
        float cosine = clamp(dot(N, closureData.V), M_FLOAT_EPS, 1.0);
        vec2 alpha = clamp(vec2(roughness * roughness), M_FLOAT_EPS, 1.0);
        vec3 facing = mix(vec3(0.04), base_color, metallic);
        FresnelData fresnel = mx_init_fresnel_schlick(facing, vec3(1.0), vec3(1.0), 5.0, 0.0, 1.5);
        vec3 coat = mx_ggx_dir_albedo(cosine, alpha.x, vec3(0.04), vec3(1.0));
        vec3 base = base_color * (1.0 - metallic) * (1.0 - coat);
        vec3 mirrored = mx_environment_radiance(N, closureData.V, X, alpha, 0, fresnel);
        bsdf.response = (mirrored + mx_environment_irradiance(N) * base) * weight;
    }
}
