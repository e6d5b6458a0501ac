"""Three bounces of which one is off a rigid wall, by the path's place in them, against brute force with images.

A Lambert bed z = -20 m for -14 < x < 12 and a Lambert board x = -15 over it (-12 < z < 0) face a rigid wall x = 12.
Sonar at the origin, 10 m deep, omnidirectional. A leg by way of the wall is straight to the image of where it ends, at
24 - x:

    e² = Σ_p Σ_q (sin_p,in / l_0²) (μ_p sin_p,out sin_q,in / l_1²) (μ_q sin_q,out / l_2²) 10^(-α (l_0 + l_1 + l_2)/10)

over points p, q of bed and board. The wall may come first, last, or between, where three bounces without it add to
what is heard; each is heard once. The gate is 34 to 38 m of half the way. The record is a Monte-Carlo sum: 0.4 dB is
four standard errors.
"""
from itertools import product

import numpy as np
from scipy.stats import qmc

from mitsonar.survey.pressure.pressure import PressureRecord
from mitsonar.validation.scenes import array_sonar

EDGES = np.array([34.0, 38.0])
SOURCE = np.array([[0.0], [0.0], [-10.0]])
FACES = {"bed": (lambda u, v: (26 * u - 14, 120 * v - 60, 0 * u - 20), [0, 0, 1.0], 26 * 120, 0.1),
         "board": (lambda u, v: (0 * u - 15, 120 * v - 60, 12 * u - 12), [1.0, 0, 0], 12 * 120, 10 ** -0.5)}


def leg(start, end, mirrored):
    """Length of a way, and unit directions at its beginning and end."""
    sign = np.array([[-1.0], [1.0], [1.0]]) if mirrored else np.ones((3, 1))
    way = np.where(mirrored, [[24.0], [0.0], [0.0]], 0.0) + sign * end - start
    length = np.linalg.norm(way, axis=0)
    return length, way / length, sign * way / length


def expected(mirrored, points=1 << 17):
    """Energies in gates, of paths whose legs go by way of the wall or not; evenly spread points leave 0.03 dB."""
    drawn = qmc.Sobol(2 * (len(mirrored) - 1), seed=3).random(points).T.reshape(-1, 2, points)
    total = 0
    for faces in product(FACES.values(), repeat=len(mirrored) - 1):
        energy, length, before, strength, normal = 1 / points, 0, SOURCE, 1.0, None
        for face, by_wall, uv in zip((*faces, None), mirrored, (*drawn, None)):
            place = SOURCE if face is None else np.array(face[0](*uv))
            way, begin, end = leg(before, place, by_wall)
            length = length + way
            energy = energy / way ** 2
            if normal is not None:
                energy = energy * strength * np.maximum((begin * normal).sum(0), 0)
            if face is not None:
                normal, strength = np.array(face[1])[:, None], face[3]
                energy = energy * np.maximum(-(end * normal).sum(0), 0) * face[2]
            before = place
        total = total + np.histogram(length / 2, EDGES, weights=energy * 10 ** (-0.003 * length))[0]
    return total


def test_a_wall_that_mirrors_first_last_and_between(variant):
    import mitsuba as mi
    T = mi.ScalarTransform4f
    shapes = {"bed": {"type": "rectangle", "to_world": T().translate([-1, 0, -20]).scale([13, 60, 1]),
                      "bsdf": {"type": "lambert", "mu_db": -10.0}},
              "board": {"type": "rectangle", "to_world": T().translate([-15, 0, -6]).rotate([0, 1, 0], 90).scale(
                  [6, 60, 1]), "bsdf": {"type": "lambert", "mu_db": -5.0}},
              "wall": {"type": "rectangle", "to_world": T().translate([12, 0, -10]).rotate([0, 1, 0], -90).scale(
                  [10, 60, 1]), "bsdf": {"type": "rigid"}}}
    scene = array_sonar(shapes, film={"range": 40.0}, sensor={"frequency_khz": 10.0},
                        integrator={"max_depth": 3, "cell": 3.0, "rays": 200_000})
    survey = scene.integrator().array_survey(scene, scene.sensors()[0])
    ensonification = PressureRecord(survey).ensonification(0)
    found, keys = {True: 0, "last": 0, False: 0}, 12
    for key in range(keys):
        for echoes in ensonification.random_echoes(survey.track.position[0], survey.track.rotation()[0], 10.0, key):
            if echoes.path == "bbb":
                half = 0.75e3 * (echoes.arrival + echoes.back.travel_time).numpy()
                energy = echoes.energy.numpy().astype(float) / keys
                first, last = (abs(end.offset.x.numpy() - 12) < 1e-5 for end in (echoes.out, echoes.back))
                for name, some in ((True, first), ("last", last), (False, ~first & ~last)):
                    found[name] = found[name] + np.histogram(half[some], EDGES, weights=energy[some])[0]
    first, between = expected((True, False, False)), expected((False, True, False)) + expected((False,) * 4)
    np.testing.assert_allclose(found["last"], found[True], rtol=1e-5)
    assert np.abs(10 * np.log10(found[True] / first)).max() < 0.4
    assert np.abs(10 * np.log10(found[False] / between)).max() < 0.4
