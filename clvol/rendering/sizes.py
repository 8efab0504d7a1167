"""Bytes that a render takes on its device, worked out before any of them is taken.

All of a scene's bricks stay on the device: a volume that has no room there is refused, with what would have.
"""

from __future__ import annotations

import gc
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from clvol import layout
from clvol.base.memory import available_memory, format_bytes
from clvol.base.types import triple
from clvol.device.memory import KEPT_FREE
from clvol.errors import DeviceError
from clvol.layout import BRICK_CELLS, BRICK_SAMPLES

if TYPE_CHECKING:
    from clvol.device.memory import DeviceMemory
    from clvol.planning.plan import Plan
    from clvol.rendering.pool import Pool
    from clvol.tables.prepare import PreparedScene

Size = tuple[int, int, int]
HOST_BYTES = 250
"""Bytes a pixel that making a picture of the film takes at most, beside the film itself."""
_MARGIN = 0.95
"""Share of the free memory that a volume is said to fit in: tops and bounds grow with it, too."""


def film_sizes(plan: Plan, pixels: int) -> dict[str, int]:
    """Of the film's buffers, by name."""
    sizes = {
        "film": 8 * (plan.randomizations or 2) * plan.channels * pixels,
        "film_peaks": 4 * (1 + layout.shows_weight(plan.macros)) * pixels,
    }
    if counts := layout.path_counts(plan.macros):
        sizes["film_counts"] = 8 * len(counts) * pixels
    if firsts := layout.first_hit_fields(plan.macros):
        sizes["film_firsts"] = 8 * len(firsts) * pixels
    return sizes


def wave_sizes(plan: Plan, pixels: int, slots: int, ring_jobs: int) -> dict[str, int]:
    """Of the state of `slots` paths, of queues, and of what the jobs of a ring of passes leave, by name."""
    groups = slots // plan.tuning.group_slots
    sizes = {
        "state": 4 * len(layout.path_fields(plan.macros)) * stride(slots),
        "queues": 4 * len(layout.QUEUES) * slots,
        "queue_lengths": 4 * layout.QUEUE_LENGTHS_STRIDE * groups,
        "results": 4 * plan.channels * ring_jobs // plan.jobs_per_sample,
    }
    if firsts := layout.first_hit_fields(plan.macros):
        sizes["result_firsts"] = 4 * len(firsts) * ring_jobs
    if plan.pixel_list:
        sizes["pixel_list"] = 8 * pixels
    if counts := layout.counts_per_path(plan.macros):
        sizes["result_counts"] = 4 * counts * ring_jobs
    return sizes


def stride(slots: int) -> int:
    """From one field of the paths' state to the next: off the power of two, or all share a cache set."""
    return slots + 16


def render_bytes(plan: Plan, pixels: int, pool: Pool) -> int:
    """That a render takes beside its scene."""
    _, ring_jobs = pool.ring(pixels * plan.jobs_per_sample)
    film, waves = film_sizes(plan, pixels), wave_sizes(plan, pixels, pool.slots, ring_jobs)
    return sum(film.values()) + sum(waves.values())


def rows_at_a_time(
    memory: DeviceMemory, plan: Plan, size: tuple[int, int], pool: Pool, sharing: int = 1, beside: int = 0
) -> int:
    """Rows of a film of (width, height) pixels that have room on the device: all, or those of bands alike.

    sharing : so many films, of which this is one, are to have room.
    beside : bytes that are yet to be put there.

    Raises
    ------
    DeviceError
        Not one row has room, or the host has none for the picture; with a size that has.
    """
    room = _Room.of(memory, sharing, beside)
    rows = room.rows(plan, size, pool)
    if rows < size[1]:
        gc.collect()  # buffers of a render before may be held by nothing but a cycle
        room = _Room.of(memory, sharing, beside)
        rows = room.rows(plan, size, pool)
    if not rows:
        raise _without_room(room, plan, size, pool)
    return rows


