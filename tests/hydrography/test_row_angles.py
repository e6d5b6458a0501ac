"""Angles by the phases of rows against plane waves of known sines, in noise and without.

Of two rows d wavelengths apart the phase of N samples of coherence γ strays by √((1 - γ²) / (2 γ² N)) (Rodríguez and
Martin, 1992), good to some per cent for γ over 0.8 and N of 10 and more: 2000 windows tell a spread to 1.6 %.
"""
import numpy as np
import pytest

from mitsonar.hydrography.detection.row_angles import ReceiverRows, sector_of

SECTOR = sector_of(np.deg2rad(30.0))
PLACES = {"two": [0.0, 0.5], "three": [0.0, 0.6, 3.0], "four": [0.0, 0.5, 1.5, 4.0], "ten": list(0.5 * np.arange(10))}
LOOKS, BINS = 20, 2000


def gaussian(rng, *shape):
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) * np.sqrt(0.5)


def echoes(place, sine, ratio=None, seed=0):
    """Signals (K, samples) of echoes of sines (B,), so many times as strong as the noise of each row."""
    rng = np.random.default_rng(seed)
    z = gaussian(rng, len(sine), LOOKS) * np.exp(2j * np.pi * np.multiply.outer(place, sine))[..., None]
    if ratio is not None:
        z = z + gaussian(rng, *z.shape) / np.sqrt(ratio)
    return z.reshape(len(place), -1)


def found(place, signals, **more):
    rows = ReceiverRows(place=np.array(place), sector=SECTOR)
    return rows.angles(signals, **{"per_bin": LOOKS, "window": LOOKS, "looks": LOOKS, **more})


@pytest.mark.parametrize("name", PLACES)
def test_a_plane_wave_without_noise_comes_from_its_sine(name):
    """Newton's method ends at the rounding of phases: 1e-9 of a sine."""
    sine = np.linspace(SECTOR[0] + 0.01, SECTOR[1] - 0.01, 101)
    angles = found(PLACES[name], echoes(np.array(PLACES[name]), sine))
    np.testing.assert_allclose(angles.sine, sine, atol=1e-9)
    np.testing.assert_allclose(angles.coherence, 1, atol=1e-12)
    assert angles.inside.all()
    wanted = np.exp(2j * np.pi * np.ptp(PLACES[name]) * sine)
    np.testing.assert_allclose(np.exp(1j * angles.phase), wanted, atol=1e-9)


def test_two_rows_spread_as_theory_has_it_and_say_so():
    sine = np.full(BINS, 0.1)
    angles = found([0.0, 0.5], echoes(np.array([0.0, 0.5]), sine, ratio=10.0))
    gamma = 10 / 11
    theory = np.sqrt((1 - gamma ** 2) / (2 * gamma ** 2 * LOOKS)) / (2 * np.pi * 0.5)
    assert (angles.sine - sine).std() == pytest.approx(theory, rel=0.08)
    assert np.sqrt((angles.deviation ** 2).mean()) == pytest.approx(theory, rel=0.08)
    assert angles.coherence.mean() == pytest.approx(gamma, abs=0.005)


@pytest.mark.parametrize("name", ["four", "ten"])
def test_many_rows_are_as_precise_as_can_be_and_never_take_one_answer_for_another(name):
    """The bound of Cramér and Rao, (1 + 1/(K q)) / (2 N q 4π² Σ (x - x̄)²)."""
    place, q = np.array(PLACES[name]), 5.0
    sine = np.random.default_rng(1).uniform(SECTOR[0] + 0.05, SECTOR[1] - 0.05, BINS)
    angles = found(place, echoes(place, sine, ratio=q))
    bound = np.sqrt((1 + 1 / (len(place) * q)) / (2 * LOOKS * q * 4 * np.pi ** 2 * np.sum((place - place.mean()) ** 2)))
    off = angles.sine - sine
    assert np.abs(off).max() < 8 * bound
    assert off.std() == pytest.approx(bound, rel=0.08)
    assert np.sqrt((angles.deviation ** 2).mean()) == pytest.approx(bound, rel=0.08)


def test_a_pulse_that_comes_late_to_the_upper_row_strays_as_it_says():
    """White speckle of bandwidth 1/4, d s / f late: σ_φ = 2π d s b / √(12 N) of 4 samples a look; 8 % of spread."""
    rng, samples, looks, late = np.random.default_rng(3), 4 * LOOKS, LOOKS, 0.4
    frequency = np.fft.fftfreq(BINS * samples)
    spectrum = gaussian(rng, BINS * samples) * (np.abs(frequency) < 0.125)
    rows = np.stack([np.fft.ifft(spectrum * np.exp(2j * np.pi * frequency * shift)) for shift in (0.0, late)])
    # a shift of 0.4 samples is d s / f with d s = 0.5 · 0.5 and f = 0.625 a sample, so that b = 0.25 / 0.625
    place, sine = np.array([0.0, 0.5]), 0.5
    rows[1] *= np.exp(2j * np.pi * 0.5 * sine)
    angles = found(place, rows, per_bin=samples, window=samples, looks=looks, relative_bandwidth=0.4)
    theory = 2 * np.pi * late * 0.25 / np.sqrt(12 * looks) / (2 * np.pi * 0.5)
    assert (angles.sine - sine).std() == pytest.approx(theory, rel=0.12)
    assert np.sqrt((angles.deviation ** 2).mean()) == pytest.approx(theory, rel=0.12)


def test_noise_alone_is_seldom_coherent():
    rng = np.random.default_rng(5)
    angles = found(PLACES["four"], gaussian(rng, 4, BINS * 8), per_bin=8, window=8, looks=8)
    assert (angles.coherence > 0.85).mean() < 0.01 and angles.coherence.mean() < 0.7
    assert not found(PLACES["four"], np.zeros((4, 80)), per_bin=8, window=8, looks=8).inside.any()


def test_two_echoes_at_one_time_make_an_angle_between_theirs():
    place = np.array(PLACES["two"])
    both = echoes(place, np.full(BINS, -0.2)) + echoes(place, np.full(BINS, 0.3), seed=9)
    angles = found(PLACES["two"], both)
    assert np.median(angles.sine) == pytest.approx(0.05, abs=0.02)
    assert angles.coherence.mean() == pytest.approx(np.cos(np.pi * 0.5 * 0.5), abs=0.05)
    assert angles.deviation.mean() > 0.02


def test_windows_are_about_the_middle_of_their_bins():
    """A bin of 4 samples, a window of 8: an echo 2 samples before the bin counts, one 3 before does not."""
    place = np.array(PLACES["two"])
    for sample, counts in ((5, False), (6, True), (13, True), (14, False)):
        signals = np.zeros((2, 24), complex)
        signals[:, sample] = np.exp(2j * np.pi * place * 0.2)
        angles = found(PLACES["two"], signals, per_bin=4, window=8)
        assert (angles.power[2] > 0) == counts


@pytest.mark.parametrize("place, words", [
    ([0.0, 1.0], "take sines 1.02 apart for the same"), ([0.0, 2.0, 4.0], "let two rows be less than 0.63 wavelengths"),
    ([0.0], "two or more places that rise"), ([0.5, 0.0], "two or more places that rise"),
    ([0.0, np.nan], "two or more places that rise")])
def test_rows_that_cannot_tell_angles_apart_are_refused(place, words):
    with pytest.raises(ValueError, match=words):
        ReceiverRows(place=np.array(place), sector=SECTOR)
