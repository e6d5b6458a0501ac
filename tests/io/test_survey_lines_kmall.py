"""KMALL files of soundings, read back field by field by two readers of others, and laid beside an instrument's."""
import struct
from pathlib import Path

import numpy as np
import pytest
from soundings_line import blocks_of, soundings_line

from mitsonar.device.rotations import mounting_matrix
from mitsonar.io import survey_lines
from mitsonar.io.survey_lines.reading import read

LINE = soundings_line(pings=5, speeds=(1502.0, 1498.0, 1510.0))
START = 1_777_629_600                                  # 2026-05-01T10:00:00Z
CONVERGENCE = -0.636                                   # degrees, of the meridians there
MEASURED = Path(__file__).resolve().parents[3] / "shared" / "data" / "measured" / "multibeam"


def datagrams(path, *kinds):
    """What pykmall reads of some kinds, in the order of the file."""
    from KMALL.kmall import kmall

    reader = kmall(str(path))
    reader.OpenFiletoRead()
    reader.file_size = Path(path).stat().st_size
    at = 0
    while at < reader.file_size:
        reader.FID.seek(at)
        length, kind = struct.unpack("<I4s", reader.FID.read(8))
        reader.FID.seek(at + length - 4)
        assert struct.unpack("<I", reader.FID.read(4))[0] == length
        if kind.decode() in kinds:
            reader.FID.seek(at)
            yield getattr(reader, f"read_EMdgm{kind.decode()[1:]}")()
        at += length
    assert at == reader.file_size
    reader.closeFile()


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    target = tmp_path_factory.mktemp("kmall") / "line.kmall"
    written = survey_lines.write(blocks_of(LINE), target)
    assert (written.pings, written.soundings) == (5, int(LINE["valid"].sum()))
    return target


def there(number):
    return np.isfinite(LINE["angle"].values[number])


def test_every_sounding_is_read(path):
    # Numbers of 32 bits: seven digits.
    for number, ping in enumerate(datagrams(path, "#MRZ")):
        own, read = LINE.isel(ping=number, beam=there(number)), ping["sounding"]
        valid = own["valid"].values
        assert np.array_equal(np.array(read["detectionType"]) == 0, valid)
        assert np.allclose(read["beamAngleReRx_deg"], -np.degrees(own["angle"].values), rtol=2e-7)
        assert np.array_equal(read["txSectorNumb"], own["sector"].values)
        for field, values in [
                ("twoWayTravelTime_sec", own["travel_time"]), ("y_reRefPoint_m", own["across_track"]),
                ("x_reRefPoint_m", own["along_track"]), ("z_reRefPoint_m", own["depth"] - own["ping_depth"]),
                ("reflectivity2_dB", own["backscatter_db"]), ("detectionUncertaintyVer_m", own["uncertainty"]),
                ("detectionUncertaintyHor_m", own["horizontal_uncertainty"]), ("detectionMethod", own["detection"]),
                ("qualityFactor", 100 / 10.0**own["quality"])]:
            assert np.allclose(np.array(read[field])[valid], values.values[valid], rtol=3e-7, atol=1e-9), field


def test_depths_below_the_water_line_are_the_soundings(path):
    for number, ping in enumerate(datagrams(path, "#MRZ")):
        own = LINE.isel(ping=number, beam=there(number))
        below = np.array(ping["sounding"]["z_reRefPoint_m"]) - ping["pingInfo"]["z_waterLevelReRefPoint_m"]
        assert np.abs(below - own["depth"].values)[own["valid"].values].max() < 1e-5
        offset = mounting_matrix(float(own["ping_roll"]), float(own["ping_pitch"])) @ LINE["transmit_offset"].values
        assert ping["pingInfo"]["txTransducerDepth_m"] == pytest.approx(float(own["ping_depth"]) + offset[2], abs=1e-6)


def test_soundings_lie_where_latitudes_and_longitudes_say(path):
    import pyproj

    back = pyproj.Transformer.from_crs("EPSG:4326", LINE.attrs["crs"], always_xy=True)
    for number, ping in enumerate(datagrams(path, "#MRZ")):
        own, info, read = LINE.isel(ping=number, beam=there(number)), ping["pingInfo"], ping["sounding"]
        assert ping["header"]["dgtime"] - START == pytest.approx(float(own["ping_time"]), abs=1e-6)
        east, north = back.transform(info["longitude_deg"] + np.array(read["deltaLongitude_deg"]),
                                     info["latitude_deg"] + np.array(read["deltaLatitude_deg"]))
        away = np.hypot(east - LINE.attrs["origin"][0] - own["x"].values,
                        north - LINE.attrs["origin"][1] - own["y"].values)[own["valid"].values]
        assert away.max() < 1e-4                       # deltas of 32 bits


