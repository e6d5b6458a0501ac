"""Phases, angles and depths of an interferometric sidescan against closed forms.

A row x wavelengths up the face hears a plane wave of the sine s along it e^(i2π x s), s = a·n c / (c + n·v), n towards
the echo when it is received and v the rows' velocity. On a level bed two rows d wavelengths apart have the coherence

    γ = |∫ χ(u) χ*(u - τ) e^(i2πνu) du| / ∫ |χ|² du,      τ = d s / f,      ν = d ds/dt

χ the compressed pulse: it comes to one row later than to the other, and the angle changes within it.
"""
import functools

import mitsuba as mi
import numpy as np
import pytest
from sonar_scenes import bed as bed_of, buried_bed, interferometric, lambert, point_target, sediment, water_of

import mitsonar
import mitsonar.scene.loading  # tells Dr.Jit its libraries before Mitsuba is imported
from mitsonar.device.rotations import rotation_matrix
from mitsonar.propagation.numpy_rays.eigenrays import eigenray
from mitsonar.scene.errors import as_exception
from mitsonar.signal.matched_filtering import matched_filter
from mitsonar.survey.interferometric.instrument import both_sides
from mitsonar.survey.interferometric.plan import up_along
from mitsonar.verbs.images import opened
from mitsonar.water import SoundSpeedProfile

DEPTH, H, C = 10.0, 10.0, 1500.0
CENTRED = {"face_place": "0, 0, 0", "transmitter_place": "0, 0, 0"}
ANGLES = np.deg2rad([8.0, 20.0, 40.0, 60.0, 78.0])       # below the horizontal
RANGES = 10 + 5.0 * np.arange(len(ANGLES))
LINE = {"speed_knots": 5.0, "noise": True, "pings": 2, "ping_rate_hz": 2.0}
SHORT = {"range": 32.0, "bins": 320}
THERMOCLINE = SoundSpeedProfile([0.0, 12.0, 18.0, 60.0], [1520.0, 1518.0, 1495.0, 1490.0])


def bed(depth, material=None, tilt=0.0):
    """A level bed, or one that slopes to starboard, as wide as the sonar sees."""
    return bed_of(depth, material, size=110.0, tilt=tilt)


def planned(scene):
    scene, sensor, integrator = opened(scene)
    survey = integrator.survey(scene, sensor)
    return survey, both_sides(survey)


def points(**more):
    """A scene of points to starboard, beyond whose ranges the bed lies."""
    balls = {f"p{k}": point_target([r * np.cos(a), 0.0, -DEPTH - r * np.sin(a)])
             for k, (a, r) in enumerate(zip(ANGLES, RANGES))}
    return interferometric({"seabed": buried_bed(60.0), **balls}, depth=DEPTH, film={"range": 40.0, "bins": 400},
                           integrator={"cell": 4.0}, **more)


def peak(signals, time, near):
    """The rows' values at the strongest sample near a time."""
    about = np.flatnonzero(np.abs(time - near) < 2e-4)
    return signals[:, about[np.argmax(np.abs(signals[:, about]).sum(0))]]


def phase_errors(values, place, sine):
    """Phases of rows [cycles] less those of a sine, of the lowest row's."""
    off = np.angle(values * np.exp(-2j * np.pi * place * sine)) / (2 * np.pi)
    return off - off[0]


# ---- phases of points

def test_phases_between_rows_are_those_of_the_angle():
    """To 1e-3 of a cycle: what the grid over sines leaves, a fifteenth of a degree over four wavelengths."""
    survey, sides = planned(points(sensor=CENTRED))
    signals = sides[1].signals(0, 0)
    time = survey.sides[1].time[survey.sides[1].lead:]
    for angle, distance in zip(ANGLES, RANGES):
        values, sine = peak(signals, time, 2 * distance / C), np.sin(np.deg2rad(30) - angle)
        np.testing.assert_allclose(phase_errors(values, survey.rows.place, sine), 0, atol=1e-3)


def test_rays_that_bend_come_from_their_own_angle():
    """As the exact eigenray leaves the sonar; straight lines would be 3 degrees off."""
    survey, sides = planned(points(sensor=CENTRED, water=water_of(THERMOCLINE)))
    side = survey.sides[1]
    signals, time = sides[1].signals(0, 0), side.time[side.lead:]
    bent = []
    for angle, distance in zip(ANGLES, RANGES):
        ray = eigenray(THERMOCLINE, DEPTH, DEPTH + distance * np.sin(angle), distance * np.cos(angle))
        down = float(ray.launch_angle)
        values = peak(signals, time, 2 * float(ray.travel_time))
        np.testing.assert_allclose(phase_errors(values, survey.rows.place, np.sin(np.deg2rad(30) - down)), 0, atol=2e-3)
        bent.append(abs(down - angle))
    assert max(bent) > np.deg2rad(0.5)


