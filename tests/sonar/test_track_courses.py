"""Courses through way points: legs, arcs that touch them, corners, and what does not fit.

Closed forms: an arc of radius R between legs that differ by δ is R |δ| long, replaces 2 R tan(|δ|/2) of them and lies
R (1/cos(δ/2) - 1) inside the way point. The heading is the direction of the way, so the chord over a step s differs
from it by at most s / 2R. Tolerance 1e-9 m: roundings of sums over hundreds of metres.
"""
import numpy as np
import pytest

from mitsonar.sonar.motion.waypoints import Course

SQUARE = [(0, 0), (0, 100), (80, 100), (80, 0)]
ZIGZAG = [(-40, -60), (30, -60), (30, 40), (-30, 40), (0, 0), (0, -40)]


def test_a_right_angle_is_a_quarter_of_a_circle():
    course = Course([(0, 0), (0, 100), (80, 100)], 10.0)
    assert course.length == pytest.approx(180 - 20 + 5 * np.pi, abs=1e-9)
    assert course.marks == pytest.approx([0, 90 + 2.5 * np.pi, course.length], abs=1e-9)
    position, heading, curvature = course.at([0.0, 90.0, 90 + 2.5 * np.pi, 90 + 5 * np.pi, course.length])
    inside = 10 * (np.sqrt(2) - 1) / np.sqrt(2)
    np.testing.assert_allclose(position, [[0, 0], [0, 90], [inside, 100 - inside], [10, 100], [80, 100]], atol=1e-9)
    np.testing.assert_allclose(np.rad2deg(heading), [0, 0, 45, 90, 90], atol=1e-9)
    np.testing.assert_allclose(curvature, [0, 0.1, 0.1, 0, 0], atol=1e-12)


@pytest.mark.parametrize("radius", [0.5, 8.0, 12.0])
def test_position_heading_and_curvature_belong_together(radius):
    course = Course(ZIGZAG, radius)
    distance = np.linspace(0, course.length, 20001)
    position, heading, curvature = course.at(distance)
    step = distance[1]
    chord = np.diff(position, axis=0) / step
    middle = 0.5 * (heading[1:] + heading[:-1])
    # the chord of an arc is shorter by (s / R)^2 / 24; in the few steps with an arc's end in them, turned by s / 2R
    off = np.hypot(*(chord - np.stack([np.sin(middle), np.cos(middle)], -1)).T)
    assert off.max() < 0.5 * step / radius and np.quantile(off, 0.99) < (step / radius) ** 2 / 12
    assert np.sum(0.5 * (curvature[1:] + curvature[:-1])) * step == pytest.approx(heading[-1] - heading[0],
                                                                                 abs=20 * step / radius)
    assert np.abs(curvature).max() == pytest.approx(1 / radius)


def test_port_turns_are_negative_and_headings_run_on():
    _, heading, curvature = Course([(0, 0), (0, 50), (-50, 50), (-50, 0), (0, 0)], 5.0).at([45 + 1.0, 1e9])
    assert curvature[0] == pytest.approx(-0.2)
    assert np.rad2deg(heading[-1]) == pytest.approx(-270)


def test_corners_keep_the_way_points():
    course = Course(SQUARE)
    assert course.length == 280 and course.marks.tolist() == [0, 100, 180, 280]
    position, heading, curvature = course.at([99.5, 100.5, 180.0])
    assert position.tolist() == [[0, 99.5], [0.5, 100], [80, 100]] and not curvature.any()
    np.testing.assert_allclose(np.rad2deg(heading), [0, 90, 180])


def test_the_widest_turn_that_fits_is_the_one_the_refusal_names():
    with pytest.raises(ValueError, match=r"50 m radius need 100\.0 m of the 80\.0 m between way points 2 and 3; take a "
                                         r"turn radius of at most 40 m, or 0 for corners"):
        Course(SQUARE, 50.0)
    course = Course(SQUARE, 40.0)
    assert course.length == pytest.approx(60 + 40 * np.pi + 60, abs=1e-9)


@pytest.mark.parametrize(("points", "radius", "words"), [
    ([(0, 0)], 0, "got 1; give from two"),
    ([], 0, "got 0; give from two"),
    ([(0, 0), (1, 1), (1, 1)], 0, "way points 2 and 3 are the same place"),
    ([(0, 0), (np.nan, 1)], 0, "not a finite number"),
    ([(0, 0), (0, 9), (0, 1)], 1.0, "turns back on itself at way point 2"),
    ([(0, 0), (0, 9)], -1.0, "turn radius -1.0 m"),
    ([(0, 0, 0), (0, 9, 0)], 0, "each as x and y"),
])
def test_courses_that_cannot_be_sailed(points, radius, words):
    with pytest.raises(ValueError, match="way point") as caught:
        Course(points, radius)
    assert words in str(caught.value)
