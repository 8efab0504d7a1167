"""Buffers of a scene on one device: made for a render, or kept from one to the next where they still fit.

They are kept once a scene's parameters are traversed (`clvol.traverse`), as long as the scene is there.  What
is kept is never written to again: a render that goes on meanwhile keeps what it began with.
"""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterator

    import pyopencl as cl

    from clvol.device.device import Device
    from clvol.planning.plan import Plan
    from clvol.scene.records import Scene

_HINT = "use a device with more memory, or simpler meshes and pictures"
_Made = TypeVar("_Made")


class Residence:
    """What of one scene is on one device.

    Parameters
    ----------
    uploaded : bytes that were written to the device so far.
    """

    def __init__(self, device: Device) -> None:
        self.device = device
        self.uploaded = 0
        self._arrays: dict[str, np.ndarray] = {}
        self._buffers: dict[str, cl.Buffer] = {}
        self._made: dict[str, tuple[Any, Any]] = {}

    @classmethod
    def of(cls, scene: Scene, device: Device) -> Residence:
        """The one that the scene keeps; a fresh one where it keeps none."""
        if not scene.kept.on_device:
            return cls(device)
        known: Residence | None = scene.kept.get(__name__)
        if known is None or known.device is not device:
            known = scene.kept[__name__] = cls(device)
        return known

    def has(self, name: str) -> bool:
        """Whether something of that name is there, up to date or not: it may be replaced."""
        return name in self._buffers or name in self._made

    def put(self, name: str, array: np.ndarray, what: str = "the scene", hint: str = _HINT) -> cl.Buffer:
        """A buffer with the bytes of an array: the one that is there, if it has them."""
        array = np.ascontiguousarray(array)
        if name not in self._buffers or not _same_bytes(self._arrays[name], array):
            self._buffers.pop(name, None)  # its memory may be needed for the next
            self._buffers[name] = self.device.memory.upload(array, what, hint)
            self._arrays[name] = array
            self.uploaded += array.nbytes
        return self._buffers[name]

    def made(self, name: str, key: Hashable, make: Callable[[], _Made]) -> _Made:
        """What `make` makes; what it made before, if the key is equal."""
        if name not in self._made or self._made[name][0] != key:
            self._made.pop(name, None)
            self._made[name] = key, make()
        found: _Made = self._made[name][1]
        return found


@contextmanager
def staying(scene: Scene) -> Iterator[None]:
    """What the scene takes on a device stays there between the renders in the block."""
    before, scene.kept.on_device = scene.kept.on_device, True
    try:
        yield
    finally:
        scene.kept.on_device = before
        if not before:
            scene.kept.pop(__name__, None)


def compiled(plan: Plan) -> Hashable:
    """What decides the text of a plan's kernels."""
    return tuple(plan.macros.items()), tuple(plan.slots.items())


class Same:
    """Objects as a key: equal to the same ones in the same order, whatever they hold."""

    def __init__(self, *objects: object) -> None:
        self.objects = objects

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Same)
            and len(self.objects) == len(other.objects)
            and all(one is two for one, two in zip(self.objects, other.objects, strict=True))
        )

    def __hash__(self) -> int:
        return hash(tuple(map(id, self.objects)))


def _same_bytes(one: np.ndarray, other: np.ndarray) -> bool:
    if one is other:
        return True
    if one.dtype != other.dtype or one.shape != other.shape:
        return False
    return bool(np.array_equal(one.reshape(-1).view(np.uint8), other.reshape(-1).view(np.uint8)))
