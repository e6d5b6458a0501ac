"""Doppler factors against kinematics, and classes of factors against the echoes they stand for."""
import numpy as np
import pytest

from mitsonar.signal.doppler import (
    doppler_class,
    doppler_classes,
    glide_of,
    longer_period,
    two_way_doppler,
    two_way_shift,
)
from mitsonar.sonar import cw, hfm, lfm


@pytest.mark.parametrize("speed, factor, shift", [(2, 1.00267023, 801.068), (-5, 0.99335548, -1993.355)])
def test_two_way_factor(speed, factor, shift):
    """c = 1500 m/s, 300 kHz; the reference carries eight decimals and three."""
    assert two_way_doppler(speed, 1500) == pytest.approx(factor, abs=6e-9)
    assert 3e5 * (two_way_doppler(speed, 1500) - 1) == pytest.approx(shift, abs=6e-4)
    assert 3e5 * two_way_shift(speed, 1500, speed) == pytest.approx(shift, abs=6e-4)


def test_small_shifts_keep_their_digits_in_float32():
    out, back, speed = np.float32(1e-3), np.float32(2e-3), np.float32(1500)
    shift = two_way_shift(out, speed, back)
    assert shift.dtype == np.float32 and shift == pytest.approx(3e-3 / 1499.999, rel=3e-7)
    assert longer_period(shift, np.float32(0)) == pytest.approx(1 / (1 + float(shift)) - 1, rel=3e-7)


def test_factor_is_the_ratio_of_time_sent_to_time_heard():
    """Two wave fronts 1 ms apart from a platform that passes a point: their echoes come 1 ms / η apart.

    Exact two-way times by the closed quadratic; bias from the change of direction within 1 ms, 1e-8.
    """
    c, velocity, target = 1500.0, np.array([4.0, 1.0, 0.2]), np.array([60.0, 30.0, -15.0])

    def arrival(start):
        position = velocity * start
        out = target - position
        t_out = np.linalg.norm(out) / c
        w = position + velocity * t_out - target
        wv, rest = w @ velocity, c**2 - velocity @ velocity
        t_back = (wv + np.sqrt(wv**2 + rest * (w @ w))) / rest
        back = w + velocity * t_back
        return (start + t_out + t_back, out @ velocity / np.linalg.norm(out),
                -(back @ velocity) / np.linalg.norm(back))

    first, *speeds = arrival(-5e-4)
    last = arrival(5e-4)[0]
    _, out, back = arrival(0.0)
    assert two_way_doppler(out, c, back) == pytest.approx(1e-3 / (last - first), abs=1e-8)


@pytest.mark.parametrize("pulse", [cw(3e5, 1e-3), lfm(1e5, 2e4, 10e-3), hfm(1e5, 2e4, 10e-3)], ids=lambda p: p.kind)
@pytest.mark.parametrize("bound", [0.02, 0.1])
def test_classes_keep_the_phase(pulse, bound):
    """The passband phase of every echo against that of its class, over the part where both sound."""
    classes = doppler_classes(pulse, 0.998, 1.0067, bound)
    assert np.all(np.diff(classes) > 0)
    worst = 0.0
    for eta in np.linspace(0.998, 1.0067, 41):
        index, delay = doppler_class(eta, classes, pulse)
        time = np.linspace(0.001, 0.999, 201) * pulse.duration / eta
        other = time - delay
        own = pulse.envelope(time, eta) * np.exp(2j * np.pi * pulse.frequency * time)
        its = pulse.envelope(other, classes[index]) * np.exp(2j * np.pi * pulse.frequency * other)
        both = np.abs(its) > 0
        assert np.mean(both) > 0.99
        worst = max(worst, np.abs(np.angle(own[both] / its[both])).max() / (2 * np.pi))
    assert worst <= bound * 1.001
    assert worst > 0.5 * bound                                      # no more classes than needed


@pytest.mark.parametrize("pulse", [lfm(3e5, 2e4, 5e-4), lfm(3e5, -2e4, 5e-4), hfm(3e5, 2e4, 5e-4), lfm(3e5, 4e4, 2e-3)],
                         ids=lambda p: f"{p.kind} {p.bandwidth:.0f} Hz {1e3 * p.duration:g} ms")
def test_a_glide_makes_up_for_what_is_left_of_the_factor(pulse):
    """Compressed echoes at 3 knots, shifted by `Glide.shift`, against their own stretched pulse, relative to the peak.

    Known bias: the ends of the sweep are off by 0.4 % of its length at most, -48 dB of the peak when compressed.
    """
    speed, glide = 1.54 / 1500, glide_of(pulse)
    plain = doppler_classes(pulse, 1 - 2 * speed, 1 + 2 * speed)
    classes = doppler_classes(pulse, 1 - 2 * speed, 1 + 2 * speed, glide=glide)
    assert len(classes) <= len(plain)
    rate, samples = 64 * pulse.bandwidth, 1 << 15
    frequency = np.fft.fftfreq(samples, 1 / rate)
    replica = np.conj(pulse.spectrum(rate, samples))

    def compressed(factor, late, turn):
        wave = pulse.spectrum(rate, samples, factor) * np.exp(-2j * np.pi * (frequency + pulse.frequency) * late)
        return np.fft.ifft(wave * replica * np.exp(2j * np.pi * turn))

    worst = 0.0
    for eta in np.linspace(1 - 1.99 * speed, 1 + 1.99 * speed, 9):
        factor = classes[np.abs(classes - eta).argmin()]
        late, turn = glide.shift(longer_period(eta - 1, factor - 1), factor)
        late += 0.5 * pulse.duration * (1 / eta - 1 / factor)
        own = compressed(eta, 0.0, 0.0)
        worst = max(worst, np.abs(compressed(factor, late, turn) - own).max() / np.abs(own).max())
    assert 20 * np.log10(worst) < -44


def test_what_does_not_sweep_has_no_glide():
    assert glide_of(cw(1e5, 1e-3)) is None


def test_one_class_is_enough_for_one_factor():
    pulse = lfm(1e5, 2e4, 10e-3)
    assert doppler_classes(pulse, 1.0, 1.0).tolist() == [1.0]
    index, delay = doppler_class(np.ones(3), [1.0], pulse)
    assert index.tolist() == [0, 0, 0] and delay.tolist() == [0, 0, 0]


@pytest.mark.parametrize("lowest, highest, error", [(1.1, 1.0, 0.02), (0, 1, 0.02), (1, np.nan, 0.02), (1, 1, 0)])
def test_impossible_ranges_are_refused(lowest, highest, error):
    with pytest.raises(ValueError, match="Doppler classes"):
        doppler_classes(cw(1e5, 1e-3), lowest, highest, error)
