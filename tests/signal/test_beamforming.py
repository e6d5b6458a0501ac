"""Beams against closed forms, from element signals of point scatterers written down in float64.

Uniform line of N elements at pitch d, steered to ψ0, plane wave from ψ: b = |sin Nu / (N sin u)|, u = (πd/λ)(sin ψ -
sin ψ0); shaded, b = |Σ w_n exp(2iu n)| / Σ w_n. Targets stand a thousand far fields (2 L²/λ) away or more, so curvature
is below 1e-3 rad, and the pulse crosses the array in 3 % of its length: a bias of 1e-3 of the main lobe where fans have
no delays, 2e-4 elsewhere, of interpolation. Patterns are compared to 0.1 dB where b > -35 dB, to 2e-3 elsewhere (to
0.01 dB at points of known value), angles to 0.1°. Near-field points and phases have no bias but that of interpolation,
-67 dB rms: 1e-3 is asked for.
"""
import drjit as dr
import numpy as np
import pytest
from synthetic_echoes import FREQUENCY, SAMPLING_RATE, SOUND_SPEED, WAVELENGTH, line, narrow, signals

from mitsonar.signal import ElementNoise, beamforming
from mitsonar.signal.beamforming import interpolation
from mitsonar.sonar.arrays.shading import window_weights

FAR = 5000.0                       # [m]
AHEAD = "forward"


def db(values):
    return 20 * np.log10(np.maximum(np.abs(values), 1e-12))


def closed_form(elements, pitch, sine, towards, weights=None):
    """Pattern |b| of a line, beams towards `sine`, a plane wave from `towards`."""
    weights = np.ones(elements) if weights is None else weights
    turns = np.subtract.outer(np.asarray(sine), towards) * pitch / WAVELENGTH
    return np.abs(np.exp(2j * np.pi * turns[..., None] * np.arange(elements)) @ weights) / np.sum(weights)


def cut(beams, sample=320):
    return np.abs(beams.values[0, :, sample])


@pytest.mark.parametrize(("elements", "beam_deg", "expected"), [(16, 5, -8.570309), (16, 20, -20.912533),
                                                                (64, 1, -5.029421)])
def test_known_values_of_a_uniform_line(elements, beam_deg, expected):
    heard = signals(line(elements), FAR * beamforming.directions(0.0), pulse=narrow)
    beam = beamforming.delay_and_sum(heard, beamforming.directions([np.radians(beam_deg)]))
    assert db(cut(beam))[0] == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize("window", [None, "hann", ("chebwin", 30), ("taylor", 4, 30)], ids=str)
@pytest.mark.parametrize("target_deg", [0.0, 20.0])
@pytest.mark.parametrize("method", ["delay_and_sum", "fft_beams", "fan_beams"])
def test_pattern_is_the_closed_form(method, window, target_deg):
    elements, pitch, target = 32, 0.5 * WAVELENGTH, np.sin(np.radians(target_deg))
    weights = np.ones(elements) if window is None else window_weights(window, elements)
    heard = signals(line(elements), FAR * beamforming.directions(np.arcsin(target)), pulse=narrow)
    if method == "delay_and_sum":
        sine = np.linspace(-0.85, 0.85, 401)
        beams = beamforming.delay_and_sum(heard, beamforming.directions(np.arcsin(sine)), window=window)
    else:
        size = {"size": 1024} if method == "fft_beams" else {"beams": 401}
        beams = getattr(beamforming, method)(heard, AHEAD, window=window, widest=np.radians(58), **size)
        sine = beams["sine"].values
        np.testing.assert_allclose(sine, beams["beam_y"], atol=1e-12)
    expected = closed_form(elements, pitch, sine, target, weights)
    lobes = expected > 10 ** (-35 / 20)
    np.testing.assert_allclose(db(cut(beams))[lobes], db(expected)[lobes], atol=0.1)
    assert np.abs(cut(beams) - expected).max() < 2e-3
    assert np.degrees(np.arcsin(sine[cut(beams).argmax()])) == pytest.approx(target_deg, abs=0.2)


def test_main_lobe_and_first_side_lobe():
    """Long line: -3 dB width 0.88589294 λ/L, first side lobe -13.261459 dB (64 elements: -13.25 dB)."""
    elements, pitch = 64, 0.5 * WAVELENGTH
    heard = signals(line(elements), FAR * beamforming.directions(0.3), pulse=narrow)
    azimuth = np.linspace(0.2, 0.4, 4001)
    level = db(cut(beamforming.delay_and_sum(heard, beamforming.directions(azimuth))))
    assert np.degrees(azimuth[level.argmax()]) == pytest.approx(np.degrees(0.3), abs=0.01)
    wide = azimuth[level > -3.0103]
    assert np.sin(wide[-1]) - np.sin(wide[0]) == pytest.approx(0.88589294 * WAVELENGTH / (elements * pitch), rel=5e-3)
    side = np.abs(np.sin(azimuth) - np.sin(0.3)) > WAVELENGTH / (elements * pitch)
    assert level[side].max() == pytest.approx(-13.26, abs=0.05)


