"""Recorder of an instrument: every stage of its chain against its closed form."""
from functools import partial

import numpy as np
import pytest
import xarray as xr

from mitsonar.imaging import recorded_levels
from mitsonar.imaging.recorder import (
    LAWS,
    Converter,
    Detector,
    Electronics,
    PingFaults,
    Recorder,
    TimeVariedGain,
    formed_rows,
    interpolated,
)
from mitsonar.imaging.recording import PingRecorder, as_recorded
from mitsonar.imaging.sidescan import peaks, realisation
from mitsonar.signal.gates import envelope_steps, pulse_shares
from mitsonar.units import NOTHING_DB

FULL_DB = 140.0
FINE = Converter(bits=16, full_scale_db=FULL_DB)
BED_DB = FULL_DB - 26.0
PINGS, SIDES, BINS = 60, 2, 500


def picture(level, interval=0.1):
    """A picture over (ping, side, range) with the coordinates that a recorder reads; bins of 0.05 m."""
    pings, _, bins = level.shape
    slant_range = (np.arange(bins) + 0.5) * 0.05
    return xr.Dataset({"level": (("ping", "side", "range"), level.astype(np.float32))},
                      coords={"ping": np.arange(pings), "ping_time": ("ping", interval * np.arange(pings)),
                              "range": slant_range, "time": ("range", slant_range / 750.0)})


def speckled(level_db=BED_DB, shape=(PINGS, SIDES, BINS), seed=1):
    """Levels of independent Rayleigh amplitudes with a mean power."""
    return level_db + 10 * np.log10(np.random.default_rng(seed).exponential(1.0, shape))


def recorded(level, seed=3, **parts):
    """The counts of levels, as shares of full scale, float64."""
    recorder = Recorder(**{"converter": FINE, **parts})
    return PingRecorder(recorder, seed).added(picture(level))["recorded"].values / recorder.converter.highest


def r1(amplitude):
    """Correlation of neighbours in range."""
    x = amplitude - amplitude.mean()
    return np.mean(x[..., 1:] * x[..., :-1]) / np.mean(x * x)


@pytest.mark.parametrize("k", [0.0, 0.055, 0.1, 0.17, 1 / 3])
def test_a_low_pass_ties_the_correlation_of_neighbours_to_the_spread(k):
    """q = (1 - 2k)² + 2k²: r1 = 2k (1 - 2k) / q, and CV² = (4/π - 1) q for Rayleigh amplitudes.

    Of 60,000 samples r1 scatters by 0.004 and CV by 0.002: 4 of these, and 1 % for the ends of the rows.
    """
    q = (1 - 2 * k) ** 2 + 2 * k ** 2
    amplitude = recorded(speckled(), detector=Detector(low_pass=k))
    assert r1(amplitude) == pytest.approx(2 * k * (1 - 2 * k) / q, abs=0.016)
    assert amplitude.std() / amplitude.mean() == pytest.approx(np.sqrt((4 / np.pi - 1) * q), abs=0.008)


@pytest.mark.parametrize("law, spread", [("linear", 0.5227), ("square", 1.0), ("root", 0.2809)])
def test_detectors_have_the_spread_of_their_law(law, spread):
    """The CV² of p^a, of an exponential power p, is Γ(1 + 2a) / Γ(1 + a)² - 1, with a of 1/2, 1 and 1/4.

    60,000 samples leave 0.3 % of CV, 0.7 % for the square: 4 of these."""
    amplitude = recorded(speckled(), detector=Detector(law=law))
    assert amplitude.std() / amplitude.mean() == pytest.approx(spread, rel=0.03 if law == "square" else 0.012)


