"""Lines of soundings in files: the name chooses, files are whole or not there, and memory holds a block."""
import tracemalloc
import warnings

import h5py
import numpy as np
import pytest
import rasterio
import xarray as xr
from soundings_line import blocks_of, soundings_line

import mitsonar
from mitsonar.device.rotations import mounting_matrix
from mitsonar.io import survey_lines
from mitsonar.io.survey_lines.directions import array_axes, level
from mitsonar.io.survey_lines.lines import line_of, pings

LINE = soundings_line(pings=5)


@pytest.mark.parametrize("suffix", survey_lines.SUFFIXES)
def test_blocks_give_the_same_file_as_the_line_at_once(suffix, tmp_path):
    written = [survey_lines.write(blocks, tmp_path / f"{name}{suffix}")
               for name, blocks in (("blocks", blocks_of(LINE)), ("line", LINE))]
    assert written[0] == written[1] and written[0].pings == 5
    if suffix != ".nc":                                # HDF5 lays out what grows by the order of writing
        assert (tmp_path / f"blocks{suffix}").read_bytes() == (tmp_path / f"line{suffix}").read_bytes()


@pytest.mark.parametrize("suffix", survey_lines.SUFFIXES)
def test_a_line_that_breaks_off_leaves_no_file_and_keeps_an_older_one(suffix, tmp_path):
    def breaking():
        yield LINE.isel(ping=slice(0, 2))
        raise RuntimeError("the scene broke")

    path = tmp_path / f"line{suffix}"
    path.write_bytes(b"older")
    with pytest.raises(RuntimeError, match="the scene broke"):
        survey_lines.write(breaking(), path)
    assert path.read_bytes() == b"older" and len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("blocks, options, said", [
    ([], {}, "no ping was given"), ([LINE.isel(ping=slice(0, 0))], {}, "no ping was given"),
    ([LINE.drop_vars("angle")], {}, "lacks angle"), ([LINE], {"place": (54.0, 8.0)}, "leave place out"),
    ([LINE.drop_attrs(deep=False)], {"place": (95.0, 8.0)}, "latitude and longitude"),
    ([LINE], {"start": "yesterday"}, "give a date and time"), ([LINE], {"start": "1950-01-01"}, "between 1970"),
    ([LINE, LINE.isel(beam=slice(0, 9))], {}, "other variables, beams, samples or motion"),
    ([LINE, LINE.isel(motion=slice(9))], {}, "motion of the whole line"),
    ([LINE.assign_attrs(crs="EPSG:4326")], {}, "not one in metres")])
def test_what_is_no_line_is_refused_in_a_sentence(blocks, options, said, tmp_path):
    with pytest.raises(ValueError, match=said) as caught:
        survey_lines.write(blocks, tmp_path / "line.gsf", **options)
    assert "\n" not in str(caught.value) and not list(tmp_path.iterdir())


def test_another_suffix_is_answered_by_those_that_are_known(tmp_path):
    with pytest.raises(ValueError, match=r"\.gsf, \.kmall, \.s7k, \.nc, \.csv or \.las"):
        survey_lines.write(LINE, tmp_path / "line.xyz")


def test_the_netcdf_library_reads_what_h5py_has_written(tmp_path):
    """GDAL reads variables of two dimensions by the C library of netCDF, which knows dimensions by HDF5's scales."""
    if "netCDF" not in rasterio.drivers.raster_driver_extensions().values():
        pytest.skip("rasterio has no netCDF here")
    survey_lines.write(LINE, tmp_path / "line.nc")
    for name in ("depth", "travel_time", "quality"):
        with warnings.catch_warnings(), rasterio.open(f"netcdf:{tmp_path / 'line.nc'}:{name}") as found:
            warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
            assert np.array_equal(found.read(1)[::-1], LINE[name].values, equal_nan=True)     # the last row is first


def test_netcdf_gives_back_what_was_written(tmp_path):
    for line in (LINE, soundings_line(pings=3, sectors=2, column=False, snippets=False, crs=None)):
        survey_lines.write(blocks_of(line), tmp_path / "line.nc")
        read = mitsonar.read(tmp_path / "line.nc")
        assert read.identical(line)
        for name, value in read.variables.items():
            assert value.dtype == line[name].dtype, name
        with xr.open_dataset(tmp_path / "line.nc", engine="h5netcdf") as plain:
            assert np.array_equal(plain["depth"], line["depth"], equal_nan=True)


