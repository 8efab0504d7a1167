"""What can be worked out about a scene without a device: brick maps, majorants, its bounding sphere."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

from clvol.planning.plan import Plan
from clvol.planning.refusals import refuse_fine_step
from clvol.planning.settled import Settled
from clvol.scene.boundaries import scene_sphere
from clvol.scene.medium_facts import Matter, number_matter
from clvol.scene.thinness import check_thinness
from clvol.tables.apart import channels_apart, depth_across
from clvol.tables.camera_medium import check_camera_medium
from clvol.tables.majorants import Majorants, PreparedMajorant, choose_majorants
from clvol.tables.surfaces import Surfaces, prepare_surfaces
from clvol.tables.volumes import PreparedVolume, check_cover, prepare_volume

if TYPE_CHECKING:
    import numpy as np

    from clvol.planning.needs import MajorantNeeds
    from clvol.scene.boundaries import Boundaries
    from clvol.scene.records import Scene


@dataclass(frozen=True, eq=False)
class PreparedScene:
    """Everything about a scene that can be worked out without a device.

    Parameters
    ----------
    plan : what it was prepared for, settled with what the volumes show.
    centre, radius : of a sphere round all that rays can meet; world positions count from its centre.
    surfaces : None where there are none.
    matter : the media and volumes by number.
    volumes : in the order of their numbers.
    majorants : for each medium, by number; None of homogeneous ones.
    """

    scene: Scene
    plan: Plan
    centre: np.ndarray
    radius: float
    surfaces: Surfaces | None
    matter: Matter
    volumes: tuple[PreparedVolume, ...]
    majorants: tuple[PreparedMajorant | None, ...]

    @property
    def boundaries(self) -> Boundaries:
        """What bounds the media."""
        return self.plan.boundaries

    def under(self, plan: Plan) -> PreparedScene:
        """The same tables under another plan of the scene, whose majorants need the same.

        Raises
        ------
        ValueError
            They need something else.
        """
        if plan.needs != self.plan.needs or self.plan.settled is None:
            raise ValueError("a scene was prepared for other majorants than a plan needs")
        return replace(self, plan=plan.settle(self.plan.settled))

    def density(self, medium: int) -> PreparedVolume | None:
        """The volume that is a medium's sigma_t; None of homogeneous ones."""
        number = self.matter.roles[medium].get("sigma_t")
        return None if number is None else self.volumes[number]


def prepare(scene: Scene, plan: Plan | None = None) -> PreparedScene:
    """Build brick maps, majorants and what the plan asks of them.

    Raises
    ------
    SceneError
        A coefficient is too large for a float, a volume is wrapped as none can be, a medium is too thin for
        places in it, or the camera is not in the medium that it is said to be in.
    OptionError
        The marching step is too fine.
    """
    plan = plan or Plan.of(scene)
    if scene not in _KEPT:
        _KEPT[scene] = _Kept.of(scene, plan.boundaries)
    kept = _KEPT[scene]
    refuse_fine_step(plan.choices.step, kept.radius)
    majorants = kept.majorants(plan.needs)
    settled = Settled(
        majorants.kind,
        majorants.costs,
        channels_apart(kept.matter, kept.volumes),
        top_trees=any(volume.bricks.levels for volume in kept.volumes),
        depth=depth_across(kept.matter, kept.volumes),
        tree_grid=any(table is not None and table.links is not None for table in majorants.tables),
    )
    parts = kept.centre, kept.radius, kept.surfaces, kept.matter, kept.volumes
    return PreparedScene(scene, plan.settle(settled), *parts, majorants.tables)


@dataclass(eq=False)
class _Kept:
    """What is worked out about a scene, whatever is planned for it, and the majorants of its latest plan.

    It holds neither samples of bricks nor the scene: a few hundredths of what the volumes take.
    """

    centre: np.ndarray
    radius: float
    surfaces: Surfaces | None
    matter: Matter
    volumes: tuple[PreparedVolume, ...]
    latest: tuple[MajorantNeeds, Majorants] | None = None

    @classmethod
    def of(cls, scene: Scene, found: Boundaries) -> _Kept:
        """Work it out, and check the scene."""
        check_camera_medium(scene, found)
        check_thinness(scene, found)
        centre, radius = scene_sphere(scene, found)
        matter = number_matter([entry.medium for entry in found.entries])
        for medium in matter.media:
            check_cover(medium)
        volumes = tuple(prepare_volume(volume, centre) for volume in matter.volumes)
        return cls(centre, radius, prepare_surfaces(scene, found, centre), matter, volumes)

    def majorants(self, needs: MajorantNeeds) -> Majorants:
        """Majorants that have what is needed of them."""
        if self.latest is None or self.latest[0] != needs:
            self.latest = needs, choose_majorants(self.matter, self.volumes, needs)
        return self.latest[1]


_KEPT: WeakKeyDictionary[Scene, _Kept] = WeakKeyDictionary()
"""Of every scene that there still is: one that is rendered again has its tables."""
