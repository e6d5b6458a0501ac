"""What fills a sidescan's shadows: diffuse side lobes, the other side, noise; and the faces that a scene may build.

The shadow is that of a long box on one side. The other side has an open bed. Closed form of the bed that diffuse side
lobes f of either way see at a slant range, relative to that of the main lobe: the ring of bed around the sonar, on one
side ∫ f² dψ = π f², over the main lobe's Φ = ∫ b⁴ dψ; the box hides its share of the ring.
"""
import mitsuba as mi
import numpy as np
import pytest

import mitsonar
import mitsonar.scene.loading
from mitsonar.survey.sidescan.kind import sonar_at
from mitsonar.validation.scenes import bed, lambert, sidescan

ALTITUDE, BOX = 20.0, (40.0, 3.0)          # ground range of the box's front and its height
OMNI = {"vertical_beam_width_deg": 180.0}


def boxed_scene(sensor=None, *, length, rays=100_000, bins=350):
    """A box to starboard over a flat bed."""
    mitsonar.scene.loading.prepare()
    x, height = BOX
    T = mi.ScalarTransform4f
    to_world = T().translate([x + 0.5, 0, -40 + height / 2]).scale([0.5, length / 2, height / 2])
    return sidescan({"bed": bed(40.0, size=800.0), "box": {"type": "cube", "to_world": to_world,
                                                           "bsdf": lambert(-20.0)}},
                    sensor={**OMNI, **(sensor or {})}, rays=rays, film={"range": 70.0, "bins": bins})


def boxed(sensor=None, length=400.0, rays=200_000):
    """Levels [dB] of a box's shadow under the bed of the other side at the same ranges."""
    scene = boxed_scene(sensor, length=length, rays=rays)
    dataset = mitsonar.render(scene)
    inside = (dataset["range"].values > 48.5) & (dataset["range"].values < 50.0)
    assert (dataset["shadow"].values[:, 1, inside] == 1).all() and not dataset["label"].values[:, 1, inside].any()
    name = "level" if scene.sensors()[0].noise else "mean_level"
    port, starboard = np.moveaxis(10 ** (dataset[name].values[..., inside].astype(float) / 10), 1, 0)
    return 10 * np.log10(starboard.mean() / port.mean()), scene, dataset


def test_diffuse_side_lobes_fill_a_shadow_by_the_ring_of_bed_that_they_see():
    """A box 10 m long hides atan(5/41)/(π/2) of the ring of its side, at most; the rest is f² against the beam."""
    floor = 10 ** -2.0
    depth, scene, _ = boxed({"sidelobe_db": -20.0}, length=10.0)
    sonar = sonar_at(scene.sensors()[0], 20.0)
    azimuth = np.linspace(0, 1, 20001) ** 3 * np.pi / 2
    cosine = np.sqrt(1 - (ALTITUDE / 49.25) ** 2)
    pattern = sonar.along_intensity(cosine * np.sin(azimuth))
    whole = np.trapezoid(pattern, azimuth)
    open_bed = np.trapezoid(np.where(np.tan(azimuth) > 5.0 / 41.0, pattern, 0), azimuth)
    assert depth == pytest.approx(10 * np.log10(open_bed / whole), abs=0.7)
    assert 10 * np.log10(floor ** 2 * np.pi / 2 / whole) == pytest.approx(depth, abs=1.5)


def test_the_other_side_fills_a_shadow_by_what_leaks():
    assert boxed({"back_db": -15.0})[0] == pytest.approx(-15, abs=0.3)
    assert boxed({"crosstalk_db": -18.0})[0] == pytest.approx(-18, abs=0.3)


def test_a_shadow_without_flaws_is_far_deeper():
    assert boxed(length=60.0)[0] < -30


def test_the_receivers_noise_is_in_the_level_and_fainter_by_the_compression():
    found = {}
    for chirp_ms in (0.0, 10.0):
        _, scene, dataset = boxed({"noise": True, "noise_level_db": -100.0, "self_noise_db": 60.0,
                                   "chirp_ms": chirp_ms}, rays=20_000)
        found[chirp_ms] = dataset.attrs["noise_db"]
        assert dataset["level"].values[:, :, 20:80].mean() == pytest.approx(found[chirp_ms], abs=0.1)
    assert found[0.0] == pytest.approx(60 + 40, abs=1e-3)              # 10 kHz of band
    assert found[0.0] - found[10.0] == pytest.approx(20, abs=1e-9)


def test_the_presets_noise_belongs_to_scenes_with_noise():
    def self_noise_db(**sensor):
        return sidescan({"bed": bed(40.0)}, sensor=sensor).sensors()[0].self_noise_db
    assert self_noise_db() is None
    assert self_noise_db(self_noise_db=33.0) == 33


