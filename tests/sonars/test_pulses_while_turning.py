"""Pulses of 100 ms from arrays that turn or accelerate while they are sent: a point against the kinematics.

What element e sends at t_s leaves O(t_s) + R(t_s) d_e, and is heard at t_r at O(t_r), of a trajectory in closed form:

    y(t) = Σ_e w_e s_b(t_s - τ_e) e^{i2πf0 (t_s - τ_e' - t)} / r²,    t_s(t) by interpolation of t_r(t_s) for every e

A line of a metre that turns by 25 degrees a second sweeps its steered beam over the point: with arms that stood still
the level was 0.27 dB off. A drive that comes 20 ms late on a platform that accelerates by 3.5 m/s² is heard with the
factor of its own moment, which was half a cycle off. Classes leave 0.02 cycle, on the beam's flank 0.1 dB.
"""
import numpy as np
import pytest
from track_files import write_track

import mitsonar
from mitsonar.device.rotations import rotation_matrix
from mitsonar.validation.scenes import array_sonar, buried_bed, point_target

C, F0, PULSE = 1500.0, 1e5, 0.1


def spinning(t):
    return np.stack([0 * t, 2 * t, 0 * t - 10], -1), np.radians(25) * t


def accelerating(t):
    return np.stack([1.75 * t ** 2, 2 * t, 0 * t - 10], -1), 0 * t


def rendered_and_wanted(tmp_path, motion, point, **sensor):
    time, distance = np.arange(0, 2.01, 0.05), float(np.linalg.norm(point - np.array([0, 0, -10.0])))
    place, heading = motion(time)
    rows = np.column_stack([time, place, 0 * time, 0 * time, np.degrees(heading)])
    scene = array_sonar(
        {"bed": buried_bed(200.0), "ball": point_target(point)}, integrator={"cell": 50.0},
        sensor={"pulse": "cw", "pulse_ms": 1e3 * PULSE, "pings": 1, "track": write_track(tmp_path / "track.csv", rows),
                "ping_rate_hz": 1.0, **sensor},
        water={"absorption_db_per_km": 0.0}, film={"range": distance + 120, "range_min": distance - 5})
    signals = mitsonar.element_signals(scene)
    survey = scene.integrator().array_survey(scene, scene.sensors()[0])
    time_axis, wanted = signals["time"].values, 0
    weight = survey.transmit.weight / np.abs(survey.transmit.weight).sum()
    sent = np.linspace(-0.1, 1.5, 20_001) * PULSE
    for element, late, share in zip(survey.transmit.position, survey.transmit.delay, weight):
        place, heading = motion(sent)
        leaves = place + rotation_matrix(0 * heading, 0 * heading, heading) @ element
        met = sent + np.linalg.norm(point - leaves, axis=1) / C
        received = met + distance / C
        for _ in range(8):
            received = met + np.linalg.norm(point - motion(received)[0], axis=1) / C
        own = np.interp(time_axis, received, sent, left=-1, right=-1) - late
        wanted = wanted + share * survey.pulse.envelope(own) * np.exp(2j * np.pi * F0 * (own - time_axis))
    level = 10 ** (signals.attrs["source_level_db"] / 20) / distance ** 2
    return signals.values[0, 0, 0].astype(complex), level * wanted


def test_a_steered_line_sweeps_as_it_turns(variant, tmp_path):
    line = {"transmit": "line", "transmit_elements": 6, "transmit_pitch": 0.2, "transmit_axis": "0, 1, 0",
            "transmit_normal": "forward", "transmit_steer_deg": "49, 10"}
    got, wanted = rendered_and_wanted(tmp_path, spinning, [25.0, 20.0, -16.0], **line)
    assert 20 * np.log10(np.linalg.norm(got) / np.linalg.norm(wanted)) == pytest.approx(0, abs=0.1)


def test_a_late_drive_has_the_factor_of_its_moment(variant, tmp_path):
    np.savetxt(tmp_path / "late.csv", [[0, 0, 0, 1, 0.02]], delimiter=",", header="x,y,z,weight,delay", comments="")
    got, wanted = rendered_and_wanted(tmp_path, accelerating, [40.0, 20.0, -16.0], transmit="file",
                                      transmit_file=str(tmp_path / "late.csv"))
    phase = np.angle(np.sum(got * wanted.conj())) / (2 * np.pi)
    assert phase == pytest.approx(0, abs=0.03)
    kept = abs(np.sum(got * wanted.conj())) / np.linalg.norm(got) / np.linalg.norm(wanted)
    assert 20 * np.log10(kept) > -0.1
