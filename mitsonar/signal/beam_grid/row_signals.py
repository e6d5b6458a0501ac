"""Compressed signals of one receiver, ping by ping, from echoes as points of (ping, time).

    y_r(f) = P_r(f) Σ_j a_j e^{-2πi f τ_j} + noise                                          j of the echoes of row r

What `line_beams` makes of a line, without a line: the beam's pattern is in the amplitudes a_j, a row is a ping (a step
of a rotating head, say), and many rows are formed together.
"""
from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.device.chance import Salt
from mitsonar.device.types import DrJitArray
from mitsonar.sonar.pulses.pulse import Pulse, Window

from ..impulses import BandLimited, Bell
from .grids import MARGIN, GridShape, RowGrid
from .kernels import Noise, Sizes, along_rows
from .noise import NoiseDensity
from .pulse_response import PulseResponse
from .transforms import transformed


class RowSignals:
    """Signals of rows; made once for a survey."""
    # sampling_rate [Hz]; start [s]; sound_speed [m/s]

    def __init__(self, like: DrJitArray | type, *, pulse: Pulse, sampling_rate: float, samples: int, lead: int,
                 start: float = 0.0, sound_speed: float = 1500.0,
                 absorption_db: Callable[[np.ndarray], np.ndarray] | None = None, window: Window | None = None):
        if not 0 <= lead < samples:
            raise ValueError(f"signals of rows: {lead} of {samples} samples are to be dropped; give fewer.")
        self.lib, self.samples, self.lead = arrays_of(like), samples, lead
        self.pulse = PulseResponse(pulse, window, sampling_rate, samples, padding=2 * MARGIN)
        self._terms = None if absorption_db is None else self.pulse.weaken(absorption_db, sound_speed, start, MARGIN)
        self._used = upload(self.lib.UInt32, self.pulse.used.astype(np.uint32))
        self._replica = upload(self.lib.Float, np.abs(self.pulse.replica).astype(np.float32))

    def grid(self, rows: int) -> RowGrid:
        """Make empty sums of so many rows on the device."""
        return RowGrid(self.lib.Float, GridShape(rows=rows, samples=self.samples, length=self.pulse.length,
                                                 along=Bell(BandLimited().band), absorption=self._terms))

    def form(self, grid: RowGrid, *, doppler: np.ndarray | None = None, noise: NoiseDensity | None = None,
             keys: np.ndarray | None = None) -> np.ndarray:
        """Form the signals of the echoes on a grid, which is empty afterwards."""
        rows, lib = grid.shape.rows, self.lib
        factors = np.ones(rows) if doppler is None else np.asarray(doppler, float)
        power = 0.0 if noise is None else (noise.ambient + noise.own) * self.pulse.sampling_rate * self.pulse.length
        given = np.asarray([] if keys is None else keys, np.uint32)
        if factors.shape != (rows,) or (power and given.shape != (rows,)):
            raise ValueError(f"signals of {rows} rows: there are {factors.shape} Doppler factors and {given.shape} "
                             "keys of noise; give one of each for every row.")
        drawn = row_keys = None
        if power:
            level = np.full(rows, np.sqrt(power), np.float32)
            drawn = Noise(key=Salt.ROW_NOISE, row=upload(lib.Float, level), frequency=self._replica)
            row_keys = upload(lib.UInt32, given)
        sizes = Sizes(rows=rows, length=self.pulse.length, period=rows, used=self._used)
        spectra = transformed(grid.taken(), sizes.length)
        spectra = along_rows(spectra, sizes, self.pulse.transfers(factors), drawn, row_keys)
        whole = transformed(spectra, sizes.length, inverse=True).numpy().view(np.complex64).reshape(rows, -1)
        return whole[:, MARGIN + self.lead:MARGIN + self.samples]
