"""Absorption laws against an independent implementation.

Closed form: the published fits. The table holds dB/km at 10, 50, 100, 300, 500 and 900 kHz from another
implementation of the same formulas, printed to five decimals; Thorp's, to six. Bias: none, so the tolerance is that
rounding, 6e-6 and 6e-7.
"""
import numpy as np
import pytest

from mitsonar.water import absorption_db, ainslie_mccolm_db, francois_garrison_db, thorp_db
from mitsonar.water.absorption import FORMULAS

FREQUENCIES = np.array([10, 50, 100, 300, 500, 900]) * 1e3
# (temperature, salinity, depth, ph): Francois-Garrison, Ainslie-McColm [dB/km]
TABLE = {
    (10, 35, 0, 8.0): ([0.96264, 15.39191, 33.63032, 73.13931, 124.67276, 299.46258],
                       [0.98657, 15.70968, 34.34102, 76.15058, 132.09674, 322.30851]),
    (10, 35, 50, 8.0): ([0.95647, 15.28317, 33.39953, 72.75268, 124.17761, 298.62886],
                        [0.97956, 15.58486, 34.07518, 75.68291, 131.45504, 321.10420]),
    (4, 35, 200, 7.9): ([1.10516, 14.70786, 26.80241, 64.44847, 129.11862, 353.69978],
                        [1.12085, 14.84259, 27.03723, 65.98877, 133.36515, 367.43860]),
    (20, 35, 10, 8.1): ([0.76682, 13.00925, 38.03664, 101.86179, 146.54070, 274.05515],
                        [0.78622, 13.09952, 38.83190, 107.11640, 155.02028, 290.60312]),
    (25, 38, 20, 8.2): ([0.78823, 12.33799, 39.63395, 128.08330, 179.04252, 295.76395],
                        [0.81293, 12.13002, 39.72978, 136.38547, 192.26447, 313.57350]),
    (8, 0.5, 10, 7.0): ([0.04805, 1.05375, 3.79591, 30.94084, 84.88211, 273.60828],
                        [0.05147, 1.12318, 4.05088, 33.33742, 91.61658, 295.53863]),
    (5, 33, 100, 8.0): ([1.04265, 14.30259, 26.91451, 64.00081, 126.05011, 341.14967],
                        [1.06282, 14.46953, 27.16811, 65.82963, 131.24767, 358.18527]),
}
THORP = [1.189830, 17.529923, 34.318963, 69.196189, 118.403343, 286.891705]
LAWS = list(FORMULAS.values())


@pytest.mark.parametrize("water", TABLE, ids=str)
@pytest.mark.parametrize("column, law", list(enumerate([francois_garrison_db, ainslie_mccolm_db])))
def test_agrees_with_an_independent_implementation(water, column, law):
    np.testing.assert_allclose(1000 * law(FREQUENCIES, *water), TABLE[water][column], rtol=0, atol=6e-6)


@pytest.mark.parametrize("water", TABLE, ids=str)
def test_thorp_is_the_same_in_all_waters(water):
    np.testing.assert_allclose(1000 * thorp_db(FREQUENCIES, *water), THORP, rtol=0, atol=6e-7)


@pytest.mark.parametrize("name", FORMULAS)
def test_a_formula_is_called_by_its_name(name):
    water = (12.0, [[30.0], [36.0]], 40.0, 8.1)
    assert np.array_equal(absorption_db(FREQUENCIES, *water, formula=name), FORMULAS[name](FREQUENCIES, *water))


def test_default_law_is_francois_garrison():
    assert np.array_equal(absorption_db(FREQUENCIES), francois_garrison_db(FREQUENCIES, 10.0, 35.0, 0.0, 8.0))
    assert FORMULAS.keys() == {"francois-garrison", "ainslie-mccolm", "thorp"}


def test_an_unknown_formula_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match="'schulkin' is unknown; use one of francois-garrison, ainslie-mccolm, thorp"):
        absorption_db(1e5, formula="schulkin")


@pytest.mark.parametrize("law", LAWS)
def test_arguments_broadcast_and_stay_positive(law):
    absorption = law(FREQUENCIES[:, None], np.linspace(-2, 40, 5), 35, 10, 8)
    assert absorption.shape == (6, 5) and (absorption > 0).all()


@pytest.mark.parametrize("law", LAWS)
def test_silence_and_fresh_water_are_finite(law):
    silence = 3.3e-6 if law is thorp_db else 0      # Thorp's has a constant, for scattering below 1 kHz
    assert law(0.0) == silence
    assert law(0.0, 10, 0.0) == silence
    assert 0 < law(1e5, 10, 0.0) < law(1e5, 10, 35.0) or law is thorp_db


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name, value", [("frequency", -1), ("frequency", np.nan), ("temperature", -3),
                                         ("temperature", 41), ("salinity", -0.1), ("salinity", 46),
                                         ("depth", 20000), ("ph", 6.9), ("ph", 9.1)])
def test_nonsense_is_refused_by_name(law, name, value):
    with pytest.raises(ValueError, match=name):
        law(**{"frequency": 1e5, name: value})
