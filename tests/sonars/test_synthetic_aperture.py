"""Raw echoes of a synthetic aperture, and the truth of its image.

In water of one sound speed c a point target at p sends back what leaves the transmitter at t_0 and comes to a receiver
at t_0 + τ,

    c τ = |p - x_t(t_0)| + |p - x_r(t_0 + τ)|

whatever the platform does meanwhile. `arrival` iterates it from the trajectory that the record itself tells, in code
that shares nothing with the renderer's.
"""
import warnings

import mitsuba as mi
import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from sonar_scenes import bed, lambert, point_target, synthetic_aperture

import mitsonar
from mitsonar.device.rotations import rotation_matrix
from mitsonar.sonar.arrays.element_patterns import element_pressure
from mitsonar.sonar.preset_tables import presets
from mitsonar.sonar.pulses.pulses import pulse_of
from mitsonar.survey.synthetic_aperture.truth import strip_truth
from mitsonar.synthetic_aperture.record import check_raw
from mitsonar.verbs.images import opened
from mitsonar.verbs.strips import raw_pings, scatterers

C = 1500.0
WATER = {"sound_speed": C, "absorption_db_per_km": 0.0}
UNEASY = {"overlap": 4, "sway": 0.05, "heave": 0.04, "yaw_deg": 1.0, "surge": 0.05, "roll_deg": 1.0,
          "motion_period": 3.0}
TARGET = (24.0, 0.3, -19.0)
SILENT = bed(20.3, lambert(-200.0))


def strip(sensor=None, shapes=None, **more):
    return synthetic_aperture(shapes or {"seabed": SILENT, "target": point_target(TARGET)}, water=WATER,
                              sensor={**UNEASY, **(sensor or {})}, **more)


def numbers(survey):
    """Labels of the crate and of the seabed."""
    return [next(number for number, name in survey.labels.items() if name == wanted) for wanted in ("crate", "seabed")]


def poses(raw):
    """Place (3,) and attitude matrix of the body at a time."""
    way = CubicSpline(raw.motion_time, np.stack([raw.motion_x, raw.motion_y, -raw.motion_depth], -1))
    turns = CubicSpline(raw.motion_time, np.stack([raw.motion_roll, raw.motion_pitch, raw.motion_heading], -1))
    return lambda t: (way(t), rotation_matrix(*turns(t)))


def arrival(raw, pose, ping, rx, target, after=0.0):
    """Delay of what is sent some time after the ping's beginning."""
    sent = float(raw.ping_time[ping]) + after
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


def test_the_middle_of_a_long_pulse_arrives_at_the_ends_of_a_long_array_when_the_trajectory_says():
    """Within 0.002 cycle: the ends close in by 3 cm/s more or less, 0.018 cycle until the middle of 5 ms."""
    steady = dict.fromkeys(("sway", "heave", "yaw_deg", "surge", "roll_deg"), 0.0)
    long = mitsonar.raw_echoes(strip({**steady, "receivers": 36, "overlap": 12, "pulse_ms": 5.0, "pings": 2}))
    for rx in (0, 18, 35):
        tau = arrival(long, poses(long), 0, rx, np.array(TARGET), after=2.5e-3)
        assert abs(np.angle(pointed(long, 0, rx, tau))) < 2 * np.pi * 0.002, rx


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


