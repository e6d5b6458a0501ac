"""Arrays that are steered, turned, rolled and moving: point targets around them against closed forms and brute force.

A steered line of N elements at pitch d hears, and is heard, by |sin(Nx) / (N sin x)|, x = π d/λ (sin ψ - sin ψ0), ψ
from broadside in the body frame, whatever its attitude. On a moving platform every element sends from where it is when
its turn comes, which brute force follows here: emission e at O + v e + d, arrival by fixed point. Tolerances: levels
0.1 dB, for the phase of a Doppler class is right to 0.02 cycle at the ends of the pulse; phases of responses 0.002
cycle; a spectrum's peak to one class, 0.04 cycle over half a pulse.
"""
from types import SimpleNamespace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from summer import SUMMER_TEXT
from track_files import write_track

import mitsonar
from mitsonar.signal import doppler_classes
from mitsonar.sonar import Track, cw
from mitsonar.survey.pressure import echo_classes
from mitsonar.survey.pressure.pressure import PressureRecord
from mitsonar.units import KNOT
from mitsonar.validation.scenes import array_sonar, bed, buried_bed, point_target

C, F0, RANGE, PULSE = 1500.0, 100e3, 20.0, 4e-3
LONG = {"pulse": "cw", "pulse_ms": 1000 * PULSE, "pulse_window": "hann"}
RECORD = {"range": 28.0, "range_min": 15.0, "sample_rate_khz": 10.0}


def at_time(signals, time):
    """Signals between their samples, exactly."""
    rate = signals.attrs["sampling_rate"]
    spectrum = np.fft.fft(signals.values[0, 0, 0].astype(complex), 2 * signals.sizes["sample"])
    turns = np.fft.fftfreq(len(spectrum), 1 / rate) * (time - float(signals["time"][0]))
    return np.mean(spectrum * np.exp(2j * np.pi * turns))


def tracked(tmp_path, rows, shapes, *, integrator=None, **sensor):
    """A scene whose sonar follows a recorded track: rows of time, x, y, z, roll, pitch, heading [degrees]."""
    return array_sonar(shapes, sensor={"track": write_track(tmp_path / "track.csv", rows), **sensor}, film=RECORD,
                       water={"absorption_db_per_km": 0.0}, integrator={"cell": 2.0, **(integrator or {})})


# (roll, pitch, heading) of the platform, [degrees]
@pytest.mark.parametrize("attitude", [(0, 0, 90), (10, -7, 217)])
def test_transmission_goes_where_it_is_steered(variant, tmp_path, attitude):
    place, steered = np.array([5.0, -3.0, -30.0]), 30.0
    roll, pitch, heading = np.radians(attitude)
    turn = Track.straight(start=place, heading=heading, roll=roll, pitch=pitch, speed=0, interval=1,
                          pings=1).rotation()[0]
    azimuth = np.array([30.0, 27.0, 33.0, 41.0, 2.0, -30.0])
    found = []
    for angle in np.radians(azimuth):
        buoy = place + RANGE * turn @ [np.cos(angle), np.sin(angle), 0]
        scene = tracked(tmp_path, [(0, *place, *attitude)], {"bed": buried_bed(60.0), "buoy": point_target(buoy)},
                        transmit="line", transmit_elements=16, transmit_normal="forward",
                        transmit_steer_deg=f"{steered}, 0", **LONG)
        found.append(abs(at_time(mitsonar.element_signals(scene), 2 * RANGE / C + PULSE / 2)))
    x = 0.5 * np.pi * (np.sin(np.radians(azimuth)) - np.sin(np.radians(steered)))
    expected = np.abs(np.sinc(16 * x / np.pi) / np.sinc(x / np.pi))
    level = 20 * np.log10(found) - (210 - 40 * np.log10(RANGE))
    assert level[0] == pytest.approx(0, abs=0.02)
    heard = expected > 0.02
    assert level[heard] == pytest.approx(20 * np.log10(expected[heard]), abs=0.1)
    assert np.all(level[~heard] < -34)


