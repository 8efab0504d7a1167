"""Volume files and arrays to sampled fields on the host (`grid`): OpenVDB, NanoVDB, .vol, NumPy.

Readers live here, with the checks that broken and hostile files need, and the brick maps made of what they
read; majorants and the device do not.
"""

from clvol.volumes.check import check_coefficients, check_finite
from clvol.volumes.grid import DenseGrid, Grid, SparseGrid
from clvol.volumes.grid_info import GridInfo
from clvol.volumes.listing import Listed, list_grids
from clvol.volumes.loading import load_volume
from clvol.volumes.numpy_files import dense_from_array, read_numpy
from clvol.volumes.nvdb import list_nvdb, read_nvdb
from clvol.volumes.read import read_volume
from clvol.volumes.vdb import list_vdb, read_vdb
from clvol.volumes.vol import read_vol, write_vol

__all__ = [
    "DenseGrid",
    "Grid",
    "GridInfo",
    "Listed",
    "SparseGrid",
    "check_coefficients",
    "check_finite",
    "dense_from_array",
    "list_grids",
    "list_nvdb",
    "list_vdb",
    "load_volume",
    "read_numpy",
    "read_nvdb",
    "read_vdb",
    "read_vol",
    "read_volume",
    "write_vol",
]
