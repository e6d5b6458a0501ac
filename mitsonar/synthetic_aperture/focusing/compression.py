"""Range compression of raw echoes, on a time axis fine enough for linear interpolation; windows over an image.

The filter is that of `signal.matched_filtering`: an echo of amplitude a and delay τ peaks at τ with the value a. The
fine axis has `FINER` samples per cycle of the band. The spectrum is divided by that of linear interpolation between
samples, sinc²(f / rate), whose error is then -52 dB of an echo (rms over a flat band).
"""
from __future__ import annotations

import numpy as np
import xarray as xr
from scipy import fft

from mitsonar.signal.matched_filtering import replica_spectra
from mitsonar.signal.reception import check_record, occupied_band, padded_length
from mitsonar.sonar.arrays.shading import window_weights
from mitsonar.sonar.pulses.pulse import Pulse, Window

FINER = 8.0                        # samples of the fine axis per cycle of the band
TRIED = 64                         # samples that a window is tried on


def window_samples(image: xr.Dataset, window: tuple[float, float]) -> tuple[int, int]:
    """Return the odd numbers of points along and across that a window [m] holds, at most those of the image."""
    size = []
    for name, length in zip(("along_track", "across_track"), window):
        step = float(np.abs(np.diff(image[name].values)).mean()) if image.sizes[name] > 1 else np.inf
        if not (np.isfinite(length) and length > 0):
            raise ValueError(f"the window's length {name.replace('_', ' ')} is {length} m; give one above 0")
        size.append(min(2 * int(0.5 * length / step) + 1, image.sizes[name]))
    return size[0], size[1]


def window_of(text: str | tuple | None) -> Window | None:
    """Return a window as scipy takes it, "taylor 4 30" as a tuple, or None for "none" and None."""
    if text is None or text == "none":
        return None
    if not isinstance(text, str):
        return text
    name, *numbers = text.split() or [""]
    try:
        values = [int(number) if number.lstrip("+-").isdigit() else float(number) for number in numbers]
    except ValueError:
        raise ValueError(f'window is "{text}"; give a name and its numbers, such as "hann" or "taylor 4 30"') from None
    return (name, *values) if values else name


class Compressor:
    """Range compression of pings of one length."""

    def __init__(self, pulse: Pulse, sampling_rate: float,  # [Hz]
                 samples: int, window: str | tuple | None = None):
        check_record(pulse, sampling_rate, samples)
        self.length = padded_length(samples, pulse.duration, sampling_rate)
        finer = max(1, int(np.ceil(FINER * occupied_band(pulse) / sampling_rate)))
        self.rate = finer * sampling_rate
        self.fine_length = finer * self.length
        self.samples = max(int((samples - 1 - pulse.duration * sampling_rate) * finer) + 1, 2)
        shape = window_of(window)
        if shape is not None:
            window_weights(shape, TRIED)                   # refuses an unknown window
        spectra = replica_spectra(pulse, sampling_rate, self.length, shape)
        flat = np.sinc(spectra.frequency / self.rate) ** 2
        self._transfer = (finer * spectra.replica / spectra.gain / flat).astype(np.complex64)

    def compressed(self, signals: np.ndarray) -> np.ndarray:
        """Return the compressed signals complex64 (rx, `samples`) of signals (rx, sample)."""
        spectrum = fft.fft(np.asarray(signals, np.complex64), self.length) * self._transfer
        fine = np.zeros((len(signals), self.fine_length), np.complex64)
        half = (self.length + 1) // 2
        fine[:, :half], fine[:, half - self.length:] = spectrum[:, :half], spectrum[:, half:]
        return np.ascontiguousarray(fft.ifft(fine, overwrite_x=True)[:, :self.samples])