def test_netcdf_has_the_groups_of_the_sonar_convention(tmp_path):
    path = tmp_path / "line.nc"
    survey_lines.write(blocks_of(LINE), path)

    def group(name):
        with xr.open_dataset(path, engine="h5netcdf", group=name) as found:
            return found.load()

    assert group("/").attrs["sonar_convention_name"] == "SONAR-netCDF4"
    beams = group("Sonar/Beam_group1")
    assert np.array_equal(beams["backscatter_r"], LINE["column_level_db"], equal_nan=True)
    assert np.allclose(beams["rx_beam_rotation_phi"], np.degrees(LINE["column_angle"]))
    assert np.allclose(beams["sample_interval"], 1 / LINE["column_rate"])
    assert np.allclose(beams["transmit_frequency_stop"] - beams["transmit_frequency_start"], LINE["sector_bandwidth"])
    assert np.array_equal(beams["transmit_beam_index"], LINE["column_sector"])
    since = (beams["ping_time"].values - np.datetime64("2026-05-01T10:00:00")) / np.timedelta64(1, "ns")
    assert np.allclose(since, 1e9 * LINE["ping_time"].values, atol=300)       # of 64 bits since 1970
    assert np.allclose(group("Platform/Attitude/001")["roll"], np.degrees(LINE["motion_roll"]))
    assert np.allclose(group("Environment/Sound_speed_profile")["sound_speed"], LINE["cast_sound_speed"])
    assert group("Provenance").attrs["conversion_software_name"] == "mitsonar"
    with h5py.File(path) as file:                      # two names of one thing
        assert file["column_level_db"] == file["Sonar/Beam_group1/backscatter_r"]


def test_a_table_has_a_sounding_a_line_with_units(tmp_path):
    survey_lines.write(blocks_of(LINE), tmp_path / "line.csv")
    header, *rows = (tmp_path / "line.csv").read_text().splitlines()
    table = dict(zip(header.split(","), np.array([row.split(",") for row in rows]).T))
    valid = LINE["valid"].values
    assert len(rows) == valid.sum()
    assert np.allclose(table["depth [m]"].astype(float), LINE["depth"].values[valid], atol=5.1e-5)
    assert np.allclose(table["angle [deg]"].astype(float), np.degrees(LINE["angle"].values[valid]), atol=5.1e-6)
    assert np.allclose(table["easting [m]"].astype(float), LINE["x"].values[valid] + 448_000, atol=5.1e-5)
    assert np.array_equal(table["beam"].astype(int), np.nonzero(valid)[1])
    assert np.array_equal(table["ping"].astype(int), np.nonzero(valid)[0])
    assert table["time [UTC]"][0] == "2026-05-01T10:00:01.000000"
    assert {"true_depth [m]", "error [m]", "label", "backscatter_db [dB]", "latitude [deg]"} <= set(table)


def test_a_table_says_latitudes_where_a_place_is_said(tmp_path):
    line = soundings_line(pings=1, crs=None)
    survey_lines.write(line, tmp_path / "line.csv")
    assert "latitude" not in (tmp_path / "line.csv").read_text().splitlines()[0]
    survey_lines.write(line, tmp_path / "line.csv", place=(54.0, 8.0), start="2027-01-01T00:00:00Z")
    header, row, *_ = (tmp_path / "line.csv").read_text().splitlines()
    said = dict(zip(header.split(","), row.split(",")))
    # A degree of latitude is 111.3 km at 54 degrees north.
    assert float(said["latitude [deg]"]) == pytest.approx(54 + float(said["y [m]"]) / 111_316, abs=1e-6)
    assert said["time [UTC]"].startswith("2027-01-01")


