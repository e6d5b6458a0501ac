"""Truth of a fan of beams against geometry: a box ahead on a level bed, uniform water, a line of elements at the bow.

The sonar is H above the bed; the box is h high, its face at y0 ahead, its back at y1, from -w to w athwart. In the beam
straight ahead, at slant range R

    highlight    hypot(y0, H - h) .. hypot(y1, H - h)
    shadow       hypot(y1, H - h) .. hypot(y1 H / (H - h), H)

Across, the face reaches to arcsin(w / R) on either side. Edges are those of the picture: off by two samples for the
pulse, which is 1.3 samples wide; a shadow begins a sample later still, when the top, 12 dB brighter than the bed, has
died away, and across the box names bins as far as its beams are not 12 dB down: about a width of the unshaded beam.
"""
import mitsuba as mi
import numpy as np
import pytest
from track_files import write_track

import mitsonar.scene.loading  # tells Dr.Jit its libraries before Mitsuba is imported
from mitsonar.imaging.fan import fan_directions
from mitsonar.survey.energy.sound_paths import SoundPaths
from mitsonar.survey.fan.beams import Beams
from mitsonar.survey.motion.places import Places
from mitsonar.validation.scenes import array_sonar, bed, lambert, point_target

H, HEIGHT, NEAR, FAR, HALF = 6.0, 1.2, 16.0, 18.0, 2.0
BEAM = np.deg2rad(0.886 * 2 / 48 * 180 / np.pi)            # width of 48 elements half a wavelength apart
SONAR = {"receive": "line", "receive_elements": 48, "receive_normal": "forward", "receive_baffle": "hard",
         "receive_shading": "chebwin 50", "frequency_khz": 200.0, "beams": 91, "fan_deg": 90.0,
         "pulse_ms": 1.0, "bandwidth_khz": 20.0, "start": [0.0, 0.0, -20.0 + H]}


@pytest.fixture(scope="module")
def image():
    mitsonar.scene.loading.prepare()
    to_world = mi.ScalarTransform4f().translate([0, 0.5 * (NEAR + FAR), -20 + HEIGHT / 2])
    box = {"type": "cube", "id": "box.1", "bsdf": {"type": "lambert", "mu_db": -15.0},
           "to_world": to_world.scale([HALF, 0.5 * (FAR - NEAR), HEIGHT / 2])}
    made = array_sonar({"seabed": bed(20, size=120), "box": box}, sensor=SONAR, film={"range": 28.0},
                       integrator={"cell": 0.15})
    return mitsonar.render(made, seed=1)


def _span(image, flags):
    """Slant ranges from where to where `flags` (bins,) hold, without gaps."""
    found = np.flatnonzero(flags)
    assert len(found) == found[-1] - found[0] + 1, "there are gaps"
    return image["range"].values[[found[0], found[-1]]]


def test_highlight_and_shadow_lie_where_geometry_puts_them(image):
    ahead = image.isel(ping=0, beam=45)
    edges = 2 * image.attrs["bin_width"]
    box, top = 1, (np.hypot(NEAR, H - HEIGHT), np.hypot(FAR, H - HEIGHT))
    end = np.hypot(FAR * H / (H - HEIGHT), H)
    assert image.attrs["labels"][str(box)] == "box.1"
    np.testing.assert_allclose(_span(image, ahead["label"] == box), top, atol=edges)
    np.testing.assert_allclose(_span(image, ahead["object_shadow"] == box), (top[1], end), atol=1.5 * edges)
    assert not ahead["shadow"].values[ahead["range"].values < top[0]].any()
    bins = np.flatnonzero((ahead["range"] > np.hypot(NEAR, H - HEIGHT) + edges) & (ahead["range"] < np.hypot(NEAR, H)
                                                                                   - 2 * edges))
    assert (ahead["layover"].values[bins] >= 2).all()
    assert (image["layover"].values[0, :, ahead["range"].values < top[0] - edges] <= 1).mean() > 0.999


def test_the_box_is_as_wide_as_it_is(image):
    """The beams that its face fills, about straight ahead: to arcsin(w / R), give or take a beam."""
    bin = int(np.argmin(np.abs(image["range"].values - 0.5 * (np.hypot(NEAR, H) + np.hypot(FAR, H - HEIGHT)))))
    seen = np.flatnonzero(image["label"].values[0, :, bin] == 1)
    reach = np.arcsin(HALF / image["range"].values[bin])
    angle = image["beam"].values[[seen[0], seen[-1]]]
    np.testing.assert_allclose(angle, [-reach, reach], atol=BEAM)


