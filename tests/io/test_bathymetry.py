"""Bathymetry read back from rasters of every orientation, against the surface they were made from.

The surface is a plane that falls to the east and rises to the north at different rates, so that a flipped or transposed
axis shows. Linear interpolation and averaging keep a plane: nodes away from edges and holes are right to float32
rounding of the heights (1e-5 m; resampled 0.01 m and warped 0.02 m, where GDAL rounds weights and places).
"""
from pathlib import Path

import numpy as np
import pytest
import rasterio
from rasterio.transform import Affine, from_origin
from rasterio.warp import transform

from mitsonar.io.grids import bathymetry

WEST, NORTH = 500000.0, 5000080.0
UPRIGHT = from_origin(WEST, NORTH, 2, 2)
SURVEY = Path(__file__).resolve().parents[2] / "../shared/data/bathymetry/JD211_public_Release_1-4_UTM.bag"


def plane(east, north):
    return -30 - 0.02 * (east - WEST) + 0.05 * (north - NORTH)


def place(placed, columns, rows):
    """Apply a raster's affine transform."""
    return placed.c + columns * placed.a + rows * placed.b, placed.f + columns * placed.d + rows * placed.e


def make(path, placed=UPRIGHT, crs="EPSG:32632", surface=plane, hole=None, shape=(40, 50), nodata=-9999.0,
         dtype="float32", **attributes):
    rows, columns = np.mgrid[:shape[0], :shape[1]]
    east, north = place(placed, columns + 0.5, rows + 0.5)
    values = surface(east, north)
    if hole is not None:
        values[hole] = -9999.0 if nodata is None else nodata
    with rasterio.open(path, "w", driver="GTiff", height=shape[0], width=shape[1], count=1, dtype=dtype,
                       transform=placed, crs=crs, nodata=nodata) as raster:
        raster.write(values.astype(dtype), 1)
        for name, value in attributes.items():
            setattr(raster, name, (value,))
    return path


def error(grid, surface=plane, edge=0):
    """Return the largest difference from the surface, leaving out ``edge`` nodes all round."""
    assert (np.diff(grid.x) > 0).all() and (np.diff(grid.y) > 0).all()
    assert grid.heights.shape == (grid.y.size, grid.x.size) and grid.heights.dtype == np.float32
    east, north = np.meshgrid(grid.x + grid.local_origin[0], grid.y + grid.local_origin[1])
    inner = np.s_[edge:grid.y.size - edge, edge:grid.x.size - edge]
    return np.nanmax(np.abs(grid.heights - surface(east, north))[inner])


@pytest.fixture
def path(tmp_path):
    return tmp_path / "survey.tif"


def test_upright_grid(path):
    grid = bathymetry.read(make(path))
    assert error(grid) < 1e-5
    assert grid.spacing == (2.0, 2.0) and grid.crs == "EPSG:32632" and grid.vertical == "elevation"
    assert grid.bounds == (WEST + 1, NORTH - 79, WEST + 99, NORTH - 1)
    assert grid.local_origin == (WEST + 50, NORTH - 40) and abs(grid.x[0] + grid.x[-1]) <= 1
    assert grid.valid.all()


@pytest.mark.parametrize("placed", [Affine(2, 0, WEST, 0, 2, NORTH - 80), Affine(2, 0, WEST, 0, -3, NORTH)],
                         ids=["south up", "oblong"])
def test_other_upright_grids(path, placed):
    assert error(bathymetry.read(make(path, placed))) < 1e-5


@pytest.mark.parametrize("placed", [Affine(1.7, 1, WEST, 1, -1.7, NORTH), Affine(-2, 0, WEST + 100, 0, -2, NORTH)],
                         ids=["turned", "mirrored"])
def test_turned_grids_are_set_upright(path, placed):
    grid = bathymetry.read(make(path, placed))
    inner = grid.heights[5:-5, 5:-5]
    assert np.isfinite(inner).mean() > 0.4
    grid = bathymetry.Bathymetry(**{**vars(grid), "heights": _eroded(grid.heights)})
    assert error(grid) < 0.02


