"""Strengths, angles and depths of an echo sounder against closed forms.

A target of strength TS at the range r, θ off the axis, has the level

    p² = SL + TS - 40 log r - 2 α r + 20 log |b_t b_r|,     b = 2 J1(x)/x,  x = π D sin θ / λ, of a disc

and the sounder's TS is that level without the pattern. Samples lie up to 1/48 of the bandwidth off a peak: to 0.1 dB.
Water of the volume strength S_v fills the equivalent beam, whose S_v is unbiased; the mean of N independent bins has a
deviation of 4.3 dB / √N. The energy of a level bed's echo is an integral over the angle from the axis:

    ∫ p² dt = 10^(SL/10) τ ∫ |b|⁴ S_b(θ) 10^(-0.2 α r) r^-4 dA,     dA = 2π H² tan θ / cos² θ dθ,  r = H / cos θ
"""
import functools

import numpy as np
import pytest
from exhaustive import thinned
from scipy.special import j1
from sonar_scenes import bed, buried_bed, echo_sounder, lambert, point_target

import mitsonar
import mitsonar.scene.loading  # tells Dr.Jit its libraries before Mitsuba is imported
from mitsonar import plots
from mitsonar.imaging.echo_sounder import CalibratedSounder
from mitsonar.imaging.objects import object_bins
from mitsonar.scene.errors import as_exception
from mitsonar.signal.matched_filtering import compression, matched_filter
from mitsonar.sonar.preset_tables import presets
from mitsonar.sonar.pulses.pulses import pulse_of

C, ALPHA = 1500.0, 0.03
PUBLISHED = {"scientific_38khz": -20.7, "scientific_120khz": -21.0, "scientific_200khz": -20.7}
every_preset = pytest.mark.parametrize("preset", thinned(presets("echo_sounder"), "scientific_120khz",
                                                         "navigation_50khz"))


def sounder(shapes, *, preset="scientific_120khz", sensor=None, **parts):
    """Load a scene of an echo sounder with a preset; parts as of `sonar_scenes`."""
    return echo_sounder(shapes, sensor={"preset": preset, **(sensor or {})}, **parts)


def peak(image, near, ping=0):
    """The bin of the strongest echo within 1 m of a range."""
    away = image.isel(ping=ping)
    about = np.flatnonzero(np.abs(away["range"].values - near) < 1.0)
    return away.isel(range=about[np.argmax(away["target_strength"].values[about])])


def pattern_db(theta, preset):
    """One-way pattern of a disc that is as wide as the preset says."""
    half = np.sin(np.deg2rad(presets("echo_sounder")[preset]["beam_width_deg"]) / 2)
    x = 1.61634 * np.sin(theta) / half
    return 20 * np.log10(np.abs(2 * j1(x) / x)) if theta else 0.0


# ---- targets

@every_preset
@pytest.mark.parametrize("aside", [(0.0, 0.0), (0.6, 0.0), (0.0, -0.9), (0.5, 0.8)])
def test_a_target_has_its_strength_and_its_direction(preset, aside):
    """`aside` in shares of half the beam width, to starboard (east) and ahead (north).

    The target lies in the middle of a bin of 2.5 cm. A triangle |χ| as long as c T / 2 is on average 0.07 dB / (T / ms)
    below its peak there.
    """
    own, away = presets("echo_sounder")[preset], 35.0125
    angle = np.tan(0.5 * np.deg2rad(own["beam_width_deg"])) * np.array(aside)
    along = np.array([angle[0], angle[1], -1.0]) / np.sqrt(1 + angle @ angle)
    ball = point_target([0, 0, -2] + away * along, -42.0)
    image = mitsonar.render(sounder({"seabed": buried_bed(80.0), "ball": ball}, preset=preset, film={"bins": 2400}))
    found, two_way = peak(image, away), 2 * pattern_db(np.arccos(-along[2]), preset)
    assert float(found["range"]) == pytest.approx(away, abs=0.026)
    wanted = own["source_level_db"] - 42.0 - 40 * np.log10(away) - 2 * ALPHA * away + two_way
    assert float(found["level"]) == pytest.approx(wanted, abs=0.15 + 0.08 / own["pulse_ms"])
    assert float(found["target_strength"]) == pytest.approx(-42.0 + two_way, abs=0.2)
    assert int(found["label"]) == 1 and image.attrs["labels"]["1"] == "ball"
    if own["split_beam"]:
        assert float(found["compensated_target_strength"]) == pytest.approx(-42.0, abs=0.2)
        for name, sine in (("angle_athwart", along[0]), ("angle_along", along[1])):
            assert float(found[name]) == pytest.approx(np.arcsin(sine), abs=2e-4)
    else:
        assert not {"angle_along", "angle_athwart", "compensated_target_strength"} & set(image)


