"""Attributes of moving shapes: what cannot be is refused in one sentence, which says what to do."""
import numpy as np
import pytest
from inputs.sonar_scenes import bed, forward_looking, lambert, point_target, sidescan, synthetic_aperture

import mitsonar
from mitsonar.sonar.motion.trajectory import Steered

BALL = {"type": "sphere", "radius": 0.3, "bsdf": lambert()}
COURSE = {"start": [0.0, 8.0, -10.0], "speed": 1.0}
TRACK = "time,x,y,z,heading\n0,0,8,-10,90\n1,1,8,-10,90\n2,2,8,-10,90\n"


def rendered(fish, **sensor):
    """Frames of a small scene with a moving shape."""
    scene = forward_looking({"bed": bed(13.0), "fish": {"type": "moving", **fish}}, film={"range": 15.0}, sensor={
        "beams": 24, "receive_elements": 16, "bandwidth_khz": 8.0, "pings": 2, "ping_rate_hz": 1.0, **sensor})
    return list(mitsonar.frames(scene))


@pytest.mark.parametrize("fish, sentence", [
    ({"shape": {"type": "moving", "shape": BALL, **COURSE}, **COURSE}, "an object has one motion"),
    ({"shape": {"type": "seabed", "depth": 9.0, "length": 9.0, "width": 9.0}, **COURSE}, "do not move; nest a mesh"),
    ({"shape": {**BALL, "bsdf": {"type": "rigid"}}, **COURSE}, "smooth surfaces do not move"),
    ({"shape": BALL}, "neither track nor start is given"),
    ({"shape": BALL, "track": "TRACK", **COURSE}, "track and start are both given"),
    ({"shape": BALL, "track": "BACK"}, "time 1 is not later than 2 before it"),
    ({"shape": BALL, "track": "DEGREES"}, "in latitude and longitude"),
    ({"shape": BALL, "track": "TRACK", "begin": 1.5}, "ends before the last ping"),
    ({"shape": BALL, "track": "TRACK", "begin": -1.0}, "begins after the first ping"),
    ({"shape": BALL, **COURSE, "start": [0.0, 8.0, -14.0]}, "under the bed, which lies at z = -13"),
])
def test_what_cannot_move_is_refused_in_one_sentence(variant, tmp_path, fish, sentence):
    texts = {"TRACK": TRACK, "BACK": TRACK.replace("\n2,", "\n1,").replace("\n1,1", "\n2,1"),
             "DEGREES": TRACK.replace("x,y", "longitude,latitude")}
    if fish.get("track") in texts:
        (tmp_path / "track.csv").write_text(texts[fish["track"]], encoding="utf-8")
        fish = {**fish, "track": str(tmp_path / "track.csv")}
    with pytest.raises((ValueError, RuntimeError), match=sentence):
        rendered(fish)


def test_a_recorded_track_is_followed_and_begins_when_told(variant, tmp_path):
    (tmp_path / "track.csv").write_text(TRACK, encoding="utf-8")
    fish = {"shape": BALL, "track": str(tmp_path / "track.csv"), "begin": 0.5}
    places = [frame.attrs["objects"]["2"]["position"] for frame in rendered(fish)]
    # sound takes 5.3 ms to the track, 8 m away: at 1 m/s the object is 5 mm farther when it is met
    assert np.allclose(places, [[0.505, 8, -10], [1.505, 8, -10]], atol=1e-3)


def test_a_target_is_where_its_track_is(variant):
    frames = rendered({"shape": point_target([0, 0.5, 0]), **COURSE, "heading_deg": 0.0})
    for frame, place in zip(frames, (8.5, 9.5)):
        level = frame["level"].values[0]
        assert 750 * float(frame["time"][level.max(0).argmax()]) == pytest.approx(place, abs=0.12)


def test_a_turning_course_is_a_circle():
    course = Steered(start=np.array([1.0, 2.0, -3.0]), attitude=np.array([0, 0, 0.5]), speed=2.0, turn_rate=0.25)
    place, attitude = course.at(np.linspace(0, 30, 50), np.zeros(50))
    middle = np.array([1.0, 2.0]) + 8.0 * np.array([np.cos(0.5), -np.sin(0.5)])          # 2 m/s at 0.25 rad/s: 8 m
    assert np.allclose(np.hypot(*(place[:, :2] - middle).T), 8.0)
    step = np.diff(place[:, :2], axis=0)
    assert np.allclose(np.mod(np.arctan2(*step.T), 2 * np.pi), np.mod(0.5 * (attitude[1:, 2] + attitude[:-1, 2]),
                                                                       2 * np.pi))


def test_the_scene_stays_as_it_was_loaded(variant):
    """Two renders of one scene are the same: moving objects move in copies."""
    scene = forward_looking({"bed": bed(13.0), "fish": {"type": "moving", "shape": BALL, **COURSE}}, sensor={
        "beams": 24, "receive_elements": 16, "bandwidth_khz": 8.0, "pings": 2, "ping_rate_hz": 1.0},
        film={"range": 15.0})
    first, second = mitsonar.render(scene, seed=1), mitsonar.render(scene, seed=1)
    assert first.identical(second)
    alone = mitsonar.render(scene, seed=1)["level"].values[1]
    assert np.array_equal(list(mitsonar.frames(scene, seed=1))[1]["level"].values[0], alone)


def test_frames_of_moving_objects_compile_nothing_anew(variant):
    import drjit as dr

    scene = forward_looking({"bed": bed(13.0), "fish": {"type": "moving", "shape": BALL, **COURSE}}, sensor={
        "beams": 24, "receive_elements": 16, "bandwidth_khz": 8.0, "pings": 6, "ping_rate_hz": 1.0},
        film={"range": 15.0})
    frames = mitsonar.frames(scene)
    for _ in range(3):
        next(frames)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history()
        next(frames)
        kernels = [each for each in dr.kernel_history() if "cache_hit" in each]
    assert kernels and all(each["cache_hit"] for each in kernels)


def test_a_round_shape_keeps_its_size_and_centre(variant):
    ball = {"type": "sphere", "radius": 0.4, "center": [0.0, 1.0, 0.0], "bsdf": lambert()}
    entry = rendered({"shape": ball, **COURSE, "speed": 0.0})[0].attrs["objects"]["2"]
    assert np.allclose(entry["lower"], [-0.4, 8.6, -10.4], atol=1e-3)
    assert np.allclose(entry["upper"], [0.4, 9.4, -9.6], atol=1e-3)


def test_gradients_and_focused_images_need_a_scene_that_stands_still(variant):
    fish = {"fish": {"type": "moving", "shape": BALL, **COURSE}}
    with pytest.raises(ValueError, match="focused image has truth for a scene that stands still, and the shape"):
        mitsonar.render(synthetic_aperture({"bed": bed(20.0), **fish}))
    scene = sidescan({"bed": bed(20.0), **fish}, depth=10.0, film={"range": 30.0, "bins": 60}, rays=1000)
    with pytest.raises(ValueError, match="gradients need a scene that stands still"):
        mitsonar.gradient(scene, ["bed.bsdf.strength"], np.ones_like)


def test_vertices_that_follow_from_a_course_cannot_be_changed(variant):
    import mitsuba as mi

    scene = mi.load_dict({"type": "scene", "fish": {"type": "moving", "shape": BALL, **COURSE}})
    parameters = mi.traverse(scene)
    parameters["fish.vertex_positions"] = parameters["fish.vertex_positions"] + mi.Float(1)
    with pytest.raises(ValueError, match='vertices of "fish" were changed, and they follow from its course'):
        parameters.update()
