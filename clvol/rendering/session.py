"""One scene on one device with one set of choices: what `render` opens and runs."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from clvol import layout
from clvol.base.arguments import check_seed
from clvol.base.progress import FilmNoise, Progress, ProgressCallback
from clvol.device.device import Device
from clvol.device.programs import build_stages
from clvol.errors import RenderError
from clvol.picture.result import relative_noise
from clvol.planning import registry
from clvol.planning.choices import Choices, prepare_for, resolve
from clvol.planning.config import KernelConfig
from clvol.rendering.upload import upload_scene
from clvol.rendering.wavefront import Pool, Progressed, Wavefront
from clvol.scene.records import Scene
from clvol.tables.apart import FAR_APART, extinction_ratio
from clvol.tables.camera import camera_rays
from clvol.tables.pixel_filter import FILTER_BINS
from clvol.tables.prepare import PreparedScene

log = logging.getLogger("clvol")
MAX_SAMPLES = 2**32 - 1
"""Samples of a pixel are numbered in 32 bits; a render without an end asks for all of them."""


@dataclass(eq=False)
class Session:
    """One scene, ready on one device with one set of choices."""

    device: Device
    prepared: PreparedScene
    config: KernelConfig
    wavefront: Wavefront
    seed: int
    step: float | None = None
    setup_seconds: float = 0.0
    """From the scene's records to buffers and kernels."""
    kernel_seconds: float = 0.0
    """The part of it that went into building kernels, nothing where a cache has them."""

    @classmethod
    def for_scene(
        cls, device: Device, scene: Scene, choices: Choices, seed: int, pool: int | None = None
    ) -> Session:
        """Prepare a scene for `choices` and open it."""
        check_seed(seed)
        started = time.perf_counter()
        prepared = prepare_for(scene, choices)
        prepared_after = time.perf_counter() - started
        session = cls.open(device, prepared, choices, seed, pool)
        session.setup_seconds += prepared_after
        return session

    @classmethod
    def open(
        cls, device: Device, prepared: PreparedScene, choices: Choices, seed: int, pool: int | None = None
    ) -> Session:
        """Compose and build the kernels, upload the scene, allocate the pool."""
        started = time.perf_counter()
        config = kernel_config(prepared, choices, device)
        kernels = build_stages(device, config)
        built = time.perf_counter()
        buffers = upload_scene(device, prepared, config, choices.step)
        record = render_record(prepared, seed)
        wavefront = Wavefront(device, config, kernels, buffers, record, Pool.for_device(device, config, pool))
        warming = time.perf_counter()
        wavefront.warm_up()
        ready = time.perf_counter()
        kernel_seconds = built - started + ready - warming
        return cls(device, prepared, config, wavefront, seed, choices.step, ready - started, kernel_seconds)

    def restart(self, seed: int) -> None:
        """Forget the picture; the next run draws another seed's samples with the same kernels and buffers."""
        self.seed = seed
        self.wavefront.restart(seed_words(seed))

    def describe(self) -> None:
        """Log what was found and built."""
        wavefront, config = self.wavefront, self.config
        log.info("device: %s", self.device.description)
        log.info("features: %s", config.features.found())
        log.info("choices: %s", ", ".join(f"{k} {v}" for k, v in self.choices().items()))
        log.info("units built: %s, accumulate", ", ".join(config.stages))
        log.info(
            "path state: %d bytes per slot (%s)",
            4 * len(wavefront.fields),
            ", ".join(f.name for f in wavefront.fields),
        )
        log.info(
            "pool: %d slots in %d groups; %.1f MiB on the device",
            wavefront.pool.slots,
            wavefront.groups,
            wavefront.bytes / 2**20,
        )

    def warn_of_unused(self, asked: dict[str, str]) -> None:
        """Say which of the caller's own choices this scene has no use for, and what leaves it black."""
        used = self.choices()
        for family, value in asked.items():
            if value not in ("auto", used[family]):
                reason = f"the scene's media need only the {used[family]} rule"
                if used[family] == "none":
                    reason = f"nothing in this render needs {'an' if family[0] in 'aeiou' else 'a'} {family}"
                log.warning("%s %s is not used: %s", family, value, reason)
        if self.prepared.needs.scale != 1 and used["majorant"] == "none":
            log.warning("majorant_scale is not used: nothing in this render walks a majorant")
        if not self.config.features.emitters and not self.config.features.emission:
            log.warning("the scene has no emitter: its picture is black")
        if self.mixes_far_channels():
            log.warning(
                "extinctions of the channels differ by 1 : %.2g, and technique %s follows them with one "
                "path: most of what the thinnest scatters may never be sampled, nor the error show it; "
                "technique auto or delta has a path for each channel",
                extinction_ratio(self.prepared),
                self.config.technique,
            )
        for what in self.biased():
            log.warning("%s is BIASED: the picture's mean is off by an unknown amount", what)

    def choices(self) -> dict[str, str]:
        """The choices in force; "none" where the scene has no use for one."""
        config, features = self.config, self.config.features
        walks = features.heterogeneous
        analytic = "analytic" if features.homogeneous else "none"
        chooses = config.spectrum == 3 and (config.extinction == 3 or config.absorption == "sample")
        return {
            "technique": config.technique if walks else analytic,
            "transmittance": (config.transmittance if walks else analytic) if config.nee else "none",
            "majorant": config.majorant if config.walks_majorants else "none",
            "lookup": config.lookup
            if walks and not (features.nearest and not features.trilinear)
            else "none",
            "absorption": config.absorption if features.media and features.scattering else "none",
            "probability": config.probability if walks and config.weighted and chooses else "none",
            "control": config.control if config.needs_residuals else "none",
            "sampler": config.sampler,
        }

    def biased(self) -> list[str]:
        """The choices in force whose pictures are biased, as "family name"."""
        used = self.choices()
        families = {"technique": registry.TECHNIQUES, "transmittance": registry.TRANSMITTANCES}
        return [
            f"{f} {used[f]}" for f, table in families.items() if used[f] in table and table[used[f]].biased
        ]

    def mixes_far_channels(self) -> bool:
        """Whether one path follows channels whose extinctions are too far apart for it."""
        return self.config.far_apart and self.config.extinction == 3

    def needs_bound(self) -> bool:
        """Whether a choice in force is right only where majorants bound the density."""
        used = self.choices()
        families = {"technique": registry.TECHNIQUES, "transmittance": registry.TRANSMITTANCES}
        return any(used[f] in table and table[used[f]].needs_bound for f, table in families.items())

    def run(
        self,
        first: int,
        count: int,
        time_limit: float | None = None,
        callback: ProgressCallback | None = None,
        interrupted: Callable[[], int] = lambda: 0,
    ) -> int:
        """Render samples; returns how many of each pixel were done.

        `interrupted` says how urgently an end is asked for, as `Wavefront.run` takes it.
        """
        started = time.perf_counter()
        total = count if count < MAX_SAMPLES else None
        noise = FilmNoise(lambda done: self._noise(first, done))

        def should_stop() -> int:
            return max(interrupted(), time_limit is not None and time.perf_counter() - started >= time_limit)

        def report(progressed: Progressed) -> None:
            if callback is not None:
                done = progressed.samples_done
                noise_now = noise.after(done, exact=done == total)
                callback(Progress(done, total, progressed.seconds, time_limit, noise_now))

        done = self.wavefront.run(first, count, should_stop, report)
        if done == 0:
            raise nothing_finished(interrupted())
        self.seconds = time.perf_counter() - started
        return done

    def _noise(self, first: int, count: int) -> float:
        estimate = self.wavefront.film.estimate(first, count)
        return relative_noise(*estimate.mean_and_variance(), estimate.dof)


