"""Pock marks, drag marks and sand ribbons against closed forms.

Volumes by sums over a grid whose step is 1/40 of the feature: the trapezium rule is good to 1e-3 for shapes that end
with zero slope. Numbers and mean volumes of random marks: within 4 standard deviations of their Poisson numbers.
"""
import numpy as np
import pytest

from mitsonar.scattering import DragMarks, PockMarks, Relief, SandRibbons

AXIS = np.arange(-400, 401) * 0.1
MARKS = [PockMarks(density=0.01, diameter=3.0, depth=0.3, seed=2),
         DragMarks(density=0.004, width=0.8, depth=0.2, length=20.0, heading=0.6, seed=4),
         SandRibbons(spacing=9.0, height=0.2, width=4.0, heading=0.3, wander=0.8, seed=6)]


def of_one(relief, mark):
    """Let a relief have one mark."""
    object.__setattr__(relief, "_marks", lambda x, y: iter([mark]))
    return relief


@pytest.mark.parametrize("relief", MARKS, ids=lambda relief: type(relief).__name__)
class TestEveryMark:
    def test_a_longer_bed_shows_more_of_the_same(self, relief):
        whole, part = relief.on_grid(AXIS, AXIS), relief.on_grid(AXIS[200:500], AXIS[100:300])
        assert isinstance(relief, Relief) and part.any()
        np.testing.assert_allclose(whole[100:300, 200:500], part, rtol=0, atol=1e-12)

    def test_another_seed_is_another_bed(self, relief):
        other = type(relief)(**{**vars(relief), "seed": 11})
        assert not np.allclose(relief.on_grid(AXIS, AXIS), other.on_grid(AXIS, AXIS))

    def test_a_finer_grid_has_the_same_heights_at_the_same_places(self, relief):
        fine = np.arange(-400, 401) * 0.05
        np.testing.assert_allclose(relief.on_grid(fine, fine)[::2, ::2], relief.on_grid(fine[::2], fine[::2]),
                                   rtol=0, atol=1e-12)


def test_a_pock_mark_has_its_depth_and_volume():
    heights = of_one(PockMarks(density=1e-3, diameter=4.0, depth=0.5), (np.array([1.0, -2.0]), 1.0)).on_grid(AXIS, AXIS)
    assert heights.min() == pytest.approx(-0.5, abs=1e-12)
    assert heights[np.ix_(AXIS == AXIS[380], AXIS == AXIS[410])] == pytest.approx(-0.5, abs=1e-9)    # y -2, x 1
    assert -heights.sum() * 0.01 == pytest.approx(np.pi * 0.5 * 4.0**2 / 12, rel=1e-3)
    assert (heights < 0).sum() * 0.01 == pytest.approx(np.pi * 2.0**2, rel=0.01)


def test_as_many_pock_marks_as_asked():
    # few overlap: 3e-3 of the bed is covered; E[k^3] = 1 + spread^2 of a uniform factor k
    axis = np.arange(0, 600, 0.25)
    relief = PockMarks(density=1e-3, diameter=2.0, depth=0.2, spread=0.4, seed=1)
    count = relief.density * axis[-1] ** 2
    volume = np.pi * relief.depth * relief.diameter**2 / 12
    assert -relief.on_grid(axis, axis).sum() * 0.0625 == pytest.approx(count * volume * (1 + 0.4**2),
                                                                        rel=4 * 1.3 / np.sqrt(count))


