"""What a volume comes from: a file, an array or several, as grids and as the plugins that name them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.base.files import files_noted
from clvol.errors import OptionError, shown
from clvol.scene.loader import load_plugin
from clvol.scene.records import ConstVolume, GridVolume, Volume
from clvol.scene.transforms import scale
from clvol.staging.coarse import Coarse, coarse, extremes
from clvol.staging.transfer import Look, made_grid, value_range
from clvol.volumes import Listed, check_finite, list_grids
from clvol.volumes.grid import DenseGrid, Grid
from clvol.volumes.repair import sanitized

if TYPE_CHECKING:
    from clvol.base.output_files import StrPath
    from clvol.scene.library import Grids

UNIT_BOX = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])


@dataclass(frozen=True, eq=False)
class Source:
    """A volume's file, or its arrays by name ("" for one alone).

    `grids` are those that were read, so that the scene need not read them again, and `files` what from.
    """

    path: StrPath | None = None
    arrays: Mapping[str, Any] = field(default_factory=dict)
    grids: Grids = field(default_factory=dict)
    files: dict[str, None] = field(default_factory=dict)

    @classmethod
    def of(cls, volume: Any) -> Source:
        """A file's name, an array [z, y, x], or a dict of arrays by name."""
        if isinstance(volume, str | os.PathLike):
            return cls(os.fspath(volume))
        if not isinstance(volume, Mapping):
            return cls(None, {"": volume})
        if not volume or not all(isinstance(name, str) for name in volume):
            hint = "as {'density': array, 'temperature': array}"
            raise OptionError(f"a volume's arrays go by their names, not as {shown(volume)}", hint=hint)
        return cls(None, volume)

    @property
    def name(self) -> str:
        """For messages."""
        return "the volume" if self.path is None else str(self.path)

    def listed(self) -> list[Listed]:
        """Its grids."""
        return [Listed(name) for name in self.arrays] if self.path is None else list_grids(self.path)

    def open(self, name: str, use: Mapping[str, Any] = MappingProxyType({})) -> Field:
        """Read one grid, and place it; `use`: parameters of its plugin on what its samples are taken for."""
        if self.path is None:
            plugin = {"type": "gridvolume", "data": self.arrays[name]}
        else:
            plugin = {"type": "gridvolume", "filename": str(self.path)}
            plugin |= {"grid": name} if name else {}
        with files_noted() as noted:
            found = Field.of(name, plugin | dict(use), self.grids)
        self.files.update(noted)
        return found


@dataclass(frozen=True, eq=False)
class Field:
    """One grid of a volume: the plugin that gives it to a scene, and what and where it is, without NaN.

    `cubic`: its file says nothing of its size, and its voxels are taken as cubes.  `look`: what is made of
    its values; `means` and `peak` are of what is made.
    """

    name: str
    plugin: dict[str, Any]
    volume: Volume
    cubic: bool = False
    look: Look | None = None

    @classmethod
    def of(cls, name: str, plugin: dict[str, Any], grids: Grids) -> Field:
        """Read a grid and place it: where its file says, else with cubic voxels and the longest side 1."""
        volume = load_plugin(plugin, grids)
        if isinstance(volume, ConstVolume):
            return cls(name, plugin, volume)
        grid = volume.grid
        more: dict[str, Any] = {}
        mended = sanitized(grid, signed=True)[0] if volume.sanitize else grid
        check_finite(mended, "the volume")
        cubic = False
        if isinstance(grid, DenseGrid) and grid.index_to_world is None:
            if np.array_equal(grid.box, UNIT_BOX):
                size = np.array(grid.values.shape[2::-1])
                cubic = len(set(size.tolist())) > 1
                more = {"to_world": scale(size / size.max())} if cubic else {}
            else:
                more = {"use_grid_bbox": True}
        if isinstance(grid, DenseGrid) and grid.index_to_world is None and "data" in plugin:
            more["data"] = grid  # without masks: what was said of it is said once
        if more:
            plugin = plugin | more
            volume = load_plugin(plugin, grids)
        if mended is not grid:
            volume = replace(volume, grid=mended)
        return cls(name, plugin, volume, cubic)

    @property
    def empty(self) -> bool:
        """Whether it is 0 everywhere, without a sample that is active."""
        return isinstance(self.volume, ConstVolume)

    @property
    def channels(self) -> int:
        """1 or 3."""
        if isinstance(self.volume, ConstVolume):
            return 1
        return self.volume.grid.channels

    @cached_property
    def means(self) -> Coarse:
        """The grid in few cells."""
        assert isinstance(self.volume, GridVolume)
        return coarse(self._shown)

    @cached_property
    def _shown(self) -> Grid:
        """The grid, or what is made of its samples."""
        assert isinstance(self.volume, GridVolume)
        return self.volume.grid if self.look is None else made_grid(self.volume.grid, self.look.opacity)

    def seen_as(self, look: Look | None, limits: tuple[float, float] | None = None) -> Field:
        """With a look of its values, relative ones between the limits, or else the field's own extremes."""
        if look is None or isinstance(self.volume, ConstVolume):
            return self
        return replace(self, look=look.within(*(limits or self.limits)))

    @cached_property
    def limits(self) -> tuple[float, float]:
        """The least and the greatest value, but for a little noise."""
        return (0.0, 0.0) if isinstance(self.volume, ConstVolume) else value_range(self.volume.grid)

    @cached_property
    def peak(self) -> float:
        """The greatest sample."""
        if isinstance(self.volume, ConstVolume):
            return 0.0
        grid = self._shown
        stores = [grid.values] if isinstance(grid, DenseGrid) else [grid.leaf_values, grid.tile_values]
        return float(max((store.max() for store in stores if store.size), default=0.0))

    def outermost(self) -> np.ndarray:
        """The outermost points (n, 3) in the world of what is more than next to nothing."""
        assert isinstance(self.volume, GridVolume)
        points = self.means.filled()
        matrix = self.volume.index_to_world
        return extremes(points @ matrix[:3, :3].T + matrix[:3, 3])
