"""Plans against what can be said of them by hand: level beds, slopes, areas with holes, shoals.

Coverage is counted in nodes, so it is right to a row of nodes along a border; what is counted is said at each test.
"""
import time

import numpy as np
import pytest

from mitsonar.planning.area import inside, polygon
from mitsonar.planning.bed import bed_of, flat_bed
from mitsonar.planning.coverage import SwathSonar
from mitsonar.planning.lines import Segment, in_sailing_order
from mitsonar.planning.plan import Layout, plan
from mitsonar.water import SoundSpeedProfile

WATER = SoundSpeedProfile.constant(1500.0)
SONAR = SwathSonar(swath=np.deg2rad(130), beams=256)
TANGENT = np.tan(np.deg2rad(65))


def box(west, south, east, north):
    return np.array([[west, south], [east, south], [east, north], [west, north]], float)


def level(area, depth=30.0):
    return flat_bed(depth, *area.bounds)


def planned(area, layout=None, depth=30.0, sonar=SONAR, **more):
    return plan(level(area, depth), WATER, sonar, layout, area=area, **more)


def sloped(degrees, towards=0.0, size=600.0):
    """A bed from 20 m on, deeper towards a heading, and its nodes' rise of depth."""
    x = y = np.arange(0, size + 1, 6.0)
    way = x * np.sin(towards) + y[:, None] * np.cos(towards)
    return bed_of(x, y, -20 - np.tan(np.deg2rad(degrees)) * (way - way.min()))


def test_lines_over_a_level_bed_are_as_far_apart_as_the_overlap_says():
    found = planned(polygon([box(0, 0, 1000, 700)]), Layout(overlap=0.2))
    offsets = np.sort([line.track.segment.offset for line in found.lines])
    np.testing.assert_allclose(np.diff(offsets)[:-1], 0.8 * 2 * 30 * TANGENT, atol=0.05)  # the last is pulled back
    assert all(line.length == pytest.approx(1000) for line in found.lines)
    assert found.contours is False and found.frame.heading == pytest.approx(np.pi / 2)
    assert found.coverage.share() == 1.0 and not found.gaps


@pytest.mark.parametrize("layout", [Layout(overlap=0.2, swath_at="mean"), Layout(spacing=0.8 * 2 * 30 * TANGENT)])
def test_even_spacing_by_overlap_is_that_of_the_swath(layout):
    found = planned(polygon([box(0, 0, 1000, 700)]), layout)
    offsets = np.sort([line.track.segment.offset for line in found.lines])
    np.testing.assert_allclose(np.diff(offsets), 0.8 * 2 * 30 * TANGENT)
    assert offsets.mean() == pytest.approx(-350)                                          # in the middle of the area


def test_lines_too_far_apart_leave_the_gaps_that_the_swath_says():
    found = planned(polygon([box(0, 0, 1000, 1200)]), Layout(spacing=200.0, heading=np.pi / 2))
    covered = 2 * 30 * TANGENT / 200
    assert found.coverage.share() == pytest.approx(covered, abs=0.02)                     # rows of nodes 4 m apart
    assert len(found.gaps) == 7                                                          # between lines, and beside
    assert sum(gap.area for gap in found.gaps) == pytest.approx((1 - covered) * 1.2e6, rel=0.05)


def test_soundings_a_square_metre_are_beams_and_pings_over_the_swath():
    even = {}
    for kind in ("distance", "angle"):
        sonar = SwathSonar(swath=np.deg2rad(130), beams=256, rate=5.0, even=kind)
        even[kind] = planned(polygon([box(0, 0, 600, 100)]), Layout(spacing=100.0, heading=np.pi / 2, speed=2.0),
                             sonar=sonar)
    density = even["distance"].coverage.density[even["distance"].coverage.wanted]
    np.testing.assert_allclose(density, 256 / (2 * 30 * TANGENT) * 5 / 2, rtol=1e-5)
    nadir = even["angle"].coverage.density.max()
    assert nadir == pytest.approx(256 / SONAR.swath / 30 * 5 / 2, rel=0.01)               # dθ/dr = 1 / h
    line = even["distance"].lines[0]
    assert even["distance"].pings(line) == 600 / 2 * 5 + 1


def test_a_sonar_without_a_rate_pings_when_the_farthest_echo_is_back():
    found = planned(polygon([box(0, 0, 600, 100)]))
    np.testing.assert_allclose(found.lines[0].track.rate, 1500 * np.cos(np.deg2rad(65)) / (2 * 30), rtol=1e-5)


