"""Truth of the bins on hand-built sums: shares, shadows, and the runs of sectors that make layover."""
from functools import partial

import numpy as np
import pytest

from mitsonar.echoes.sums.origin_sums import runs
from mitsonar.imaging import truth
from mitsonar.imaging.sidescan import mean_intensity
from mitsonar.scene.labels import ShapeLabels, classes_of, fingerprint
from mitsonar.signal.gates import pulse_shares

GATES = {"shorter than a bin": pulse_shares(1.0, 0.7), "of three bins": pulse_shares(1.0, 3.0)}


@pytest.mark.parametrize("gate", GATES.values(), ids=GATES)
def test_shares_add_to_one_where_something_is_heard_and_are_nothing_elsewhere(gate):
    random = np.random.default_rng(1)
    intensity = random.exponential(size=(6, 4, 40)) * (random.random((6, 4, 40)) < 0.3)
    intensity[..., 20:] = 0
    share = truth.shares(intensity, partial(mean_intensity, shares=gate))
    total = share.sum(1)
    assert (np.abs(total[total > 0] - 1) < 1e-6).all()
    np.testing.assert_array_equal(total[:, 24:], 0)
    assert (total > 0).any(0)[:20].all()


def test_a_pulse_longer_than_a_bin_takes_its_echo_along():
    """One echo of instance 2 in bin 10: under a pulse of 3 bins it is the whole of the bins 9 to 11."""
    intensity = np.zeros((1, 2, 20))
    intensity[0, 1, 10] = 1
    share = truth.shares(intensity, partial(mean_intensity, shares=pulse_shares(1.0, 3.0)))
    np.testing.assert_array_equal(np.flatnonzero(share[0, 1]), [9, 10, 11])


def test_what_has_a_phase_is_shared_out_by_power():
    """Bed 1, and coherent echoes of together 3 of two bodies whose powers are as 1 to 2: shares 1/4, 1/4, 2/4."""
    intensity, power = np.zeros((1, 3, 5)), np.zeros((1, 3, 5))
    intensity[0, 0] = 1
    power[0, 1:, 2] = 10, 20
    share = truth.shares(intensity, np.asarray, power, np.array([[0, 0, 3.0, 0, 0]]))[0]
    np.testing.assert_allclose(share[:, 2], [0.25, 0.25, 0.5], rtol=1e-6)
    np.testing.assert_array_equal(share[:, 1], [1, 0, 0])


def test_what_has_a_phase_and_lasts_into_the_next_bin_is_still_its_own():
    """A body's echo in bin 2 whose pulse reaches bin 3, where its power is not counted; bin 1 hears the bed alone."""
    intensity, power = np.zeros((1, 2, 5)), np.zeros((1, 2, 5))
    intensity[0, 0], power[0, 1, 2] = 1, 50
    share = truth.shares(intensity, np.asarray, power, np.array([[0, 0, 40.0, 9.0, 0]]))[0, 1]
    np.testing.assert_allclose(share, [0, 0, 40 / 41, 0.9, 0], rtol=1e-6)


def test_a_shadow_is_where_an_object_hides_more_than_half_and_nothing_takes_its_place():
    hidden = np.zeros((1, 3, 5))
    hidden[0, 1] = 0, 4, 6, 6, 0
    hidden[0, 2, 3] = 7
    bed = np.array([[10.0, 6, 4, 0, 0]])
    arriving = np.array([[10.0, 6, 4, 0, 0]]) + np.array([[0, 0, 0, 0, 5.0]])
    share, shadow = truth.shadows(hidden, bed, arriving, np.asarray)
    np.testing.assert_allclose(share[0], [0, 0.4, 0.6, 1, 0], rtol=1e-6)
    np.testing.assert_array_equal(shadow[0], [0, 0, 2, 3, 0])
    bright = truth.shadows(hidden, bed, arriving + 3, np.asarray)[1]      # bins that something else brightens are none
    np.testing.assert_array_equal(bright[0], [0, 0, 0, 3, 0])
    glint = truth.shadows(hidden, bed, arriving, np.asarray, np.array([[0, 0, 0, 9.0, 0]]))[1]       # nor what glints
    np.testing.assert_array_equal(glint[0], [0, 0, 2, 0, 0])


def test_runs_of_bits_are_counted_across_words():
    random = np.random.default_rng(2)
    bits = random.random((50, 256)) < random.random((50, 1))
    words = np.packbits(bits, axis=1, bitorder="little").view("<u8").astype(np.uint64)
    closed = bits.copy()
    closed[:, 1:-1] |= bits[:, :-2] & bits[:, 2:]                          # a single zero between ones does not count
    expected = (np.diff(closed.astype(int), axis=1, prepend=0) == 1).sum(1)
    np.testing.assert_array_equal(runs(words), expected)


def test_classes_are_what_stands_before_the_first_dot():
    classes, class_of = classes_of({1: "cylinder.1", 2: "cylinder.mines.2", 3: "seabed", 4: ".odd"})
    assert classes == {1: ".odd", 2: "cylinder", 3: "seabed"}
    assert class_of == {1: 2, 2: 2, 3: 3, 4: 1}


class _Shape:
    """As much of a shape as labels ask for."""

    def __init__(self, name, **attributes):
        self.name = name
        self.__dict__.update(attributes)

    def id(self):
        return self.name

    def class_name(self):
        return "Mesh"


def test_parts_of_a_mesh_are_instances_of_their_own():
    mines = _Shape("mines", part_names=("tyre.mines.2", "bed.mines.1"), part_of_face=np.array([0, 0, 1]))
    named = ShapeLabels([_Shape("area", seabed=True), mines, _Shape("top", sea_surface=True), _Shape(""),
                         _Shape("bed.2")])
    assert named.names == {1: "Mesh", 2: "area", 3: "bed.2", 4: "bed.mines.1", 5: "top", 6: "tyre.mines.2"}
    assert (named.seabed, named.surface, named.objects) == ({2, 3}, 5, {1, 4, 6})
    np.testing.assert_array_equal(named.of_faces(mines, 3), [6, 6, 4])
    np.testing.assert_array_equal(named.label_kinds(), [0, 2, 1, 1, 2, 0, 2])


def test_a_fingerprint_is_of_the_geometry_and_not_of_its_order():
    a = np.zeros((3, 3)), np.array([[0, 1, 2]])
    b = np.ones((3, 3)), np.array([[0, 1, 2]])
    assert fingerprint([a, b]) == fingerprint([b, a])
    assert len({fingerprint([a]), fingerprint([b]), fingerprint([a, b])}) == 3