@pytest.mark.parametrize("window", [2, 3])
def test_a_peak_detector_writes_the_highest_sample_of_a_window_and_repeats_it(window):
    """The highest of n independent exponential powers has the mean 1 + 1/2 + ... 1/n.

    Windows of neighbours share n - 1 of n + 1 samples, so that (n - 1) / (n + 1) of neighbours are equal. 60,000
    samples, of which each is in n windows, leave 0.4 % of the mean and 0.003 of the share: 4 of these, and converter.
    """
    amplitude = recorded(speckled(), detector=Detector(peak=window))
    power = np.mean(amplitude ** 2) * 10 ** ((FULL_DB - BED_DB) / 10)
    assert power == pytest.approx(sum(1 / n for n in range(1, window + 1)), rel=0.02)
    assert np.mean(amplitude[..., 1:] == amplitude[..., :-1]) == pytest.approx((window - 1) / (window + 1), abs=0.012)


@pytest.mark.parametrize("window", [0.0, 1.0, 1.4])
def test_a_window_of_one_sample_changes_no_count(window):
    assert np.array_equal(recorded(speckled(), detector=Detector(peak=window)), recorded(speckled()))


@pytest.mark.parametrize("pulse, cells, steps", [(1.0, 1, 4), (0.5, 2, 2), (3.0, 2, 1)])
def test_a_window_of_one_sample_is_one_realisation_and_wider_ones_repeat(pulse, cells, steps):
    """Bins of 1. A window of 1.5 bins shares half a bin with its neighbour's, of 2.5 in both: 1/5 are equal.

    That holds where the pulse is short beside the window; samples of one pulse are alike, and maxima at the windows'
    edges make it 0.02 less (0.5) and 0.05 less (1).
    """
    random = np.random.default_rng(1)
    intensity, shares = np.full((40, 2, 500), 2.0), pulse_shares(1.0, pulse)
    drawn = random.standard_normal((2, 40, 2, 500 * cells * steps + steps)) * np.sqrt(0.5 / steps)
    z = np.lib.stride_tricks.sliding_window_view(drawn[0] + 1j * drawn[1], steps, -1).sum(-1)[..., :500 * cells * steps]
    speckle = z.reshape(40, 2, 500 * cells, steps)
    generator = partial(np.random.default_rng, 5)
    assert envelope_steps(1.0, pulse) == steps
    if cells == 1 or pulse > 1:
        one = peaks(intensity, shares, speckle, 0.3, generator(), 0.25)
        assert one == pytest.approx(realisation(intensity, shares, speckle[..., 0], 0.3, generator()), rel=1e-12)
    wide = peaks(intensity, shares, speckle, 0.3, generator(), 1.5)
    assert np.all(wide >= peaks(intensity, shares, speckle, 0.3, generator(), 1.0))
    if pulse <= 1:
        assert 0.13 < np.mean(wide[..., 1:] == wide[..., :-1]) < 0.21


def test_a_log_detector_has_even_steps_of_level():
    level = np.broadcast_to(np.linspace(FULL_DB - 70, FULL_DB + 10, BINS), (2, SIDES, BINS))
    amplitude = recorded(level, detector=Detector(law="log", range_db=60.0))
    assert amplitude[0, 0] == pytest.approx(np.clip(1 + (level[0, 0] - FULL_DB) / 60, 0, 1), abs=1 / 65535)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("gain", [
    TimeVariedGain(), TimeVariedGain(spreading=30.0, absorption_db=0.1, start=2.0, end=18.0),
    TimeVariedGain(spreading=40.0, step_db=3.0, sectors_db=(2.0, -4.0))])
def test_counts_lead_back_to_levels(law, gain):
    """Half a step of a count is the error: 20 log (1 ± 1 / 2C) for a linear one, less for root and log."""
    level = speckled() - gain.over((np.arange(BINS) + 0.5) * 0.05) + 20
    recorder = Recorder(converter=FINE, gain=gain, detector=Detector(law=law, range_db=80.0))
    image = PingRecorder(recorder, 0).added(picture(level))
    counts, found = image["recorded"].values, recorded_levels(image).values
    clear = (counts > 300) & (counts < 65535)
    assert clear.mean() > 0.9
    assert np.abs(found - level)[clear].max() < 20 * np.log10(1 + 0.5 / 300) + 2e-3        # and that of float32
    assert (found[counts == 0] == NOTHING_DB).all()