@pytest.mark.parametrize("suffix", (".csv", ".las"))
def test_written_strengths_stand_beside_those_of_the_bed(suffix, tmp_path):
    line, path = LINE.assign(written_backscatter_db=LINE["backscatter_db"] + 3), tmp_path / f"line{suffix}"
    survey_lines.write(blocks_of(line), path)
    if suffix == ".las":
        cloud = pytest.importorskip("laspy").read(path)
        found = [np.asarray(cloud[f"{name}backscatter_db"]) for name in ("written_", "")]
    else:
        header, *rows = path.read_text().splitlines()
        table = dict(zip(header.split(","), np.array([row.split(",") for row in rows]).T))
        found = [table[f"{name}backscatter_db [dB]"].astype(float) for name in ("written_", "")]
    assert np.isfinite(found).any() and np.nanmax(np.abs(found[0] - found[1] - 3)) < 2e-3       # CSV: rounded to 1e-3


def test_a_point_cloud_has_places_classes_and_the_records_names(tmp_path):
    laspy = pytest.importorskip("laspy")
    line = LINE.copy(deep=True)
    line["valid"][2, 7] = False                        # has a place, and is rejected
    survey_lines.write(blocks_of(line), tmp_path / "line.las")
    cloud, there = laspy.read(tmp_path / "line.las"), np.isfinite(line["x"].values)
    assert (str(cloud.header.version), cloud.header.point_format.id) == ("1.4", 6)
    assert np.abs(cloud.z + line["depth"].values[there]).max() <= 5.001e-4
    assert np.abs(cloud.x - line["x"].values[there] - 448_000).max() <= 5.001e-4
    assert np.abs(cloud.y - line["y"].values[there] - 5_955_000).max() <= 5.001e-4
    assert np.array_equal(cloud.classification == 1, line["valid"].values[there])
    assert set(np.unique(cloud.classification)) == {1, 7}
    assert np.abs(cloud.intensity / 100 - 100 - line["backscatter_db"].values[there]).max() < 0.0051
    assert np.array_equal(cloud["true_depth"], line["true_depth"].values[there])
    assert np.array_equal(cloud["beam"], np.nonzero(there)[1])
    assert cloud.header.parse_crs().to_epsg() == 32632
    # 2026-05-01T10:00:01Z is GPS second 1,461,664,819.
    assert cloud.gps_time[0] == pytest.approx(461_664_819.0, abs=1e-5)


def test_a_point_cloud_about_a_place_has_a_projection_of_its_own(tmp_path):
    laspy = pytest.importorskip("laspy")
    line = soundings_line(pings=1, crs=None)
    written = survey_lines.write(line, tmp_path / "line.las")
    assert laspy.read(tmp_path / "line.las").header.parse_crs() is None
    assert any("names no coordinate system" in words for words in written.words)
    survey_lines.write(line, tmp_path / "line.las", place=(54.0, 8.0))
    assert "Transverse Mercator" in laspy.read(tmp_path / "line.las").header.parse_crs().to_wkt()


def test_beams_point_where_their_cones_cross_on_turned_arrays():
    # Arrays turned against each other: the direction has both sines again, and the length 1.
    line = LINE.copy(deep=True)
    line["transmit_mounting"].values[:], line["receive_mounting"].values[:] = (0.02, 0.03, 0.05), (0.1, -0.04, 0.2)
    opened, blocks = line_of(line)
    ping = next(pings(opened, next(blocks)))
    along, across = array_axes(opened)
    away = level(opened, ping) @ mounting_matrix(float(ping["ping_roll"]), float(ping["ping_pitch"]), 0.0)
    assert np.allclose(np.linalg.norm(away, axis=1), 1)
    assert np.allclose(away @ along, np.sin(ping["transmit_angle"]))
    assert np.allclose(away @ across, np.sin(ping["angle"]))


@pytest.mark.parametrize("suffix", [".gsf", ".kmall", ".nc"])
def test_memory_does_not_grow_with_the_line(suffix, tmp_path):
    block = soundings_line(pings=12)
    survey_lines.write(block, tmp_path / f"warm{suffix}")

    def most(blocks):
        tracemalloc.start()
        survey_lines.write((block for _ in range(blocks)), tmp_path / f"line{suffix}")
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak

    few, many = most(2), most(6)
    assert many < few + 0.5 * block.nbytes             # 48 pings more, four blocks


