"""SBET and POS MV: values come back as they were written, damage is passed over or named, and clocks are right.

Files are written byte by byte (`inertial_files`), from the layouts that public readers have.
"""
import datetime

import numpy as np
import pytest
from inertial_files import (
    GPS_TIME,
    group,
    heave_group,
    navigation_group,
    week_group,
    write_sbet,
    write_smrmsg,
)

from mitsonar.io.tracks import gps_time, posmv, sbet, tracks

TIME = 200_000.0 + 0.01 * np.arange(400)
LATITUDE, LONGITUDE = 54.4 + 1e-6 * np.arange(400), 10.2 + 2e-6 * np.arange(400)
ROLL, PITCH = 0.05 * np.sin(TIME), 0.02 * np.cos(TIME)
HEADING = np.unwrap(6.2 + 0.001 * np.arange(400))                  # over north
HEIGHT = 40.0 + 0.3 * np.sin(2 * np.pi * TIME / 0.8)
WEEK = 2416                                                        # from Sunday, 26 April 2026


def sbet_file(path, **more):
    return write_sbet(path, TIME, LATITUDE, LONGITUDE, HEIGHT, ROLL, PITCH, HEADING, **more)


def posmv_file(path, *, number=1, before=(), clock=2):
    groups = [navigation_group(*row, number=number, heave=-0.25, clock=clock) for row in zip(
        TIME, LATITUDE, LONGITUDE, HEIGHT, np.degrees(ROLL), np.degrees(PITCH), np.degrees(HEADING) % 360)]
    path.write_bytes(b"".join([*before, *groups]))
    return path


def check(found, time=TIME):
    np.testing.assert_allclose(found.time, time, atol=1e-9)
    np.testing.assert_allclose(found.y, LATITUDE, atol=1e-12)
    np.testing.assert_allclose(found.x, LONGITUDE, atol=1e-12)
    np.testing.assert_allclose(found.roll, ROLL, atol=1e-12)
    np.testing.assert_allclose(found.pitch, PITCH, atol=1e-12)
    np.testing.assert_allclose(np.sin(found.heading - HEADING), 0, atol=1e-12)
    np.testing.assert_array_less(np.abs(np.diff(found.heading)), 0.1)
    np.testing.assert_allclose(found.height, HEIGHT, atol=1e-12)
    assert found.geographic and found.z is None


def test_an_sbet_comes_back_as_written(tmp_path):
    """Its heading is that of the wander frame less the wander angle."""
    found = tracks.load(sbet_file(tmp_path / "any", wander=0.3))
    check(found)
    assert found.week
    # waves of 0.8 s about a steady height, but for the ends, where the minute is cut
    np.testing.assert_allclose(found.heave[100:300], (HEIGHT - 40.0)[100:300], atol=0.02)


def test_a_date_names_the_week_of_an_sbet(tmp_path):
    path = sbet_file(tmp_path / "a.sbet")
    sunday = datetime.datetime(2026, 4, 26, tzinfo=datetime.timezone.utc).timestamp()
    for date in ("2026-04-26", "2026-04-28T10:00:00Z", "2026-05-02"):
        found = tracks.load(path, date=date)
        check(found, sunday + TIME)
        assert not found.week
    for date, words in (("2026-13-01", "the date of the week is '2026-13-01'"), ("1970-01-01", "give a date such as")):
        with pytest.raises(ValueError, match=words):
            tracks.load(path, date=date)


def test_an_sbet_over_the_end_of_a_week_runs_on(tmp_path):
    time = (gps_time.WEEK - 2 + 0.01 * np.arange(400)) % gps_time.WEEK
    found = sbet.read(write_sbet(tmp_path / "a", time, LATITUDE, LONGITUDE, HEIGHT))
    np.testing.assert_allclose(np.diff(found.time), 0.01, atol=1e-9)


def test_accuracies_are_in_metres_and_radians(tmp_path):
    found = sbet.accuracy(write_smrmsg(tmp_path / "smrmsg", TIME[::100], position=0.03, minutes=3.0))
    np.testing.assert_allclose(found["time"], TIME[::100])
    for name in ("x", "y", "height"):
        np.testing.assert_allclose(found[name], 0.03)
    for name in ("roll", "pitch", "heading"):
        np.testing.assert_allclose(found[name], np.radians(0.05))


def test_leap_seconds_are_those_of_the_bulletins():
    for year, leaps in ((1980, 0), (1999, 13), (2010, 15), (2014, 16), (2016, 17), (2017, 18), (2026, 18)):
        assert gps_time.ahead(datetime.datetime(year, 6, 1, tzinfo=datetime.timezone.utc).timestamp()) == leaps, year


@pytest.mark.parametrize("number", [1, 102])
@pytest.mark.parametrize("clock, leaps", [(2, 0.0), (GPS_TIME, 18.0)])
def test_a_posmv_names_its_week_and_its_clock(tmp_path, number, clock, leaps):
    before = [group(56, b"\0" * 40, 0.0, kind=b"$MSG"), week_group(199_990.0, WEEK, 18.0, clock=clock)]
    found = tracks.load(posmv_file(tmp_path / "a.000", number=number, before=before, clock=clock))
    check(found, gps_time.EPOCH + WEEK * gps_time.WEEK + TIME - leaps)
    assert not found.week and gps_time.EPOCH + WEEK * gps_time.WEEK == gps_time.week_of(
        gps_time.instant("2026-04-28", "day"))
    if number == 102:
        np.testing.assert_allclose(found.heave, 0.25)              # it counts downwards in the file


