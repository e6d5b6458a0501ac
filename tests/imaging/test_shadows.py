"""The rule of shadow on rows that are drawn by hand: `.` no echo, a digit so many echoes, `b` ten of the bed.

A bin lasts 1 ms. The expected row has `#` in shadow.
"""
import numpy as np
import pytest

from mitsonar.imaging.energy_record import EnergyRecord
from mitsonar.imaging.shadows import FEWEST, labels_of, shadows_of
from mitsonar.imaging.truth import BinTruth


def record(*rows, hides=None):
    """A record of a ping with rows; in `hides`, `x` marks bins in the shadow of the object 2."""
    counts = np.array([[10 if mark == "b" else 0 if mark == "." else int(mark) for mark in row] for row in rows])[None]
    bed = np.array([[mark == "b" for mark in row] for row in rows])[None]
    hidden = np.zeros(counts.shape, np.uint32)
    if hides is not None:
        hidden[0] = 2 * np.array([[mark == "x" for mark in row] for row in hides])
    place = np.where(bed[..., None], 1.0, np.nan) * np.ones(3)
    known = BinTruth(label=np.ones(counts.shape, np.uint32), share=np.ones((1, len(rows), 1, counts.shape[-1])),
                     hidden=np.zeros(counts.shape), object_shadow=hidden, layover=hidden, seabed_place=place)
    numbers = counts.astype(np.uint32)
    return EnergyRecord(intensity=counts.astype(float), depth=place[..., 2], rays=numbers, rays_in_beam=numbers,
                        truth=known)


def drawn(some, pulse=1e-3):
    """The shadows of a record as text."""
    return ["".join(".#"[dark] for dark in row) for row in shadows_of(some, bin_length=1e-3, pulse_length=pulse)[0]]


def test_a_shadow_begins_behind_the_first_return_and_lasts_to_the_next():
    assert drawn(record("...bb...b.b..")) == [".....###.#.##"]


@pytest.mark.parametrize(("pulse", "expected"), [
    (0.4e-3, "...#.##.###."), (2e-3, ".....##.###."), (3e-3, "........###.")])
def test_a_gap_shorter_than_the_pulse_is_no_shadow(pulse, expected):
    assert drawn(record("..b.b..b...b"), pulse) == [expected]


@pytest.mark.parametrize(("count", "shortest"), [(9, 1), (7, 1), (4, 2), (3, 3), (1, 7)])
def test_a_gap_that_few_echoes_leave_by_chance_is_no_shadow(count, shortest):
    """With n echoes in a bin on average, L bins are empty by chance with the probability exp(-n L) < exp(-FEWEST)."""
    assert shortest == np.ceil(FEWEST / count)
    gaps = "".join(str(count) + "." * length for length in range(1, 9)) + str(count)
    dark = "." + "".join("#.."[length < shortest] * length + "." for length in range(1, 9))
    assert drawn(record(gaps)) == [dark]


def test_the_water_behind_a_target_is_no_shadow_but_that_of_an_object_on_the_bed_is():
    rows, hides = ["..55..b..b", "..55..b..b", "......b..b"], ["..........", "....xx....", "....xx...."]
    assert drawn(record(*rows, hides=hides)) == [".......##.", "....##.##.", ".......##."]


def test_a_ping_that_sees_no_bed_begins_with_its_first_echo():
    assert drawn(record("..9..9.", ".......")) == ["...##.#", "......."]


def test_where_nothing_arrives_there_is_no_label():
    assert labels_of(record("..b.b"))[0].tolist() == [[0, 0, 1, 0, 1]]


def test_pings_do_not_depend_on_each_other(monkeypatch):
    """Long records are made in blocks of pings."""
    one, other = record("..b..b."), record("b.1...b")
    both = EnergyRecord(**{name: np.concatenate([getattr(one, name), getattr(other, name)]) for name in (
        "intensity", "depth", "rays", "rays_in_beam")}, truth=BinTruth(**{
            name: np.concatenate([value, vars(other.truth)[name]]) for name, value in vars(one.truth).items()}))
    for work in (1, 1 << 18):
        monkeypatch.setattr("mitsonar.imaging.shadows.WORK", work)
        found = shadows_of(both, bin_length=1e-3, pulse_length=0.0)
        assert found.dtype == np.uint8
        for ping, alone in enumerate((one, other)):
            assert np.array_equal(found[ping], shadows_of(alone, bin_length=1e-3, pulse_length=0.0)[0])
