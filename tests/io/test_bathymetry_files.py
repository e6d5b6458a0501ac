"""Bathymetry of every kind of file, against the plane that each was made of; and what is no bathymetry.

A plane that falls to the east and rises to the north at different rates shows every axis that is exchanged, turned or
half a cell off: half a cell of 2 m is 0.02 m one way and 0.05 m the other. Grids and lattices are read to float32
rounding of the heights (1e-5 m). Soundings in degrees are placed by pyproj, and the plane is laid in metres: 1e-3 m.
"""
import logging
import struct
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
import rasterio
import xarray as xr
from hypothesis import HealthCheck, given, settings, strategies as st
from rasterio.transform import from_origin
from rasterio.warp import transform

from mitsonar.io.grids import bathymetry

WEST, SOUTH = 500000.0, 5000000.0
SURVEY = Path(__file__).resolve().parents[2] / "../shared/data/bathymetry/JD211_public_Release_1-4_UTM.bag"


def plane(east, north):
    return -30 - 0.02 * (east - WEST) + 0.05 * (north - SOUTH)


def error(grid, surface=plane):
    """Return the largest difference from the surface."""
    assert (np.diff(grid.x) > 0).all() and (np.diff(grid.y) > 0).all()
    east, north = np.meshgrid(grid.x + grid.local_origin[0], grid.y + grid.local_origin[1])
    return np.nanmax(np.abs(grid.heights - surface(east, north)))


# ---- BAG of variable resolution: 6 x 8 cells of 16 m, refined to 2 m in the west, to 4 m in the east
def refined_bag(path, surface=plane):
    with rasterio.open(path, "w", driver="BAG", height=6, width=8, count=1, dtype="float32", nodata=1e6,
                       crs="EPSG:32632", transform=from_origin(WEST, SOUTH + 96, 16, 16)) as bag:
        bag.write(np.full((6, 8), -99, np.float32), 1)      # not the plane: the overview is not to be read
    cells = np.zeros((6, 8), [("index", "u4"), ("dimensions_x", "u4"), ("dimensions_y", "u4"), ("resolution_x", "f4"),
                              ("resolution_y", "f4"), ("sw_corner_x", "f4"), ("sw_corner_y", "f4")])
    depths, index = [], 0
    for row, column in np.ndindex(6, 8):
        step = 2 if column < 4 else 4
        number = 16 // step
        cells[row, column] = index, number, number, step, step, step / 2, step / 2
        axis = step / 2 + step * np.arange(number)
        depths.append(surface(WEST + 16 * column + axis, SOUTH + 16 * row + axis[:, None]).ravel())
        index += number**2
    refinements = np.zeros((1, index), [("depth", "f4"), ("depth_uncrt", "f4")])
    refinements["depth"] = np.concatenate(depths)
    with h5py.File(path, "r+") as file:
        metadata = file["BAG_root"].create_dataset("varres_metadata", data=cells)
        for axis in "xy":
            metadata.attrs[f"min_resolution_{axis}"], metadata.attrs[f"max_resolution_{axis}"] = np.float32((2, 4))
        file["BAG_root"].create_dataset("varres_refinements", data=refinements)
    return path


def test_bag_of_variable_resolution_is_read_at_its_finest(tmp_path):
    grid = bathymetry.read(refined_bag(tmp_path / "vr.bag"))
    assert grid.spacing == (2.0, 2.0) and grid.crs == "EPSG:32632" and grid.heights.shape == (48, 64)
    assert grid.bounds == (WEST + 1, SOUTH + 1, WEST + 127, SOUTH + 95)
    fine = grid.heights[:-1, :32]                            # the driver leaves out the northernmost row of all
    east, north = grid.x + grid.local_origin[0], grid.y + grid.local_origin[1]
    assert np.abs(fine - plane(east[:32], north[:-1, None])).max() < 1e-5      # nodes of refinements, exactly
    # Between the coarser nodes, the driver weights by distance where cells meet: a quarter of their 4 m at most.
    assert error(grid) < 0.05 * 4 / 4 + 1e-5