def test_bright_in_the_picture_is_labelled_and_dark_is_shadow(image):
    """The picture itself: the box's bins are brighter than the bed around, its shadow's at least 10 dB darker."""
    level = image["level"].values
    median = {name: np.median(level[flags]) for name, flags in
              (("box", image["share"].sel(shape="box.1").values > 0.9), ("shadow", image["object_shadow"].values == 1),
               ("bed", (image["share"].sel(shape="seabed").values > 0.99) & (image["range"].values > NEAR)))}
    assert median["box"] > median["bed"] + 6
    assert median["shadow"] < median["bed"] - 10


def test_the_seabed_of_a_bin_is_where_beam_and_range_meet_it(image):
    """x = R sin ψ, y = √(R² - H² - x²), within the beam's spacing and the sample."""
    angle, slant = np.meshgrid(image["beam"].values, image["range"].values, indexing="ij")
    x = slant * np.sin(angle)
    y = np.sqrt(np.maximum(slant**2 - H**2 - x**2, 0))
    seen = np.isfinite(image["seabed_x"].values[0]) & (y > 2)
    assert seen.mean() > 0.6
    step = np.deg2rad(1.0)
    assert np.abs(image["seabed_x"].values[0] - x)[seen].max() < 0.5 * step * slant.max() + 0.05
    assert np.median(np.abs(image["seabed_y"].values[0] - y)[seen]) < 0.05
    np.testing.assert_allclose(image["seabed_depth"].values[0][seen], 20, atol=1e-3)


def test_shares_add_to_one(image):
    total = image["share"].sum("shape").values
    assert np.abs(total[total > 0] - 1).max() < 1e-5


def test_a_point_target_has_the_share_of_its_bin():
    """-5 dB re 1 m² over a bed of a few hundredths of a square metre a bin at -27 dB and less."""
    made = array_sonar({"seabed": bed(20, size=200.0), "point": point_target([0.0, 12.0, -17.0], -5.0)}, sensor=SONAR,
                       film={"range": 20.0}, integrator={"cell": 0.3})
    image = mitsonar.render(made)
    bin = int(np.argmin(np.abs(image["range"].values - np.hypot(12.0, 3.0))))
    share = image["share"].sel(shape="point").values[0]
    assert share[45, bin] > 0.9
    assert share[10].max() < 0.1


def test_a_single_beam_hears_what_it_looks_at():
    """One beam of 48 elements straight ahead, a box 30 degrees off it."""
    to_world = mi.ScalarTransform4f().translate([9, 15.6, -19.4]).scale([1, 1, 0.6])
    box = {"type": "cube", "id": "box.1", "bsdf": {"type": "lambert", "mu_db": -15.0}, "to_world": to_world}
    image = mitsonar.render(array_sonar({"seabed": bed(20, size=120), "box": box}, sensor={**SONAR, "beams": 1},
                                        film={"range": 24.0}, integrator={"cell": 0.3}))
    assert image["share"].sel(shape="box.1").values.max() < 0.02
    assert not (image["label"] == 1).any()


def test_a_level_bed_has_no_shadows_however_many_the_bins(monkeypatch):
    """Rays go out in passes of what fits into memory, as many as the bins need."""
    monkeypatch.setattr("mitsonar.survey.fan.beams.MOST_RAYS", 100_000)
    monkeypatch.setattr("mitsonar.survey.fan.beams.FEWEST_RAYS", 100_000)
    image = mitsonar.render(array_sonar({"seabed": bed(20, size=120)}, sensor=SONAR, film={"range": 28.0},
                                        integrator={"cell": 0.5}))
    lit = image["range"].values > H + 1
    assert not image["shadow"].values.any()
    assert (image["label"].values[..., lit] == 1).mean() > 0.99


def test_pictures_that_do_not_fit_into_memory_are_refused_before_any_signal(monkeypatch):
    made = array_sonar({"seabed": bed(20, size=200.0)}, sensor={**SONAR, "pings": 1000}, film={"range": 20.0})
    monkeypatch.setattr("mitsonar.survey.limits.memory", lambda: 4e9)
    monkeypatch.setattr("mitsonar.survey.beam_domain.fan_pictures.received_signals",
                        lambda *_, **__: pytest.fail("signals made"))
    monkeypatch.setattr("mitsonar.survey.beam_domain.fan_pictures.Frames",
                        lambda *_, **__: pytest.fail("frames were made"))
    with pytest.raises(ValueError, match="1000 pings .* take fewer pings"):
        mitsonar.render(made)