def test_a_measured_pattern_takes_the_place_of_the_widths(tmp_path):
    path = tmp_path / "vertical.csv"
    path.write_text("angle_deg, level_db\n-90, -30\n-20, -3.0103\n0, 0\n20, -3.0103\n90, -12\n")
    sensor = sidescan({"bed": bed(40.0)}, sensor={"vertical_pattern": str(path)}).sensors()[0]
    sonar = sonar_at(sensor, 20.0)
    for face in (sonar.transmit, sonar.receive):
        level = 20 * np.log10(face.across(np.sin(np.radians([-90, -20, 0, 20, 90])), sonar.wavelength))
        assert level == pytest.approx([-30, -3.0103, 0, -3.0103, -12], abs=0.05)


def test_a_measured_beam_of_a_sinc_gives_the_levels_of_the_sinc(tmp_path):
    """2 degrees wide, sampled every 0.05 degrees and down to -40 dB: within 0.05 dB of the closed form's levels."""
    path = tmp_path / "along.csv"
    angle = np.arange(-30, 30.01, 0.05)
    level = np.maximum(20 * np.log10(np.abs(np.sinc(0.44294647 * np.sin(np.radians(angle)) / np.sin(np.radians(1))))
                                     + 1e-9), -60)
    path.write_text("angle_deg,level_db\n" + "".join(f"{a:.4f},{b:.4f}\n" for a, b in zip(angle, level, strict=True)))
    levels = []
    for face in ({"pattern": str(path)}, {"beam_width_deg": 2.0}):
        scene = sidescan({"bed": bed(40.0)}, sensor={**OMNI, "pings": 8, **face}, rays=100_000, film={"bins": 200})
        levels.append(10 ** (mitsonar.render(scene)["mean_level"].values[:, :, 60:180].astype(float) / 10))
    ratio = 10 * np.log10(levels[0].mean() / levels[1].mean())
    assert ratio == pytest.approx(0, abs=0.05)


@pytest.mark.parametrize("sensor, words", [
    ({"shading": "hanning"}, 'window is "hanning"'),
    ({"sidelobe_db": 0.0}, "sidelobe_db is the float 0.0; expected a number [dB] at least -200 and at most -3"),
    ({"back_db": 1.0}, "at most 0"), ({"adc_bits": 33}, "at most 24"), ({"vertical_sag": 3.0}, "at most 2"),
    ({"pattern": "none.csv"}, 'pattern names the file "none.csv", which is not there')])
def test_flaws_that_are_none_are_refused(sensor, words):
    with pytest.raises((RuntimeError, ValueError)) as caught:
        sidescan({"bed": bed(40.0)}, sensor=sensor)
    assert words in str(caught.value)


@pytest.mark.parametrize("text, words", [
    ("angle_deg,level_db\n0,0\n95,-3\n", "line 3: the angle is 95"), ("angle_deg,level_db\n0,0\n0,-3\n", "there twice"),
    ("angle,level_db\n0,0\n", "no column angle_deg"), ("angle_deg,level_db\n0,0\n", "one angle makes no pattern")])
def test_files_that_hold_no_pattern_are_refused(tmp_path, text, words):
    path = tmp_path / "pattern.csv"
    path.write_text(text)
    with pytest.raises((RuntimeError, ValueError)) as caught:
        sidescan({"bed": bed(40.0)}, sensor={"pattern": str(path)})
    assert words in str(caught.value)


def test_a_measured_beam_and_a_width_contradict_each_other(tmp_path):
    path = tmp_path / "pattern.csv"
    path.write_text("angle_deg,level_db\n-5,-30\n0,0\n5,-30\n")
    with pytest.raises((RuntimeError, ValueError), match="pattern and beam_width_deg are both given"):
        sidescan({"bed": bed(40.0)}, sensor={"pattern": str(path), "beam_width_deg": 1.0})


def test_a_shaded_face_keeps_its_beam_width():
    scene = sidescan({"bed": bed(40.0)}, sensor={"shading": "hamming", "beam_width_deg": 2.0})
    sonar = sonar_at(scene.sensors()[0], 20.0)
    assert sonar.transmit.along(np.sin(np.radians(1.0)), sonar.wavelength) ** 2 == pytest.approx(0.5, abs=2e-3)
    assert sonar.transmit.length > 1.2 * 0.44294647 * sonar.wavelength / np.sin(np.radians(1.0))


@pytest.mark.parametrize("bins", [350, 2000])
def test_a_shadow_has_the_speckle_of_the_other_side_that_leaks_into_it(bins):
    """Bins longer and shorter than the pulse: the same scatterers are heard on both sides."""
    scene = boxed_scene({"back_db": -10.0, "speckle": True, "pings": 40}, length=60.0, bins=bins)
    dataset = mitsonar.render(scene)
    inside = (dataset["range"].values > 48.5) & (dataset["range"].values < 50.0)
    port, starboard = np.moveaxis(10 ** (dataset["level"].values[..., inside].astype(float) / 20), 1, 0)
    assert np.corrcoef(port.ravel(), starboard.ravel())[0, 1] > 0.9
    assert 10 * np.log10((starboard ** 2).mean() / (port ** 2).mean()) == pytest.approx(-10, abs=0.5)
