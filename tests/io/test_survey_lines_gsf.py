"""GSF files of soundings, read back field by field by the format's official library."""
import ctypes

import numpy as np
import pytest
from soundings_line import blocks_of, soundings_line

from mitsonar.hydrography.record import variable
from mitsonar.io import survey_lines
from mitsonar.io.survey_lines import reading

gsfpy = pytest.importorskip("gsfpy3_09", reason="gsfpy, with the official library, is not installed")
LINE = soundings_line(pings=5, speeds=(1502.0, 1498.0, 1510.0))
PING, CAST, PARAMETERS, COMMENT, SUMMARY, ATTITUDE = 2, 3, 4, 6, 9, 12


def records(path, kind):
    """All of a kind, copied out by `taken` as the library reads them into memory of its own."""
    with gsfpy.open_gsf(str(path)) as file:
        while True:
            try:
                about, found = file.read()
            except gsfpy.GsfException as error:
                assert "End of file" in error.error_message
                return
            if about.recordID == kind:
                yield found


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    target = tmp_path_factory.mktemp("gsf") / "line.gsf"
    written = survey_lines.write(blocks_of(LINE), target)
    assert (written.pings, written.soundings) == (5, int(LINE["valid"].sum()))
    return target


def beams_of(path, *names):
    """Arrays of every ping, (ping, beam) with NaN for what is padded."""
    out = []
    for found in records(path, PING):
        ping = found.mb_ping
        row = np.full((len(names), LINE.sizes["beam"]), np.nan)
        for index, name in enumerate(names):
            row[index, :ping.number_beams] = [getattr(ping, name)[beam] for beam in range(ping.number_beams)]
        out.append(row)
    return np.stack(out, axis=1)


def parameters_of(path):
    """Processing parameters by their names."""
    found = next(records(path, PARAMETERS)).process_parameters
    return dict(ctypes.string_at(found.param[index]).decode().split("=", 1)
                for index in range(found.number_parameters))


def test_the_official_library_reads_every_sounding(path):
    # Tolerances are half a step of the arrays' scales, and the library's rounding by 0.501.
    valid = LINE["valid"].values
    for name, ours, factor, step in [
            ("depth", "depth", 1, 1e-4), ("across_track", "across_track", 1, 1e-4),
            ("along_track", "along_track", 1, 1e-4), ("travel_time", "travel_time", 1, 1e-8),
            ("mc_amplitude", "backscatter_db", 1, 0.01), ("quality_factor", "quality", 1, 0.02),
            ("vertical_error", "uncertainty", 1.96, 1e-3), ("sector_number", "sector", 1, 0),
            ("horizontal_error", "horizontal_uncertainty", 2.448 / np.sqrt(2), 1e-3),
            ("sonar_vert_uncert", "uncertainty", 1, 1e-3), ("detection_info", "detection", 1, 0)]:
        read = beams_of(path, name)[0]
        assert np.abs(read - factor * LINE[ours].values)[valid].max() <= 0.52 * step + 1e-9, name


def test_beams_without_a_sounding_are_flagged_and_padding_is_left_out(path):
    flags = beams_of(path, "beam_flags")[0]
    padded = np.isnan(LINE["angle"].values)
    assert padded.sum() == 1 and np.isnan(flags[padded]).all()
    assert np.array_equal(flags[~padded] == 0, LINE["valid"].values[~padded])


def test_beam_angles_are_takeoff_angles_of_the_level_ship(path):
    # Turned back by the ping's own roll and pitch they are the cones that the arrays measured, to the angles' steps.
    theta, phi = np.radians(beams_of(path, "beam_angle", "beam_angle_forward"))
    level = np.stack([np.sin(theta) * np.sin(phi), np.sin(theta) * np.cos(phi), np.cos(theta)])
    roll, pitch = LINE["ping_roll"].values[:, None], LINE["ping_pitch"].values[:, None]
    tilted = level[2] * np.cos(pitch) + level[0] * np.sin(pitch)         # about starboard first, then about forward
    forward = level[0] * np.cos(pitch) - level[2] * np.sin(pitch)
    starboard = level[1] * np.cos(roll) + tilted * np.sin(roll)
    there = np.isfinite(LINE["angle"].values)
    for read, name in ((forward, "transmit_angle"), (starboard, "angle")):
        assert np.degrees(np.abs(np.arcsin(read) - LINE[name].values)[there]).max() < 0.005, name


