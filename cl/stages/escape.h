/* What happens to a path that leaves the scene: it gathers the environment's light.  Where next-event estimation also
   finds that light, the power heuristic weights the two (METHODS §6). */
#ifndef CLVOL_STAGES_ESCAPE_H
#define CLVOL_STAGES_ESCAPE_H
#if CLVOL_HAS_CONSTANT || CLVOL_HAS_ENVMAP || CLVOL_HAS_ALPHA || CLVOL_HAS_BACKDROP
#include "core/scene.h"

#if CLVOL_HAS_ALPHA
/* Alpha is the expectation of 1 less the weight of paths that leave unscattered: 1 - T of all that is in the way, over
   the mean of the channels. */
INLINE void let_through(const Scene *scene, uint slot, float share)
{
    if (path_bounce(scene, slot) > 0)
        return;
    const float through = path_sample_weight(scene, slot) * spectrum_signed_mean(path_beta(scene, slot));
    set_path_alpha(scene, slot, path_alpha(scene, slot) - share * through);
}
#endif

#if CLVOL_HAS_CONSTANT || CLVOL_HAS_ENVMAP
#include "emitter/emitter.h"
#include "path/ray.h"
#endif

/* What a path of weight 1 gathers if it leaves along its ray. */
INLINE Spectrum escape_light(const Scene *scene, uint slot)
{
#if CLVOL_HAS_MAX_DEPTH
    if (scene->render->max_depth == 0)
        return (Spectrum)(0.0f);
#endif
#if CLVOL_HAS_BACKDROP
    if (path_bounce(scene, slot) == 0)
        return to_spectrum(load_vector(scene->render->backdrop), (int)path_channel(scene, slot));
#endif
#if CLVOL_HAS_CONSTANT || CLVOL_HAS_ENVMAP
    if (CLVOL_HIDE_ENVIRONMENT && path_bounce(scene, slot) == 0)
        return (Spectrum)(0.0f);
    float light_pdf;
    const Ray ray = path_ray(scene, slot);
    const float3 rgb = environment(scene, ray.o, ray.d, &light_pdf);
    const float pdf = path_pdf(scene, slot);
#if CLVOL_HAS_SUN
    const float3 sun = sun_radiance(scene->emitters + sun_number(scene), ray.d);
    const float sky_weight = pdf > 0.0f ? mis_weight(pdf, light_pdf) : 1.0f;
    const float sun_weight = pdf > 0.0f ? mis_weight(pdf, sun_pdf(scene, ray.o)) : 1.0f;
    return to_spectrum(rgb * sky_weight + sun * sun_weight, (int)path_channel(scene, slot));
#endif
    return to_spectrum(rgb, (int)path_channel(scene, slot)) * (pdf > 0.0f ? mis_weight(pdf, light_pdf) : 1.0f);
#else
    return (Spectrum)(0.0f);
#endif
}

INLINE void shade_escape(const Scene *scene, uint slot)
{
#if CLVOL_HAS_CONSTANT || CLVOL_HAS_ENVMAP || CLVOL_HAS_BACKDROP
    const Spectrum radiance = path_beta(scene, slot) * escape_light(scene, slot);
    set_path_radiance(scene, slot, path_radiance(scene, slot) + radiance);
#endif
#if CLVOL_HAS_ALPHA
    let_through(scene, slot, 1.0f);
#endif
}

#endif
#endif
