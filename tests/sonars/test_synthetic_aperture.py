"""Raw echoes of a synthetic aperture, and the truth of its image.

In water of one sound speed c a point target at p sends back what leaves the transmitter at t_0 and comes to a receiver
at t_0 + τ,

    c τ = |p - x_t(t_0)| + |p - x_r(t_0 + τ)|

whatever the platform does meanwhile. `arrival` iterates it from the trajectory that the record itself tells, in code
that shares nothing with the renderer's.
"""
import warnings

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import mitsonar
from mitsonar.sonar.element_patterns import element_pressure
from mitsonar.sonar.pulses import pulse_of
from mitsonar.sonar.track import rotation_matrix
from mitsonar.strip_verbs import raw_pings
from mitsonar.synthetic_aperture.record import check_raw
from mitsonar.validation.scenes import bed, lambert, point_target, synthetic_aperture
from mitsonar.verbs import opened

C = 1500.0
WATER = {"sound_speed": C, "absorption_db_per_km": 0.0}
UNEASY = {"overlap": 4, "sway": 0.05, "heave": 0.04, "yaw_deg": 1.0, "surge": 0.05, "roll_deg": 1.0,
          "motion_period": 3.0}
TARGET = (24.0, 0.3, -19.0)
SILENT = bed(20.3, lambert(-200.0))


def strip(sensor=None, shapes=None, **more):
    return synthetic_aperture(shapes or {"seabed": SILENT, "target": point_target(TARGET)}, water=WATER,
                              sensor={**UNEASY, **(sensor or {})}, **more)


def poses(raw):
    """Place (3,) and attitude matrix of the body at a time."""
    way = CubicSpline(raw.motion_time, np.stack([raw.motion_x, raw.motion_y, -raw.motion_depth], -1))
    turns = CubicSpline(raw.motion_time, np.stack([raw.motion_roll, raw.motion_pitch, raw.motion_heading], -1))
    return lambda t: (way(t), rotation_matrix(*turns(t)))


def arrival(raw, pose, ping, rx, target):
    sent = float(raw.ping_time[ping])
    place, turned = pose(sent)
    sender = place + turned @ raw.tx_position.values[int(raw.transmitter[ping])]
    tau = 0.0
    for _ in range(6):
        place, turned = pose(sent + tau)
        receiver = place + turned @ raw.rx_position.values[rx]
        tau = (np.linalg.norm(target - sender) + np.linalg.norm(target - receiver)) / C
    return tau


def pointed(raw, ping, rx, tau):
    """What a receiver hears, correlated with the echo that arrives at tau: its phase is 0 where all is right."""
    pulse, t = pulse_of(raw.attrs["pulse"]), raw.time.values
    on = (t > tau) & (t < tau + pulse.duration)
    replica = pulse.envelope(t[on] - tau) * np.exp(-2j * np.pi * raw.attrs["frequency"] * tau)
    return np.vdot(replica, raw.signal.values[ping, rx][on]) / np.vdot(replica, replica).real


@pytest.fixture(scope="module")
def raw():
    return mitsonar.raw_echoes(strip({"transmitters": 2}))


def test_raw_echoes_hold_what_the_record_says(raw):
    check_raw(raw)
    assert raw.signal.dims == ("ping", "rx", "sample") and raw.signal.dtype == np.complex64
    assert raw.transmitter.values.tolist() == [0, 1, 0, 1]
    assert raw.target_name.values.tolist() == ["target"] and raw.target_depth.values == pytest.approx([19.0])
    assert raw.attrs["bed_depth"] == pytest.approx(20.3, abs=1e-3)


def test_echoes_arrive_at_moving_receivers_when_the_true_trajectory_says(raw):
    """Phases within 0.02 cycle, 0.1 mm of way out and back: of an lfm the moving echo's stretch is part of it."""
    pose = poses(raw)
    for ping in range(4):
        for rx in (0, 3, 7):
            tau = arrival(raw, pose, ping, rx, np.array(TARGET))
            found = pointed(raw, ping, rx, tau)
            assert abs(np.angle(found)) < 2 * np.pi * 0.02, (ping, rx)


