"""Soundings as rays of known slowness.

Through other water the rays of a simulated line lead to what the line's own reduction makes of it: the two legs stand
as one, which errs by some tenths of a millimetre a metre that the arrays are apart (5 mm for 0.6 m at 40 m).
"""
from pathlib import Path

import numpy as np
import pytest

from mitsonar.hydrography.detection.sounding_beams import SoundingBeams, beams_of, beams_of_lines
from mitsonar.hydrography.reduction.legs import Starts
from mitsonar.hydrography.reduction.resounding import profile_of, resounded
from mitsonar.io.survey_lines import reading
from mitsonar.water import SoundSpeedProfile

MEASURED = Path(__file__).resolve().parents[2] / "../shared/data/measured/multibeam"
ONE = dict(x=[0.0], y=[0.0], depth=[1.0], east=[1.0], north=[0.0], slowness=[3e-4], travel_time=[0.1],
           head_speed=[1500.0], starboard=[1.0])


@pytest.mark.parametrize("name", ["em710_122m.all", "em2040_56m.all"])
def test_real_beams_through_other_water_lead_where_soundings_are_reduced_to(name):
    path = MEASURED / name
    if not path.is_file():
        pytest.skip(f"{name} is not beside this checkout")
    line = resounded(reading.read(path, water_column=False).isel(ping=slice(0, 2)))
    beams, cast = beams_of(line), profile_of(line)
    other = SoundSpeedProfile(cast.depth, cast.sound_speed + 6 * np.exp(-cast.depth / 30))
    starts = Starts(profile=other, depth=beams.depth, head_speed=beams.head_speed)
    depth = starts.depth_after(beams.slowness, beams.travel_time / 2)
    valid = line["valid"].values
    before, after = line["depth"].values[valid], resounded(line, other)["depth"].values[valid]
    assert np.std(after - before) > 0.05
    np.testing.assert_allclose(depth, after, atol=2e-3)


@pytest.mark.parametrize(("change", "message"), [
    ({"slowness": [1e-3]}, "slowness holds 0.001; it is from 0 to 1 over the head's sound speed"),
    ({"travel_time": [0.0]}, "travel_time holds 0; a time is more than 0 s"),
    ({"east": [0.5]}, "unit vector"),
    ({"x": [np.nan]}, "x holds nan; leave soundings out"),
    ({"x": [0.0, 1.0]}, "give one number for each of the 1 travel times"),
    ({name: [] for name in ONE}, "and at least one")])
def test_beams_that_are_none_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        SoundingBeams(**{**ONE, **change})


def test_lines_about_other_origins_come_into_the_frame_of_the_first(soundings):
    origins = (1000.0, 0.0), (1200.0, 50.0)
    first, second = (soundings.assign_attrs(crs="EPSG:32632", origin=origin) for origin in origins)
    alone, both = beams_of(soundings), beams_of_lines([first, second])
    count = len(alone)
    np.testing.assert_allclose(both.x[:count], alone.x)
    np.testing.assert_allclose(both.x[count:], alone.x + 200)
    np.testing.assert_allclose(both.y[count:], alone.y + 50)
    np.testing.assert_array_equal(both.slowness[count:], alone.slowness)


def test_lines_in_other_coordinate_systems_and_none_at_all_are_refused(soundings):
    with pytest.raises(ValueError, match="one line is in EPSG:32632 and another in EPSG:32633; give lines in one"):
        beams_of_lines([soundings.assign_attrs(crs=f"EPSG:3263{zone}") for zone in (2, 3)])
    with pytest.raises(ValueError, match="there is no line of soundings"):
        beams_of_lines([])
