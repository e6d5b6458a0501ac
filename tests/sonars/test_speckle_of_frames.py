"""Pictures in the beam domain against what shares nothing with them: closed forms, and sums over elements in NumPy.

Geometry: a line of 32 receivers at 300 kHz, 4 m above a level bed of Lambert's law, 20 kHz under a Hann window, beams
in equal steps of sine. Six frames from places apart hold some 4000 independent cells: 0.07 dB, and 0.05 of <I²>/<I>².

- Mean power: the sonar equation times |W|² and the compressed pulse, integrated over the rings of the bed.
- Speckle: <I²>/<I>² = 2 (1 + 1/N), N scatterers a cell as the pulse and the beam weigh them; correlations over beams
  are those of the line's squared weights, over samples those of the compressed pulse (van Cittert and Zernike).
- Point targets under way and turning: each element where it is when it hears.
- Frames of a sonar that has moved, registered on the ground: coherence as in the element chain.
"""
import brute_force_beams as exact
import mitsuba as mi  # noqa: F401  (the variant is chosen before)
import numpy as np
import pytest
import speckle
from track_files import write_track

from mitsonar.imaging import fan
from mitsonar.survey.beam_domain.frames import Frames
from mitsonar.survey.pressure.pressure import PressureRecord
from mitsonar.survey.pressure.signals import LEAD, received_signals
from mitsonar.validation import scenes
from mitsonar.verbs.images import opened

SPEED, WAVELENGTH, ALTITUDE = 1500.0, 0.005, 4.0
SWEEP = exact.Sweep(frequency=300e3, bandwidth=20e3, duration=0.5e-3)
LINE = {"frequency_khz": 300.0, "pulse": "lfm", "bandwidth_khz": 20.0, "pulse_ms": 0.5, "pulse_window": "hann",
        "source_level_db": 205.0, "transmit": "point", "transmit_normal": "forward", "transmit_baffle": "hard",
        "receive": "line", "receive_elements": 32, "receive_normal": "forward", "receive_baffle": "hard",
        "receive_shading": "hamming"}
PLACES = [(-2.0 * k, 3.0 * k) for k in range(1, 7)]               # ahead and to starboard [m]


def planned(shapes, *, film, **sensor):
    scene, sensor, path = opened(scenes.array_sonar(shapes, sensor={**LINE, **sensor}, film=film,
                                                    integrator={"cell": 0.04}))
    survey = path.array_survey(scene, sensor, LEAD)
    return survey, fan.fan_directions(survey.receive, 41, np.deg2rad(80), "sine")[1]


def over_bed(place=(0.0, 0.0), nearest=8.0):
    return planned({"seabed": scenes.bed(20.0, size=110.0)}, film={"range": 12.0, "range_min": nearest},
                   start=[place[1], place[0], ALTITUDE - 20.0])


def distance_of(survey):
    return 0.5 * SPEED * survey.time[survey.lead:]


@pytest.fixture(scope="module")
def expected():
    """Survey, directions, and mean powers (B, S) of the level bed."""
    survey, direction = over_bed()
    R = distance_of(survey)
    nodes = np.linspace(R[0], R[-1], 25)
    power = exact.beam_power_of_bed(
        nodes, direction[:, 1], altitude=ALTITUDE, lambert_db=-27.0, sweep=SWEEP, sound_speed=SPEED,
        place=survey.receive.position[:, 1] / WAVELENGTH, weight=survey.receive.weight, absorption_db=0.03,
        source_level_db=205.0, pattern=lambda sight: (sight[..., 0] > 0) * 1.0)
    return survey, direction, np.array([np.interp(R, nodes, row) for row in power])


@pytest.fixture(scope="module")
def frames():
    """Frames from several places, 5 scatterers a cell."""
    return [Frames(*over_bed(place), per_cell=5).frame(0, 1)[0] for place in PLACES]


def test_the_level_of_a_bed_is_the_integral_of_the_sonar_equation(frames, expected):
    ratio = np.mean([np.abs(frame) ** 2 for frame in frames], axis=0) / expected[2]
    assert 10 * np.log10(ratio.mean()) == pytest.approx(0, abs=0.2)
    for half in (ratio[:, :96], ratio[:, 96:], ratio[:20], ratio[21:]):
        assert 10 * np.log10(half.mean()) == pytest.approx(0, abs=0.35)


