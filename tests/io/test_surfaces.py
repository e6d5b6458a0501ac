"""Grids of soundings as BAG and S-102, read back by GDAL and as the formats' documents describe them."""
import h5py
import numpy as np
import pytest
import rasterio
from soundings_line import soundings_line

from mitsonar.cli.main import main
from mitsonar.hydrography.gridding import gridded
from mitsonar.io import survey_lines
from mitsonar.io.grids import bathymetry, surfaces

CELL = 2.0


@pytest.fixture(scope="module")
def line():
    return soundings_line(column=False, snippets=False).assign_attrs(vertical_datum="LAT")


def test_bag_holds_elevation_uncertainty_and_datum(line, tmp_path):
    grid = gridded(line, CELL, rule="weighted")
    assert surfaces.write(grid, tmp_path / "bed.bag") == ()
    with rasterio.open(tmp_path / "bed.bag") as raster:
        assert raster.descriptions == ("elevation", "uncertainty") and raster.nodata == 1e6
        assert raster.transform.a == CELL and raster.transform.c == float(grid.x[0]) - CELL / 2
        assert '"LAT"' in raster.crs.to_wkt() and "32632" in raster.crs.to_wkt()
        elevation, uncertainty = raster.read(masked=True).filled(np.nan)
    np.testing.assert_array_equal(elevation, -grid["depth"].values)
    np.testing.assert_array_equal(uncertainty, grid["uncertainty"].values)
    with h5py.File(tmp_path / "bed.bag") as file:
        root = file["BAG_root"]
        assert root.attrs["Bag Version"] == b"1.6.2" and root["tracking_list"].attrs["Tracking List Length"] == 0
        # Rows run north from the south-western node.
        assert np.flatnonzero(root["elevation"][0] < 1e6).tolist() == np.flatnonzero(elevation[-1] < 1e6).tolist()
        assert float(root["elevation"].attrs["Maximum Elevation Value"]) == np.nanmax(elevation)
        text = b"".join(root["metadata"][:].tolist()).decode()
    assert "<gco:Date>2026-05-01</gco:Date>" in text and "standard deviation of the depth" in text


def test_s102_holds_depth_uncertainty_and_datum(line, tmp_path):
    grid = gridded(line, CELL, rule="weighted")
    assert surfaces.write(grid, tmp_path / "bed.h5") == ()
    with rasterio.open(tmp_path / "bed.h5") as raster:
        assert raster.driver == "S102" and raster.descriptions == ("depth", "uncertainty")
        assert raster.crs.to_epsg() == 32632 and raster.transform.f == float(grid.y[0]) + CELL / 2
        assert raster.tags()["VERTICAL_DATUM_ABBREV"] == "LAT"
        depth, uncertainty = raster.read(masked=True).filled(np.nan)
    np.testing.assert_array_equal(depth, grid["depth"].values)
    np.testing.assert_array_equal(uncertainty, grid["uncertainty"].values)
    with h5py.File(tmp_path / "bed.h5") as file:
        assert file.attrs["productSpecification"] == "INT.IHO.S-102.3.0.0" and file.attrs["issueDate"] == "20260501"
        assert h5py.check_enum_dtype(file.attrs.get_id("verticalDatumReference").dtype) == {
            "s100VerticalDatum": 1, "EPSG": 2}
        assert file["Group_F/featureCode"][:].tolist() == [b"BathymetryCoverage"]
        group = file["BathymetryCoverage/BathymetryCoverage.01/Group_001"]
        assert float(group.attrs["minimumDepth"]) == np.nanmin(depth)
        west, east = file.attrs["westBoundLongitude"], file.attrs["eastBoundLongitude"]
        assert 8.20 < west < east < 8.22 and 53.74 < file.attrs["southBoundLatitude"] < 53.75


