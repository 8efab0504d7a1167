"""What a session has to show: its film as a Result, with pictures of what it cost and statistics."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from clvol import layout
from clvol.device.driver import driver_errors
from clvol.picture.result import Result, said_ranges
from clvol.planning import registry
from clvol.rendering.doubts import Expected, say_doubts, say_seconds
from clvol.rendering.labels import scenery_of
from clvol.version import __version__

if TYPE_CHECKING:
    from clvol.picture.estimate import Estimate
    from clvol.planning.plan import Plan
    from clvol.rendering.session import Session
    from clvol.scene.records import Scene

MOST_SAID = 20
"""Parts of a scene that its pictures' metadata have by name."""


def make_result(session: Session, first: int, count: int, final: bool = True) -> Result:
    """The film as a Result; of samples `first` to `first + count`, or of as many as each listed pixel got.

    What is wrong with it is logged, unless more is to come: where it is not `final`.
    """
    film, window = session.wavefront.film, session.prepared.scene.film.window
    shape = window[3], window[2]
    estimate: Estimate
    with driver_errors(session.device.description):
        if session.plan.pixel_list:
            estimate, samples = film.uneven_estimate(), film.samples
        else:
            estimate, samples = film.estimate(first, count), np.full(film.pixels, count)
        stats = statistics(session, int(samples.sum()))
        pictures = _pictures(session, samples, estimate)
    aovs = {name: values.reshape(*shape, *values.shape[1:]) for name, values in pictures.items()}
    result = Result.from_estimate(
        estimate.reshaped(*shape, 3), (first, count), aovs, stats, metadata_of(session, first, samples)
    )
    result.component_format = session.prepared.scene.film.component_format
    result.scenery, result.files = scenery_of(session.prepared), session.prepared.scene.files
    if final:
        say_doubts(result, Expected.of(session))
        say_seconds(result)
    return result


def metadata_of(session: Session, first: int, samples: np.ndarray) -> dict[str, Any]:
    """How a picture of so many samples a pixel, from number `first` on, is made."""
    scene, plan = session.prepared.scene, session.plan
    biased, scale = plan.biased, plan.choices.majorant_scale
    apart = plan.settled.channels_apart if plan.settled and plan.mixes_far_channels else None
    even = samples.min() == samples.max()
    return {
        "scene": scene.source,
        "digest": session.digest,
        **plan.in_force,
        **({"majorant_scale": scale} if scale != 1 else {}),
        **({"biased": ", ".join(biased), "step": plan.choices.step or "voxel"} if biased else {}),
        **({"channels_apart": f"1 : {apart:.3g}"} if apart else {}),
        **({"pixel_format": scene.film.pixel_format} if scene.film.has_alpha else {}),
        **_repairs(session),
        **_departures(scene),
        **({"bands": session.wavefront.bands} if session.wavefront.bands > 1 else {}),
        "spp": int(samples[0]) if even else round(float(samples.mean()), 3),
        **said_ranges(((first, int(samples.max())),)),
        "seed": session.seed,
        "device": session.device.description,
        "version": __version__,
        "seconds": round(session.seconds, 4),
    }


def _departures(scene: Scene) -> dict[str, str]:
    """In what the scene is not what its file says."""
    found = {}
    for kind, said in (("approximated", scene.approximated), ("left_out", scene.left_out)):
        more = [f"{len(said) - MOST_SAID:,} more"] if len(said) > MOST_SAID else []
        found[kind] = "; ".join([*said[:MOST_SAID], *more])
    return {kind: text for kind, text in found.items() if text}


def _repairs(session: Session) -> dict[str, str]:
    """Which volumes had samples that were taken as 0, and how many."""
    volumes = session.prepared.matter.volumes
    said = [f"{volume.source}: {volume.repairs}" for volume in volumes if volume.repairs]
    return {"sanitized": "; ".join(said)} if said else {}


def picture_names(plan: Plan) -> list[str]:
    """The pictures that a result has beside the image."""
    more = [layout.ALPHA] * plan.features.alpha + ["samples"] * plan.pixel_list
    return list(dict.fromkeys(("lookups", *plan.choices.aov, *more)))


def _pictures(session: Session, samples: np.ndarray, estimate: Estimate) -> dict[str, np.ndarray]:
    """Look-ups and what `aov` asks for: means per sample, and the largest weight; float32 (pixels[, 3])."""
    film, plan = session.wavefront.film, session.plan
    sums, peaks, nothing = film.counts(), film.peaks_by_pixel(), np.zeros(film.pixels)
    counts = {name: total / np.maximum(samples, 1) for name, total in sums.items()}
    found = {}
    for name in picture_names(plan):
        if name == layout.ALPHA:
            values = _alpha(session, np.maximum(samples, 1) * plan.jobs_per_sample)
        elif name in registry.FIRST_HIT:
            values = _first_hit(session, name, np.maximum(samples, 1) * plan.jobs_per_sample)
        elif name == "largest_weight":
            values = peaks.get(name, np.ones(film.pixels))
        elif name == "null":
            values = counts["tentative"] - counts["real"] if "tentative" in counts else nothing
        elif name == "samples":
            values = samples
        elif name == "variance":
            values = _variance(estimate) * samples
        elif name == "efficiency":
            values = _efficiency(session, sums, samples, _variance(estimate))
        else:
            values = counts.get(name, nothing)
        found[name] = np.asarray(values, np.float32)
    return found