def test_sectors_are_read(path):
    for number, ping in enumerate(datagrams(path, "#MRZ")):
        own, read = LINE.isel(ping=number), ping["txSectorInfo"]
        for field, name, factor in [
                ("sectorTransmitDelay_sec", "sector_delay", 1), ("tiltAngleReTx_deg", "sector_angle", np.degrees(1)),
                ("centreFreq_Hz", "sector_frequency", 1), ("signalBandWidth_Hz", "sector_bandwidth", 1),
                ("totalSignalLength_sec", "sector_pulse_length", 1),
                ("txNominalSourceLevel_dB", "sector_source_level_db", 1)]:
            assert np.allclose(read[field], factor * own[name].values, rtol=2e-7), field


def test_the_seabed_image_holds_the_snippets(path):
    for number, ping in enumerate(datagrams(path, "#MRZ")):
        own, read = LINE.isel(ping=number, beam=there(number)), ping["sounding"]
        assert ping["rxInfo"]["seabedImageSampleRate"] == 20e3
        samples = own["snippet_db"].values
        assert np.array_equal(read["SInumSamples"], np.isfinite(samples).sum(1))
        assert np.abs(0.1 * np.array(ping["SIsample_desidB"]) - samples[np.isfinite(samples)]).max() < 0.0501
        some = own["valid"].values
        assert np.array_equal(np.array(read["SIstartRange_samples"])[some],
                              np.rint(20e3 * own["snippet_start"].values[some]))


def gained(own):
    """Levels of a ping's water column with the format's gain against absorption, 2 a R with R = c t / 2."""
    level, rate = own["column_level_db"].values, own["column_rate"].values[:, None]
    time = own["column_start"].values[:, None] + (np.arange(level.shape[1]) + 0.5) / rate
    absorption = own["sector_absorption_db"].values[own["column_sector"].values]
    return level + absorption[:, None] * float(own["head_sound_speed"]) * time


def test_the_water_column_comes_back(path):
    back = read(path)["column_level_db"].values
    level = LINE["column_level_db"].values[..., :back.shape[-1]]
    heard = np.isfinite(back) & np.isfinite(level)
    assert heard.sum() > 0.9 * np.isfinite(level).sum()
    assert np.abs(back - level)[heard].max() < 0.29                   # and half a sample of absorption


def test_the_water_column_is_read_to_a_quarter_of_a_decibel(path):
    draught = float(LINE["motion_depth"].mean())
    for number, ping in enumerate(datagrams(path, "#MWC")):
        own, beams, about = LINE.isel(ping=number), ping["beamData"], ping["rxInfo"]
        assert (about["sampleFreq_Hz"], about["TVGfunctionApplied"], about["phaseFlag"]) == (1500.0, 0, 0)
        assert ping["txInfo"]["heave_m"] == pytest.approx(float(own["ping_depth"]) - draught, abs=1e-6)
        assert np.array_equal(beams["beamTxSectorNum"], own["column_sector"].values)
        level = gained(own)
        for index, values in enumerate(beams["sampleAmplitude05dB_p"]):
            heard = level[index][np.isfinite(level[index])]
            assert np.abs(0.5 * np.array(values) - about["TVGoffset_dB"] - heard).max() <= 0.2501
        straight = mounting_matrix(float(own["ping_roll"]), float(own["ping_pitch"]))[2, 1]
        assert np.allclose(beams["beamPointAngReVertical_deg"],
                           np.degrees(np.arcsin(straight) - own["column_angle"].values), atol=1e-5)
        # The bed stands out where the soundings beside say, at beams that see it under the same angle or nearly so.
        found = np.array(beams["detectedRangeInSamplesHighResolution"])
        inner = slice(6, 10)
        assert np.abs(found - np.nanargmax(level, axis=1))[inner].max() < 3


