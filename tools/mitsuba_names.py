"""The plugins of Mitsuba 0.6, 2 and 3.9 by name: what else scenes name is of another program."""

from __future__ import annotations

import re

_PLUGINS = """
cube cylinder disk rectangle sphere obj ply serialized shapegroup instance merge hair heightfield
deformable blender bsplinecurve linearcurve sdfgrid ellipsoids ellipsoidsmesh diffuse roughdiffuse
dielectric thindielectric roughdielectric conductor roughconductor plastic roughplastic pplastic
coating roughcoating bumpmap normalmap phong ward mixturebsdf blendbsdf mask twosided difftrans hk
irawan null principled principledthin measured measured_polarized polarizer retarder circular bitmap
checkerboard gridtexture scale vertexcolors wireframe curvature mesh_attribute volume uniform
rawconstant srgb d65 regular irregular blackbody spectrum rgb dipole singlescatter homogeneous
heterogeneous isotropic hg rayleigh kkay microflake mixturephase blendphase sggx tabphase
constvolume gridvolume volcache hgridvolume area point spot directional directionalarea collimated
sky sun sunsky timed_sunsky envmap constant projector perspective perspective_rdist thinlens
orthographic telecentric spherical irradiancemeter fluencemeter radiancemeter distant batch ao
direct path volpath volpath_simple volpathsimple volpathmis bdpt photonmap ppm sppm pssmlt mlt erpt
ptracer adaptive vpl irrcache multichannel field motion moment aov stokes depth prb prb_basic
prb_projective prbvolpath direct_projective volprim_rf_basic independent stratified ldsampler halton
hammersley sobol multijitter orthogonal hdrfilm tiledhdrfilm ldrfilm mfilm specfilm exrfilm pngfilm
box tent gaussian mitchell catmullrom lanczos ldrtexture exrtexture lambertian mirror
"""
PLUGINS = frozenset(_PLUGINS.split())
_ELEMENTS = """
scene integrator sensor camera sampler film rfilter shape bsdf texture subsurface medium phase
volume emitter luminaire utility float integer boolean string point vector rgb srgb spectrum
blackbody transform animation translate rotate scale matrix lookat lookAt ref alias default include
path null
"""
ELEMENTS = frozenset(_ELEMENTS.split())
_PLUGIN = re.compile(r"(?:unknown \w+|integrator|sampler|film|sensor) '([^']+)'(?: is not supported.*)?$")
_ELEMENT = re.compile(r"unknown element <(\w+)>$")


def is_foreign(what: str) -> bool:
    """Whether a fault is about a plugin, or an element, that no release of Mitsuba has."""
    if found := _ELEMENT.match(what):
        return found[1] not in ELEMENTS
    found = _PLUGIN.match(what)
    return bool(found) and found[1] not in PLUGINS and not what.startswith("unknown parameter")