def sent_on_the_way(speed, buoy, elements, delay):
    """Baseband of one transmission at the time `middle` [s] an echo of the array's middle is half over."""
    velocity = np.array([0, speed, 0.0])

    def arrival(emitted, place):
        met = emitted + np.linalg.norm(buoy - place - velocity * emitted) / C
        time = met + RANGE / C
        for _ in range(40):
            time = met + np.linalg.norm(buoy - velocity * time) / C
        return time

    middle, total = arrival(PULSE / 2, np.zeros(3)), 0
    for late, place in zip(delay, elements):
        age = PULSE / 2
        for _ in range(40):
            age += middle - arrival(late + age, place)
        total += np.sin(np.pi * age / PULSE) ** 2 * np.exp(2j * np.pi * F0 * (age - middle))
    return total / len(elements), middle


@pytest.mark.parametrize("steered", [59.8, 60.0, 60.2])
def test_steered_transmission_of_a_moving_platform(variant, steered):
    """At 5 m/s delays that do not shrink with Doppler would turn the beam of a metre by 0.2 degrees, by 0.9 dB."""
    speed = 5.0
    direction = np.array([np.sin(np.radians(steered)), np.cos(np.radians(steered)), 0])
    buoy = RANGE * np.array([np.sin(np.radians(60.0)), 0.5, 0])
    elements = (np.arange(9) - 4)[:, None] * [0.125, 0, 0]
    wanted, middle = sent_on_the_way(speed, buoy, elements, elements @ direction / C)
    scene = array_sonar(
        {"bed": buried_bed(60.0), "buoy": point_target(buoy - [0, 0, 10])}, integrator={"cell": 2.0}, film=RECORD,
        water={"absorption_db_per_km": 0.0},
        sensor={"speed_knots": speed / KNOT, "transmit": "line", "transmit_elements": 9, "transmit_pitch": 0.125,
                "transmit_steer_deg": f"{steered}, 0", **LONG})
    found = at_time(mitsonar.element_signals(scene), middle) / 10 ** (210 / 20) * RANGE ** 2
    assert 20 * np.log10(abs(found / wanted)) == pytest.approx(0, abs=0.15)
    assert np.angle(found / wanted) / (2 * np.pi) == pytest.approx(0, abs=0.01)


@pytest.mark.parametrize("heading", [0.0, 90.0, 203.0])
def test_doppler_of_a_target_ahead(variant, heading):
    speed, course = 4.0, np.array([np.sin(np.radians(heading)), np.cos(np.radians(heading)), 0])
    scene = array_sonar({"bed": buried_bed(30.0), "buoy": point_target(RANGE * course - [0, 0, 10.0])},
                        sensor={"speed_knots": speed / KNOT, "heading_deg": heading, **LONG},
                        film=RECORD, integrator={"cell": 2.0})
    signals = mitsonar.element_signals(scene)
    spectrum = np.abs(np.fft.fft(signals.values[0, 0, 0], 1 << 16))
    peak = np.fft.fftfreq(1 << 16, 1 / signals.attrs["sampling_rate"])[spectrum.argmax()]
    assert peak == pytest.approx(F0 * ((C + speed) / (C - speed) - 1), abs=0.04 / PULSE)
    assert 20 * np.log10(np.abs(signals.values).max()) > 210 - 41 * np.log10(RANGE) - 1


