"""Noise in the beams of a line: level and correlation against the elements' noise, steered and summed.

    C_bb' = Σ_f |S_r(f)/g|² f_s v_b(f)^H C v_b'(f) / L,      v_b(f) = w_n e^{-2πi x_n s_b (1 + f/f0)/λ} / Σ|w_n|

C is that of `signal.noise.ElementNoise`. Drawn numbers are looked at over 40 pings of 4000 samples, some 60,000 that do
not depend on each other: 0.4 % of level, 0.004 of correlation.
"""
import numpy as np
import pytest
from beam_cases import SPEED, Line
from scipy import fft

from mitsonar.device.arrays import arrays_of
from mitsonar.device.chance import ping_key
from mitsonar.signal.beam_grid import NoiseDensity
from mitsonar.signal.noise import ElementNoise
from mitsonar.signal.reception import band_filter

LONG, PINGS = 4000, 40
LINES = {
    "half a wavelength apart": dict(elements=32),
    "a third of a wavelength apart": dict(elements=40, pitch=0.33),
    "shaded, jittered, some dead": dict(elements=40, jitter=0.05,
                                        weight=np.hanning(42)[1:-1] * (np.arange(40) % 9 > 0)),
    "three": dict(elements=3),
}
SINES = np.array([-0.8, -0.5, 0.0, 0.02, 0.04, 0.07, 0.3])


@pytest.fixture
def lib(variant):
    import mitsuba as mi

    return arrays_of(mi.Float)


def expected(line, density):
    """C of the beams of the module."""
    length = 2048
    f = fft.fftfreq(length, 1 / line.rate)
    spectrum = np.abs(line.pulse.spectrum(line.rate, length)) ** 2
    power = spectrum / np.mean(spectrum * band_filter(f, line.rate)) ** 2
    wavelength = SPEED / line.pulse.frequency
    rows, columns = len(density.across), len(line.position)
    place = np.zeros((rows, columns, 3))
    place[..., 0], place[..., 1] = line.position, wavelength * np.array(density.across)[:, None]
    elements = ElementNoise(position=place.reshape(-1, 3), wavelength=wavelength, sampling_rate=line.rate,
                            ambient_db=0.0)
    mixed = density.ambient * elements.covariance + density.own * line.rate * np.eye(rows * columns)
    turns = np.multiply.outer((line.pulse.frequency + f) / SPEED, np.multiply.outer(line.sines, line.position))
    steered = np.exp(2j * np.pi * turns) * np.conj(line.weight) / np.abs(line.weight).sum()
    share = np.array(density.weights) / np.abs(density.weights).sum()
    steered = (share[:, None] * steered[:, :, None]).reshape(*steered.shape[:2], -1)
    return np.einsum("f,fbi,ij,fcj->bc", power / length, np.conj(steered), mixed, steered, optimize=True)


ROWS = dict(across=(-0.45, 0.0, 0.4), weights=(0.5, 1.0, 0.8))


@pytest.mark.parametrize("name", LINES)
@pytest.mark.parametrize("density", [NoiseDensity(ambient=2.0), NoiseDensity(own=0.7),
                                     NoiseDensity(ambient=2.0, **ROWS), NoiseDensity(own=0.7, **ROWS)],
                         ids=["sea", "own", "sea, three rows", "own, three rows"])
def test_level_and_correlation_are_those_of_the_elements(lib, name, density):
    line = Line(lib, sines=SINES, samples=LONG, **LINES[name])
    drawn = np.concatenate([line.beams.form(line.beams.grid(), noise=density, key=ping_key(7, ping))
                            for ping in range(PINGS)], 1)
    found, wanted = drawn @ np.conj(drawn.T) / drawn.shape[1], expected(line, density)
    level, wanted_level = np.sqrt(np.diag(found).real), np.sqrt(np.diag(wanted).real)
    assert level ** 2 == pytest.approx(wanted_level ** 2, rel=0.015)
    correlation = found / np.multiply.outer(level, level)
    error = np.abs(correlation - wanted / np.multiply.outer(wanted_level, wanted_level)).max()
    assert error < (0.1 if name == "three" and density.own else 0.012)


def test_sea_and_receivers_are_independent_and_keys_tell_pings_apart(lib):
    line = Line(lib, samples=LONG, sines=SINES)

    def drawn(key, **density):
        return line.beams.form(line.beams.grid(), noise=NoiseDensity(**density), key=key).copy()

    sea, own, both = drawn(1, ambient=1.0), drawn(1, own=1.0), drawn(1, ambient=1.0, own=1.0)
    assert np.abs(both - sea - own).max() < 1e-4 * np.abs(both).max()
    assert both.tobytes() == drawn(1, ambient=1.0, own=1.0).tobytes()
    other = drawn(2, ambient=1.0)
    for one, two in ((sea, own), (sea, other)):
        assert np.abs(np.vdot(one, two)) < 0.03 * np.linalg.norm(one) * np.linalg.norm(two)


def test_noise_adds_to_echoes(lib):
    line, noise = Line(lib), NoiseDensity(ambient=1e-3, own=1e-3)
    echo = line.beams.form(line.grid((200.0, 0.3, 1.0))).copy()
    alone = line.beams.form(line.beams.grid(), noise=noise, key=3).copy()
    both = line.beams.form(line.grid((200.0, 0.3, 1.0)), noise=noise, key=3)
    assert np.abs(both - echo - alone).max() < 1e-5