def test_grating_lobe():
    """sin ψ_g = sin ψ_s - λ/d: d = 0.75 λ steered to 30° has one at -56.44269°, as high as the main lobe."""
    heard = signals(line(24, 0.75 * WAVELENGTH), FAR * beamforming.directions(np.radians(30.0)), pulse=narrow)
    angle = np.arange(-70.0, -40.0, 0.02)
    level = db(cut(beamforming.delay_and_sum(heard, beamforming.directions(np.radians(angle)))))
    assert level.max() == pytest.approx(0, abs=0.1)
    assert angle[level.argmax()] == pytest.approx(-56.44269, abs=0.1)


@pytest.mark.parametrize(("window", "side_lobe", "width"), [
    (("chebwin", 30), -30.000, 0.069582), (("taylor", 4, 30), -30.06, 0.070350), ("hann", -31.50, 0.096043),
    ("hamming", -39.37, 0.084883)])
def test_shading(window, side_lobe, width):
    """16 elements: highest side lobe [dB] and -3 dB width in (d/λ) sin ψ, from the windows' own array factors."""
    heard = signals(line(16), FAR * beamforming.directions(0.0), pulse=narrow)
    sine = np.linspace(0, 0.99, 2000)
    level = db(cut(beamforming.delay_and_sum(heard, beamforming.directions(np.arcsin(sine)), window=window)))
    half = np.interp(3.0103, -level[:400], sine[:400])
    assert 2 * half * 0.5 == pytest.approx(width, rel=3e-3)
    past_null = np.flatnonzero(np.diff(level) > 0)[0]
    assert level[past_null:].max() == pytest.approx(side_lobe, abs=0.1)


@pytest.mark.parametrize("interpolation", ["band_limited", "linear"])
def test_near_field_of_an_array_of_any_shape(rng, interpolation):
    """An echo from 2 m, a third of an array length off the axis: unit gain, the phase it has at the origin."""
    receivers = rng.uniform(-0.5, 0.5, (40, 3))
    for distance in (2.0, 9.0):
        vector = beamforming.directions(0.4, -0.7)
        heard = signals(receivers, distance * vector, [2j])
        beam = beamforming.delay_and_sum(heard, vector[None], interpolation=interpolation)
        expected = 2j * np.exp(-2j * np.pi * FREQUENCY * 2 * distance / SOUND_SPEED)
        tolerance = {"band_limited": 1e-3, "linear": 0.02}[interpolation]
        assert abs(beam.values[0, 0, 320] - expected) < 2 * tolerance


def test_wide_band_fan_is_the_plane_wave_beam():
    """At 40 km curvature is 1e-3 rad: the chirp-z fan must give what delay-and-sum gives, sample by sample."""
    receivers = line(32) + [0.1, 0.05, -0.02]
    heard = signals(receivers, 40e3 * beamforming.directions(0.2), transmitters=[(0.03, 0.2, 0.1)])
    fan = beamforming.fan_beams(heard, AHEAD, beams=33)
    look = np.column_stack([fan[f"beam_{axis}"] for axis in "xyz"])
    exact = beamforming.delay_and_sum(heard, look)
    assert np.abs(fan.values - exact.values).max() < 2e-3 * np.abs(exact.values).max()


def test_narrow_band_fan_is_the_wide_one_for_a_long_pulse():
    heard = signals(line(48), FAR * beamforming.directions(-0.5), pulse=narrow)
    narrow_fan = beamforming.fft_beams(heard, AHEAD, size=96)
    wide_fan = beamforming.fan_beams(heard, AHEAD, beams=narrow_fan.sizes["beam"],
                                     widest=float(narrow_fan["angle"].max()))
    np.testing.assert_allclose(narrow_fan["sine"], wide_fan["sine"], atol=1e-12)
    assert np.abs(narrow_fan.values - wide_fan.values).max() < 4e-3


def test_several_transmitters_focus_as_one():
    """Four transmitters and six elements far apart: every pair has its own way; unit gain where they agree."""
    transmitters = line(4, 0.3)
    vector = beamforming.directions(0.3)
    heard = signals(line(6), 12 * vector, transmitters=transmitters, pulse=narrow)
    together = beamforming.delay_and_sum(heard, beamforming.directions([0.3, 0.32]))
    one_by_one = [beamforming.delay_and_sum(heard.isel(tx=[k]), beamforming.directions([0.3, 0.32])) for k in range(4)]
    np.testing.assert_allclose(together, sum(beam.values for beam in one_by_one) / 4, atol=1e-5)
    assert cut(together)[0] == pytest.approx(1, abs=2e-3)
    assert cut(together)[1] < 0.6 < 0.9 < cut(one_by_one[0])[1]