def test_bag_of_variable_resolution_at_another(tmp_path):
    refined_bag(tmp_path / "vr.bag")
    grid = bathymetry.read(tmp_path / "vr.bag", resolution=8.0, crop=(WEST + 16, SOUTH + 16, WEST + 48, SOUTH + 80))
    assert grid.spacing == (8.0, 8.0) and error(grid) < 1e-4


@pytest.mark.skipif(not SURVEY.exists(), reason="the survey JD211 is not beside this checkout")
def test_real_bag_stands_where_its_metadata_say():
    # The south-west corner point is the first node (cellGeometry "point"). The north-east one of this file is a cell
    # beyond the last node, as if nodes were middles of cells: within half a cell, both readings hold.
    import re
    with h5py.File(SURVEY) as file:
        root = file["BAG_root"]
        text = root["metadata"][:].tobytes().decode()
        elevation = root["elevation"][:]                     # rows from the south
    west, south, east, north = (float(v) for v in re.search(r"<gml:coordinates.*?>(.*?)<", text)[1].replace(",", " ")
                                .split())
    grid = bathymetry.read(SURVEY)
    assert grid.bounds[:2] == pytest.approx((west, south), abs=1e-6)
    centre = (west + east) / 2, (south + north) / 2
    assert np.allclose(np.reshape(grid.bounds, (2, 2)).mean(0), centre, atol=1.0 + 1e-6)
    x = np.rint((grid.x + grid.local_origin[0] - west) / 2).astype(int)
    y = np.rint((grid.y + grid.local_origin[1] - south) / 2).astype(int)
    expected = np.where(elevation == 1e6, np.nan, elevation)[np.ix_(y, x)]
    assert np.array_equal(grid.heights, expected, equal_nan=True)


# ---- netCDF
X, Y = WEST + 2.0 * np.arange(20), SOUTH + 2.0 * np.arange(15)


def netcdf(path, x=X, y=Y, names=("y", "x"), name="z", values=None, engine="h5netcdf", axes=({}, {}), extra=None,
           **attributes):
    values = plane(x, y[:, None]) if values is None else values
    dataset = xr.Dataset({name: (names, values.astype(np.float32))},
                         coords={names[0]: (names[0], y, axes[0]), names[1]: (names[1], x, axes[1])})
    for also in extra or ():
        dataset[also] = dataset[name] * 0 + 1
    dataset.attrs.update(attributes)
    dataset.to_netcdf(path, engine=engine)
    return path


@pytest.mark.parametrize("engine", ["h5netcdf", "scipy"])
@pytest.mark.parametrize("turned", [False, True], ids=["north last", "north first"])
@pytest.mark.parametrize("names", [("y", "x"), ("northing", "easting")])
def test_netcdf_grids(tmp_path, engine, turned, names):
    grid = bathymetry.read(netcdf(tmp_path / "z.nc", y=Y[::-1] if turned else Y, names=names, engine=engine),
                           crs="EPSG:32632")
    assert error(grid) < 1e-5 and grid.valid.all() and grid.spacing == (2.0, 2.0)
    assert grid.bounds == (X[0], Y[0], X[-1], Y[-1])


def test_pixel_registered_netcdf_has_its_values_at_the_middles(tmp_path):
    # GMT's node_offset 1: actual_range reaches to the edges, the axes are middles of pixels.
    axes = {"actual_range": [Y[0] - 1, Y[-1] + 1]}, {"actual_range": [X[0] - 1, X[-1] + 1]}
    assert error(bathymetry.read(netcdf(tmp_path / "z.nc", axes=axes, node_offset=np.int32(1)))) < 1e-5