def test_motion_positions_cast_and_the_heads_sound_speed_are_there(path):
    motion = [one["sample"]["KMdefault"] for one in datagrams(path, "#SKM")]
    time, roll, pitch, heave = (np.concatenate([one[name] for one in motion])
                                for name in ("dgtime", "roll_deg", "pitch_deg", "heave_m"))
    assert np.allclose(time - START, LINE["motion_time"].values, atol=1e-6)
    assert np.allclose(roll, np.degrees(LINE["motion_roll"].values), atol=1e-5)
    assert np.allclose(pitch, np.degrees(LINE["motion_pitch"].values), atol=1e-5)
    # Heave and the water line of the installation give the depth of the reference point.
    draught = float(LINE["motion_depth"].mean())
    assert np.allclose(heave + draught, LINE["motion_depth"].values, atol=1e-6)
    text, = [one["install_txt"] for one in datagrams(path, "#IIP")]
    assert f"EMXI:SWLZ={-draught:.4f}" in text and "TRAI_TX1:N=1;X=1.2000;Y=0.3000;Z=0.9000" in text
    cast, = datagrams(path, "#SVP")
    assert cast["sensorData"]["depth_m"] == [0, 20, 200]
    assert cast["sensorData"]["soundVelocity_mPerSec"] == [1502, 1498, 1510]
    # The sensor is read once a second; the five pings take 1.6 s.
    assert [one["sensorData"]["soundVelocity_mPerSec"] for one in datagrams(path, "#SVT")] == [[1500.0]] * 2
    fixes = list(datagrams(path, "#SPO"))
    assert len(fixes) > 20
    for one in fixes:
        data = one["sensorData"]
        assert data["speedOverGround_mPerSec"] == pytest.approx(np.hypot(2, 3), rel=1e-3)      # of the projection
        sentence = data["posDataFromSensor"].split(",")
        minutes = float(sentence[2])
        assert minutes // 100 + minutes % 100 / 60 == pytest.approx(data["correctedLat_deg"], abs=1e-8)


def test_pykmall_reads_installation_and_settings_as_tables(path):
    from KMALL.kmall import kmall

    reader = kmall(str(path))
    installation, = [one["install_txt"] for one in datagrams(path, "#IIP")]
    assert reader.translate_installation_parameters_todict(installation)["sonar_model_number"] == "EM2040"
    settings, = [one["runtime_txt"] for one in datagrams(path, "#IOP")]
    assert "mitsonar" in reader.translate_runtime_parameters_todict(settings)["Remark"]


def test_datagrams_come_in_the_order_of_time(path):
    times = [one["header"]["dgtime"] for one in datagrams(path, "#SKM", "#SPO", "#SVT", "#MRZ", "#MWC")]
    assert np.all(np.diff(times) >= -1e-6)


def test_structures_are_as_long_as_an_instruments(path):
    theirs = MEASURED / "em2042_os01.kmall"
    if not theirs.exists():
        pytest.skip(f"there is no {theirs}")
    for kind, group, fields in [
            ("#MRZ", "pingInfo", ("numBytesInfoData", "numBytesPerTxSector")),
            ("#MRZ", "rxInfo", ("numBytesRxInfo", "numBytesPerSounding", "numBytesPerClass")),
            ("#MRZ", "cmnPart", ("numBytesCmnPart",)), ("#MRZ", "header", ("dgmVersion",)),
            ("#SKM", "infoPart", ("numBytesInfoPart", "numBytesPerSample")), ("#SKM", "header", ("dgmVersion",)),
            ("#SVT", "infoPart", ("numBytesInfoPart", "numBytesPerSample")), ("#SVP", "header", ("dgmVersion",)),
            ("#SPO", "cmnPart", ("numBytesCmnPart",)), ("#SPO", "header", ("dgmVersion",))]:
        ours, others = next(datagrams(path, kind))[group], next(datagrams(theirs, kind))[group]
        assert [ours[field] for field in fields] == [others[field] for field in fields], (kind, group)
    column = next(datagrams(theirs.with_suffix(".kmwcd"), "#MWC"))
    ours = next(datagrams(path, "#MWC"))
    for group, field in (("txInfo", "numBytesTxInfo"), ("txInfo", "numBytesPerTxSector"), ("rxInfo", "numBytesRxInfo"),
                         ("rxInfo", "numBytesPerBeamEntry"), ("header", "dgmVersion")):
        assert ours[group][field] == column[group][field]


