"""Mean absorption along a ray from integrals over depth."""
import numpy as np
import pytest
from drjit.auto import Float
from scipy.integrate import trapezoid

from mitsonar.device.arrays import upload
from mitsonar.water import SoundSpeedProfile, absorption_db
from mitsonar.water.absorption_table import Absorption
from mitsonar.water.column import AbsorptionColumn

DEPTH = np.array([0.0, 6.0, 10.0, 14.0, 18.0, 24.0, 60.0])
TEMPERATURE = np.array([18.0, 17.8, 15.5, 13.0, 11.8, 11.3, 11.0])
SUMMER = SoundSpeedProfile(DEPTH, 1450 + 3.4 * TEMPERATURE)


def loss_db(column, profile, z0, z1, length, p):
    absorption = Absorption(column, profile, 80.0, Float)
    one = [upload(Float, np.array([v], np.float32)) for v in (z0, z1, length, p)]
    return absorption.two_way_db(*one).numpy()[0]


@pytest.mark.parametrize("pair", [(0.0, 60.0), (3.0, 18.0), (18.0, 3.0), (20.0, 20.0), (20.0, 20.2), (55.0, 75.0)])
def test_vertical_paths_take_the_mean_over_depth(variant, pair):
    """Against numerical integration of the piecewise linear α; the table of 1024 steps over 80 m is good to 1e-5."""
    column = AbsorptionColumn([0.0, 10.0, 20.0, 60.0], [0.10, 0.10, 0.06, 0.05])
    mean = column.at(np.linspace(*pair, 20001)).mean()
    assert loss_db(column, SUMMER, *pair, 37.0, 0.0) == pytest.approx(2 * mean * 37.0, abs=2e-3)


@pytest.mark.parametrize("grazing_deg, tolerance", [(5.0, 0.4), (8.0, 0.12), (10.0, 0.06), (20.0, 0.01), (60.0, 0.005)])
def test_slant_paths_through_a_thermocline(variant, grazing_deg, tolerance):
    """∫ α dz / s by quadrature along the refracted ray, 2 to 40 m, 400 kHz. The expansion is of first order in the
    change of c² over s², so its error grows like 1/s⁴: found are 0.36, 0.10, 0.05 dB, and 0.003 dB of float32 and
    table above."""
    column = AbsorptionColumn(DEPTH, absorption_db(400e3, TEMPERATURE, 32.0, DEPTH, 8.0))
    z = np.linspace(2.0, 40.0, 200_001)
    p = np.cos(np.radians(grazing_deg)) / SUMMER.at(2.0)
    per_depth = 1 / np.sqrt(1 - (p * SUMMER.at(z)) ** 2)
    length, exact = trapezoid(per_depth, z), 2 * trapezoid(column.at(z) * per_depth, z)
    assert loss_db(column, SUMMER, 2.0, 40.0, length, p) == pytest.approx(exact, abs=tolerance)
    without = 2 * column.at(z).mean() * length
    assert abs(without - exact) > 2 * abs(loss_db(column, SUMMER, 2.0, 40.0, length, p) - exact) or grazing_deg > 30


def test_values_that_are_no_absorption_are_refused():
    with pytest.raises(ValueError, match="not negative"):
        AbsorptionColumn([0.0], [-0.1])
    with pytest.raises(ValueError, match="depths increasing"):
        AbsorptionColumn([10.0, 0.0], [0.1, 0.1])
