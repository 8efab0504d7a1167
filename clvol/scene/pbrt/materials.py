"""Materials as BSDFs: those that Mitsuba has, and those that it has nearly, which is said."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.errors import SceneError, shortened
from clvol.scene.nodes import MAX_DEPTH, Node
from clvol.scene.pbrt.colours import GLASSES
from clvol.scene.refraction import METALS
from clvol.scene.vocabulary import did_you_mean, join_hints, listed

if TYPE_CHECKING:
    from collections.abc import Callable

    from clvol.scene.pbrt.context import Context
    from clvol.scene.pbrt.parameters import Parameters
    from clvol.scene.pbrt.statements import Thing
    from clvol.scene.pbrt.textures import Textures

SMOOTH = 1e-3
"""Roughness alpha below which pbrt takes a surface as smooth."""


class Materials:
    """The materials of a scene, each made once; those with textures once for each kind of surface."""

    def __init__(self, context: Context, textures: Textures) -> None:
        self.context, self.textures = context, textures
        self._made: dict[tuple[int, str], Node] = {}
        self._varied: set[int] = set()
        self._default: Node | None = None
        self._depth = 0

    def node(self, material: Thing | str | None, where: str) -> Node:
        """The BSDF of a material, of the one of that name, or of pbrt's default."""
        if material is None:
            if self._default is None:
                self._default = self._both(self.context.node("bsdf", "diffuse", where), where)
            return self._default
        if isinstance(material, str):
            material = self._named(material, where)
        before = self.textures.varied
        key = id(material), self.textures.surface if id(material) in self._varied else ""
        if key not in self._made:
            made = self._build(material)
            if self.textures.varied > before:
                self._varied.add(id(material))
                key = id(material), self.textures.surface
            self._made[key] = made
        self.textures.varied += id(material) in self._varied  # a mixture of it varies too
        return self._made[key]

    def is_interface(self, material: Thing | str | None, where: str) -> bool:
        """Whether it is no surface, only a boundary of media."""
        if isinstance(material, str):
            material = self._named(material, where)
        return material is not None and material.type in ("", "none", "interface")

    def _named(self, name: str, where: str) -> Thing:
        known = self.context.read.materials
        if name not in known:
            hint = join_hints(did_you_mean(name, known), f"known: {listed(known)}")
            raise SceneError(f"there is no material '{shortened(name, 60)}'", where, hint)
        return known[name]

    def _build(self, thing: Thing) -> Node:
        parameters = thing.parameters()
        if thing.what == "MakeNamedMaterial":
            parameters.get("type")
        if self._depth >= MAX_DEPTH:
            parameters.fail("it is made of itself")
        builder = _BUILDERS.get(thing.type)
        if builder is None:
            hint = join_hints(did_you_mean(thing.type, _BUILDERS), f"supported: {listed(_BUILDERS)}")
            parameters.refuse(f"the material '{thing.type[:60]}'", hint=hint)
        self._depth += 1
        made = builder(self, thing, parameters)
        self._depth -= 1
        if parameters.get("displacement") is not None:
            self.context.say("'displacement' of materials is left out", parameters.place("displacement"))
        made = self._bent(made, thing, parameters)
        parameters.finish()
        return made

    def _bent(self, bsdf: Node, thing: Thing, parameters: Parameters) -> Node:
        """The BSDF under the normals of a picture, if the material names one; alike on both sides."""
        if parameters.get("normalmap") is None:
            return bsdf
        if thing.type == "mix":
            parameters.refuse("the normalmap of a mix", parameters.place("normalmap"), "give it to its parts")
        said = "light that meets a surface and its normalmap from different sides is left out"
        self.context.say(said, parameters.place("normalmap"))
        flags = dict.fromkeys(("flip_invalid_normals", "use_shadowing_function"), False)
        normals = self.textures.normals(parameters, "normalmap")
        made = self._bsdf("normalmap", thing, normalmap=normals, **flags)
        made.add_nameless(bsdf)
        return made

    # -- the materials -------------------------------------------------------------------------------

    def interface(self, thing: Thing, parameters: Parameters) -> Node:
        """No surface."""
        return self.context.node("bsdf", "null", thing.where)

    def diffuse(self, thing: Thing, parameters: Parameters) -> Node:
        """Both sides reflect."""
        reflectance = self.textures.of(parameters, "reflectance", 0.5, thing.state.space)
        value = self.textures.value(reflectance, thing.where)
        return self._both(self._bsdf("diffuse", thing, reflectance=value), thing.where)

    def dielectric(self, thing: Thing, parameters: Parameters) -> Node:
        """Smooth, or of GGX microfacets, as pbrt's Trowbridge-Reitz."""
        indices = self._indices(thing, parameters, "eta")
        rough = self._roughness(parameters, "")
        return self._bsdf("roughdielectric" if rough else "dielectric", thing, **indices, **rough)

    def thin(self, thing: Thing, parameters: Parameters) -> Node:
        """A pane."""
        return self._bsdf("thindielectric", thing, **self._indices(thing, parameters, "eta"))

    def conductor(self, thing: Thing, parameters: Parameters) -> Node:
        """A metal of eta and k, or of the reflectance at normal incidence."""
        return self._both(self._metal(thing, parameters, ""), thing.where)

    def coated_diffuse(self, thing: Thing, parameters: Parameters) -> Node:
        """The plastic whose inner reflections are counted; pbrt walks through the layers by chance."""
        reflectance = self.textures.of(parameters, "reflectance", 0.5, thing.state.space)
        self._layers(parameters)
        rough = self._roughness(parameters, "")
        if len(rough) > 2:
            rough = {"distribution": "ggx", "alpha": float(np.sqrt(rough["alpha_u"] * rough["alpha_v"]))}
        plastic = self._bsdf(
            "roughplastic" if rough else "plastic",
            thing,
            diffuse_reflectance=self.textures.value(reflectance, thing.where),
            nonlinear=True,
            **self._indices(thing, parameters, "eta"),
            **rough,
        )
        self.context.say("material 'coateddiffuse' is taken as Mitsuba's plastic", thing.where)
        return self._both(plastic, thing.where)

    def coated_conductor(self, thing: Thing, parameters: Parameters) -> Node:
        """The metal under the coat alone."""
        self._layers(parameters)
        parameters.ignore(*(f"interface.{name}" for name in ("roughness", "uroughness", "vroughness", "eta")))
        metal = self._metal(thing, parameters, "conductor.")
        self.context.say("material 'coatedconductor' is taken as a conductor without its coat", thing.where)
        return self._both(metal, thing.where)

    def mix(self, thing: Thing, parameters: Parameters) -> Node:
        """One or the other by chance: `amount` is the share of the second."""
        named = parameters.get("materials", "string")
        if named is None or len(named.texts) != 2:
            parameters.fail("'materials' takes the names of two materials")
        first, second = (self.node(name, thing.where) for name in named.texts)
        amount = self.textures.of(parameters, "amount", 0.5, thing.state.space, "float")
        if isinstance(amount, np.ndarray) and amount[0] in (0, 1):
            return second if amount[0] else first
        weight = (
            float(amount[0]) if isinstance(amount, np.ndarray) else self.textures.value(amount, thing.where)
        )
        made = self._bsdf("blendbsdf", thing, weight=weight)
        made.add_nameless(first)
        made.add_nameless(second)
        return made

    # -- pieces --------------------------------------------------------------------------------------

    def _bsdf(self, type: str, thing: Thing, **values: Any) -> Node:
        return self.context.node("bsdf", type, thing.where, **values)

    def _both(self, bsdf: Node, where: str) -> Node:
        made = self.context.node("bsdf", "twosided", where)
        made.add_nameless(bsdf)
        return made

    def masked(self, bsdf: Node, opacity: Any, where: str) -> Node:
        """A BSDF that is there by chance, as `alpha` of a shape says."""
        made = self.context.node("bsdf", "mask", where, opacity=opacity)
        made.add_nameless(bsdf)
        return made

    def _layers(self, parameters: Parameters) -> None:
        parameters.ignore("thickness", "maxdepth", "nsamples", "g")
        if self.context.colour(parameters, "albedo", 0.0, "srgb").any():
            self.context.say("the medium inside of a coat is left out", parameters.place("albedo"))

    def _indices(self, thing: Thing, parameters: Parameters, name: str) -> dict[str, float]:
        eta = self.context.colour(parameters, name, 1.5, thing.state.space)
        found = parameters.get(name)
        if found is not None and found.type == "spectrum" and found.values and found.values[0] in GLASSES:
            self.context.say("dispersion is left out: a glass has its index at 587.6 nm", found.where)
        elif np.ptp(eta) > 0:
            self.context.say("dispersion is left out: an index is the green one", parameters.place(name))
        return {"int_ior": float(eta[1]), "ext_ior": 1.0}

    def _metal(self, thing: Thing, parameters: Parameters, prefix: str) -> Node:
        space, rough = thing.state.space, self._roughness(parameters, prefix)
        if parameters.get(prefix + "reflectance") is not None:
            texture = self.textures.of(parameters, prefix + "reflectance", 0.5, space)
            if not isinstance(texture, np.ndarray):
                parameters.fail("a conductor's reflectance cannot be a texture")
            at_normal = np.clip(texture, 0, 0.9999)
            eta, k = np.ones(3), 2 * np.sqrt(at_normal) / np.sqrt(1 - at_normal)  # as pbrt works it out
        else:
            eta, k = (
                self._complex(parameters, prefix + name, n, space) for n, name in enumerate(("eta", "k"))
            )
        values = {name: self.context.rgb(value, thing.where) for name, value in (("eta", eta), ("k", k))}
        return self._bsdf("roughconductor" if rough else "conductor", thing, **values, **rough)

    def _complex(self, parameters: Parameters, name: str, which: int, space: str) -> np.ndarray:
        if parameters.get(name) is None:
            return np.array(METALS["Cu"][which])
        return self.context.colour(parameters, name, 1.0, space)

    def _roughness(self, parameters: Parameters, prefix: str) -> dict[str, Any]:
        """Parameters of microfacets; none where the surface is smooth."""
        both = self.textures.constant(parameters, prefix + "roughness", 0.0)
        sides = [
            self.textures.constant(parameters, prefix + name, both) for name in ("uroughness", "vroughness")
        ]
        remapped = parameters.boolean("remaproughness", True)
        u, v = np.sqrt(sides) if remapped else sides
        if max(u, v) < SMOOTH:
            return {}
        if u == v:
            return {"distribution": "ggx", "alpha": float(u)}
        return {"distribution": "ggx", "alpha_u": float(max(u, 1e-4)), "alpha_v": float(max(v, 1e-4))}


_BUILDERS: dict[str, Callable[[Materials, Thing, Parameters], Node]] = {
    **dict.fromkeys(("", "none", "interface"), Materials.interface),
    "diffuse": Materials.diffuse,
    "dielectric": Materials.dielectric,
    "thindielectric": Materials.thin,
    "conductor": Materials.conductor,
    "coateddiffuse": Materials.coated_diffuse,
    "coatedconductor": Materials.coated_conductor,
    "mix": Materials.mix,
}
