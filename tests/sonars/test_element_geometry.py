"""Where a point target's echo lands: time, phase and level at every element, through the whole chain.

Truth is the exact eigenray out and, by Newton's method on exact eigenrays (`propagation.return_time`, NumPy), back to
every element where it is then; level 10^(TS/20) 10^(-α (L + L') / 20) (c_h/c_0)/A. Tolerances: travel times to the
2 ns the guard promises, that is 0.0002 cycle at 100 kHz, phases to 0.002 cycle (float32 differences and the kernel's
-55 dB); the peak of the matched filter to 1/20 of a range cell, where it is found by a parabola through three samples
of a fourfold interpolated record, itself good to 1/100.
"""
import numpy as np
import pytest
from scipy.signal import resample
from summer import SUMMER_TEXT

import mitsonar
from mitsonar.propagation import eigenray, return_time
from mitsonar.signal import matched_filter
from mitsonar.units import KNOT
from mitsonar.validation.scenes import array_sonar, bed, buried_bed, point_target

PROFILES = {"constant": "0:1500", "summer": SUMMER_TEXT}
RIGHT_CYCLES = 0.002


def truth(scene, where):
    """Two-way delays (rx,) [s] to a target, exactly; arrays in the scene frame of heading 0: x east, y north."""
    sensor = scene.sensors()[0]
    profile, platform = sensor.water.profile, sensor.route
    origin = platform.start
    elements = sensor.receive.position @ np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]])       # body to scene
    velocity = np.array([0.0, platform.speed, 0.0])
    out = eigenray(profile, -origin[2], -where[2], np.hypot(*(where - origin)[:2])).travel_time
    back = return_time(profile, origin, np.array([where]), elements, velocity=velocity, method="eigenray")[0]
    return float(out) + back


def line(axis="starboard", elements=9, pitch=0.125):
    """A line of elements 1 m long."""
    return {"receive": "line", "receive_elements": elements, "receive_pitch": pitch, "receive_axis": axis}


@pytest.mark.parametrize("speed", [0.0, 3.0])
@pytest.mark.parametrize("axis", ["starboard", "down", "0.6, 0.5, 0.62"])
@pytest.mark.parametrize("profile", PROFILES)
def test_phase_across_a_metre_of_elements(variant, profile, axis, speed):
    where = np.array([9.0, 21.0, -24.0])
    scene = array_sonar({"bed": buried_bed(30.0), "ball": point_target(where)}, water={"profile": PROFILES[profile]},
                        sensor={**line(axis), "receive_normal": "forward" if axis == "down" else "down",
                                "speed_knots": speed / KNOT},
                        integrator={"cell": 2.0})
    response = mitsonar.impulse_response(scene)
    delay = truth(scene, where)
    # the response's spectrum at the carrier is its sum: a phase, free of where the samples lie
    start, rate = float(response.time[0]), response.attrs["sampling_rate"]
    sums = response.values[0, 0].astype(complex).sum(-1)
    wanted = np.exp(-2j * np.pi * (100e3 * delay % 1))
    off = np.angle(sums / wanted) / (2 * np.pi)
    assert np.abs(off).max() < RIGHT_CYCLES
    peak = start + np.argmax(np.abs(response.values[0, 0]), -1) / rate
    assert np.abs(peak - delay).max() < 0.51 / rate


@pytest.mark.parametrize("pulse", [{"pulse": "lfm", "pulse_ms": 2.0, "bandwidth_khz": 20.0},
                                   {"pulse": "cw", "pulse_ms": 0.2},
                                   {"pulse": "hfm", "pulse_ms": 1.0, "bandwidth_khz": 15.0, "pulse_window": "hann"}],
                         ids=lambda pulse: pulse["pulse"])
def test_matched_filter_peaks_at_the_range_of_a_target(variant, pulse):
    where = np.array([4.0, 18.0, -20.0])
    scene = array_sonar({"bed": buried_bed(30.0), "ball": point_target(where, -10.0)}, water={"profile": SUMMER_TEXT},
                        sensor={**line(), **pulse}, integrator={"cell": 2.0})
    signals = mitsonar.element_signals(scene)
    shape, rate = scene.sensors()[0].pulse, signals.attrs["sampling_rate"]
    heard = matched_filter(signals.values[0, 0], shape, rate)
    for echo, delay in zip(heard, truth(scene, where)):
        fine = np.abs(resample(echo, 4 * len(echo)))
        k = int(np.argmax(fine))
        a, b, c = fine[k - 1:k + 2]
        time = float(signals.time[0]) + (k + 0.5 * (a - c) / (a - 2 * b + c)) / (4 * rate)
        assert abs(time - delay) < 1 / (20 * shape.bandwidth)
    wave = eigenray(scene.sensors()[0].water.profile, 10.0, 20.0, np.hypot(4, 18))
    ratio = scene.sensors()[0].water.profile.at(20.0) / scene.sensors()[0].water.profile.at(10.0)
    level = 210 - 10 + 20 * np.log10(ratio / wave.spreading_area) - 2 * 0.030 * wave.arc_length
    assert 20 * np.log10(np.abs(resample(heard, 8 * heard.shape[-1], axis=-1)).max()) == pytest.approx(level, abs=0.05)