def test_a_platform_that_moves_and_rolls_hears_where_it_is_then():
    """Sway at 2 m/s and 5 degrees of roll in 3 s: the phase is that of rows which stand there at the reception."""
    survey, sides = planned(points(sensor={"roll_deg": 5.0, "roll_period": 3.0, "speed_knots": 4.0, "pings": 4,
                                           "ping_rate_hz": 1.0, "heading_deg": 60.0, **CENTRED}))
    side, place = survey.sides[1], survey.rows.place
    time, trajectory, axis = side.time[side.lead:], survey.voyage.trajectory, up_along(side.receive)
    ping, looked = 0, 0
    sent = survey.track.time[ping]
    signals = sides[1].signals(ping, 0)
    for angle, distance in zip(ANGLES, RANGES):
        target = np.array([distance * np.cos(angle), 0.0, -DEPTH - distance * np.sin(angle)])
        out, delay = np.linalg.norm(target - survey.track.position[ping]) / C, 0.0
        for _ in range(5):
            back, attitude = trajectory.pose(np.array(sent + delay), np.array(sent))
            delay = out + np.linalg.norm(target - back) / C
        later = trajectory.pose(np.array(sent + delay + 1e-4), np.array(sent))[0]
        towards = (target - back) / np.linalg.norm(target - back)
        sine = axis @ rotation_matrix(*attitude).T @ towards / (1 + towards @ (later - back) / 1e-4 / C)
        if abs(survey.track.rotation()[ping][:, 0] @ towards) < 0.6:
            values = peak(signals, time, delay)
            np.testing.assert_allclose(phase_errors(values, place, sine), 0, atol=2e-3)
            looked += 1
    assert looked >= 2


# ---- coherence of a level bed

@functools.cache
def speckle(self_noise_db=None):
    """Signals of both sides over a level bed, from places 10 m apart, and their times and rows."""
    noise = {} if self_noise_db is None else {"self_noise_db": self_noise_db}
    survey, sides = planned(interferometric(
        {"seabed": bed(DEPTH + H)}, depth=DEPTH, film={"range": 36.0, "bins": 360},
        sensor={"speed_knots": 10.0, "pings": 4, "ping_rate_hz": 0.5, **CENTRED, **noise}))
    side = survey.sides[0]
    return [one.signals(ping, 1) for one in sides for ping in range(4)], side.time[side.lead:], survey


def measured_coherence(signals, time, survey, near, first, second, moving=None):
    """Of two rows about a range [m], freed from the phase of the mean bed."""
    d = survey.rows.place[second] - survey.rows.place[first]
    some = np.abs(0.5 * C * time - near) < 1.5
    turn = np.exp(-2j * np.pi * d * bed_sine(time[some]))
    cross = sum((rows[second, some] * np.conj(rows[first, some]) * turn).sum() for rows in signals)
    power = [sum((np.abs(rows[row, some]) ** 2).sum() for rows in signals) for row in (first, second)]
    return abs(cross) / np.sqrt(power[0] * power[1])


def bed_sine(time):
    """s of a level bed H below."""
    return np.sin(np.deg2rad(30.0) - np.arcsin(np.minimum(H / (0.5 * C * time), 1)))


def theory(survey, near, d):
    """γ of the module's formula."""
    side = survey.sides[0]
    rate, count = 8 * side.sampling_rate, 1 << 15
    frequency = np.fft.fftfreq(count, 1 / rate)
    spectrum = np.abs(side.pulse.spectrum(rate, count)) ** 2
    time = 2 * near / C
    s, slope = bed_sine(time), (bed_sine(time + 1e-5) - bed_sine(time - 1e-5)) / 2e-5
    chi, late = (np.fft.ifft(spectrum * np.exp(-2j * np.pi * frequency * shift))
                 for shift in (0.0, d * s / side.frequency))
    u = np.fft.fftfreq(count) * count / rate
    return abs(np.sum(chi * np.conj(late) * np.exp(2j * np.pi * d * slope * u))) / np.sum(np.abs(chi) ** 2)


