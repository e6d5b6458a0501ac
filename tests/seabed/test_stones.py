"""Stones: closed, outward, of enough faces and many shapes."""
import numpy as np
import pytest

from mitsonar.seabed.stones import KINDS, stones

ALL = [(kind, number) for kind in KINDS for number in range(len(stones(kind)))]


def test_at_least_thirty_all_different():
    volumes = [volume(stones(kind)[number]) for kind, number in ALL]
    assert len(ALL) >= 30 and len(set(np.round(volumes, 6))) == len(ALL)


def volume(body):
    a, b, c = body.vertices[body.faces].transpose(1, 0, 2)
    return np.einsum("fi,fi->", a, np.cross(b, c)) / 6


@pytest.mark.parametrize("kind, number", ALL)
def test_stones_are_closed_and_look_outwards(kind, number):
    body = stones(kind)[number]
    edges = np.concatenate((body.faces[:, [0, 1]], body.faces[:, [1, 2]], body.faces[:, [2, 0]]))
    directed = set(map(tuple, edges))
    assert len(directed) == len(edges) and all((end, start) in directed for start, end in directed)
    assert 300 <= len(body.faces) <= 1000
    # star-shaped about its middle: every face looks away from there, so that none is turned or folded
    a, b, c = (body.vertices - (0, 0, body.vertices[:, 2].max() / 2))[body.faces].transpose(1, 0, 2)
    assert (np.einsum("fi,fi->f", a, np.cross(b, c)) > 0).all()
    # of its hull, a stone fills most, and no facet is more than a tenth of its surface
    assert 0.8 < volume(body) / body.hull.volume <= 1
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    assert areas.max() < 0.1 * areas.sum()


def test_stones_are_a_metre_long_and_lie_on_the_ground():
    for kind, number in ALL:
        body = stones(kind)[number]
        assert body.size == pytest.approx(1) and body.vertices[:, 2].min() == pytest.approx(0, abs=1e-12)


def test_all_four_classes_of_zingg_occur():
    for kind in KINDS:
        sides = np.array([np.sort(np.ptp(body.vertices, axis=0)) for body in stones(kind)])
        ratios = sides[:, 1] / sides[:, 2], sides[:, 0] / sides[:, 1]             # b/a, c/b
        classes = {(bool(first > 2 / 3), bool(second > 2 / 3)) for first, second in zip(*ratios)}
        assert len(classes) == 4


def test_angular_stones_have_flat_faces_and_rounded_stones_none():
    # share of the area whose normal lies within 8 degrees of the largest face's neighbourhood
    def flattest(body):
        a, b, c = body.vertices[body.faces].transpose(1, 0, 2)
        normal = np.cross(b - a, c - a)
        area = np.linalg.norm(normal, axis=1)
        normal /= area[:, None]
        return max((area * (normal @ direction > np.cos(np.deg2rad(8)))).sum() for direction in normal) / area.sum()

    rounded, angular = ([flattest(body) for body in stones(kind)] for kind in KINDS)
    assert np.median(angular) > 1.5 * np.median(rounded)
