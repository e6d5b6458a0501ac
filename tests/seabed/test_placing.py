"""Targets on a seabed against closed forms: where they lie, how they lie, and the statistics of what is drawn.

Heights of a bed: linear on its triangles, so to rounding of float32 heights (2e-6 m at 20 m). Rest poses: of a box with
half sides a, b and half height h a face is seen from the middle under 4 atan(ab / (h sqrt(a^2 + b^2 + h^2))); of six
stable faces that is the share of all drops. Drawn numbers: Kolmogorov-Smirnov against the uniform distribution, chance
of a false alarm 1e-3 each; the seeds are fixed, so a test that passes once passes always.
"""
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.tri import LinearTriInterpolator, Triangulation
from scipy import stats
from scipy.spatial import Delaunay

from mitsonar.seabed import Bed, Body, Rules, draw_count, place

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
SIDES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6],
                  [0, 6, 4], [1, 5, 7], [1, 7, 3]])
SLOPE = np.array([0.2, -0.1])      # of a tilted bed, along x and y


def box(*size, name="box", shift=(5.0, -3.0, 40.0)):
    """A box with its origin far away."""
    return Body(name=name, vertices=CORNERS * size + shift, faces=SIDES)


def bed(height=lambda x, y: 0 * x - 20.0, half=30.0, step=0.5):
    """A square bed about the origin."""
    x, y = np.meshgrid(*2 * [np.arange(-half, half + step / 2, step)])
    index = np.arange(x.size).reshape(x.shape)
    here, east, north, across = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
    faces = np.stack((here, east, north, east, across, north), -1).reshape(-1, 3)
    return Bed(np.stack((x, y, height(x, y)), -1).reshape(-1, 3).astype(np.float32), faces)


FLAT = bed(step=10.0)


def drawn(count, rules=Rules(), bodies=(box(0.02, 0.06, 0.04),), ground=FLAT, seed=1):
    return place(bodies, ground, rules, count=count, seed=seed)


def is_uniform(values, low, high):
    return stats.kstest(values, stats.uniform(low, high - low).cdf).pvalue > 1e-3


class TestBed:
    def test_uneven_triangles_are_linear_between_their_corners(self, rng):
        # a fine patch in a coarse bed: triangles of 1 cm to 20 m
        points = np.concatenate((rng.uniform(-20, 20, (40, 2)), rng.normal(0, 0.3, (1000, 2)) + 5))
        heights = rng.normal(-20, 1, len(points)).astype(np.float32)
        triangles = Delaunay(points.astype(np.float32))
        ground = Bed(np.column_stack((triangles.points, heights)), triangles.simplices)
        x, y = np.concatenate((rng.uniform(-22, 22, (3000, 2)), rng.normal(0, 0.3, (3000, 2)) + 5)).T
        found, surface = ground.heights(x, y), Triangulation(*triangles.points.T, triangles.simplices)
        expected = LinearTriInterpolator(surface, heights)(x, y).filled(np.nan)
        assert np.isnan(expected).any() and np.array_equal(np.isnan(found), np.isnan(expected))
        assert np.nanmax(np.abs(found - expected)) < 1e-9

    def test_the_highest_of_several_sheets(self):
        sheets = np.array([[0, 0, -9], [4, 0, -9], [0, 4, -9], [0, 0, -7], [1, 0, -7], [0, 1, -7], [2, 1, 0]], float)
        ground = Bed(sheets, [[0, 1, 2], [3, 4, 5], [1, 6, 1], [0, 6, 6]])
        assert np.array_equal(ground.heights([0.2, 1.5, 3.5], [0.2, 1.5, 3.5]), [-7, -9, np.nan], equal_nan=True)
        assert ground.bounds == (0, 0, 4, 4)

    def test_without_width_it_is_refused(self):
        with pytest.raises(ValueError, match="no triangle that can be seen from above"):
            Bed(np.array([[1, 1, 0], [1, 1, 5], [1, 1, 9]], float), [[0, 1, 2]])


