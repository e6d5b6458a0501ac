"""Separations of a vertical datum: constants, and grids as PROJ interpolates them."""
import struct

import numpy as np
import pytest
import rasterio
from rasterio.transform import from_origin

from mitsonar.device.earth import Frame
from mitsonar.io.grids.separation import Separation

KIEL = Frame.about(54.4, 10.2)
HEIGHTS = 38.0 + 0.3 * np.arange(5)[:, None] + 0.11 * np.arange(7) ** 1.5            # rows from the south


def gtx(path, heights=HEIGHTS, west=9.9):
    """A grid as GTX: four doubles, two integers, and rows from the south, all big-endian."""
    path.write_bytes(struct.pack(">4d2i", 54.2, west, 0.1, 0.1, *heights.shape) + heights.astype(">f4").tobytes())
    return path


def tif(path, heights=HEIGHTS, **more):
    with rasterio.open(path, "w", driver="GTiff", height=5, width=7, count=1, dtype="float32", crs="EPSG:4326",
                       transform=from_origin(9.85, 54.65, 0.1, 0.1), **more) as raster:
        raster.write(heights[::-1].astype("f4"), 1)
    return path


X, Y = np.array([-9000.0, 0.0, 1234.5, 11000.0]), np.array([-15000.0, 10.0, 777.0, 20000.0])


@pytest.mark.parametrize("made", [gtx, tif])
def test_a_grid_is_interpolated_as_by_proj(tmp_path, made):
    """PROJ reads float32 and is bilinear, too: 2e-5 m."""
    import pyproj

    path = made(tmp_path / "geoid.gtx")
    found = Separation(path=path).at(X, Y, KIEL)
    latitude, longitude, _ = KIEL.on_globe(np.stack([X, Y], -1))
    gtx(tmp_path / "proj.gtx")
    proj = pyproj.Transformer.from_pipeline(f"+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step "
                                            f"+proj=vgridshift +grids={tmp_path / 'proj.gtx'} +multiplier=1")
    assert not pyproj.network.is_network_enabled()
    np.testing.assert_allclose(found, proj.transform(longitude, latitude, np.zeros(4))[2], atol=2e-5)


def test_longitudes_may_count_from_0_to_360_and_a_grid_may_be_in_metres(tmp_path):
    east = Separation(path=gtx(tmp_path / "a.gtx")).at(X, Y, KIEL)
    np.testing.assert_allclose(Separation(path=gtx(tmp_path / "b.gtx", west=369.9)).at(X, Y, KIEL), east, atol=1e-5)
    path = tmp_path / "metres.tif"
    with rasterio.open(path, "w", driver="GTiff", height=2, width=2, count=1, dtype="float32", crs="EPSG:32632",
                       transform=from_origin(400_000, 6_200_000, 400_000, 400_000)) as raster:
        raster.write(np.full((1, 2, 2), 41.5, "f4"))
    assert Separation(path=path, constant=-0.5).at([0.0], [0.0], Frame(crs="EPSG:32632", origin=(7e5, 5.9e6))) == 41.0


def test_a_constant_needs_no_place():
    np.testing.assert_array_equal(Separation(constant=-31.25).at(X, Y, None), np.full(4, -31.25))


@pytest.mark.parametrize("made, words", [
    (lambda path: Separation(constant=300.0), "separation is 300 m"),
    (lambda path: Separation(path=path / "none.gtx"), "there is no such file"),
    (lambda path: Separation(path=gtx(path / "a.gtx")).at(X, Y, None), "the line has no place on Earth"),
    (lambda path: Separation(path=gtx(path / "a.gtx")).at(X + 1e6, Y, KIEL), "does not reach all places"),
    (lambda path: Separation(path=tif(path / "a.tif", np.where(HEIGHTS > 38.5, -9999.0, HEIGHTS), nodata=-9999)).at(
        X, Y, KIEL), "has no value"),
    (lambda path: Separation(path=tif(path / "a.tif", HEIGHTS * 100)).at(X, Y, KIEL), r"none within \+-200 m"),
])
def test_what_is_no_separation_is_refused_in_a_sentence(tmp_path, made, words):
    with pytest.raises(ValueError, match=words):
        made(tmp_path)


def test_a_file_that_is_no_grid_is_refused(tmp_path):
    (tmp_path / "cut.gtx").write_bytes(gtx(tmp_path / "a.gtx").read_bytes()[:50])
    with pytest.raises(ValueError, match="cannot read the separation"):
        Separation(path=tmp_path / "cut.gtx").at(X, Y, KIEL)
