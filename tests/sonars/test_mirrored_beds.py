"""A flat Lambert bed under a mirror, heard by an omnidirectional element: what it sends back along every way.

With d and f the distances to the bed's point from the sonar and from its image, h and H their heights over the bed,

    e² = ∫ μ (sin_out sin_back) / (A_out A_back) 10^(-α (L_out + L_back)/10) dA,    sin = h/d or H/f, A = d² or f²

in gates of (L_out + L_back)/2, for (d, d) "b", (d, f) and (f, d) "bs", (f, f) "sbs": no more and no less, whether
all cells are lit or those that rays find. Tolerance 0.02 dB with every cell, 0.1 dB with the sampling of 50 000 rays.
"""
import numpy as np
import pytest

from mitsonar.survey.pressure.pressure import PressureRecord
from mitsonar.validation.scenes import array_sonar, bed, lambert

GATES = np.array([22.0, 26.0, 30.0, 34.0, 38.0])
H_DIRECT, H_IMAGE, MU = 10.0, 30.0, 0.1


def expected():
    """Energies by path and gate."""
    r, step = np.linspace(1e-3, 95, 400_001, retstep=True)
    d, f = np.hypot(r, H_DIRECT), np.hypot(r, H_IMAGE)
    ways = {"b": [(d, H_DIRECT, d, H_DIRECT)], "bs": 2 * [(d, H_DIRECT, f, H_IMAGE)], "sbs": [(f, H_IMAGE, f, H_IMAGE)]}
    return {path: sum(np.histogram((a + b) / 2, GATES, weights=2 * np.pi * r * step * MU * (g * h) / (a * b) ** 3
                                   * 10 ** (-0.003 * (a + b)))[0] for a, g, b, h in both)
            for path, both in ways.items()}


@pytest.mark.parametrize("ensonification, tolerance", [("scatterers", 0.02), ("rays", 0.1)])
def test_a_bed_under_a_mirror_is_heard_once_along_each_way(variant, ensonification, tolerance):
    sea = {"type": "sea_surface", "wind_speed": 0.0, "size": 400.0}
    scene = array_sonar({"bed": bed(20.0, lambert(-10.0), size=200.0), "sea": sea}, film={"range": 42.0},
                        integrator={"max_depth": 3, "cell": 0.5, "rays": 50_000, "ensonification": ensonification})
    survey = scene.integrator().array_survey(scene, scene.sensors()[0])
    heard, ensonification = {}, PressureRecord(survey).ensonification(0)
    for echoes in ensonification.echoes(survey.track.position[0], survey.track.rotation()[0], 10.0, 0):
        half = 0.75e3 * (echoes.arrival + echoes.back.travel_time).numpy()
        found = np.histogram(half, GATES, weights=echoes.energy.numpy().astype(float))[0]
        heard[echoes.path] = heard.get(echoes.path, 0) + found
    for path, energy in expected().items():
        lit = energy > 1e-3 * energy.max()
        assert np.abs(10 * np.log10(heard[path][lit] / energy[lit])).max() < tolerance, path
