#include "libraries/pbrlib/genglsl/lib/mx_closure_type.glsl"

@PROGRAM@
void mx_@NAME@(ClosureData closureData, float weight, vec3 ambient, @SAMPLERS@vec3 N, vec3 X, inout BSDF bsdf)
{
    bsdf.throughput = vec3(0.0);
    if (weight < M_FLOAT_EPS)
    {
        return;
    }
    N = mx_forward_facing_normal(N, closureData.V);
    if (closureData.closureType == CLOSURE_TYPE_REFLECTION)
    {
        vec3 t = normalize(X - dot(X, N) * N);
        vec3 b = cross(N, t);
        vec3 wi = vec3(dot(closureData.L, t), dot(closureData.L, b), dot(closureData.L, N));
        vec3 wo = vec3(dot(closureData.V, t), dot(closureData.V, b), dot(closureData.V, N));
        bsdf.response = vec3(@NAME@_evaluate(wi, wo@GIVEN@)) * max(wi.z, 0.0) * closureData.occlusion * weight;
    }
    else if (closureData.closureType == CLOSURE_TYPE_INDIRECT)
    {
        bsdf.response = mx_environment_irradiance(N) * ambient * weight;
    }
}