def test_netcdf_in_degrees_is_known_by_its_units(tmp_path):
    longitude, latitude = 9 + 3e-5 * np.arange(120), 45 + 2e-5 * np.arange(100)
    east, north = (np.reshape(v, (100, 120)) for v in transform("EPSG:4326", "EPSG:32632", *(
        v.ravel() for v in np.meshgrid(longitude, latitude))))
    values = -30 - 0.02 * (east - WEST) + 0.05 * (north - north[0, 0])
    grid = bathymetry.read(netcdf(tmp_path / "gebco.nc", longitude, latitude, ("lat", "lon"), "elevation", values,
                                  axes=({"units": "degrees_north"}, {"units": "degrees_east"})))
    assert grid.crs == "EPSG:32632"
    inner = bathymetry.Bathymetry(**{**vars(grid), "heights": np.where(_deep_inside(grid), grid.heights, np.nan)})
    assert error(inner, lambda e, n: -30 - 0.02 * (e - WEST) + 0.05 * (n - north[0, 0])) < 0.01


def _deep_inside(grid):
    from scipy.ndimage import binary_erosion
    return binary_erosion(grid.valid, np.ones((5, 5)))


def test_netcdf_with_several_grids(tmp_path):
    path = netcdf(tmp_path / "a.nc", extra=["mask", "uncertainty"])
    assert error(bathymetry.read(path)) < 1e-5
    assert error(bathymetry.read(path, variable="z")) < 1e-5
    assert bathymetry.read(path, variable="mask").heights[0, 0] == -1          # positive numbers are depths
    (tmp_path / "a folder: this").mkdir()
    assert error(bathymetry.read(netcdf(tmp_path / "a folder: this" / "b.nc", extra=["mask"]))) < 1e-5
    assert error(bathymetry.read(netcdf(tmp_path / "c.nc"), variable="z")) < 1e-5
    netcdf(path, name="mean", extra=["least"])
    with pytest.raises(ValueError, match="holds the grids mean, least; name the one of heights by variable"):
        bathymetry.read(path)
    assert error(bathymetry.read(path, variable="mean")) < 1e-5
    with pytest.raises(ValueError, match='no grid "median"; it has mean, least'):
        bathymetry.read(path, variable="median")


# ---- ESRI ASCII
def ascii_grid(path, corner="corner", rows=30, columns=40, body=None, nodata=-9999, wrap=None):
    offset = 0 if corner == "corner" else 1
    east, north = WEST + 1 + 2 * np.arange(columns), SOUTH + 1 + 2 * np.arange(rows)[::-1, None]
    numbers = [f"{value:.6f}" for value in plane(east, north).ravel()]
    step = wrap or columns
    body = "\n".join(" ".join(numbers[i:i + step]) for i in range(0, len(numbers), step)) if body is None else body
    path.write_text(f"NCOLS {columns}\nNROWS {rows}\nXLL{corner} {WEST + offset}\nyll{corner} {SOUTH + offset}\n"
                    f"cellsize 2\nNODATA_value {nodata}\n{body}\n")
    return path


@pytest.mark.parametrize("corner", ["corner", "center"])
@pytest.mark.parametrize("wrap", [None, 7])
def test_ascii_grids(tmp_path, corner, wrap):
    grid = bathymetry.read(ascii_grid(tmp_path / "bed.asc", corner, wrap=wrap), crs="EPSG:32632")
    assert error(grid) < 1e-5 and grid.bounds == (WEST + 1, SOUTH + 1, WEST + 79, SOUTH + 59)


def test_ascii_grid_with_holes_and_a_prj(tmp_path):
    ascii_grid(tmp_path / "bed.asc", rows=2, columns=3, body="-1 -9999 -3\n-4 -5 -6")
    (tmp_path / "bed.prj").write_text(rasterio.crs.CRS.from_epsg(32632).to_wkt(version="WKT1_ESRI"))
    grid = bathymetry.read(tmp_path / "bed.asc")
    assert np.array_equal(grid.heights, [[-4, -5, -6], [-1, np.nan, -3]], equal_nan=True)
    assert grid.crs == "EPSG:32632"


