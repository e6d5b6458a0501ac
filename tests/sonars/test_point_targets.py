"""A point target in a sidescan's record: RL = SL - 2 TL + TS + 10 log B, in its bin, on its side, with its label.

Closed form in water of one speed, to 0.01 dB (energies are float32 until they are summed).
"""
import numpy as np
import pytest

import mitsonar
from mitsonar.survey.sidescan.kind import sonar_at
from mitsonar.validation.scenes import array_sonar, bed, buried_bed, point_target, sidescan


@pytest.mark.parametrize("where", [(30.0, 0.0, -30.0), (-41.0, 0.4, -25.0)])
def test_level_side_and_label_of_a_point_target(variant, where):
    scene = sidescan({"bed": buried_bed(40.0, size=800.0), "ball": point_target(where, -12.0)})
    image = mitsonar.render(scene)
    sonar = sonar_at(scene.sensors()[0], 20.0)
    offset = np.array(where) - [0, 0, -20]
    distance = np.linalg.norm(offset)
    level = image["mean_level"].values[0]
    side, bin = np.unravel_index(np.argmax(level), level.shape)
    assert side == (where[0] > 0)                                          # heading north: starboard is east
    assert abs(image["range"].values[bin] - distance) <= image.attrs["bin_width"]
    u, down = offset[1] / distance, -offset[2] / distance
    v = down * np.cos(sonar.depression_angle) - abs(offset[0]) / distance * np.sin(sonar.depression_angle)
    # an object has the label where its main lobe meets the bin: the second one lies just beside it
    label = str(image["label"].values[0, side, bin])
    assert image.attrs["labels"].get(label) == ("ball" if sonar.along_intensity(u) > 0.25 else None)
    beam = sonar.along_intensity(u) * sonar.across_intensity(v)
    echo_db = 224 - 12 - 40 * np.log10(distance) - 0.030 * 2 * distance + 10 * np.log10(beam)
    # a bin holds the mean over its length of a pulse that is shorter
    per_bin = sonar.pulse_length / (2 * image.attrs["bin_width"] / sonar.sound_speed)
    total = 10 * np.log10(np.sum(10 ** (level[side].astype(float) / 10)))
    assert total == pytest.approx(echo_db + 10 * np.log10(per_bin), abs=0.01)


def test_a_target_behind_a_wall_is_not_heard(variant):
    import mitsuba as mi

    T = mi.ScalarTransform4f
    wall = {"type": "cube", "to_world": T().translate([20, 0, -30]).scale([0.2, 5, 9])}
    shapes = {"bed": buried_bed(40.0, size=800.0), "ball": point_target([30.0, 0.0, -30.0], 30.0)}
    level = [mitsonar.render(sidescan({**shapes, **more}))["mean_level"].values for more in ({}, {"wall": wall})]
    assert level[0].max() > level[1][:, 1].max() + 30


@pytest.mark.parametrize("where", [(30.0, 0.0, -30.0), (-41.0, 0.4, -25.0)])
def test_element_signals_of_a_sidescan_have_the_level_of_its_picture(variant, where):
    """The faces as elements hear what the picture shows: |peak|² is the echo's level, on the same side.

    The cw envelope is as high as the echo once it is in whole; 1.5 dB are left to the band of the samples.
    """
    scene = sidescan({"bed": buried_bed(40.0, size=800.0), "ball": point_target(where, -12.0)},
                     integrator={"cell": 4.0})
    sonar = sonar_at(scene.sensors()[0], 20.0)
    signals = mitsonar.element_signals(scene)
    assert dict(signals.sizes) | {"sample": 0} == {"ping": 1, "tx": 1, "rx": 2, "sample": 0}
    offset = np.array(where) - [0, 0, -20]
    distance = np.linalg.norm(offset)
    u, down = offset[1] / distance, -offset[2] / distance
    v = down * np.cos(sonar.depression_angle) - abs(offset[0]) / distance * np.sin(sonar.depression_angle)
    beam = sonar.along_intensity(u) * sonar.across_intensity(v)
    echo_db = 224 - 12 - 40 * np.log10(distance) - 0.030 * 2 * distance + 10 * np.log10(beam)
    power = np.abs(signals.values[0, 0]) ** 2
    side, sample = np.unravel_index(np.argmax(power), power.shape)
    assert side == (where[0] > 0)
    assert 10 * np.log10(power[side, sample]) == pytest.approx(echo_db, abs=1.5)
    assert power[1 - side].max() < 1e-6 * power[side, sample]
    assert 750 * float(signals.time[sample]) == pytest.approx(distance, abs=1500 * 1e-4)


def test_a_point_target_hides_neither_bed_nor_targets(variant):
    """Rays pass it: what lies behind is as loud, and nowhere in a shadow, as if it were not there."""
    behind = {"seabed": bed(40.0), "ball": point_target([30.0, 0.0, -30.0])}
    behind["top"] = point_target([-150.0, 0.0, -23.8])                     # one depth range: the same rays
    # on the way to the one behind, and, as good as silent, a fence of them before the bed
    fence = {f"post{i}": point_target([12.0, 0.0, -23.8 - 0.019 * i], -190.0) for i in range(40)}
    alone, fenced = (mitsonar.render(sidescan({**behind, **more}, sensor={"pings": 1}, rays=20_000), 3)
                     for more in ({}, fence))
    reached = alone["mean_level"].values > 0
    np.testing.assert_allclose(fenced["mean_level"].values[reached], alone["mean_level"].values[reached], atol=1e-3)
    for name in ("hidden", "object_shadow"):
        np.testing.assert_array_equal(fenced[name].values, alone[name].values)


def test_elements_hear_a_target_behind_another(variant):
    where = np.array([10.0, 0.0, -20.0]), np.array([20.0, 0.0, -30.0])
    both, one = (mitsonar.impulse_response(array_sonar({"bed": buried_bed(60.0), **{
        f"ball{i}": point_target(place, strength) for i, (place, strength) in enumerate(zip(where, strengths))}}))
        for strengths in ((-150.0, 0.0), (0.0, -150.0)))
    first, second = (np.abs(response.values.astype(complex).sum()) for response in (one, both))
    # spherical spreading there and back, absorption
    assert 20 * np.log10(first / second) == pytest.approx(
        40 * np.log10(2) + 0.030 * 2 * 10 * np.sqrt(2), abs=0.01)
