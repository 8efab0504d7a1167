"""Media: pbrt's sigma_a and sigma_s, times a density, as extinction and albedo.

In pbrt as here a medium emits sigma_a L_e, and coefficients are per unit of the world, whatever the medium's
own transform.  An Le is of luminance 1 where a light's is; black bodies and the Le of an rgbgrid are not
normalised.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.errors import SceneError, shortened
from clvol.scene.lookup import find
from clvol.scene.nodes import Node
from clvol.scene.pbrt.cloud import SAMPLES, cloud_density
from clvol.scene.pbrt.colours import glow, light_colour, to_srgb
from clvol.scene.pbrt.presets import PRESETS
from clvol.scene.spectra import Y_INTEGRAL
from clvol.scene.transforms import scale, translate
from clvol.scene.vocabulary import did_you_mean, join_hints, listed
from clvol.volumes import read_volume
from clvol.volumes.grid import SparseGrid
from clvol.volumes.listing import list_grids

if TYPE_CHECKING:
    from collections.abc import Callable

    from clvol.scene.pbrt.context import Context
    from clvol.scene.pbrt.parameters import Parameters
    from clvol.scene.pbrt.statements import Thing

MOST_CLOUDED = 1e4
"""Largest frequency and wispiness of a cloud."""


class Media:
    """The media of a scene by name, each made once, and put into the scene to be referred to."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self._made: set[str] = set()

    def reference(self, name: str, where: str) -> Node:
        """A reference to the medium of that name."""
        known = self.context.read.media
        if name not in known:
            hint = join_hints(did_you_mean(name, known), f"known: {listed(known)}")
            raise SceneError(f"there is no medium '{shortened(name, 60)}'", where, hint)
        if name not in self._made:
            made = self._build(name, known[name])
            self.context.root.add_nameless(made)
            self._made.add(name)
        return self.context.reference(name, where)

    def _build(self, name: str, thing: Thing) -> Node:
        parameters = thing.parameters()
        parameters.get("type")
        builder = _BUILDERS.get(thing.type)
        if builder is None:
            hint = join_hints(did_you_mean(thing.type, _BUILDERS), f"supported: {listed(_BUILDERS)}")
            parameters.refuse(f"the medium '{thing.type[:60]}'", hint=hint)
        kind, values = builder(self, thing, parameters)
        made = self.context.node("medium", kind, thing.where, id=name, **values)
        g = parameters.number("g", 0.0, -1.0, 1.0)
        if g:
            made.add_nameless(self.context.node("phase", "hg", thing.where, g=g))
        parameters.finish()
        return made

    # -- the media -----------------------------------------------------------------------------------

    def homogeneous(self, thing: Thing, parameters: Parameters) -> tuple[str, dict[str, Any]]:
        """The same everywhere."""
        sigma_t, albedo = self._coefficients(thing, parameters)
        values = {"sigma_t": self._rgb(sigma_t, thing), "albedo": self._rgb(albedo, thing)}
        emitted = self._emitted(thing, parameters)
        if emitted is not None and (factor := parameters.number("Lescale", 1.0, 0.0)):
            values["emission"] = self._rgb(emitted * factor * self.context.exposure, thing)
        return "homogeneous", values

    def uniform(self, thing: Thing, parameters: Parameters) -> tuple[str, dict[str, Any]]:
        """A grid of densities, and perhaps of factors of Le or of temperatures."""
        counts = self._counts(parameters)
        density = self._grid(parameters, "density", counts)
        if density is None:
            parameters.fail("'density' is missing")
        values = self._scaled(thing, parameters)
        emission, factor = self._grid_emission(thing, parameters, counts)
        padded = _has_border(density) or (emission is not None and _has_border(emission))
        matrix = self._box(thing, parameters)
        values["sigma_t"] = self._volume(thing, density, matrix, padded)
        if emission is not None:
            values["emission"] = self._volume(thing, emission, matrix, padded)
        if factor is not None:
            values["emission" if emission is None else "emission_scale"] = self._rgb(factor, thing)
        return "heterogeneous", values

    def rgb(self, thing: Thing, parameters: Parameters) -> tuple[str, dict[str, Any]]:
        """Grids of coloured coefficients."""
        counts, space = self._counts(parameters), thing.state.space
        matrix = to_srgb(space, light=False).T
        grids = {name: self._grid(parameters, name, counts, "rgb") for name in ("sigma_a", "sigma_s")}
        given = [grid for grid in grids.values() if grid is not None]
        if not given:
            parameters.fail("sigma_a or sigma_s is missing")
        sigma_a, sigma_s = (
            np.ones_like(given[0]) if grid is None else np.maximum(grid @ matrix, 0)
            for grid in grids.values()
        )
        sigma_t = sigma_a + sigma_s
        albedo = np.divide(sigma_s, sigma_t, out=np.zeros_like(sigma_t), where=sigma_t > 0)
        emission = self._grid(parameters, "Le", counts, "rgb")
        padded = _has_border(sigma_t)
        box = self._box(thing, parameters)
        values: dict[str, Any] = {
            "sigma_t": self._volume(thing, sigma_t, box, padded),
            "scale": parameters.number("scale", 1.0, 0.0),
        }
        seen = albedo[sigma_t > 0]
        if not len(seen) or np.ptp(seen) == 0:
            values["albedo"] = float(seen[0]) if len(seen) else 0.0
        else:
            values["albedo"] = self._volume(thing, albedo, box, padded, fill="edge")
            self.context.say("an rgbgrid's albedo is interpolated, not its sigma_s", thing.where)
        factor = parameters.number("Lescale", 1.0, 0.0) * Y_INTEGRAL * self.context.exposure
        if emission is not None and emission.any() and factor:
            emission = np.maximum(emission @ to_srgb(space, light=True).T, 0)
            values |= {"emission": self._volume(thing, emission, box, padded), "emission_scale": factor}
        return "heterogeneous", values

    def cloud(self, thing: Thing, parameters: Parameters) -> tuple[str, dict[str, Any]]:
        """The procedural cloud, on a grid."""
        shape = {
            "density": parameters.number("density", 1.0, 0.0, MOST_CLOUDED),
            "wispiness": parameters.number("wispiness", 1.0, 0.0, MOST_CLOUDED),
            "frequency": parameters.number("frequency", 5.0, -MOST_CLOUDED, MOST_CLOUDED),
        }
        matrix = self._box(thing, parameters)
        lower, upper = self._corners(parameters)
        if np.abs([lower, upper]).max() > MOST_CLOUDED:
            parameters.fail(f"a cloud's box reaches at most {MOST_CLOUDED:g} from the origin")
        values = self._scaled(thing, parameters)
        density = cloud_density(lower, upper, **shape)
        values["sigma_t"] = self._volume(thing, density, matrix, False)
        self.context.say(f"the medium 'cloud' is taken as a grid of at most {SAMPLES}³ samples", thing.where)
        return "heterogeneous", values

    def nanovdb(self, thing: Thing, parameters: Parameters) -> tuple[str, dict[str, Any]]:
        """A density of a NanoVDB file, and perhaps temperatures."""
        where = parameters.place("filename")
        path = find(parameters.string("filename", ""), self.context.folders, where)
        names = [listed.name for listed in list_grids(path)]
        density = parameters.string("gridname", "density")
        temperature = parameters.string("temperaturename", "temperature")
        if density not in names:
            parameters.fail(f"'{path}' has no grid '{density[:60]}'", where, f"it has {listed(names)}")
        values = self._scaled(thing, parameters)
        values["sigma_t"] = self.context.node(
            "volume", "vdbvolume", thing.where, filename=str(path), grid=density, to_world=thing.state.ctm
        )
        older = parameters.number("LeScale", 1.0, 0.0)
        factor = parameters.number("Lescale", older, 0.0) * self.context.exposure
        offset, scaled = self._temperature(parameters)
        absorbs = not isinstance(values["albedo"], Node) or min(values["albedo"]["value"]) < 1
        if temperature in names and factor and absorbs:
            grid = read_volume(path, temperature)
            if not isinstance(grid, SparseGrid) or grid.channels != 1:
                parameters.fail(f"the grid '{temperature[:60]}' has no temperatures", where)
            shown = replace(
                grid,
                leaf_values=_glowing(grid.leaf_values[..., 0], offset, scaled),
                tile_values=_glowing(grid.tile_values[..., 0], offset, scaled),
                background=_glowing(grid.background[0], offset, scaled),
            )
            values["emission"] = self.context.node(
                "volume", "gridvolume", thing.where, grid=shown, to_world=thing.state.ctm
            )
            values["emission_scale"] = factor
            self._say_glowing(thing)
        return "heterogeneous", values

    # -- pieces --------------------------------------------------------------------------------------

    def _rgb(self, value: np.ndarray, thing: Thing) -> Node:
        return self.context.rgb(value, thing.where)

    def _coefficients(self, thing: Thing, parameters: Parameters) -> tuple[np.ndarray, np.ndarray]:
        """sigma_t and albedo, float64 (3,) each, `scale` included."""
        preset = parameters.string("preset", "")
        if preset and preset not in PRESETS:
            hint = join_hints(did_you_mean(preset, PRESETS), f"supported: {listed(PRESETS)}")
            parameters.fail(f"unknown preset '{preset[:60]}'", parameters.place("preset"), hint)
        space = thing.state.space
        sigma_a, sigma_s = (
            self.context.colour(parameters, name, 1.0, space) for name in ("sigma_a", "sigma_s")
        )
        if preset:
            sigma_s, sigma_a = (np.array(one) for one in PRESETS[preset])
        sigma_t = sigma_a + sigma_s
        albedo = np.divide(sigma_s, sigma_t, out=np.zeros(3), where=sigma_t > 0)
        return sigma_t * parameters.number("scale", 1.0, 0.0), albedo

    def _scaled(self, thing: Thing, parameters: Parameters) -> dict[str, Any]:
        """`scale` and `albedo` of a medium whose density is a grid."""
        sigma_t, albedo = self._coefficients(thing, parameters)
        return {"scale": self._rgb(sigma_t, thing), "albedo": self._rgb(albedo, thing)}

    def _emitted(self, thing: Thing, parameters: Parameters) -> np.ndarray | None:
        found = parameters.get("Le", "rgb", "spectrum", "blackbody")
        emitted = None if found is None else light_colour(found, thing.state.space, self.context.folders)
        return emitted if emitted is not None and emitted.any() else None

    def _temperature(self, parameters: Parameters) -> tuple[float, float]:
        """What is subtracted from a temperature, and what it is multiplied by then."""
        older = parameters.number("temperaturecutoff", 0.0)
        return parameters.number("temperatureoffset", older), parameters.number("temperaturescale", 1.0)

    def _grid_emission(
        self, thing: Thing, parameters: Parameters, counts: tuple[int, int, int]
    ) -> tuple[np.ndarray | None, np.ndarray | None]:
        """A grid of what is emitted, and its factor; without a grid the factor is all, and None nothing."""
        offset, scaled = self._temperature(parameters)
        kelvin = self._grid(parameters, "temperature", counts, signed=True)
        shares = self._grid(parameters, "Lescale", counts)
        emitted = self._emitted(thing, parameters)
        if kelvin is not None:
            if emitted is not None:
                parameters.fail("both Le and temperature are given", parameters.place("Le"))
            self._say_glowing(thing)
            shown = _glowing(kelvin, offset, scaled)
            return shown if shares is None else shown * shares[..., None], np.full(3, self.context.exposure)
        if emitted is None:
            return None, None
        return shares, emitted * self.context.exposure

    def _say_glowing(self, thing: Thing) -> None:
        self.context.say("what black bodies emit is interpolated, not their temperature", thing.where)

    def _counts(self, parameters: Parameters) -> tuple[int, int, int]:
        nx, ny, nz = (parameters.integer(name, 1, 1) for name in ("nx", "ny", "nz"))
        return nz, ny, nx

    def _grid(
        self,
        parameters: Parameters,
        name: str,
        counts: tuple[int, int, int],
        kind: str = "float",
        signed: bool = False,
    ) -> np.ndarray | None:
        """An array [z, y, x], or [z, y, x, 3] of rgb; None without."""
        found = parameters.get(name, kind)
        if found is None or not len(found.values):
            return None
        depth = 3 if kind == "rgb" else 1
        nz, ny, nx = counts
        if len(found.numbers) != nx * ny * nz * depth:
            what = f"'{name}' has {len(found.numbers) // depth} values for {nx} x {ny} x {nz} samples"
            parameters.fail(what, found.where)
        if not signed and found.numbers.min() < 0:
            parameters.fail(f"'{name}' must be >= 0", found.where)
        return found.numbers.reshape(*counts, depth) if depth > 1 else found.numbers.reshape(counts)

    def _corners(self, parameters: Parameters) -> tuple[np.ndarray, np.ndarray]:
        p0, p1 = parameters.point("p0", (0, 0, 0)), parameters.point("p1", (1, 1, 1))
        if not (np.abs(p1 - p0) > 0).all():
            parameters.fail("the box from p0 to p1 has no volume", parameters.place("p1"))
        return np.minimum(p0, p1), np.maximum(p0, p1)

    def _box(self, thing: Thing, parameters: Parameters) -> np.ndarray:
        """From the unit cube to the medium's box in the world."""
        lower, upper = self._corners(parameters)
        matrix: np.ndarray = thing.state.ctm @ translate(lower) @ scale(upper - lower)
        return matrix

    def _volume(
        self, thing: Thing, values: np.ndarray, matrix: np.ndarray, padded: bool, fill: str = "constant"
    ) -> Node:
        """A grid in the box of `matrix`; `padded`: with a sample more all round, as pbrt fades to 0."""
        if padded:
            counts = np.array(values.shape[2::-1])
            around = [(1, 1)] * 3 + [(0, 0)] * (values.ndim - 3)
            values = np.pad(values, around, "edge") if fill == "edge" else np.pad(values, around)
            matrix = matrix @ translate(-1 / counts) @ scale(1 + 2 / counts)
        data = np.asarray(values, np.float32)
        return self.context.node("volume", "gridvolume", thing.where, data=data, to_world=matrix)


_BUILDERS: dict[str, Callable[[Media, Thing, Parameters], tuple[str, dict[str, Any]]]] = {
    "homogeneous": Media.homogeneous,
    "uniformgrid": Media.uniform,
    "rgbgrid": Media.rgb,
    "cloud": Media.cloud,
    "nanovdb": Media.nanovdb,
}


def _has_border(values: np.ndarray) -> bool:
    """Whether there is anything in the outermost samples."""
    return any(np.take(values, [0, -1], axis).any() for axis in range(3))


def _glowing(values: np.ndarray, offset: float, scaled: float) -> np.ndarray:
    """What is emitted at such temperatures, float32 (..., 3)."""
    kelvin, shown = glow()
    at = (values.astype(np.float64) - offset) * scaled
    return np.stack([np.interp(at, kelvin, one) for one in shown.T], axis=-1).astype(np.float32)