class TestBody:
    def test_rest_poses_of_a_box(self):
        sides = np.array([1.0, 2.0, 3.0])
        rotations, often = box(*sides).rest_poses
        heights = np.array([np.ptp(box(*sides).vertices @ rotation.T, axis=0)[2] for rotation in rotations])
        for height in sides:
            a, b = sides[sides != height] / 2
            angle = 4 * np.arctan(a * b / (height / 2 * np.sqrt(a * a + b * b + height * height / 4)))
            assert often[np.isclose(heights, height)].sum() == pytest.approx(2 * angle / (4 * np.pi), rel=1e-9)
        assert np.allclose(np.linalg.det(rotations), 1)

    def test_it_rolls_off_a_face_that_does_not_bear_it(self):
        vertices = CORNERS + np.outer(CORNERS[:, 2], (2.0, 0, 0))      # a cube sheared by two sides leans over its base
        rotations, often = Body(name="leaning", vertices=vertices, faces=SIDES).rest_poses
        assert often.sum() == pytest.approx(1)
        ends = [rotation @ (0, 0, 1) for rotation in rotations]        # where the normal of the base comes to point
        assert all(abs(end[2]) < 0.95 for end in ends)

    def test_a_stray_vertex_is_no_part_of_it(self):
        stray = Body(name="box", vertices=np.concatenate(([[900.0, 0, np.nan]], CORNERS)), faces=SIDES + 1)
        assert np.array_equal(stray.vertices[stray.faces], CORNERS[SIDES]) and stray.size == 1

    @pytest.mark.parametrize("vertices, faces, said", [
        (CORNERS, np.zeros((0, 3), int), "has no faces"),
        (CORNERS, [[0, 1, 8]], "names vertex 8 of 8"),
        (np.where(CORNERS > 0.5, np.nan, 0), SIDES, "not finite"),
        (CORNERS * (1, 1, 0), SIDES, "lies in a plane"),
    ])
    def test_what_is_no_body_is_refused(self, vertices, faces, said):
        with pytest.raises(ValueError, match=said):
            Body(name="thing", vertices=vertices, faces=faces)


class TestChance:
    def test_numbers_are_uniform(self):
        rules = Rules(scale=(0.5, 2.0), burial=(0.1, 0.6), heading=(0.2, 3.0), tilt=(0.0, 0.4))
        targets = drawn(800, rules)
        for name, low, high in (("scale", 0.5, 2.0), ("burial", 0.1, 0.6), ("heading", 0.2, 3.0), ("tilt", 0.0, 0.4),
                                ("tilt_heading", 0.0, 2 * np.pi)):
            assert is_uniform([getattr(target, name) for target in targets], low, high), name
        lifted = drawn(800, replace(rules, height=(0.5, 3.0)))         # and nothing else changes
        assert is_uniform([target.height for target in lifted], 0.5, 3.0)
        for above, target in zip(lifted, targets):
            np.testing.assert_allclose(above.vertices - target.vertices, [[0, 0, above.height]] * 8, atol=1e-9)
        whole = [target.heading for target in drawn(800)]
        assert is_uniform(whole, 0, 2 * np.pi) and not is_uniform(whole, 0.2, 2 * np.pi)

    def test_places_are_uniform_over_the_area(self):
        places = np.array([target.position for target in drawn(800, Rules(area=(-20, 3, 10, 11)))])
        assert is_uniform(places[:, 0], -20, 10) and is_uniform(places[:, 1], 3, 11)

    def test_any_attitude_is_as_likely(self):
        targets = drawn(800, Rules(pose="any"), [box(0.1, 0.1, 0.5)])
        upward = np.array([(target.vertices[1] - target.vertices[0]) / 0.5 for target in targets])
        assert is_uniform(upward[:, 2], -1, 1)
        assert is_uniform(np.arctan2(upward[:, 1], upward[:, 0]), -np.pi, np.pi)

    def test_species_by_weight(self):
        bodies = [box(0.1, 0.1, 0.1, name=name) for name in ("a", "b", "c")]
        names = [target.body.name for target in drawn(900, Rules(weights=np.array([2.0, 0.0, 1.0])), bodies)]
        assert set(names) == {"a", "c"} and stats.binomtest(names.count("a"), 900, 2 / 3).pvalue > 1e-3

    def test_resting_on_any_side_as_often_as_it_falls_so(self):
        targets = drawn(900, Rules(pose="rest"), [box(0.1, 0.2, 0.3)])
        heights = np.array([np.ptp(target.vertices[:, 2]) for target in targets])
        angle = 4 * np.arctan(0.1 * 0.15 / (0.05 * np.sqrt(0.01 + 0.0225 + 0.0025)))
        assert np.isclose(heights[:, None], (0.1, 0.2, 0.3)).any(1).all()
        assert stats.binomtest(int(np.isclose(heights, 0.1).sum()), 900, angle / (2 * np.pi)).pvalue > 1e-3

    def test_counts_lie_in_their_range_and_reach_both_ends(self):
        counts = [draw_count(3, 8, seed) for seed in range(300)]
        assert set(counts) == set(range(3, 9)) and stats.chisquare(np.bincount(counts)[3:]).pvalue > 1e-3

    def test_a_seed_means_the_same_targets_however_many_follow(self):
        rules = Rules(spacing=1.0, scale=(1, 30), pose="rest")
        few, many, others = drawn(10, rules), drawn(60, rules), drawn(10, rules, seed=2)
        assert all(np.array_equal(a.vertices, b.vertices) for a, b in zip(few, many))
        assert not any(np.allclose(a.position, b.position) for a, b in zip(few, others))

    def test_one_rule_moves_nothing_else(self):
        plain, buried = drawn(20, Rules(scale=(1, 2))), drawn(20, Rules(scale=(1, 2), burial=(0.2, 0.7)))
        for a, b in zip(plain, buried):
            assert (a.heading, a.scale) == (b.heading, b.scale) and np.array_equal(a.position, b.position)


