"""Smooth targets and point targets in a sidescan's record: levels, phases that add, labels, paths.

RL = SL - 2 TL + TS + 10 log B in water of one speed; a bin holds the mean over its length of a pulse that is shorter,
so that all bins together hold pulse / bin of it. TS from closed forms of the far field, 0.3 dB as for element signals.
"""
import mitsuba as mi
import numpy as np
import pytest

import mitsonar
from mitsonar.imaging.sidescan import realisation
from mitsonar.scene.loading import prepare
from mitsonar.survey.sidescan.kind import sonar_at
from mitsonar.validation.scenes import bed, buried_bed, sidescan

RIGID, SILENT = {"type": "rigid"}, -190.0


def expected_db(scene, offset, strength_db):
    sonar, distance = sonar_at(scene.sensors()[0], 20.0), np.linalg.norm(offset)
    u, down = offset[1] / distance, -offset[2] / distance
    v = down * np.cos(sonar.depression_angle) - abs(offset[0]) / distance * np.sin(sonar.depression_angle)
    beam = sonar.along_intensity(u) * sonar.across_intensity(v)
    return 224 + strength_db - 40 * np.log10(distance) - 0.030 * 2 * distance + 10 * np.log10(beam)


def total_db(image, side):
    """Level of an echo from all bins of a ping."""
    share = image.attrs["pulse_length"] / (2 * image.attrs["bin_width"] / 1500.0)
    level = image["mean_level"].values[0, side].astype(float)
    return 10 * np.log10(np.sum(10 ** (level / 10)) / share)


def test_sphere(variant):
    a, offset = 0.4, np.array([40.0, 0.0, -10.0])
    away = offset / np.linalg.norm(offset)
    ball = {"type": "sphere", "center": list(offset + a * away + [0, 0, -20]), "radius": a, "bsdf": RIGID}
    scene = sidescan({"bed": buried_bed(60.0, size=800.0), "ball": ball})
    image = mitsonar.render(scene)
    near_db = 20 * np.log10(np.linalg.norm(offset) / (np.linalg.norm(offset) + a))
    assert total_db(image, 1) == pytest.approx(expected_db(scene, offset, 20 * np.log10(a / 2)) + near_db, abs=0.3)
    bin = int(image["mean_level"].values[0, 1].argmax())
    assert abs(image["range"].values[bin] - np.linalg.norm(offset)) <= image.attrs["bin_width"]
    assert image.attrs["labels"][str(image["label"].values[0, 1, bin])] == "ball"
    assert image["depth"].values[0, 1, bin] == pytest.approx(30.0, abs=0.1)
    # the far side of the sphere is silent: what is left there are side lobes
    assert image["mean_level"].values[0, 0].max() < image["mean_level"].values[0, 1].max() - 40


@pytest.mark.parametrize("apart, gain_db", [(0.0, 6.0206), (0.5, 6.0206), (0.25, None)])
def test_two_point_targets_add_as_pressures(variant, apart, gain_db):
    # at ranges that differ by so many wavelengths; a quarter is half a turn there and back; they are 5 µs apart, of the
    # pulse's 100 µs, so that a little is left at its ends
    wavelength = 1500.0 / 100e3
    targets = {f"buoy{i}": {"type": "point_target", "position": [float(40.02 + i * apart * wavelength), 0.0, -20.0],
                            "target_strength_db": -10.0} for i in range(2)}
    one = {"buoy0": targets["buoy0"]}
    level = [total_db(mitsonar.render(sidescan({"bed": buried_bed(60.0, size=800.0), **some})), 1)
             for some in (one, targets)]
    if gain_db is None:
        assert level[1] - level[0] < -10
    else:
        assert level[1] - level[0] == pytest.approx(gain_db, abs=0.02 if apart == 0 else 0.5)


def test_dihedral_is_a_path_of_two_bounces(variant):
    prepare()
    a, b, at = 0.2, 0.3, np.array([40.0, 0.0, -20.0])
    side = np.sqrt(0.5) * np.array([[-1, 1, 0], [-1, -1, 0]])
    shapes = {"bed": buried_bed(60.0, size=800.0)}
    for i in range(2):
        matrix = np.eye(4)
        matrix[:3, 0], matrix[:3, 1], matrix[:3, 2] = 0.5 * a * side[i], [0, 0, 0.5 * b], side[1 - i]
        matrix[:3, 3] = at + 0.5 * a * side[i]
        shapes[f"plate{i}"] = {"type": "rectangle", "to_world": mi.ScalarTransform4f(matrix), "bsdf": RIGID}
    scene = sidescan(shapes, rays=2000, integrator={"max_depth": 2})
    image = mitsonar.render(scene)
    # 40 m are less than the aperture of 0.3 m wants: 0.2 dB of near field
    assert total_db(image, 1) == pytest.approx(expected_db(scene, at + [0, 0, 20], 15.0515), abs=0.5)
    bin = int(image["mean_level"].values[0, 1].argmax())
    assert image["path_name"].values[image["path"].values[0, 1, bin] - 1] == "bb"


def test_amplitudes_are_those_of_rice(rng):
    """|z_c + z|² of a steady and a random part: mean P + I, variance I² + 2 P I; 4 standard errors of 10^5 draws."""
    count, power, random = 100_000, 4.0, 1.5
    coherent = np.full((count, 1), np.sqrt(power) * np.exp(0.7j))
    speckle = np.array([1, 1j]) @ rng.standard_normal((2, count)) * np.sqrt(0.5)
    got = realisation(np.full(count, random), np.array([1.0]), speckle, 0.0, rng, coherent, np.full(count, power))
    variance = random ** 2 + 2 * power * random
    assert got.mean() == pytest.approx(power + random, abs=4 * np.sqrt(variance / count))
    assert got.var() == pytest.approx(variance, rel=0.04)


def test_a_record_is_the_same_for_any_number_of_threads(variant):
    import drjit as dr

    ball = {"type": "sphere", "center": [30.0, 0.0, -30.0], "radius": 0.3, "bsdf": RIGID}
    threads, levels = dr.thread_count(), []
    try:
        for count in (2, 3):
            dr.set_thread_count(count)
            scene = sidescan({"bed": bed(40.0), "ball": ball}, sensor={"speckle": True}, rays=4000)
            levels.append(mitsonar.render(scene, seed=3)["level"].values)
    finally:
        dr.set_thread_count(threads)
    assert np.array_equal(*levels)
