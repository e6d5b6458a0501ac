"""Delay and turn of a compressed pulse whose Doppler factor is a little off: of every pulse, against its own spectra.

The filter is that of the pulse's class, as the rows of beams and the classes of element signals have it.

The reference is the compressed pulse at the other factor, by FFT of the pulse's true spectra. A delay and a phase
cannot make good a change of shape, so the error that stays grows with f0 d T (cw) and f0 d / B (sweeps).
"""
import numpy as np
import pytest
from scipy import fft

from mitsonar.signal.doppler import residual_doppler
from mitsonar.sonar.pulses.pulses import PULSES

SWEPT = {"cw": (), "lfm": (20e3,), "hfm": (20e3,)}
CASES = [(kind, window, duration) for kind in PULSES for window in (None, "hann", ("tukey", 0.2))
         for duration in (0.3e-3, 2e-3)]


def pulse_of(kind, window, duration):
    return PULSES[kind](300e3, *SWEPT[kind], duration, window=window)


def compressed(pulse, residual, class_shift):
    """The pulse at a factor through the filter of its class, what stands for it, and the same uncorrected."""
    rate = 3 * pulse.suggested_sampling_rate
    length = fft.next_fast_len(int(6 * pulse.duration * rate))
    f, of_class = fft.fftfreq(length, 1 / rate), pulse.spectrum(rate, length, 1 + class_shift)
    shift = (1 + residual) * (1 + class_shift) - 1
    delay, phase = residual_doppler(pulse).shift(shift, class_shift)
    turn = np.exp(2j * np.pi * (phase - f * delay))
    return fft.ifft([pulse.spectrum(rate, length, 1 + shift) * np.conj(of_class), np.abs(of_class) ** 2 * turn,
                     np.abs(of_class) ** 2], axis=1)


@pytest.mark.parametrize("class_shift", [0.0, -2e-3])
@pytest.mark.parametrize(("kind", "window", "duration"), CASES)
def test_delay_and_phase_stand_for_the_rest_of_an_echos_doppler(kind, window, duration, class_shift):
    pulse = pulse_of(kind, window, duration)
    for residual in (-2e-4, 3e-5, 1e-4):
        moved = pulse.frequency * abs(residual)
        wanted, found, plain = compressed(pulse, residual, class_shift)
        error, before = (np.abs(wanted - one).max() / np.abs(plain).max() for one in (found, plain))
        assert error < max(2.5e-3, 1.1 * moved * pulse.duration if kind == "cw" else 1.5 * moved / 20e3 * (
            1 + pulse.duration / 0.5e-3))
        assert error < 0.35 * before


def test_an_lfm_is_late_by_its_shift_over_its_sweep():
    """In the large of time times band: f_d T/B, from which 10 cycles' ends differ by 7 %, 40 cycles' by less."""
    for duration, within in ((0.5e-3, 0.08), (2e-3, 0.06)):
        pulse = PULSES["lfm"](300e3, 20e3, duration)
        found = residual_doppler(pulse)
        for residual in (1e-5, -1e-4, 5e-4):
            shift = pulse.frequency * residual
            delay, phase = found.shift(residual, 0.0)
            assert delay == pytest.approx(-shift * duration / 20e3, rel=within)
            assert phase == pytest.approx(0.5 * shift * duration, rel=within)
        down = residual_doppler(PULSES["lfm"](300e3, -20e3, duration))
        assert down.shift(1e-4, 0.0)[0] == pytest.approx(300e3 * 1e-4 * duration / 20e3, rel=within)


def test_a_cw_turns_and_stays():
    pulse = PULSES["cw"](300e3, 0.5e-3)
    delay, phase = residual_doppler(pulse).shift(1e-4, 0.0)
    assert phase == pytest.approx(0.5 * 300e3 * 1e-4 * 0.5e-3, rel=1e-3)
    assert abs(delay) < 1e-7
    assert residual_doppler(pulse).shift(0.0, 0.0) == (0, 0)


@pytest.mark.parametrize("window, error_db", [(None, -24), ("hann", -28)])
@pytest.mark.parametrize("cycles", [0.3, 1.0, 2.0, 3.0, 6.0])
def test_a_sweep_of_few_cycles_is_as_good_as_a_cw(window, error_db, cycles):
    """At f_d T = 0.05, where a cw is off by -28 dB without a window; the sweep's own shift would leave -9 dB."""
    pulse = PULSES["lfm"](300e3, cycles / 1e-3, 1e-3, window=window)
    wanted, found, plain = compressed(pulse, 0.05 / 300, 0.0)
    assert 20 * np.log10(np.abs(wanted - found).max() / np.abs(plain).max()) < error_db