# ---- soundings
def write(path, x, y, z, divider=" ", header="", form="{:.4f}"):
    with open(path, "w") as file:
        file.write(header)
        file.writelines(divider.join(form.format(v) for v in line) + "\n" for line in zip(x, y, z))
    return path


@pytest.fixture
def lattice():
    """Nodes of a grid in no order, some missing, as x, y and z."""
    rng = np.random.default_rng(1)
    east, north = (v.ravel() for v in np.meshgrid(WEST + 2.5 * np.arange(30), SOUTH + 5.0 * np.arange(20)))
    order = rng.permutation(east.size)[:570]
    return east[order], north[order], plane(east[order], north[order])


@pytest.mark.parametrize("divider", [" ", ",", "; ", "\t"])
@pytest.mark.parametrize("header", ["", "# soundings\n\n", "X Y Z\n", "Easting [m], Northing [m], Depth [m]\n"])
def test_lattices_are_read_as_they_are(tmp_path, lattice, divider, header):
    east, north, z = lattice
    sign = -1 if "Depth" in header else 1
    grid = bathymetry.read(write(tmp_path / "a.xyz", east, north, sign * z, divider, header), crs="EPSG:32632")
    assert grid.spacing == (2.5, 5.0) and grid.heights.shape == (20, 30) and grid.crs == "EPSG:32632"
    assert error(grid) < 1e-4 and (~grid.valid).sum() == 30 and grid.bounds[:2] == (WEST, SOUTH)
    assert grid.vertical == ("depth" if sign < 0 else "elevation")


def test_columns_are_found_by_their_names(tmp_path, lattice):
    path, (east, north, z) = tmp_path / "a.csv", lattice
    with open(path, "w") as file:
        file.write("id,depth,northing,easting,quality\n")
        file.writelines(f"{i},{-c},{b},{a},1\n" for i, (a, b, c) in enumerate(zip(east, north, z)))
    assert error(bathymetry.read(path)) < 1e-4


def scattered(count=4000, seed=2):
    rng = np.random.default_rng(seed)
    east, north = WEST + 200 * rng.random(count), SOUTH + 100 * rng.random(count)
    return east, north, plane(east, north)


@pytest.mark.parametrize("resolution", [1.0, 4.0])
def test_scattered_soundings_are_laid_on_a_grid(tmp_path, resolution):
    grid = bathymetry.read(write(tmp_path / "a.xyz", *scattered()), resolution=resolution)
    assert grid.spacing == pytest.approx((resolution, resolution)) and grid.valid.mean() > 0.85
    # Linear interpolation keeps a plane, and so do means over a cell about the mean of its places.
    assert error(grid) < 1e-3
    assert np.allclose((grid.x + grid.local_origin[0]) / resolution % 1, 0)     # the same nodes for every survey


def test_soundings_are_interpolated_on_their_triangles(tmp_path):
    from matplotlib.tri import LinearTriInterpolator, Triangulation
    rng = np.random.default_rng(5)
    east, north = (v.ravel() for v in np.meshgrid(WEST + 3.0 * np.arange(30), SOUTH + 3.0 * np.arange(20)))
    east, north = (v + rng.uniform(-1.2, 1.2, v.size) for v in (east, north))
    z = rng.normal(-30, 1, east.size)
    path = write(tmp_path / "a.xyz", east, north, z, form="{:.6f}")
    grid = bathymetry.read(path, resolution=0.5)                     # no two in one cell: nothing is averaged
    x, y = np.meshgrid(grid.x + grid.local_origin[0] - WEST, grid.y + grid.local_origin[1] - SOUTH)
    wanted = LinearTriInterpolator(Triangulation(east - WEST, north - SOUTH), z)(x, y).filled(np.nan)
    assert np.array_equal(grid.valid, np.isfinite(wanted)) and np.nanmax(np.abs(grid.heights - wanted)) < 1e-4