@pytest.mark.parametrize("towards_deg", [0, 30, 90, 135])
def test_best_heading_follows_the_contours(towards_deg):
    found = plan(sloped(3, np.deg2rad(towards_deg)), WATER, SONAR)
    away = np.rad2deg(found.frame.heading) - towards_deg - 90
    assert found.contours and abs((away + 90) % 180 - 90) < 0.5


def test_lines_lie_farther_apart_where_it_is_deeper():
    found = plan(sloped(4, size=900.0), WATER, SONAR, Layout(overlap=0.1))
    lines = sorted(found.lines, key=lambda line: line.track.depth.mean())
    apart = np.abs(np.diff([line.track.segment.offset for line in lines]))
    assert (np.diff(apart[:-1]) > 0).all() and found.coverage.share() == 1.0


def test_neighbouring_swaths_overlap_everywhere_by_what_was_asked():
    rng = np.random.default_rng(4)
    x = np.arange(0, 800, 5.0)
    waves = sum(rng.uniform(0.5, 2) * np.sin(x / rng.uniform(40, 120) + x[:, None] / rng.uniform(40, 120))
                for _ in range(4))
    found = plan(bed_of(x, x, -30 - waves), WATER, SONAR, Layout(overlap=0.15, heading=0.4))
    for one, other in zip(found.lines, found.lines[1:-1]):                                # the last is pulled back
        s = np.linspace(max(one.track.s[0], other.track.s[0]), min(one.track.s[-1], other.track.s[-1]), 50)
        starboard, port, width = (np.interp(s, line.track.s, values) for line, values in (
            (one, one.track.edges.starboard), (other, other.track.edges.port), (other, other.track.edges.width)))
        common = one.track.segment.offset + starboard - (other.track.segment.offset - port)
        assert (common / width).min() > 0.15 - 0.01 and (common / width).min() < 0.2
    assert found.coverage.share() == 1.0


def test_no_line_leads_through_a_wide_hole_of_the_area():
    area = polygon([box(0, 0, 1000, 800), box(300, 200, 700, 600)])
    assert area.area == pytest.approx(800_000 - 160_000)
    found = planned(area, Layout(heading=np.pi / 2, run_in=10, turn_radius=10))
    for line in found.lines:
        offset, (west, east) = -line.track.segment.offset, sorted((line.start[0], line.end[0]))
        if 260 < offset < 540:                               # farther in than a swath reaches
            assert east <= 310 or west >= 690
    assert found.coverage.share() == 1.0
    assert np.count_nonzero(found.coverage.wanted) * np.prod(found.bed.step) == pytest.approx(640_000, rel=0.03)


@pytest.mark.parametrize("rings, size", [
    ([box(0, 0, 10, 8), box(2, 2, 8, 6), box(4, 3, 6, 5)], 60),                          # a hole, an island in it
    ([box(0, 0, 5, 5), box(5, 0, 10, 5)], 50),                                           # an edge in common
    ([box(0, 0, 5, 5), box(5, 5, 8, 8)], 34), ([box(0, 0, 5, 5), box(0, 1, 2, 3)], 21)])  # a corner; a bay
def test_a_place_is_in_the_area_within_an_odd_number_of_rings(rings, size):
    area = polygon(rings)
    assert area.area == pytest.approx(size)
    assert np.count_nonzero(inside(area, np.arange(12.0), np.arange(10.0))) == size      # nodes west and south are in


def test_shoals_are_left_out_of_the_area():
    x = np.arange(0, 600, 4.0)
    depth = np.full((x.size, x.size), 20.0)
    depth[60:80, 60:90] = 0.5
    found = plan(bed_of(x, x, -depth), WATER, SONAR, Layout(spacing=60.0))
    assert found.shoal == pytest.approx(600 / x.size**2, rel=0.2) and not found.coverage.wanted[65:75, 65:85].any()
    assert found.depths[0] == 20.0


def test_steep_rocks_do_not_fill_an_area_with_lines():
    x = np.arange(0, 1000, 5.0)
    rock = sum(35 * np.exp(-((x - a) ** 2 + (x[:, None] - b) ** 2) / 200) for a, b in ((300, 200), (650, 730)))
    found = plan(bed_of(x, x, -45 + rock), WATER, SONAR, Layout(heading=0.0))
    assert len(found.lines) <= 10 and found.coverage.share() > 0.99