def _variance(estimate: Estimate) -> np.ndarray:
    """Of each pixel's mean, the mean of the channels', float64 (pixels,)."""
    grey: np.ndarray = estimate.mean_and_variance()[1].mean(axis=-1)
    return grey


def _efficiency(
    session: Session, sums: dict[str, np.ndarray], samples: np.ndarray, variance: np.ndarray
) -> np.ndarray:
    """1 / (variance · seconds) of each pixel, 0 where that is unknown; float64 (pixels,).

    The device keeps no clock for a pixel: the seconds of the stages that walk are dealt out by look-ups and
    cells crossed, the others by samples.
    """
    film, seconds = session.wavefront.film, session.wavefront.launched.seconds
    walking = sum(seconds.get(stage, 0.0) for stage in ("medium_sample", "shadow_transmittance"))
    work = sum((sums[name] for name in ("lookups", "cells") if name in sums), np.zeros(film.pixels))
    even = samples / samples.sum()
    share = work / work.sum() if work.sum() > 0 else even
    spent = walking * share + (sum(seconds.values()) - walking) * even
    cost = variance * spent
    known = np.isfinite(cost) & (cost > 0)
    efficiency: np.ndarray = np.divide(1.0, cost, out=np.zeros(film.pixels), where=known)
    return efficiency


def _first_hit(session: Session, name: str, paths: np.ndarray) -> np.ndarray:
    """A picture of what camera paths first met: means over `paths` paths, float64 (pixels[, 3])."""
    sums = session.wavefront.film.first_hits()
    channels = layout.FIRST_HIT[name]
    means = np.stack([sums[f"{name}_{c}"] / paths for c in range(channels)], axis=1)
    if name == "position":  # the device's are relative to the centre
        means += (sums["met"] / paths)[:, None] * session.prepared.centre
    return means if channels > 1 else means[:, 0]


def _alpha(session: Session, paths: np.ndarray) -> np.ndarray:
    """The share of `paths` paths that met something; 1 where an environment is seen behind all else."""
    if session.plan.opaque:
        return np.ones(session.wavefront.film.pixels)
    alpha: np.ndarray = session.wavefront.film.first_hits()[layout.ALPHA] / paths
    return alpha


def statistics(session: Session, samples: int) -> dict[str, Any]:
    """What `samples` samples, over all pixels, cost and met."""
    wavefront, film = session.wavefront, session.wavefront.film
    slots = wavefront.slot_statistics()
    peaks = {n: float(p.max(initial=0.0)) for n, p in film.peaks_by_pixel().items()}
    counts = {n: int(slots.get(n, 0)) for n in layout.COUNTS}
    counts |= {n: int(c.sum()) for n, c in film.counts().items()}
    paths = samples * session.plan.jobs_per_sample
    stats = {
        "paths": paths,
        "lookups": counts["lookups"],
        "tentative_collisions": counts["tentative"],
        "null_collisions": counts["tentative"] - counts["real"],
        "real_collisions": counts["real"],
        "cells_crossed": counts["cells"],
        "shadow_rays": counts["shadow_rays"],
        "lane_steps": int(slots.get("lane_steps", 0)),
        "busy_lane_steps": int(slots.get("busy_lane_steps", 0)),
        "seconds": {
            "setup": session.setup_seconds,
            "kernels": session.kernel_seconds,
            "render": session.seconds,
            **wavefront.launched.seconds,
        },
        "items": wavefront.handled.by_stage(session.plan.stages),
        "uploaded_bytes": session.uploaded,
        "kernels_built": session.built,
        "launches": wavefront.launched.launches,
        "waves": wavefront.launched.waves,
        "slots": wavefront.pool.slots,
        "bytes_per_slot": 4 * len(wavefront.fields),
        "non_finite": wavefront.non_finite(),
        "majorant_violations": counts["violations"],
        "walks_exhausted": int(slots.get("exhausted", 0)),
        "largest_weight": max(1.0, slots.get("largest_weight", 0.0), peaks.get("largest_weight", 0.0)),
        "largest_sample": peaks["largest_sample"],
        "paths_cut_by_max_depth": int(slots.get("cut", 0)),
        "energy_lost_to_caps": slots.get("cut_energy", 0.0) / max(paths, 1),
    }
    return stats