def test_a_ping_has_its_time_place_and_attitude(path):
    import pyproj

    back = pyproj.Transformer.from_crs("EPSG:4326", LINE.attrs["crs"], always_xy=True)
    convergence = pyproj.Proj(LINE.attrs["crs"]).get_factors(8.21, 53.741).meridian_convergence
    for number, found in enumerate(records(path, PING)):
        ping, own = found.mb_ping, LINE.isel(ping=number)
        since = ping.ping_time.tv_sec + 1e-9 * ping.ping_time.tv_nsec
        assert since - 1_777_629_600 == pytest.approx(float(own["ping_time"]), abs=1e-6)      # 2026-05-01T10:00:00Z
        # gsfpy gives latitude and longitude each other's name, those of instruments' files too.
        east, north = back.transform(ping.latitude, ping.longitude)
        assert np.hypot(east - LINE.attrs["origin"][0] - float(own["ping_x"]),
                        north - LINE.attrs["origin"][1] - float(own["ping_y"])) < 0.012       # 1e-7 degrees
        assert ping.heading == pytest.approx(np.degrees(float(own["ping_heading"])) + convergence, abs=0.011)
        assert (ping.roll, ping.pitch) == (pytest.approx(np.degrees(float(own["ping_roll"])), abs=0.006),
                                           pytest.approx(np.degrees(float(own["ping_pitch"])), abs=0.006))
        assert ping.heave == pytest.approx(float(LINE["motion_depth"].mean() - own["ping_depth"]), abs=0.006)
        assert ping.tide_corrector == 0
        assert ping.speed == pytest.approx(np.hypot(2, 3) / 0.514444, abs=0.01)
        assert ping.course == pytest.approx(np.degrees(np.arctan2(2, 3)) + convergence, abs=0.02)


def test_sectors_are_told_with_frequency_tilt_delay_and_pulse(path):
    for number, found in enumerate(records(path, PING)):
        ping = found.mb_ping
        assert ping.sensor_id == 156
        about = ping.sensor_data.gsfKMallSpecific
        assert about.soundSpeedAtTxDepth_mPerSec == pytest.approx(1500.0)
        for index in range(about.numTxSectors):
            sector, own = about.sector[index], LINE.isel(ping=number, transmission=index)
            for field, name, factor, step in [
                    ("centreFreq_Hz", "sector_frequency", 1, 1e-3), ("signalBandWidth_Hz", "sector_bandwidth", 1, 1e-3),
                    ("tiltAngleReTx_deg", "sector_angle", np.degrees(1), 1e-6),
                    ("sectorTransmitDelay_sec", "sector_delay", 1, 1e-6),
                    ("totalSignalLength_sec", "sector_pulse_length", 1, 1e-6),
                    ("txNominalSourceLevel_dB", "sector_source_level_db", 1, 1e-6)]:
                assert getattr(sector, field) == pytest.approx(factor * float(own[name]), abs=step), field


def test_snippets_are_intensity_series_about_the_soundings_sample(path):
    for number, found in enumerate(records(path, PING)):
        series, own = found.mb_ping.brb_inten.contents, LINE.isel(ping=number)
        for beam in range(found.mb_ping.number_beams):
            some = series.time_series[beam]
            samples = own["snippet_db"].values[beam]
            samples = samples[np.isfinite(samples)]
            assert some.sample_count == samples.size
            if samples.size:
                values = (np.array([some.samples[index] for index in range(samples.size)]) - 20_000) / 100
                assert np.abs(values - samples).max() < 0.0051
                assert some.start_range_samples == round(float(own["snippet_start"][beam]) * 20e3)
                heard = (some.start_range_samples + some.detect_sample) / 20e3
                last = some.detect_sample == samples.size - 1
                assert heard == pytest.approx(float(own["travel_time"][beam]), abs=2.6e-5) or last


