"""Grids to focus on, and those that a record suggests."""
import numpy as np
import pytest

from mitsonar.sonar.pulses.pulses import lfm
from mitsonar.synthetic_aperture.focusing.grids import default_grid, ground_grid, slant_grid, strip_grid
from mitsonar.synthetic_aperture.focusing.motion import ApertureMotion
from tests.inputs.raw_strip import circle, line_array, raw_strip, straight

PULSE = lfm(100e3, 20e3, 1e-3)


def record(way, pings=6, side=1.0):
    return raw_strip(way, PULSE, np.zeros((0, 4)), ping_time=np.arange(pings) * 1.0, sampling_rate=4e4,
                     window=(0.02, 0.05), receivers=line_array(4, 0.08), side=side, tx_length=0.08, rx_length=0.08)


def test_rows_go_along_the_heading_and_columns_to_starboard():
    grid = ground_grid((0, 2), (5, 6), (1, 0.5), lambda x, y: 10 + 0.1 * x, origin=(100, 200), heading=np.pi / 2)
    np.testing.assert_allclose(grid.x[:, 0], [100, 101, 102])
    np.testing.assert_allclose(grid.y[0], [195, 194.5, 194])
    np.testing.assert_allclose(grid.depth, 10 + 0.1 * grid.x, rtol=1e-6)


def test_slant_columns_are_even_in_distance_from_the_line():
    grid = slant_grid((0, 1), (10, 20), (0.5, 0.25), 18.0, line_depth=8.0, side=-1)
    np.testing.assert_allclose(np.hypot(grid.ground, grid.depth - 8.0)[0], -grid.across_track, rtol=1e-6)
    assert np.all(grid.ground <= 0) and np.all(np.diff(grid.across_track) > 0)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("kind", ["ground", "slant"])
def test_a_strip_suggests_what_it_hears_on_the_side_it_looks_at(side, kind):
    grid = strip_grid(record(straight(2.0, heading=0.7, start=(3.0, 4.0), sway=(0.02, 3.0)), side=side), kind=kind)
    assert grid.heading == pytest.approx(0.7, abs=0.01)
    assert np.ptp(grid.along_track) == pytest.approx(10.0, abs=0.03)
    assert (grid.x[0, 0] - grid.ground[0] * np.cos(0.7)) == pytest.approx(3.0, abs=0.1)
    far = np.abs(grid.across_track).max()
    assert far == pytest.approx(0.75 * 49 if kind == "slant" else np.sqrt((0.75 * 49) ** 2 - 100), abs=0.1)
    assert np.all(np.sign(grid.across_track) == side)


def test_a_circle_suggests_a_square_about_its_middle():
    radius = 1.5 * 40 / (2 * np.pi)
    grid = default_grid(record(circle(radius), pings=40))
    assert np.hypot(*grid.origin) < 1e-6
    assert grid.depth.shape[0] == grid.depth.shape[1]
    assert np.diff(grid.along_track)[0] == pytest.approx(0.015 / 8)


@pytest.mark.parametrize("make, words", [
    (lambda: ground_grid((1, 0), (0, 1), (1, 1), 5.0), "first that is not above"),
    (lambda: ground_grid((0, 1), (0, 1), (0, 1), 5.0), "step above 0"),
    (lambda: ground_grid((0, 1e9), (0, 1e9), (1, 1), 5.0), "points"),
    (lambda: ground_grid((0, 1), (0, 1), (1, 1), np.nan), "finite"),
    (lambda: ground_grid((0, 1), (0, 1), (1, 1), np.zeros((3, 3))), "one for every point"),
    (lambda: strip_grid(record(straight()), kind="polar"), "ground"),
    (lambda: strip_grid(record(straight(0.0))), "one place"),
    (lambda: strip_grid(record(straight()), ping_time=np.array([0.0])), "two or more pings")])
def test_grids_that_cannot_be_are_refused(make, words):
    with pytest.raises(ValueError, match=words):
        make()


def test_polynomials_follow_the_body_within_a_ping():
    """1 µm was asked for; splines through 200 samples a second are what they follow."""
    raw = record(straight(2.0, sway=(0.05, 1.0), yaw=(0.03, 1.5), heave=(0.05, 2.0)))
    motion, point, window = ApertureMotion(raw), np.array([0.5, 0.0, 0.2]), (0.02, 0.2)
    degree = motion.degree(window, point)
    found = motion.moving(1.3, window, point, degree)
    s = np.linspace(-1, 1, 41)
    moved = np.polynomial.polynomial.polyval(s, found.coefficients).T
    times = 1.3 + found.middle + found.half * s
    assert np.abs(found.place + moved[:, :3] - motion.of_point(times, point)).max() < 1e-7
    assert degree <= 10
