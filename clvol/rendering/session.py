"""One scene on one device with one set of choices: what `render` opens and runs."""

from __future__ import annotations

import logging
import math
import time
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from clvol import layout
from clvol.base.arguments import check_seed
from clvol.device.driver import driver_errors
from clvol.device.programs import arguments_of, build_stages, stage_units
from clvol.device.quick import StageUnits
from clvol.device.side_builds import SideBuilds, Unit
from clvol.errors import RenderError, option
from clvol.planning.in_force import warnings
from clvol.planning.plan import Plan
from clvol.planning.settled import Tuning
from clvol.rendering.bands import BandedWavefront
from clvol.rendering.lamp_edges import lamp_edges_unit
from clvol.rendering.light_cache import light_cache_unit
from clvol.rendering.pool import Pool
from clvol.rendering.profiler import Profiler, timed
from clvol.rendering.residence import Residence, compiled
from clvol.rendering.sizes import brick_bytes, check_volumes, render_bytes, rows_at_a_time
from clvol.rendering.upload import upload_scene
from clvol.rendering.wavefront import Wavefront
from clvol.scene.digest import scene_digest
from clvol.tables.camera import camera_rays, reach_of
from clvol.tables.colours import rgb
from clvol.tables.lamp_edges import lamp_window
from clvol.tables.light_cache import light_cache_record
from clvol.tables.pixel_filter import FILTER_BINS
from clvol.tables.prepare import PreparedScene, prepare

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from clvol.device.device import Device
    from clvol.planning.choices import Choices
    from clvol.scene.records import Scene

log = logging.getLogger("clvol")
MAX_SAMPLES = 2**32 - 1
"""Samples of a pixel are numbered in 32 bits; a render without an end asks for all of them."""


