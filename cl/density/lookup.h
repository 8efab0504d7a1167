/* Look-ups of density.  Each header that --lookup names implements

       float density(scene, volume, p, channel, stream);
       float3 density3(scene, volume, p, stream);        three channels, for trackers that follow them all

   whose expectation is the field at index position p. */
#ifndef CLVOL_DENSITY_LOOKUP_H
#define CLVOL_DENSITY_LOOKUP_H
#include CLVOL_LOOKUP_HEADER

#endif
