"""Sidescan records as XTF: read back by byte offsets of the format's document, by pyxtf, and by our reader of tracks.

The record: 40 pings northward at 2 m/s, 12 m over a level bed 20 m deep, 200 bins of 0.375 m.
"""
import numpy as np
import pytest
import pyxtf
import xtf_by_bytes
from synthetic_sidescan import sidescan

from mitsonar.io.tracks import tracks
from mitsonar.io.tracks.navigation import Frame
from mitsonar.io.xtf import xtf

UTM = "EPSG:32631"
ORIGIN = [512200.0, 5790240.0]
STARTED = 1777629600.25            # 2026-05-01T10:00:00.25Z


@pytest.fixture
def record():
    made = sidescan(pings=40).assign_attrs(crs=UTM, local_origin=ORIGIN)
    level = made["level"].values.copy()
    level[:, :, 3] = -200                                       # no sound at all
    return made.assign(level=(made["level"].dims, level, made["level"].attrs))


def written(record, path, **options):
    about = xtf.write(record, path, **options)
    return about, *xtf_by_bytes.read(path)


def test_headers_say_where_when_and_how_the_sonar_was(record, tmp_path):
    _, header, channels, _, pings = written(record, tmp_path / "a.xtf", start=STARTED)
    assert header["format"] == 123 and header["units"] == 3 and header["channels"] == 2
    assert [channel["type"] for channel in channels] == [1, 2] and [c["number"] for c in channels] == [0, 1]
    assert all((c["correction"], c["unipolar"], c["format"], c["frequency"]) == (1, 1, 3, 100.0) for c in channels)
    assert channels[0]["name"].startswith(b"Port 100\0") and channels[1]["name"].startswith(b"Starboard 100\0")
    assert len(pings) == 40
    latitude, longitude, convergence = Frame(crs=UTM, origin=tuple(ORIGIN)).on_globe(
        np.stack([record["x"], record["y"]], -1))
    for k, ping in enumerate(pings):
        assert (ping["year"], ping["month"], ping["day"], ping["hour"], ping["minute"], ping["julian_day"]) == (
            2026, 5, 1, 10, 0, 121)
        assert ping["second"] + ping["hundredths"] / 100 == pytest.approx(0.25 + 0.1 * k, abs=0.0051)
        assert ping["number"] == k and ping["sound_speed"] == pytest.approx(1492.3 / 2)
        assert (ping["east"], ping["north"]) == pytest.approx((longitude[k], latitude[k]), abs=1e-11)
        assert ping["ship"] == (ping["north"], ping["east"]) and ping["layback"] == 0 and ping["heave"] == 0
        assert ping["depth"] == pytest.approx(8) and ping["altitude"] == pytest.approx(12)
        assert np.deg2rad(ping["pitch"]) == pytest.approx(float(record["pitch"][k]), abs=1e-8)
        assert np.deg2rad(ping["roll"]) == pytest.approx(float(record["roll"][k]), abs=1e-8)
        north = np.deg2rad(ping["heading"]) - float(record["heading"][k]) - convergence[k]
        assert np.sin(north) == pytest.approx(0, abs=1e-6) and ping["ship_gyro"] == ping["heading"]
        assert ping["speed"] * 1852 / 3600 == pytest.approx(2, rel=1e-3)
        assert ping["aux"] == pytest.approx((float(record["x"][k]), float(record["y"][k]), -8), abs=1e-4)


def test_channels_say_their_ranges_and_gain(record, tmp_path):
    _, _, _, _, pings = written(record, tmp_path / "a.xtf")
    for number, side in enumerate(pings[7]["sides"]):
        assert side["number"] == number and side["count"] == 200 and side["frequency"] == 100
        assert side["slant_range"] == pytest.approx(75) and side["delay"] == 0 and side["weight"] == 0
        assert side["ground_range"] == pytest.approx(np.sqrt(75**2 - 12**2))
        assert side["duration"] == side["per_ping"] == pytest.approx(150 / 1492.3)
        # how readers use half the speed of sound
        assert side["slant_range"] == pytest.approx(side["duration"] * pings[7]["sound_speed"])
        assert side["flags"] == 4                               # time-varied gain


def test_channels_say_their_beams(record, tmp_path):
    built = {"beam_width": 0.4, "vertical_beam_width": 50.0, "depression_angle": 20.0}
    told = record.assign_attrs({name: np.deg2rad(angle) for name, angle in built.items()})
    xtf.write(told, tmp_path / "a.xtf", start=STARTED)
    header, _ = pyxtf.xtf_read(str(tmp_path / "a.xtf"))
    for info in header.ChanInfo[:2]:
        assert (info.HorizBeamAngle, info.BeamWidth, info.TiltAngle) == pytest.approx((0.4, 50, 20))