@pytest.mark.parametrize("near", [13.5, 16.0, 22.0, 33.0])
def test_rows_lose_the_coherence_that_the_pulse_costs_them(near):
    """Where no face hears the other side's bed; 600 samples: (1 - γ²) / √(2 · 600), and what γ changes over 3 m."""
    signals, time, survey = speckle()
    for second in (1, 3):
        d = survey.rows.place[second] - survey.rows.place[0]
        wanted = np.mean([theory(survey, part, d) for part in np.linspace(near - 1.5, near + 1.5, 7)])
        found = measured_coherence(signals, time, survey, near, 0, second)
        assert found == pytest.approx(wanted, abs=0.003 + 4 * (1 - wanted ** 2) / np.sqrt(1200))


def test_noise_costs_coherence_by_its_ratio():
    """γ = γ_0 q / (1 + q), q the ratio of echoes to noise as the quiet record and the silent water tell."""
    (quiet, time, survey), (noisy, *_) = speckle(), speckle(self_noise_db=52.0)
    near, early = np.abs(0.5 * C * time - 33.0) < 1.5, 0.5 * C * time < 8.0
    echo = np.mean([np.abs(rows[:, near]) ** 2 for rows in quiet])
    noise = np.mean([np.abs(rows[:, early]) ** 2 for rows in noisy])
    ratio = echo / noise
    assert 1 < ratio < 20
    without = measured_coherence(quiet, time, survey, 33.0, 0, 1)
    found = measured_coherence(noisy, time, survey, 33.0, 0, 1)
    assert found == pytest.approx(without * ratio / (1 + ratio), abs=0.03)


# ---- depths

def sounded(shapes=None, *, profile=None, water=None, film=None, **sensor):
    scene = interferometric(shapes or {"seabed": bed(DEPTH + H, sediment("medium sand"))}, depth=DEPTH, water=water,
                            film=film or SHORT, sensor={**LINE, **sensor})
    return mitsonar.soundings(scene, profile=profile)


@functools.cache
def level_line(tilt=0.0):
    return sounded({"seabed": bed(DEPTH + H, sediment("medium sand"), tilt=tilt)}, pings=6, motion="hull",
                   film={"range": 42.0, "bins": 420})


def within(line, name, low, high):
    """Valid values of a variable where soundings lie between distances across the track [m]."""
    aside = np.abs(line["across_track"].values)
    return line[name].values[line["valid"].values & (aside > low) & (aside < high)]


@pytest.mark.parametrize("tilt", [0.0, np.deg2rad(5.0)])
@pytest.mark.parametrize("low, high", [(5.0, 9.0), (9.0, 15.0), (15.0, 25.0), (25.0, 40.0)])
def test_depths_of_a_slope_err_as_coherence_says_and_no_more(tilt, low, high):
    """Spread to a quarter of what is stated (150 windows or more), bias to a quarter of it."""
    line = level_line(tilt)
    error, stated = within(line, "error", low, high), within(line, "uncertainty", low, high)
    assert len(error) > 250
    assert error.std() == pytest.approx(np.sqrt((stated.astype(float) ** 2).mean()), rel=0.3)
    assert abs(error.mean()) < 0.25 * error.std()


def test_below_the_sonar_depths_are_worse_and_fewer():
    line = level_line()
    angle = np.rad2deg(np.abs(line["angle"].values))
    near, far = (line["valid"].values & (angle > low) & (angle < high) for low, high in ((0, 15), (40, 55)))
    assert line["error"].values[near].std() > 1.5 * line["error"].values[far].std()
    assert near.sum() < 0.5 * far.sum()
    assert line["uncertainty"].values[near].mean() > line["uncertainty"].values[far].mean()


def test_strength_of_the_bed_is_that_of_its_law():
    """Within 0.7 dB over 25 to 70 degrees from the vertical: lobes that have turned on cost up to 0.4."""
    line = level_line()
    angle = np.rad2deg(np.abs(line["angle"].values))
    some = line["valid"].values & (angle > 25) & (angle < 70)
    off = (line["backscatter_db"] - line["true_backscatter_db"]).values[some]
    assert 10 * np.log10(np.mean(10 ** (0.1 * off))) == pytest.approx(0, abs=0.7)


def box(**sensor):
    top = mi.ScalarTransform4f().translate([20.0, 0, -DEPTH - H + 1.5]).scale([2.0, 8.0, 1.5])
    return interferometric({"seabed": bed(DEPTH + H), "box": {"type": "cube", "to_world": top, "bsdf": lambert(-15.0)}},
                           depth=DEPTH, sensor={"noise": True, "pings": 2, **CENTRED, **sensor},
                           film={"range": 40.0, "bins": 400})