def test_resolution_of_soundings_follows_from_their_density_and_is_said(tmp_path, caplog):
    with caplog.at_level(logging.INFO):
        grid = bathymetry.read(write(tmp_path / "a.xyz", *scattered()))
    assert grid.spacing == pytest.approx((2.2, 2.2), rel=0.05)                  # sqrt(20000 m2 / 4000)
    assert "4000 scattered soundings" in caplog.text and "are laid on a grid of 2.2 m" in caplog.text


def test_soundings_rounded_to_metres_are_scattered(tmp_path):
    east, north, _ = scattered()
    east, north = np.rint(east), np.rint(north)
    grid = bathymetry.read(write(tmp_path / "a.xyz", east, north, plane(east, north)))
    assert grid.spacing == pytest.approx((2.2, 2.2), rel=0.05) and grid.valid.mean() > 0.85 and error(grid) < 1e-3


def test_no_bed_where_nothing_was_sounded(tmp_path):
    east, north, z = scattered(8000)
    kept = np.hypot(east - WEST - 100, north - SOUTH - 50) > 30
    grid = bathymetry.read(write(tmp_path / "a.xyz", east[kept], north[kept], z[kept]), resolution=1.0)
    hole = np.isnan(grid.heights).sum()
    reach = 3 * np.sqrt(200 * 100 / kept.sum())
    assert np.pi * (30 - reach - 1) ** 2 < hole < np.pi * 30**2


def test_soundings_in_degrees(tmp_path):
    east, north, z = scattered()
    longitude, latitude = transform("EPSG:32632", "EPSG:4326", east, north)
    path = write(tmp_path / "a.csv", longitude, latitude, z, ",", "lon,lat,z\n", form="{:.9f}")
    grid = bathymetry.read(path, resolution=2.0)
    assert grid.crs == "EPSG:32632" and error(grid) < 1e-3
    part = bathymetry.read(path, resolution=2.0, crop=(*(np.ravel(transform(
        "EPSG:32632", "EPSG:4326", [WEST + 50], [SOUTH + 20]))), *np.ravel(transform(
            "EPSG:32632", "EPSG:4326", [WEST + 90], [SOUTH + 60]))))
    assert np.allclose(part.bounds, (WEST + 50, SOUTH + 20, WEST + 90, SOUTH + 60), atol=2.0)
    bare = write(tmp_path / "b.xyz", longitude, latitude, z, form="{:.9f}")
    with pytest.raises(ValueError, match='look like degrees; say crs "EPSG:4326"'):
        bathymetry.read(bare)
    assert error(bathymetry.read(bare, crs="EPSG:4326", resolution=2.0)) < 1e-3


def test_depths_that_are_nan_or_the_fill_value_are_no_soundings(tmp_path, lattice):
    east, north, z = lattice
    z[:50], z[50:80] = np.nan, 9999
    grid = bathymetry.read(write(tmp_path / "a.xyz", east, north, z), nodata=9999)
    assert error(grid) < 1e-4 and grid.valid.sum() == 490


# ---- what is no bathymetry
def text(suffix, content):
    def prepare(folder):
        (folder / f"bed{suffix}").write_text(content)
        return folder / f"bed{suffix}"
    return prepare


def binary(suffix, content):
    def prepare(folder):
        (folder / f"bed{suffix}").write_bytes(content)
        return folder / f"bed{suffix}"
    return prepare


def cut_tif(folder):
    path = folder / "bed.tif"
    with rasterio.open(path, "w", driver="GTiff", height=200, width=200, count=1, dtype="float32", crs="EPSG:32632",
                       transform=from_origin(WEST, SOUTH, 2, 2)) as raster:
        raster.write(np.random.default_rng(0).random((1, 200, 200), np.float32))
    path.write_bytes(path.read_bytes()[:60000])
    return path


def cut_bag(folder):
    path = refined_bag(folder / "bed.bag")
    path.write_bytes(path.read_bytes()[:20000])
    return path


