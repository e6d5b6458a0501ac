"""Statistics of pictures: made-up ones of known speckle, and a real record.

Made up: 256 pings of 384 samples of 5 cm; the first return at sample 100 (5 m), water at -35 dB, Rayleigh speckle. A
complex field that is averaged over n neighbours has the intensity correlation ((n - k) / n)² at lag k; that of
Rayleigh amplitudes is 0.92 of it to its power of about 1.02 (Lord 1954), which a tenth of the value allows for.
"""
from pathlib import Path

import numpy as np
import pytest

from mitsonar.imaging.picture_statistics import first_return, measure, open_bed
from mitsonar.io.xtf.amplitudes import read_amplitudes

REAL = Path(__file__).resolve().parents[2] / "../shared/data/measured/sidescan/scotsman_600khz.xtf"
PINGS, SAMPLES, FIRST, SPACING = 256, 384, 100, 0.05


def picture(smooth_pings=1, smooth_range=1, seed=3):
    """Rayleigh amplitudes over a water column, (P, N)."""
    random = np.random.default_rng(seed)
    size = PINGS + smooth_pings - 1, SAMPLES + smooth_range - 1
    field = random.standard_normal(size) + 1j * random.standard_normal(size)
    field = np.lib.stride_tricks.sliding_window_view(field, (smooth_pings, smooth_range)).mean((2, 3))
    amplitude = np.abs(field) / np.sqrt(np.mean(np.abs(field) ** 2))
    amplitude[:, :FIRST] *= 10 ** (-35 / 20)
    return amplitude


def test_uncorrelated_speckle_is_rayleigh_and_white():
    found = measure(picture(), SPACING)
    assert found.variation == pytest.approx(np.sqrt(4 / np.pi - 1), abs=0.015)
    for correlation in (found.ping_correlation, found.range_correlation, found.range_intensity_correlation):
        assert np.abs(correlation).max() < 0.04
    np.testing.assert_allclose(found.ping_spectrum, 1, atol=0.2)
    rayleigh = np.sqrt(-np.log(1 - np.array([0.1, 0.5, 0.9]))) * np.sqrt(4 / np.pi)
    np.testing.assert_allclose(found.quantiles[1:4], rayleigh, atol=0.05)
    assert found.windows > 150 and found.shadows == 0 and np.isnan(found.shadow_db).all()


def test_correlation_along_each_axis_is_that_of_its_averages():
    found = measure(picture(smooth_pings=3, smooth_range=2), SPACING)
    np.testing.assert_allclose(found.ping_intensity_correlation[:3], [4 / 9, 1 / 9, 0], atol=0.05)
    np.testing.assert_allclose(found.range_intensity_correlation[:2], [1 / 4, 0], atol=0.05)
    assert found.ping_correlation[0] == pytest.approx(0.42, abs=0.05)
    assert found.ping_spectrum[0] < 0.6 < 1.2 < found.ping_spectrum[-1]


def test_a_slow_change_of_the_bed_is_texture_and_not_correlation():
    slow = 1 + 0.5 * np.sin(2 * np.pi * np.arange(PINGS) / 128)[:, None]
    found = measure(picture() * slow, SPACING)
    assert found.ping_correlation[0] < 0.06 and found.ping_texture > 0.15


def test_a_gain_over_range_changes_no_ratio():
    gain = 1 + np.arange(SAMPLES) / 100
    plain, raised = measure(picture(), SPACING), measure(picture() * gain, SPACING)
    assert raised.variation == pytest.approx(plain.variation, abs=0.01)
    assert raised.range_correlation[0] == pytest.approx(plain.range_correlation[0], abs=0.02)
    assert raised.water_db == pytest.approx(plain.water_db, abs=8)


def test_water_column_first_return_and_shadow_are_as_deep_as_they_were_made():
    amplitude = picture()
    amplitude[:, FIRST:FIRST + 6] *= 10 ** (9 / 20)
    amplitude[100:130, 200:260] *= 10 ** (-18 / 20)
    found = measure(amplitude, SPACING)
    assert np.abs(first_return(amplitude, SPACING) - FIRST).max() <= 3
    assert found.water_db == pytest.approx(-35, abs=1)
    assert found.peak_db == pytest.approx(9, abs=2) and found.rise < 0.3
    assert found.shadow_db[1] == pytest.approx(18, abs=1) and 800 < found.shadows < 1800
    open_ = open_bed(amplitude, SPACING)
    assert not open_[104:126, 205:255].any() and not open_[:, :FIRST].any() and open_[180:, 200:].mean() > 0.9


def test_steps_and_a_full_scale_are_counted():
    found = measure(np.minimum(np.round(20 * picture()), 40), SPACING)
    assert found.values == 41 and found.saturated == pytest.approx(np.exp(-4) * 0.74, abs=0.006)


def test_the_dynamic_range_of_8_bits_with_zeros_is_that_of_their_steps():
    """From 1 to 255 steps are 48 dB; what is recorded as 0 has no level."""
    found = measure(np.clip(np.round(60 * picture()), 0, 255), SPACING)
    assert 40 < found.dynamic_range_db <= 20 * np.log10(255)


@pytest.mark.parametrize(("amplitude", "words"), [
    (np.ones((20, 400)), "at least 64"), (-picture(), "not decibels"), (np.ones((100, 400)), "no first return")])
def test_what_is_no_picture_is_refused(amplitude, words):
    with pytest.raises(ValueError, match=words):
        measure(amplitude, SPACING)


@pytest.mark.skipif(not REAL.is_file(), reason="the shared sidescan record is not here")
def test_a_real_record():
    """600 kHz: Known figures with the bed's texture in, 0.30 to 0.43 and 0.41 to 0.49; most of it is no speckle."""
    record = read_amplitudes(REAL)
    assert dict(record.sizes) == {"ping": 461, "side": 2, "range": 1024}
    assert record["altitude"][100] == pytest.approx(8.46) and record["range"][-1] == pytest.approx(29.97, abs=0.01)
    for side in ("port", "starboard"):
        found = measure(record["amplitude"].sel(side=side).values, float(record["range"].diff("range").mean()))
        assert 0.30 < found.ping_texture < 0.43 and 0.41 < found.range_texture < 0.49
        assert 0.05 < found.ping_correlation[0] < 0.15 and 0.2 < found.range_correlation[0] < 0.3
        assert 0.40 < found.variation < 0.48 and found.water_db < -30