@pytest.mark.parametrize("pulse", [{"pulse": "lfm", "pulse_ms": 1.0, "bandwidth_khz": 20.0}, {"face": "square"},
                                   {"mounting_deg": "10, -20, 30"}])
def test_sweeps_squares_and_turned_faces_measure_alike(pulse):
    """A turned face looks along Rz(30) Ry(-20) Rx(10) z: its target lies on the axis, 30 m away."""
    from mitsonar.device.rotations import mounting_matrix

    turn = mounting_matrix(*np.deg2rad([float(part) for part in pulse.get("mounting_deg", "0, 0, 0").split(",")]))
    north, east, down = turn @ [0.03, 0.02, np.sqrt(1 - 0.03 ** 2 - 0.02 ** 2)]
    ball = point_target([30 * east, 30 * north, -2 - 30 * down], -50.0)
    found = peak(mitsonar.render(sounder({"seabed": buried_bed(80.0), "ball": ball}, sensor=pulse)), 30.0)
    assert float(found["compensated_target_strength"]) == pytest.approx(-50.0, abs=0.2)
    assert float(found["angle_along"]) == pytest.approx(np.arcsin(0.03), abs=2e-4)
    assert float(found["angle_athwart"]) == pytest.approx(np.arcsin(0.02), abs=2e-4)


@pytest.mark.parametrize("moving", [{}, {"speed_knots": 12.0, "pulse_ms": 1.0, "pitch_deg": 2.0, "pitch_period": 4.0}])
def test_halves_receive_a_target_on_the_axis_as_the_whole_face_does(monkeypatch, moving):
    """Patterns of quadrants and of the face are 1 on the axis, and differ by 0.002 where it moves to meanwhile."""
    caught, measured = [], CalibratedSounder.measured
    monkeypatch.setattr(CalibratedSounder, "measured", lambda sounder, whole, halves: caught.append(
        [whole, *np.concatenate(halves)]) or measured(sounder, whole, halves))
    mitsonar.render(sounder({"seabed": buried_bed(80.0), "ball": point_target([0, 0, -32.0], -40.0)}, sensor=moving))
    whole, *halves = np.array(caught[0])
    peak = np.argmax(np.abs(whole))
    assert len(halves) == 4
    np.testing.assert_allclose(np.abs([half[peak] for half in halves]), np.abs(whole[peak]), rtol=0.01)


def test_a_target_is_passed_as_the_platform_moves_and_pitches():
    """3 m/s and pitch: half of the way out, from the place of the transmission, and half of the way back.

    Until the echo is back the sounder has gone 0.12 m, 0.23 degrees of the target's direction, and pitched 0.09 degrees
    more. The angle is that of the reception; at half power the beam of the transmission falls by 1.7 dB a degree.
    """
    ball = np.array([0.3, 6.0, -32.0])
    image = mitsonar.render(sounder(
        {"seabed": buried_bed(80.0), "ball": point_target(ball, -40.0)},
        sensor={"speed_knots": 5.8315, "pings": 25, "ping_rate_hz": 6.0, "pitch_deg": 1.0, "pitch_period": 4.0}))
    looked = 0
    for ping in range(image.sizes["ping"]):
        place = np.array([float(image[axis][ping]) for axis in "xyz"])
        out = np.linalg.norm(ball - place)
        back = np.linalg.norm(ball - place - [0, 3.0 * 2 * out / C, 0])
        found = peak(image, 0.5 * (out + back), ping)
        if not float(found["target_strength"]) > -46.0:
            continue
        assert float(found["range"]) == pytest.approx(0.5 * (out + back), abs=0.11)
        ahead = np.arctan2(ball[1] - place[1], place[2] - ball[2]) - float(image["pitch"][ping])
        assert float(found["angle_along"]) == pytest.approx(ahead, abs=6e-3)
        assert float(found["compensated_target_strength"]) == pytest.approx(-40.0, abs=0.6)
        looked += 1
    assert looked >= 6


