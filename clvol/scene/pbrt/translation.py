"""`read_pbrt`: a .pbrt file as the node of a scene."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from clvol.base.files import other_kind
from clvol.errors import SceneError
from clvol.scene.pbrt.camera import Pictures
from clvol.scene.pbrt.context import Context
from clvol.scene.pbrt.directives import Directives
from clvol.scene.pbrt.lights import Lights
from clvol.scene.pbrt.materials import Materials
from clvol.scene.pbrt.media import Media
from clvol.scene.pbrt.shapes import Shapes
from clvol.scene.pbrt.textures import Textures

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from clvol.scene.faults import Faults
    from clvol.scene.nodes import Node
    from clvol.scene.pbrt.parameters import Parameters
    from clvol.scene.pbrt.statements import Thing

SUFFIXES = (".pbrt", ".pbrt.gz")
"""How names of such scenes end."""


def is_pbrt(path: str | os.PathLike[str]) -> bool:
    """Whether a file's name says that it is a pbrt scene."""
    return os.fspath(path).lower().endswith(SUFFIXES)


def read_pbrt(path: Path, keywords: Mapping[str, object], faults: Faults) -> Node:
    """The scene in a .pbrt file, in Mitsuba's vocabulary.

    keywords : must be empty, since there is nothing in such a file that they could fill.
    faults : takes what cannot be rendered.

    Raises
    ------
    SceneError
        With file and line: what cannot be understood.
    """
    if not os.path.isfile(path):
        if kind := other_kind(path):
            raise SceneError(f"'{path}' is {kind}, not a scene file")
        raise SceneError(f"scene file '{path}' does not exist")
    if keywords:
        raise SceneError(f"a pbrt scene has no $names, so '{min(keywords)}' fills nothing", str(path))
    directives = Directives(path)
    read = directives.run()
    context = Context(read, directives.folders, str(path), faults)
    for said, where in read.said:
        context.say(said, where)
    if read.moving:
        context.say("motion is left out: transforms are those of the exposure's start", read.moving)
    _Translation(context).run()
    return context.root


class _Translation:
    """Puts everything that a file asks for into the scene's node."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self.textures = Textures(context)
        self.materials = Materials(context, self.textures)
        self.media, self.shapes, self.lights = Media(context), Shapes(context), Lights(context)
        self.sees_media = True

    def run(self) -> None:
        """Everything; what is refused is told together at the end."""
        context, root = self.context, self.context.root
        pictures = Pictures(context)
        with context.collecting():
            integrator, self.sees_media = pictures.integrator()
            root.add_nameless(integrator)
        if not self.sees_media and any(
            thing.state.inside or thing.state.outside for thing, _ in context.read.shapes
        ):
            context.say("media are left out, since the integrator sees none", root.where)
        with context.collecting():
            root.add_nameless(pictures.sensor(self.media, self.sees_media))
        for thing in context.read.lights:
            with context.collecting():
                root.add_nameless(self.lights.node(thing))
        for thing, instances in context.read.shapes:
            with context.collecting():
                made = self._shape(thing, instances)
                if made is not None:
                    root.add_nameless(made)

    def _shape(self, thing: Thing, instances: tuple[np.ndarray, ...]) -> Node | None:
        """A shape with its material, light and media; None where nothing of it is seen."""
        state, parameters = thing.state, thing.parameters()
        matrix = state.ctm
        for instance in instances:
            matrix = instance @ matrix
        if not np.isfinite(matrix).all() or np.linalg.matrix_rank(matrix[:3, :3]) < 3:
            parameters.fail("the transform flattens space")
        interface = self.materials.is_interface(state.material, thing.where)
        divides = self.sees_media and state.inside != state.outside
        if interface and not divides:
            return None
        self.textures.surface, before = self.shapes.surface(thing, matrix), self.textures.varied
        bsdf = self._alpha(self.materials.node(state.material, thing.where), thing, parameters)
        made = self.shapes.node(thing, parameters, matrix, self.textures.varied > before)
        parameters.finish()
        made.add_nameless(bsdf)
        if state.area_light is not None and not interface:
            made.add_nameless(self.lights.area(state.area_light))
        if divides:
            for name, medium in (("interior", state.inside), ("exterior", state.outside)):
                if medium:
                    made.add(name, self.media.reference(medium, thing.where), thing.where)
        return made

    def _alpha(self, bsdf: Node, thing: Thing, parameters: Parameters) -> Node:
        """The BSDF where a shape's `alpha` lets it be."""
        opacity = self.textures.of(parameters, "alpha", 1.0, "srgb", "float")
        if isinstance(opacity, np.ndarray):
            if opacity[0] >= 1:
                return bsdf
            return self.materials.masked(bsdf, float(max(opacity[0], 0.0)), thing.where)
        return self.materials.masked(bsdf, self.textures.value(opacity, thing.where), thing.where)
