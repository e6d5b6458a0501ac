"""Lines of elements and the exact sum over them, for tests of beams."""
import numpy as np
from scipy import fft

from mitsonar.device.arrays import upload
from mitsonar.signal.beam_grid import LineBeams
from mitsonar.signal.impulses import BandLimited
from mitsonar.signal.reception import band_filter, padded_length
from mitsonar.sonar.pulses.pulses import lfm

SPEED, SAMPLES, LEAD = 1500.0, 600, 20


class Line:
    """A line of elements that hears an lfm, by default 48 elements half a wavelength apart."""

    def __init__(self, lib, *, elements=48, pitch=0.5, jitter=0.0, weight=None, sines=None, pulse=None, **more):
        rng = np.random.default_rng(3)
        self.lib, self.pulse = lib, pulse or lfm(300e3, 20e3, 0.5e-3)
        self.rate = self.pulse.suggested_sampling_rate
        wavelength = SPEED / self.pulse.frequency
        self.position = wavelength * ((np.arange(elements) - (elements - 1) / 2) * pitch
                                      + jitter * rng.standard_normal(elements))
        self.weight = np.ones(elements) if weight is None else np.asarray(weight)
        self.sines = np.linspace(-0.87, 0.87, 15) if sines is None else np.asarray(sines)
        self.beams = LineBeams(lib.Float, position=self.position, weight=self.weight, pulse=self.pulse,
                               sampling_rate=self.rate, sound_speed=SPEED, sines=self.sines,
                               **{"samples": SAMPLES, "lead": LEAD, **more})

    def grid(self, *echoes):
        """A grid with echoes, each (column, sine, amplitude), arrays or numbers."""
        grid = self.beams.grid()
        for column, sine, amplitude in echoes:
            column, sine, amplitude = np.broadcast_arrays(np.atleast_1d(column), sine, amplitude)
            real, imaginary = np.real(amplitude), np.imag(amplitude)
            grid.add(**{name: upload(self.lib.Float, np.asarray(values, np.float32)) for name, values in
                        dict(column=column, sine=sine, real=real, imaginary=imaginary).items()})
        return grid

    def exact(self, column, sine, amplitude, doppler=1.0):
        """The sum over elements and frequencies of one echo, complex128 (B, SAMPLES - LEAD)."""
        length = padded_length(SAMPLES + 64,  self.pulse.duration, self.rate)
        f = fft.fftfreq(length, 1 / self.rate)
        replica, keep = np.conj(self.pulse.spectrum(self.rate, length)), band_filter(f, self.rate)
        gain = np.mean(np.abs(replica) ** 2 * keep)
        received = self.pulse.spectrum(self.rate, length, doppler) * keep * BandLimited().response(f / self.rate)
        turns = np.multiply.outer(self.sines - sine, (self.pulse.frequency + f) / SPEED)
        pattern = np.exp(-2j * np.pi * turns[..., None] * self.position) @ self.weight / np.abs(self.weight).sum()
        delay = np.exp(-2j * np.pi * f * (column + 32) / self.rate)
        return amplitude * fft.ifft(received * replica / gain * delay * pattern)[:, 32 + LEAD:32 + SAMPLES]


def worst_db(found, expected, peak=1.0):
    """The largest difference, relative to a peak [dB]."""
    return 20 * np.log10(np.abs(found - expected).max() / peak)