def _eroded(heights):
    """Drop the nodes within two of a hole: there the interpolation is one-sided."""
    from scipy.ndimage import binary_erosion
    return np.where(binary_erosion(np.isfinite(heights), np.ones((5, 5))), heights, np.nan).astype(np.float32)


@pytest.mark.parametrize("crs, placed", [
    ("EPSG:4326", from_origin(10.0, 45.16, 2e-5, 2e-5)),
    ("EPSG:2263", from_origin(1000000.0, 200000.0, 6, 6)),  # New York, US survey feet
], ids=["degrees", "feet"])
def test_grids_not_in_metres_are_warped_to_utm(path, crs, placed):
    def surface(across, down):
        east, north = transform(crs, utm, np.ravel(across), np.ravel(down))
        return -30 - 0.02 * (np.reshape(east, across.shape) - middle[0]) \
            + 0.05 * (np.reshape(north, across.shape) - middle[1])
    utm = "EPSG:32632" if crs == "EPSG:4326" else "EPSG:32618"
    middle = [v[0] for v in transform(crs, utm, *([v] for v in place(placed, 25, 20)))]
    grid = bathymetry.read(make(path, placed, crs, surface))
    assert grid.crs == utm and 1.0 < grid.spacing[0] < 3.0
    grid = bathymetry.Bathymetry(**{**vars(grid), "heights": _eroded(grid.heights)})
    assert grid.valid.mean() > 0.5
    assert error(grid, lambda e, n: -30 - 0.02 * (e - middle[0]) + 0.05 * (n - middle[1])) < 0.02
    # A crop in the file's own degrees or feet.
    low, high = place(placed, 10, 30), place(placed, 40, 10)
    part = bathymetry.read(path, crop=(*low, *high))
    corners = np.array(transform(crs, utm, (low[0], high[0]), (low[1], high[1])))
    assert np.allclose(np.reshape(part.bounds, (2, 2)).T, corners, atol=1.5 * grid.spacing[0])


@pytest.mark.parametrize("resolution", [1.0, 4.0, 5.0, 0.7])
@pytest.mark.parametrize("crs", ["EPSG:32632", None])
def test_resampled_grids_keep_the_surface(path, resolution, crs):
    grid = bathymetry.read(make(path, crs=crs), resolution=resolution)
    assert grid.spacing == pytest.approx((resolution, resolution))
    assert error(grid, edge=3) < 0.01
    assert grid.valid.all()


HOLE = np.s_[10:20, 20:35]


@pytest.mark.parametrize("resolution", [None, 1.0, 5.0])
@pytest.mark.parametrize("declared", [True, False])
def test_holes_stay_holes_and_fill_values_do_not_bleed(path, resolution, declared):
    make(path, hole=HOLE, nodata=-9999.0 if declared else None)
    grid = bathymetry.read(path, resolution=resolution, nodata=None if declared else -9999.0)
    assert error(grid) < 0.2  # one-sided by a cell at most: 0.05 x 2 m and 0.02 x 2 m
    area = (~grid.valid).sum() * grid.spacing[0] * grid.spacing[1]
    assert 0.6 < area / (10 * 15 * 4) <= 1
    assert np.isnan(grid.height_at(WEST + 55 - grid.local_origin[0], NORTH - 30 - grid.local_origin[1]))


def test_holes_as_nan(path):
    grid = bathymetry.read(make(path, hole=HOLE, nodata=np.nan), resolution=1.0)
    assert error(grid) < 0.2 and 0.6 < (~grid.valid).sum() / 600 <= 1


@pytest.mark.parametrize("written, taken", [("depth", "auto"), ("depth", "depth"), ("elevation", "elevation")])
def test_sign(path, written, taken):
    sign = -1 if written == "depth" else 1
    grid = bathymetry.read(make(path, surface=lambda e, n: sign * plane(e, n), hole=HOLE), vertical=taken)
    assert error(grid) < 1e-5 and grid.vertical == written