def test_a_smooth_sphere_has_the_strength_of_its_radius():
    """20 log a / 2 of a rigid sphere of ka = 150; the echo is that of its nearest point."""
    ball = {"type": "sphere", "center": [0.5, 0.3, -32.0], "radius": 0.3, "bsdf": {"type": "rigid"}}
    found = peak(mitsonar.render(sounder({"seabed": buried_bed(80.0), "ball": ball})), 29.7)
    assert float(found["range"]) == pytest.approx(np.sqrt(30.0 ** 2 + 0.34) - 0.3, abs=0.06)
    assert float(found["compensated_target_strength"]) == pytest.approx(20 * np.log10(0.15), abs=0.3)
    assert float(found["angle_along"]) == pytest.approx(0.01, abs=2e-4)


def test_noise_scatters_angles_as_its_ratio_says():
    """Deviation √(2 / q) λ / (2π d) of halves d apart, q the power of echo over noise; 100 pings have it to 7 %."""
    scene = sounder({"seabed": buried_bed(80.0), "ball": point_target([0.0, 0.0, -32.0], -42.0)},
                    film={"range": 35.0, "bins": 1400}, sensor={"self_noise_db": 60.0, "pings": 100})
    image, quadrants = mitsonar.render(scene), scene.sensors()[0].quadrants.position
    at = int(np.argmin(np.abs(image["range"].values - 30.0)))
    ratio = 10 ** (0.1 * (222.0 - 42.0 - 40 * np.log10(30.0) - 2 * ALPHA * 30.0 - image.attrs["noise_db"]))
    assert 30 < ratio < 3000
    wanted = np.sqrt(2 / ratio) * C / 120e3 / (2 * np.pi * np.ptp(quadrants[:, 0]))
    for name in ("angle_along", "angle_athwart"):
        assert float(image[name][:, at].std()) == pytest.approx(wanted, rel=0.25)
        assert float(image[name][:, at].mean()) == pytest.approx(0.0, abs=0.4 * wanted)


def test_elements_are_the_quadrants_of_the_picture():
    """The mean of four signals is the face's: their beams differ by 0.1 dB within the main lobe."""
    scene = sounder({"seabed": buried_bed(80.0), "ball": point_target([0.4, 0.7, -32.0], -40.0)},
                    integrator={"cell": 2.0})
    signals = mitsonar.element_signals(scene)
    assert signals.sizes["rx"] == 4
    pulse = pulse_of(signals.attrs["pulse"])
    mean = matched_filter(signals.values[0, 0], pulse, signals.attrs["sampling_rate"]).mean(0)
    r = 0.5 * C * signals["time"].values
    strength = 20 * np.log10(np.abs(mean) + 1e-9) + 40 * np.log10(np.maximum(r, 1)) + 2 * ALPHA * r - 222.0
    wanted = float(peak(mitsonar.render(scene), 30.0)["target_strength"])
    assert strength[np.abs(r - 30.0) < 1.0].max() == pytest.approx(wanted, abs=0.2)


# ---- the beam, the water, noise

@every_preset
def test_the_equivalent_beam_angle_is_that_of_a_disc_and_of_transducers(preset):
    """5.78 / (ka)² holds for narrow beams: to 0.1 dB at 12 degrees, to 0.3 dB at 28."""
    image = mitsonar.render(sounder({"seabed": bed(52.0)}, preset=preset, film={"bins": 60}))
    half = np.sin(np.deg2rad(presets("echo_sounder")[preset]["beam_width_deg"]) / 2)
    psi = image.attrs["equivalent_beam_angle_db"]
    assert psi == pytest.approx(10 * np.log10(5.78 * (half / 1.61634) ** 2), abs=0.3 if half > 0.15 else 0.1)
    if preset in PUBLISHED:
        assert psi == pytest.approx(PUBLISHED[preset], abs=0.2)


@pytest.mark.parametrize("preset, face", [("scientific_120khz", "circular"), ("scientific_38khz", "square"),
                                          ("navigation_200khz", "circular")])
