"""When an array is too large for the vector approximation, and when nothing is said."""
import pytest

from mitsonar.survey.pressure.delays import ArrivalCounts


def counts(radius):
    return ArrivalCounts(radius=radius, guard=5e-10)


def test_arrivals_and_lost_ones_add_up():
    some = counts(0.1)
    some.count(100)
    some.count(50, lost=3)
    assert (some.arrivals, some.lost) == (150, 3)


def test_a_large_array_with_most_echoes_in_doubt_is_refused():
    some = counts(3.0)
    some.judge(4000, 1000)
    with pytest.raises(ValueError, match="reaches 3 m .* for 60 % of the echoes .* more than 0.5 ns"):
        some.judge(1000, 2000)


@pytest.mark.parametrize("radius, judged, doubtful", [(0.5, 4000, 4000), (3.0, 4000, 2000), (3.0, 400, 400)])
def test_small_arrays_a_minority_in_doubt_and_few_echoes_are_not(radius, judged, doubtful):
    counts(radius).judge(judged, doubtful)
