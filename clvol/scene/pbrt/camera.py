"""Camera, film, filter, sampler and integrator: what a picture is taken with."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.scene.pbrt.statements import State, Thing
from clvol.scene.sensor import MAX_SIDE
from clvol.scene.transforms import keeps_angles, scale
from clvol.scene.vocabulary import listed

if TYPE_CHECKING:
    from clvol.scene.nodes import Node
    from clvol.scene.pbrt.context import Context
    from clvol.scene.pbrt.media import Media
    from clvol.scene.pbrt.parameters import Parameters

_WITH_MEDIA = ("volpath", "simplevolpath", "bdpt", "mlt", "lightpath")
_WITHOUT = ("path", "simplepath", "sppm")
_SAMPLERS = ("independent", "stratified", "halton", "sobol", "paddedsobol", "zsobol", "pmj02bn")
_NEAR, _FAR = 1e-4, 1e8
"""Pictures have no near and far plane in pbrt."""


class Pictures:
    """How the picture of a scene is taken."""

    def __init__(self, context: Context) -> None:
        self.context = context

    def _thing(self, what: str, type: str) -> tuple[Thing, Parameters]:
        """The statement of that kind, or pbrt's default."""
        where = self.context.root.where
        thing = self.context.read.options.get(what) or Thing(what, type, [], where, State())
        return thing, thing.parameters()

    # -- integrator ----------------------------------------------------------------------------------

    def integrator(self) -> tuple[Node, bool]:
        """The integrator, and whether it sees media.

        pbrt counts scatterings, and Mitsuba the segments of a path: one more.
        """
        thing, parameters = self._thing("Integrator", "volpath")
        if thing.type not in (*_WITH_MEDIA, *_WITHOUT):
            parameters.refuse(
                f"the integrator '{thing.type[:60]}'",
                hint=f"supported: {listed((*_WITH_MEDIA, *_WITHOUT))}",
            )
        if thing.type not in ("volpath", "path", "simplevolpath", "simplepath"):
            self.context.say(f"integrator '{thing.type}' is taken as a path tracer", thing.where)
        depth = parameters.integer("maxdepth", 5, 0, 2**31 - 2)
        if parameters.boolean("regularize", False):
            parameters.refuse("'regularize'", parameters.place("regularize"), "leave it out")
        parameters.ignore("lightsampler", "samplelights", "samplebsdf", "rrthreshold", "regularization")
        if thing.type in ("bdpt", "mlt", "sppm", "lightpath"):
            parameters.ignore("visualizestrategies", "visualizeweights", "bootstrapsamples", "chains")
            parameters.ignore("mutationsperpixel", "largestepprobability", "sigma", "photonsperiteration")
            parameters.ignore("radius", "seed")
        parameters.finish()
        made = self.context.node("integrator", "volpath", thing.where, max_depth=depth + 1)
        return made, thing.type in _WITH_MEDIA

    # -- sensor --------------------------------------------------------------------------------------

    def sensor(self, media: Media, sees_media: bool) -> Node:
        """The camera with its film and sampler."""
        film, size = self._film()
        made = self._camera(size)
        made.add_nameless(film)
        made.add_nameless(self._sampler())
        outside = self._thing("Camera", "perspective")[0].state.outside
        if outside and sees_media:
            made.add_nameless(media.reference(outside, made.where))
        return made

    def _camera(self, size: tuple[int, int]) -> Node:
        thing, parameters = self._thing("Camera", "perspective")
        if thing.type not in ("perspective", "orthographic"):
            hint = "supported: perspective, orthographic"
            parameters.refuse(f"the camera '{thing.type[:60]}'", hint=hint)
        parameters.ignore("shutteropen", "shutterclose")  # see _sensor_response
        if np.linalg.cond(thing.state.ctm[:3, :3]) > 1e9:
            parameters.fail("the camera's transform flattens space")
        from_camera = np.linalg.inv(thing.state.ctm)
        if not keeps_angles(from_camera):
            parameters.fail("the camera's transform stretches or shears", hint="scale all axes alike")
        unit = float(np.cbrt(abs(np.linalg.det(from_camera[:3, :3]))))
        # pbrt's x goes to the picture's right, Mitsuba's to its left
        to_world = from_camera @ scale([-1 / unit, 1 / unit, 1 / unit])
        low, high = self._window(parameters, size)
        lens = parameters.number("lensradius", 0.0, 0.0) * unit
        focus = parameters.number("focaldistance", 1e6, 0.0) * unit
        values = {"near_clip": _NEAR, "far_clip": _FAR}
        middle = {
            f"principal_point_offset_{axis}": offset for axis, offset in _middle(low, high).items() if offset
        }
        if thing.type == "orthographic":
            parameters.finish()
            if lens or middle:
                parameters.refuse("an orthographic camera with a lens, or off the middle,")
            half = (high[0] - low[0]) / 2 * unit
            sized = to_world @ scale([half, half, 1])
            return self.context.node("sensor", "orthographic", thing.where, to_world=sized, **values)
        fov = parameters.number("fov", 90.0, 0.0, 180.0)
        if not 0 < fov < 180:
            parameters.fail("fov must lie between 0 and 180", parameters.place("fov"))
        parameters.finish()
        tangent = np.tan(np.deg2rad(fov) / 2) * (high[0] - low[0]) / 2
        values["fov"] = float(2 * np.rad2deg(np.arctan(tangent)))
        if lens:
            if middle:
                parameters.refuse("a lens with a screenwindow off the middle")
            values |= {"aperture_radius": lens, "focus_distance": focus}
        kind = "thinlens" if lens else "perspective"
        return self.context.node(
            "sensor", kind, thing.where, to_world=to_world, fov_axis="x", **values, **middle
        )

    def _window(self, parameters: Parameters, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper corner of the picture on the plane at depth 1, -1 to 1 along its shorter side."""
        aspect = parameters.number("frameaspectratio", size[0] / size[1])
        if aspect <= 0:
            parameters.fail("frameaspectratio must be > 0", parameters.place("frameaspectratio"))
        high = np.array([aspect, 1.0] if aspect > 1 else [1.0, 1 / aspect])
        low = -high
        window = parameters.floats("screenwindow")
        if window is not None:
            if len(window) != 4 or not (window[[1, 3]] > window[[0, 2]]).all():
                parameters.fail(
                    "screenwindow takes x0 x1 y0 y1, increasing", parameters.place("screenwindow")
                )
            low, high = window[[0, 2]], window[[1, 3]]
        across, up = high - low
        if not np.isclose(across / up, size[0] / size[1], rtol=1e-3):
            parameters.refuse("pixels that are not square", hint="leave frameaspectratio out")
        return low, high

    def _sampler(self) -> Node:
        thing, parameters = self._thing("Sampler", "zsobol")
        if thing.type not in _SAMPLERS:
            parameters.fail(f"unknown sampler '{thing.type[:60]}'", hint=f"supported: {listed(_SAMPLERS)}")
        count = parameters.integer("pixelsamples", 16, 1)
        if thing.type == "stratified":
            count = parameters.integer("xsamples", 4, 1) * parameters.integer("ysamples", 4, 1)
        parameters.ignore("randomization", "jitter")
        seed = parameters.integer("seed", self.context.read.seed, 0)
        parameters.finish()
        if thing.type != "independent" and "Sampler" in self.context.read.options:
            self.context.say(
                f"sampler '{thing.type}' is taken as clvol's own, of the same count", thing.where
            )
        count = min(count, 2**31 - 1)
        return self.context.node("sampler", "independent", thing.where, sample_count=count, seed=seed)

    # -- film ----------------------------------------------------------------------------------------

    def _film(self) -> tuple[Node, tuple[int, int]]:
        """The film, and its size; `exposure` of the context becomes what it multiplies pictures by."""
        thing, parameters = self._thing("Film", "rgb")
        if thing.type not in ("rgb", "gbuffer"):
            parameters.refuse(f"the film '{thing.type[:60]}'", hint="supported: rgb")
        width = parameters.integer("xresolution", 1280, 1, MAX_SIDE)
        height = parameters.integer("yresolution", 720, 1, MAX_SIDE)
        parameters.ignore("filename", "diagonal", "savefp16", "coordinatesystem")
        self._sensor_response(thing, parameters)
        if parameters.get("maxcomponentvalue") is not None:
            where = parameters.place("maxcomponentvalue")
            self.context.say("'maxcomponentvalue' is left out: samples are not clamped", where)
        if thing.state.space != "srgb":
            self.context.say("the picture is in linear sRGB, whatever the film's colour space", thing.where)
        crop = self._crop(parameters, width, height)
        parameters.finish()
        values = dict(
            zip(("crop_offset_x", "crop_offset_y", "crop_width", "crop_height"), crop or (), strict=False)
        )
        film = self.context.node("film", "hdrfilm", thing.where, width=width, height=height, **values)
        film.add_nameless(self._filter())
        return film, (width, height)

    def _sensor_response(self, thing: Thing, parameters: Parameters) -> None:
        """`iso` and the time of exposure multiply the picture; all sensors are the standard observer.

        That time is the camera's; films of early versions have it themselves.
        """
        sensor = parameters.string("sensor", "cie1931")
        if sensor != "cie1931":
            self.context.say(
                f"the film's sensor '{sensor[:60]}' is taken as cie1931", parameters.place("sensor")
            )
        if parameters.number("whitebalance", 0.0):
            self.context.say("'whitebalance' of the film is left out", parameters.place("whitebalance"))
        camera = self._thing("Camera", "perspective")[1]
        opened, closed = camera.number("shutteropen", 0.0), camera.number("shutterclose", 1.0)
        if opened >= closed:
            camera.fail("the shutter does not open", camera.place("shutterclose"))
        time = parameters.number("exposuretime", closed - opened, 0.0)
        self.context.exposure = time * parameters.number("iso", 100.0, 0.0) / 100

    def _crop(self, parameters: Parameters, width: int, height: int) -> tuple[int, int, int, int] | None:
        window, bounds = parameters.floats("cropwindow"), parameters.integers("pixelbounds")
        if window is not None:
            if len(window) != 4:
                parameters.fail("cropwindow takes x0 x1 y0 y1", parameters.place("cropwindow"))
            size = np.array([width, width, height, height])
            bounds = np.ceil(np.clip(window, 0, 1) * size - 1e-6).astype(np.int64)
        if bounds is None:
            return None
        if len(bounds) != 4:
            parameters.fail("pixelbounds takes x0 x1 y0 y1", parameters.place("pixelbounds"))
        x0, x1 = (int(np.clip(one, 0, width)) for one in bounds[:2])
        y0, y1 = (int(np.clip(one, 0, height)) for one in bounds[2:])
        if x1 <= x0 or y1 <= y0:
            parameters.fail("nothing is left of the picture")
        return x0, y0, x1 - x0, y1 - y0

    def _filter(self) -> Node:
        thing, parameters = self._thing("PixelFilter", "gaussian")
        default = {"box": 0.5, "triangle": 2.0, "gaussian": 1.5, "mitchell": 2.0, "sinc": 4.0}
        if thing.type not in default:
            parameters.fail(f"unknown filter '{thing.type[:60]}'", hint=f"supported: {listed(default)}")
        radius = parameters.number("xradius", default[thing.type], 1e-3, 16.0)
        if parameters.number("yradius", default[thing.type], 1e-3, 16.0) != radius:
            parameters.refuse("a filter of two radii", parameters.place("yradius"))
        make, exact = self.context.node, True
        if thing.type == "box":
            made, exact = make("rfilter", "box", thing.where), radius == 0.5
        elif thing.type == "triangle":
            made = make("rfilter", "tent", thing.where, radius=radius)
        elif thing.type == "mitchell":
            b, c = (parameters.number(name, 1 / 3, 0.0, 1.0) for name in "BC")
            made, exact = make("rfilter", "mitchell", thing.where, B=b, C=c), radius == 2
        elif thing.type == "gaussian":
            sigma = parameters.number("sigma", 0.5, 1e-3, 4.0)
            made, exact = make("rfilter", "gaussian", thing.where, stddev=sigma), False
        else:
            parameters.ignore("tau")
            made, exact = make("rfilter", "lanczos", thing.where, lobes=3), False
        parameters.finish()
        if not exact:
            self.context.say(f"filter '{thing.type}' is taken as Mitsuba's, of its own radius", thing.where)
        return made


def _middle(low: np.ndarray, high: np.ndarray) -> dict[str, float]:
    """How far the picture's middle is to the right of the camera's axis and below it, as a share of it."""
    x, y = low + high
    across, up = high - low
    return {"x": float(x / (2 * across)), "y": float(-y / (2 * up))}
