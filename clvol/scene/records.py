"""What a scene is once it is read: plain frozen records, in double precision, in world space.

The loader makes them, `clvol.planning` inspects them, `clvol.tables` turns them into what the device reads.
Nothing here knows Mitsuba's syntax or OpenCL.  All 4x4 matrices are float64 arrays that map column
vectors from local to world space (``world = M @ local``).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from clvol.scene.fields import ConstVolume as ConstVolume
from clvol.scene.fields import GridVolume as GridVolume
from clvol.scene.fields import Volume as Volume
from clvol.scene.films import Film as Film
from clvol.scene.films import ReconstructionFilter as ReconstructionFilter
from clvol.scene.films import Sampler as Sampler
from clvol.scene.kept import Kept
from clvol.scene.lights import ConstantEmitter as ConstantEmitter
from clvol.scene.lights import DirectionalEmitter as DirectionalEmitter
from clvol.scene.lights import Emitter as Emitter  # noqa: TC001 - others import it from here
from clvol.scene.lights import EnvmapEmitter as EnvmapEmitter
from clvol.scene.lights import PointEmitter as PointEmitter
from clvol.scene.lights import ProjectorEmitter as ProjectorEmitter
from clvol.scene.lights import SpotEmitter as SpotEmitter
from clvol.scene.lights import SunEmitter as SunEmitter
from clvol.scene.materials import Bsdf, Null, Texture

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import ArrayLike

    from clvol.errors import Told
    from clvol.volumes.transfer import Transfer, Transfers

Spectrum = tuple[float, ...]
"""One number (grey) or three (linear sRGB)."""


def as_spectrum(value: float | Iterable[float]) -> Spectrum:
    """A number or one or three numbers as a Spectrum; three equal ones stay three."""
    components = np.asarray(value, dtype=np.float64).reshape(-1)
    if components.size not in (1, 3):
        raise ValueError(f"a spectrum has one or three components, got {components.size}")
    return tuple(components.tolist())


@dataclass(frozen=True, eq=False)
class Perspective:
    """Camera looking along local +z; local +x is the image's left (look_at convention).

    A pinhole, or with an `aperture_radius` a thin lens that is sharp at depth `focus_distance`.

    `fov` in degrees is along `fov_axis`: "x", "y", "diagonal", "smaller" or "larger".
    `principal_point_offset` is relative to the film size, as in Mitsuba.
    `medium`: what the scene says the camera is in; what shapes hold round it is found without.
    """

    to_world: np.ndarray
    fov: float
    fov_axis: str = "x"
    near_clip: float = 1e-2
    far_clip: float = 1e4
    principal_point_offset: tuple[float, float] = (0.0, 0.0)
    aperture_radius: float = 0.0
    focus_distance: float = 1.0
    medium: Medium | None = None


@dataclass(frozen=True, eq=False)
class Orthographic:
    """Camera of parallel rays along local +z; local +x is the image's left.

    Under `to_world` the film is 2 wide about local (0, 0), and as high as its pixels say.  `near_clip` is
    along local z, rays end far_clip - near_clip farther on in the world.
    `medium`: what the scene says the camera is in; what shapes hold round it is found without.
    """

    to_world: np.ndarray
    near_clip: float = 1e-2
    far_clip: float = 1e4
    medium: Medium | None = None

    def at(self, x: ArrayLike, y: ArrayLike, film: Film) -> np.ndarray:
        """Points of the near plane at film positions, in pixels from its corner, float64 (..., 3)."""
        across, down = np.asarray(x) / film.width, np.asarray(y) / film.height
        height = film.height / film.width
        local = [1 - 2 * across, height * (1 - 2 * down), np.full(np.shape(across), self.near_clip)]
        points: np.ndarray = np.stack(local, axis=-1) @ self.to_world[:3, :3].T + self.to_world[:3, 3]
        return points

    @property
    def forward(self) -> np.ndarray:
        """Where all rays go, unit, float64 (3,)."""
        along: np.ndarray = self.to_world[:3, 2] / np.linalg.norm(self.to_world[:3, 2])
        return along


@dataclass(frozen=True, eq=False)
class Meter:
    """Rays along local +z of a rigid `to_world`, whose mean is a picture of one pixel.

    They start at its origin, or if `distant` outside of all there is: on their way to the `target`, which is
    a point (float64 (3,)), any place on a shape, or without one on a section of the scene.
    `medium`: as of the others.
    """

    to_world: np.ndarray
    distant: bool = False
    target: np.ndarray | Shape | None = None
    medium: Medium | None = None


@dataclass(frozen=True, eq=False)
class IrradianceMeter:
    """Pi times the mean of rays from all over a `shape`, by their cosine with its normals: its irradiance.

    `medium`: as of the others.
    """

    shape: Shape
    medium: Medium | None = None

    @property
    def to_world(self) -> np.ndarray:
        """That of the shape."""
        return self.shape.to_world


def measured_shape(camera: Camera) -> Shape | None:
    """The shape from all over which a meter draws points, where it has one that is no rectangle or disk."""
    if isinstance(camera, IrradianceMeter):
        return camera.shape
    target = camera.target if isinstance(camera, Meter) else None
    return target if isinstance(target, Shape) and target.kind not in ("rectangle", "disk") else None


Camera = Perspective | Orthographic | Meter | IrradianceMeter


@dataclass(frozen=True, eq=False)
class Batch:
    """Several cameras whose pictures stand side by side on one film, each on as many columns of it.

    Each is rendered as a picture of its own (`clvol.scene.views.parts_of`).  `names`: ids, for parameters.
    """

    parts: tuple[Camera, ...]
    names: tuple[str, ...]

    @property
    def medium(self) -> Medium | None:
        """One that a camera names, if any does."""
        return next((part.medium for part in self.parts if part.medium is not None), None)


@dataclass(frozen=True, eq=False)
class SpectrumColor:
    """Linear sRGB of a spectrum, float64 (1,) or (3,): of a light, and of anything else."""

    light: np.ndarray
    surface: np.ndarray


@dataclass(frozen=True)
class PhaseTable:
    """Values of a phase function, up to a factor, between which it is linear in the cosine.

    values : of the cosines -1 (back) to 1 (straight on) in even steps, or of `angles`.
    angles : increasing, in degrees, from 0 (straight on) to 180; empty: even steps of the cosine.
    """

    values: tuple[float, ...]
    angles: tuple[float, ...] = ()


@dataclass(frozen=True)
class Phase:
    """Phase function: "isotropic", "rayleigh", "hg" (Henyey–Greenstein of g), "tabphase" or "sggx"."""

    kind: str = "isotropic"
    g: float = 0.0
    table: PhaseTable | None = None  # of a tabphase
    flakes: tuple[float, ...] | GridVolume | None = None  # of an sggx: xx, yy, zz, xy, xz, yz of its matrix S


@dataclass(frozen=True)
class BlendPhase:
    """Mixture of two phase functions; `weight` in [0, 1], or a volume cut to that, is the second's share."""

    weight: float | GridVolume
    first: PhaseFunction
    second: PhaseFunction