def test_cast_attitude_and_summary_are_there(path):
    cast, = [found.svp for found in records(path, CAST)]
    assert [cast.depth[index] for index in range(cast.number_points)] == [0, 20, 200]
    assert [cast.sound_speed[index] for index in range(cast.number_points)] == [1502, 1498, 1510]
    roll = np.concatenate([[found.attitude.roll[index] for index in range(found.attitude.num_measurements)]
                           for found in records(path, ATTITUDE)])
    assert np.abs(roll - np.degrees(LINE["motion_roll"].values)).max() < 0.0051
    summary, = [found.summary for found in records(path, SUMMARY)]
    assert summary.min_depth == pytest.approx(float(LINE["depth"].min()), abs=0.006)
    assert summary.max_depth == pytest.approx(float(LINE["depth"].max()), abs=0.006)


def test_parameters_say_lever_arms_and_that_nothing_is_left_to_apply(path):
    said = parameters_of(path)
    assert [float(value) for value in said["APPLIED_TRANSDUCER_OFFSET"].split(",")] == list(
        LINE["transmit_offset"].values)
    assert [float(value) for value in said["APPLIED_RX_TRANSDUCER_OFFSET"].split(",")] == list(
        LINE["receive_offset"].values)
    assert all(float(value.split(",")[0]) == 0 for name, value in said.items() if name.endswith("_TO_APPLY"))
    assert said["DEPTH_CALCULATION"] == "CORRECTED"


def test_comments_say_where_the_line_comes_from(path):
    text = b" ".join(ctypes.string_at(found.comment.comment) for found in records(path, COMMENT)).decode()
    assert "mitsonar" in text and "a plane bed" in text and "true one" in text


def test_what_gsf_cannot_hold_is_said(tmp_path):
    words = " ".join(survey_lines.write(soundings_line(pings=1), tmp_path / "a.gsf").words)
    assert "column_level_db" in words and "true_depth" in words and "travel_time" not in words


def test_a_line_without_snippets_and_with_one_sector_is_written(tmp_path):
    line = soundings_line(pings=2, sectors=1, column=False, snippets=False)
    survey_lines.write(line, tmp_path / "a.gsf")
    pings = [found.mb_ping.sensor_data.gsfKMallSpecific.numTxSectors for found in records(tmp_path / "a.gsf", PING)]
    assert pings == [1, 1]


def test_both_receivers_of_two_heads_are_told_from_port_to_starboard_and_come_back(tmp_path):
    arms, mountings = np.array([[1.0, 0.6, 0.9], [1.0, -0.4, 0.95]]), np.radians([[-35, 0.5, 1], [35, -0.5, 2]])
    line = soundings_line(pings=4, column=False, snippets=False)
    twin = line.assign({name: variable(name, values) for name, values in {
        "head": np.arange(4) % 2, "head_receive_offset": arms, "head_receive_mounting": mountings}.items()})
    words = " ".join(survey_lines.write(twin, tmp_path / "twin.gsf").words)
    assert "head_receive" not in words
    said = parameters_of(tmp_path / "twin.gsf")
    assert said["NUMBER_OF_RECEIVERS"] == "2" and said["NUMBER_OF_TRANSMITTERS"] == "1"
    assert said["APPLIED_RX_TRANSDUCER_OFFSET"] == "+1.0000,-0.4000,+0.9500,+1.0000,+0.6000,+0.9000"
    assert said["APPLIED_RX_TRANSDUCER_ROLL_OFFSET"] == "+35.0000,-35.0000"
    again = reading.read(tmp_path / "twin.gsf")
    assert again["head"].values.tolist() == [1, 0, 1, 0]
    assert np.allclose(again["head_receive_offset"], arms[::-1])
    assert np.allclose(again["head_receive_mounting"], mountings[::-1], atol=1e-6)


def test_tide_and_heights_that_nobody_took_are_not_said_to_be_applied(path):
    assert parameters_of(path)["TIDE_COMPENSATED"] == "NO"
    for found in records(path, PING):
        ping = found.mb_ping
        assert (ping.height, ping.sep) == (pytest.approx(9999.99), pytest.approx(9999.99))         # the format's null


def test_pings_are_counted_from_one(path):
    assert [found.mb_ping.sensor_data.gsfKMallSpecific.pingCnt for found in records(path, PING)] == [1, 2, 3, 4, 5]
