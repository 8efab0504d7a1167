"""One scene on one device with one set of choices: what `render` opens, runs and asks for its Result."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from clvol import layout
from clvol.camera import camera_rays
from clvol.config import KernelConfig
from clvol.device import Device
from clvol.errors import OptionError
from clvol.film import FILTER_BINS
from clvol.prepare import PreparedScene
from clvol.programs import build_stages
from clvol.progress import Progress, ProgressCallback
from clvol.result import Result, mean_and_variance, relative_noise
from clvol.scene.digest import scene_digest
from clvol.upload import emitter_order, upload_scene
from clvol.version import __version__
from clvol.wavefront import Pool, Progressed, Wavefront

log = logging.getLogger("clvol")
MAX_SAMPLES = 2**32 - 1
"""Samples of a pixel are numbered in 32 bits; a render without an end asks for all of them."""
_NOISE_SECONDS = 0.5
"""The noise shown by the progress bar is read from the film at most this often."""


@dataclass(eq=False)
class Session:
    """One scene, ready on one device with one set of choices."""

    device: Device
    prepared: PreparedScene
    config: KernelConfig
    wavefront: Wavefront
    seed: int

    @classmethod
    def open(
        cls, device: Device, prepared: PreparedScene, choices: dict[str, str], seed: int, pool: int | None
    ) -> Session:
        """Compose and build the kernels, upload the scene, allocate the pool."""
        config = kernel_config(prepared, choices, device)
        kernels = build_stages(device, config)
        buffers = upload_scene(device, prepared, config)
        record = render_record(prepared, seed)
        wavefront = Wavefront(device, config, kernels, buffers, record, Pool.for_device(device, config, pool))
        wavefront.warm_up()
        return cls(device, prepared, config, wavefront, seed)

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
                log.warning(
                    "%s %s is not used: the scene's media need %s",
                    family,
                    value,
                    "none" if used[family] == "none" else f"only the {used[family]} rule",
                )
        if not self.config.features.emitters:
            log.warning("the scene has no emitter: its picture is black")

    def choices(self) -> dict[str, str]:
        """The choices in force; "none" where the scene has no use for one."""
        config, features = self.config, self.config.features
        walks = features.heterogeneous
        analytic = "analytic" if features.homogeneous else "none"
        return {
            "technique": config.technique if walks else analytic,
            "transmittance": (config.transmittance if walks else analytic) if config.nee else "none",
            "majorant": config.majorant,
            "lookup": config.lookup if walks else "none",
            "absorption": config.absorption if features.media else "none",
        }

    def run(
        self,
        first: int,
        count: int,
        time_limit: float | None,
        callback: ProgressCallback | None,
        interrupted: Callable[[], bool],
    ) -> int:
        """Render samples; returns how many of each pixel were done."""
        started = time.perf_counter()
        total = count if count < MAX_SAMPLES else None
        last_noise = [float("nan"), -_NOISE_SECONDS]

        def should_stop() -> bool:
            return interrupted() or (time_limit is not None and time.perf_counter() - started >= time_limit)

        def report(progressed: Progressed) -> None:
            if callback is None:
                return
            if progressed.seconds - last_noise[1] >= _NOISE_SECONDS:
                last_noise[:] = self._noise(progressed.samples_done), progressed.seconds
            callback(Progress(progressed.samples_done, total, progressed.seconds, time_limit, last_noise[0]))

        done = self.wavefront.run(first, count, should_stop, report)
        self.seconds = time.perf_counter() - started
        return done

    def _noise(self, count: int) -> float:
        return relative_noise(*mean_and_variance(*self.wavefront.sums(), count))

    def result(self, first: int, count: int, setup_seconds: float) -> Result:
        """The film as a Result, with what it cost."""
        film = self.prepared.scene.film
        shape = (film.height, film.width)
        sums = [np.broadcast_to(s, (len(s), 3)).reshape(*shape, 3).copy() for s in self.wavefront.sums()]
        lookups = self.wavefront.lookups()
        stats = self._statistics(count, lookups, setup_seconds)
        metadata = {
            "scene": self.prepared.scene.source,
            "digest": scene_digest(self.prepared.scene),
            **self.choices(),
            "spp": count,
            "seed": self.seed,
            "device": self.device.description,
            "version": __version__,
            "seconds": round(self.seconds, 4),
        }
        aovs = {"lookups": (lookups.astype(np.float64) / count).astype(np.float32).reshape(shape)}
        return Result.from_sums(*sums, (first, count), aovs, stats, metadata)

    def _statistics(self, count: int, lookups: np.ndarray, setup_seconds: float) -> dict:
        wavefront = self.wavefront
        slots = wavefront.slot_statistics()
        paths = count * wavefront.pixels
        stats = {
            "paths": paths,
            "lookups": int(lookups.sum()),
            "seconds": {"setup": setup_seconds, "render": self.seconds, **wavefront.seconds},
            "launches": wavefront.launches,
            "waves": wavefront.waves,
            "slots": wavefront.pool.slots,
            "bytes_per_slot": 4 * len(wavefront.fields),
            "non_finite": wavefront.non_finite(),
            "majorant_violations": int(slots.get("violations", 0)),
            "walks_exhausted": int(slots.get("exhausted", 0)),
            "largest_weight": max(self.config.first_weight, slots.get("largest_weight", 0.0)),
            "paths_cut_by_max_depth": int(slots.get("cut", 0)),
            "energy_lost_to_caps": slots.get("cut_energy", 0.0) / paths,
        }
        if (
            self.config.features.heterogeneous
            and not stats["lookups"]
            and not self.config.features.homogeneous
        ):
            log.warning("no path met any density: are the transforms right?")
        for name in ("non_finite", "majorant_violations", "walks_exhausted"):
            if stats[name]:
                log.warning("%s: %d", name.replace("_", " "), stats[name])
        log.info("set-up (kernels, volumes, majorants) %8.3f seconds", setup_seconds)
        for stage, seconds in wavefront.seconds.items():
            log.info("stage %-20s %8.3f seconds", stage, seconds)
        return stats


def kernel_config(prepared: PreparedScene, choices: dict[str, str], device: Device) -> KernelConfig:
    """Resolve `auto` by fixed rules and tune the launch for the kind of device."""
    features = prepared.features
    fixed = {"technique": "delta", "transmittance": "ratio", "lookup": "exact", "absorption": "mixed"}
    if not (features.envmap or features.directional or features.point_lights):
        # scattering finds a constant environment as well as sampling it does, without the shadow ray
        fixed["transmittance"] = "none"
    resolved = {k: choices[k] if choices[k] != "auto" else v for k, v in fixed.items()}
    if resolved["transmittance"] == "none" and (features.directional or features.point_lights):
        raise OptionError(
            "transmittance 'none' cannot render point and directional lights",
            hint="only next-event estimation reaches them: use ratio",
        )
    tuning = (
        {"local_size": 1, "group_slots": 256} if device.is_cpu else {"local_size": 128, "group_slots": 1024}
    )
    return KernelConfig(features, majorant=prepared.majorant, **resolved, **tuning)


def render_record(prepared: PreparedScene, seed: int) -> np.ndarray:
    """The Render record, schedule fields left at 0."""
    scene = prepared.scene
    record = np.zeros(1, layout.RENDER)
    record["film_size"] = scene.film.width, scene.film.height
    record["seed"] = seed & 0xFFFFFFFF, seed >> 32
    record["max_depth"] = scene.integrator.max_depth & 0xFFFFFFFF
    record["rr_depth"] = scene.integrator.rr_depth
    record["emitters"] = len(emitter_order(scene))
    record["media"] = prepared.features.media
    record["filter_radius"] = scene.film.rfilter.radius
    record["filter_bins"] = FILTER_BINS
    record["sample_border"] = int(scene.film.sample_border)
    rays = camera_rays(scene.sensor, scene.film, prepared.centre, prepared.radius)
    for field, value in {
        "camera_position": rays.position,
        "camera_dx": rays.dx,
        "camera_dy": rays.dy,
        "camera_base": rays.base,
        "camera_base_dx": rays.base_dx,
        "camera_base_dy": rays.base_dy,
        "camera_forward": rays.forward,
    }.items():
        record[field] = value
    record["camera_far"] = rays.far
    return record
