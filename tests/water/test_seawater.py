"""Sound speed of seawater against TEOS-10's own numbers and printed or checked values of the other formulas.

The columns were computed by other implementations at 45 N 20 W and printed to 1e-5 m/s (Leroy's to 1e-4): tolerance
6e-6 (6e-5). NaN: outside what the formula was fitted to. Wong and Zhu's table and Mackenzie's check value are printed
to 1e-3 m/s: tolerance 6e-4. Bias: none. Two standards differ by up to 0.28 m/s at 1000 m, so 0.3 m/s only guards
against a wrong unit.
"""
import gsw
import numpy as np
import pytest

from mitsonar.water import sound_speed
from mitsonar.water.ranges import RANGES, SOUND_SPEED_RANGES
from mitsonar.water.seawater import FORMULAS

NAN = np.nan
TEMPERATURE, SALINITY, DEPTH, EXACT, CHEN_MILLERO, MACKENZIE, MEDWIN = np.transpose([
    (10, 35, 0, 1489.78863, 1489.83212, 1489.80340, 1489.99000),
    (10, 35, 50, 1490.60958, 1490.66208, 1490.61882, 1490.79000),
    (15, 35, 20, 1507.00371, 1507.01051, 1507.01829, 1507.12375),
    (4, 35, 1000, 1482.98378, 1483.25596, 1482.95520, 1482.73856),
    (20, 30, 5, 1515.94989, 1515.97919, 1515.86970, 1515.90000),
    (8, 0, 5, 1439.23023, 1439.22061, NAN, 1438.60848),
    (25, 38, 50, 1538.43433, 1538.49333, 1538.36104, 1538.42625),
])
COLUMNS = {"teos-10": EXACT, "chen-millero": CHEN_MILLERO, "mackenzie": MACKENZIE, "medwin": MEDWIN}
# temperature, salinity, pressure [bar], sound speed: of Wong and Zhu's table
WONG_ZHU = [(0, 35, 0, 1449.139), (0, 25, 0, 1435.790), (10, 25, 100, 1494.127), (30, 35, 300, 1595.909),
            (0, 35, 1000, 1623.150), (10, 40, 400, 1562.547)]
# temperature, salinity, depth, sound speed
LEROY = [(10, 35, 0, 1489.8195), (10, 35, 50, 1490.6267), (10, 35, 100, 1491.4351), (4, 35, 1000, 1482.8690),
         (20, 30, 5, 1516.0648), (25, 38, 50, 1538.5197), (2, 34, 200, 1459.9071)]


@pytest.mark.parametrize("formula", COLUMNS)
def test_agrees_with_other_implementations(formula):
    wanted = COLUMNS[formula]
    rows = np.isfinite(wanted)
    speed = sound_speed(TEMPERATURE[rows], SALINITY[rows], DEPTH[rows], formula=formula)
    np.testing.assert_allclose(speed, wanted[rows], rtol=0, atol=6e-6)


@pytest.mark.parametrize("temperature, salinity, pressure, wanted", WONG_ZHU)
@pytest.mark.parametrize("latitude", [0, 45])
def test_chen_millero_agrees_with_the_printed_table(temperature, salinity, pressure, wanted, latitude):
    depth = -gsw.z_from_p(10 * pressure, latitude)
    speed = sound_speed(temperature, salinity, depth, latitude, formula="chen-millero")
    assert speed == pytest.approx(wanted, rel=0, abs=6e-4)


def test_mackenzie_agrees_with_its_check_value():
    assert sound_speed(25, 35, 1000, formula="mackenzie") == pytest.approx(1550.744, rel=0, abs=6e-4)


@pytest.mark.parametrize("temperature, salinity, depth, wanted", LEROY)
def test_leroy_agrees_with_other_implementations(temperature, salinity, depth, wanted):
    speed = sound_speed(temperature, salinity, depth, formula="leroy-robinson-goldsmith")
    assert speed == pytest.approx(wanted, rel=0, abs=6e-5)


def test_leroy_counts_latitude_from_the_equator():
    north, south, middle = sound_speed(10, 35, 4000, [60, -60, 45], formula="leroy-robinson-goldsmith")
    assert north == south == pytest.approx(middle + 1.2e-6 * 4000 * 15, rel=1e-14)


@pytest.mark.parametrize("formula", FORMULAS)
def test_formulas_stay_near_each_other_and_broadcast(formula):
    t, s, z = np.linspace(2, 30, 8)[:, None, None], np.array([30, 35, 40])[:, None], np.array([0, 50, 200])
    speed = sound_speed(t, s, z, formula=formula)
    assert speed.shape == (8, 3, 3)
    np.testing.assert_allclose(speed, sound_speed(t, s, z), rtol=0, atol=0.5)


@pytest.mark.parametrize("formula", FORMULAS)
def test_every_argument_broadcasts(formula):
    assert sound_speed(10, 35, 20, [[50], [60]], [0, 10, 20], formula=formula).shape == (2, 3)


EDGES = [(formula, name, side) for formula, ranges in SOUND_SPEED_RANGES.items() for name in ranges for side in (0, 1)]


@pytest.mark.parametrize("formula, name, side", EDGES)
def test_what_a_formula_was_not_fitted_to_is_refused(formula, name, side):
    edge = SOUND_SPEED_RANGES[formula][name][side]
    water = {"temperature": 10.0, "salinity": 35.0, "depth": 0.0}
    assert np.isfinite(sound_speed(**{**water, name: edge}, formula=formula))
    with pytest.raises(ValueError, match=f"^sound speed, {formula}: {name} is .*; it must lie in "):
        sound_speed(**{**water, name: edge + (side - 0.5) / 5}, formula=formula)


def test_every_formula_has_its_ranges():
    assert list(SOUND_SPEED_RANGES) == list(FORMULAS)
    for ranges in SOUND_SPEED_RANGES.values():
        assert all(low >= RANGES[name][0] and high <= RANGES[name][1] for name, (low, high, _) in ranges.items())


def test_an_unknown_formula_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match="'del-grosso' is unknown; use one of teos-10, chen-millero, mackenzie, medw"):
        sound_speed(10, 35, 0, formula="del-grosso")


def test_stays_near_the_older_standard():
    np.testing.assert_allclose(sound_speed(TEMPERATURE, SALINITY, DEPTH), CHEN_MILLERO, rtol=0, atol=0.3)


def test_arguments_broadcast():
    assert sound_speed([[5], [10]], 35, [0, 50, 100], latitude=60, longitude=20).shape == (2, 3)


def test_position_matters_little():
    here, there = sound_speed(10, 35, 100), sound_speed(10, 35, 100, latitude=-10, longitude=150)
    assert 0 < abs(here - there) < 0.1


@pytest.mark.parametrize("name, value", [("temperature", 50), ("salinity", -1), ("salinity", np.nan),
                                         ("depth", 2e4), ("latitude", 91)])
def test_nonsense_is_refused_by_name(name, value):
    with pytest.raises(ValueError, match=name):
        sound_speed(**{"temperature": 10, "salinity": 35, "depth": 0, name: value})
