"""Medical images, TIFF stacks, HDF5, Zarr, VTI and DataArrays are volumes, and lie where they say."""

from __future__ import annotations

import locale
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import clvol
from clvol.errors import OptionError, SceneError, VolumeError
from clvol.volumes import list_grids, read_volume

if TYPE_CHECKING:
    from pathlib import Path

ANGLE = 0.3
TURN = np.array([[np.cos(ANGLE), -np.sin(ANGLE), 0], [np.sin(ANGLE), np.cos(ANGLE), 0], [0, 0, 1]])
FLIP = TURN @ np.diag([1.0, -1, 1])
"""Directions as scanners write them: turned, and turned with an axis that runs the other way."""
SPACING, ORIGIN = (0.5, 1.0, 2.0), (10.0, 20.0, 30.0)


def steps() -> np.ndarray:
    return np.arange(60, dtype=np.int16).reshape(3, 4, 5) - 20


def expected(direction: np.ndarray = TURN) -> np.ndarray:
    to_world = np.eye(4)
    to_world[:3, :3], to_world[:3, 3] = direction * SPACING, ORIGIN
    return to_world


def itk_image(direction: np.ndarray = TURN) -> tuple[Any, Any]:
    sitk = pytest.importorskip("SimpleITK", reason="SimpleITK is not installed")
    image = sitk.GetImageFromArray(steps())
    image.SetSpacing(SPACING)
    image.SetOrigin(ORIGIN)
    image.SetDirection(direction.ravel())
    return sitk, image


@pytest.mark.parametrize("name", ["a.nii", "a.nii.gz", "a.nrrd", "a.mha", "a.mhd"])
@pytest.mark.parametrize("direction", [TURN, FLIP], ids=["turned", "flipped"])
def test_medical_images_keep_spacing_origin_and_direction(
    tmp_path: Path, name: str, direction: np.ndarray
) -> None:
    sitk, image = itk_image(direction)
    sitk.WriteImage(image, str(tmp_path / name))
    grid = read_volume(tmp_path / name)
    assert (grid.values[..., 0] == steps()).all()
    np.testing.assert_allclose(grid.index_to_world, expected(direction), atol=2e-6)
    assert grid.unit == "mm"


def write_series(folder: Path, numbers: range) -> None:
    sitk, image = itk_image()
    before = locale.setlocale(locale.LC_ALL)
    writer = sitk.ImageFileWriter()
    writer.KeepOriginalImageUIDOn()
    folder.mkdir()
    for n in numbers:
        part = image[:, :, n : n + 1]
        tags = {
            "0020|000e": "1.2.826.0.1",
            "0020|0037": "\\".join(map(str, TURN[:, :2].T.ravel())),
            "0020|0032": "\\".join(map(str, image.TransformIndexToPhysicalPoint((0, 0, n)))),
            "0008|0060": "CT",
        }
        for tag, value in tags.items():
            part.SetMetaData(tag, value)
        writer.SetFileName(str(folder / f"{9 - n}.dcm"))  # the order of names is not that of slices
        writer.Execute(part)
    locale.setlocale(locale.LC_ALL, before)  # ITK's writer leaves another behind


def test_a_folder_of_dicom_slices_is_a_volume(tmp_path: Path) -> None:
    write_series(tmp_path / "scan", range(3))
    before = locale.setlocale(locale.LC_ALL)
    grid = read_volume(tmp_path / "scan")
    assert locale.setlocale(locale.LC_ALL) == before
    assert (grid.values[..., 0] == steps()).all()
    np.testing.assert_allclose(grid.index_to_world, expected(), atol=1e-6)
    (tmp_path / "empty").mkdir()
    with pytest.raises(VolumeError, match="without DICOM slices"):
        read_volume(tmp_path / "empty")


