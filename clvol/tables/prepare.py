"""What can be worked out about a scene without a device: brick maps, majorants, its bounding sphere."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from clvol.planning.plan import Plan
from clvol.planning.refusals import refuse_fine_step
from clvol.planning.settled import Settled
from clvol.scene.boundaries import scene_sphere
from clvol.scene.material_facts import texture_volumes
from clvol.scene.medium_facts import Matter, number_matter
from clvol.scene.thinness import check_thinness
from clvol.tables.apart import channels_apart, depth_across
from clvol.tables.camera_medium import check_camera_medium
from clvol.tables.majorants import Majorants, PreparedMajorant, choose_majorants
from clvol.tables.resolution import check_resolution
from clvol.tables.surfaces import Surfaces, prepare_surfaces, same_surface, with_looks
from clvol.tables.volumes import PreparedVolume, prepare_volume
from clvol.tables.wrapped import Reach, reaches

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clvol.planning.needs import MajorantNeeds
    from clvol.scene.boundaries import Boundaries
    from clvol.scene.records import GridVolume, Scene, Shape


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
        The marching step is too fine, or bounds are multiplied by so much that no walk ends.
    """
    plan = plan or Plan.of(scene)
    kept: _Kept | None = scene.kept.get(__name__)
    if kept is None or not kept.fits(scene):
        kept = scene.kept[__name__] = _Kept.of(scene, plan.boundaries, kept)
    refuse_fine_step(plan.choices.step, kept.radius)
    majorants = kept.majorants(plan.needs)
    if plan.walks_by_collisions:
        for worst in majorants.worst:
            worst.check()
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

    It holds no samples of bricks: a few hundredths of what the volumes take.

    Parameters
    ----------
    shapes, others : what it was worked out from; the others are the sensor, the film and the emitters.
    found : what bounds the media.
    """

    shapes: tuple[Shape, ...]
    others: tuple[object, ...]
    found: Boundaries
    centre: np.ndarray
    radius: float
    surfaces: Surfaces | None
    matter: Matter
    volumes: tuple[PreparedVolume, ...]
    latest: tuple[MajorantNeeds, Majorants] | None = None

    @classmethod
    def of(cls, scene: Scene, found: Boundaries, before: _Kept | None) -> _Kept:
        """Work it out, and check the scene; what has not changed since `before` is taken from there."""
        check_camera_medium(scene, found)
        check_thinness(scene, found)
        centre, radius = scene_sphere(scene, found)
        shown = [v for n in found.surfaces for v in _shown_volumes(scene.shapes[n])]
        matter = number_matter([entry.medium for entry in found.entries], shown)
        wrapped = reaches(scene, found, shown)
        known = () if before is None else before.volumes
        in_place = before is not None and np.array_equal(before.centre, centre)
        volumes = tuple(
            _prepared_volume(volume, centre, known, in_place, wrapped.get(id(volume)))
            for volume in matter.volumes
        )
        check_resolution(scene, found, centre, radius, matter, volumes)
        surfaces = before.surfaces_of(scene, found) if before is not None and in_place else None
        surfaces = surfaces or prepare_surfaces(scene, found, centre)
        kept = cls(scene.shapes, _others(scene), found, centre, radius, surfaces, matter, volumes)
        if before is not None and _same_objects(before.matter.media, matter.media):
            same = before.matter.of_entry == matter.of_entry and _same_objects(before.volumes, volumes)
            kept.latest = before.latest if same else None
        return kept

    def fits(self, scene: Scene) -> bool:
        """Whether the scene is as it was."""
        return _same_objects(self.shapes, scene.shapes) and _same_objects(self.others, _others(scene))

    def surfaces_of(self, scene: Scene, found: Boundaries) -> Surfaces | None:
        """The surfaces as they are, of what other materials and light; None where they are others."""
        divided = self.found.surfaces == found.surfaces and self.found.boundaries == found.boundaries
        pairs = [(self.shapes[n], scene.shapes[n]) for n in found.surfaces] if divided else []
        if self.surfaces is None or not pairs or not all(same_surface(*pair) for pair in pairs):
            return None
        return with_looks(self.surfaces, [now for _, now in pairs])

    def majorants(self, needs: MajorantNeeds) -> Majorants:
        """Majorants that have what is needed of them."""
        if self.latest is None or self.latest[0] != needs:
            self.latest = needs, choose_majorants(self.matter, self.volumes, needs)
        return self.latest[1]


def _shown_volumes(shape: Shape) -> list[GridVolume]:
    return texture_volumes(shape.bsdf, shape.emission)


def _others(scene: Scene) -> tuple[object, ...]:
    return (scene.camera, scene.film, *scene.emitters)


def _prepared_volume(
    volume: GridVolume,
    centre: np.ndarray,
    known: tuple[PreparedVolume, ...],
    in_place: bool,
    reach: Reach | None,
) -> PreparedVolume:
    """A volume's tables, or of its bricks what is `known`; `in_place`: the centre is the same."""
    alike = [one for one in known if one.reach == reach]
    for one in alike if in_place else ():
        if one.volume is volume:
            return one
    for one in alike:
        if one.volume.grid is volume.grid and one.volume.wrap_mode == volume.wrap_mode:
            return prepare_volume(volume, centre, one.bricks, reach)
    return prepare_volume(volume, centre, reach=reach)


def _same_objects(some: Sequence[object], others: Sequence[object]) -> bool:
    return len(some) == len(others) and all(one is other for one, other in zip(some, others, strict=True))
