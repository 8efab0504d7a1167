/* Beckmann and GGX microfacets (Walter et al. 2007), sampled by the normals that are visible (Heitz and d'Eon 2014).

   G1(w) is the share of the facets facing w that are seen from there.  Values use the fit for Beckmann of Walter et
   al. (within 0.35 %), as Mitsuba does; pdfs use the exact G1, since that is what visible normals are drawn with.  Both
   come divided by |cos theta|, which stays finite at the horizon. */
#ifndef CLVOL_BSDF_MICROFACET_H
#define CLVOL_BSDF_MICROFACET_H
#include "core/scene.h"

/* What a distribution is given by.  Where roughness varies over a surface, it is what `material_facets` finds at a point;
   else the material itself. */
#if CLVOL_VARIED_ROUGHNESS
#include "bsdf/facets.h"
#define FACETS const Facets
#define LOAD_FACETS(scene, material, uv) const Facets facets = material_facets(scene, material, uv);
#define FACETS_OF(material) (&facets)
#else
#define FACETS __global const Material
#define LOAD_FACETS(scene, material, uv)
#define FACETS_OF(material) material
#endif

/* Density D of the normals m per solid angle and area; m.z > 0. */
INLINE float microfacet_density(FACETS *material, float3 m)
{
    const float au = material->alpha_u, av = material->alpha_v;
    const float x = m.x / au, y = m.y / av, cos2 = m.z * m.z;
    float density;
    if (material->distribution == DISTRIBUTION_GGX) {
        const float rho = x * x + y * y + cos2;
        density = 1.0f / (PI * au * av * rho * rho);
    } else {
        density = exp(-(x * x + y * y) / cos2) / (PI * au * av * cos2 * cos2);
    }
    return density * m.z > 1e-20f ? density : 0.0f;
}

/* Length of the tangential part of w in units of roughness: tan theta times alpha is this over cos theta. */
INLINE float stretched_sine(FACETS *material, float3 w)
{
    const float x = material->alpha_u * w.x, y = material->alpha_v * w.y;
    return sqrt_of(x * x + y * y);
}

INLINE float ggx_over_cos(float c, float s) { return 2.0f / (c + sqrt_of(c * c + s * s)); }

/* G1(w) / |cos theta| of the model's values. */
INLINE float shadowing_over_cos(FACETS *material, float3 w)
{
    const float c = abs_of(w.z), s = stretched_sine(material, w);
    if (material->distribution == DISTRIBUTION_GGX)
        return ggx_over_cos(c, s);
    if (c >= 1.6f * s)
        return 1.0f / c;
    const float a = c / s;
    return (2.181f * a + 3.535f) / (s * ((2.577f * a + 2.276f) * a + 1.0f));
}

/* G1(w) / |cos theta| of the density of visible normals. */
INLINE float visibility_over_cos(FACETS *material, float3 w)
{
    const float c = abs_of(w.z), s = stretched_sine(material, w);
    if (material->distribution == DISTRIBUTION_GGX)
        return ggx_over_cos(c, s);
    if (c >= 4.0f * s) /* 1 + erf(a) is 2 and exp(-a²) nothing */
        return 1.0f / c;
    const float a = c / s;
    return 2.0f / (c * (1.0f + erf(a)) + s * (0.56418958354775628695f * exp(-a * a)));
}

/* G1(wo) of values. */
INLINE float shadowing(FACETS *material, float3 w) { return abs_of(w.z) * shadowing_over_cos(material, w); }

