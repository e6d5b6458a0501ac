"""Files that GDAL would follow elsewhere: nothing is asked over the network, nothing else is opened."""
import socket

import numpy as np
import pytest
import rasterio
from rasterio.transform import from_origin

from mitsonar.io.grids import bathymetry, raster_files, rasters, sediment_map

VRT = """<VRTDataset rasterXSize="60" rasterYSize="60"><GeoTransform>500000,1,0,6000000,0,-1</GeoTransform>
<VRTRasterBand dataType="Float32" band="1"><SimpleSource><SourceFilename>/vsicurl/ADDRESS/a.tif</SourceFilename>
<SourceBand>1</SourceBand></SimpleSource></VRTRasterBand></VRTDataset>"""
WMS = """<GDAL_WMS><Service name="TMS"><ServerUrl>ADDRESS/${z}/${x}/${y}</ServerUrl></Service><DataWindow>
<UpperLeftX>0</UpperLeftX><UpperLeftY>60</UpperLeftY><LowerRightX>60</LowerRightX><LowerRightY>0</LowerRightY>
<SizeX>60</SizeX><SizeY>60</SizeY></DataWindow><Projection>EPSG:3857</Projection><BandsCount>1</BandsCount>
</GDAL_WMS>"""
WCS = "<WCS_GDAL><ServiceURL>ADDRESS?</ServiceURL><Version>1.0.0</Version><CoverageName>a</CoverageName></WCS_GDAL>"
CONTENTS = {"VRT": VRT, "WMS": WMS, "WCS": WCS}


@pytest.fixture
def address(monkeypatch):
    """A server on this host; at the end nobody has called it."""
    monkeypatch.setenv("GDAL_HTTP_TIMEOUT", "1")                    # so that the test ends where somebody does
    monkeypatch.setenv("GDAL_HTTP_CONNECTTIMEOUT", "1")
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"http://127.0.0.1:{server.getsockname()[1]}"
        server.setblocking(False)
        with pytest.raises(BlockingIOError):
            server.accept()


@pytest.fixture
def survey(tmp_path):
    path = tmp_path / "bed.tif"
    with rasterio.open(path, "w", driver="GTiff", height=60, width=60, count=1, dtype="float32", crs="EPSG:32632",
                       transform=from_origin(5e5, 6e6, 1, 1)) as raster:
        raster.write(np.full((60, 60), -20, np.float32), 1)
    return path


@pytest.mark.parametrize("suffix", ["tif", "bag", "nc", "asc", "vrt", "xml"])
@pytest.mark.parametrize("content", CONTENTS.values(), ids=CONTENTS)
def test_descriptions_of_data_elsewhere_are_not_opened(tmp_path, address, content, suffix):
    path = tmp_path / f"bed.{suffix}"
    path.write_text(content.replace("ADDRESS", address))
    with pytest.raises(ValueError, match="not a bathymetry grid that GDAL can read|no grid"):
        bathymetry.read(path)
    with pytest.raises(ValueError, match="that GDAL can read|no grid"), \
            raster_files.opened(path, what="map of classes"):
        pass


@pytest.mark.parametrize("name", ["bed.tif.ovr", "bed.tif.msk", "BED.OVR"])
def test_companions_that_are_no_rasters(survey, address, name):
    (survey.parent / name).write_text(VRT.replace("ADDRESS", address))
    with pytest.raises(ValueError, match=rf"{name}, which lies beside the file, is no raster; remove it"):
        bathymetry.read(survey)


def test_coarser_copies_elsewhere(survey, address):
    (survey.parent / "bed.tif.aux.xml").write_text(
        '<PAMDataset><Metadata domain="OVERVIEWS"><MDI key="OVERVIEW_FILE">'
        f"/vsicurl/{address}/a.tif</MDI></Metadata></PAMDataset>")
    with pytest.raises(ValueError, match="the file names another one for its coarser copies"):
        bathymetry.read(survey)


def test_coarser_copies_beside_the_file(survey):
    with rasterio.Env(TIFF_USE_OVR=True), rasterio.open(survey, "r+") as raster:
        raster.build_overviews([2, 4])
    assert (survey.parent / "bed.tif.ovr").is_file()
    assert bathymetry.read(survey, resolution=4.0).heights.shape == (15, 15)


@pytest.mark.parametrize("text", ["{address}/crs", "/vsicurl/{address}/crs", "{file}"])
def test_coordinate_systems_are_not_fetched(address, survey, text):
    with pytest.raises(ValueError, match="is no coordinate system; write an EPSG code"):
        rasters.crs_of(text.format(address=address, file=survey))


@pytest.mark.parametrize("text", ["EPSG:32632", "epsg:32632", "+proj=utm +zone=32 +datum=WGS84", "WKT"])
def test_coordinate_systems_by_all_their_names(text):
    system = rasters.crs_of("EPSG:32632")
    found = rasters.crs_of(system.to_wkt() if text == "WKT" else text)
    assert found.is_projected and found.linear_units_factor[1] == 1


def test_formats_are_files_and_known_to_gdal():
    with rasterio.Env() as env:
        known = env.drivers()
    assert {"GTiff", "netCDF", "AAIGrid"} <= set(raster_files.DRIVERS) & set(known)
    assert not set(raster_files.DRIVERS) & {"VRT", "WMS", "WCS", "WMTS", "HTTP", "MEM", "Zarr", "GTI", "MRF", "ERS"}
    assert sediment_map.raster_files is raster_files                # maps of classes come by the same way