def cut_classic_netcdf(folder):
    path = netcdf(folder / "bed.nc", engine="scipy")
    path.write_bytes(path.read_bytes()[:-104])        # three numbers of an axis are missing, zeros to the driver
    return path


def placed_nowhere(folder):
    return netcdf(folder / "bed.nc", x=np.full(20, WEST), y=np.full(15, SOUTH))


def huge_tif(folder):
    path = folder / "bed.tif"
    with rasterio.open(path, "w", driver="GTiff", height=10**6, width=10**6, count=1, dtype="float32", sparse_ok=True,
                       tiled=True, blockxsize=4096, blockysize=4096, bigtiff=True, crs="EPSG:32632",
                       transform=from_origin(WEST, SOUTH, 2, 2)):
        pass
    return path


def huge_array(folder):
    path = folder / "bed.npy"
    header = b"{'descr': '<f4', 'fortran_order': False, 'shape': (1000000, 1000000), }"
    header = header + b" " * (63 - (len(header) + 10) % 64) + b"\n"
    path.write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + bytes(1000))
    return path


def without_axes(folder):
    xr.Dataset({"z": (("r", "c"), np.zeros((5, 6)))}).to_netcdf(folder / "bed.nc", engine="h5netcdf")
    return folder / "bed.nc"


def uneven(folder):
    return netcdf(folder / "bed.nc", x=WEST + np.arange(20.0) ** 2)


def cut_netcdf(folder):
    path = netcdf(folder / "bed.nc")
    path.write_bytes(path.read_bytes()[:3000])
    return path


HEADER = "ncols {}\nnrows {}\nxllcorner 0\nyllcorner 0\ncellsize 100\n"


