"""Bounds of cells or boxes that are kept together, whatever they are the cells of."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable


class Cells(NamedTuple):
    """Extrema and perhaps means of cells, float32 (..., channels).  Beyond the lattice: infinity, 0, 0."""

    minimum: np.ndarray
    maximum: np.ndarray
    mean: np.ndarray | None

    def at(self, index: Any) -> Cells:
        """Some of them, by any index of NumPy's."""
        return self.each(lambda values: values[index])

    def arrays(self) -> list[np.ndarray]:
        """What there is: minimum, maximum, and mean where there are means."""
        return [part for part in self if part is not None]

    def each(self, change: Callable[[np.ndarray], np.ndarray]) -> Cells:
        """What `change` makes of each array that there is."""
        mean = None if self.mean is None else change(self.mean)
        return Cells(change(self.minimum), change(self.maximum), mean)

    @staticmethod
    def joined(parts: Iterable[Cells]) -> Cells:
        """The cells of all parts, at least one, in their order; either all parts have means or none has."""
        arrays = zip(*(part.arrays() for part in parts), strict=True)
        low, high, *mean = (np.concatenate(array) for array in arrays)
        return Cells(low, high, mean[0] if mean else None)