def test_speckle_has_the_moment_of_many_scatterers_and_the_correlations_of_line_and_pulse(frames, expected):
    survey, direction, mean = expected
    assert 1.9 < speckle.second_moment(frames, mean) < 2.3
    gap = direction[1, 1] - direction[0, 1]
    place, weight = survey.receive.position[:, 1] / WAVELENGTH, survey.receive.weight
    of_line = [speckle.correlation_of_line(place, weight, k * gap) for k in (1, 2, 3)]
    assert speckle.correlation(frames, mean, (1, 2, 3), 0) == pytest.approx(of_line, abs=0.06)
    of_pulse = speckle.correlation_of_pulse(SWEEP.compressed(survey.sampling_rate), np.array([1, 2, 3]))
    assert speckle.correlation(frames, mean, (1, 2, 3), 1) == pytest.approx(of_pulse, abs=0.06)


def test_speckle_goes_with_the_ground_as_in_the_element_chain(expected):
    """N independent cells bring 1/√N = 0.04 of chance; the chain has 0.33 for 5 cm ahead, 0.01 for 30 cm aside."""
    R, sines = distance_of(expected[0]), expected[1][:, 1]
    alike = {}
    for name in ("beams", "elements"):
        first, ahead, aside = (formed(name, place) for place in ((0.0, 0.0), (0.05, 0.0), (0.0, 0.3)))
        alike[name] = [speckle.coherence(first, second, moved=np.array(moved), distance=R, sines=sines,
                                         altitude=ALTITUDE, wavenumber=2 * np.pi / WAVELENGTH)
                       for second, moved in ((ahead, (0.05, 0.0)), (aside, (0.0, 0.3)))]
    assert alike["beams"] == pytest.approx(alike["elements"], abs=0.1)
    assert alike["beams"][0] > 0.2 > 0.1 > alike["beams"][1]


def formed(way, place):
    survey, direction = over_bed(place)
    if way == "beams":
        return Frames(survey, direction, per_cell=5).frame(0, 1)[0]
    return fan.formed(received_signals(PressureRecord(survey, seed=1), [0]), survey.pulse, direction)[0]


# what beams keep of Doppler across the band is -49 dB; the element chain's classes are off by -42 dB here
@pytest.mark.parametrize("knots, turn, worst", [(0.0, 0.0, -53), (3.0, 12.0, -46)])
def test_point_targets_are_those_of_a_sum_over_elements(tmp_path, knots, turn, worst):
    """At 5, 14 and 27 m, elements where they are when they hear; levels absolute."""
    speed, start = 0.514444 * knots, np.array([0.0, 0.0, -10.0])
    places = np.array([[-1.5, 4.7, -10.6], [3.0, 13.6, -10.9], [-8.0, 25.8, -11.0]])
    strength = np.array([0.0, 18.0, 29.0])
    shapes = {f"p{k}": scenes.point_target(place, level) for k, (place, level) in enumerate(zip(places, strength))}
    t, where = np.arange(-4, 4, 0.1), {}
    if knots:
        track = np.stack([t + 4, 0 * t, speed * t, 0 * t - 10, 0 * t, 0 * t, turn * t], 1)
        where = {"track": write_track(tmp_path / "track.csv", track), "pings": 2, "ping_rate_hz": 0.25}
    survey, direction = planned({"seabed": scenes.buried_bed(60.0), **shapes}, film={"range": 30.0, "range_min": 3.0},
                                **(where or {"start": start}))
    ping = survey.track.pings - 1
    course = exact.Course(start=survey.track.position[ping], velocity=np.array([0.0, speed, 0.0]),
                          heading=np.deg2rad(turn) * (survey.track.time[ping] - 4 if knots else 0.0),
                          turn_rate=np.deg2rad(turn))
    truth = exact.beams_of_points(
        places, strength, course=course, sweep=SWEEP, elements=survey.receive.position, weight=survey.receive.weight,
        directions=direction, time=survey.time[survey.lead:], sound_speed=SPEED, absorption_db=0.03,
        source_level_db=205.0)
    mine = Frames(survey, direction, per_cell=5).frame(ping, 1)[0]
    R = distance_of(survey)
    for place in places:
        some = np.abs(R - np.linalg.norm(place - course.start)) < 1.5
        error = np.abs(mine - truth)[:, some].max() / np.abs(truth[:, some]).max()
        assert 20 * np.log10(error) < worst
