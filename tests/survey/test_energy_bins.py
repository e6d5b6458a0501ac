"""Time bins and units of an energy record."""
import numpy as np
import pytest

COUNT, START, LENGTH, SPEED = 40, 0.01, 0.5e-3, 1500.0


@pytest.fixture
def bins(variant):
    from mitsonar.survey.energy.energy_bins import EnergyBins

    return EnergyBins(start=START, length=LENGTH, count=COUNT, sound_speed=SPEED, beam=1e-3, absorption_db=3.0)


def test_a_bin_holds_what_arrives_from_its_beginning_to_its_end(bins):
    import mitsuba as mi

    delay = START + LENGTH * np.array([-0.01, 0.0, 0.99, 1.01, COUNT - 0.01, COUNT + 0.01])
    found, inside = bins.of(mi.Float64(delay), mi.Bool(True))
    np.testing.assert_array_equal(inside.numpy(), [False, True, True, True, True, False])
    np.testing.assert_array_equal(found.numpy()[1:5], [0, 0, 1, COUNT - 1])
    assert not bins.of(mi.Float64(delay), mi.Bool(False))[1].numpy().any()


def test_a_unit_is_worth_the_energy_that_it_stands_for(bins):
    """An echo E that loses α R out and back is E 10^(-2 α R / 10) / unit units, however little that is."""
    import mitsuba as mi

    number = mi.UInt32([0, 20, 39])
    loss_db = 2 * 3.0 * bins.slant_range[[0, 20, 39]]
    units = bins.units(mi.Float([2.0, 2.0, 2.0]), mi.Float(loss_db), number, mi.Bool(True)).numpy()
    np.testing.assert_allclose(units * bins.unit[[0, 20, 39]], 2.0 * 10 ** (-loss_db / 10), rtol=1e-5)
    assert bins.farthest == pytest.approx(0.5 * SPEED * (START + COUNT * LENGTH))


def test_energies_that_are_no_numbers_are_none(bins):
    import mitsuba as mi

    units = bins.units(mi.Float([np.nan, np.inf]), mi.Float(0.0), mi.UInt32([3, 3]), mi.Bool(True)).numpy()
    np.testing.assert_array_equal(units, 0)
