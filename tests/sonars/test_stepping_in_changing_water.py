"""A sonar that is stepped through water that changes: every ping has the water of its own time and place.

Geometry as in `test_water_along_a_line`: a level bed 18 m deep, two casts with the same sound speed at 2 m depth
and the same extremes, so that a ping in one of several waters is, to the last bit, that of a sonar in this water alone.
"""
import numpy as np
import pytest

import mitsonar
from tests.inputs.sonar_scenes import bed, forward_looking, sector_scan
from tests.sonars.test_stepping import poses, same
from tests.sonars.test_water_along_a_line import KINDS, NORTH, SHAPES, SOUTH, folder, halves

__all__ = ["folder"]
SEED = 3
POSE = {"velocity": (0.0, 2.0, 0.0)}


def alone(path, name):
    return {"cast": str(path / f"{name}.csv")}


def few_elements(water):
    """A forward-looking sonar 10 m over the bed, whose signals take a second."""
    return forward_looking({"bed": bed(18.0, size=60.0)}, water=water, film={"range": 14.0, "range_min": 9.0}, sensor={
        "frequency_khz": 100.0, "receive_elements": 4, "beams": 5, "pulse_ms": 0.2, "pings": 2, "speed_knots": 4.0,
        "sound_speed": 1500.0}, integrator={"cell": 0.5})


@pytest.mark.parametrize("rule", ["nearest", "interpolated"])
def test_planned_poses_give_the_bytes_of_frames(exact, folder, rule):
    water = {**halves(folder[1]), "casts_rule": rule}
    scene = KINDS["forward_looking"](water)
    with mitsonar.Sonar(scene, SEED) as sonar:
        for pose, frame in zip(poses(scene), mitsonar.frames(scene, SEED), strict=True):
            same(sonar.ping(**pose), frame)


@pytest.mark.parametrize("kind", ["forward_looking", "sidescan", "multibeam"])
def test_other_poses_have_the_water_of_their_place(exact, folder, kind):
    """To and fro between the casts, beyond the planned track; the record says which cast was used."""
    path, listed = folder
    places = [(0.5, 4.9, -2.0), (0.5, -1.0, -2.0), (0.5, 30.0, -2.0), (0.5, 0.3, -2.0)]
    with mitsonar.Sonar(KINDS[kind](halves(listed)), SEED) as sonar:
        found = [sonar.ping(position=place, **POSE) for place in places]
    for name, cast in (("north", 0), ("south", 1)):
        with mitsonar.Sonar(KINDS[kind](alone(path, name)), SEED) as sonar:
            single = [sonar.ping(position=place, **POSE) for place in places]
        for number in (0, 2) if cast == 0 else (1, 3):
            np.testing.assert_array_equal(found[number]["level"], single[number]["level"])
            np.testing.assert_array_equal(found[number]["label"], single[number]["label"])
            assert found[number].attrs["cast_of_ping"] == [cast]
        assert not np.array_equal(found[0 if cast else 1]["level"], single[0 if cast else 1]["level"])


def test_signals_and_soundings_have_the_water_of_the_step(exact, folder):
    """Reduced with the northern cast, soundings are right in the north and wrong in the south."""
    path, listed = folder
    with mitsonar.Sonar(KINDS["multibeam"](halves(listed)), SEED) as sonar:
        errors = [abs(sonar.soundings(str(path / "north.csv"), position=(0, y, -2), **POSE)["error_refraction"]).max()
                  for y in (5.0, 0.5)]
    assert errors[0] < 1e-9 and errors[1] > 0.05
    signals = []
    for water in (halves(listed), alone(path, "south")):
        with mitsonar.Sonar(few_elements(water), SEED) as sonar:
            sonar.signals(position=(0, 5, -8), **POSE)
            signals.append(sonar.signals(position=(0, 0.5, -8), **POSE).values)
    np.testing.assert_array_equal(*signals)


def test_water_by_time_changes_under_a_sonar_that_stands_and_only_the_latest_is_kept(exact, folder):
    water = {**folder[1]("time", "south.csv,0", "north.csv,40"), "casts_rule": "interpolated", "casts_step": 0.0}
    scene = sector_scan(SHAPES, depth=2.0, water=water, film={"range": 20.0, "bins": 50},
                        sensor={"pings": 2, "speed_knots": 0.0})
    with mitsonar.Sonar(scene, SEED) as sonar:
        survey = sonar._run.survey
        for time in (0.5, 2.0, 9.0):
            sonar.ping(position=(0, 0, -2), time=time)
            middle = [np.interp(10.0, list(cast), list(cast.values())) for cast in (SOUTH, NORTH)]
            assert survey.water_at(0).profile.at(10.0) == pytest.approx(
                middle[0] + time / 40 * (middle[1] - middle[0]), abs=1e-9)
        assert len(survey.waters._latest) == 1 and len(survey._part) == 1


def test_a_field_that_moves_stands_as_at_the_time_of_the_step(exact):
    field = {"profile": "0:1510, 2:1500, 6:1480, 40:1490", "field": "front", "field_change": 4.0, "field_width": 4.0,
             "field_heading_deg": 0.0}
    frames = []
    for moving, time in ((2.0, 3.0), (0.0, 3.0)):
        scene = KINDS["forward_looking"]({**field, "field_speed": moving, "field_y": 10.0 if moving else 16.0})
        with mitsonar.Sonar(scene, SEED) as sonar:
            sonar.ping(position=(0.5, 0, -2), **POSE)
            frames.append(sonar.ping(position=(0.5, 1, -2), time=time, **POSE))
    np.testing.assert_array_equal(frames[0]["level"], frames[1]["level"])


def test_the_water_level_is_that_of_the_step_and_the_tide_must_cover_it(exact, tmp_path):
    """A sonar whose z is given stays, and the thermocline passes it: it rises by 1 m in 10 s."""
    (tmp_path / "tide.csv").write_text("time,height\n-1,0\n0,0\n10,1\n11,1\n")
    profile = ",".join(f"{depth}:{speed}" for depth, speed in NORTH.items())
    scene = KINDS["forward_looking"]({"profile": profile, "tide": str(tmp_path / "tide.csv")})
    with mitsonar.Sonar(scene, SEED) as sonar:
        image = sonar.ping(position=(0.5, 0, -4), time=10.0, **POSE)
        assert image.attrs["tide_of_ping"] == [1.0]
        assert sonar._run.survey.sound_speed(0) == pytest.approx(np.interp(5.0, list(NORTH), list(NORTH.values())))
        with pytest.raises(ValueError, match="time is 12 s, and the tide of the water lasts from -1 to 11 s"):
            sonar.ping(position=(0.5, 0, -4), time=12.0, **POSE)
        with pytest.raises(ValueError, match=r"0.50 m above the sea surface \(z = 1\)"):
            sonar.ping(position=(0.5, 0, 1.5), time=10.9, **POSE)