def test_themachinethatgoesping_reads_soundings_and_water_column(path):
    kmall = pytest.importorskip("themachinethatgoesping.echosounders.kmall",
                                reason="themachinethatgoesping is not installed (pip install themachinethatgoesping)")
    pings = kmall.KMALLFileHandler([str(path)], show_progress=False).get_pings()
    assert len(pings) == 5
    for number, ping in enumerate(pings):
        own = LINE.isel(ping=number, beam=there(number))
        valid = own["valid"].values
        assert ping.get_timestamp() - START == pytest.approx(float(own["ping_time"]), abs=1e-6)
        assert np.allclose(np.array(ping.bottom.get_two_way_travel_times())[valid], own["travel_time"].values[valid],
                           rtol=2e-7)
        assert np.allclose(ping.bottom.get_beam_crosstrack_angles(), -np.degrees(own["angle"].values), rtol=2e-7)
        places = ping.bottom.get_xyz()
        for axis, values in (("x", own["along_track"]), ("y", own["across_track"]),
                             ("z", own["depth"] - own["ping_depth"])):
            assert np.allclose(np.array(getattr(places, axis))[valid], values.values[valid], atol=1e-5)
        signals = ping.bottom.get_tx_signal_parameters()
        assert [one.get_center_frequency() for one in signals] == list(own["sector_frequency"].values)
        column = ping.watercolumn
        assert column.get_sample_interval() == pytest.approx(1 / 1500, rel=1e-6)
        level = gained(own)
        read = np.array(column.get_amplitudes())[:, :level.shape[1]] - column.get_tvg_offset()
        heard = np.isfinite(level[:, :read.shape[1]])
        assert np.abs(read - level[:, :read.shape[1]])[heard].max() <= 0.2501
        place = ping.get_geolocation()
        assert place.yaw == pytest.approx(np.degrees(float(own["ping_heading"])) % 360 + CONVERGENCE, abs=2e-3)
        assert (place.roll, place.pitch) == (pytest.approx(np.degrees(float(own["ping_roll"])), abs=2e-3),
                                             pytest.approx(np.degrees(float(own["ping_pitch"])), abs=2e-3))


def test_a_line_without_water_column_and_snippets_is_written(tmp_path):
    line = soundings_line(pings=2, sectors=1, column=False, snippets=False, crs=None)
    written = survey_lines.write(line, tmp_path / "a.kmall")
    assert "latitude 0, longitude 0" in " ".join(written.words)
    assert len(list(datagrams(tmp_path / "a.kmall", "#MRZ"))) == 2
    assert not list(datagrams(tmp_path / "a.kmall", "#MWC"))


def test_beams_of_the_water_column_with_several_rates_are_refused(tmp_path):
    line = soundings_line(pings=1)
    line["column_rate"][0, 3] = 700.0
    with pytest.raises(ValueError, match="KMALL has one a ping"):
        survey_lines.write(line, tmp_path / "a.kmall")
    assert not list(tmp_path.iterdir())


def test_an_instruments_name_gives_its_number(tmp_path):
    line = soundings_line(pings=1, column=False).assign_attrs(sonar="Kongsberg EM 710")
    survey_lines.write(line, tmp_path / "a.kmall")
    assert next(datagrams(tmp_path / "a.kmall", "#MRZ"))["header"]["echoSounderID"] == 710


def test_pings_are_counted_from_one_at_their_rate_and_no_height_above_the_ellipsoid_is_said(path):
    # A widely used reader takes a change of the counter for a new ping, and its own begins at 0.
    pings, fixes = list(datagrams(path, "#MRZ")), list(datagrams(path, "#SPO"))
    assert [one["cmnPart"]["pingCnt"] for one in pings] == [1, 2, 3, 4, 5]
    assert [one["pingInfo"]["pingRate_Hz"] for one in pings] == pytest.approx([2.5] * 5, rel=1e-6)
    assert {one["pingInfo"]["ellipsoidHeightReRefPoint_m"] for one in pings} == {-999.0}
    assert {one["sensorData"]["ellipsoidHeightReRefPoint_m"] for one in fixes} == {-999.0}


def test_pings_of_two_heads_and_two_swaths_are_one_cycle(tmp_path):
    line = soundings_line(pings=8, column=False, snippets=False)
    time = np.repeat(1.0 + 0.4 * np.arange(2), 4) + np.tile([0.0, 0.0, 0.003, 0.003], 2)
    survey_lines.write(line.assign(ping_time=("ping", time)), tmp_path / "line.kmall")
    rates = [one["pingInfo"]["pingRate_Hz"] for one in datagrams(tmp_path / "line.kmall", "#MRZ")]
    assert rates == pytest.approx([2.5] * 8, rel=1e-6)


def test_the_speed_over_ground_is_not_that_of_the_positions_noise(tmp_path):
    # 2 cm of noise at 50 Hz are 0.7 m/s of difference from sample to sample; the ship sails at 3.6 m/s.
    line = soundings_line(pings=12, column=False, snippets=False)
    chance = np.random.default_rng(1)
    for name in ("motion_x", "motion_y"):
        line[name] = line[name] + 0.02 * chance.standard_normal(line.sizes["motion"])
    survey_lines.write(line, tmp_path / "line.kmall")
    speed = [one["sensorData"]["speedOverGround_mPerSec"] for one in datagrams(tmp_path / "line.kmall", "#SPO")]
    assert np.abs(np.array(speed) - np.hypot(2, 3)).max() < 0.1