def test_the_top_of_a_box_is_as_high_as_it_is_and_its_face_lies_over_the_bed():
    """3 m high, from 18 to 22 m aside; before it face and bed come at one time, behind it is its shadow."""
    image = mitsonar.render(box())
    starboard = image.sel(side="starboard")
    number = next(int(key) for key, name in image.attrs["labels"].items() if name == "box")
    distance = image["range"].values
    on_top = (distance > np.hypot(18.0, H) + 0.3) & (distance < np.hypot(22.0, H - 3.0) - 0.3)
    assert (starboard["label"].values[:, on_top] == number).all()
    for name in ("depth", "measured_depth"):
        assert np.nanmedian(starboard[name].values[:, on_top]) == pytest.approx(DEPTH + H - 3.0, abs=0.05)
    assert np.nanmedian(starboard["error"].values[:, on_top]) == pytest.approx(0, abs=0.05)
    mixed = (distance > np.hypot(18.0, H - 3.0) + 0.3) & (distance < np.hypot(18.0, H) - 0.3)
    clean = (distance > 26.0) & (distance < 28.0)
    port = image.sel(side="port")
    assert (starboard["layover"].values[:, mixed] >= 2).mean() > 0.8
    assert (starboard["coherence"].values[:, mixed].mean() < port["coherence"].values[:, mixed].mean() - 0.005)
    shadow = (starboard["object_shadow"].values == number)
    assert shadow[:, clean].all() and not starboard["valid"].values[:, clean].any()
    assert port["valid"].values[:, clean].all()


def test_causes_of_errors_are_told_apart():
    """A roll bias of half a degree lifts the bed by y δ; 5 m/s at a face 30 degrees down by what Snell leaves of it."""
    line = sounded(roll_bias_deg=0.5)
    across = line["across_track"].values
    some = line["valid"].values & (np.abs(across) > 15) & (np.abs(across) < 25)
    np.testing.assert_allclose(line["error"].values[some], sum(line[f"error_{cause}"].values[some] for cause in (
        "detection", "refraction", "motion")), atol=1e-9)
    np.testing.assert_allclose(line["error_motion"].values[some], np.deg2rad(0.5) * across[some], rtol=0.05)
    assert np.abs(line["error_refraction"].values[some]).max() < 1e-6
    for wrong in ({"head_speed_error": 5.0}, {"profile": SoundSpeedProfile([0.0, 60.0], [1510.0, 1510.0])}):
        line = sounded(**wrong)
        some = line["valid"].values & (np.abs(line["across_track"].values) > 15)
        assert np.abs(line["error_refraction"].values[some]).mean() > 0.01
        assert np.abs(line["error_motion"].values[some]).mean() < 1e-3


def test_soundings_through_a_thermocline_are_right_with_its_cast_and_wrong_without():
    water = water_of(THERMOCLINE)
    right = sounded(water=water)
    wrong = sounded(water=water, profile=SoundSpeedProfile([0.0, 60.0], [1518.0, 1518.0]))
    assert abs(within(right, "error", 15.0, 30.0).mean()) < 0.02
    assert abs(within(wrong, "error", 15.0, 30.0).mean()) > 0.2


# ---- records

def test_picture_and_soundings_are_of_the_same_echoes():
    scene = {"shapes": {"seabed": bed(DEPTH + H)}, "depth": DEPTH, "sensor": LINE, "film": SHORT}
    image, line = (make(interferometric(**scene), seed=3) for make in (mitsonar.render, mitsonar.soundings))
    assert image.sizes["side"] == 2 and line.sizes["beam"] == 2 * image.sizes["range"]
    for own in ("measured_depth", "measured_x", "measured_y", "measured_across_track", "uncertainty", "valid"):
        name = own.removeprefix("measured_")
        both = np.concatenate([image[own].values[:, 0, ::-1], image[own].values[:, 1]], -1)
        valid = line["valid"].values
        np.testing.assert_allclose(both[valid].astype(float), line[name].values[valid].astype(float), rtol=1e-6)
    assert (np.diff(line["angle"].values[0][line["valid"].values[0]]) > -0.3).all()