@pytest.mark.parametrize("preset", presets("synthetic_aperture"))
def test_presets_resolve_what_their_class_does(preset):
    """c / 2B across, and half the longer element along the track: 1.5 to 6 cm; bands are sampled by half more."""
    own = presets("synthetic_aperture")[preset]
    scene = synthetic_aperture({"seabed": SILENT}, water=WATER, sensor={
        "preset": preset, "receivers": own["receivers"], "banks": own["banks"], "pulse_ms": own["pulse_ms"],
        "overlap": own["receivers"] // 4})
    scene, sensor, integrator = opened(scene)
    survey = integrator.survey(scene, sensor)
    assert 0.01 < C / (2 * survey.pulse.bandwidth) < 0.06
    assert 0.01 < 0.5 * max(survey.transmit.length, survey.receive.length) < 0.06
    assert survey.sampling_rate > 1.4 * survey.pulse.bandwidth
    assert survey.receive.elements == own["receivers"] * own["banks"] == len(survey.bank)
    above = survey.receive.position[survey.bank == 0, 2] - survey.receive.position[survey.bank == survey.bank.max(), 2]
    assert (above < 0).all() == (own["banks"] > 1)                                # topmost first, z is down


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


def test_the_scatterers_of_a_strip_are_told_with_the_areas_they_stand_for():
    """On a level bed they cover the area in range, and their amplitudes have mean square 1."""
    found = scatterers(strip(shapes={"seabed": bed(20.3)}))
    flat = np.hypot(found.x, found.depth - 10.0)
    abreast = (abs(found.y) < 0.2) & (flat > 21) & (flat < 29)
    wide = np.sqrt(29 ** 2 - 10.3 ** 2) - np.sqrt(21 ** 2 - 10.3 ** 2)
    assert float(found.area[abreast].sum()) == pytest.approx(0.4 * wide, rel=0.1)            # cells of 0.25 m
    assert float((abs(found.amplitude) ** 2).mean()) == pytest.approx(1.0, abs=4 / np.sqrt(found.sizes["scatterer"]))
    assert (found.x > 0).all() and (found.depth > 20.2).all()


def test_echoes_add_up_to_what_the_scatterers_say():
    """A receiver's raw echo is the sum over the scatterers, brute force: correlation above 0.99 over the record.

    Amplitudes by Lambert's law and the sonar equation; faces are shallow, so beams matter little over the range.
    """
    steady = dict.fromkeys(("sway", "heave", "yaw_deg", "surge", "roll_deg"), 0.0)
    scene = strip({**steady, "pings": 2, "vertical_beam_width_deg": 180.0}, shapes={"seabed": bed(20.3)})
    raw, every = mitsonar.raw_echoes(scene), scatterers(scene)
    pose, sensor, sent = poses(raw), opened(scene)[1], float(raw.ping_time[0])
    place, turned = pose(sent)
    point = np.stack([every.x, every.y, -every.depth], -1)
    way = point - (place + turned @ raw.tx_position.values[0])
    out = np.linalg.norm(way, axis=1)
    velocity = (pose(sent + 0.01)[0] - place) / 0.01
    home = out
    for _ in range(3):
        receiver = place + turned @ raw.rx_position.values[3] + ((out + home) / C)[:, None] * velocity
        home = np.linalg.norm(point - receiver, axis=1)
    tau = (out + home) / C
    u = way @ turned[:, 0] / out * 300e3 / C
    beams = np.sinc(sensor.transmit.length * u) * np.sinc(sensor.receive.length * u)
    strength = np.sqrt(10 ** -2.7 * every.area.values) * 10.3 / out                         # Lambert: μ sin² θ
    echo = (10 ** (raw.attrs["source_level_db"] / 20) * every.amplitude.values * strength * beams / (out * home)
            * np.exp(-2j * np.pi * 300e3 * tau))
    pulse, t = pulse_of(raw.attrs["pulse"]), raw.time.values
    wanted = np.zeros(len(t), complex)
    for amplitude, late in zip(echo, tau):
        on = slice(*np.searchsorted(t, (late, late + pulse.duration)))
        wanted[on] += amplitude * pulse.envelope(t[on] - late)
    heard = raw.signal.values[0, 3]
    match = np.vdot(wanted, heard) / np.sqrt(np.vdot(wanted, wanted).real * np.vdot(heard, heard).real)
    assert abs(match) > 0.99 and abs(np.angle(match)) < 0.05
    assert np.linalg.norm(heard) / np.linalg.norm(wanted) == pytest.approx(1.0, abs=0.02)


def test_the_truth_of_a_box_stands_where_its_echo_does():
    """From H above the bed, edges of the top at x, h high, stand in the image at √(x² + (H - h)² - H²).

    The shadow ends where the ray over the far edge meets the bed, x H / (H - h). Within two points of 2 cm.
    """
    height, top, near, far = 10.3, 0.6, 24.0, 24.8
    cube = {"type": "cube", "bsdf": lambert(-15.0), "to_world": mi.ScalarTransform4f().translate(
        [0.5 * (near + far), 0.3, -20.3]).scale([0.5 * (far - near), 0.5, top])}
    scene, sensor, integrator = opened(strip(shapes={"seabed": bed(20.3), "crate": cube}))
    y, x = np.meshgrid(np.arange(-0.5, 1.1, 0.02), np.arange(23.0, 27.0, 0.02), indexing="ij")
    survey = integrator.survey(scene, sensor)
    truth, (of_crate, of_bed) = strip_truth(survey, x, y, np.full(x.shape, 20.3)), numbers(survey)
    first, last = (np.sqrt(edge ** 2 + (height - top) ** 2 - height ** 2) for edge in (near, far))
    across, rows = x[0], (y[:, 0] > -0.15) & (y[:, 0] < 0.75)
    crate = (truth["label"].values[rows] == of_crate).mean(0) > 0.5
    assert across[crate].min() == pytest.approx(first, abs=0.04)
    assert across[crate].max() == pytest.approx(last, abs=0.04)
    dark = truth["shadow"].values[rows].mean(0) > 0.5
    assert across[dark].min() == pytest.approx(last, abs=0.04)
    assert across[dark].max() == pytest.approx(far * height / (height - top), abs=0.04)
    assert (truth["object_shadow"].values[rows][:, dark] == of_crate).mean() > 0.9
    beside = y[:, 0] < -0.25
    assert not truth["shadow"].values[beside].any()
    assert (truth["label"].values[beside] == of_bed).mean() > 0.995                # side lobes of a narrow beam
    seen = truth["seabed_x"].values[beside]
    assert np.nanmax(np.abs(seen - x[beside])) < 0.04


def test_round_a_circle_labels_are_those_seen_from_above():
    scene = synthetic_aperture({"seabed": bed(20.3), "crate": {
        "type": "cube", "bsdf": lambert(-15.0), "to_world": mi.ScalarTransform4f().translate([0, 0, -20.3])}},
        water=WATER, sensor={"circle_radius": 22.0, "overlap": 0, "start": [0.0, 0.0, -10.0], "heading_deg": None,
                             "pings": None})
    scene, sensor, integrator = opened(scene)
    y, x = np.meshgrid(np.arange(-3.0, 3.05, 0.25), np.arange(-3.0, 3.05, 0.25), indexing="ij")
    survey = integrator.survey(scene, sensor)
    truth = strip_truth(survey, x + 0.01, y + 0.01, np.full(x.shape, 20.3))
    on = np.maximum(abs(x + 0.01), abs(y + 0.01)) < 1
    np.testing.assert_array_equal(truth["label"].values == numbers(survey)[0], on)
    assert (truth["shadow"].values[on] == 0).all()
    assert truth["shadow"].values[x.shape[0] // 2, -8] > 0.2          # of the circle, beside it
