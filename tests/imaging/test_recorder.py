"""What receiver and recorder make of a sidescan's echoes: the other side, steps, full scale, the line at range zero."""
import numpy as np
import pytest

from mitsonar.imaging.recorder import Recorder, leaked, leaked_pressure, recorded

TIME = np.arange(400) * 1e-5
LOUD = 1e12                        # [µPa²]


def db(power):
    return 10 * np.log10(power)


def test_a_recorder_without_faults_keeps_everything():
    intensity = np.random.default_rng(1).exponential(size=(3, 2, 400))
    pressure = intensity + 1j * intensity[::-1]
    assert leaked(intensity, Recorder()) is intensity and leaked_pressure(pressure, Recorder()) is pressure
    assert recorded(intensity, Recorder(), TIME) is intensity


def test_each_side_has_the_other_at_the_sum_of_both_leaks():
    intensity = np.zeros((1, 2, 5))
    intensity[0, 0, 2] = 1.0
    found = leaked(intensity, Recorder(back=1e-3, crosstalk=1e-4))
    assert found[0, 1].tolist() == pytest.approx([0, 0, 1.1e-3, 0, 0]) and (found[0, 0] == intensity[0, 0]).all()


def test_leaked_pressures_have_the_mean_of_leaked_intensities():
    random = np.random.default_rng(2)
    intensity = np.stack([np.full((1, 40_000), 4.0), np.full((1, 40_000), 1e4)], 1)
    recorder = Recorder(back=2e-3)
    z = np.sqrt(0.5 * intensity) * (random.standard_normal(intensity.shape)
                                    + 1j * random.standard_normal(intensity.shape))
    found = np.mean(np.abs(leaked_pressure(z, recorder)) ** 2, -1)
    assert found == pytest.approx(leaked(intensity, recorder)[..., 0], rel=0.03)
    # the same scatterers: a copy of the other side, not another draw
    assert np.abs(np.corrcoef(leaked_pressure(z, recorder)[0])[0, 1]) > 0.9


@pytest.mark.parametrize("bits", [8, 12])
def test_samples_are_the_middles_of_steps_of_the_full_scale(bits):
    step = 1e6 / 2 ** bits
    amplitude = np.linspace(0, 0.999e6, 400)
    found = np.sqrt(recorded(amplitude ** 2, Recorder(bits=bits, full_scale=LOUD), TIME))
    assert np.abs(found - amplitude).max() <= 0.5 * step * (1 + 1e-9)
    assert found / step % 1 == pytest.approx(0.5)
    assert np.unique(found).size > 100


def test_louder_echoes_than_the_full_scale_are_cut_to_it():
    found = recorded(np.array([1.0, 100.0]) * LOUD, Recorder(bits=12, full_scale=LOUD), TIME[:2])
    assert db(found / LOUD) == pytest.approx([0, 0], abs=2e-3)


def test_the_transmission_is_a_line_at_range_zero_that_rings_away():
    recorder = Recorder(bits=24, full_scale=LOUD, blind=5e-5, ringing=2e-3)
    level = db(recorded(np.zeros(400), recorder, TIME) / LOUD)
    assert level[:6] == pytest.approx(np.zeros(6), abs=1e-4)
    assert level[105] == pytest.approx(-30, abs=0.05) and level[205] == pytest.approx(-60, abs=0.05)


@pytest.mark.parametrize("wrong", [{"back": 2.0}, {"crosstalk": -1.0}, {"bits": 8}, {"bits": -1}])
def test_recorders_that_are_none_are_refused(wrong):
    with pytest.raises(ValueError, match="give"):
        Recorder(**wrong)
