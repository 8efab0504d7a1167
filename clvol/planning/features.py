"""What a scene uses, as far as it decides which code, buffers and stages are needed."""

from __future__ import annotations

from dataclasses import asdict, dataclass

SAMPLED_LIGHTS = {
    "envmap": "an envmap",
    "directional": "directional",
    "point_lights": "points",
    "spot": "spots",
    "projector": "projectors",
    "sun": "a sun",
    "area": "area lights",
}
"""Lights that are worth shadow rays, as all are but a uniform sky; in words."""


@dataclass(frozen=True)
class Features:
    """What a scene contains, as far as it decides which code, buffers and stages are needed."""

    media: int = 0
    volumes: int = 0
    homogeneous: bool = False
    heterogeneous: bool = False
    clipped: bool = False
    thin: bool = False
    media_overlap: bool = False
    chromatic_extinction: bool = False
    coloured_extinction: bool = False
    chromatic_albedo: bool = False
    chromatic_light: bool = False
    chromatic_emission: bool = False
    albedo_volumes: bool = False
    emission: bool = False
    emission_volumes: bool = False
    glow: bool = False
    glow_volumes: bool = False
    temperature: bool = False
    transfers: bool = False
    interpolated_transfers: bool = False
    only_dark_emitters: bool = False
    trilinear: bool = False
    nearest: bool = False
    coloured_volumes: bool = False
    cubes: bool = False
    spheres: bool = False
    phases: tuple[str, ...] = ()
    blend: bool = False
    varied_phases: bool = False
    varied_flakes: bool = False
    varied_areas: bool = False
    scattering: bool = False
    emitters: int = 0
    constant: bool = False
    envmap: bool = False
    directional: bool = False
    point_lights: bool = False
    spot: bool = False
    spot_textures: bool = False
    projector: bool = False
    sun: bool = False
    area_meshes: bool = False
    area_spheres: bool = False
    area_disks: bool = False
    area_cylinders: bool = False
    area_textures: bool = False
    samples_lights: bool = False
    surfaces: int = 0
    triangles: bool = False
    quadrics: bool = False
    shading_normals: bool = False
    vertex_uvs: bool = False
    bsdfs: tuple[str, ...] = ()
    chromatic_surfaces: bool = False
    textures: bool = False
    bitmaps: bool = False
    volume_textures: bool = False
    material_tables: bool = False
    rough_textures: bool = False
    metal_textures: bool = False
    bumps: bool = False
    reflecting: bool = False
    samples_at_surfaces: bool = False
    passable: bool = False
    transmissive: bool = False
    boundaries: int = 0
    camera_inside: bool = False
    filter_table: bool = False
    signed_filter: bool = False
    lens: bool = False
    parallel_rays: bool = False
    meter: bool = False
    depth_limited: bool = False
    shows_depth: bool = False
    hide_emitters: bool = False
    hide_environment: bool = False
    backdrop: bool = False
    alpha: bool = False

    @property
    def area(self) -> bool:
        """Surfaces that are lights."""
        return self.area_meshes or self.area_spheres or self.area_disks or self.area_cylinders

    @property
    def sky_apart(self) -> bool:
        """A uniform sky among other lights, which next-event estimation leaves to scattering.

        That finds it as well without a shadow ray, and the other lights get all of these.
        """
        return self.constant and self.emitters > 1

    @property
    def sampled_emitters(self) -> int:
        """Lights that next-event estimation chooses among."""
        return self.emitters - self.sky_apart

    @property
    def samples_sky(self) -> bool:
        """The environment is one of them."""
        return self.envmap or (self.constant and not self.sky_apart)

    @property
    def sampled_lights(self) -> list[str]:
        """Kinds of light that are worth shadow rays, in words."""
        found = [words for name, words in SAMPLED_LIGHTS.items() if getattr(self, name)]
        if not found and self.emitters > self.constant:
            raise ValueError("a scene has lights that no entry of SAMPLED_LIGHTS stands for")
        return found

    @property
    def peaked(self) -> bool:
        """Some phase function has a peak, and some light is found by next-event estimation alone.

        All have to have a convolution in closed form (cl/phase/convolution.h), which tables and flakes
        lack, and the same everywhere.
        """
        closed = "HG" in self.phases and not {"TABPHASE", "SGGX"} & {*self.phases} and not self.varied_phases
        return closed and (self.directional or self.lit_by_points)

    @property
    def lit_by_points(self) -> bool:
        """Lights that are points, which no path meets."""
        return self.point_lights or self.spot or self.projector

    @property
    def near_lights(self) -> bool:
        """Lights at a finite distance."""
        return self.lit_by_points or self.area

    @property
    def segments(self) -> bool:
        """A ray is walked segment by segment, from surface to surface or through several media."""
        return self.media > 1 or (self.media > 0 and self.surfaces > 0)

    @property
    def boundary_words(self) -> int:
        """32-bit words that hold a path's bits of the boundaries it is inside of."""
        return -(-self.boundaries // 32)

    def found(self) -> str:
        """One line that names what is there, for the log."""
        return "; ".join(_said(name, value) for name, value in asdict(self).items() if value)


def _said(name: str, value: object) -> str:
    words = " ".join(value).lower() if isinstance(value, tuple) else str(value)
    name = name.replace("_", " ")
    return name if value is True else f"{name}: {words}"
