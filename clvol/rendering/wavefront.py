"""The wavefront: path slots, queues, and the schedule that keeps the device busy.

Jobs (one sample of one pixel each, or one channel of it) are numbered; a free slot takes the next number.
A *pass* is a run of jobs that gives every pixel the same number of samples; its results stand in a ring
buffer and are added to the film once all of them have arrived, in the order of the samples.  Several passes
are in flight together, so that no slot waits for a pass to end.
"""

from __future__ import annotations

import logging
import math
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np
import pyopencl as cl

from clvol import layout
from clvol.device.launch import scene_arguments, set_arguments
from clvol.rendering.film import Film
from clvol.rendering.handled import Handled
from clvol.rendering.launches import BATCH_SECONDS, Launches
from clvol.rendering.patience import Patience
from clvol.rendering.profiler import timed
from clvol.rendering.sizes import stride, wave_sizes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from clvol.device.device import Device
    from clvol.planning.plan import Plan
    from clvol.rendering.pool import Pool
    from clvol.rendering.profiler import Profiler

log = logging.getLogger("clvol")
_NEXT_JOB, _JOB_LIMIT, _NON_FINITE, _DONE = (layout.enum("COUNTER", n) for n in layout.ENUMS["COUNTER"])
_MAX_ROUND_JOBS = 1 << 31
_HARVEST_SECONDS = 2.0
"""Statistics of the slots are collected at least this often: their 32-bit counters must not run over."""


