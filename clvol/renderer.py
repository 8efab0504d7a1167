"""`clvol.render`: from a scene and the user's choices to a Result."""

from __future__ import annotations

import logging
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass

import numpy as np

from clvol import layout, registry
from clvol.camera import camera_rays
from clvol.config import KernelConfig
from clvol.device import Device, open_device
from clvol.errors import OptionError
from clvol.film import FILTER_BINS
from clvol.prepare import PreparedScene, prepare
from clvol.programs import build_stages
from clvol.progress import Progress, ProgressCallback, RichProgress
from clvol.result import Result, mean_and_variance, relative_noise
from clvol.scene.records import Scene
from clvol.upload import emitter_order, upload_scene
from clvol.version import __version__
from clvol.wavefront import Pool, Progressed, Wavefront

log = logging.getLogger("clvol")
_NOISE_SECONDS = 0.5
"""The noise shown by the progress bar is read from the film at most this often."""
_MAX_SAMPLES = 2**32 - 1


def render(
    scene: Scene,
    *,
    spp: int | None = None,
    seed: int | None = None,
    technique: str = "auto",
    transmittance: str = "auto",
    majorant: str = "auto",
    lookup: str = "auto",
    absorption: str = "auto",
    time_limit: float | None = None,
    device: str | None = None,
    progress: bool | ProgressCallback = False,
    samples: tuple[int, int] | None = None,
    pool: int | None = None,
) -> Result:
    """Render a scene.

    Parameters
    ----------
    scene : from `load_file` or `load_dict`.
    spp, seed : samples per pixel and 64-bit seed; default to the scene's.
    technique, transmittance, majorant, lookup, absorption : names from `clvol.registry`; "auto" takes the
        scene's own choice, else follows fixed rules, so that the same seed gives the same bits.
    time_limit : seconds after which no new pass of samples is begun; alone it replaces `spp`.
    device : index or part of the name of an OpenCL device (see `clvol devices`).
    progress : True for a progress bar, or a callable that receives `clvol.progress.Progress` records.
    samples : (first, count): render only these of the samples; results of disjoint ranges `merge`.
    pool : paths in flight, for measurements; the picture does not depend on it.

    Returns
    -------
    Result.  Ctrl-C finishes the paths in flight and returns the picture so far, with
    ``stats["interrupted"]`` set; a second Ctrl-C raises KeyboardInterrupt.

    Raises
    ------
    OptionError, SceneError, VolumeError, DeviceError : a choice, scene, volume or device that won't do.
    """
    chosen = {
        "technique": technique,
        "transmittance": transmittance,
        "majorant": majorant,
        "lookup": lookup,
        "absorption": absorption,
    }
    choices = {family: _choice(scene, family, value) for family, value in chosen.items()}
    first, count = _sample_range(scene, spp, time_limit, samples)
    seed = scene.seed if seed is None else seed
    if not 0 <= seed < 2**64:
        raise OptionError(f"seed {seed} is not a 64-bit number", hint="choose one from 0 to 2**64 - 1")
    started = time.perf_counter()
    opened = open_device(device)
    prepared = prepare(scene, choices["majorant"])
    session = Session.open(opened, prepared, choices, seed, pool)
    session.describe()
    setup_seconds = time.perf_counter() - started
    bar = RichProgress() if progress is True else nullcontext(progress or None)
    with bar as callback, _interrupt_flag() as interrupted:
        done = session.run(first, count, time_limit, callback, interrupted)
    result = session.result(first, done, setup_seconds)
    result.stats["interrupted"] = bool(interrupted())
    return result


def _choice(scene: Scene, family: str, value: str) -> str:
    """The caller's choice, else the scene's, else auto."""
    if value == "auto":
        value = scene.integrator.choices.get(family, "auto")
    return registry.check_choice(family, value)


def _sample_range(
    scene: Scene, spp: int | None, time_limit: float | None, samples: tuple[int, int] | None
) -> tuple[int, int]:
    """First sample and how many; a time limit alone sets no end."""
    if samples is not None and spp is not None:
        raise OptionError("spp and samples exclude each other", hint="samples=(first, count) says both")
    if time_limit is not None and not time_limit > 0:
        raise OptionError(f"time limit {time_limit} is not a positive number of seconds")
    if samples is not None:
        first, count = samples
    elif time_limit is not None and spp is None:
        first, count = 0, _MAX_SAMPLES
    else:
        first, count = 0, scene.spp if spp is None else spp
    if first < 0 or count < 1 or first + count > _MAX_SAMPLES:
        raise OptionError(
            f"cannot render {count} samples per pixel from sample {first} on",
            hint=f"give at least 1 sample, and at most {_MAX_SAMPLES} in all",
        )
    return int(first), int(count)


@contextmanager
def _interrupt_flag() -> Iterator[Callable[[], bool]]:
    """Turns the first Ctrl-C into a flag; the second one is an ordinary KeyboardInterrupt."""
    flag = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield flag.is_set
        return
    previous = signal.getsignal(signal.SIGINT)

    def on_interrupt(number: int, frame: object) -> None:
        flag.set()
        signal.signal(signal.SIGINT, previous)

    signal.signal(signal.SIGINT, on_interrupt)
    try:
        yield flag.is_set
    finally:
        signal.signal(signal.SIGINT, previous)


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
        total = count if count < _MAX_SAMPLES else None
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
            "paths_cut_by_max_depth": int(slots.get("cut", 0)),
            "energy_lost_to_caps": slots.get("cut_energy", 0.0) / paths,
        }
        for name in ("non_finite", "majorant_violations", "walks_exhausted"):
            if stats[name]:
                log.warning("%s: %d", name.replace("_", " "), stats[name])
        for stage, seconds in wavefront.seconds.items():
            log.info("stage %-20s %8.3f s", stage, seconds)
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