def test_focus_gives_the_amplitude_with_its_phase():
    points = np.array([[8.0, 3.0, 2.0], [9.0, -1.0, 4.0], [200.0, 0.0, 0.0]])
    amplitudes = [1.0, 0.5j]
    heard = signals(line(300), points[:2], amplitudes, samples=2048, sample=256)
    found = beamforming.focus(heard, points).values[0]
    np.testing.assert_allclose(found[:2], amplitudes, atol=0.02)            # 1 % is the other one's side lobe
    assert found[2] == 0                                                     # heard after the record's end


@pytest.mark.parametrize("origin", [0.0, 5000.0])
def test_backprojection_of_a_track(origin):
    """A 3 m track of pings, 5 km from the scene's origin: gain 1 at the scatterer, resolution 0.886 λ R / (2 L).

    Between pings the phase of a scatterer turns by hundreds of cycles; float32 coordinates would lose it.
    """
    pings, length, distance = 121, 3.0, 40.0
    track = np.zeros((pings, 1, 3))
    track[:, 0, 0] = np.linspace(-length / 2, length / 2, pings)
    track += origin
    target = np.array([0.0, distance, 0.0]) + origin
    heard = signals(track + line(2, 0.0125, (1, 0, 0)), target, [1j], transmitters=track, samples=128, sample=64)
    along = np.linspace(-0.06, 0.06, 481)
    image = beamforming.backproject(heard, target + along[:, None] * [1, 0, 0])
    assert image.dims == ("point",)
    assert image.values[240] == pytest.approx(1j, abs=3e-3)
    lobe = along[np.abs(image.values) > np.sqrt(0.5)]
    assert lobe[-1] - lobe[0] == pytest.approx(0.886 * WAVELENGTH * distance / (2 * length), rel=0.05)
    single = beamforming.focus(heard, target[None])
    assert single.dims == ("ping", "point") and np.abs(single.values - 1j).max() < 4e-3


@pytest.mark.parametrize("window", [None, "hann"])
def test_noise_goes_down_by_the_sum_of_squared_weights(rng, window):
    """Independent element noise in the band of the signals: Σw²/(Σw)², 0.1 dB of 20 x 4096 samples / 1.5."""
    elements, samples = 32, 4096
    heard = signals(line(elements), FAR * beamforming.directions(0.0), samples=samples)
    spectrum = rng.standard_normal((elements, samples)) + 1j * rng.standard_normal((elements, samples))
    spectrum[:, np.abs(np.fft.fftfreq(samples)) > 1 / 3] = 0
    noise = np.fft.ifft(spectrum, axis=1)
    look = beamforming.directions(np.linspace(-1, 1, 20))
    beams = beamforming.delay_and_sum(heard.copy(data=noise[None, None]), look, window=window)
    weights = np.ones(elements) if window is None else window_weights(window, elements)
    expected = 10 * np.log10((weights ** 2).sum() / weights.sum() ** 2)
    inner = slice(64, -64)
    found = (np.abs(beams.values[..., inner]) ** 2).mean() / (np.abs(noise[:, inner]) ** 2).mean()
    assert 10 * np.log10(found) == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize(("pitch", "expected"), [(0.5, 12.041200), (0.25, 9.117833)])
def test_isotropic_noise_goes_down_by_the_directivity_index(pitch, expected):
    """Line of 16, broadside: 10 log N at half a wavelength, less where neighbours hear the same; 0.15 dB of 40,000."""
    receivers = line(16, pitch * WAVELENGTH)
    noise = ElementNoise(position=receivers, wavelength=WAVELENGTH, sampling_rate=SAMPLING_RATE, ambient_db=60.0)
    heard = signals(receivers, FAR * beamforming.directions(0.0), samples=40_000)
    heard = heard.copy(data=noise.drawn(40_000, 1, 0)[None, None])
    beam = beamforming.delay_and_sum(heard, beamforming.directions([0.0]))
    assert noise.level_db - 10 * np.log10((np.abs(beam.values) ** 2).mean()) == pytest.approx(expected, abs=0.15)


@pytest.mark.parametrize("by", ["argument", "coordinate"])
def test_failed_elements_are_left_out(by):
    weights = np.ones(16)
    weights[[2, 9]] = 0
    heard = signals(line(16), FAR * beamforming.directions(0.2), pulse=narrow)
    heard[:, :, [2, 9]] = 1e3
    if by == "coordinate":
        heard, weights = heard.assign_coords(rx_weight=("rx", weights)), None
    beam = beamforming.delay_and_sum(heard, beamforming.directions([0.2]), window=weights)
    assert cut(beam)[0] == pytest.approx(1, abs=2e-3)


