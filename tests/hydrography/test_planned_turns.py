"""Ways between lines: the two closed forms of turning round, and what holds of any shortest way."""
import numpy as np
import pytest

from mitsonar.planning.turns import turn


@pytest.mark.parametrize("apart", [0.0, 10.0, 99.0, 100.0, 300.0])
def test_turning_round_is_as_long_as_its_arcs(apart, radius=50.0, heading=0.3):
    found = turn(np.zeros(2), heading, apart * np.array([np.cos(heading), -np.sin(heading)]), heading + np.pi, radius)
    wide = np.pi * radius + apart - 2 * radius
    wanted = wide if apart >= 2 * radius else radius * (np.pi + 4 * np.arccos((2 * radius + apart) / (4 * radius)))
    assert found.length == pytest.approx(wanted, rel=1e-9)
    # chords of a tenth of a radius are shorter than their arcs by 4e-4
    assert np.hypot(*np.diff(found.path, axis=0).T).sum() == pytest.approx(wanted, rel=6e-4)


def test_any_way_leads_there_and_is_as_long_backwards():
    rng = np.random.default_rng(1)
    for _ in range(100):
        begin, end = rng.normal(size=2) * rng.choice([10, 100, 1000]), rng.normal(size=2) * 100
        heading, course = rng.uniform(0, 2 * np.pi, 2)
        found = turn(begin, heading, end, course, 50.0)
        assert found.length == pytest.approx(turn(end, course + np.pi, begin, heading + np.pi, 50.0).length, abs=1e-3)
        assert found.length >= np.hypot(*(end - begin)) - 1e-6
        np.testing.assert_allclose(found.path[[0, -1]], [begin, end], atol=1e-2)
        first, last = (found.path[1] - found.path[0]), (found.path[-1] - found.path[-2])
        for way, wanted in ((first, heading), (last, course)):
            away = np.arctan2(way[0], way[1]) - wanted
            assert abs((away + np.pi) % (2 * np.pi) - np.pi) < 0.11


def test_without_a_radius_a_way_is_straight():
    assert turn(np.zeros(2), 0.0, np.array([3.0, 4.0]), 1.0, 0.0).length == 5.0
