"""A stepped sonar among moving objects: those of planned pings, and those that the user moves."""
import numpy as np
import pytest
import sonar_scenes as scenes
from numbered_scenes import numbered

import mitsonar

SEED, SPEED = 3, (1.0, -0.5, 0.0)


def ball(**course):
    """A scattering ball that moves; where it starts, and how, unless its course is given."""
    course = {"start": [2.0, 6.0, -9.0], "heading_deg": float(np.degrees(np.arctan2(*SPEED[:2]))),
              "speed": float(np.hypot(*SPEED[:2])), **course}
    return {"type": "moving", **course, "shape": {"type": "sphere", "radius": 0.4, "bsdf": {"type": "lambert"}}}


def fan(**course):
    """A forward-looking sonar at rest, north of which a ball moves over a rough bed."""
    sensor = {"frequency_khz": 200.0, "receive_elements": 8, "beams": 9, "element_spacing": 0.5, "pulse_ms": 0.2,
              "pings": 3, "speed_knots": 0.0, "ping_rate_hz": 1.0}
    return scenes.forward_looking({"seabed": scenes.bed(12.0, size=40.0), "ball": ball(**course)}, depth=8.0,
                                  sensor=sensor, film={"range": 9.0, "range_min": 4.0}, integrator={"cell": 0.2})


def planned(scene):
    """Frames of the scene's own track, and their poses as arguments of a step."""
    for frame in mitsonar.frames(scene, seed=SEED):
        pose = [float(frame[name].values[0]) for name in ("x", "y", "z", "roll", "pitch", "heading", "ping_time")]
        yield frame, {"position": pose[:3], "attitude": pose[3:6], "time": pose[6]}


def test_objects_on_their_own_tracks_stand_as_at_planned_pings():
    scene = fan()
    wanted = list(planned(scene))
    assert not np.array_equal(wanted[0][0]["level"], wanted[2][0]["level"])
    with mitsonar.Sonar(scene, seed=SEED) as sonar:
        for frame, pose in wanted:
            assert np.array_equal(sonar.ping(**pose)["level"], frame["level"])


def test_an_object_that_is_moved_goes_on_from_there_as_one_with_that_course():
    """Moved once to where the planned one starts, and moved for every ping: levels as planned, to rounding."""
    scene, moved = fan(), fan(start=[-2.0, 7.0, -8.0], speed=0.0)
    start, velocity = np.array([2.0, 6.0, -9.0]), np.array(SPEED)
    heading = np.arctan2(*SPEED[:2])
    for again in (False, True):
        with mitsonar.Sonar(moved, seed=SEED) as sonar:
            for number, (frame, pose) in enumerate(planned(scene)):
                if again or not number:
                    sonar.move("ball", position=start + number * velocity, attitude=(0, 0, heading),
                               velocity=velocity)
                got = sonar.ping(**pose)
                label = next(iter(got.attrs["objects"]))
                assert got.attrs["objects"][label]["position"] == pytest.approx(
                    frame.attrs["objects"][label]["position"], abs=1e-3)
                strong = frame["level"].values > frame["level"].values.max() - 40
                assert got["level"].values[strong] == pytest.approx(frame["level"].values[strong], abs=0.02)


def test_a_move_waits_for_the_next_ping():
    with mitsonar.Sonar(fan(), seed=SEED) as sonar:
        first = sonar.ping(position=(0, 0, -8), time=0.0)
        sonar.move("ball", position=(0, 7, -9))
        second = sonar.ping(position=(0, 0, -8), time=5.0)
        label = next(iter(first.attrs["objects"]))
        assert first.attrs["objects"][label]["position"] == pytest.approx((2, 6, -9), abs=0.02)
        assert second.attrs["objects"][label]["position"] == pytest.approx((0, 7, -9), abs=1e-3)


def test_a_ping_that_fails_leaves_objects_where_they_were_and_moves_waiting():
    """The last ping's signals stay, and a waiting move begins at the ping that is sent."""
    with mitsonar.Sonar(fan(), seed=SEED) as sonar:
        sonar.ping(position=(0, 0, -8), time=0.0)
        before = sonar.signals()
        sonar.move("ball", position=(0, 7, -9), velocity=(0.5, 0, 0))
        with pytest.raises(ValueError, match="turns"):
            sonar.ping(position=(0, 0, -8), turn_rate=(0, 0, 500.0))
        assert np.array_equal(sonar.signals().values, before.values)
        after = sonar.ping(position=(0, 0, -8), time=8.0)
        assert after.attrs["objects"][next(iter(after.attrs["objects"]))]["position"] == pytest.approx(
            (0, 7, -9), abs=0.01)


@pytest.mark.parametrize("name, given, match", [
    ("seabed", {"position": (0, 6, -9)}, "moving shapes ball"),
    ("ball", {"position": (0, 6, 2)}, "between"),
    ("ball", {"position": (0, 6, -20)}, "between"),
    ("ball", {"position": (0, np.nan, -9)}, "finite"),
    ("ball", {"position": (0, 6)}, "shape"),
    ("ball", {"position": (0, 6, -9), "time": "soon"}, "seconds"),
    ("ball", {"position": (0, 900, -9)}, "beyond the bed"),
    ("ball", {"position": (0, 6, -9), "velocity": (0, 2000, 0)}, "most 50 m/s"),
    ("ball", {"position": (0, 6, -9), "turn_rate": (0, 0, 1e4)}, "most 6.28 rad/s"),
])
def test_moves_that_cannot_be_are_refused(name, given, match):
    with mitsonar.Sonar(fan(), seed=SEED) as sonar, pytest.raises(ValueError, match=match):
        sonar.move(name, **given)


def test_scenes_in_which_nothing_moves_and_closed_sonars_say_so(rng):
    sonar = mitsonar.Sonar(numbered("forward_looking", rng, pings=2), seed=SEED)
    with pytest.raises(ValueError, match="no moving shapes"):
        sonar.move("box", position=(0, 6, -9))
    sonar.close()
    with pytest.raises(ValueError, match="closed"):
        sonar.move("box", position=(0, 6, -9))


def test_an_object_that_sinks_under_the_bed_is_refused_in_a_plan_and_between_moves():
    with pytest.raises(ValueError, match=r'"ball" is at z = .* m at ping 2, under the bed'):
        next(planned(fan(start=[-2.0, 7.0, -11.0], speed=0.0, climb=-0.6)))
    with mitsonar.Sonar(fan(), seed=SEED) as sonar:
        sonar.move("ball", position=(-2, 7, -11), velocity=(0, 0, -1))
        sonar.ping(position=(0, 0, -8))
        with pytest.raises(ValueError, match='"ball" goes on from where it was moved to, and is at z = .* under the'):
            sonar.ping(position=(0, 0, -8), time=10.0)
        sonar.move("ball", position=(-2, 7, -9))
        assert sonar.ping(position=(0, 0, -8), time=10.0).sizes["ping"] == 1
