"""Lines of real sounders, where they are at hand: read the same by other programs, field by field, and consistent."""
from pathlib import Path

import numpy as np
import pytest

from mitsonar.device.earth import Frame
from mitsonar.hydrography.record import joined
from mitsonar.io.survey_lines import reading

MEASURED = Path(__file__).resolve().parents[2] / "../shared/data/measured/multibeam"
EM710, EM2040, EM2042 = MEASURED / "em710_122m.all", MEASURED / "em2040_56m.all", MEASURED / "em2042_os01.kmall"
GSF = MEASURED / "gsf_3_08.gsf"
pytestmark = pytest.mark.skipif(not EM710.is_file(), reason="the shared survey lines are not here")



@pytest.mark.parametrize("path", [EM710, EM2040], ids=lambda path: path.stem)
def test_an_all_file_is_read_as_another_reader_does(path):
    kongsberg = pytest.importorskip("themachinethatgoesping.echosounders.kongsbergall",
                                    reason="needs pip install themachinethatgoesping")
    found = list(kongsberg.KongsbergAllFileHandler([str(path)]).datagram_interface.datagrams())
    line = reading.read(path)
    valid, start = line["valid"].values, np.datetime64(line.attrs["start"].rstrip("Z")).astype("O").timestamp()
    matched = 0
    for raw, xyz in zip(*([one for one in found if type(one).__name__ == name] for name in (
            "RawRangeAndAngle", "XYZDatagram"))):
        points, beams = xyz.get_xyz(), raw.beams.get_beams()
        depth = np.array(points.z) + xyz.get_transmit_transducer_depth()
        ping = next(ping for ping in range(line.sizes["ping"]) if np.allclose(
            line["depth"].values[ping][valid[ping]], depth[valid[ping]], atol=1e-4))
        some, one = valid[ping], line.isel(ping=ping)
        theirs = {"travel_time": [beam.get_two_way_travel_time() for beam in beams],
                  "across_track": points.y, "along_track": points.x,
                  "sector": [beam.get_transmit_sector_number() for beam in beams]}
        for name, values in theirs.items():
            assert np.allclose(one[name].values[some], np.array(values)[some], atol=1e-6), name
        angle = np.array([beam.get_beam_crosstrack_angle_in_degrees() for beam in beams])
        assert np.allclose(np.abs(np.rad2deg(one["angle"].values))[some], np.abs(angle)[some], atol=1e-4)
        assert one["head_sound_speed"] == pytest.approx(raw.get_sound_speed_at_transducer_in_m_per_s())
        assert np.array_equal(some, [beam.get_detection_is_valid() for beam in beams])
        assert start + float(one["ping_time"]) == pytest.approx(raw.get_timestamp(), abs=2e-3)
        matched += 1
    assert matched == line.sizes["ping"]


def test_a_water_column_is_read_as_another_reader_does():
    kongsberg = pytest.importorskip("themachinethatgoesping.echosounders.kongsbergall",
                                    reason="needs pip install themachinethatgoesping")
    handler = kongsberg.KongsbergAllFileHandler([str(EM710.with_suffix(".wcd"))])
    parts = [one for one in handler.datagram_interface.datagrams() if type(one).__name__ == "WatercolumnDatagram"][:3]
    line = reading.read(EM710, pings=slice(0, 1))
    beams = [beam for part in parts for beam in part.beams.get_beams()]
    level = line["column_level_db"].values[0]
    assert len(beams) == level.shape[0]
    speed, rate = float(line["head_sound_speed"][0]), float(line["column_rate"][0, 0])
    reach = (np.arange(level.shape[1]) + 0.5) * speed / (2 * rate)
    for number, beam in list(enumerate(beams))[::20]:
        theirs = 0.5 * np.array(beam.get_samples(), float)
        lost = 2 * float(line["sector_absorption_db"][0, int(line["column_sector"][0, number])])
        gain = 40 * np.log10(reach) + lost * reach + 20
        assert np.allclose((level[number] + gain)[:theirs.size], theirs, atol=1e-3)
        assert np.isnan(level[number][theirs.size:]).all()


def test_places_of_a_kmall_line_are_its_latitudes_and_longitudes():
    """The sounder gives places twice, in metres and in degrees. UTM's scale is left out: 0.05 % of 7 m here."""
    from mitsonar.io.survey_lines.kongsberg.kmall_datagrams import datagrams, decoded

    line = reading.read(EM2042, water_column=False)
    frame = Frame(crs=line.attrs["crs"], origin=line.attrs["origin"])
    with open(EM2042, "rb") as stream:
        pings = sorted(datagrams(stream, ("MRZ",)), key=lambda one: one.time)
        for row, whole in enumerate(decoded(ping) for ping in pings):
            valid, place = line["valid"].values[row], whole["pingInfo"]
            assert not valid[len(whole["sounding"]["deltaLongitude_deg"]):].any()
            valid = np.flatnonzero(valid)
            east, north = frame.places(place["latitude_deg"] + np.array(whole["sounding"]["deltaLatitude_deg"]),
                                       place["longitude_deg"] + np.array(whole["sounding"]["deltaLongitude_deg"])).T
            assert np.allclose(line["x"].values[row][valid], east[valid], atol=0.004)
            assert np.allclose(line["y"].values[row][valid], north[valid], atol=0.004)


def test_depths_of_a_gsf_line_are_those_of_the_official_library():
    gsfpy = pytest.importorskip("gsfpy3_08", reason="needs gsfpy, of mitsonar[test]")
    from gsfpy3_08.enums import RecordType

    line = reading.read(GSF)
    row = 0
    with gsfpy.open_gsf(str(GSF)) as file:
        while row < line.sizes["ping"]:
            _, record = file.read(RecordType.GSF_RECORD_SWATH_BATHYMETRY_PING)
            ping = record.mb_ping
            valid = line["valid"].values[row]
            for name, array in (("depth", ping.depth), ("across_track", ping.across_track),
                                ("along_track", ping.along_track), ("travel_time", ping.travel_time)):
                assert np.allclose(line[name].values[row][valid], np.array(array[:ping.number_beams])[valid], atol=1e-6)
            assert np.array_equal(valid, [flag & 1 == 0 for flag in ping.beam_flags[:ping.number_beams]])
            row += 1


@pytest.mark.parametrize("path", [EM710, EM2042, GSF], ids=lambda path: path.stem)
def test_blocks_of_a_line_are_the_line(path):
    assert joined(reading.blocks(path, size=3)).identical(reading.read(path))


def test_a_head_of_two_has_its_own_lever_arm():
    line = reading.read(EM2040, head=1)
    assert line.sizes["ping"] == 6 and line["receive_offset"][1] == pytest.approx(0.338, abs=0.01)
    assert np.rad2deg(line["receive_mounting"][0]) == pytest.approx(-34.98)
    assert np.nanmedian(line["across_track"]) > 0 > np.nanmedian(reading.read(EM2040, head=0)["across_track"])
