"""Swimmers: rigid parts of a mesh swing through the poses of a gait, and their echoes have the Doppler of their swing.

A fin at a distance r from its joint swings by θ(t) = A sin(2πt/T): P(t) = (r cos θ, r sin θ), as fast as 2πrA/T.
Twelve poses of a period are joined by a periodic cubic spline, whose slope is off by (2π/12)^4/180 = 4e-4 of the
largest speed.
"""
import mitsuba as mi
import numpy as np
import pytest
from inputs.sonar_scenes import array_sonar, bed, buried_bed, forward_looking, lambert

import mitsonar
from mitsonar.sonar.motion.gait import Gait, rigid_parts
from mitsonar.sonar.pulses.pulses import pulse_of

SOUND, FREQUENCY, RADIUS, SWING, PERIOD, POSES = 1500.0, 100e3, 1.0, 0.5, 1.0, 12


def turned(angle):
    """A rotation about z."""
    return np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])


def test_a_gait_swings_about_its_joint_as_its_poses_say():
    joint, points = np.array([0.3, -0.2, 0.1]), np.random.default_rng(1).normal(size=(8, 3))
    angle = SWING * np.sin(2 * np.pi * np.arange(POSES) / POSES)
    poses = np.stack([(points - joint) @ turned(a).T + joint for a in angle])
    still = np.zeros((POSES, 3, 3)) + np.eye(3)
    poses, faces = np.concatenate([poses, still], 1), np.array([[k, k + 1, k + 2] for k in range(6)] + [[8, 9, 10]])
    swinging, rest = rigid_parts(poses, faces, PERIOD)
    assert rest.gait is None and rest.vertices.tolist() == [8, 9, 10] and isinstance(swinging.gait, Gait)
    for time in (0.0, 3.25, 0.51, -0.4):
        rotation, moved = swinging.gait.at(np.array(time))
        wanted = (points - joint) @ turned(SWING * np.sin(2 * np.pi * time / PERIOD)).T + joint
        np.testing.assert_allclose(points @ rotation.T + moved, wanted, atol=2e-3)


def test_pieces_that_bend_are_refused():
    flat = np.random.default_rng(2).normal(size=(4, 3))
    with pytest.raises(ValueError, match="changes its form by .* mm between poses"):
        rigid_parts(np.stack([flat, flat * [1, 1.1, 1]]), np.array([[0, 1, 2], [1, 2, 3]]), 1.0)


def fin(angle, size=1e-3):
    """A plate that faces south, at a distance from the origin that is its joint."""
    return {"type": "rectangle", "bsdf": {"type": "lambert", "mu_db": -6.0},
            "to_world": mi.ScalarTransform4f().rotate([0, 0, 1], np.rad2deg(angle)).translate([RADIUS, 0, 0]).rotate(
                [1, 0, 0], 90).scale([size] * 3)}


def swimmer(begin=0.0, swings=True, size=1e-3, start=(0.2, 11.0, -10.5)):
    angles = SWING * np.sin(2 * np.pi * np.arange(POSES) / POSES) if swings else [0.0]
    gait = {"gait_period": PERIOD} if swings else {}
    return {"type": "moving", "start": list(start), "begin": begin, **gait,
            **{f"pose{number:02d}": fin(angle, size) for number, angle in enumerate(angles)}}


@pytest.mark.parametrize("pulse", [{"pulse": "cw", "pulse_ms": 1.0},
                                   {"pulse": "lfm", "pulse_ms": 2.0, "bandwidth_khz": 10.0}])