@pytest.mark.parametrize("bits, dtype", [(8, np.uint8), (12, np.uint16), (16, np.uint16), (24, np.uint32)])
def test_counts_fill_the_bits_and_saturate(bits, dtype):
    level = np.broadcast_to(FULL_DB + np.linspace(-120, 20, BINS), (1, SIDES, BINS))
    recorder = Recorder(converter=Converter(bits=bits, full_scale_db=FULL_DB))
    counts = PingRecorder(recorder, 0).added(picture(level))["recorded"].values[0, 0]
    exact = np.minimum(10 ** ((level[0, 0] - FULL_DB) / 20), 1) * (2 ** bits - 1)
    assert counts.dtype == dtype and counts.max() == 2 ** bits - 1
    assert np.abs(counts - exact).max() <= 0.5 + 1e-6 * 2 ** bits      # float32 levels of 140 dB: 8e-6 dB


def test_dither_makes_the_mean_of_few_steps_right():
    """A constant 2.3 steps is always 2 without dither; with it, the mean of 60,000 counts scatters by 0.002."""
    level = np.full((PINGS, SIDES, BINS), FULL_DB + 20 * np.log10(2.3 / 255))
    mean = [recorded(level, converter=Converter(bits=8, full_scale_db=FULL_DB, dither=dither)).mean() * 255
            for dither in (False, True)]
    assert mean[0] == pytest.approx(2, abs=1e-6) and mean[1] == pytest.approx(2.3, abs=0.01)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.8, 1.0])
def test_noise_that_sides_share_correlates_them(share):
    """Intensities of complex Gaussian noise of which a share s is common correlate by s².

    30,000 pairs scatter by 0.006 (0.02 near s = 1, where few loud samples decide): 4 of these.
    """
    silent = np.full((PINGS, SIDES, BINS), NOTHING_DB)
    power = recorded(silent, electronics=Electronics(noise=1e-3 * (1 - share), common_noise=1e-3 * share)) ** 2
    assert power.mean() == pytest.approx(1e-3, rel=0.025)
    assert np.corrcoef(power[:, 0].ravel(), power[:, 1].ravel())[0, 1] == pytest.approx(share ** 2, abs=0.04)


def test_noise_adds_to_echoes_as_powers_do():
    power = recorded(speckled(), electronics=Electronics(noise=2e-3, common_noise=1e-3)) ** 2
    assert power.mean() == pytest.approx(10 ** -2.6 + 3e-3, rel=0.02)


def test_crosstalk_gives_every_row_the_mean_of_all():
    level = np.full((PINGS, SIDES, BINS), NOTHING_DB)
    level[:, 1] = FULL_DB - 20
    power = recorded(level, electronics=Electronics(crosstalk=0.01)) ** 2
    assert power[:, 0].mean() == pytest.approx(0.01 * 0.01 / 2, rel=0.03)                  # 30,000 exponential powers
    assert power[:, 1].mean() == pytest.approx(0.01 * (1 + 0.01 / 2), rel=0.005)


def test_the_transmission_rings_down_by_60_db():
    silent = np.full((1, SIDES, BINS), NOTHING_DB)
    time = (np.arange(BINS) + 0.5) * 0.05 / 750
    electronics = Electronics(line=0.25, line_length=2e-3, ringing=8e-3)
    amplitude = recorded(silent, converter=Converter(bits=24, full_scale_db=FULL_DB), electronics=electronics)[0, 0]
    early = time < 1e-2
    assert 20 * np.log10(amplitude[early]) == pytest.approx(
        10 * np.log10(0.25) - 60 * np.maximum(time - 2e-3, 0)[early] / 8e-3, abs=0.02)