class Wavefront:
    """Runs one render: buffers of state, queues and film on one device, and the launch loop.

    Parameters
    ----------
    kernels : stage name to kernel, `accumulate` included.
    arguments : stage name to what its kernel takes of the scene and the pool, in order.
    buffers : scene buffers by argument name.
    render : the Render record, without its schedule fields.
    profiler : is told of all that goes to the device.
    when_slow : asked, with the seconds that the stages took, for kernels to go on with in place of these.
    held : pixels that the device has at a time, where these are not all (`clvol.rendering.bands`).
    """

    def __init__(
        self,
        device: Device,
        plan: Plan,
        kernels: dict[str, cl.Kernel],
        arguments: Mapping[str, Sequence[str]],
        buffers: dict[str, cl.Buffer],
        render: np.ndarray,
        pool: Pool,
        profiler: Profiler | None = None,
        when_slow: Callable[[float], dict[str, cl.Kernel]] = lambda seconds: {},
        held: int | None = None,
    ) -> None:
        self.device, self.plan, self.kernels, self.pool = device, plan, kernels, pool
        self.profiler, self._when_slow = profiler, when_slow
        self._arguments = arguments
        self.render = render
        self.pixels = int(render["film_size"][0, 0]) * int(render["film_size"][0, 1])
        self.held = held or self.pixels
        self.bands = -(-self.pixels // self.held)
        self.buffers: dict[str, cl.Buffer] = {}
        self._list(self.held)
        self.groups = pool.slots // plan.tuning.group_slots
        self.fields = layout.path_fields(plan.macros)
        low, high = (int(word) for word in render["seed"][0])
        self.film = self.new_film((low, high))
        self._harvested = time.perf_counter()
        self.stride = stride(pool.slots)
        self.handled = Handled(self.groups)
        self._allocate(buffers)
        self.launched = Launches(device, plan, self.groups, self.buffers, profiler)
        self._use(kernels)

    def _allocate(self, scene_buffers: dict[str, cl.Buffer]) -> None:
        self.ring_passes, ring_jobs = self.pool.ring(self.sample_jobs)
        sizes = {
            "render": self.render.nbytes,
            "counters": 4 * (_DONE + self.ring_passes),
            **wave_sizes(self.plan, self.held, self.pool.slots, ring_jobs),
        }
        self.buffers = {name: self._buffer(size) for name, size in sizes.items()} | scene_buffers
        self.bytes = sum(sizes.values()) + sum(b.size for b in scene_buffers.values())
        state = np.zeros((len(self.fields), self.stride), np.uint32)
        state[[f.name for f in self.fields].index("job")] = layout.NO_JOB
        self._write("state", state)
        self._write("counters", np.zeros(_DONE + self.ring_passes, np.uint32))
        self._write("queue_lengths", self.handled.all_idle(self.plan.tuning.group_slots))
        self._list(self.held, self._entries(np.arange(self.held)))

    def _use(self, kernels: dict[str, cl.Kernel]) -> None:
        """Launch these from now on."""
        self.kernels = kernels
        for stage in self.plan.stages:
            given = scene_arguments(self._arguments[stage], self.buffers, self.stride)
            set_arguments(kernels[stage], *given)

    def restart(self, seed: tuple[int, int]) -> None:
        """Forget every sample and what was counted; the next run draws the random numbers of another seed."""
        self._harvest()
        self.film.clear(seed)
        self._write("counters", np.zeros(_DONE + self.ring_passes, np.uint32))
        self._reset_clocks()

    def new_film(self, seed: tuple[int, int]) -> Film:
        """An empty film for samples of another seed."""
        return Film(self.device, self.plan, self.pixels, seed)

    def use_film(self, film: Film) -> None:
        """Go on with another film, which the next run adds to."""
        self._harvest()
        self.film = film

    def _reset_clocks(self) -> None:
        self.launched.clear()
        self.handled.clear()

    def _buffer(self, size: int) -> cl.Buffer:
        return self.device.memory.allocate(size, f"a film of {self.pixels} pixels", "render fewer pixels")

    def _write(self, name: str, array: np.ndarray, offset: int = 0) -> None:
        queue, buffer = self.device.queue, self.buffers[name]
        self._copied(cl.enqueue_copy(queue, buffer, array, dst_offset=offset, is_blocking=True), array.nbytes)

    def _read(self, name: str, array: np.ndarray, offset: int = 0) -> np.ndarray:
        """Fill `array`, and return it."""
        queue, buffer = self.device.queue, self.buffers[name]
        self._copied(cl.enqueue_copy(queue, array, buffer, src_offset=offset, is_blocking=True), array.nbytes)
        return array

    def _copied(self, event: cl.Event, size: int) -> None:
        if self.profiler:
            self.profiler.copied(event, size)

    def list_pixels(self, pixels: np.ndarray | None) -> None:
        """What the next run renders: these pixels, each from the first sample on that its film lacks.

        int (n,), or None for all; a list needs kernels with `plan.pixel_list`.
        """
        chosen = np.arange(self.pixels) if pixels is None else pixels
        self._list(len(chosen), self._entries(chosen))

    def _entries(self, pixels: np.ndarray) -> np.ndarray | None:
        """What a list says of pixels: their numbers, and the samples they have; None without lists."""
        if not self.plan.pixel_list:
            return None
        return np.stack([pixels, self.film.samples[pixels]], axis=1).astype(np.uint32)

    def _list(self, listed: int, entries: np.ndarray | None = None) -> None:
        """Let so many pixels be rendered: all on the device, or those of a list's entries."""
        self.listed = listed
        self.sample_jobs = listed * self.plan.jobs_per_sample  # of one sample of each
        self.pass_samples = max(1, self.pool.pass_jobs // self.sample_jobs)
        if entries is not None:
            self._write("pixel_list", entries)

    def passes(
        self,
        first: int,
        count: int,
        should_stop: Callable[[], int],
        seconds_left: Callable[[], float] = lambda: math.inf,
    ) -> Iterator[int]:
        """Render samples `first` .. `first + count` of every pixel listed; how many, whenever it is more.

        `should_stop` is asked between batches.  Once it says 1 no new pass is begun, and the passes in
        flight are finished, not dropped (dropping favours short paths), as long as patience lasts; at 2 only
        what is finished is kept, with a warning, and at 3 without.  So it is where the iterator is closed.
        `seconds_left` is for passes that are long enough to be planned.
        """
        done, self._patience = 0, Patience()
        per_round = max(1, _MAX_ROUND_JOBS // (self.pass_samples * self.sample_jobs)) * self.pass_samples
        while done < count and not (done and should_stop()):
            part, finished = min(count - done, per_round), 0
            for finished in self._round(first + done, part, should_stop, done > 0):
                yield done + finished
            done += finished
            if finished < part:
                break

    def _round(self, first: int, count: int, should_stop: Callable[[], int], earlier: bool) -> Iterator[int]:
        """One numbering of jobs, fewer than 2³¹ of them: how many samples are done, whenever it is more.

        `earlier`: a round before has samples.
        """
        passes = -(-count // self.pass_samples)
        samples = [self.pass_samples] * passes
        samples[-1] = count - (passes - 1) * self.pass_samples
        pass_jobs = self.pass_samples * self.sample_jobs
        self._start_round(first, pass_jobs, passes - 1, samples[-1])
        begun = finished = allowed = 0
        waves = 1
        idle = False
        try:
            while not idle:
                urgency = should_stop() if begun else 0
                if urgency:  # what is queued may have begun more
                    begun = self._begun(allowed, pass_jobs, self._read_counters())
                    if idle := finished == begun:
                        return
                allowed = begun if urgency else min(passes, finished + self.ring_passes)
                self._allow(sum(samples[:allowed]) * self.sample_jobs)
                with timed(self.profiler, "waves"):
                    launched, elapsed, counters = self.launched.batch(self.kernels, waves, not urgency)
                if others := self._when_slow(sum(self.launched.seconds.values())):
                    self._use(others)
                waves = int(np.clip(launched * BATCH_SECONDS / max(elapsed, 1e-6), 1, max(2 * launched, 4)))
                if time.perf_counter() - self._harvested > _HARVEST_SECONDS:
                    self._harvest()
                begun = self._begun(allowed, pass_jobs, counters)
                while finished < begun:
                    place = finished % self.ring_passes
                    if counters[_DONE + place] != samples[finished] * self.sample_jobs:
                        break
                    self._accumulate(place, samples[finished], first + finished * self.pass_samples)
                    finished += 1
                    yield sum(samples[:finished])
                idle = finished == passes or bool(urgency and finished == begun)
                if not idle and self._patience.ends(urgency, finished > 0 or earlier):
                    if urgency <= 2:
                        log.warning("dropped %d unfinished passes, whose paths did not end", begun - finished)
                    return
        finally:
            if idle:
                self.launched.settle()
            else:
                with suppress(cl.Error):  # a device that is lost has no paths
                    self._abandon()

    @staticmethod
    def _begun(most: int, pass_jobs: int, counters: np.ndarray) -> int:
        """How many passes have begun, by the counters, of as many as were allowed."""
        return min(most, -(-int(counters[_NEXT_JOB]) // pass_jobs))

    def _abandon(self) -> None:
        """Give up the paths in flight, and with them the passes that they belong to."""
        try:
            self.launched.settle()
        finally:
            self.launched.forget()
            fresh = {"job": layout.NO_JOB, "leg": 0, "shadow_leg": 0}
            for row, field in enumerate(self.fields):
                if field.name in fresh:
                    values = np.full(self.stride, fresh[field.name], np.uint32)
                    self._write("state", values, values.nbytes * row)

    def warm_up(self) -> None:
        """Run every kernel once with nothing to do.

        Some drivers (PoCL) compile at the first launch, which is part of setting up and not of the render.
        """
        self._start_round(0, self.pass_samples * self.sample_jobs, 0, self.pass_samples)
        self.launched.batch(self.kernels, 1, ahead=False)
        self._accumulate(0, 0, 0)
        self.launched.settle()
        self._reset_clocks()

    def _start_round(self, first: int, pass_jobs: int, last_pass: int, last_samples: int) -> None:
        self.render["seed"], self.render["first_pixel"] = self.film.seed, self.film.first_pixel
        self.render["first_sample"], self.render["pass_samples"] = first, self.pass_samples
        self.render["pass_jobs"], self.render["ring_passes"] = pass_jobs, self.ring_passes
        self.render["last_pass"], self.render["last_samples"] = last_pass, last_samples
        self._write("render", self.render)
        counters = np.zeros(_DONE + self.ring_passes, np.uint32)
        counters[_NON_FINITE] = self.non_finite()  # counts over all rounds
        self._write("counters", counters)
        self._allowed = 0
        self._read_handled()
        self._write("queue_lengths", self.handled.all_idle(self.plan.tuning.group_slots))

    def _allow(self, jobs: int) -> None:
        """Let paths begin up to this number of jobs."""
        if jobs != self._allowed:
            self._allowed = jobs
            self._set_counter(_JOB_LIMIT, jobs)

    def _set_counter(self, number: int, value: int) -> None:
        """Set a counter once what is queued has run, without waiting for it."""
        pattern = np.array([value], np.uint32)
        cl.enqueue_fill_buffer(self.device.queue, self.buffers["counters"], pattern, 4 * number, 4)

    def _read_counters(self) -> np.ndarray:
        return self._read("counters", np.empty(_DONE + self.ring_passes, np.uint32))

    def _accumulate(self, ring_pass: int, samples: int, first: int) -> None:
        """Add one finished pass, from sample `first` on, to the film and free its place in the ring."""
        film = self.film.buffers
        kernel = self.kernels["accumulate"]
        set_arguments(
            kernel,
            self.buffers["results"],
            *(film[name] for name in ("film", "film_peaks")),
            *((self.buffers["result_counts"],) if "result_counts" in self.buffers else ()),
            *((film["film_counts"],) if "film_counts" in film else ()),
            *((self.buffers["result_firsts"], film["film_firsts"]) if "film_firsts" in film else ()),
            *((self.buffers["pixel_list"],) if self.plan.pixel_list else ()),
            self.buffers["counters"],
            np.uint32(ring_pass),
            np.uint32(self.pass_samples * self.sample_jobs),
            np.uint32(samples),
            np.uint32(first),
            np.uint32(self.listed),
        )
        self.launched.accumulate(kernel, self.listed, samples)
        self._set_counter(_DONE + ring_pass, 0)

    def slot_statistics(self) -> dict[str, float]:
        """Statistics that slots keep for themselves, combined over the slots."""
        self._harvest()
        return dict(self.film.slot_totals)

    def spent(self) -> dict[str, Any]:
        """What the samples so far took, and what slots counted: numbers for a checkpoint."""
        slots = self.slot_statistics()
        return {
            "stages": dict(self.launched.seconds),
            "launches": self.launched.launches,
            "waves": self.launched.waves,
            "items": self.handled.by_stage(self.plan.stages),
            "non_finite": self.non_finite(),
            "slots": slots,
        }

    def take_up(self, film: dict[str, np.ndarray], spent: Mapping[str, Any]) -> None:
        """Go on where another wavefront was: with its film's buffers, and what it had `spent`."""
        stages, slots = spent["stages"], spent["slots"]
        self.launched.seconds = {stage: float(stages[stage]) for stage in self.launched.seconds}
        self.launched.launches, self.launched.waves = int(spent["launches"]), int(spent["waves"])
        self.handled.take_up(spent["items"])
        self.film.slot_totals = {name: float(slots[name]) for name in self.film.slot_totals}
        self._set_counter(_NON_FINITE, int(spent["non_finite"]))
        self.film.put_back(film)

    def _harvest(self) -> None:
        """Collect what has run, and what the slots have counted since the last time; they begin anew."""
        self.launched.settle()
        rows = {f.name: n for n, f in enumerate(self.fields)}
        zeros = np.zeros(self.stride, np.uint32)
        totals = self.film.slot_totals
        for name in totals:
            field, at = self.fields[rows[name]], 4 * self.stride * rows[name]
            row = self._read("state", np.empty(self.stride, np.uint32), at)
            self._write("state", zeros, at)
            found = (row.view(np.float32) if field.kind == "f" else row)[: self.pool.slots].astype(np.float64)
            combine = layout.SLOT_STATISTICS[name]
            totals[name] = combine([totals[name], combine(found)]).item()
        self._read_handled()
        self._harvested = time.perf_counter()

    def _read_handled(self) -> None:
        shape = self.groups, layout.QUEUE_LENGTHS_STRIDE
        self.handled.add(self._read("queue_lengths", np.empty(shape, np.uint32)))

    def non_finite(self) -> int:
        """Samples that were NaN or infinite."""
        return int(self._read_counters()[_NON_FINITE])
