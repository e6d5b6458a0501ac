"""Signals of elements from a point target that moves while sound travels and while the pulse passes it.

Sound received at t left at τ:  |P(t_h) - p_rx(t)| = c (t - t_h),  |P(t_h) - p_tx(τ)| = c (t_h - τ), for a target P, a
transmit and a receive element that keep their velocities. The exact signal is s(τ) e^(i2πf₀(τ - t)), whose phase is
compared by correlation over the whole pulse, and in its middle half. Bound: 0.01 cycle, 0.075 mm of way at 100 kHz. Of
this, classes of Doppler factors may take 0.02 cycle at the ends of a pulse alone. Without the target's motion the
signal is off by tens of cycles, and without that of its own within the ping by cycles.
"""
import numpy as np
import pytest
from inputs.sonar_scenes import array_sonar, buried_bed, point_target

import mitsonar
from mitsonar.sonar.pulses.pulses import pulse_of

SOUND, FREQUENCY = 1500.0, 100e3
PULSES = {"cw": {"pulse": "cw", "pulse_ms": 1.0}, "lfm": {"pulse": "lfm", "pulse_ms": 2.0, "bandwidth_khz": 10.0}}


def exact(time, pulse, start, velocity, transmit, receive, speed):
    """The signal at times [s]: target's start and velocity, elements' places and the velocity of both, (3,) each."""
    hit = time - np.linalg.norm(start - receive) / SOUND
    for _ in range(30):
        target = start + np.outer(hit, velocity)
        hit = time - np.linalg.norm(target - receive - np.outer(time, speed), axis=1) / SOUND
    sent = hit.copy()
    for _ in range(30):
        sent = hit - np.linalg.norm(start + np.outer(hit, velocity) - transmit - np.outer(sent, speed), axis=1) / SOUND
    return pulse.envelope(sent) * np.exp(2j * np.pi * FREQUENCY * (sent - time))


@pytest.mark.parametrize("knots", [0.0, 3.0])
@pytest.mark.parametrize("kind", PULSES)
def test_signals_of_a_closing_target_have_the_phase_of_its_motion(variant, kind, knots):
    start, velocity = np.array([4.0, 11.0, -13.0]), 3.0 * np.array([-0.3, -0.95, 0.1])
    heading = np.rad2deg(np.arctan2(velocity[0], velocity[1]))
    target = {"type": "moving", "shape": point_target([0, 0, 0]), "start": start.tolist(), "heading_deg": heading,
              "speed": float(np.hypot(*velocity[:2])), "climb": float(velocity[2])}
    scene = array_sonar({"bed": buried_bed(60.0), "ball": target}, film={"range": 18.0}, sensor={
        "frequency_khz": FREQUENCY / 1000, "receive": "line", "receive_elements": 3, "receive_pitch": 0.3,
        "transmit_offset": [0.1, 0.4, 0.0], "speed_knots": knots, "pings": 1, **PULSES[kind]},
        water={"absorption_db_per_km": 0.0})
    signals = mitsonar.element_signals(scene)
    pulse, time = pulse_of(signals.attrs["pulse"]), signals["time"].values
    sonar, speed = np.array([0, 0, -10.0]), np.array([0, knots * 1852 / 3600, 0])
    in_scene = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]])
    for row in range(3):
        place = sonar + in_scene @ [float(signals[f"rx_{axis}"][row]) for axis in "xyz"]
        signal = signals.values[0, 0, row]
        wanted = exact(time, pulse, start, velocity, sonar + in_scene @ [0.1, 0.4, 0.0], place, speed)
        inside = np.flatnonzero(wanted)
        middle = inside[len(inside) // 4:-len(inside) // 4]
        for part in (inside, middle):
            product = np.vdot(wanted[part], signal[part])
            assert abs(np.angle(product)) / (2 * np.pi) < 0.01
        assert abs(product) > 0.999 * np.linalg.norm(wanted[middle]) * np.linalg.norm(signal[middle])


@pytest.mark.parametrize("kind", PULSES)
def test_a_facet_far_from_its_bodys_origin_has_the_phase_of_its_own_motion(variant, kind):
    """A plate of 2 mm at 1.5 m from the body's origin, which sound meets 1 ms before the plate: 3 mm, 0.4 cycle.

    Its scatterers have a random amplitude, the same whatever the speed: that of a plate at rest is divided out.
    """
    import mitsuba as mi

    def signals(speed):
        plate = {"type": "rectangle", "bsdf": {"type": "lambert", "mu_db": -6.0},
                 "to_world": mi.ScalarTransform4f().translate([0, -1.5, 0]).rotate([1, 0, 0], 90).scale([1e-3] * 3)}
        body = {"type": "moving", "shape": plate, "start": [1.0, 9.0, -10.5], "heading_deg": 180.0, "speed": speed}
        return mitsonar.element_signals(array_sonar(
            {"bed": buried_bed(60.0), "ball": body}, film={"range": 18.0}, water={"absorption_db_per_km": 0.0},
            sensor={"frequency_khz": FREQUENCY / 1000, "pings": 1, "transmit_offset": [0.1, 0.4, 0.0],
                    **PULSES[kind]}))

    start, sonar, nothing = np.array([1.0, 10.5, -10.5]), np.array([0, 0, -10.0]), np.zeros(3)
    transmit, amplitude = sonar + [0.4, 0.1, 0.0], []
    for speed in (0.0, 3.0):
        signal = signals(speed)
        wanted = exact(signal["time"].values, pulse_of(signal.attrs["pulse"]), start, np.array([0, -speed, 0]),
                       transmit, sonar, nothing)
        amplitude.append(np.vdot(wanted, signal.values[0, 0, 0]) / np.vdot(wanted, wanted))
    assert abs(np.angle(amplitude[1] / amplitude[0])) / (2 * np.pi) < 0.01
    assert abs(amplitude[1] / amplitude[0]) == pytest.approx(1, rel=0.02)


@pytest.mark.parametrize("speed", [-3.0, 3.0])
def test_a_sweep_is_seen_where_its_doppler_puts_it_in_the_beam_domain_as_by_elements(variant, speed):
    """The compressed peak of a sweep moves by -v f T / B: 30 mm here, of which a third is allowed.

    Both ways agree within a tenth of that. The target is met 6 ms after the transmission, 18 mm from its start.
    """
    def peak(way):
        ball = {"type": "moving", "shape": point_target([0, 0, 0]), "start": [0.3, 9.0, -10.0],
                "heading_deg": 180.0 if speed > 0 else 0.0, "speed": abs(speed)}
        scene = array_sonar({"bed": buried_bed(60.0), "ball": ball}, film={"range": 12.0}, sensor={
            "frequency_khz": 300.0, "pulse": "lfm", "bandwidth_khz": 30.0, "pulse_ms": 1.0, "receive": "line",
            "receive_elements": 24, "receive_normal": "forward", "pings": 1, "beams": 21, "picture": way})
        image = mitsonar.render(scene)
        level = image["level"].values[0]
        beam, sample = np.unravel_index(level.argmax(), level.shape)
        power = 10 ** (level[beam, sample - 4:sample + 5] / 10)
        time = image["time"].values[sample - 4:sample + 5]
        return beam, 750 * (time @ power) / power.sum()

    (beam, place), (other, by_elements) = peak("beams"), peak("elements")
    assert beam == other and place == pytest.approx(by_elements, abs=0.004)
    met = np.hypot(9.0, 0.3) - speed * 0.006
    assert by_elements - met == pytest.approx(-speed * 300e3 * 1e-3 / 30e3, abs=0.01)