def test_another_sonar_pings_at_its_own_rate():
    """Pulses of 1 ms at 7 Hz are 0.7 % of the time, anywhere in the record."""
    silent = np.full((400, SIDES, BINS), NOTHING_DB)
    electronics = Electronics(interference=1e-2, interference_rate=7.0, interference_length=1e-3)
    image = PingRecorder(Recorder(converter=FINE, electronics=electronics), 3).added(picture(silent, interval=0.0937))
    marked = image["recorded"].values[:, 0] > 0.01 * 65535
    assert marked.mean() == pytest.approx(7e-3 * np.exp(-0.01), rel=0.15)       # each of 90 bursts is 15 samples long
    pings, samples = np.nonzero(marked)
    phase = np.mod(0.0937 * pings + (samples + 0.5) * 0.05 / 750, 1 / 7)
    assert np.ptp(phase) < 1e-3


@pytest.mark.parametrize("name, axis", [("row_gain_db", 1), ("stripe_db", 2)])
def test_gains_of_rows_and_samples_are_the_instruments_own(name, axis):
    """Their rms is as asked, within 4 of its scatter; they stay from run to run, and differ between instruments."""
    shape = (2, 400, 400)
    flat, electronics = np.full(shape, BED_DB), Electronics(**{name: 1.0})
    seeds = [20 * np.log10(recorded(flat, seed=seed, electronics=electronics)) for seed in (1, 2)]
    other = 20 * np.log10(recorded(flat, seed=1, electronics=electronics, serial=1))
    gain = seeds[0].mean(tuple(set(range(3)) - {axis}))
    assert gain.std() == pytest.approx(1.0, rel=4 / np.sqrt(800)) and np.array_equal(*seeds)
    assert abs(np.corrcoef(gain, other.mean(tuple(set(range(3)) - {axis})))[0, 1]) < 0.2


def test_pings_are_lost_repeated_and_brighter_as_often_as_asked():
    """Shares of 0.1 of 2000 pings scatter by 0.007: 4 of these."""
    level = speckled(shape=(2000, 1, 40))
    faults = PingFaults(lost=0.1, repeated=0.1, bright=0.1, bright_db=6.0)
    with_faults, without = recorded(level, faults=faults), recorded(level)
    lost = (with_faults == 0).all((1, 2))
    repeated = ~lost & (with_faults == np.roll(with_faults, 1, 0)).all((1, 2))
    ratio = np.median(with_faults / without, (1, 2))
    assert lost.mean() == pytest.approx(0.1, abs=0.028)
    assert repeated.mean() == pytest.approx(0.09, abs=0.028)             # those after a lost ping look lost, too
    assert (np.abs(20 * np.log10(ratio[~lost & ~repeated]) - 6) < 0.1).mean() == pytest.approx(0.125, abs=0.035)


def test_a_low_pass_along_the_track_correlates_pings():
    """y_p = (1 - m) x_p + m y_(p-1): neighbours correlate by m."""
    amplitude = recorded(speckled(shape=(400, 1, 200)), detector=Detector(along_track=0.4))[20:]
    x = amplitude - amplitude.mean()
    assert np.mean(x[1:] * x[:-1]) / np.mean(x * x) == pytest.approx(0.4, abs=0.015)


def test_decimated_samples_are_repeated():
    amplitude = recorded(speckled(shape=(2, 1, 50)), detector=Detector(decimation=3))[0, 0]
    assert np.array_equal(amplitude, np.repeat(amplitude[::3], 3)[:50]) and len(np.unique(amplitude)) > 10


def test_beams_between_formed_ones_are_interpolated():
    rows = np.arange(12.0)[:, None] ** 2 * np.ones(3)
    formed = formed_rows(12, 4)
    found = interpolated(rows[formed], formed)
    assert formed.tolist() == [0, 4, 8, 11] and np.array_equal(found[formed], rows[formed])
    assert found[2, 0] == pytest.approx(8) and found[10, 0] == pytest.approx(64 + (121 - 64) * 2 / 3)
    assert interpolated(rows, formed_rows(12, 1)) is rows