/* Inverse error function, |x| < 1; relative error about 1e-6 (Giles 2012). */
INLINE float erf_inverse(float x)
{
    const float safe = clamp_to(x, -0x1.fffffep-1f, 0x1.fffffep-1f);
    float w = -log((1.0f - safe) * (1.0f + safe)), p;
    if (w < 5.0f) {
        w -= 2.5f;
        p = 2.81022636e-08f * w + 3.43273939e-07f;
        p = p * w - 3.5233877e-06f;
        p = p * w - 4.39150654e-06f;
        p = p * w + 2.1858087e-04f;
        p = p * w - 1.25372503e-03f;
        p = p * w - 4.17768164e-03f;
        p = p * w + 2.46640727e-01f;
        p = p * w + 1.50140941f;
    } else {
        w = sqrt_of(w) - 3.0f;
        p = 1.00950558e-04f - 2.00214257e-04f * w;
        p = p * w + 1.34934322e-03f;
        p = p * w - 3.67342844e-03f;
        p = p * w + 5.73950773e-03f;
        p = p * w - 7.6224613e-03f;
        p = p * w + 9.43887047e-03f;
        p = p * w + 1.00167406f;
        p = p * w + 2.83297682f;
    }
    return p * safe;
}

/* Slope along the plane of incidence for roughness 1, of density (c - slope s)+ exp(-slope²) with c, s = cos and sin of
   the incidence: its distribution function, with x = erf(slope) as the unknown (Jakob 2014), is solved by Newton's
   method kept between bounds. */
INLINE float beckmann_slope(float c, float s, float u)
{
    const float inv_sqrt_pi = 0.56418958354775628695f;
    const float cot = c / max_of(s, 1e-20f);
    const float last = erf(cot);
    const float total = c * (1.0f + last) + s * inv_sqrt_pi * exp(-cot * cot);
    float low = -1.0f, high = last;
    float x = last - (last + 1.0f) * erf(sqrt_of(-log(max_of(u, 1e-30f))));
    float slope = 0.0f;
    for (int step = 0; step < 12; ++step) {
        if (!(x >= low && x <= high))
            x = 0.5f * (low + high);
        slope = erf_inverse(x);
        const float excess = c * (1.0f + x) + s * inv_sqrt_pi * exp(-slope * slope) - u * total;
        if (abs_of(excess) < 5e-7f * total)
            break;
        low = excess < 0.0f ? x : low;
        high = excess < 0.0f ? high : x;
        x -= excess / (c - slope * s);
    }
    return slope;
}

INLINE float3 beckmann_normal(FACETS *material, float3 w, float u, float v)
{
    const float r2 = w.x * w.x + w.y * w.y, r = sqrt_of(r2);
    const float cos_phi = r > 0.0f ? w.x / r : 1.0f, sin_phi = r > 0.0f ? w.y / r : 0.0f;
    const float x = beckmann_slope(w.z, r, u), y = erf_inverse(2.0f * v - 1.0f);
    return (float3)(-material->alpha_u * (cos_phi * x - sin_phi * y), -material->alpha_v * (sin_phi * x + cos_phi * y),
                    1.0f);
}

/* Reflecting w on a sphere gives a spherical cap of uniform directions (Dupuy and Benyoub 2023). */
INLINE float3 ggx_normal(FACETS *material, float3 w, float u, float v)
{
    const float h = (1.0f - v) * (1.0f + w.z), z = h - w.z;
    const float r = sqrt_of(max_of(1.0f - z * z, 0.0f));
    const float2 turn = cos_sin_turn(u);
    return (float3)(material->alpha_u * (r * turn.x + w.x), material->alpha_v * (r * turn.y + w.y), h);
}

/* A normal m, m.z > 0, of density D(m) G1(w) (w·m)+ / cos theta; w.z > 0. */
INLINE float3 sample_visible_normal(FACETS *material, float3 w, float u, float v)
{
    const float3 stretched = unit_of((float3)(material->alpha_u * w.x, material->alpha_v * w.y, w.z));
    const float3 m = material->distribution == DISTRIBUTION_GGX ? ggx_normal(material, stretched, u, v)
                                                                : beckmann_normal(material, stretched, u, v);
    return unit_of((float3)(m.x, m.y, max_of(m.z, 1e-12f)));
}

#endif