def test_points_are_told_apart():
    """Two points a metre apart in range have each its own bins; a third, behind a wall, has none."""
    T = mi.ScalarTransform4f
    wall = {"type": "rectangle", "bsdf": {"type": "lambert", "mu_db": -60.0},
            "to_world": T().translate([5.0, 8.0, -16]).rotate([1, 0, 0], 90).scale([1.5, 6, 1])}
    points = {"a": [0.0, 12.0, -17.0], "hidden": [7.0, 11.5, -17.0], "z": [0.0, 13.0, -17.0]}
    made = array_sonar({"seabed": bed(20, lambert(-60), size=200.0), "wall": wall,
                        **{name: point_target(place, -5.0) for name, place in points.items()}},
                       sensor=SONAR, film={"range": 20.0}, integrator={"cell": 0.3})
    image = mitsonar.render(made)
    for name in ("a", "z"):
        bin = int(np.argmin(np.abs(image["range"].values - np.linalg.norm(np.array(points[name]) - [0, 0, -20 + H]))))
        assert image["share"].sel(shape=name).values[0, 45, bin] > 0.99
    assert not image["share"].sel(shape="hidden").values.any()


def test_what_has_a_phase_adds_as_pressure_whatever_its_blocks(monkeypatch):
    """A smooth body may come in several blocks. The same echo twice is twice the pressure: four times the power."""
    made = array_sonar({"seabed": bed(20, size=200.0), "point": point_target([0.0, 12.0, -17.0])}, sensor=SONAR,
                       film={"range": 20.0}, integrator={"cell": 0.3})
    survey = made.integrator().array_survey(made, made.sensors()[0])
    beams, sound = Beams(survey, *fan_directions(survey.receive, 91, np.pi / 2)), SoundPaths.of(survey, 30.0)
    place = Places(survey, sound.tracer, beams.underway, beams.per_ping).of(np.array([0]))
    source = beams.coherent(sound)
    once, blocks = source.sum(place).label_power, source._phased.of
    monkeypatch.setattr(source._phased, "of", lambda *place: [*blocks(*place), *blocks(*place)])
    assert once.max() > 0
    np.testing.assert_allclose(source.sum(place).label_power, 4 * once, rtol=1e-6)


@pytest.mark.filterwarnings("ignore:the track is cut")
def test_truth_lies_where_a_fast_and_turning_array_hears_the_echo(tmp_path):
    """10 m/s and 40 degrees a second: within 37 ms a target drifts by 1.5 beams, its echo is 0.18 m, 10 bins, early.

    A pulse this short has little coupling of range and Doppler, T f_D / B: 0.03 m.
    """
    rate, speed = np.deg2rad(40), 10.0
    time = np.arange(0, 1.01, 0.05)
    heading = rate * time
    track = np.column_stack([time, speed / rate * (1 - np.cos(heading)), speed / rate * np.sin(heading), 0 * time - 14,
                             0 * time, 0 * time, np.rad2deg(heading)])
    moving = {key: value for key, value in SONAR.items() if key != "start"}
    moving |= {"track": write_track(tmp_path / "turn.csv", track), "pings": 1, "pulse_ms": 0.25}
    shapes = {"seabed": bed(20, lambert(-60.0), size=120), "buoy": point_target([1.0, 27.5, -15.0])}
    scene = array_sonar(shapes, sensor=moving, film={"range": 32.0}, integrator={"cell": 0.6})
    image = mitsonar.render(scene).isel(ping=0)
    beam, bin = np.unravel_index(np.nanargmax(image["level"].values), image["level"].shape)
    known = np.argwhere(image["share"].sel(shape="buoy").values > 0.5).mean(0)        # its main lobe, alike both sides
    assert known == pytest.approx([beam, bin], abs=2.0)
    # at rest: 2.1 degrees, one a beam about beam 45
    away = np.hypot(1.0, 27.5)
    assert 45 + np.rad2deg(np.arctan2(1.0, 27.5)) - known[0] > 1
    assert np.interp(away, image["range"], np.arange(image.sizes["range"])) - known[1] > 7
