"""Scour about footprints against closed forms: depth, volume of the moat and the heap, and which way they lie.

Sums over a grid of 4 cm about a circle of 48 corners: its area is 3e-3 below a circle's, and sums are good to 2e-3;
the tolerance is 8e-3.
"""
import numpy as np
import pytest

from mitsonar.seabed.scour import Footprint, Scour
from mitsonar.seabed.stones import stones

TURN = 2 * np.pi * np.arange(48) / 48
ROUND = Footprint(corners=np.column_stack((np.cos(TURN), np.sin(TURN))), height=0.8)     # radius 1 m
AXIS = np.arange(-250, 251) * 0.04
X, Y = (part.ravel() for part in np.meshgrid(AXIS, AXIS))


def cut(scour, footprint=ROUND):
    moat, heap = scour.cut(footprint, X, Y)
    return moat.reshape(501, 501), heap.reshape(501, 501)


def test_a_moat_has_its_depth_extent_and_volume():
    moat, heap = cut(Scour(depth=0.5, extent=2.0, tail=2.0, heap=0.0))
    away, extent = np.hypot(X, Y).reshape(moat.shape), 2.0 * 0.8
    assert not heap.any() and moat.min() == pytest.approx(-0.5 * 0.8, rel=2e-3)
    assert away.flat[moat.argmin()] == pytest.approx(1 + extent / 2, abs=0.05)
    assert not moat[away < 0.99].any() and not moat[away > 1.01 + extent].any()
    volume = 2 * np.pi * 0.4 * extent * (8 / 15 + 4 / 15 * extent)
    assert -moat.sum() * 0.04**2 == pytest.approx(volume, rel=8e-3)


def test_a_heap_has_its_height_and_volume():
    _, heap = cut(Scour(depth=0.3, extent=2.0, tail=6.0, heap=0.25))
    assert heap.max() == pytest.approx(0.25 * 0.8, rel=3e-3)
    assert heap.sum() * 0.04**2 == pytest.approx(np.pi / 3 * 0.2 * 1.0 * (6 * 0.8 / 2), rel=8e-3)


@pytest.mark.parametrize("heading", [0, 90, 225])
def test_the_tail_and_the_heap_lie_downstream(heading):
    moat, heap = cut(Scour(depth=0.5, extent=2.0, tail=4.0, heading=np.deg2rad(heading)))
    ahead = (X * np.sin(np.deg2rad(heading)) + Y * np.cos(np.deg2rad(heading))).reshape(moat.shape)
    assert ahead[heap > 0].min() > 0.99 and ahead[heap > 0].max() == pytest.approx(1 + 4 * 0.8, abs=0.08)
    assert ahead[moat < 0].max() > 1 + 3 * 0.8 and ahead[moat < 0].min() == pytest.approx(-1 - 2 * 0.8, abs=0.08)
    assert heap.max() == pytest.approx(0.25 * 0.8, rel=3e-3)                                # half the depth by default


def test_a_slender_pile_scours_by_its_width_a_low_plate_by_its_height():
    pile = Footprint(corners=0.1 * ROUND.corners, height=5.0)
    plate = Footprint(corners=ROUND.corners, height=0.1)
    scour = Scour(depth=0.6, extent=2.0, tail=2.0, heap=0.0)
    assert scour.width(pile) == pytest.approx(0.4, rel=2e-3) and scour.width(plate) == pytest.approx(0.2)
    assert scour.cut(pile, np.array([0.3]), np.array([0.0]))[0] == pytest.approx(-0.12, rel=0.01)


def test_nothing_changes_beyond_the_reach():
    for scour in (Scour(depth=0.5, heading=0.4), Scour(depth=0.2, extent=1.0, tail=9.0)):
        middle, radius = scour.reach(ROUND)
        moat, heap = scour.cut(ROUND, X, Y)
        assert not (moat + heap)[np.hypot(X - middle[0], Y - middle[1]) > radius].any()


def test_footprints_are_the_lower_half_without_parts_far_away():
    block = np.array([[x, y, z] for z in (0, 1) for y in (-1, 1) for x in (-2, 2)], float)
    faces = np.array([[0, 1, 3], [0, 3, 2], [4, 5, 7], [4, 7, 6]])
    mark = Footprint.of(block, faces, -0.2)
    assert mark.height == pytest.approx(1.2)
    assert np.allclose(np.ptp(mark.corners, axis=0), (4, 2)) and len(mark.corners) == 4
    mast, splinter = block[:4] * 0.1 + (0, 0, 3), block[:4] * 0.05 + (30, 0, 0)
    debris = Footprint.of(np.concatenate((block, mast, splinter)), np.concatenate((faces, faces[:2] + 8,
                                                                                   faces[:2] + 12)), 0.0)
    assert np.allclose(np.ptp(debris.corners, axis=0), (4, 2)) and debris.height == 3
    assert Footprint.of(block, faces, 1.5) is None
    tripod = np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1], [0, 0, 0]], float)            # one corner below
    assert len(Footprint.of(tripod, np.zeros((0, 3), int), 0.0).corners) == 3


def test_a_stone_stands_on_ground_that_stays():
    body = stones("rounded_stone")[3]
    mark = Footprint.of(body.vertices, body.faces, 0.1)
    moat, _ = Scour(depth=0.4).cut(mark, *body.vertices[body.vertices[:, 2] < 0.3, :2].T)
    assert moat == pytest.approx(0, abs=0.01)


@pytest.mark.parametrize("attributes, said", [
    ({"depth": 1.0, "extent": 2.0}, "from 0 to 0.65 at an extent of 2"),
    ({"depth": 0.1, "extent": 0.0}, "extent is 0.0"),
    ({"depth": 0.1, "extent": 3.0, "tail": 2.0}, "tail is 2.0; it must be at least 3, the extent"),
    ({"depth": 0.1, "heap": -1.0}, "heap is -1.0"),
])
def test_refusals(attributes, said):
    with pytest.raises(ValueError, match=said):
        Scour(**attributes)