def nothing_finished(urgency: int) -> BaseException:
    """What is raised where a render had to end and no pass of samples was finished."""
    if urgency > 1:
        return KeyboardInterrupt()
    return RenderError(
        "the render was to end, but its first samples did not: paths in flight go on for very long",
        hint="limit them with max_depth, lower majorant_scale or the density, or give more time",
    )


def kernel_config(prepared: PreparedScene, choices: Choices, device: Device) -> KernelConfig:
    """What is compiled: `auto` resolved by fixed rules, the launch tuned for the kind of device."""
    resolved = resolve(prepared.features, choices.names)
    tuning = (
        {"local_size": 1, "group_slots": 256} if device.is_cpu else {"local_size": 128, "group_slots": 1024}
    )
    return KernelConfig(
        prepared.features,
        majorant=prepared.majorant,
        top_trees=any(volume.bricks.levels for volume in prepared.volumes.values()),
        tree_grid=any(found.links is not None for found in prepared.majorants.values()),
        aov=choices.aov,
        far_apart=extinction_ratio(prepared) > FAR_APART,
        pixel_list=choices.target_error is not None,
        **resolved,
        **tuning,
    )


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
    record["emitters"] = prepared.features.emitters
    record["media"] = prepared.features.media
    if prepared.surfaces is not None:
        record["triangles"] = len(prepared.surfaces.faces)
    record["filter_radius"] = scene.film.rfilter.radius
    record["filter_bins"] = FILTER_BINS
    record["sample_border"] = int(scene.film.sample_border)
    everywhere = any(entry.everywhere for entry in prepared.boundaries.entries)
    reach = np.inf if everywhere else prepared.radius  # of what a ray can meet
    rays = camera_rays(scene.sensor, scene.film, prepared.centre, reach)
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