def test_even_water_has_its_volume_strength(preset, face):
    """200 pings of 15 m or more, 20 independent pulses at least in each: to 0.07 dB."""
    image = mitsonar.render(sounder({"seabed": buried_bed(90.0, size=300.0)}, preset=preset, film={"bins": 60},
                                    sensor={"pings": 200, "face": face}, water={"volume_strength_db": -72.0},
                                    integrator={"rays": 1000}))
    power = 10 ** (0.1 * image["volume_strength"])
    for first in (10, 25, 40):
        mean = power.sel(range=slice(first, first + 15)).mean()
        assert 10 * np.log10(float(mean)) == pytest.approx(-72.0, abs=0.2)


@pytest.mark.parametrize("noise", [{"noise": True, "noise_level_db": 60.0}, {"self_noise_db": 45.0}])
def test_noise_has_its_level(noise):
    """6000 bins of a pulse each: to 0.15 dB."""
    image = mitsonar.render(sounder({"seabed": buried_bed(80.0)}, sensor={**noise, "pings": 60}, film={"bins": 100}))
    power = 10 ** (0.1 * image["level"].sel(range=slice(5, 60)))
    assert 10 * np.log10(float(power.mean())) == pytest.approx(image.attrs["noise_db"], abs=0.2)


# ---- the bed

@functools.cache
def level_bed(preset):
    """Fifty pings over a level bed 40 m below, 12 m apart."""
    return mitsonar.render(sounder({"seabed": bed(42.0, size=1600.0)}, preset=preset, film={"range": 70.0, "bins": 700},
                                   sensor={"pings": 50, "speed_knots": 23.3, "ping_rate_hz": 1.0}))


@every_preset
def test_the_depth_is_that_of_a_level_bed(preset):
    """Within the echo of the bed in half the beam, H (1/cos - 1), and 0.3 c T / 2 of a pulse that is shorter."""
    own = presets("echo_sounder")[preset]
    error = level_bed(preset)["measured_depth"].values - 42.0
    long = 40.0 * (1 / np.cos(np.deg2rad(own["beam_width_deg"]) / 2) - 1)
    assert np.isfinite(error).all()
    assert -0.05 < error.mean() < long + 0.15 * C * own["pulse_ms"] / 1000 and error.std() < 0.08 + 0.1 * long


@every_preset
def test_a_level_bed_has_the_energy_of_the_sonar_equation(preset):
    """The mean level to 0.25 dB, as speckle leaves it to 1.5 dB: 50 pings of one cell or more."""
    image, own = level_bed(preset), presets("echo_sounder")[preset]
    theta = np.linspace(1e-4, 0.6, 4000)
    x = 1.61634 * np.sin(theta) / np.sin(np.deg2rad(own["beam_width_deg"]) / 2)
    r = 40.0 / np.cos(theta)
    near = r < 47.0
    integrand = ((2 * j1(x) / x) ** 4 * 10 ** -2.7 * np.cos(theta) ** 2 * 10 ** (-0.2 * ALPHA * r) / r ** 4
                 * 2 * np.pi * 40.0 ** 2 * np.tan(theta) / np.cos(theta) ** 2)
    rate = 24 * pulse_of(image.attrs["pulse"]).bandwidth
    length = compression(pulse_of(image.attrs["pulse"]), rate)[0]
    wanted = own["source_level_db"] + 10 * np.log10(length * np.sum(integrand[near]) * (theta[1] - theta[0]))
    step = float(image["time"][1] - image["time"][0])
    for name, within in (("mean_level", 0.25), ("level", 1.5)):
        energy = (10 ** (0.1 * image[name].sel(range=slice(37, 47)))).sum("range").mean() * step
        assert 10 * np.log10(float(energy)) == pytest.approx(wanted, abs=within)


def test_the_bed_is_searched_for_in_the_gate_and_may_not_be_found():
    shapes = {"seabed": bed(42.0), "ball": point_target([0.0, 0.0, -22.0], 20.0)}
    assert float(mitsonar.render(sounder(shapes))["measured_depth"][0]) == pytest.approx(22.0, abs=0.2)
    gated = mitsonar.render(sounder(shapes, sensor={"depth_gate": "30, 50"}))
    assert float(gated["measured_depth"][0]) == pytest.approx(42.0, abs=0.2)
    assert np.isnan(mitsonar.render(sounder(shapes, sensor={"depth_gate": "45, 50"}))["measured_depth"][0])


# ---- objects and bounces