def test_same_bytes_whatever_the_threads_and_the_pings_before():
    import drjit as dr

    def made(pings):
        return interferometric({"seabed": bed(DEPTH + H)}, depth=DEPTH, sensor={**LINE, "pings": pings}, film=SHORT)

    threads = dr.thread_count()
    whole = mitsonar.render(made(3), seed=4)
    try:
        dr.set_thread_count(1 if threads > 1 else 2)
        other = mitsonar.render(made(3), seed=4)
    finally:
        dr.set_thread_count(threads)
    for name in whole.data_vars:
        np.testing.assert_array_equal(other[name].values, whole[name].values, err_msg=name)
    fewer = mitsonar.render(made(2), seed=4)
    np.testing.assert_allclose(fewer["level"].values, whole["level"].values[:2], atol=0.01)
    assert not np.array_equal(mitsonar.render(made(2), seed=5)["level"].values, fewer["level"].values)


def test_elements_are_the_transmitters_and_rows_of_both_sides():
    scene = interferometric({"seabed": buried_bed(60.0), "ball": point_target([8.0, 0.0, -14.0])}, depth=DEPTH,
                            sensor=CENTRED, film={"range": 12.0, "bins": 120}, integrator={"cell": 4.0})
    survey, sides = planned(scene)
    exact = mitsonar.element_signals(scene)
    assert exact.sizes["rx"] == 8
    found = matched_filter(exact.values[0, 0], survey.sides[1].pulse, exact.attrs["sampling_rate"])
    at = np.argmax(np.abs(found[4:]).sum(0))
    rows = sides[1].signals(0, 0)
    mine = np.argmax(np.abs(rows).sum(0))
    apart = np.angle(found[4:, at] / found[4, at] * np.conj(rows[:, mine] / rows[0, mine]))
    np.testing.assert_allclose(apart, 0, atol=0.03)
    assert np.abs(found[:4]).max() < 1e-3 * np.abs(found[4:]).max()


# ---- bad input

@pytest.mark.parametrize("sensor, words", [
    ({"rows": "0, 1, 2"}, "take sines .* apart for the same"), ({"rows": "1, 0"}, "places \\[wavelengths\\] that rise"),
    ({"rows": "0"}, "rows is \\[0.0\\]"), ({"face_place": "0, 500, 0"}, "face_place is .* at most 100 m"),
    ({"depth_gate": "5, 2"}, "depth_gate is 5 to 2 m"),
    ({"pulse": "cw", "bandwidth_khz": 20.0}, "bandwidth_khz is given")])
def test_what_cannot_be_is_refused_in_a_sentence(sensor, words):
    with pytest.raises(Exception) as caught:
        interferometric({"seabed": bed(20.0)}, sensor=sensor)
    said = as_exception(caught.value)
    assert isinstance(said, ValueError)
    with pytest.raises(ValueError, match=words):
        raise said


def test_numbers_out_of_bounds_are_refused_in_a_sentence_that_names_them():
    from mitsonar.plugins.attributes import Number
    from mitsonar.plugins.attributes.groups import flat

    def made(**sensor):
        return interferometric({"seabed": bed_of(20.0, size=10.0)}, sensor=sensor)

    numbers = [one for one in flat(made().sensors()[0].declared) if isinstance(one, Number) and not one.only]
    assert len(numbers) > 20
    for one in numbers:
        bad = [np.nan, np.inf, "much"]
        bad += [] if one.minimum is None else [one.minimum - 1]
        bad += [] if one.above is None else [one.above, one.above - 1]
        bad += [] if one.maximum is None else [one.maximum + 1]
        for value in bad:
            if "Float" not in one.types and value not in ("much", np.inf) and value == value:
                value = int(value)
            with pytest.raises(Exception) as caught:
                made(**{one.name: value})
            said = str(as_exception(caught.value))
            assert f"{one.name} is" in said and one.expected in said and "Traceback" not in said, said


def test_a_water_column_is_not_asked_of_it():
    with pytest.raises(ValueError, match="no beams, whose water column"):
        mitsonar.soundings(interferometric({"seabed": bed(20.0)}), column=True)


def test_a_gate_keeps_soundings_within_it_and_a_sonar_without_a_bed_has_none():
    line = sounded(depth_gate="9.5, 12", pings=1)
    depth = line["depth"].values[line["valid"].values]
    assert len(depth) > 100 and depth.min() > DEPTH + 9.4 and depth.max() < DEPTH + 12.1
    empty = sounded({"seabed": bed(200.0)}, pings=1, noise=False)
    assert not empty["valid"].values.any()