def test_a_posmv_without_a_week_keeps_seconds_of_the_week(tmp_path):
    check(found := posmv.read(posmv_file(tmp_path / "a.000")))
    assert found.week
    with pytest.raises(ValueError, match="counts GPS time and names no week"):
        posmv.read(posmv_file(tmp_path / "b.000", clock=GPS_TIME))


def test_delayed_heave_comes_beside_that_of_its_time(tmp_path):
    groups = [heave_group(one, 0.1 * k, 0.1 * k + 0.04, valid=k != 3) for k, one in enumerate(TIME[:10])]
    (tmp_path / "a.000").write_bytes(b"".join(groups))
    found = posmv.delayed_heave(tmp_path / "a.000")
    kept = [k for k in range(10) if k != 3]
    np.testing.assert_allclose(found.time, TIME[kept])
    np.testing.assert_allclose(found.delayed, -0.1 * np.array(kept), atol=1e-6)
    np.testing.assert_allclose(found.delayed - found.at_once, 0.04, atol=1e-6)


def test_damaged_groups_are_left_out(tmp_path):
    path = posmv_file(tmp_path / "a.000")
    content = bytearray(path.read_bytes())
    size = len(content) // 400
    content[5 * size + 40] ^= 0xFF                                 # a wrong checksum
    content[9 * size + 6] = 0xFF                                   # a wrong length
    path.write_bytes(bytes(content[:-20]) + b"$GRP" * 3)           # cut off, and words that begin nothing
    found = posmv.read(path)
    np.testing.assert_allclose(found.time, np.delete(TIME, [5, 9, 399]), atol=1e-9)


@pytest.mark.parametrize("content, words", [
    (b"$GRP" * 50_000, "no two groups 1 or 102"), (b"$GRP\1\0\xff\xff" * 20_000, "no two groups 1 or 102"),
    (group(1, b"\0" * 100, 1.0) * 3, "no two of its groups 1 have a place")])
def test_a_posmv_without_navigation_is_refused(tmp_path, content, words):
    (tmp_path / "a.000").write_bytes(content)
    with pytest.raises(ValueError, match=words):
        posmv.read(tmp_path / "a.000")
    with pytest.raises(ValueError, match="no two valid groups 111"):
        posmv.delayed_heave(tmp_path / "a.000")


def test_what_is_no_sbet_is_refused(tmp_path):
    path = sbet_file(tmp_path / "a")
    whole = path.read_bytes()
    for content, words in ((whole[:-8], "no whole number of records"), (b"", "no whole number of records"),
                           (whole[:136 * 8] + b"\xff" * 136 + whole[136 * 9:], "record 9 of 400"),
                           (whole[:1360] + whole[136:], "the time of record 11 is not later")):
        path.write_bytes(content)
        with pytest.raises(ValueError, match=words):
            sbet.read(path)
    path.write_bytes(whole[:-8])
    with pytest.raises(ValueError, match="cannot read the track"):
        tracks.load(path)
    for content in (b"", np.full(10, -1.0).tobytes(), bytes(83)):
        path.write_bytes(content)
        with pytest.raises(ValueError, match="cannot read the accuracy"):
            sbet.accuracy(path)


def test_an_sbet_is_a_track_of_scenes(tmp_path, variant):
    """Its heave is there, about the draft; a date makes its times dates."""
    from sonar_scenes import bed, multibeam

    path, week = sbet_file(tmp_path / "a.sbet"), gps_time.week_of(gps_time.instant("2026-05-01", "day"))
    for date, begin in (("", TIME[0]), ("2026-05-01", week + TIME[0])):
        scene = multibeam({"bed": bed(18.0, size=120.0)}, film={"range": 40.0}, sensor={
            "start": None, "track": str(path), "track_date": date, "draft": 2.0, "ping_rate_hz": 4.0, "pings": 12})
        survey = scene.integrator().survey(scene, scene.sensors()[0])
        track = survey.voyage.track
        assert track.time[0] == pytest.approx(begin)
        np.testing.assert_allclose(track.position[:, 2], -2.0, atol=0.6)
        assert np.ptp(track.position[:, 2]) > 0.3


def test_a_date_for_a_track_that_has_its_own_is_refused(tmp_path):
    (tmp_path / "a.csv").write_text("time,x,y,z\n0,0,0,-1\n1,1,1,-1\n")
    with pytest.raises(ValueError, match="is no SBET and names its own dates"):
        tracks.load(tmp_path / "a.csv", date="2026-05-01")


def test_an_empty_file_is_refused_by_its_name(tmp_path):
    (tmp_path / "a.000").write_bytes(b"")
    with pytest.raises(ValueError, match=r"a\.000: it is empty"):
        posmv.delayed_heave(tmp_path / "a.000")