@functools.cache
def boxed():
    """Thirty pings over a box 6 m long and 4 m high on the bed, which hides the bed below it."""
    mitsonar.scene.loading.prepare()
    import mitsuba as mi

    place = mi.ScalarTransform4f().translate([0, 10.0, -40.0]).scale([4.0, 3.0, 4.0])
    return mitsonar.render(sounder(
        {"seabed": bed(42.0, size=400.0), "box": {"type": "cube", "to_world": place, "bsdf": lambert(-15.0)}},
        sensor={"pings": 30, "speed_knots": 5.8315, "ping_rate_hz": 4.5, "beam_width_deg": 5.0, "pulse_ms": 0.1},
        film={"range": 50.0, "bins": 500}))


def test_a_box_stands_above_the_bed_and_hides_it():
    """Its top is 34 m below, the bed 40 m: over its middle there is no bed, beside it no box."""
    image = boxed()
    number = next(int(label) for label, name in image.attrs["labels"].items() if name == "box")
    y = image["y"].values
    over, beside = np.flatnonzero(np.abs(y - 10) < 0.5), np.flatnonzero(y < 3)
    label, dark = image["label"], image["object_shadow"]
    for ping in over:
        top = image["range"].values[label[ping].values == number]
        assert top.min() == pytest.approx(34.0, abs=0.15)
        assert float(image["measured_depth"][ping]) == pytest.approx(36.0, abs=0.15)
        # from 40.2 m on, side lobes see the bed beside the box
        assert (dark[ping].sel(range=slice(40.0, 40.2)) == number).all()
        assert float(image["hidden"][ping].sel(range=slice(40.0, 40.2)).min()) > 0.9
    for ping in beside:
        assert not (dark[ping] == number).any()
        assert float(image["measured_depth"][ping]) == pytest.approx(42.0, abs=0.2)
    assert float(image["seabed_depth"][beside].sel(range=slice(40.0, 40.4)).mean()) == pytest.approx(42.0, abs=0.01)
    assert image.attrs["unseen"] == []


def test_its_records_are_written_labelled_and_drawn(tmp_path):
    image = boxed()
    mitsonar.write(image, tmp_path / "echogram.exr")
    xr_same = mitsonar.read(tmp_path / "echogram.exr")
    assert set(xr_same.data_vars) == set(image.data_vars)
    for name in image.data_vars:
        np.testing.assert_array_equal(xr_same[name].values, image[name].values)
    box, = object_bins(xr_same)
    assert box.name == "box" and box.highlight.any() and box.shadow.any()
    for what in ("waterfall", "objects", "labels", "depth", "ping", "mean", "shadow", "rays"):
        plots.plot(xr_same, what, tmp_path / f"{what}.png")


def test_the_second_echo_of_the_bed_comes_by_way_of_the_surface():
    """Bed, surface, bed: 2 H + 2 d for a sounder d deep; without bounces there is nothing but the lobes' echo."""
    shapes = {"seabed": bed(22.0, lambert(-15.0), size=400.0), "surface": {"type": "sea_surface", "size": 400.0}}
    film, sensor = {"range": 50.0, "bins": 250}, {"pings": 5, "speed_knots": 20.0, "ping_rate_hz": 1.0}
    once, more = (mitsonar.render(sounder(shapes, film=film, sensor=sensor, integrator={"max_depth": depth}))
                  for depth in (1, 3))
    second = {"range": slice(41.5, 43.5)}
    gain = [float((10 ** (0.1 * image["level"].sel(second))).mean()) for image in (once, more)]
    assert gain[1] > 100 * gain[0]


@pytest.mark.parametrize("written, words", [
    ({"beam_width_deg": 80.0, "face": "square"}, "quadrants of a face of 80 degrees lie"),
    ({"bandwidth_khz": 5.0}, "a cw pulse has the bandwidth of its length"),
    ({"depth_gate": "5, 2"}, "depth_gate is 5 to 2"), ({"pulse_window": "hat"}, "hat"),
    ({"preset": "scientific"}, "scientific_120khz")])
def test_bad_attributes_are_refused_by_name(written, words):
    with pytest.raises(ValueError, match=words):
        try:
            sounder({"seabed": bed(42.0)}, sensor=written)
        except RuntimeError as error:
            raise as_exception(error) from error