def test_pictures_of_single_pings_have_the_counts_of_one_of_all():
    recorder = Recorder(converter=FINE, detector=Detector(low_pass=0.1, along_track=0.3),
                        electronics=Electronics(noise=1e-4, common_noise=1e-4, interference=1e-3,
                                                interference_rate=9.0, interference_length=1e-3),
                        faults=PingFaults(gain_db=1.0, lost=0.1, repeated=0.2, bright=0.1))
    image = picture(speckled(shape=(30, SIDES, 80)))
    whole, run = PingRecorder(recorder, 5).added(image)["recorded"].values, PingRecorder(recorder, 5)
    single = [run.added(image.isel(ping=[ping]))["recorded"].values[0] for ping in range(30)]
    assert np.array_equal(whole, single)
    assert not np.array_equal(whole, PingRecorder(recorder, 6).added(image)["recorded"].values)


def test_the_level_of_a_picture_stays_and_that_of_its_counts_keeps_the_gain():
    image = picture(speckled())
    recorder = Recorder(converter=FINE, gain=TimeVariedGain(spreading=30.0))
    found = PingRecorder(recorder, 0, absorption_db=0.05).added(image)
    assert found["level"].identical(image["level"]) and found.attrs["recorder"]["absorption_db"] == 0.05
    drawn = as_recorded(found)["level"].values - found["level"].values
    gain = 30 * np.log10(np.maximum(image["range"].values, 1)) + 0.1 * np.maximum(image["range"].values, 1)
    clear = (found["recorded"].values > 300) & (found["recorded"].values < 65535)
    assert np.abs(drawn - gain)[clear].max() < 0.02


def test_a_picture_without_counts_is_refused():
    with pytest.raises(ValueError, match="holds no recorded counts"):
        recorded_levels(picture(speckled()))


@pytest.mark.parametrize("made, words", [
    (lambda: Converter(bits=0, full_scale_db=140.0), "0 bits"),
    (lambda: Converter(bits=8, full_scale_db=np.nan), "full scale of nan"),
    (lambda: Detector(law="cube"), "one of linear"),
    (lambda: Detector(low_pass=0.4), "low pass of 0.4"),
    (lambda: Detector(along_track=1.0), "1 along the track"),
    (lambda: TimeVariedGain(start=5.0, end=4.0), "ends at 4 m"),
    (lambda: Electronics(noise=-1.0), "noise of the recorder is -1"),
    (lambda: PingFaults(lost=0.7, repeated=0.4), "shares of 0.7 lost"),
    (lambda: Recorder(converter=FINE, interpolation=0), "one of 0 rows")])
def test_impossible_recorders_are_refused(made, words):
    with pytest.raises(ValueError, match=words):
        made()


def test_noise_is_louder_in_outer_rows_and_rough_by_rows_and_ranges():
    """Mean powers over 60 pings of 41 rows and 300 samples: 0.02 dB of chance by row and 0.1 by sample. The rms of 41
    rows is itself known to 11 %, and that of 300 samples to 4: three of these.
    """
    nothing = np.full((PINGS, 41, 300), -100.0)

    def noise(axis, **more):
        counts = recorded(nothing, converter=Converter(bits=24, full_scale_db=FULL_DB),
                          electronics=Electronics(noise=1e-6, **more))
        return 10 * np.log10(np.mean(counts ** 2, axis)) + 60

    np.testing.assert_allclose(noise((0, 2), noise_edge_db=12.0), 12 * np.linspace(-1, 1, 41) ** 2, atol=0.15)
    assert np.std(noise((0, 2), noise_rows_db=2.0)) == pytest.approx(2.0, rel=0.33)
    ranges = noise((0, 1), noise_ranges_db=3.0)
    assert np.std(ranges) == pytest.approx(3.0, rel=0.12)
    np.testing.assert_array_equal(ranges, noise((0, 1), noise_ranges_db=3.0))
    assert np.std(noise((0, 1))) < 0.3


def test_uneven_noise_leaves_the_gains_of_rows_and_samples():
    even = recorded(speckled(), electronics=Electronics(row_gain_db=1.0, stripe_db=1.0))
    uneven = recorded(speckled(), electronics=Electronics(row_gain_db=1.0, stripe_db=1.0, noise_rows_db=3.0))
    np.testing.assert_array_equal(even, uneven)