@dataclass(frozen=True)
class _Room:
    """Bytes that a film may take: on the device, and on the host, inf where these are the same."""

    memory: DeviceMemory
    device: float
    host: float

    @classmethod
    def of(cls, memory: DeviceMemory, sharing: int, beside: int) -> _Room:
        free = None if memory.shared else available_memory()
        host = math.inf if free is None else free * (1 - KEPT_FREE)
        return cls(memory, max(memory.room() - beside, 0) / sharing, host / sharing)

    def rows(self, plan: Plan, size: tuple[int, int], pool: Pool) -> int:
        """Rows at a time, 0 for none."""
        width, height = size
        pixels = width * height
        whole = _film_bytes(self.memory, plan, pixels, pool) <= self.device
        if whole and max(_buffers(plan, pixels, pool)) <= self.memory.largest:
            return height
        kept = _kept_bytes(plan, pixels)
        if kept > self.host:
            return 0
        room = _MARGIN * self.device - (kept if self.memory.shared else 0)
        low, high = 0, height - 1
        while low < high:
            middle = (low + high + 1) // 2
            fits = _on_device(plan, width * middle, pool) <= room
            fits = fits and max(_buffers(plan, width * middle, pool)) <= self.memory.largest
            low, high = (middle, high) if fits else (low, middle - 1)
        return -(-height // -(-height // low)) if low else 0


def _without_room(room: _Room, plan: Plan, size: tuple[int, int], pool: Pool) -> DeviceError:
    """What is said of a film that cannot be rendered, not in bands either."""
    memory, pixels, share = room.memory, math.prod(size), 1.0
    safely = replace(room, device=_MARGIN * room.device)
    while share > _LEAST_SHARE:
        share *= _STEP
        width, height = (max(1, int(n * share)) for n in size)
        if safely.rows(plan, (width, height), pool):
            hint = f"{width} x {height} would fit: render fewer pixels, or tiles as crop windows of the film"
            break
    else:
        hint = "render fewer pixels"
    if _kept_bytes(plan, pixels) > room.host:
        need, had = format_bytes(_kept_bytes(plan, pixels)), format_bytes(room.host)
        what = (
            f"a film of {pixels} pixels, of which {memory.name} would have some rows at a time, needs {need} "
        )
        return DeviceError(f"{what}of this machine's memory, which has {had}", hint=hint)
    need = format_bytes(_film_bytes(memory, plan, pixels, pool))
    return DeviceError(
        f"a film of {pixels} pixels needs {need}; {memory.name} has {format_bytes(room.device)}, and at most "
        f"{format_bytes(memory.largest)} in one buffer",
        hint=f"{hint}; or use a device with more memory",
    )


def _on_device(plan: Plan, pixels: int, pool: Pool) -> int:
    """That a render takes there beside its scene, with the film of its survey."""
    survey = sum(film_sizes(plan, pixels).values()) if plan.pixel_list else 0
    return render_bytes(plan, pixels, pool) + survey


def _film_bytes(memory: DeviceMemory, plan: Plan, pixels: int, pool: Pool) -> int:
    """That a film and its paths take at most at a time; making the picture comes from a shared memory too."""
    picture = HOST_BYTES * pixels if memory.shared else 0
    return max(_on_device(plan, pixels, pool), sum(film_sizes(plan, pixels).values()) + picture)


def _kept_bytes(plan: Plan, pixels: int) -> int:
    """That the host takes for a film in bands: its sums, and those of a round or to make the picture."""
    film = sum(film_sizes(plan, pixels).values())
    return (1 + plan.pixel_list) * film + max(film, HOST_BYTES * pixels)


def _buffers(plan: Plan, pixels: int, pool: Pool) -> tuple[int, ...]:
    """Bytes of each buffer."""
    _, ring_jobs = pool.ring(pixels * plan.jobs_per_sample)
    waves = wave_sizes(plan, pixels, pool.slots, ring_jobs)
    return (*film_sizes(plan, pixels).values(), *waves.values())


def brick_bytes(prepared: PreparedScene) -> int:
    """Of all its volumes."""
    bricks = sum(volume.bricks.brick_count * volume.bricks.channels for volume in prepared.volumes)
    return 4 * BRICK_SAMPLES * bricks


def check_volumes(memory: DeviceMemory, prepared: PreparedScene, beside: int) -> None:
    """DeviceError where the bricks of a scene's volumes have no room, but so many other bytes do."""
    plural = "volume" if len(prepared.volumes) == 1 else "volumes"
    need = brick_bytes(prepared)
    room = min(memory.largest, memory.room() - beside)
    if need <= room or room <= 0:  # where nothing at all has room beside the film, the film's error says so
        return
    sizes = [volume.bricks.size for volume in prepared.volumes]
    fitting = _fitting(prepared, _MARGIN * room)
    hint = "render fewer pixels"
    if fitting:
        share = min(new / old for new, old in zip(fitting[0], sizes[0], strict=True))
        hint = f"on {_said(fitting)} points they would fit, {share:.2g} of these along each axis"
    had = _said(sizes)
    raise DeviceError(
        f"the bricks of the scene's {plural} ({had}) need {format_bytes(need)}; {memory.name} has "
        f"{format_bytes(room)} for them beside the render, and all of them must be there",
        hint=f"{hint}; or use a device with more memory",
    )


def _fitting(prepared: PreparedScene, room: float) -> list[Size]:
    """Sizes of all volumes, in proportion to those they have, that fit; none where nothing does."""
    bricks = [volume.bricks for volume in prepared.volumes]
    filled = [one.brick_count / math.prod(one.shape) for one in bricks]
    share = 1.0
    while share > _LEAST_SHARE:
        share *= _STEP
        sizes = [triple(max(2, int(n * share)) for n in one.size) for one in bricks]
        places = [math.prod(-(-(n - 1) // BRICK_CELLS) for n in size) for size in sizes]
        counts = zip(bricks, filled, places, strict=True)
        if 4 * BRICK_SAMPLES * sum(one.channels * part * count for one, part, count in counts) <= room:
            return sizes
    return []


def _said(sizes: list[Size]) -> str:
    return ", ".join("{} x {} x {}".format(*size) for size in sizes[:_MOST_SAID])


_STEP, _LEAST_SHARE = 0.98, 1e-3
"""By which smaller volumes are tried, and to what share of their edges."""
_MOST_SAID = 8
"""Volumes that a message has by their sizes."""
