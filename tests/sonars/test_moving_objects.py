"""A moving object is seen, labelled and shadowed as the same object at rest where the sound of each ping meets it.

A box of 1,000 facets or so swims over a level bed, with speed, climb, turn, pitch and roll that differ. Its pose at the
moment t1 that sound meets it is solved for here by bisection of |P(t1) - P_0| = c t1 in water of one speed. A scene of
the same shape at rest at this pose must have the same truth: scatterers are hashed in the body's frame, and places
differ by the rounding of float32 (1e-6 m), which may move single echoes across the edge of a bin.
"""
import numpy as np
import pytest
from inputs.sonar_scenes import bed, echo_sounder, forward_looking, lambert, multibeam, sector_scan, sidescan

import mitsonar

SPEED = 1500.0


def box(*size):
    """The dictionary of a box of these half-lengths [m], as it stands at the origin."""
    import mitsuba as mi

    return {"type": "cube", "to_world": mi.ScalarTransform4f().scale(list(size)), "material": lambert(-15)}


def steered(start, heading, speed, climb=0.0, pitch=0.0, roll=0.0, turn=0.0):
    """Attributes of a course, angles in degrees, and its pose at a time: (3,), and a rotation (3, 3) of x, y, z."""
    attributes = {"start": list(start), "heading_deg": heading, "speed": speed, "climb": climb, "pitch_deg": pitch,
                  "roll_deg": roll, "turn_rate_deg": turn}

    def pose(t):
        half = np.deg2rad(turn) * t / 2
        chord = speed * t * np.sinc(half / np.pi)
        way = np.deg2rad(heading) + half
        place = np.array(start) + np.array([chord * np.sin(way), chord * np.cos(way), climb * t])
        h, p, r = np.deg2rad([heading + turn * t, pitch, roll])
        about_z = np.array([[np.cos(h), np.sin(h), 0], [-np.sin(h), np.cos(h), 0], [0, 0, 1]])       # clockwise
        about_x = np.array([[1, 0, 0], [0, np.cos(p), -np.sin(p)], [0, np.sin(p), np.cos(p)]])       # nose up
        about_y = np.array([[np.cos(r), 0, np.sin(r)], [0, 1, 0], [-np.sin(r), 0, np.cos(r)]])       # starboard down
        return place, about_z @ about_x @ about_y

    return attributes, pose


def met(pose, sonar, time):
    """The pose at the moment that sound sent at a time [s] from a place meets the object, by bisection."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        early = np.linalg.norm(pose(time + middle)[0] - sonar) > SPEED * middle
        low, high = (middle, high) if early else (low, middle)
    return pose(time + low)


def standing(shape, place, turn):
    """The dictionary of a shape at rest at a pose."""
    import mitsuba as mi

    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, place
    return {**shape, "to_world": mi.ScalarTransform4f(matrix.tolist()) @ shape["to_world"]}


KINDS = {                           # how the scene is made, the depth of its bed, and the object's course
    "forward_looking": (lambda shapes: forward_looking(shapes, sensor={"pings": 3, "ping_rate_hz": 2.0, "beams": 64}),
                        13.0, steered((-3, 8, -11.5), 60, 1.5, climb=-0.3, pitch=10, roll=20, turn=15)),
    "multibeam": (lambda shapes: multibeam(shapes, sensor={"pings": 3, "ping_rate_hz": 2.0}, film={"range": 25.0}),
                  20.0, steered((-3, 0.0, -16), 80, 1.5, climb=0.3, pitch=-10, roll=20, turn=5)),
    "sidescan": (lambda shapes: sidescan(shapes, depth=10.0, film={"range": 30.0, "bins": 300}, sensor={
        "pings": 3, "ping_rate_hz": 2.0, "speckle": True}),
                 20.0, steered((12, 0.0, -19), 80, 1.5, climb=0.3, pitch=-10, roll=20, turn=5)),
    "sector_scan": (lambda shapes: sector_scan(shapes, sensor={
        "pings": 3, "ping_rate_hz": 2.0, "first_bearing_deg": 0.0, "tilt_deg": 10.0}),
                    13.0, steered((-0.2, 8.0, -11.4), 80, 0.3, climb=0.1, pitch=-10, roll=20, turn=5)),
    "echo_sounder": (lambda shapes: echo_sounder(shapes, sensor={"pings": 3, "ping_rate_hz": 2.0},
                                                 film={"range": 30.0, "bins": 600}),
                     20.0, steered((-0.5, 0.0, -14), 80, 0.5, climb=0.3, pitch=-10, roll=20, turn=5)),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.filterwarnings("ignore")
def test_truth_is_that_of_the_object_at_rest_where_sound_meets_it(variant, kind):
    make, depth, (course, pose) = KINDS[kind]
    shape, ground = box(0.5, 1.0, 0.3), bed(depth, lambert(-27))
    moving = mitsonar.render(make({"bed": ground, "fish": {"type": "moving", "shape": shape, **course}}), seed=3)
    number = next(int(key) for key, name in moving.attrs["labels"].items() if name == "fish")
    sonar = np.array([moving[axis].values for axis in "xyz"]).T
    for ping in range(3):
        place, turn = met(pose, sonar[ping], float(moving["ping_time"].values[ping]))
        still = mitsonar.render(make({"bed": ground, "fish": standing(shape, place, turn)}), seed=3)
        for name in ("label", "object_shadow"):
            a, b = (image[name].values[ping] == number for image in (moving, still))
            assert b.sum() > (5 if name == "label" else 0) and (a != b).sum() <= 0.02 * b.sum() + 1, (name, ping)
        share = [image["share"].values[number - 1, ping] for image in (moving, still)]
        assert np.abs(share[0] - share[1]).sum() <= 0.02 * share[1].sum() + 1.01


def test_a_moving_shape_at_speed_0_is_that_shape_at_rest_bit_by_bit(variant):
    """Labels, levels, echoes by way of the bed and of a mirroring surface: the second scene changes nothing."""
    from inputs.sonar_scenes import point_target, sediment

    shape = box(0.41, 0.63, 0.29)
    ball = {**point_target([0, 0, 0]), "target_strength_db": -20.0}
    sea = {"type": "sea_surface", "wind_speed": 0.0}

    def levels(fish, buoy):
        scene = forward_looking(
            {"bed": {**bed(13.0), "bsdf": sediment("fine sand")}, "sea": sea, "fish": fish, "buoy": buoy},
            film={"range": 12.0}, integrator={"cell": 0.25, "max_depth": 3}, sensor={
                "beams": 16, "receive_elements": 8, "bandwidth_khz": 8.0, "pings": 2})
        return mitsonar.render(scene, seed=2)

    moving = levels({"type": "moving", "shape": shape, "start": [0.5, 7.0, -12.0]},
                    {"type": "moving", "shape": ball, "start": [-1.0, 8.0, -11.0]})
    still = levels(standing(shape, [0.5, 7.0, -12.0], np.eye(3)), {**ball, "position": [-1.0, 8.0, -11.0]})
    for name in ("level", "label", "share", "object_shadow"):
        assert np.array_equal(moving[name].values, still[name].values), name