class TestPlaces:
    def test_circles_keep_their_distance_and_hold_their_targets(self):
        rules = Rules(spacing=1.5, scale=(20, 40), tilt=(0, 0.5), pose="rest", exclude=np.array([[-5, -40, 5, 40]]),
                      area=(-25, -20, 25, 28), along_slope=True)
        taken = np.array([[15.0, 15.0, 6.0]])
        ground = bed(lambda x, y: 0.2 * x - 20 + 0.3 * np.sin(y))
        targets = place([box(0.02, 0.06, 0.04)], ground, rules, count=60, seed=4, taken=taken)
        circles = np.array([(*target.position[:2], target.radius) for target in targets])
        both = np.concatenate((taken, circles))
        gaps = np.hypot(*(both[:, None, :2] - both[:, :2]).transpose(2, 0, 1)) - both[:, 2] - both[:, None, 2]
        assert (gaps[~np.eye(len(both), dtype=bool)] >= 1.5 - 1e-9).all()
        for target, (x, y, radius) in zip(targets, circles):
            out = np.hypot(*(target.vertices[:, :2] - (x, y)).T).max()
            assert out == pytest.approx(radius, rel=1e-6) and abs(x) >= 5 + radius
            assert -25 <= x - radius and x + radius <= 25 and -20 <= y - radius and y + radius <= 28

    def test_no_target_lies_over_a_hole(self):
        grid = bed(lambda x, y: np.where(np.hypot(x, y) < 25, np.nan, -20.0))
        targets = drawn(40, Rules(scale=(20, 20)), ground=grid)
        assert min(np.hypot(*target.position[:2]) for target in targets) > 25
        assert all(np.isfinite(target.vertices).all() for target in targets)

    def test_too_many_are_told_how_many_fit(self):
        with pytest.raises(ValueError, match=r"only \d+ of 500 targets found room on 60 x 60 m .* spacing below 9 m"):
            drawn(500, Rules(spacing=9.0))
        with pytest.raises(ValueError, match="only 0 of 1 targets"):
            drawn(1, Rules(area=(0, 0, 0.01, 0.01)))

    def test_those_without_room_are_left_out_where_that_is_wanted(self):
        """The same targets at the same places as of a draw with room for all, but for those in the way of others."""
        ground = bed(lambda x, y: np.full(np.broadcast(x, y).shape, -20.0))
        def draw(**options):
            return place([drawn(1)[0].body], ground, Rules(spacing=9.0), count=60, seed=3, **options)
        with pytest.raises(ValueError, match="found room"):
            draw()
        kept = draw(crowded="fewer")
        assert 5 < len(kept) < 60 and [each.number for each in kept] == sorted(each.number for each in kept)
        spots = np.array([each.position[:2] for each in kept])
        apart = np.linalg.norm(spots[:, None] - spots[None], axis=-1) + 1e9 * np.eye(len(kept))
        assert apart.min() >= 9.0

    @pytest.mark.parametrize("rules, said", [
        (Rules(scale=(1.0, 5000.0)), "the mesh box is 300 m long at a scale of 5000"),
        (Rules(scale=(0.001, 1.0)), "is 6e-05 m long at a scale of 0.001; .* is the file in metres"),
    ])
    def test_sizes_that_betray_other_units(self, rules, said):
        with pytest.raises(ValueError, match=said):
            drawn(1, rules)


