/* What happens to a path that leaves the scene: it gathers the environment's light.  Where next-event estimation also
   finds that light, the power heuristic weights the two (METHODS §6). */
#ifndef CLVOL_STAGES_ESCAPE_H
#define CLVOL_STAGES_ESCAPE_H
#if CLVOL_HAS_CONSTANT || CLVOL_HAS_ENVMAP
#include "emitter/emitter.h"
#include "path/ray.h"

INLINE void shade_escape(const Scene *scene, uint slot)
{
    if (CLVOL_HIDE_EMITTERS && path_bounce(scene, slot) == 0)
        return;
#if CLVOL_HAS_MAX_DEPTH
    if (scene->render->max_depth == 0)
        return;
#endif
    float light_pdf;
    const Ray ray = path_ray(scene, slot);
    const float3 rgb = environment(scene, ray.o, ray.d, &light_pdf);
    Spectrum radiance = path_beta(scene, slot) * to_spectrum(rgb, (int)path_channel(scene, slot));
    const float pdf = path_pdf(scene, slot);
    if (pdf > 0.0f)
        radiance *= mis_weight(pdf, light_pdf);
    set_path_radiance(scene, slot, path_radiance(scene, slot) + radiance);
}

#endif
#endif
