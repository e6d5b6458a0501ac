"""Directions in which the cones of two line arrays meet: exact, so that 1e-12 is rounding."""
import numpy as np
import pytest

from mitsonar.sonar.arrays.cones import cone_directions

FORWARD, STARBOARD = np.eye(3)[:2]


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


@pytest.mark.parametrize("shared", [True, False], ids=["one attitude", "an attitude each"])
def test_directions_come_back_from_their_sines_along_tilted_arrays(shared):
    rng = np.random.default_rng(1)
    tilt = rng.normal(0, 0.1, (2, 3) if shared else (2, 200, 3))
    transmit, receive = unit(FORWARD + tilt[0]), unit(STARBOARD + tilt[1])
    towards = unit(rng.normal(0, 1, (200, 3)) * [0.2, 1, 0] + [0, 0, 1.5])
    found = cone_directions(transmit, receive, (towards * transmit).sum(-1), (towards * receive).sum(-1))
    assert found == pytest.approx(towards, abs=1e-12)


def test_the_lower_direction_is_found_for_arrays_that_are_mounted_the_other_way_round():
    found = cone_directions(FORWARD, -STARBOARD, np.zeros(1), np.sin([0.3]))
    assert found[0] == pytest.approx([0, -np.sin(0.3), np.cos(0.3)], abs=1e-12)


def test_cones_that_do_not_meet_have_no_direction_or_the_nearest_one_asked_for():
    sines = np.array([0.8]), np.array([0.9])
    assert np.isnan(cone_directions(FORWARD, STARBOARD, *sines)).all()
    found = cone_directions(FORWARD, STARBOARD, *sines, least=0.0)[0]
    assert found == pytest.approx(unit(np.array([0.8, 0.9, 0.0])), abs=1e-12)
    assert cone_directions(FORWARD, STARBOARD, *sines, least=0.1)[0] == pytest.approx(unit(np.array([0.8, 0.9, 0.1])))
