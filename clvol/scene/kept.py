"""What is worked out about a scene, and goes with it: tables, and buffers where they stay on a device."""

from __future__ import annotations

from typing import Any


class Kept(dict[str, Any]):
    """By the module that keeps it.  A scene shares it with those that `dataclasses.replace` makes of it.

    Whoever keeps something sees to it that it still fits: records may have changed.

    Parameters
    ----------
    on_device : buffers stay between renders (`clvol.traverse`).
    """

    on_device = False

    def __reduce__(self) -> tuple[type[Kept], tuple[()]]:
        """A copy, and what another process gets, begins without anything."""
        return Kept, ()

    def __deepcopy__(self, _memo: object) -> Kept:
        return Kept()

    def __copy__(self) -> Kept:
        return Kept()