@pytest.mark.parametrize("prepare, options, said", [
    (cut_tif, {}, "GDAL can read"),
    (cut_bag, {}, "the HDF5 file is damaged"),
    (cut_netcdf, {}, "the HDF5 file is damaged"),
    (cut_classic_netcdf, {}, "the netCDF file is cut off or broken"),
    (placed_nowhere, {"resolution": 1.0}, "on a line or nowhere|no georeference"),
    (huge_tif, {}, "1000000 x 1000000 nodes are more than 2e"),
    (huge_array, {"spacing": 1.0}, "not a NumPy array"),
    (without_axes, {}, "no georeference"),
    (uneven, {}, "no georeference"),
    (binary(".tif", b""), {}, "GDAL can read"),
    (text(".tif", "II*\0 this is none"), {}, "GDAL can read"),
    (text(".asc", HEADER.format(10**6, 10**6) + "1 2 3\n"), {}, "1000000 x 1000000 nodes are more than 2e"),
    (text(".asc", HEADER.format(10**4, 10**4) + "1 2 3\n"), {}, "for which the file is too short"),
    (text(".asc", HEADER.format(3, 2) + "1 2 3\n4 x 6\n"), {}, "the heights contain 'x', which is not a number"),
    (text(".asc", HEADER.format(3, 2) + "1 2.01 3.01\n4 5\n"), {}, "5 numbers, and the header names 2 x 3"),
    (text(".asc", HEADER.format(3, 2) + "1 2 3\n4 5 6 7\n"), {}, "more numbers than the 2 x 3"),
    (text(".asc", HEADER.format(3, -2) + "1 2 3\n"), {}, "GDAL can read"),
    (text(".asc", HEADER.format(3, "two") + "1 2 3\n"), {}, "GDAL can read"),
    (lambda folder: (folder / "bed.xyz").mkdir() or folder / "bed.xyz", {}, "it is a folder"),
    (text(".xyz", ""), {}, "holds no soundings"),
    (text(".xyz", "# only\n# comments\n"), {}, "holds no soundings"),
    (text(".xyz", "500000 5000000\n500002 5000000\n"), {}, 'line 1, "500000 5000000", does not hold x, y and z'),
    (text(".xyz", "1 2 3\n" * 5 + "4 oops 6\n"), {}, 'line 6, "4 oops 6", does not hold x, y and z'),
    (text(".xyz", "1000 2 3\n# nothing\n\n1001 2 3\n5 6\n"), {}, 'line 5, "5 6", does not hold x, y and z'),
    (text(".xyz", "1000 2000 3\n1001 nan 3\n1002 2000 3\n"), {}, "x or y is not a finite number"),
    (text(".xyz", "1000 2000 nan\n" * 9), {}, "holds 0 soundings"),
    (text(".xyz", "".join(f"{i} {i} 3\n" for i in range(1000, 1100))), {}, "lie on a line or in a point"),
    (text(".xyz", "1000 2000 3\n" * 9), {}, "lie on a line or in a point"),
    (text(".xyz", "".join(f"{i**1.5:.3f} {i**2.2:.3f} -9\n" for i in range(10, 400))), {"resolution": 1e-3},
     "use a coarser resolution"),
    (text(".xyz", "".join(f"{i * 7e9 % 1e15} {i * 9e10 % 1e14} -9\n" for i in range(10, 400))), {"crs": "EPSG:4326"},
     "no UTM zone|no place|inf"),
    (text(".xyz", "name\nwhat is this\n1 2 3\n"), {}, 'line 2, "what is this", does not hold'),
    (text(".xyz", "x" * 200000), {}, "the first line has no end"),
    (binary(".xyz", b"1 2 3\n\0\1\2" * 50), {}, "this is no text"),
    (binary(".txt", np.random.default_rng(0).bytes(5000).replace(b"\0", b"a")), {}, "does not hold|no soundings"),
    (text(".xyz", "1000 2000 -3\n" + "garbage " * 9 + "\n" * 10**6), {}, 'line 2, "garbage'),
    (lambda folder: netcdf(folder / "bed.nc"), {"variable": "depth"}, 'holds no grid "depth"; it has z'),
    (lambda folder: ascii_grid(folder / "bed.asc"), {"variable": "z"}, 'variable is "z", but only netCDF'),
    (lambda folder: write(folder / "bed.xyz", *scattered(50)), {"spacing": 2.0}, "the file has its own spacing"),
    (lambda folder: write(folder / "bed.xyz", *scattered(50)), {"crs": "somewhere"}, "is no coordinate system"),
])
def test_refusals_are_one_sentence(tmp_path, capfd, prepare, options, said):
    path, start = prepare(tmp_path), time.perf_counter()
    capfd.readouterr()
    with pytest.raises(ValueError, match=said) as caught:
        bathymetry.read(path, **options)
    assert "\n" not in str(caught.value) and str(caught.value).startswith(str(path))
    assert capfd.readouterr().err == ""
    assert time.perf_counter() - start < 10            # generous: nothing of what a header claims is allocated


WORDS = st.one_of(st.floats(allow_nan=True, allow_infinity=True, width=32).map(repr), st.integers(-9, 99).map(str),
                  st.sampled_from(["", "nan", "x", "1e400", "-", "#", '"', "é", "\x00", "ncols", "1,5", "0x1"]))
LINES = st.lists(st.lists(WORDS, max_size=5).map(" ".join), max_size=8).map("\n".join)


@settings(max_examples=300, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(body=LINES, header=st.sampled_from(["", "x y z\n", "lon,lat,depth\n", HEADER.format(2, 2), HEADER.format(1, 3),
                                           "ncols 2\nnrows 2\n"]),
       suffix=st.sampled_from([".xyz", ".asc"]))
def test_any_text_is_read_or_refused_in_a_sentence(tmp_path, body, header, suffix):
    path = tmp_path / f"bed{suffix}"
    path.write_text(header + body, encoding="utf-8")
    try:
        grid = bathymetry.read(path)
    except ValueError as refused:
        assert str(refused).startswith(str(path)) and "\n" not in str(refused)
    else:
        assert np.isfinite(grid.heights).any() and grid.heights.size < 1e6