PhaseFunction = Phase | BlendPhase


def _varied_weight(phase: PhaseFunction) -> GridVolume | None:
    if not isinstance(phase, BlendPhase):
        return None
    if isinstance(phase.weight, GridVolume):
        return phase.weight
    return _varied_weight(phase.first) or _varied_weight(phase.second)


def _varied_flakes(phase: PhaseFunction) -> GridVolume | None:
    if isinstance(phase, BlendPhase):
        return _varied_flakes(phase.first) or _varied_flakes(phase.second)
    return phase.flakes if isinstance(phase.flakes, GridVolume) else None


@dataclass(frozen=True, eq=False)
class Medium:
    """Participating medium: sigma_t(x) = scale · sigma_t volume, sigma_s = albedo · sigma_t.

    A `homogeneous` medium fills its shape; a heterogeneous one is clipped to the box of its
    sigma_t volume as well.  `scale` and the scales of emission may be given as one number.

    It emits sigma_a · L_e per length, where L_e = emission_scale · emission · blackbody(kelvin), without the
    factor that is None (both: no emission at all), and kelvin = (temperature − temperature_offset) ·
    temperature_scale.  `transfers` say what is made of the volumes' values, after interpolation, before all
    that.  The blackbody is `clvol.tables.blackbody.blackbody_rgb`: of luminance 1, and 0 where
    kelvin <= 0.  Beside that it emits emission_density_scale · emission_density per length, W/(m³ sr),
    whatever its extinction.
    """

    sigma_t: Volume
    albedo: Volume
    scale: Spectrum = (1.0,)
    phase: PhaseFunction = Phase()
    homogeneous: bool = True
    sample_emitters: bool = True
    emission: Volume | None = None
    temperature: Volume | None = None  # one channel
    emission_scale: Spectrum = (1.0,)
    temperature_scale: float = 1.0
    temperature_offset: float = 0.0
    emission_density: Volume | None = None
    emission_density_scale: Spectrum = (1.0,)
    transfers: Transfers | None = None
    name: str = ""

    def __post_init__(self) -> None:
        for name in ("scale", "emission_scale", "emission_density_scale"):
            object.__setattr__(self, name, as_spectrum(getattr(self, name)))

    @property
    def phase_weight(self) -> GridVolume | None:
        """The volume by which its phase functions are mixed, where one is."""
        return _varied_weight(self.phase)

    @property
    def flakes(self) -> GridVolume | None:
        """The volume of the matrices S of its sggx, where they differ from place to place."""
        return _varied_flakes(self.phase)

    @property
    def emits(self) -> bool:
        """Whether its L_e is anything but 0 everywhere, as far as can be told without reading grids."""
        if not any(self.emission_scale) or (self.emission is None and self.temperature is None):
            return False
        if isinstance(self.emission, ConstVolume) and not any(self.emission.value):
            return False
        if isinstance(self.temperature, ConstVolume):
            return (self.temperature.value[0] - self.temperature_offset) * self.temperature_scale > 0
        return True

    @property
    def glows(self) -> bool:
        """Whether its emission_density is anything but 0 everywhere, as far as can be told."""
        density = self.emission_density
        dark = density is None or (isinstance(density, ConstVolume) and not any(density.value))
        return not dark and any(self.emission_density_scale)

    def transfer(self, role: str) -> Transfer | None:
        """What is made of the values of the volume that is "sigma_t", "albedo" or "emission", if anything."""
        return None if self.transfers is None else getattr(self.transfers, role, None)


