"""The width of a planned swath against closed forms: straight rays, circular arcs, and beds that slope.

In one sound speed a level bed h below the head is covered over 2 h tan Θ. In c = c_0 + g d a ray is an arc of a circle,
r = (s_0 - s_1) / (p g) with the sines of grazing s at both ends. A bed that falls by tan β a metre to starboard is met
at h tan Θ / (1 - tan β tan Θ) downslope and h tan Θ / (1 + tan β tan Θ) upslope. Edges are found between 257 samples of
the bed, linearly, and the tables are linear in depth: 1e-9 where all is linear, 1e-5 of the reach where rays are arcs.
"""
import numpy as np
import pytest

from mitsonar.planning.area import LineFrame
from mitsonar.planning.bed import PlannedBed, flat_bed
from mitsonar.planning.coverage import SwathSonar
from mitsonar.planning.lines import swath_edges
from mitsonar.planning.rays import swath_rays
from mitsonar.propagation.numpy_rays.eigenrays import eigenray
from mitsonar.water import SoundSpeedProfile

THETA = np.deg2rad(65)
SUMMER = SoundSpeedProfile([0, 8, 20, 40, 60], [1513.2, 1511.6, 1494.2, 1492.2, 1493.0])


def sloping(tangent, middle=50.0):
    """A bed that falls to the east."""
    x, y = np.arange(-400, 401, 5.0), np.arange(-50, 51, 5.0)
    depth = np.broadcast_to(middle + tangent * x, (y.size, x.size))
    return PlannedBed(x=x, y=y, depth=depth.copy(), known=np.ones(depth.shape, bool))


def edges_over(bed, profile, head=0.0, **limits):
    rays = swath_rays(profile, head_depth=head, half_angle=THETA, deepest=float(bed.depth.max()), **limits)
    return swath_edges(bed, rays, LineFrame(heading=0.0), 0.0, np.array([-20.0, 0.0, 20.0]))


@pytest.mark.parametrize("head", [0.0, 4.0])
def test_level_bed_in_one_sound_speed_is_covered_as_far_as_straight_rays_go(head):
    found = edges_over(flat_bed(50.0, -400, -400, 400, 400), SoundSpeedProfile.constant(1500.0), head)
    np.testing.assert_allclose(found.width, 2 * (50 - head) * np.tan(THETA), rtol=1e-9)
    np.testing.assert_array_equal(found.port, found.starboard)


@pytest.mark.parametrize("gradient", [-0.5, -0.05, 0.05, 0.4])
def test_swath_in_a_constant_gradient_ends_where_the_arc_does(gradient):
    profile = SoundSpeedProfile([0, 100], [1500, 1500 + 100 * gradient])
    p = np.sin(THETA) / profile.at(2.0)
    begin, end = (np.sqrt(1 - (p * profile.at(depth)) ** 2) for depth in (2.0, 50.0))
    found = edges_over(flat_bed(50.0, -400, -400, 400, 400), profile, 2.0)
    np.testing.assert_allclose(found.starboard, (begin - end) / (p * gradient), rtol=1e-5)


def test_swath_through_a_cast_ends_where_the_eigenray_of_the_outermost_angle_does():
    found = edges_over(flat_bed(50.0, -400, -400, 400, 400), SUMMER, 3.0)
    launch = eigenray(SUMMER, 3.0, 50.0, found.port).launch_angle
    np.testing.assert_allclose(0.5 * np.pi - launch, THETA, atol=1e-6)


def test_rays_that_turn_back_upwards_do_not_cover_the_bed():
    steep = SoundSpeedProfile([0, 50], [1400, 1700])
    found = edges_over(flat_bed(50.0, -400, -400, 400, 400), steep)
    # the flattest ray that comes down is level at the bed: p = 1 / c there, s_1 = 0; the limit of 1 mrad costs 1e-3
    p, gradient = 1 / 1700, 6.0
    assert found.port[0] == pytest.approx(np.sqrt(1 - (1400 * p) ** 2) / (p * gradient), rel=3e-3)


def test_swath_is_wider_downslope_and_as_wide_as_the_slope_says():
    tangent = np.tan(np.deg2rad(8))
    found = edges_over(sloping(tangent), SoundSpeedProfile.constant(1500.0))
    reach = np.tan(THETA)
    np.testing.assert_allclose(found.starboard, 50 * reach / (1 - tangent * reach), rtol=1e-6)     # float32 depths
    np.testing.assert_allclose(found.port, 50 * reach / (1 + tangent * reach), rtol=1e-6)


def test_largest_range_ends_a_swath():
    found = edges_over(flat_bed(30.0, -400, -400, 400, 400), SoundSpeedProfile.constant(1500.0), max_range=50.0)
    np.testing.assert_allclose(found.width, 2 * 40.0, rtol=1e-5)


def test_a_bank_ends_a_swath():
    bed = sloping(0.0)
    bed.depth[:, bed.x >= 50] = 10.0
    found = edges_over(bed, SoundSpeedProfile.constant(1500.0))
    assert ((found.starboard > 45) & (found.starboard < 50)).all()
    np.testing.assert_allclose(found.port, 50 * np.tan(THETA), rtol=1e-6)


def test_angle_of_a_place_is_that_of_its_eigenray():
    rays = swath_rays(SUMMER, head_depth=2.0, half_angle=THETA, deepest=60.0)
    depth, distance = (values.ravel() for values in np.meshgrid(np.linspace(15, 60, 9), np.linspace(0, 30, 8)))
    wanted = 0.5 * np.pi - eigenray(SUMMER, 2.0, depth, distance).launch_angle
    found, within = rays.angle(distance, depth), wanted < THETA
    assert within.sum() > 60
    np.testing.assert_allclose(found[within], wanted[within], atol=2e-5)           # by a table of 256 x 128


@pytest.mark.parametrize("wrong, words", [
    ({"swath": np.pi}, "more than 0 and less than 180"), ({"swath": np.nan}, "the swath is nan degrees"),
    ({"beams": 0}, "0 beams"), ({"rate": 0.0}, "pings 0 times"), ({"max_range": np.nan}, "range is nan m"),
    ({"head_depth": -1.0}, "head is -1 m deep"), ({"even": "time"}, 'choose "angle" or "distance"')])
def test_a_sonar_that_cannot_be_is_refused(wrong, words):
    with pytest.raises(ValueError, match=words):
        SwathSonar(**{"swath": 2.0} | wrong)


def test_a_head_below_the_bed_is_refused():
    with pytest.raises(ValueError, match="the head must be in the water and above the bed"):
        swath_rays(SUMMER, head_depth=10.0, half_angle=1.0, deepest=9.0)
