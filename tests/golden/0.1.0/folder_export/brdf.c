/* BRDF of synthetic_cornell.brdf, by homofact 0.1.0: 2 log textures, 2 fetches. */
/* epsilon = 0.01, A = (0.327278, 0.412529, 0.322794) 1/sr. */
/* wi, wo: unit, to the light and to the viewer, in the surface frame (z normal, x tangent). */
/* The value is the BRDF in 1/sr, linear, without the cosine. */
/* Textures: bilinear, clamped to the edge, no mipmaps; row 0 is at v = 0; a texel's centre is at (k + 1/2)/n. */
/* The texels below are those of texture_0.exr, texture_1.exr, decoded. */
#include <math.h>

/* 4 rows of 4 texels of 3 channels */
static const float homofact_texture_0[48] = {
    -0.9383782f, 0.025643835f, -1.063985f, 0.6932579f, 0.082945704f, 0.80223155f, -0.7738928f, -0.30237222f, -0.8513479f,
    -1.1755413f, -0.46020854f, -1.3225619f, -0.506692f, -0.21413933f, -0.5099999f, 1.0265005f, 0.22322838f, 1.1638944f,
    -0.9479241f, -0.35022637f, -1.0586892f, -1.3398509f, -0.57775235f, -1.518807f, 0.8153975f, 0.37937242f, 0.9418442f,
    2.4321184f, 1.2201062f, 2.6031485f, -1.206858f, -0.50617486f, -1.3356316f, -1.2871884f, -0.51492345f, -1.4867425f,
    6.7009864f, 5.240704f, 6.9902563f, 4.6754217f, 4.918358f, 4.684105f, 4.555101f, 0.3396277f, 4.5698295f,
    -14.903349f, -2.0201747f, -15.382518f
};

/* 4 rows of 4 texels of 3 channels */
static const float homofact_texture_1[48] = {
    5.520148f, 1.161673f, 6.0912814f, 1.1124259f, -0.35494843f, 1.3363723f, 0.64965916f, 1.1827163f, 0.4689244f,
    6.620049f, 5.7490354f, 6.482907f, 3.8361437f, 1.7397245f, 4.016982f, -2.4184477f, -1.1477404f, -2.586519f,
    -1.983927f, -1.1026026f, -2.0556672f, -0.7407859f, -0.71054447f, -0.65718704f, -1.7929229f, -0.7365425f, -1.9448969f,
    -1.9034863f, -1.0591384f, -1.9680725f, -1.238396f, -0.7535041f, -1.2146266f, -1.0549744f, -0.3677725f, -1.1208235f,
    -3.35304f, -2.0520363f, -3.6582768f, -1.2491527f, -0.75553894f, -1.2507576f, -0.9716496f, -0.5790235f, -0.88640046f,
    -1.031643f, -0.21375681f, -1.0532395f
};

static void homofact_lookup(const float *texels, int rows, int columns, const float uv[2], float *value)
{
    const float x = fminf(fmaxf(uv[0] * (float)columns - 0.5f, 0.0f), (float)(columns - 1));
    const float y = fminf(fmaxf(uv[1] * (float)rows - 0.5f, 0.0f), (float)(rows - 1));
    const int column = (int)x, row = (int)y;
    const int right = column + 1 < columns ? column + 1 : column, above = row + 1 < rows ? row + 1 : row;
    const float u = x - (float)column, v = y - (float)row;
    for (int c = 0; c < 3; c++) {
        const float low = (1.0f - u) * texels[(row * columns + column) * 3 + c]
            + u * texels[(row * columns + right) * 3 + c];
        const float high = (1.0f - u) * texels[(above * columns + column) * 3 + c]
            + u * texels[(above * columns + right) * 3 + c];
        value[c] = (1.0f - v) * low + v * high;
    }
}

/* f_out[3]: R, G, B */
void homofact_evaluate(const float wi[3], const float wo[3], float f_out[3])
{
    /* s points along the half vector, at right angles to e */
    const float s[3] = {wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]};
    const float e[3] = {wi[0] - wo[0], wi[1] - wo[1], wi[2] - wo[2]};
    /* of s, s.xy, e */
    const float lengths[3] = {sqrtf(s[0] * s[0] + s[1] * s[1] + s[2] * s[2]), sqrtf(s[0] * s[0] + s[1] * s[1]), sqrtf(e[0] * e[0] + e[1] * e[1] + e[2] * e[2])};
    /* theta_h, theta_d, phi_d */
    const float angle[3] = {atan2f(lengths[1], s[2] + 1e-20f), atan2f(lengths[2], lengths[0] + 1e-20f), atan2f(fabsf(s[0] * e[1] - s[1] * e[0]), fabsf(e[2]) * lengths[0] + 1e-20f)};
    /* r = theta_h/(pi/2) stretched to asinh(r/0.03)/asinh(1/0.03) */
    const float warped_0 = asinhf(angle[0] * 21.22066f);
    /* texture 0: theta_h-theta_d on isotropic-half-diff, 4 x 4 texels */
    const float uv_0[2] = {warped_0 * 0.1785744f + 0.125f, angle[1] * 0.47746482f + 0.125f};
    float p_0[3];
    homofact_lookup(homofact_texture_0, 4, 4, uv_0, p_0);
    /* r = theta_h/(pi/2) stretched to asinh(r/0.03)/asinh(1/0.03) */
    const float warped_1 = asinhf(angle[0] * 21.22066f);
    const float x_1[4] = {warped_1, angle[1], angle[2], 1.0f};
    /* texture 1: searched on isotropic-half-diff, 4 x 4 texels */
    const float uv_1[2] = {0.049518656f * x_1[0] + 0.15396665f * x_1[1] + (-0.19109726f * x_1[2]) + 0.4251749f * x_1[3], 0.105101466f * x_1[0] + (-0.008997291f * x_1[1]) + 0.1874516f * x_1[2] + 0.13913292f * x_1[3]};
    float p_1[3];
    homofact_lookup(homofact_texture_1, 4, 4, uv_1, p_1);
    /* the sum of logarithms; the constant is log A and the textures' biases */
    const float log_f[3] = {p_0[0] + p_1[0] + (-1.1169462f), p_0[1] + p_1[1] + (-0.8854499f), p_0[2] + p_1[2] + (-1.1307396f)};
    /* 0 under the horizon */
    const float above = (fminf(wi[2], wo[2]) >= 0.0f ? 1.0f : 0.0f);
    /* epsilon A was added before the logarithm */
    const float f[3] = {fmaxf(expf(log_f[0]) - 0.003272777f, 0.0f), fmaxf(expf(log_f[1]) - 0.0041252854f, 0.0f), fmaxf(expf(log_f[2]) - 0.0032279443f, 0.0f)};
    f_out[0] = f[0] * above;
    f_out[1] = f[1] * above;
    f_out[2] = f[2] * above;
}