def test_a_forward_looking_sonar_does_not_stop_and_hop(variant):
    """At 5 m/s and 300 kHz a target 100 m ahead is heard (2 v / c) t_i earlier than by a sonar that stands still."""
    where = np.array([0.0, 100.0, -20.0])
    found = {}
    for speed in (0.0, 5.0):
        scene = array_sonar({"bed": buried_bed(30.0), "ball": point_target(where)},
                            film={"range": 110.0, "range_min": 90.0},
                            sensor={"start": [0.0, 0.0, -20.0], "speed_knots": speed / KNOT, "frequency_khz": 300.0},
                            integrator={"cell": 5.0})
        response = mitsonar.impulse_response(scene)
        sums = response.values[0, 0, 0].astype(complex).sum()
        found[speed] = response, np.angle(sums) / (2 * np.pi)
    one_way = 100 / 1500
    closer = one_way - (100 - 5 * one_way) / (1500 + 5)
    assert closer == pytest.approx(2 * 5 / 1505 * one_way, rel=1e-9)
    cycles = 300e3 * closer
    assert (found[5.0][1] - found[0.0][1] - cycles + 0.5) % 1 - 0.5 == pytest.approx(0, abs=RIGHT_CYCLES)
    peak = {speed: np.argmax(np.abs(response.values)) / response.attrs["sampling_rate"]
            for speed, (response, _) in found.items()}
    assert peak[0.0] - peak[5.0] == pytest.approx(closer, abs=0.6 / response.attrs["sampling_rate"])


@pytest.mark.parametrize("path,least,most", [("vector", -np.inf, -75), ("paper", -25, -10)])
def test_return_paths_against_the_eigenray(variant, path, least, most):
    """Responses of a bed, under way [dB of the exact ones]; where water has layers the published formula is far off."""
    scene = array_sonar(
        {"bed": bed(30.0, size=60.0)}, water={"profile": SUMMER_TEXT}, integrator={"cell": 0.2},
        sensor={"speed_knots": 6.0, "transmit": "line", "transmit_elements": 2, "transmit_pitch": 0.3,
                "receive": "planar", "receive_elements": 6, "receive_rows": 3, "receive_pitch": 0.1,
                "receive_normal": "forward"}, film={"range": 28.0, "range_min": 22.0})
    exact = mitsonar.impulse_response(scene, return_path="eigenray").values
    other = mitsonar.impulse_response(scene, return_path=path).values
    off_db = 20 * np.log10(np.linalg.norm(other - exact) / np.linalg.norm(exact))
    print(f"{path}: {off_db:.1f} dB")
    assert least < off_db < most


@pytest.mark.parametrize("fans", ["elements", "interpolated"])
def test_fans_of_elements_and_few_fans_agree_with_the_centre(variant, fans):
    """In all three the scatterers are the same points, so only the paths to them are found in other ways."""
    shapes = {"bed": buried_bed(25.0), **{f"ball {k}": point_target([3.0 * k - 4, 14 + k, -16]) for k in range(4)}}
    sensor = {"transmit": "line", "transmit_elements": 5, "transmit_pitch": 0.05, "receive": "line",
              "receive_elements": 3, "receive_pitch": 0.1}
    responses = [mitsonar.impulse_response(array_sonar(shapes, water={"profile": SUMMER_TEXT}, sensor=sensor,
                                                       integrator={"cell": 2.0, "fans": each})).values
                 for each in ("centre", fans)]
    # amplitudes are those of each way: A differs by metres over range, 1 %
    assert np.linalg.norm(responses[1] - responses[0]) < 0.03 * np.linalg.norm(responses[0])
    phases = np.angle(responses[1] / responses[0])[np.abs(responses[0]) > 0.3 * np.abs(responses[0]).max()]
    assert np.abs(phases).max() < 2 * np.pi * 0.005