def test_a_turned_volume_is_where_its_file_says(tmp_path: Path) -> None:
    """One bright voxel of a turned image shines where ITK puts it, and nowhere else."""
    sitk, image = itk_image()
    values, index = np.zeros((3, 4, 5), np.float32), (1, 3, 2)
    values[index[::-1]] = 1
    lit = sitk.GetImageFromArray(values)
    lit.CopyInformation(image)
    sitk.WriteImage(lit, str(tmp_path / "lit.nii"))
    place = np.array(image.TransformIndexToPhysicalPoint(index))
    eye = place + np.array([0, 0, 50])
    glow = {"type": "gridvolume", "filename": str(tmp_path / "lit.nii"), "filter_type": "nearest"}
    scene = clvol.load_dict(
        {
            "type": "scene",
            "sensor": {
                "type": "perspective",
                "fov": 2.4,  # about two units across
                "to_world": clvol.look_at(origin=eye, target=place, up=[0, 1, 0]),
                "film": {"type": "hdrfilm", "width": 21, "height": 21, "rfilter": {"type": "box"}},
            },
            "body": {
                "type": "cube",
                "to_world": clvol.translate(place) @ clvol.scale(20),
                "bsdf": {"type": "null"},
                "interior": {"type": "heterogeneous", "sigma_t": glow, "albedo": 0.0, "emission": glow},
            },
        }
    )
    picture = clvol.render(scene, spp=16, seed=1).image[..., 0]
    rows, columns = np.nonzero(picture > 0.2 * picture.max())
    middle = np.array([columns.mean(), rows.mean()])
    assert picture.max() > 0 and np.abs(middle - 10).max() < 0.75, middle
    # half a unit wide and one unit high, and turned: neither all of the picture nor a spot
    assert 0.08 < np.mean(picture > 0.2 * picture.max()) < 0.25