@pytest.mark.parametrize("tvg", ["seabed", "target", None])
def test_samples_give_the_levels_back_by_the_formula_that_is_written_beside_them(record, tmp_path, tvg):
    about, header, _, notes, pings = written(record, tmp_path / "a.xtf", tvg=tvg)
    note = header["note"].rstrip(b"\0").decode()
    assert note == about.scales[0].words() and note in notes[0]
    assert pings[0]["sides"][0]["flags"] == (4 if tvg else 0)
    text = note.removeprefix("dB re 1uPa = ").replace("20lg n", "20*np.log10(n)").replace("lgR", "*np.log10(R)")
    text = text[:-1] + "*R" if text.endswith("R") else text
    samples = np.stack([[side["samples"] for side in ping["sides"]] for ping in pings])
    samples = np.stack([samples[:, 0, ::-1], samples[:, 1]], 1)               # port: the farthest first
    assert samples.max() > 60_000 and not samples[:, :, 3].any()
    with np.errstate(divide="ignore"):
        level = eval(text, {"np": np, "n": samples.astype(float), "R": record["range"].values})  # our own text
    sure = (samples >= 50) & (samples < 65535)
    assert np.abs(level - record["level"].values)[sure].max() < 20 * np.log10(1 + 0.51 / 50)
    assert sure[:, :, 40:].mean() > 0.7
    np.testing.assert_allclose(about.scales[0].levels(samples, record["range"].values)[sure], level[sure], atol=1e-9)


def test_pyxtf_reads_every_field_alike(record, tmp_path):
    import pyxtf

    xtf.write(record, tmp_path / "a.xtf", start=STARTED)
    header, packets = pyxtf.xtf_read(str(tmp_path / "a.xtf"))
    _, _, _, expected = xtf_by_bytes.read(tmp_path / "a.xtf")
    assert header.channel_count() == 2 and [info.TypeOfChannel for info in header.sonar_info] == [1, 2]
    assert {kind.name: len(found) for kind, found in packets.items()} == {"notes": 2, "pos_raw_navigation": 40,
                                                                          "attitude": 40, "sonar": 40}
    for packet, other in zip(packets[pyxtf.XTFHeaderType.attitude], expected, strict=True):
        assert (packet.Pitch, packet.Roll, packet.Heading) == (other["pitch"], other["roll"], other["heading"])
        assert packet.Millisecond // 10 - other["hundredths"] in (0, -1) and packet.Second == other["second"]
        assert packet.SourceEpoch + 1e-6 * packet.EpochMicroseconds == pytest.approx(
            STARTED + 0.1 * other["number"], abs=1e-9 + 2e-7)
    for ping, other in zip(packets[pyxtf.XTFHeaderType.sonar], expected, strict=True):
        assert (ping.SensorXcoordinate, ping.SensorYcoordinate) == (other["east"], other["north"])
        assert (ping.SensorHeading, ping.SensorPitch, ping.SensorRoll) == (other["heading"], other["pitch"],
                                                                           other["roll"])
        assert (ping.SensorPrimaryAltitude, ping.SoundVelocity) == (other["altitude"], other["sound_speed"])
        for side, samples, own in zip(ping.ping_chan_headers, ping.data, other["sides"], strict=True):
            assert (side.NumSamples, side.SlantRange, side.ChannelNumber) == (own["count"], own["slant_range"],
                                                                              own["number"])
            np.testing.assert_array_equal(samples, own["samples"])
    picture = pyxtf.concatenate_channel(packets[pyxtf.XTFHeaderType.sonar], header, channel=1)
    np.testing.assert_array_equal(picture[::-1], [ping["sides"][1]["samples"] for ping in expected])


@pytest.mark.parametrize("geographic", [True, False])
def test_the_track_that_is_read_from_it_is_the_records_own(record, tmp_path, geographic):
    xtf.write(record, tmp_path / "a.xtf", geographic=geographic, start=STARTED)
    track = tracks.read(tmp_path / "a.xtf", frame=Frame(crs=UTM, origin=tuple(ORIGIN)))
    place = np.stack([record[axis] for axis in "xyz"], -1)
    np.testing.assert_allclose(track.position, place, atol=1e-6)
    np.testing.assert_allclose(track.time, STARTED + record["ping_time"], atol=1e-4)
    for name in ("roll", "pitch", "heading"):
        np.testing.assert_allclose(np.sin(getattr(track, name) - record[name].values), 0, atol=1e-7)


def test_without_a_coordinate_system_positions_are_metres(record, tmp_path):
    _, header, _, notes, pings = written(record.assign_attrs(crs=None), tmp_path / "a.xtf")
    assert header["units"] == 0 and "no coordinate system" in notes[1]
    assert (pings[3]["east"], pings[3]["north"]) == pytest.approx(
        (ORIGIN[0] + float(record["x"][3]), ORIGIN[1] + float(record["y"][3])), abs=1e-6)