def test_a_drag_mark_has_its_cross_section():
    relief = of_one(DragMarks(density=1e-5, width=2.0, depth=0.4, length=60.0), (np.zeros(2), np.pi / 2, 60.0, 0.0))
    heights = relief.on_grid(np.arange(-400, 401) * 0.1, np.arange(-400, 401) * 0.05)       # it runs to the east
    across = heights[:, 400]
    assert across.min() == pytest.approx(-0.4, abs=1e-12) and across[400] == across.min()
    assert across.max() == pytest.approx(0.4 * 32 / 243, rel=1e-3)                    # berms at s^2 = 5/3
    assert np.interp(0, across[400:425], np.arange(25) * 0.05) == pytest.approx(1.0, abs=0.01)     # half the width
    area = 32 * np.sqrt(3) / 105 * 0.4 * 2.0
    assert -across.sum() * 0.05 == pytest.approx(area, rel=1e-3)
    assert -heights.sum() * 0.005 == pytest.approx(area * (60 - 2 * 2.0), rel=2e-3)   # the ends fade over two widths


def test_drag_marks_run_along_their_heading():
    axis = np.arange(-400, 401) * 0.25
    heights = DragMarks(density=1e-3, width=1.5, depth=0.3, length=60.0, heading=np.deg2rad(30.0),
                        heading_spread=np.deg2rad(3.0), seed=3).on_grid(axis, axis)
    north, east = np.gradient(heights)
    # the gradient points across the marks: structure tensor
    angle = 0.5 * np.arctan2(2 * (east * north).sum(), (east**2).sum() - (north**2).sum())
    assert np.rad2deg(angle) == pytest.approx(-30.0, abs=2.0)


def test_crossing_marks_are_as_deep_as_the_deeper():
    for relief in (PockMarks(density=0.05, diameter=4.0, depth=0.3, spread=0.0),
                   DragMarks(density=0.02, width=0.8, depth=0.3, length=30.0, heading_spread=1.0)):
        assert relief.on_grid(AXIS, AXIS).min() >= -0.3 - 1e-12


def test_sand_ribbons_have_their_spacing_height_and_width():
    x = np.arange(-2000, 2000) * 0.01
    heights = SandRibbons(spacing=10.0, height=0.4, width=6.0).on_grid(x, np.array([0.0, 1.0]))    # they run north
    assert np.allclose(heights[0], heights[1], atol=1e-12) and heights[0, 2000] == pytest.approx(0.4)
    assert np.allclose(heights[0, :1000], heights[0, 1000:2000], atol=1e-12)
    assert heights[0].mean() == pytest.approx(8 / 15 * 0.4 * 6 / 10, rel=1e-4)
    assert (heights[0] > 0).mean() == pytest.approx(0.6, abs=2e-3)


def test_no_marks_of_no_density():
    assert not PockMarks(density=0.0, diameter=3.0, depth=0.3).on_grid(AXIS, AXIS).any()
    assert not DragMarks(density=0.0, width=0.5, depth=0.1, length=20.0).on_grid(AXIS, AXIS).any()


@pytest.mark.parametrize("make, said", [
    (lambda: PockMarks(density=-1.0, diameter=2.0, depth=0.1), "pock marks: density is -1.0"),
    (lambda: PockMarks(density=0.5, diameter=2.0, depth=0.1), "at most 0.25 per m^2 for marks of 2 m"),
    (lambda: PockMarks(density=0.01, diameter=2.0, depth=1.0), "from 0 to 0.65 m, or its sides would be steeper"),
    (lambda: DragMarks(density=0.01, width=1.0, depth=0.6, length=20.0), "depth is 0.6; it must be from 0 to 0.5 m"),
    (lambda: DragMarks(density=0.01, width=1.0, depth=0.2, length=2.0), "at least 12 m, 12 widths"),
    (lambda: DragMarks(density=1.0, width=1.0, depth=0.2, length=20.0), "at most 0.05 per m^2"),
    (lambda: SandRibbons(spacing=5.0, height=0.1, width=6.0), "above 0 and at most 5 m, the spacing"),
    (lambda: SandRibbons(spacing=5.0, height=1.0), "sand ribbons: height is 1.0"),
    (lambda: SandRibbons(spacing=5.0, height=0.1, wander=11.0), "at least twice the wander of 11.0 m"),
])
def test_refusals(make, said):
    with pytest.raises(ValueError, match=said.replace("^", r"\^")):
        make()