def test_without_uncertainty_the_spread_of_the_soundings_is_written(line, tmp_path):
    grid = gridded(line, 8.0)
    surfaces.write(grid, tmp_path / "bed.bag")
    with rasterio.open(tmp_path / "bed.bag") as raster:
        spread = raster.read(2, masked=True).filled(np.nan)
    several = grid["count"].values > 1
    assert several.any() and not several.all()
    np.testing.assert_array_equal(spread, np.where(several, grid["deviation"].values, np.nan))
    with h5py.File(tmp_path / "bed.bag") as file:
        assert b'"rawStdDev"' in b"".join(file["BAG_root/metadata"][:].tolist())


@pytest.mark.parametrize("suffix", surfaces.SUFFIXES)
def test_surface_comes_back_as_a_bed(line, suffix, tmp_path):
    grid = gridded(line.assign(depth=line["depth"] - 50.5), CELL)                  # most of it dries
    surfaces.write(grid, tmp_path / f"bed{suffix}")
    bed = bathymetry.read(tmp_path / f"bed{suffix}", vertical="auto" if suffix == ".h5" else "elevation")
    np.testing.assert_array_equal(bed.heights, -grid["depth"].values[::-1])
    np.testing.assert_allclose(bed.y + bed.local_origin[1], grid["y"].values[::-1])


@pytest.mark.parametrize("suffix", surfaces.SUFFIXES)
def test_surface_holds_no_time_of_writing(line, suffix, tmp_path):
    grid = gridded(line, CELL)
    for name in ("one", "two"):
        surfaces.write(grid, tmp_path / f"{name}{suffix}")
    assert (tmp_path / f"one{suffix}").read_bytes() == (tmp_path / f"two{suffix}").read_bytes()
    stamps: list[int] = []
    with h5py.File(tmp_path / f"one{suffix}") as file:
        file.visititems(lambda _, item: stamps.append(h5py.h5o.get_info(item.id).mtime))
        if suffix == ".bag":
            text = b"".join(file["BAG_root/metadata"][:].tolist()).decode()
            assert text.count("2026-05-01") == 2 and text.count("T00:00:00") == 0
    assert set(stamps) == {0}


def test_unknown_datum_and_foreign_systems(line, tmp_path):
    grid = gridded(line, CELL)
    nameless = grid.copy()
    del nameless.attrs["vertical_datum"]
    assert "name no vertical datum" in surfaces.write(nameless, tmp_path / "a.bag")[0]
    assert "local datum" in surfaces.write(grid.assign_attrs(vertical_datum="NAP"), tmp_path / "a.h5")[0]
    with h5py.File(tmp_path / "a.h5") as file:
        assert file.attrs["verticalDatum"] == 24
    for attrs, suffix, message in (({"crs": None}, ".bag", "name no coordinate system"),
                                   ({"crs": "EPSG:25832"}, ".h5", "UTM or UPS zones of WGS 84"),
                                   ({"crs": "EPSG:4326"}, ".h5", "not one in metres")):
        with pytest.raises(ValueError, match=message):
            surfaces.write(grid.assign_attrs(attrs), tmp_path / f"no{suffix}")
    with pytest.raises(ValueError, match="no cell of the grid"):
        surfaces.write(gridded(line, CELL, least=1000), tmp_path / "no.bag")
    assert not list(tmp_path.glob("no*"))
    with pytest.raises(ValueError, match="below LAT and MSL cannot"):
        gridded([line, line.assign_attrs(vertical_datum="MSL")], CELL)


def test_command_writes_surfaces(line, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    survey_lines.write(line, "a.nc")
    assert main(["grid", "a.nc", "-o", "bed.bag", "--cell", "2", "--rule", "weighted"]) == 0
    assert main(["grid", "a.nc", "-o", "bed.h5", "--cell", "2"]) == 0
    assert main(["grid", "a.nc", "-o", "bed.h5", "--layer", "count"]) == 2
    assert "--layer chooses" in capsys.readouterr().err
