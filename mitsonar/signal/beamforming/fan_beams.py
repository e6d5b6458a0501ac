"""Fans of beams from elements in a line with one pitch, in the frequency domain: far field, all beams at once.

    y(s, f) = Σ_n w_n z_n(f) exp(-2πi (f0 + f) R_n·u / c),   R_n·u = R_0·u + n d s,   s = sin ψ = u·e

d -> pitch, e -> axis of the line, ψ -> angle of the beam from broadside, u -> its unit vector, on the side of the line
that ``facing`` names. `fft_beams` takes f = 0 in the exponent (narrow band: B L |s| / c << 1 for a bandwidth B and a
length L) and is an FFT over the elements padded with zeros, its beams at s = m λ / (N d). `fan_beams` is exact for
every f: a chirp-z transform over the elements per frequency (Rabiner, Schafer & Rader 1969), beams at any equal steps
of s. Both hold beyond some 2 L²/λ; nearer, use `delay_and_sum`.
"""
from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy import fft

from mitsonar.sonar.arrays.axes import axis_vector
from mitsonar.units import khz_from_hertz

from .recording import Shading, beam_signals, read_recording, uniform_line, weights_of

EDGE = 8                           # samples by which a record is lengthened, beside the way across the array
STRAY = 0.02                       # cosine of `facing` with the line
SLACK = 1e-6                       # relative, for pitches of exactly the limit


def fft_beams(signals: xr.DataArray, facing: str | ArrayLike, *, widest: float = np.pi / 3, size: int | None = None,
              window: Shading = None) -> xr.DataArray:
    """Form a narrow-band fan by an FFT over the elements."""
    # facing (3,); widest [rad]
    fan = _BeamFan(signals, facing, widest, window)
    recording, elements = fan.recording, len(fan.weights)
    size = fft.next_fast_len(2 * elements) if size is None else size
    if not size >= elements:
        raise ValueError(f"an FFT of {size} is shorter than the line of {elements} elements; give size >= {elements}")
    step = recording.wavelength / (size * fan.pitch)
    most = int(np.floor(np.sin(widest) / step * (1 + SLACK)))
    number = np.arange(-most, most + 1)
    sines = np.clip(number * step, -1, 1)
    turned = np.exp(-2j * np.pi / recording.wavelength * fan.offset(sines)).astype(np.complex64)
    shaded = recording.values[:, 0] * fan.weights[:, None].astype(np.float32)
    values = fft.fft(shaded, n=size, axis=1)[:, number % size] * turned[:, None]
    return fan.labelled(values, sines, "fft_beams")


def fan_beams(signals: xr.DataArray, facing: str | ArrayLike, *, beams: int | None = None, widest: float = np.pi / 3,
              window: Shading = None) -> xr.DataArray:
    """Form a wide-band fan by a chirp-z transform over the elements, frequency by frequency."""
    # facing (3,); widest [rad]
    fan = _BeamFan(signals, facing, widest, window)
    recording, elements = fan.recording, len(fan.weights)
    beams = 2 * elements + 1 if beams is None else beams
    if not beams >= 1:
        raise ValueError(f"a fan of {beams} beams is empty; give at least 1 beam")
    sines = np.linspace(-1, 1, beams) * np.sin(widest) if beams > 1 else np.zeros(1)
    samples = recording.values.shape[-1]
    across = np.abs(fan.offset(np.array([-1.0, 1.0]))).max() + (elements - 1) * fan.pitch
    padded = fft.next_fast_len(samples + EDGE + int(np.ceil(across / recording.sound_speed * recording.sampling_rate)))
    wavenumber = (recording.frequency + fft.fftfreq(padded, 1 / recording.sampling_rate)) / recording.sound_speed
    transform = _ChirpZ(wavenumber * fan.pitch, sines, elements)
    turned = np.exp(-2j * np.pi * np.outer(wavenumber, fan.offset(sines))).astype(np.complex64)
    values = np.empty((recording.values.shape[0], beams, samples), np.complex64)
    for ping, one in enumerate(recording.values[:, 0]):
        spectra = fft.fft(one * fan.weights[:, None].astype(np.float32), n=padded, axis=-1)
        steered = transform.transformed(np.ascontiguousarray(spectra.T)) * turned    # (frequency, beam)
        values[ping] = fft.ifft(np.ascontiguousarray(steered.T), axis=-1)[:, :samples]
    return fan.labelled(values, sines, "fan_beams")