def test_an_echo_has_the_level_of_the_sonar_equation(raw):
    """Within 0.1 dB, off the axis of faces that look 15 degrees down."""
    tau = arrival(raw, poses(raw), 0, 4, np.array(TARGET))
    found = 20 * np.log10(abs(pointed(raw, 0, 4, tau)))
    sensor = opened(strip())[1]
    place, turned = poses(raw)(float(raw.ping_time[0]))
    way = np.array(TARGET) - place
    gain = 1.0
    for array in (sensor.transmit, sensor.receive):
        face = {name: getattr(array, name) for name in ("length", "height", "pattern", "baffle")}
        gain *= element_pressure(way / np.linalg.norm(way), C / 300e3, turned @ array.normal[0],
                                 turned @ array.along[0], **face)
    wanted = raw.attrs["source_level_db"] - 40 * np.log10(np.linalg.norm(way)) + 20 * np.log10(abs(gain))
    assert found == pytest.approx(wanted, abs=0.1)


def test_a_ping_is_the_same_wherever_one_starts(raw):
    alone = next(raw_pings(strip({"transmitters": 2}), start=2))
    np.testing.assert_array_equal(alone.signal.values[0], raw.signal.values[2])
    assert alone.ping.values.tolist() == [2]


def test_overlap_sets_the_pace_of_pings():
    """8 receivers of 33.3 mm fill 133 mm of aperture a ping; 4 in common leave 67 mm from ping to ping."""
    scene, sensor, integrator = opened(strip({"sway": 0.0, "surge": 0.0, "heave": 0.0, "yaw_deg": 0.0}))
    track = integrator.survey(scene, sensor).track
    np.testing.assert_allclose(np.linalg.norm(np.diff(track.position, axis=0), axis=1), 4 * 0.0333 / 2, rtol=1e-6)


def test_pings_too_far_apart_are_told():
    scene, sensor, integrator = opened(strip({"overlap": 0, "receivers": 8, "surge": 0.3}))
    with pytest.warns(UserWarning, match="ghosts along the track"):
        integrator.survey(scene, sensor)


@pytest.mark.parametrize("wrong, words", [
    ({"overlap": 8}, "there are 8 receivers"), ({"overlap": 2, "ping_rate_hz": 3.0}, "each sets the other"),
    ({"transmitter_spacing": 0.1}, "one transmitter"), ({"bank_spacing": 0.1}, "one bank"),
    ({"image_window": "tailor"}, "image_window"), ({"banks": 16, "receivers": 100_000}, "elements are the most"),
    ({"speed_knots": 0.0}, "overlap sets the ping rate")])
def test_settings_that_contradict_each_other(wrong, words):
    with pytest.raises((ValueError, RuntimeError), match=words):           # Mitsuba wraps what plugins raise
        strip(wrong)


def test_a_record_that_sees_no_bed_is_refused():
    scene, sensor, integrator = opened(strip(shapes={"seabed": bed(20.3, size=10.0)}))
    with pytest.raises(ValueError, match="sees no seabed"):
        integrator.survey(scene, sensor)


def test_other_sonars_have_no_raw_echoes():
    with pytest.raises(ValueError, match="synthetic aperture"):
        mitsonar.raw_echoes("sidescan_flat")


def test_a_circle_is_sailed_once_round_with_starboard_inwards():
    scene = synthetic_aperture({"seabed": SILENT}, water=WATER, sensor={
        "circle_radius": 15.0, "overlap": 0, "start": [0.0, 0.0, -10.0], "heading_deg": None, "pings": None})
    scene, sensor, integrator = opened(scene)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        track = integrator.survey(scene, sensor).track
    np.testing.assert_allclose(np.hypot(*track.position[:, :2].T), 15.0, rtol=1e-9)
    starboard = track.rotation()[:, :, 1]
    np.testing.assert_allclose(starboard[:, :2], -track.position[:, :2] / 15.0, atol=1e-6)
    gap = np.linalg.norm(track.position[0] - track.position[-1])
    assert gap <= np.linalg.norm(track.position[1] - track.position[0]) * 1.001
