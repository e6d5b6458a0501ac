"""Compressed signals of a few elements from echoes as points of time.

    B_n(f) = Σ_k P_k(f) F_t { Σ_j a_j e^{-i2πf0 δ_nj} k_t((τ_j + δ_nj - t) f_s) } + N_n(f),       δ_nj = -r_n·l_j / c

τ_j -> ``column`` / f_s; a_j -> ``real``, ``imaginary``, with the pattern of the element; r_n -> ``place``; l_j ->
``towards``; k -> ``sheet``, the number of the Doppler class of an echo; P_k as of `pulse_response`, k_t its bell. The
noise N has the covariance C between elements: N = |S_r| √L chol(C) g, S_r the replica, L the length of the FFT, g
Gaussian of variance 1.

Every element has a record for each class; there is no grid of sines. Waves are plane over the elements.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence

import drjit as dr
import numpy as np
from scipy import fft

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.device.types import DrJitArray, Float, UInt32
from mitsonar.sonar.pulses.pulse import Pulse, Window

from ..impulses import BandLimited, Bell, Nearest, turned
from .grids import MARGIN
from .noise import random_phases
from .pulse_response import PulseResponse
from .spreading import GridSums
from .transforms import divided, transformed

UNTURNED = np.eye(3)


class ElementReceivers:
    """Elements that receive the same echoes, each with its own delay, made once for a survey."""
    # place (E, 3) [m]; sampling_rate [Hz]; sound_speed [m/s]; start [s]

    def __init__(self, like: DrJitArray | type, *, place: np.ndarray, pulse: Pulse, sampling_rate: float, samples: int,
                 lead: int, sound_speed: float, start: float = 0.0,
                 absorption_db: Callable[[np.ndarray], np.ndarray] | None = None, window: Window | None = None):
        self.lib, self.place, self._speed = arrays_of(like), np.asarray(place, float), sound_speed
        self._samples, self._lead = samples, lead
        self._carrier, self._rate = (dr.opaque(self.lib.Float, value) for value in (pulse.frequency, sampling_rate))
        self._pulse = PulseResponse(pulse, window, sampling_rate, samples, padding=2 * MARGIN)
        self._terms = None if absorption_db is None else self._pulse.weaken(absorption_db, sound_speed, start, MARGIN)

    def sums(self, classes: int) -> GridSums:
        """Make empty records for echoes of so many Doppler classes, the classes of an element after each other."""
        return GridSums(self.lib.Float, rows=len(self.place) * classes, columns=self._samples + 2 * MARGIN,
                        pitch=self._pulse.length, along=Bell(BandLimited().band), across=Nearest(),
                        absorption=self._terms)

    def add(self, sums: GridSums, elements: Sequence[int], *, column: Float, real: Float, imaginary: Float,
            sheet: UInt32, towards: Sequence[Float] | None = None, rotation: np.ndarray = UNTURNED) -> None:
        """Add echoes at elements with one pattern; without `towards`, they are at the array's centre."""
        # column (H,) [samples], at the centre; sheet (H,); rotation (3, 3), of the places to the frame of `towards`
        lib, U, classes = self.lib, self.lib.UInt32, sums.stripes // len(self.place)
        count = dr.width(column)
        if not count:
            return
        first = dr.opaque(U, elements[0] * classes)
        if towards is None:
            sums.add(lib.Float(sheet + first), column + MARGIN, real, imaginary)
            return
        element, echo = divided(lib, dr.arange(U, len(elements) * count), count)
        early = np.zeros((len(elements), 4), np.float32)
        early[:, :3] = self.place[list(elements)] @ rotation.T / self._speed
        x, y, z, _ = dr.gather(lib.Array4f, upload(lib.Float, early), element)
        column, real, imaginary, *direction = (dr.gather(lib.Float, part, echo) for part in (
            column, real, imaginary, *towards))
        ahead = x * direction[0] + y * direction[1] + z * direction[2]
        cosine, sine = turned(lib, ahead * self._carrier)
        row = element * dr.opaque(U, classes) + dr.gather(U, sheet, echo) + first
        sums.add(lib.Float(row), column - ahead * self._rate + MARGIN, dr.fma(real, cosine, -imaginary * sine),
                 dr.fma(imaginary, cosine, real * sine))

    def formed(self, sums: GridSums, doppler: np.ndarray, *, noise: np.ndarray | None = None,
               key: int = 0) -> np.ndarray:
        """Return the compressed signals (E, samples) of echoes of classes of these Doppler factors."""
        # doppler (K,) [-]; noise (E, E): C, in the square of the unit of echoes
        elements, pulse = len(self.place), self._pulse
        spectra = transformed(sums.sums, pulse.length).numpy().view(np.complex64)
        spectra = spectra.reshape(elements, len(doppler), pulse.length)[:, :, pulse.used]
        whole = (spectra * pulse.transfers(doppler).rows).sum(1)
        if noise is not None:
            mixing, size = np.linalg.cholesky(noise).astype(np.float32), np.abs(pulse.replica) * np.sqrt(pulse.length)
            number = dr.arange(self.lib.UInt32, whole.size)
            real, imaginary = (mixing @ part.numpy().reshape(whole.shape)
                               for part in random_phases(self.lib, number, dr.opaque(self.lib.UInt32, key)))
            whole += (real + 1j * imaginary) * size.astype(np.float32)
        record = np.zeros((elements, pulse.length), np.complex64)
        record[:, pulse.used] = whole
        return fft.ifft(record, overwrite_x=True)[:, MARGIN + self._lead:MARGIN + self._samples]