def test_cut_medical_images_are_errors(tmp_path: Path) -> None:
    """ITK itself has zeros for the samples that a cut NIfTI file lacks."""
    sitk, image = itk_image()
    for name in ("a.nii", "a.nii.gz", "a.nrrd", "a.mha"):
        path = tmp_path / name
        sitk.WriteImage(image, str(path))
        whole = path.read_bytes()
        for length in (len(whole) - 9, len(whole) // 2, 30):
            path.write_bytes(whole[:length])
            before = locale.setlocale(locale.LC_ALL)
            with pytest.raises(VolumeError):
                read_volume(path)
            assert locale.setlocale(locale.LC_ALL) == before, "ITK has left another locale behind"


def test_tiff_stacks_keep_imagejs_and_omes_spacing(tmp_path: Path) -> None:
    tifffile = pytest.importorskip("tifffile", reason="tifffile is not installed")
    tifffile.imwrite(
        tmp_path / "a.tif",
        steps(),
        imagej=True,
        resolution=(2, 4),
        metadata={"spacing": 3, "unit": "um", "axes": "ZYX"},
    )
    grid = read_volume(tmp_path / "a.tif")
    assert (grid.values[..., 0] == steps()).all()
    assert np.allclose(np.diag(grid.index_to_world), [0.5, 0.25, 3, 1]) and grid.unit == "µm"
    sizes = {f"PhysicalSize{axis}": size for axis, size in zip("XYZ", (0.1, 0.2, 0.3), strict=True)}
    both = np.stack([steps(), steps() + 1])
    tifffile.imwrite(tmp_path / "b.ome.tif", both, metadata={"axes": "CZYX", **sizes})
    grid = read_volume(tmp_path / "b.ome.tif", "[1]")
    assert (grid.values[..., 0] == steps() + 1).all()
    assert np.allclose(np.diag(grid.index_to_world), [0.1, 0.2, 0.3, 1]) and grid.unit == "µm"
    with pytest.raises(VolumeError, match=r"c, z, y, x.*such as \[0\]"):
        read_volume(tmp_path / "b.ome.tif")


def test_cut_tiff_stacks_are_errors(tmp_path: Path) -> None:
    """The library itself returns the pictures that it finds."""
    tifffile = pytest.importorskip("tifffile", reason="tifffile is not installed")
    path = tmp_path / "a.tif"
    with tifffile.TiffWriter(path) as writer:
        for plane in steps():
            writer.write(plane, contiguous=False)
    assert (read_volume(path).values[..., 0] == steps()).all()
    whole = path.read_bytes()
    for length in (len(whole) - 8, len(whole) - 150, len(whole) // 2, 20):
        path.write_bytes(whole[:length])
        with pytest.raises(VolumeError):
            read_volume(path)


def write_hdf5(path: Path) -> None:
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    with h5py.File(path, "w") as file:
        density = file.create_dataset("entry/density", data=steps(), chunks=True, compression="gzip")
        file["entry/z"] = [4.0, 2.0, 0.0]
        file["entry/z"].make_scale("z")
        file["entry/z"].attrs["units"] = "m"
        density.dims[0].attach_scale(file["entry/z"])
        file["frames"] = np.stack([steps(), steps() + 1])
        file["packed"] = steps()
        file["packed"].attrs.update({"scale_factor": 0.5, "add_offset": 3.0, "_FillValue": np.int16(-20)})


def test_hdf5_is_addressed_by_path(tmp_path: Path) -> None:
    write_hdf5(tmp_path / "scan.h5")
    address = f"{tmp_path}/scan.h5"
    grid = read_volume(f"{address}:/entry/density")
    assert (grid.values[..., 0] == steps()[::-1]).all()  # its z falls
    assert np.diag(grid.index_to_world).tolist() == [1, 1, 2, 1] and grid.unit == "m"
    assert (read_volume(address, "frames[1]").values[..., 0] == steps() + 1).all()
    packed = read_volume(f"{address}:/packed").values[..., 0]
    assert packed[0, 0, 0] == 0 and packed[1, 0, 0] == 0.5 * steps()[1, 0, 0] + 3
    assert [grid.name for grid in list_grids(address)] == ["/entry/density", "/frames", "/packed"]
    for wrong, says in (
        ("", "holds 3 arrays"),
        (":/nothing", "has no array"),
        (":/frames", "takes 1 numbers"),
    ):
        with pytest.raises(VolumeError, match=says):
            read_volume(address + wrong)


def test_a_scene_names_an_array_in_a_file(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    with h5py.File(tmp_path / "scan.h5", "w") as file:
        file["density"], file["other"] = np.ones((2, 3, 4)), np.ones((2, 3, 4))
        file["density"].attrs["element_size_um"] = [3.0, 2.0, 1.0]
    (tmp_path / "scene.xml").write_text(
        """<scene version="3.0.0"><sensor type="perspective"/>
        <shape type="cube"><medium name="interior" type="heterogeneous">
        <volume name="sigma_t" type="gridvolume"><string name="filename" value="scan.h5:/density"/></volume>
        </medium></shape></scene>"""
    )
    volume = clvol.load_file(tmp_path / "scene.xml").shapes[0].interior.sigma_t
    assert np.diag(volume.index_to_world).tolist() == [1, 2, 3, 1]
    assert volume.lower.tolist() == [-0.5] * 3 and volume.upper.tolist() == [3.5, 2.5, 1.5]


def test_vti_keeps_spacing_origin_and_direction(tmp_path: Path) -> None:
    data = pytest.importorskip("vtkmodules.vtkCommonDataModel", reason="vtk is not installed")
    io = pytest.importorskip("vtkmodules.vtkIOXML", reason="vtk is not installed")
    from vtkmodules.util.numpy_support import numpy_to_vtk

    image, array = data.vtkImageData(), numpy_to_vtk(steps().ravel(), deep=1)
    image.SetDimensions(5, 4, 3)
    image.SetSpacing(*SPACING)
    image.SetOrigin(*ORIGIN)
    image.SetDirectionMatrix(*TURN.ravel())
    array.SetName("rho")
    image.GetPointData().SetScalars(array)
    writer = io.vtkXMLImageDataWriter()
    writer.SetFileName(str(tmp_path / "a.vti"))
    writer.SetInputData(image)
    writer.Write()
    grid = read_volume(tmp_path / "a.vti", "rho")
    assert (grid.values[..., 0] == steps()).all()
    np.testing.assert_allclose(grid.index_to_world, expected(), atol=1e-12)
    (tmp_path / "a.vti").write_bytes((tmp_path / "a.vti").read_bytes()[:300])
    with pytest.raises(VolumeError, match="cannot be read"):
        read_volume(tmp_path / "a.vti")


def data_array() -> Any:
    xarray = pytest.importorskip("xarray", reason="xarray is not installed")
    along = {"z": [0.0, 1, 2], "y": [3.0, 2, 1, 0], "x": 0.5 * np.arange(5)}
    return xarray.DataArray(steps() + 20.0, dims=("z", "y", "x"), coords=along, name="rho")


@pytest.mark.parametrize("order", [("z", "y", "x"), ("x", "z", "y")])
def test_data_arrays_lie_where_their_coordinates_say(order: tuple[str, ...]) -> None:
    array = data_array().transpose(*order)
    scene = clvol.load_dict(
        {
            "type": "scene",
            "sensor": {"type": "perspective"},
            "body": {
                "type": "cube",
                "interior": {"type": "heterogeneous", "sigma_t": {"type": "gridvolume", "data": array}},
            },
        }
    )
    volume = scene.shapes[0].interior.sigma_t
    assert (volume.grid.values[..., 0] == steps()[:, ::-1] + 20).all()  # its y falls
    assert np.diag(volume.index_to_world).tolist() == [0.5, 1, 1, 1]


def test_uneven_coordinates_are_refused() -> None:
    from clvol.volumes.labelled import grid_from_labelled

    array = data_array().assign_coords(z=[0.0, 1, 5])
    with pytest.raises(VolumeError, match="axis z are unevenly spaced"):
        grid_from_labelled(array)


def test_zarr_is_placed_by_xarrays_coordinates(tmp_path: Path) -> None:
    pytest.importorskip("zarr", reason="zarr is not installed")
    data_array().to_zarr(tmp_path / "a.zarr", consolidated=False)
    grid = read_volume(f"{tmp_path}/a.zarr:/rho")
    assert (grid.values[..., 0] == steps()[:, ::-1] + 20).all()
    assert np.diag(grid.index_to_world).tolist() == [0.5, 1, 1, 1]
    assert [grid.name for grid in list_grids(tmp_path / "a.zarr")] == ["/rho"]


@pytest.mark.parametrize(
    ("name", "package"),
    [("a.nii.gz", "SimpleITK"), ("a.tif", "tifffile"), ("a.h5", "h5py"), ("a.vti", "vtkmodules")],
)
def test_a_missing_package_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, package: str
) -> None:
    (tmp_path / name).write_bytes(b"something")
    for module in [m for m in sys.modules if m.partition(".")[0] == package] or [package]:
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(OptionError, match=rf"needs {package}.*pip install 'clvol\[science\]'"):
        read_volume(tmp_path / name)


def test_a_placed_volume_refuses_the_unit_cube(tmp_path: Path) -> None:
    sitk, image = itk_image()
    sitk.WriteImage(image + 20, str(tmp_path / "a.nrrd"))
    grid = {"type": "gridvolume", "filename": str(tmp_path / "a.nrrd"), "use_grid_bbox": False}
    body = {"type": "cube", "interior": {"type": "heterogeneous", "sigma_t": grid}}
    with pytest.raises(SceneError, match="always lies where its file says"):
        clvol.load_dict({"type": "scene", "sensor": {"type": "perspective"}, "body": body})