class TestRest:
    @pytest.mark.parametrize("pose", ["upright", "rest", "any"])
    def test_the_share_buried_is_a_share_of_the_height(self, pose):
        for target in drawn(40, Rules(burial=(0.0, 1.0), tilt=(0, 0.3), scale=(5, 20), pose=pose)):
            low, high = target.vertices[:, 2].min(), target.vertices[:, 2].max()
            assert (-20 - low) / (high - low) == pytest.approx(target.burial, abs=1e-9)
            middle = (target.vertices[:, :2].min(0) + target.vertices[:, :2].max(0)) / 2
            assert np.hypot(*(middle - target.position[:2])) < target.radius

    def test_heading_and_tilt_are_those_told(self):
        upright, = drawn(1, Rules(heading=(0.5, 0.5)), [box(0.2, 0.6, 0.4)])
        front = upright.vertices[2] - upright.vertices[0]               # along +y of the mesh
        assert np.allclose(front, 0.6 * np.array([np.sin(0.5), np.cos(0.5), 0]))
        for target in drawn(10, Rules(tilt=(0.3, 0.3)), [box(0.2, 0.6, 0.4)]):
            upward = (target.vertices[1] - target.vertices[0]) / 0.4
            towards = np.sin(target.tilt_heading), np.cos(target.tilt_heading)
            assert np.allclose(upward, (np.sin(0.3) * towards[0], np.sin(0.3) * towards[1], np.cos(0.3)))

    def test_on_a_slope(self):
        ground = bed(lambda x, y: SLOPE[0] * x + SLOPE[1] * y - 20)
        normal = np.array([*-SLOPE, 1]) / np.hypot(np.hypot(*SLOPE), 1)
        for target in drawn(20, Rules(burial=(0.1, 0.5)), [box(1, 2, 0.5)], ground):
            upward = (target.vertices[1] - target.vertices[0]) / 0.5
            assert np.allclose(upward, (0, 0, 1))
            assert target.vertices[:, 2].min() == pytest.approx(target.position @ (0, 0, 1) - 0.5 * target.burial)
            assert target.position[2] == pytest.approx(SLOPE @ target.position[:2] - 20, abs=1e-5)
        for target in drawn(20, Rules(burial=(0.1, 0.5), along_slope=True), [box(1, 2, 0.5)], ground):
            upward = (target.vertices[1] - target.vertices[0]) / 0.5
            assert np.allclose(upward, normal, atol=1e-5)
            above = (target.vertices - target.position) @ normal
            assert -above.min() / np.ptp(above) == pytest.approx(target.burial, abs=1e-4)

    def test_on_ripples_it_lies_at_their_mean_height(self):
        # 2 m of body over ripples of 0.5 m: nine points a side average a sinusoid to a tenth of its amplitude
        ground = bed(lambda x, y: -20 + 0.05 * np.sin(4 * np.pi * x), half=10.0, step=0.05)
        heights = [target.vertices[:, 2].min() for target in drawn(15, Rules(heading=(0, 0)), [box(2, 2, 1)], ground)]
        assert np.abs(np.add(heights, 20)).max() < 0.01
        small = [target.vertices[:, 2].min() for target in drawn(60, bodies=[box(0.02, 0.02, 0.1)], ground=ground)]
        assert np.ptp(small) > 0.08                                    # a small one lies on a crest or in a trough