def test_integers_with_scale_and_offset(path):
    make(path, dtype="int16", nodata=-32768, surface=lambda e, n: np.rint((plane(e, n) + 20) * 100), hole=HOLE,
         scales=0.01, offsets=-20.0)
    for resolution in (None, 1.0):
        assert error(bathymetry.read(path, resolution=resolution)) < 0.2
    assert error(bathymetry.read(path)) < 0.006  # half a step


def test_crop_and_size(path):
    make(path)
    crop = bathymetry.read(path, crop=(WEST + 11, NORTH - 61, WEST + 31, NORTH - 21))
    assert crop.bounds == (WEST + 11, NORTH - 61, WEST + 31, NORTH - 21) and error(crop) < 1e-5
    about = bathymetry.read(path, centre=(WEST + 21, NORTH - 41), size=(20, 40))
    assert about.bounds == crop.bounds and np.array_equal(about.heights, crop.heights)
    local = bathymetry.read(path, crop=(-39, -21, -19, 19), frame="local")
    assert local.bounds == crop.bounds
    middle = bathymetry.read(path, size=(20, 40))
    assert np.allclose(middle.local_origin, (WEST + 50, NORTH - 40), atol=1.0)
    assert (middle.y.size, middle.x.size) == (20, 10)


def test_common_local_origin(path):
    grid = bathymetry.read(make(path), local_origin=(WEST, NORTH))
    assert (grid.x[0], grid.y[-1]) == (1.0, -1.0) and error(grid) < 1e-5


def test_array(tmp_path):
    x, y = np.arange(60) * 0.5, np.arange(40) * 0.5
    heights = plane(x + WEST, y[:, None] + NORTH)
    heights[5:9, 10:14] = np.nan
    np.save(tmp_path / "bed.npy", heights)
    grid = bathymetry.read(tmp_path / "bed.npy", spacing=0.5)
    assert grid.spacing == (0.5, 0.5) and grid.crs == "" and (~grid.valid).sum() == 16
    assert np.array_equal(grid.x + grid.local_origin[0], x) and np.array_equal(grid.y + grid.local_origin[1], y)
    assert np.array_equal(grid.heights, heights.astype(np.float32), equal_nan=True)
    assert bathymetry.read(tmp_path / "bed.npy", spacing=0.5, resolution=1.0).spacing == (1.0, 1.0)


def test_height_at(path):
    grid = bathymetry.read(make(path))
    x, y = np.array([[-30.3, 0.0, 12.25]]), np.array([[5.0, 3.3, -20.0]])
    expected = plane(x + grid.local_origin[0], y + grid.local_origin[1])
    assert np.allclose(grid.height_at(x, y), expected, atol=1e-4)
    assert grid.height_at(0.0, 0.0).shape == ()
    assert np.isnan(grid.height_at(1000.0, 0.0))


def text_file(tmp_path):
    path = tmp_path / "survey.bag"
    path.write_text("not a grid\n" * 100)
    return path


def broken_hdf5(tmp_path):
    path = tmp_path / "survey.bag"
    path.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(1000))
    return path


def array(tmp_path, values):
    np.save(tmp_path / "bed.npy", values)
    return tmp_path / "bed.npy"


