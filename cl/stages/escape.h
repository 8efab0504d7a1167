/* What happens to a path that leaves the scene: it gathers the environment's light.  Where next-event estimation also
   finds that light, the power heuristic weights the two (METHODS §6). */
#ifndef CLVOL_STAGES_ESCAPE_H
#define CLVOL_STAGES_ESCAPE_H
#if CLVOL_HAS_CONSTANT || CLVOL_HAS_ENVMAP
#include "emitter/emitter.h"
#include "path/ray.h"

/* What a path of weight 1 gathers if it leaves along its ray. */
INLINE Spectrum escape_light(const Scene *scene, uint slot)
{
    if (CLVOL_HIDE_EMITTERS && path_bounce(scene, slot) == 0)
        return (Spectrum)(0.0f);
#if CLVOL_HAS_MAX_DEPTH
    if (scene->render->max_depth == 0)
        return (Spectrum)(0.0f);
#endif
    float light_pdf;
    const Ray ray = path_ray(scene, slot);
    const float3 rgb = environment(scene, ray.o, ray.d, &light_pdf);
    const float pdf = path_pdf(scene, slot);
    return to_spectrum(rgb, (int)path_channel(scene, slot)) * (pdf > 0.0f ? mis_weight(pdf, light_pdf) : 1.0f);
}

INLINE void shade_escape(const Scene *scene, uint slot)
{
    const Spectrum radiance = path_beta(scene, slot) * escape_light(scene, slot);
    set_path_radiance(scene, slot, path_radiance(scene, slot) + radiance);
}

#endif
#endif