def test_a_swinging_fin_has_the_phase_of_its_motion(variant, pulse):
    """At 3.1 m/s, to 0.01 cycle; without the swing's motion within the ping the signal is off by cycles."""
    signals = [mitsonar.element_signals(array_sonar(
        {"bed": buried_bed(60.0), "fin": swimmer(swings=swings)}, film={"range": 18.0, "sample_rate_khz": 40.0},
        water={"absorption_db_per_km": 0.0}, sensor={"frequency_khz": FREQUENCY / 1000, "pings": 1,
                                                     "transmit_offset": [0.1, 0.4, 0.0], **pulse}))
               for swings in (False, True)]
    sonar, joint = np.array([0, 0, -10.0]), np.array([0.2, 11.0, -10.5])
    transmit = sonar + [0.4, 0.1, 0.0]

    def place(times, swings):
        angle = SWING * np.sin(2 * np.pi * times / PERIOD) if swings else 0 * times
        return joint + RADIUS * np.stack([np.cos(angle), np.sin(angle), 0 * times], -1)

    amplitude = []
    for swings, signal in enumerate(signals):
        time = signal["time"].values
        hit, sent = time.copy(), time.copy()
        for _ in range(40):
            hit = time - np.linalg.norm(place(hit, swings) - sonar, axis=1) / SOUND
        sent = hit - np.linalg.norm(place(hit, swings) - transmit, axis=1) / SOUND
        wanted = pulse_of(signal.attrs["pulse"]).envelope(sent) * np.exp(2j * np.pi * FREQUENCY * (sent - time))
        part = np.flatnonzero(wanted)
        amplitude.append(np.vdot(wanted[part], signal.values[0, 0, 0][part]) / np.vdot(wanted, wanted))
        halves = np.array_split(part, 2)
        phases = [np.angle(np.vdot(wanted[half], signal.values[0, 0, 0][half])) for half in halves]
        # classes of Doppler factors may take 0.02 cycle at either end of a pulse; without the swing it is 0.2
        assert abs(np.angle(np.exp(1j * (phases[1] - phases[0])))) / (2 * np.pi) < 0.03
    assert abs(np.angle(amplitude[1] / amplitude[0])) / (2 * np.pi) < 0.01
    assert abs(amplitude[1] / amplitude[0]) == pytest.approx(1, rel=0.02)


def fan(**swimming):
    return forward_looking({"bed": bed(12.0, size=40.0), "fin": swimmer(**swimming)}, depth=10.0, film={"range": 15.0},
                           sensor={"beams": 32, "pings": 2, "ping_rate_hz": 2.0, "sound_speed": 1500.0})


def test_one_label_and_box_hold_all_parts_and_the_box_follows_the_swing(variant):
    """Swung to 0.5 rad, a quarter of a period after the first pose: the box of a plate of 0.2 m moves by r sin θ."""
    def box(begin):
        image = next(iter(mitsonar.frames(fan(begin=begin, size=0.1), 1)))
        names = {name: number for number, name in image.attrs["labels"].items()}
        return np.array([image.attrs["objects"][str(names["fin"])][end] for end in ("lower", "upper")]), image

    (first, image), (swung, later) = box(0.0), box(0.25 * PERIOD)
    middle = swung.mean(0) - first.mean(0)
    assert middle[1] == pytest.approx(RADIUS * np.sin(SWING), abs=0.04)     # it swings on while sound travels
    assert middle[0] == pytest.approx(RADIUS * (np.cos(SWING) - 1), abs=0.02)
    assert list(image.attrs["labels"].values()).count("fin") == 1
    assert not np.array_equal(image["level"], later["level"])


def test_poses_and_periods_that_do_not_fit_are_refused(variant):
    plate = fin(0.0)
    for given, words in (({"a": plate, "b": plate}, "a gait has two or more nested meshes"),
                         ({"a": plate, "gait_period": 1.0}, "a gait has two or more nested meshes"),
                         ({"a": plate, "b": {"type": "cube", "bsdf": lambert(-10)}, "gait_period": 1.0},
                          "pose 2 has 24 vertices and 12 faces")):
        with pytest.raises(RuntimeError, match=words):
            forward_looking({"bed": bed(12.0, size=40.0), "fin": {"type": "moving", "start": [0, 8, -11], **given}})