@pytest.mark.parametrize("prepare, options, said", [
    (lambda t: t / "none.tif", {}, "none.tif: there is no such file"),
    (text_file, {}, r"survey.bag: this is not a bathymetry grid that GDAL can read \(.*not recognized"),
    (broken_hdf5, {}, "survey.bag: the HDF5 file is damaged"),
    (lambda t: t, {}, "it is a folder, a device or a pipe; give a file"),
    (lambda t: make(t / "a.tif"), {"band": 2}, "there is no band 2; the file has 1 unnamed"),
    (lambda t: make(t / "a.tif"), {"vertical": "up"}, 'vertical is "up"; it must be'),
    (lambda t: make(t / "a.tif"), {"resolution": 0.0}, "resolution is 0.0 m"),
    (lambda t: make(t / "a.tif"), {"spacing": 2.0}, "the file has its own spacing"),
    (lambda t: make(t / "a.tif"), {"crs": "EPSG:32633"}, "names its coordinate system, EPSG:32632; leave out"),
    (lambda t: make(t / "a.tif", crs=None), {"crs": "UTM 99"}, '"UTM 99" is no coordinate system'),
    (lambda t: make(t / "a.tif"), {"crop": (0, 0, 10, 10)},
     r"0 x 0 nodes are left in 0, 0, 10, 10; the file covers 500001, 5000001, 500099, 5000079 \(west"),
    (lambda t: make(t / "a.tif"), {"crop": (10, 0, 0, 10)}, "the crop 10, 0, 0, 10 is not west, south, east, north"),
    (lambda t: make(t / "a.tif"), {"crop": (0, 0, 1, 1), "size": (1, 1)}, "give crop, or centre and size, not both"),
    (lambda t: make(t / "a.tif"), {"centre": (0, 0)}, "a centre needs a size"),
    (lambda t: make(t / "a.tif"), {"size": (0, 5)}, "size is 0, 5 m"),
    (lambda t: make(t / "a.tif"), {"size": (9, 9), "frame": "x"}, 'frame is "x"'),
    (lambda t: make(t / "a.tif", units="ft"), {}, "heights are in ft; convert them to metres"),
    (lambda t: make(t / "a.tif", hole=np.s_[:, :]), {}, "the requested part has no depths, only holes"),
    (lambda t: make(t / "a.tif", surface=lambda e, n: plane(e, n) + 1e6 * (e > WEST + 90)), {},
     "if 99996. means no data, set nodata to it"),
    (lambda t: make(t / "a.tif", placed=from_origin(10, 50, 1e-4, 1e-4), crs=None), {}, "look like degrees; say crs"),
    (lambda t: array(t, np.zeros((5, 5))), {}, "an .npy array needs the spacing"),
    (lambda t: array(t, np.zeros(5)), {"spacing": 1.0}, r"the array is float64 of shape \(5,\); expected numbers"),
    (lambda t: array(t, np.zeros((5, 5))), {"spacing": -1.0}, "spacing is -1.0 m"),
    (lambda t: (t / "bed.npy").write_text("x") and t / "bed.npy", {"spacing": 1.0}, "this is not a NumPy array"),
])
def test_refusals_are_one_sentence(tmp_path, capfd, prepare, options, said):
    with pytest.raises(ValueError, match=said) as caught:
        bathymetry.read(prepare(tmp_path), **options)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().err == ""


def test_unplaced_image_is_refused(path):
    make(path, placed=Affine.identity(), crs=None)
    with pytest.raises(ValueError, match="no georeference"):
        bathymetry.read(path)


@pytest.mark.skipif(not SURVEY.exists(), reason="the survey JD211 is not beside this checkout")
def test_real_survey():
    grid = bathymetry.read(SURVEY)
    assert grid.heights.shape == (1478, 1707) and grid.spacing == (2.0, 2.0) and grid.crs == "EPSG:32602"
    assert grid.valid.mean() == pytest.approx(0.4587, abs=1e-4)
    assert -53 < np.nanmin(grid.heights) and np.nanmax(grid.heights) < -50.9
    # GDAL gives rows from the north; the file's own first row is the southernmost.
    with rasterio.open(SURVEY) as raster:
        column, row = 900, 700
        east, north = raster.xy(row, column)
        at = grid.heights[np.argmin(abs(grid.y + grid.local_origin[1] - north)),
                          np.argmin(abs(grid.x + grid.local_origin[0] - east))]
        assert at == raster.read(1)[row, column]
