/* Light from behind a medium by expectation, instead of by whether the path's walk gets through (background "expected").

   Control variate: a walk gets through with a probability of which it estimates the mean T, so that
   (L - C) (T - 1 if it gets through) adds nothing on the mean for any L and C that are known before the walk.  With L
   the light behind and C near what a collision brings, the picture is about T L + (1 - T) C whether the walk collides
   or not, and the noise of that chance all but cancels.  Single samples may be negative. */
#ifndef CLVOL_STAGES_BACKGROUND_H
#define CLVOL_STAGES_BACKGROUND_H
#if CLVOL_EXPECTS_BACKGROUND
#include "core/scene.h"
#include "stages/escape.h"

/* Of a walk in the scene's one medium, or a leg of it; `through`: its estimate of T. */
INLINE void expect_background(const Scene *scene, uint slot, float through, bool gets_through)
{
    const Spectrum inside = to_spectrum(load_vector(scene->media->background), (int)path_channel(scene, slot));
#if CLVOL_HAS_CONSTANT || CLVOL_HAS_ENVMAP || CLVOL_HAS_BACKDROP
    const Spectrum behind = escape_light(scene, slot);
#else
    const Spectrum behind = (Spectrum)(0.0f);
#endif
    const float chance = through - (gets_through ? 1.0f : 0.0f);
    const Spectrum added = path_beta(scene, slot) * (behind - inside) * chance;
    set_path_radiance(scene, slot, path_radiance(scene, slot) + added);
#if CLVOL_HAS_ALPHA
    let_through(scene, slot, chance);
#endif
}

#endif
#endif