class _BeamFan:
    """Uniform line, the side that it faces, and the shading of its elements."""

    def __init__(self, signals: xr.DataArray, facing: str | ArrayLike, widest: float, window: Shading):
        self.recording = recording = read_recording(signals)
        transmitters = recording.values.shape[1]
        if transmitters != 1:
            raise ValueError(f"the signals have {transmitters} transmitters; a far-field fan takes one: select it with "
                             "signals.isel(tx=[0]), or use delay_and_sum, which focuses them all")
        still = recording.receivers[0], recording.transmitters[0, 0]
        if (recording.receivers != still[0]).any() or (recording.transmitters != still[1]).any():
            raise ValueError("the elements change their positions from ping to ping; give positions in the body frame, "
                             "or use delay_and_sum")
        self.first, self.axis, self.pitch = uniform_line(still[0], recording.wavelength)
        self.first = self.first + still[1]                   # the way out is shorter by T·u, as the way back by R·u
        self.facing = self._side(facing)
        self._check_lobes(widest)
        self.weights = weights_of(window, recording)

    def _side(self, facing: str | ArrayLike) -> np.ndarray:
        facing = axis_vector("facing", facing)
        along = facing @ self.axis
        if abs(along) > STRAY:
            raise ValueError(f"facing {np.round(facing, 6)} stands at {np.degrees(np.arccos(min(abs(along), 1))):.3g}° "
                             f"to the line of elements along {np.round(self.axis, 6)}; give a direction perpendicular "
                             "to it")
        facing = facing - along * self.axis
        return facing / np.linalg.norm(facing)

    def _check_lobes(self, widest: float) -> None:
        if not 0 <= widest <= np.pi / 2:
            raise ValueError(f"beams reach {np.degrees(widest):.4g}° from broadside; give widest from 0 to π/2 rad")
        wavelength, pitch = self.recording.wavelength, self.pitch
        limit = wavelength / (1 + np.sin(widest))
        if pitch <= limit * (1 + SLACK):
            return
        free = np.degrees(np.arcsin(np.clip(wavelength / pitch - 1, 0, 1)))
        what = (f"a grating lobe enters the fan when steered past {free:.1f}°, and beams reach "
                f"{np.degrees(widest):.3g}°. Use spacing <= {limit:.4f} m or narrow the fan." if pitch < wavelength else
                f"grating lobes stand in the fan wherever it is steered. Use spacing <= {limit:.4f} m, or "
                "delay_and_sum to see them.")
        raise ValueError(f"rx element spacing is {pitch:.4g} m = {pitch / wavelength:.3g} wavelengths "
                         f"at {khz_from_hertz(self.recording.frequency):g} kHz; {what}")

    def vectors(self, sines: np.ndarray) -> np.ndarray:
        """Return the unit vectors (B, 3) of beams."""
        return np.outer(sines, self.axis) + np.outer(np.sqrt(1 - sines ** 2), self.facing)

    def offset(self, sines: np.ndarray) -> np.ndarray:
        """Return the path [m] of a far target's echo by way of the first element, less that by the origin: (B,)."""
        return self.vectors(sines) @ self.first

    def labelled(self, values: np.ndarray, sines: np.ndarray, method: str) -> xr.DataArray:
        return beam_signals(self.recording, values, self.vectors(sines), method, sine=sines, angle=np.arcsin(sines))


class _ChirpZ:
    """Σ_n g_n exp(-2πi a n s_b) for rows of a, by 2 n b = n² + b² - (b - n)² (Bluestein)."""
    # cycles (F,); sines (B,)

    def __init__(self, cycles: np.ndarray, sines: np.ndarray, elements: int):
        step = sines[1] - sines[0] if len(sines) > 1 else 0.0
        n, b = np.arange(elements), np.arange(len(sines))
        self.size = fft.next_fast_len(elements + len(sines) - 1)
        self.beams = len(sines)
        rate = 0.5 * cycles * step

        def chirp(number: np.ndarray) -> np.ndarray:
            return np.exp(2j * np.pi * np.outer(rate, number.astype(float) ** 2)).astype(np.complex64)

        first = np.exp(-2j * np.pi * np.outer(cycles * sines[0], n)).astype(np.complex64)
        self.before = first * chirp(n).conj()
        kernel = np.zeros((len(cycles), self.size), np.complex64)
        kernel[:, :self.beams] = chirp(b)
        kernel[:, self.size - elements + 1:] = chirp(n[:0:-1])
        self.kernel = fft.fft(kernel, axis=1)
        self.after = chirp(b).conj()

    def transformed(self, rows: np.ndarray) -> np.ndarray:
        """Transform complex64 (F, E) to (F, B)."""
        spread = fft.fft(rows * self.before, n=self.size, axis=1) * self.kernel
        return fft.ifft(spread, axis=1)[:, :self.beams] * self.after