def gaps():
    """A line as instruments leave it: a ping without beams, one without a sounding, fewer sectors, no water column."""
    line = LINE.copy(deep=True)
    for name in ("angle", "transmit_angle", "travel_time", "x", "y", "depth", "across_track", "along_track"):
        line[name].values[1] = np.nan
        if name not in ("angle", "transmit_angle"):
            line[name].values[2] = np.nan
    line["valid"].values[1:3] = False
    line["angle"].values[4, 8] = line["x"].values[4, 8] = np.nan
    line["valid"].values[4, 8] = False
    for name in line.data_vars:
        if line[name].dims == ("ping", "transmission"):
            line[name].values[3, 2] = np.nan
        if line[name].dims[:2] == ("ping", "column_beam") and line[name].dtype.kind == "f":
            line[name].values[3] = np.nan
    line["sector"].values[3] = np.minimum(line["sector"].values[3], 1)
    return line


@pytest.mark.parametrize("suffix", survey_lines.SUFFIXES)
def test_pings_with_gaps_are_written(suffix, tmp_path):
    line = gaps()
    written = survey_lines.write(blocks_of(line), tmp_path / f"line{suffix}")
    assert written.soundings == int(line["valid"].sum())
    if suffix in (".gsf", ".kmall"):
        assert written.pings == 4 and "1 ping without beams left out" in written.words


def test_gaps_are_read_back_as_gaps(tmp_path):
    from GSFU.gsfu import gsf

    line = gaps()
    for suffix in (".gsf", ".kmall"):
        survey_lines.write(blocks_of(line), tmp_path / f"line{suffix}")
    reader = gsf(str(tmp_path / "line.gsf"))
    pings = [one[-1] for one in reader.iter_records("GSF_RECORD_SWATH_BATHYMETRY_PING")]
    beams = [int(np.isfinite(line["angle"].values[number]).sum()) for number in (0, 2, 3, 4)]
    assert [one["NumberBeams"] for one in pings] == beams
    assert [len(one["SensorSpecific"]["TxSectors"]["TxSectorNumb"]) for one in pings] == [3, 3, 2, 3]
    assert np.all(pings[1]["Beams"]["BeamFlags"] == 1)
    reader.closeFile()
    whole = (tmp_path / "line.kmall").read_bytes()
    assert (whole.count(b"#MRZ"), whole.count(b"#MWC")) == (4, 3)


def test_motion_before_1970_is_left_out_and_pings_then_are_refused(tmp_path):
    line = LINE.assign_attrs(start="1970-01-01T00:00:00Z").assign(motion_time=LINE["motion_time"] - 0.5)
    for suffix in survey_lines.SUFFIXES:
        survey_lines.write(line, tmp_path / f"line{suffix}")
    for suffix in (".gsf", ".kmall"):
        with pytest.raises(ValueError, match="ping 0 does not go into"):
            survey_lines.write(line.assign(ping_time=LINE["ping_time"] - 9), tmp_path / f"line{suffix}")


def test_a_ship_at_rest_with_one_sample_of_motion_is_written(tmp_path):
    line = LINE.isel(motion=slice(0, 1))
    for suffix in (".gsf", ".kmall", ".las"):
        assert survey_lines.write(line, tmp_path / f"line{suffix}").pings == 5


@pytest.mark.parametrize("spoilt, words", [
    (lambda line: line.assign(depth=line["depth"].astype(str)), "depth is of the type .*, it must hold numbers"),
    (lambda line: line.assign(valid=line["valid"] * 0.5), "valid is of the type .*, it must hold true or false"),
    (lambda line: line.isel({line["motion_time"].dims[0]: slice(0, 0)}), "the line has no motion"),
    (lambda line: line.assign_attrs(crs="EPSG:32631", origin=[1.0]), "the line's origin is .*; give easting and"),
    (lambda line: line.assign_attrs(crs="EPSG:0", origin=(0.0, 0.0)), "coordinate system .* none that PROJ knows"),
])
def test_records_that_are_spoilt_are_refused_by_every_writer(tmp_path, spoilt, words):
    line = spoilt(soundings_line(pings=2, beams=8, column=False, snippets=False))
    for suffix in survey_lines.SUFFIXES:
        with pytest.raises(ValueError, match=words):
            survey_lines.write(line, tmp_path / f"a{suffix}")
    assert not any(tmp_path.iterdir())