@dataclass(eq=False)
class Session:
    """One scene, ready on one device with one plan.

    Parameters
    ----------
    setup_seconds : from the scene's records to buffers and kernels.
    kernel_seconds : the part of it that went into building kernels, nothing where a cache has them.
    seconds : that the last run took, and `earlier` ones whose film it went on with.
    uploaded, built : bytes of the scene, and kernels, that opening it took.
    """

    device: Device
    prepared: PreparedScene
    wavefront: Wavefront
    seed: int
    setup_seconds: float = 0.0
    kernel_seconds: float = 0.0
    seconds: float = 0.0
    earlier: float = 0.0
    uploaded: int = 0
    built: int = 0

    @classmethod
    def for_scene(
        cls, device: Device, scene: Scene, choices: Choices, seed: int, pool: int | None = None
    ) -> Session:
        """Plan a scene's render with `choices`, and open it."""
        started = time.perf_counter()
        plan = Plan.of(scene, choices)
        return cls.for_plan(device, scene, plan, seed, pool, time.perf_counter() - started)

    @classmethod
    def for_plan(
        cls,
        device: Device,
        scene: Scene,
        plan: Plan,
        seed: int,
        pool: int | None = None,
        spent: float = 0.0,
        profiler: Profiler | None = None,
        spp: int | None = None,
        sharing: int = 1,
    ) -> Session:
        """Prepare a scene as planned, and open it.

        spent : seconds that went into the plan.
        spp : how many samples of a pixel will be asked for; None for any number, and to measure times.
        sharing : so many sessions that are yet to be opened, this one included, share the device's room.
        """
        check_seed(seed)
        started = time.perf_counter()
        with timed(profiler, "volumes and tables"):
            prepared = prepare(scene, plan)
        prepared_after = time.perf_counter() - started
        with driver_errors(device.description):
            session = cls.open(device, prepared, seed, pool, profiler, spp, sharing)
        session.setup_seconds += spent + prepared_after
        return session

    @classmethod
    def open(
        cls,
        device: Device,
        prepared: PreparedScene,
        seed: int,
        pool: int | None = None,
        profiler: Profiler | None = None,
        spp: int | None = None,
        sharing: int = 1,
    ) -> Session:
        """Compose and build the kernels, upload the scene, allocate the pool; the rest as in `for_plan`."""
        started = time.perf_counter()
        prepared = on_device(prepared, device)
        plan = prepared.plan
        if profiler:
            profiler.attach(device, plan)
        record = render_record(prepared, seed)
        slots = Pool.for_device(device, plan, pool)
        groups, size = slots.slots // plan.tuning.group_slots, prepared.scene.film.window[2:]
        residence, programs = Residence.of(prepared.scene, device), len(device.programs)
        uploaded_before, bricks = residence.uploaded, 0
        if plan.features.volumes and not residence.has("bricks"):
            check_volumes(device.memory, prepared, render_bytes(plan, size[0], slots))
            bricks = brick_bytes(prepared)
        rows = rows_at_a_time(device.memory, plan, size, slots, sharing, bricks)
        with timed(profiler, "units"):
            grid = light_cache_record(prepared).tobytes() if plan.light_cache else b""
            lamps = lamp_window(prepared) if plan.lamp_edges else ()
            key = compiled(plan), groups, size[0] * rows, grid, lamps
            stages, others = residence.made("units", key, lambda: _units(prepared, groups, size[0] * rows))
            units = StageUnits.of(device, stages, None if profiler or spp is None else spp * math.prod(size))
        with SideBuilds(device, [*units.now.values(), *others]) as builds:
            uploading = time.perf_counter()
            with timed(profiler, "upload"):
                buffers = upload_scene(device, prepared, record, residence)
            uploaded = time.perf_counter()
            with timed(profiler, "kernels"):
                kernels = build_stages(device, units.now)
                arguments = {name: arguments_of(unit.source) for name, unit in stages.items()}
            built = time.perf_counter()
            with timed(profiler, "pool"):
                rows = rows_at_a_time(device.memory, plan, size, slots, sharing)  # beside the scene
                given = device, plan, kernels, arguments, buffers, record, slots, profiler, units.when_slow
                banded = rows < size[1]
                wavefront = BandedWavefront(*given, held=size[0] * rows) if banded else Wavefront(*given)
            warming = time.perf_counter()
            with timed(profiler, "first launches"):
                wavefront.warm_up()
            builds.remember()
        ready = time.perf_counter()
        kernel_seconds = uploading - started + built - uploaded + ready - warming
        session = cls(device, prepared, wavefront, seed, ready - started, kernel_seconds)
        session.uploaded = residence.uploaded - uploaded_before
        session.built = len(device.programs) - programs
        return session

    @property
    def plan(self) -> Plan:
        """What is compiled, launched and allocated."""
        return self.prepared.plan

    @cached_property
    def digest(self) -> str:
        """Tells the scene from others."""
        return scene_digest(self.prepared.scene)

    def restart(self, seed: int) -> None:
        """Forget the picture; the next run draws another seed's samples with the same kernels and buffers."""
        self.seed = seed
        self.wavefront.restart(seed_words(seed))

    def describe(self) -> None:
        """Log the plan, and what it comes to on the device."""
        wavefront = self.wavefront
        log.info("device: %s", self.device.description)
        if log.isEnabledFor(logging.INFO):
            for line in self.plan.describe():
                log.info("%s", line)
        log.info(
            "pool: %d slots in %d groups; %.1f MiB on the device",
            wavefront.pool.slots,
            wavefront.groups,
            wavefront.bytes / 2**20,
        )
        if wavefront.bands > 1:
            width, height = self.prepared.scene.film.window[2:]
            log.info(
                "film: %d x %d pixels have no room on the device: rendered in %d bands of up to %d rows",
                *(width, height, wavefront.bands, wavefront.held // width),
            )

    def warn(self, asked: Mapping[str, str]) -> None:
        """Say what a user should hear of; `asked`: names that the caller gave, by family."""
        for warning in warnings(self.plan, asked):
            log.warning("%s", warning)

    def run(
        self,
        first: int,
        count: int,
        time_limit: float | None = None,
        interrupted: Callable[[], int] = lambda: 0,
    ) -> int:
        """Render samples; returns how many of each pixel were done, as `passes`."""
        done = 0
        for done in self.passes(first, count, time_limit, interrupted):  # noqa: B007
            pass
        return done

    def passes(
        self, first: int, count: int, time_limit: float | None, interrupted: Callable[[], int]
    ) -> Iterator[int]:
        """Render samples, and stop wherever the film has more: at how many of each pixel are done.

        `interrupted` says how urgently an end is asked for, as `Wavefront.passes` takes it.  Time that goes
        elsewhere meanwhile does not count.  Nothing finished is an error.
        """
        started, apart = time.perf_counter(), 0.0
        done = 0

        def spent() -> float:
            return time.perf_counter() - started - apart

        def seconds_left() -> float:
            return math.inf if time_limit is None else time_limit - spent()

        def should_stop() -> int:
            return max(interrupted(), time_limit is not None and spent() >= time_limit)

        with driver_errors(self.device.description):
            for done in self.wavefront.passes(first, count, should_stop, seconds_left):
                self.seconds = self.earlier + spent()
                left = time.perf_counter()
                yield done
                apart += time.perf_counter() - left
        if done == 0:
            raise nothing_finished(interrupted())
        self.seconds = self.earlier + spent()


def _units(prepared: PreparedScene, groups: int, pixels: int) -> tuple[dict[str, Unit], list[Unit]]:
    """What is built: of each stage, and of what is found out before the first wave."""
    others = [light_cache_unit(prepared)] if prepared.plan.light_cache else []
    if prepared.plan.lamp_edges:
        others.append(lamp_edges_unit(prepared))
    return stage_units(prepared.plan, groups, pixels), others


def nothing_finished(urgency: int) -> BaseException:
    """What is raised where a render had to end and no pass of samples was finished."""
    if urgency > 1:
        return KeyboardInterrupt()
    return RenderError(
        "the render was to end, but its first samples did not: paths in flight go on for very long",
        hint=f"limit them with max_depth, lower {option('majorant_scale')} or the density, or give more time",
    )


def on_device(prepared: PreparedScene, device: Device) -> PreparedScene:
    """With its plan tuned for the kind of device."""
    tuning = Tuning(1, 256, lanes=16) if device.is_cpu else Tuning(128, 1024)
    return replace(prepared, plan=prepared.plan.tune(tuning))


def seed_words(seed: int) -> tuple[int, int]:
    """A 64-bit seed as the device takes it: low word, high word; OptionError for what is none."""
    seed = check_seed(seed)
    return seed & 0xFFFFFFFF, seed >> 32


def render_record(prepared: PreparedScene, seed: int) -> np.ndarray:
    """The Render record, schedule fields left at 0."""
    scene = prepared.scene
    record = np.zeros(1, layout.RENDER)
    record["film_size"] = scene.film.window[2:]
    record["seed"] = seed_words(seed)
    record["max_depth"] = scene.integrator.max_depth & 0xFFFFFFFF
    record["rr_depth"] = scene.integrator.rr_depth
    record["emitters"] = prepared.plan.features.sampled_emitters
    record["media"] = prepared.plan.features.media
    if prepared.surfaces is not None:
        record["triangles"] = len(prepared.surfaces.faces)
    record["filter_radius"] = scene.film.rfilter.radius
    record["filter_bins"] = FILTER_BINS
    record["backdrop"] = rgb(scene.film.backdrop or (0.0,))
    record["sample_border"] = int(scene.film.sample_border)
    everywhere = any(entry.everywhere for entry in prepared.boundaries.entries)
    counts_all = everywhere or scene.integrator.shows_depth  # from the near plane on
    reach = reach_of(scene.camera, prepared.radius, counts_all)
    rays = camera_rays(scene.camera, scene.film, prepared.centre, reach)
    for field, value in {
        "camera_eye": rays.eye,
        "camera_position": rays.position,
        "camera_dx": rays.dx,
        "camera_dy": rays.dy,
        "camera_base": rays.base,
        "camera_base_dx": rays.base_dx,
        "camera_base_dy": rays.base_dy,
        "camera_forward": rays.forward,
        "lens_x": rays.lens_x,
        "lens_y": rays.lens_y,
        "lens_start": rays.lens_start,
        "lens_bend": rays.lens_bend,
    }.items():
        record[field] = value
    record["camera_far"] = rays.far
    return record