def test_frequencies_of_one_track_are_four_channels_the_lower_first(record, tmp_path):
    high = sidescan(pings=40, bins=500).assign_attrs(crs=UTM, local_origin=ORIGIN, frequency=455e3)
    about, header, channels, notes, pings = written([high, record], tmp_path / "a.xtf")
    assert [channel["frequency"] for channel in channels] == [100, 100, 455, 455]
    assert [channel["type"] for channel in channels] == [1, 2, 1, 2] and header["note"].startswith(b"scales: see")
    assert [side["count"] for side in pings[5]["sides"]] == [200, 200, 500, 500]
    assert notes[1].startswith("channels 2, 3 (455 kHz): ") and about.scales[1].words() in notes[1]
    level = about.scales[1].levels(pings[5]["sides"][2]["samples"][::-1], high["range"].values)
    np.testing.assert_allclose(level[100:], high["level"].values[5, 0, 100:], atol=0.2)


def test_a_window_that_begins_later_is_filled_up_with_silence(record, tmp_path):
    late = record.isel(range=slice(50, None))
    _, _, _, _, pings = written(late, tmp_path / "a.xtf")
    port, starboard = pings[0]["sides"]
    assert port["count"] == 200 and port["slant_range"] == pytest.approx(75) and port["delay"] == 0
    assert not starboard["samples"][:50].any() and starboard["samples"][50:].all()
    assert not port["samples"][-50:].any() and port["samples"][:-50].all()


def test_few_bright_echoes_saturate_and_the_bed_keeps_its_steps(record, tmp_path):
    level = record["level"].values.copy()
    level[10, 1, 120] += 150
    about, _, _, _, pings = written(record.assign(level=(record["level"].dims, level)), tmp_path / "a.xtf")
    assert about.saturated == 1 and pings[10]["sides"][1]["samples"][120] == 65535
    assert np.median([ping["sides"][1]["samples"] for ping in pings]) > 500


def test_the_same_record_makes_the_same_bytes(record, tmp_path, monkeypatch):
    xtf.write(record, tmp_path / "a.xtf")
    first = (tmp_path / "a.xtf").read_bytes()
    monkeypatch.setattr(xtf, "BLOCK_BYTES", 4000)               # four pings at a time
    xtf.write(record, tmp_path / "a.xtf")
    assert (tmp_path / "a.xtf").read_bytes() == first


@pytest.mark.parametrize("change, words", [
    (lambda r: r.drop_vars("level"), "has no levels"),
    (lambda r: r.drop_vars("altitude"), "has no altitude"),
    (lambda r: r.isel(ping=slice(0, 0)), "has no pings"),
    (lambda r: r.isel(range=[0]), "two or more ranges in even steps"),
    (lambda r: r.assign_coords(side=["left", "right"]), "side (port, starboard)"),
    (lambda r: r.assign_coords(range=r["range"].values**2), "two or more ranges in even steps"),
    (lambda r: r.assign_coords(range=r["range"].values + 1e8), "readers of XTF can address"),
    (lambda r: r.assign_coords(ping_time=("ping", r["ping_time"].values - 10)), "1970 to 9999"),
    (lambda r: r.assign_coords(x=("ping", np.full(40, np.nan))), "not finite"),
    (lambda r: r.assign_attrs(crs="EPSG:4326"), "not one in metres"),
    (lambda r: r.assign_attrs(crs="nonsense"), "none that PROJ knows"),
    (lambda r: r.assign_attrs(local_origin="here"), "local_origin is 'here'"),
    (lambda r: r.assign_attrs(sound_speed=0.0), "sound_speed is 0"),
    (lambda r: r.assign_attrs(frequency="high"), "frequency is 'high'"),
    (lambda r: r.assign_attrs(depression_angle="steep"), "depression_angle is 'steep'"),
    (lambda r: r.assign_attrs(beam_width=np.nan), "beam_width is nan"),
    (lambda r: r.assign(level=r["level"] + 1e30), "beyond any sound"),
    (lambda r: r.assign_coords(x=("ping", np.full(40, 1e300))), "farther than any place on Earth"),
    (lambda r: r.assign_attrs(absorption_db=-1.0), "absorption_db is -1"),
    (lambda r: r.isel(ping=[1, 0]), "do not increase"),
    (lambda r: [r, r.assign_coords(x=("ping", r["x"].values + 5))], "not the same pings"),
    (lambda r: [r] * 4, "takes 1 to 3"), (lambda r: [], "takes 1 to 3")])
def test_what_does_not_go_into_a_file_is_refused_and_leaves_none(record, tmp_path, change, words):
    with pytest.raises(ValueError, match=words.replace("(", r"\(").replace(")", r"\)")):
        xtf.write(change(record), tmp_path / "a.xtf")
    assert not list(tmp_path.iterdir())


def test_degrees_are_refused_where_they_are_not_known(record, tmp_path):
    with pytest.raises(ValueError, match="names no coordinate system"):
        xtf.write(record.assign_attrs(crs=None), tmp_path / "a.xtf", geographic=True)
    with pytest.raises(ValueError, match="the gain is 'loud'"):
        xtf.write(record, tmp_path / "a.xtf", tvg="loud")