def test_lines_are_sailed_to_and_fro_and_numbered_so():
    found = planned(polygon([box(0, 0, 1000, 700)]), Layout(run_in=30.0))
    assert [line.number for line in found.lines] == list(range(1, len(found.lines) + 1))
    for one, other in zip(found.lines, found.lines[1:]):
        assert (other.heading - one.heading) % (2 * np.pi) == pytest.approx(np.pi)
        forward = np.array([np.sin(other.heading), np.cos(other.heading)])
        np.testing.assert_allclose(other.start - other.run_in, 30 * forward, atol=1e-9)
        np.testing.assert_allclose(one.turn.path[[0, -1]], [one.end, other.run_in], atol=0.01)
    assert found.lines[-1].turn is None


def test_pieces_on_one_side_of_a_long_hole_are_sailed_together():
    pieces = [Segment(row=row, offset=40.0 * row, begin=begin, end=begin + 200) for row in range(6)
              for begin in (0.0, 3000.0)]
    order = in_sailing_order(pieces)
    assert len({id(one) for one, _ in order}) == 12
    assert sum(abs(one.begin - other.begin) > 1000 for (one, _), (other, _) in zip(order, order[1:])) == 1


def test_ten_square_kilometres_take_seconds():
    area = polygon([box(0, 0, 4000, 2500)])
    before = time.process_time()
    found = planned(area, depth=50.0)
    assert time.process_time() - before < 10
    assert len(found.lines) == 13


@pytest.mark.parametrize("rings, words", [
    ([], "the area is empty"), ([np.zeros((0, 2))], "ring of 0 corners"),
    ([box(0, 0, 10, 10)[[0, 2, 1, 3]]], "crosses itself near x = "),
    ([box(0, 0, 10, 10), box(5, 5, 15, 15)], "crosses itself near x = "),
    ([np.array([[0, 0], [1, 1], [2, 2.0]])], "has no extent"), ([np.array([[0, 0], [1, 1], [np.nan, 2.0]])], "finite"),
    ([np.random.default_rng(0).normal(size=(30_000, 2))], "30000 corners, more than")])
def test_an_area_that_is_none_is_refused(rings, words):
    with pytest.raises(ValueError, match=words):
        polygon(rings)


def test_an_area_beside_the_bathymetry_is_refused():
    with pytest.raises(ValueError, match="lies where the bathymetry has no depth; it covers 0, 0, 600, 600"):
        plan(sloped(1), WATER, SONAR, area=polygon([box(2000, 0, 2100, 100)]))


@pytest.mark.parametrize("wrong, words", [
    ({"overlap": 1.0}, "the overlap is 100 %"), ({"overlap": np.nan}, "the overlap is nan %"),
    ({"spacing": 0.0}, "must be above 0"), ({"spacing": np.inf}, "must be above 0"), ({"speed": 0.0}, "0 knots"),
    ({"heading": np.inf}, "not a finite number"), ({"run_in": -1.0}, "the run-in is -1 m"),
    ({"turn_radius": np.nan}, "the turn radius is nan m"), ({"swath_at": "x"}, "choose one of line, shoalest, mean"),
    ({"least_depth": -2.0}, "the least depth is -2 m")])
def test_a_layout_that_cannot_be_is_refused(wrong, words):
    with pytest.raises(ValueError, match=words):
        Layout(**wrong)


@pytest.mark.parametrize("layout", [Layout(spacing=0.01), Layout(overlap=0.9999)])
def test_lines_without_end_are_refused(layout):
    with pytest.raises(ValueError, match="more than 2000; take a wider spacing or less overlap"):
        planned(polygon([box(0, 0, 1000, 700)]), layout)


@pytest.mark.parametrize("layout", [Layout(least_depth=0.0), Layout(least_depth=0.0, spacing=2.0)])
def test_an_area_of_an_ocean_in_shoal_water_is_refused_at_once(layout):
    with pytest.raises(ValueError, match="more than 2000; take a wider spacing or less overlap"):
        planned(polygon([box(0, 0, 1e8, 1e8)]), layout, depth=0.5)


def test_an_area_narrower_than_the_swath_is_covered_by_one_line():
    found = planned(polygon([box(0, 0, 500, 1)]))
    assert len(found.lines) == 1 and found.lines[0].length == pytest.approx(500) and found.coverage.share() == 1.0


def test_a_bed_shoaler_than_the_least_depth_is_refused():
    with pytest.raises(ValueError, match="nowhere deeper than 30 m, and bed shoaler than 40 m is left out"):
        planned(polygon([box(0, 0, 1000, 700)]), Layout(least_depth=40.0))
