"""What is compiled: a scene's features together with the user's choices.

A plain value; everything that decides which code is built is here and in `features`, and nowhere else.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from clvol import layout
from clvol.planning import registry
from clvol.planning.features import Features


@dataclass(frozen=True)
class KernelConfig:
    """Everything that decides which kernels are composed: features plus the user's choices."""

    features: Features
    technique: str = "delta"
    transmittance: str = "ratio"
    majorant: str = "grid"  # "none" where no medium needs one
    lookup: str = "exact"
    absorption: str = "sample"
    probability: str = "history"
    control: str = "mean"
    sampler: str = "independent"
    aov: tuple[str, ...] = ()
    far_apart: bool = False  # channels' extinctions differ too much for one path (clvol.tables.apart)
    top_trees: bool = False  # some volume's top grid is a tree
    tree_grid: bool = False  # the majorant is a grid whose cells are found through a tree
    pixel_list: bool = False  # runs are over listed pixels, each at a sample of its own
    local_size: int = 1
    group_slots: int = 256

    @property
    def tracker(self) -> registry.Choice:
        """The technique's entry in the registry."""
        return registry.TECHNIQUES[self.technique]

    @property
    def channels(self) -> int:
        """Channels of the image: 1 when every coefficient and light is grey, else 3."""
        f = self.features
        media = f.chromatic_extinction or f.chromatic_albedo or f.chromatic_emission
        return 3 if media or f.chromatic_light or f.chromatic_surfaces else 1

    @property
    def one_channel_per_path(self) -> bool:
        """A path follows one channel where channels are attenuated or absorbed differently and the technique
        cannot follow them together (METHODS §3, delta); a sample is then a path for each channel, which
        spares the noise of choosing one.  Homogeneous media can be followed together, but for channels that
        are too far apart."""
        f = self.features
        if self.far_apart and not self.tracker.all_channels:
            return True
        if f.heterogeneous and not self.tracker.all_channels:
            return f.chromatic_extinction or (f.chromatic_albedo and self.absorption == "sample")
        return False

    @property
    def spectrum(self) -> int:
        """Floats that a path's weight holds."""
        return 1 if self.one_channel_per_path else self.channels

    @property
    def extinction(self) -> int:
        """Floats of a coefficient or transmittance: 3 where a path's channels are attenuated differently."""
        return 3 if self.features.chromatic_extinction and not self.one_channel_per_path else 1

    @property
    def weighted(self) -> bool:
        """Walks change the path's weight."""
        return self.extinction == 3 or (self.features.heterogeneous and self.tracker.weighted)

    @property
    def walks_majorants(self) -> bool:
        """Some stage walks majorant cells."""
        shadows = self.nee and registry.TRANSMITTANCES[self.transmittance].walks_majorant
        return self.majorant != "none" and (self.tracker.walks_majorant or shadows)

    @property
    def jobs_per_sample(self) -> int:
        """Paths of one sample: one for each channel, where a path follows one."""
        return self.channels if self.one_channel_per_path else 1

    @property
    def needs_controls(self) -> bool:
        """The technique walks a control of each majorant cell."""
        return self.majorant != "none" and self.tracker.control != "none"

    @property
    def needs_residuals(self) -> bool:
        """Transmittance is estimated over a control of each majorant cell."""
        return self.majorant != "none" and self.nee and self.transmittance == "residual-ratio"

    @property
    def nee(self) -> bool:
        """Next-event estimation: there are lights to sample, and media or surfaces that scatter to them."""
        f = self.features
        return self.transmittance != "none" and f.samples_lights and (f.scattering or f.samples_at_surfaces)

    @property
    def mis(self) -> bool:
        """Both ways of finding a light are in use, so that they must be weighted."""
        f = self.features
        return self.nee and (f.constant or f.envmap or f.area)

    @property
    def randomizations(self) -> int:
        """Independent randomisations that the samples are dealt to; 0 where every sample is independent."""
        return layout.RANDOMIZATIONS if self.sampler == "sobol" else 0

    @property
    def first_hit(self) -> tuple[str, ...]:
        """Pictures of what camera paths first meet that `aov` asks for."""
        return tuple(name for name in registry.FIRST_HIT if name in self.aov)

    @property
    def shown(self) -> frozenset[str]:
        """Pictures whose numbers are kept: those of `aov`, look-ups, and what others are made from."""
        of = {"null": ("tentative", "real"), "efficiency": ("cells",)}
        return frozenset(("lookups", *self.aov, *(n for name in self.aov for n in of.get(name, ()))))

    @property
    def stages(self) -> tuple[str, ...]:
        """Kernels of one wave, in launch order."""
        return layout.launched(self.macros)

    @cached_property
    def macros(self) -> Mapping[str, int]:
        """``CLVOL_*`` macros: what is compiled, and what a path's state and the kernels' arguments hold."""
        f = self.features
        return {
            "CLVOL_LOCAL_SIZE": self.local_size,
            "CLVOL_GROUP_SLOTS": self.group_slots,
            "CLVOL_CHANNELS": self.channels,
            "CLVOL_SPECTRUM": self.spectrum,
            "CLVOL_EXTINCTION": self.extinction,
            "CLVOL_WEIGHTED": int(self.weighted),
            "CLVOL_JOBS_PER_SAMPLE": self.jobs_per_sample,
            "CLVOL_ONE_CHANNEL_PER_PATH": int(self.one_channel_per_path),
            "CLVOL_HAS_MEDIA": int(f.media > 0),
            "CLVOL_HAS_MANY_MEDIA": int(f.media > 1),
            "CLVOL_HAS_STRETCHES": int(f.stretches),
            "CLVOL_HAS_OVERLAP": int(f.media_overlap),
            "CLVOL_HAS_HOMOGENEOUS": int(f.homogeneous),
            "CLVOL_HAS_HETEROGENEOUS": int(f.heterogeneous),
            "CLVOL_HAS_CLIPPED": int(f.clipped),
            "CLVOL_HAS_THIN": int(f.thin),
            "CLVOL_HAS_CUBE": int(f.cubes),
            "CLVOL_HAS_SPHERE": int(f.spheres),
            "CLVOL_HAS_VOLUMES": int(f.volumes > 0),
            "CLVOL_HAS_TRILINEAR": int(f.trilinear),
            "CLVOL_HAS_NEAREST": int(f.nearest),
            "CLVOL_HAS_TOP_TREES": int(self.top_trees),
            "CLVOL_HAS_COLOURED_VOLUME": int(f.coloured_volumes),
            "CLVOL_HAS_ALBEDO_VOLUME": int(f.albedo_volumes),
            "CLVOL_DENSITY_CHANNELS": 3 if f.coloured_extinction else 1,
            "CLVOL_EMISSION_ON_WALKS": int(f.emission and not f.media_overlap),
            "CLVOL_EMISSION_AT_COLLISIONS": int(f.emission and f.media_overlap),
            "CLVOL_HAS_EMISSION_VOLUME": int(f.emission_volumes),
            "CLVOL_HAS_TEMPERATURE": int(f.temperature),
            **{f"CLVOL_PHASE_{name}": int(name in f.phases) for name in layout.ENUMS["PHASE"]},
            "CLVOL_HAS_BLEND": int(f.blend),
            "CLVOL_HAS_SCATTERING": int(f.scattering),
            "CLVOL_HAS_EMITTERS": int(f.emitters > 0),
            "CLVOL_HAS_NEAR_LIGHTS": int(f.near_lights),
            "CLVOL_HAS_CONSTANT": int(f.constant),
            "CLVOL_HAS_ENVMAP": int(f.envmap),
            "CLVOL_HAS_DIRECTIONAL": int(f.directional),
            "CLVOL_HAS_POINT": int(f.point_lights),
            "CLVOL_HAS_SPOT": int(f.spot),
            "CLVOL_HAS_AREA": int(f.area),
            "CLVOL_HAS_AREA_MESH": int(f.area_meshes),
            "CLVOL_HAS_AREA_SPHERE": int(f.area_spheres),
            "CLVOL_HAS_AREA_DISK": int(f.area_disks),
            "CLVOL_HAS_SURFACES": int(f.surfaces > 0),
            "CLVOL_HAS_TRIANGLES": int(f.triangles),
            "CLVOL_HAS_QUADRICS": int(f.quadrics),
            "CLVOL_HAS_SHADING_NORMALS": int(f.shading_normals),
            "CLVOL_HAS_VERTEX_UVS": int(f.vertex_uvs),
            "CLVOL_HAS_TEXTURES": int(f.textures),
            "CLVOL_HAS_BITMAPS": int(f.bitmaps),
            "CLVOL_HAS_MATERIAL_TABLES": int(f.material_tables),
            "CLVOL_HAS_REFLECTION": int(f.reflecting),
            "CLVOL_HAS_PASSABLE": int(f.passable),
            "CLVOL_HAS_TRANSMISSION": int(f.transmissive),
            "CLVOL_BOUNDARY_WORDS": f.boundary_words,
            "CLVOL_CAMERA_INSIDE": int(f.camera_inside),
            "CLVOL_BVH_STACK": layout.BVH_STACK,
            **{f"CLVOL_BSDF_{name}": int(name in f.bsdfs) for name in layout.BSDFS},
            "CLVOL_HAS_FILTER_TABLE": int(f.filter_table),
            "CLVOL_HAS_SIGNED_FILTER": int(f.signed_filter),
            "CLVOL_HAS_LENS": int(f.lens),
            "CLVOL_HAS_LONG_WALKS": int(f.heterogeneous or f.passable),
            "CLVOL_WALKS_GRID": int(self.walks_majorants and self.majorant == "grid"),
            "CLVOL_WALKS_TREE_GRID": int(self.walks_majorants and self.tree_grid),
            "CLVOL_WALKS_KDTREE": int(self.walks_majorants and self.majorant == "kdtree"),
            "CLVOL_HAS_CONTROLS": int(self.needs_controls),
            "CLVOL_HAS_RESIDUALS": int(self.needs_residuals),
            "CLVOL_HAS_MAX_DEPTH": int(f.depth_limited),
            "CLVOL_HIDE_EMITTERS": int(f.hide_emitters),
            "CLVOL_FIRST_HIT": int(bool(self.first_hit)),
            **{f"CLVOL_SHOWS_{name.upper()}": int(name in self.shown) for name in registry.AOVS},
            "CLVOL_RANDOMIZATIONS": self.randomizations,
            "CLVOL_PIXEL_LIST": int(self.pixel_list),
            "CLVOL_NEE": int(self.nee),
            "CLVOL_MIS": int(self.mis),
            "CLVOL_ABSORPTION": layout.enum("ABSORPTION", self.absorption),
            "CLVOL_PROBABILITY": layout.enum("PROBABILITY", self.probability),
        }