def test_every_echo_is_in_one_doppler_class(variant, monkeypatch):
    """On the boundaries, at both ends, and a rounding error beyond them."""
    pulse = cw(F0, PULSE)
    factors = doppler_classes(pulse, 0.995, 1.005)
    half = 0.5 * (factors[1] - factors[0])
    doppler = mi.Float64(np.r_[factors, factors + half, factors - half, 0.995 - 1e-9, 1.005 + 1e-9])
    echoes = SimpleNamespace(chosen=lambda index: index)
    source = SimpleNamespace(position=np.zeros(3), way_back=lambda *_, **__: None)
    monkeypatch.setattr(echo_classes, "time_scale", lambda *_, **__: (doppler, mi.Float64(0.5 * PULSE) / doppler))
    classes, count, where = echo_classes.DopplerClasses(factors, 0.0, pulse), len(factors), {}

    def sort(wanted):
        return classes.sort(source, echoes, wanted, sender=np.zeros(3), receiver=np.zeros(3), delay=0.0)

    whole = sort(range(count)).sheet.numpy()
    assert np.abs(factors[whole] - doppler.numpy()).max() <= half + 2e-9
    for wanted in (range(0, count // 2), range(count // 2, count - 1), range(count - 1, count)):
        part = sort(wanted)
        sheets = [0] * len(part.echoes) if part.sheet is None else part.sheet.numpy()
        where |= dict(zip(part.echoes.numpy().tolist(), np.add(sheets, wanted.start), strict=True))
    assert [where[echo] for echo in range(dr.width(doppler))] == whole.tolist()


def test_a_source_off_the_centre_is_no_slower_than_the_centre(variant):
    """Two metres up, where sound is slower, the target ahead has more Doppler than any factor of the centre's depth."""
    levels = []
    for fans in ("centre", "elements"):
        scene = array_sonar({"bed": buried_bed(30.0), "buoy": point_target([0, RANGE, -8.0])}, film=RECORD,
                            water={"profile": "0:1490, 40:1530"}, integrator={"cell": 2.0, "fans": fans},
                            sensor={"speed_knots": 5.0 / KNOT, "transmit_offset": [0.0, 0.0, -2.0], **LONG})
        levels.append(20 * np.log10(np.abs(mitsonar.element_signals(scene).values).max() + 1e-30))
    assert levels[1] == pytest.approx(levels[0], abs=0.2)


@pytest.mark.parametrize("fans", ["elements", "interpolated"])
def test_fans_off_the_centre_turn_with_the_platform(variant, tmp_path, fans):
    """At 20 degrees a second half a metre off the middle moves by 4 mm in 24 ms: a quarter of a wavelength."""
    time = np.arange(0, 2.01, 0.05)
    rows = np.stack([time, 0 * time, 3 * time, -10 - 0.3 * np.sin(2 * time), 3 * np.sin(time), 2 * np.cos(time),
                     20 * time], -1)
    sums = {}
    for each in ("centre", fans):
        scene = tracked(tmp_path, rows, {"bed": buried_bed(30.0), "buoy": point_target([6.0, 18.0, -14.0])},
                        ping_rate_hz=2.0, transmit="line", transmit_elements=3, transmit_pitch=0.5, receive="line",
                        receive_elements=3, receive_pitch=0.2, integrator={"fans": each})
        sums[each] = mitsonar.impulse_response(scene, 1).values[0].astype(complex).sum(-1)
    assert np.angle(sums[fans] / sums["centre"]) / (2 * np.pi) == pytest.approx(0, abs=0.002)


@pytest.mark.parametrize("height", [0.5, 1.5])
def test_no_cell_that_a_narrow_beam_hears_is_left_out(variant, height):
    """Through a thermocline rays leave up to a degree off the straight line, several lobes of beams this narrow."""
    face = {"pattern": "rectangular", "element_length": 0.005, "element_height": height, "normal": "0, 1, 0.1763"}
    sensor = {f"{array}_{name}": value for array in ("transmit", "receive") for name, value in face.items()}
    heard = []
    for choose in (True, False):
        scene = array_sonar({"bed": bed(20.0, size=150.0)}, water={"profile": SUMMER_TEXT}, integrator={"cell": 0.8},
                            film={"range": 70.0, "range_min": 40.0}, sensor={"frequency_khz": 300.0, **sensor})
        record = PressureRecord(scene.integrator().array_survey(scene, scene.sensors()[0]))
        if not choose:
            record.ensonification(0).beams = None
        heard.append(record.at(0).responses())
    assert np.linalg.norm(heard[0] - heard[1]) < 1e-3 * np.linalg.norm(heard[1])


@pytest.mark.parametrize("profile,axis", [("0:1500", "starboard"), ("0:1500", "down"),
                                          ("0:1500, 40:1502", "starboard")])
def test_level_rays_in_even_water_are_no_reason_for_doubt(variant, profile, axis):
    """A metre above the bed most rays are flatter than 1.1 degrees; vector and eigenray agree, nothing is refused."""
    heard = [mitsonar.impulse_response(
        array_sonar({"bed": bed(11.0, size=150.0)}, water={"profile": profile}, integrator={"cell": 3.0},
                    film={"range": 70.0, "range_min": 60.0},
                    sensor={"receive": "line", "receive_elements": 4, "receive_axis": axis}),
        return_path=path).values for path in ("vector", "eigenray")]
    assert np.linalg.norm(heard[0] - heard[1]) < 1e-3 * np.linalg.norm(heard[1])


@pytest.mark.parametrize("length,height,gain", [(3.0, 0.0, 2 * 3.0 / 0.005),
                                                (2.0, 0.1, 2 * np.pi * 2.0 * 0.1 / 0.005 ** 2)])
def test_noise_of_elements_of_hundreds_of_wavelengths(variant, length, height, gain):
    """A line hears 2L/λ less, a face that looks both ways 2πA/λ²; 4000 samples scatter by 0.07 dB."""
    scene = array_sonar({"bed": buried_bed(30.0)}, integrator={"cell": 5.0},
                        film={"range": 30.0, "sample_rate_khz": 100},
                        sensor={"frequency_khz": 300.0, "noise": True, "noise_level_db": 60.0,
                                "receive_pattern": "rectangular", "receive_element_length": length,
                                "receive_element_height": height})
    signals = mitsonar.element_signals(scene)
    level = 10 * np.log10(np.mean(np.abs(signals.values) ** 2))
    assert level == pytest.approx(60 + 10 * np.log10(signals.attrs["sampling_rate"] / gain), abs=0.3)


def test_a_track_flown_at_an_altitude_moves_as_it_is_flown(variant, tmp_path):
    """What heave was recorded does not count once the seabed tells the height."""
    time = np.arange(0, 2.01, 0.05)
    rows = np.stack([time, 0 * time, 3 * time, -10 - 0.5 * np.sin(4 * time), 0 * time, 0 * time, 0 * time], -1)
    velocity = {}
    for altitude in (0.0, 15.0):
        scene = tracked(tmp_path, rows, {"bed": buried_bed(30.0)}, ping_rate_hz=2.0, altitude=altitude)
        velocity[altitude] = scene.integrator().array_survey(scene, scene.sensors()[0]).velocity
    assert velocity[0.0][:, 2] == pytest.approx(-2 * np.cos(4 * np.arange(0, 2.01, 0.5)), abs=0.05)
    assert velocity[15.0] == pytest.approx(np.broadcast_to([0, 3, 0], (5, 3)), abs=1e-3)


def test_steering_knows_the_water_the_track_leads_through(variant, tmp_path):
    """The mean of the profile is 1500 m/s, the array's water 1530: delays are those of 1530 m/s."""
    track = write_track(tmp_path / "line.csv", [[0, 0, 0, -10, 0, 0, 0]])
    scene = array_sonar({"bed": bed(30.0, size=200.0)}, water={"profile": "0:1530, 20:1530, 21:1470, 40:1470"},
                        sensor={"transmit": "line", "transmit_elements": 2, "transmit_pitch": 0.5,
                                "transmit_steer_deg": "30, 0", "track": track})
    survey = scene.integrator().array_survey(scene, scene.sensors()[0])
    assert survey.transmit.delay == pytest.approx(np.array([-0.25, 0.25]) * 0.5 / 1530, rel=1e-9)