@pytest.mark.parametrize(("name", "band", "rms_db", "worst_db"), [
    ("linear", 1 / 3, -33.5, -26.5), ("band_limited", 1 / 3, -69.5, -66), ("band_limited", 0.49, -67, -63)])
def test_interpolation_error_is_as_stated(rng, name, band, rms_db, worst_db):
    """Tones over |f| < band at random places, faded in and out so that no end of the record is heard."""
    kernel = interpolation.interpolation_named(name)
    number = np.arange(8192)

    def tone(frequency, place):
        return np.exp(2j * np.pi * frequency * place - 0.5 * ((place - 4096) / 500) ** 2)

    place = rng.uniform(3900, 4300, 1000)
    stored = interpolation.MARGIN + interpolation.RATE * place
    whole = np.floor(stored).astype(int)
    errors = []
    for frequency in np.linspace(-band, band, 41):
        values = interpolation.corrected(kernel, tone(frequency, number).astype(np.complex64))
        read = sum(tap * values[whole + kernel.first + k] for k, tap in enumerate(kernel.taps(stored - whole)))
        errors.append(np.mean(np.abs(read - tone(frequency, place)) ** 2))
    assert 10 * np.log10(np.mean(errors)) < rms_db
    assert 10 * np.log10(np.max(errors)) < worst_db


def test_the_number_of_threads_changes_no_bit(rng):
    heard = signals(line(9), FAR * beamforming.directions(0.0))
    heard = heard.copy(data=rng.standard_normal(heard.shape) + 1j * rng.standard_normal(heard.shape))
    before, found = dr.thread_count(), []
    try:
        for threads in (2, 5):
            dr.set_thread_count(threads)
            found.append(beamforming.delay_and_sum(heard, beamforming.directions(np.linspace(-1, 1, 77))).values)
    finally:
        dr.set_thread_count(before)
    np.testing.assert_array_equal(*found)


# ------------------------------------------------------------------ the adaptive beamformer

def noisy(heard, rng, level=0.01):
    return heard + level * (rng.standard_normal(heard.shape) + 1j * rng.standard_normal(heard.shape))


def test_mvdr_lets_the_look_direction_pass(rng):
    heard = noisy(signals(line(24), 20 * beamforming.directions(0.25), [1j]), rng)
    adapted, plain = (form(heard, beamforming.directions([0.25])).values[0, 0, 320]
                      for form in (beamforming.mvdr, beamforming.delay_and_sum))
    assert adapted == pytest.approx(plain, abs=0.02)
    assert abs(adapted) == pytest.approx(1, abs=0.02)


def test_mvdr_parts_two_coherent_echoes_that_delay_and_sum_cannot(rng):
    """Two equal echoes at the same range, 0.7 of a beam width apart (λ/L: 0.0625 in sine)."""
    between = np.arcsin([0.20, 0.22, 0.24])
    heard = noisy(signals(line(32), 30 * beamforming.directions(between[[0, 2]])), rng, 1e-3)
    look = beamforming.directions(between)
    plain = cut(beamforming.delay_and_sum(heard, look))
    adapted = cut(beamforming.mvdr(heard, look, loading=1e-4))
    assert plain[1] > plain[[0, 2]].max()
    assert adapted[1] < 0.8 * adapted[[0, 2]].min()


def test_mvdr_is_narrower_and_lower_than_delay_and_sum(rng):
    heard = noisy(signals(line(24), 20 * beamforming.directions(0.0)), rng, 1e-3)
    azimuth = np.linspace(-0.6, 0.6, 61)
    adapted, plain = (cut(form(heard, beamforming.directions(azimuth)))
                      for form in (beamforming.mvdr, beamforming.delay_and_sum))
    off = np.abs(azimuth) > 0.09
    assert db(adapted[off].max()) < db(plain[off].max()) - 10


def test_mvdr_under_a_heavy_load_is_the_mean_of_its_subarrays(rng):
    """R → I: weights of a trapezium, elements counted by the subarrays they are in."""
    elements, length = 12, 5
    heard = noisy(signals(line(elements), 20 * beamforming.directions(0.1)), rng)
    look = beamforming.directions([0.0, 0.3])
    trapezium = np.convolve(np.ones(length), np.ones(elements - length + 1))
    np.testing.assert_allclose(beamforming.mvdr(heard, look, subarray=length, loading=1e9),
                               beamforming.delay_and_sum(heard, look, window=trapezium), atol=1e-5)


def test_mvdr_of_silence_is_silence():
    heard = signals(line(8), 20 * beamforming.directions(0.0)) * 0
    heard.attrs.update(frequency=FREQUENCY, sound_speed=SOUND_SPEED)
    assert not beamforming.mvdr(heard, beamforming.directions([0.0])).values.any()
