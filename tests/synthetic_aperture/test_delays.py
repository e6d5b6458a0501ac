"""Travel times from tables against exact eigenrays."""
import numpy as np
import pytest

from mitsonar.propagation import eigenray
from mitsonar.synthetic_aperture.focusing.delays import TravelTables, bends
from mitsonar.water import SoundSpeedProfile

THERMOCLINE = SoundSpeedProfile([0, 8, 12, 14, 30, 60], [1525, 1524, 1505, 1490, 1484, 1482])


def read(plane, across, depth, rise):
    """What the device reads of a plane, in float64."""
    x, y = (across - plane.range[0]) / plane.range[1], (depth - plane.depth[0]) / plane.depth[1]
    i, j = x.astype(int), np.clip(y.astype(int), 0, plane.values.shape[0] - 2)
    x, y = (x - i)[:, None], (y - j)[:, None]
    values = plane.values.astype(float)
    both = ((1 - y) * ((1 - x) * values[j, i] + x * values[j, i + 1])
            + y * ((1 - x) * values[j + 1, i] + x * values[j + 1, i + 1]))
    return both[:, 0] + rise * both[:, 1] + rise ** 2 * both[:, 2]


@pytest.mark.parametrize("depths", [(20.0, 20.0), (18.5, 21.5)])
def test_times_through_a_thermocline_err_by_less_than_a_hundredth_of_a_cycle(depths):
    """33 ns there and back at 300 kHz: 16 ns one way, to 150 m, elements 2 cm off their depth."""
    rng = np.random.default_rng(1)
    tables = TravelTables(THERMOCLINE, 1495.0, depths, (5.0, 150.0))
    across, depth = rng.uniform(5, 150, 2000), rng.uniform(*depths, 2000)
    for source in (10.0, 10.51, 11.963):
        plane = tables.at(source)
        for rise in (-0.02, 0.0, 0.02):
            exact = eigenray(THERMOCLINE, source + rise, depth, across).travel_time
            slant = np.hypot(across, depth - source - rise)
            found = slant / 1495.0 * (1 + read(plane, across, depth, rise))
            assert np.abs(found - exact).max() < 16e-9, (source, rise)


def test_water_of_one_speed_bends_nothing():
    assert not bends(SoundSpeedProfile([0, 50], [1500, 1500]))
    assert bends(THERMOCLINE)