NO_SURFACE = Null()


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles in the shape's local space.

    vertices : float32 (n, 3).  faces : int32 (m, 3), counter-clockwise seen from outside.
    normals : float32 (n, 3), unit, of smooth shading; None: the faces' own.  uvs : float32 (n, 2), or None.
    attributes : float32 (n or m, 1 or 3) of vertices or faces, by name; shapes have pictures of them instead.
    """

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray | None = None
    uvs: np.ndarray | None = None
    source: str = ""
    attributes: Mapping[str, np.ndarray] = field(default_factory=dict, repr=False)

    def __repr__(self) -> str:
        return f"<Mesh {self.source}: {len(self.vertices)} vertices, {len(self.faces)} triangles>"


@dataclass(frozen=True, eq=False)
class Shape:
    """A surface: what it looks like, what it emits, and which media it divides.

    kind : under `to_world` the "cube" (−1..1)³, the unit "sphere", the "rectangle" (−1..1)² with normal
        +z, the unit "disk" with normal +z, the "cylinder" of radius 1 and z in 0..1 (open, normals outward),
        or the "mesh" in `mesh`.
    interior, exterior : media behind the surface and before it (the side its normals point to).
    emission : radiance of the front side, the same all over or a texture; None where the shape is no light.
    flip_normals : front and back change places.
    meter : what it is measured by; the scene has it among its sensors.
    """

    kind: str
    to_world: np.ndarray
    interior: Medium | None = None
    exterior: Medium | None = None
    bsdf: Bsdf = NO_SURFACE
    emission: Texture | None = None
    flip_normals: bool = False
    mesh: Mesh | None = None
    name: str = ""
    meter: ShapeMeter | None = None


@dataclass(frozen=True)
class Integrator:
    """Path length limits, and the estimator choices a scene may carry (names to strings)."""

    max_depth: int = -1  # −1: no limit; 1: directly visible emitters only (Mitsuba's count)
    rr_depth: int = 5
    hide_emitters: bool = False
    choices: dict[str, str] = field(default_factory=dict)
    aovs: tuple[str, ...] = ()  # pictures that are made beside the image, whoever asks
    shows_depth: bool = False  # the image is the distance to what rays first meet (`depth_picture`)


@dataclass(frozen=True, eq=False)
class Sensor:
    """A camera, or several side by side, with its film and sampler."""

    camera: Camera | Batch
    film: Film
    sampler: Sampler
    name: str = ""


@dataclass(frozen=True, eq=False)
class ShapeMeter:
    """An `irradiancemeter` that is in a shape, with its film and sampler."""

    film: Film
    sampler: Sampler
    medium: Medium | None = None
    name: str = ""

    def on(self, shape: Shape) -> Sensor:
        """The sensor that measures the shape's irradiance."""
        return Sensor(IrradianceMeter(shape, self.medium), self.film, self.sampler, self.name)


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything a render needs.  Made by `clvol.load_file` or `clvol.load_dict`.

    `sensor`, `film`, `spp` and `seed` are those of the view that is rendered, at first the first one's;
    `sensors` are all that the scene has, in its order (`clvol.scene.views.seen_by` takes another).
    """

    sensor: Camera | Batch
    film: Film
    integrator: Integrator
    shapes: tuple[Shape, ...] = ()
    emitters: tuple[Emitter, ...] = ()
    spp: int = 4
    seed: int = 0
    source: str = ""  # file the scene came from, for messages and metadata
    files: tuple[str, ...] = field(default=(), repr=False)  # all it was read from: nothing replaces them
    sensors: tuple[Sensor, ...] = ()
    approximated: tuple[Told, ...] = field(default=(), repr=False)  # what is taken as what
    left_out: tuple[Told, ...] = field(default=(), repr=False)  # what was not supported: places and reasons
    kept: Kept = field(default_factory=Kept, repr=False)

    def __post_init__(self) -> None:
        if not self.sensors:
            only = Sensor(self.sensor, self.film, Sampler(self.spp, self.seed))
            object.__setattr__(self, "sensors", (only,))

    @property
    def camera(self) -> Camera:
        """The sensor, of a scene that is seen by one: `Plan.of` refuses others."""
        assert not isinstance(self.sensor, Batch)
        return self.sensor

    def __repr__(self) -> str:
        picture = f"{self.film.width} x {self.film.height}, {self.spp} spp"
        content = f"{len(self.shapes)} shapes, {len(self.emitters)} lights"
        return f"<Scene {self.source or 'from a dict'}: {picture}, {content}>"
