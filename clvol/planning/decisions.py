"""What follows from a scene's features and the choices made for it: what is needed, and how many of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

from clvol import layout
from clvol.planning import registry
from clvol.planning.needs import MajorantNeeds
from clvol.planning.settled import FAR_APART, THIN, Settled, Tuning

if TYPE_CHECKING:
    from clvol.accel.controls import ResidualControl
    from clvol.planning.choices import Choices
    from clvol.planning.features import Features
    from clvol.planning.names import Names
    from clvol.scene.boundaries import Boundaries

UNIFORM_SHARE = 0.25
"""Of the table of lights, where it is mixed with what each brings to a point (cl/emitter/choice.h)."""


@dataclass(frozen=True)
class Decisions:
    """What follows from the features of a scene and the choices made for it, one question after the other.

    Parameters
    ----------
    features : what the scene uses.
    choices : what was asked for.
    chosen : a choice of every family; the majorant's stays "auto" until volumes are prepared, and is "none"
        where no medium is heterogeneous; that of lanes stays "auto" until a device is known.
    reasons : why, by family.
    boundaries : what bounds the media, which tables are made from; not compared.
    settled : what only the volumes show; None before they are prepared.
    tuning : what the kind of device decides.
    """

    features: Features
    choices: Choices
    chosen: Names
    reasons: Names
    boundaries: Boundaries = field(repr=False, compare=False)
    settled: Settled | None = None
    tuning: Tuning = field(default_factory=lambda: Tuning(known=False))

    @property
    def tracker(self) -> registry.Choice:
        """The technique's entry in the registry."""
        return registry.TECHNIQUES[self.chosen["technique"]]

    @property
    def estimator(self) -> registry.Choice:
        """The transmittance's entry in the registry."""
        return registry.TRANSMITTANCES[self.chosen["transmittance"]]

    @property
    def channels(self) -> int:
        """Channels of the image: 1 when every coefficient and light is grey, else 3."""
        f = self.features
        media = f.chromatic_extinction or f.chromatic_albedo or f.chromatic_emission
        return 3 if media or f.chromatic_light or f.chromatic_surfaces else 1

    @property
    def far_apart(self) -> bool:
        """Channels' extinctions differ too much for one path."""
        return self.settled is not None and self.settled.channels_apart > FAR_APART

    @property
    def one_channel_per_path(self) -> bool:
        """Whether a path follows one channel, so that a sample is a path for each.

        That is where channels are attenuated or absorbed differently and the technique cannot follow them
        together (METHODS §3, delta); it spares the noise of choosing one.  Homogeneous media can be followed
        together, but for channels that are too far apart.
        """
        f = self.features
        if self.far_apart and not self.tracker.all_channels:
            return True
        if f.heterogeneous and not self.tracker.all_channels:
            sampled = f.chromatic_albedo and self.chosen["absorption"] == "sample"
            return f.chromatic_extinction or sampled
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
    def jobs_per_sample(self) -> int:
        """Paths of one sample: one for each channel, where a path follows one."""
        return self.channels if self.one_channel_per_path else 1

    @property
    def weighted(self) -> bool:
        """Walks change the path's weight."""
        return self.extinction == 3 or (self.features.heterogeneous and self.tracker.weighted)

    @property
    def nee(self) -> bool:
        """Next-event estimation: there are lights to sample, and media or surfaces that scatter to them."""
        f = self.features
        sampled = f.samples_lights and (f.scattering or f.samples_at_surfaces)
        return self.chosen["transmittance"] != "none" and sampled

    @property
    def light_cache(self) -> bool:
        """A cache of transmittances to the lights is filled and used."""
        return self.chosen["shadow_cache"] == "on" and self.nee and self.features.heterogeneous

    @property
    def light_choice(self) -> bool:
        """There are lights to choose among, which is done by what they bring."""
        return (
            self.chosen["light_choice"] == "contribution" and self.nee and self.features.sampled_emitters > 1
        )

    @property
    def uniform_share(self) -> float:
        """Share of the table by which lights are chosen that goes to all of them alike."""
        return UNIFORM_SHARE if self.light_choice else 0.0

    @property
    def direction_control(self) -> bool:
        """Next-event estimation in media has a control variate, which goes by that cache."""
        return self.chosen["next_event"] == "control" and self.light_cache and self.features.peaked

    @property
    def may_refine_lamp_edges(self) -> bool:
        """A camera outside of all media may see lamps, by weights that are the same all over a pixel."""
        f = self.features
        unfit = f.hide_emitters or f.meter or f.camera_inside or f.signed_filter or f.shows_depth
        return f.area and not (unfit or f.emission or f.glow)

    @property
    def lamp_edges(self) -> bool:
        """Lamps that it sees directly have edges of less noise than a pixel's samples."""
        return self.may_refine_lamp_edges and self.chosen["lamp_edges"] == "refined"

    @property
    def mis(self) -> bool:
        """Both ways of finding a light are in use, so that they must be weighted."""
        f = self.features
        return self.nee and (f.samples_sky or f.area)

    @property
    def gathers_on_flights(self) -> bool:
        """Exact flights meet emission; in media that overlap, the collision that counts alone does."""
        f = self.features
        emits = f.heterogeneous and f.emission and not f.media_overlap
        return emits and self.chosen["technique"] == "regular"

    @property
    def may_expect_background(self) -> bool:
        """Walks might: through one medium alone, without surfaces, under lights at infinity."""
        f = self.features
        light = f.constant or f.envmap or f.directional
        dark = not (f.emission or f.glow)
        alone = f.media == 1 and f.heterogeneous and not f.surfaces and dark and f.scattering
        return light and alone and self.chosen["technique"] == "delta"

    @property
    def expects_background(self) -> bool:
        """Walks do."""
        return self.may_expect_background and self.chosen["background"] == "expected"

    @property
    def sun_control(self) -> bool:
        """What they expect is by the light of a sun, too, as the cache of lights has it."""
        return self.expects_background and self.light_cache and self.features.directional

    @property
    def camera_rate(self) -> int:
        """How often walks of camera paths look up what they expect, in what majorants ask for."""
        return 2 if self.depth_across <= THIN and self.expects_background else 1

    @property
    def depth_across(self) -> float:
        """Optical depth across the medium, on the mean and about; infinite where nobody knows."""
        return float("inf") if self.settled is None else self.settled.depth

    @property
    def flight_strata(self) -> int:
        """Points of an exact flight at which emission is gathered."""
        strata = self.gathers_on_flights and self.chosen["gathering"] == "strata"
        return layout.FLIGHT_STRATA if strata else 1

    @property
    def walks_majorants(self) -> bool:
        """Some stage walks majorant cells."""
        shadows = self.nee and self.estimator.walks_majorant
        return self.chosen["majorant"] != "none" and (self.tracker.walks_majorant or shadows)

    @property
    def has_tree_grid(self) -> bool:
        """The majorant is a grid whose cells are found through a tree."""
        return self.settled is not None and self.settled.tree_grid

    @property
    def needs_controls(self) -> bool:
        """The technique walks a control of each majorant cell."""
        return self.chosen["majorant"] != "none" and self.tracker.control != "none"

    @property
    def needs_residuals(self) -> bool:
        """Transmittance is estimated over a control of each majorant cell."""
        residual = self.chosen["transmittance"] == "residual-ratio"
        return self.chosen["majorant"] != "none" and self.nee and residual

    @property
    def may_walk_in_lanes(self) -> bool:
        """Walks might be side by side, whatever the technique: so far as the scene goes."""
        f = self.features
        return self.chosen["lanes"] != "off" and f.heterogeneous and f.media == 1 and not f.transfers

    @property
    def needs(self) -> MajorantNeeds:
        """What the cells of the majorant have to carry."""
        residual = self.chosen["transmittance"] == "residual-ratio"
        return MajorantNeeds(
            self.choices["majorant"],
            self.tracker.control,
            cast("ResidualControl", self.chosen["control"]) if residual else "none",
            self.choices.majorant_scale,
            self.may_walk_in_lanes,
        )

    @property
    def walks_by_collisions(self) -> bool:
        """The technique, or what estimates transmittance, goes by tentative collisions with the majorant."""
        walkers = [self.tracker, *([self.estimator] if self.nee else [])]
        return any(one.walks_majorant and not one.interpolated for one in walkers)

    @property
    def randomizations(self) -> int:
        """Parts that a pixel's samples are dealt to; 0 where every sample is independent."""
        return layout.RANDOMIZATIONS if registry.SAMPLERS[self.chosen["sampler"]].low_discrepancy else 0

    @property
    def pixel_list(self) -> bool:
        """Runs are over listed pixels, each at a sample of its own."""
        return self.choices.target_error is not None

    @property
    def first_hit(self) -> tuple[str, ...]:
        """Pictures of what camera paths first meet that are asked for."""
        return tuple(name for name in registry.FIRST_HIT if name in self.choices.aov)

    @property
    def opaque(self) -> bool:
        """Alpha is 1 everywhere, as in Mitsuba: something is seen behind all there is."""
        f = self.features
        return f.backdrop or ((f.constant or f.envmap) and not f.hide_environment)

    @property
    def counts_alpha(self) -> bool:
        """Paths that leave unscattered are counted."""
        return self.features.alpha and not self.opaque

    @property
    def guides_denoiser(self) -> bool:
        """Albedos and normals of what paths first meet tell more than the colours do."""
        f = self.features
        return f.reflecting or f.albedo_volumes or f.media > 1

    @property
    def shown(self) -> frozenset[str]:
        """Pictures whose numbers are kept: those asked for, look-ups, and what others are made from."""
        of = {"null": ("tentative", "real"), "efficiency": ("cells",)}
        asked = self.choices.aov
        return frozenset(("lookups", *asked, *(n for name in asked for n in of.get(name, ()))))

    @property
    def mixes_far_channels(self) -> bool:
        """Whether one path follows channels whose extinctions are too far apart for it."""
        return self.far_apart and self.extinction == 3
