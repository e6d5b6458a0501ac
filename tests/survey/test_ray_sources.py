"""Sources of rays: the shares of every transmit element's echoes that they bring add to one."""
import numpy as np
import pytest

from mitsonar.sonar.arrays.array import Array
from mitsonar.survey.pressure.sources import RaySources


def placed(x):
    """Elements along x [m] that look to starboard."""
    position = np.zeros((len(x), 3))
    position[:, 0] = x
    return Array(position=position, normal=np.broadcast_to([0.0, 1.0, 0.0], position.shape),
                 along=np.broadcast_to([1.0, 0.0, 0.0], position.shape))


@pytest.mark.parametrize("made", [RaySources.from_centre, RaySources.from_elements,
                                  lambda array: RaySources.interpolated(array, 3)])
def test_shares_of_an_element_add_to_one(made):
    sources = made(placed(np.linspace(-1, 1, 7)))
    np.testing.assert_allclose(sources.share.sum(0), 1)
    assert sources.share.shape == (len(sources.position), 7)


def test_an_element_takes_more_from_the_nearer_source():
    sources = RaySources.interpolated(placed([-1.0, -0.5, 0.0, 0.5, 1.0]), 2)
    aft = np.argmin(sources.position[:, 0])
    np.testing.assert_allclose(sources.share[aft], [1, 0.75, 0.5, 0.25, 0])


def test_more_sources_than_elements_are_one_for_each():
    array = placed([0.0, 1.0, 3.0])
    sources = RaySources.interpolated(array, 5)
    np.testing.assert_array_equal(sources.position, array.position)
    np.testing.assert_array_equal(sources.share, np.eye(3))


def test_a_source_that_would_stand_for_no_element_is_refused():
    with pytest.raises(ValueError, match="fan_count is 3, but some of these sources .* smaller fan_count"):
        RaySources.interpolated(placed([0.0, 0.0, 1.0, 1.0]), 3)
