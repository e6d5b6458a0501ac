"""Beams of a line of elements from echoes as points of sine and time.

    B_b(f) = P(f) Σ_j a_j e^{-2πi f τ_j} W((1 + f/f0)(s_b - s_j))                                              (1)
    G[u, t] = Σ_j a_j k_u((s_j - s_u)/ds) k_t((τ_j - t) f_s)                                                   (2)
    B = F_f⁻¹ Σ_u k_u((s_b - s_u)/ds) F_ν⁻¹ { Ŵ_f(ν) / k̂_u(ν)² · F_ν { P_u(f) F_t G } }                         (3)

s_j -> ``sine`` of the direction of arrival (at reception, body frame), τ_j -> ``column`` / f_s, a_j -> ``real``,
``imaginary``, s_b -> ``sines``; W as of `line_response`, P_u, with a Doppler factor for each row u, as of
`pulse_response`. (1) is delay-and-sum focused at every range but for the phase k x_n² (s_j² - s_b²)/2R, which vanishes
in the main lobe. In s it is a convolution: two FFTs each way, whatever the number of echoes and elements.

Rows are steps of sine fine enough for the line; beams at any sines are read from them by the bell that spread the
echoes. This is the same for all frequencies, so that it may come before F_f⁻¹ or after it: where there are fewer rows
than beams, their records are transformed and beams are read from records. The transforms over rows take them modulo a
period, so long that no echo comes round into a beam.
"""
from __future__ import annotations

from collections.abc import Callable

import drjit as dr
import numpy as np
from scipy import fft

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.device.chance import Salt, salted
from mitsonar.device.types import DrJitArray, Float
from mitsonar.sonar.pulses.pulse import Pulse, Window

from ..impulses import BandLimited, Bell
from .grids import MARGIN, BeamGrid, GridShape
from .kernels import Noise, Reading, Sizes, Waves, by_beam, by_frequency, by_record, through_the_line
from .line_response import FADE, FINER, OVERSAMPLING, ResponseRows, response_of, stride_of
from .noise import NoiseDensity
from .pulse_response import PulseResponse
from .transforms import transformed

NOISE_ROOM = 0.7                   # of sines, beyond what beams see of it: less, and no noise is as it should be
COARSEST = 1 / 16                  # step of the sine
CLASH = 256                        # rows: columns of so many fall into the same lines of a cache
EDGE = 3                           # rows beyond ±1 on either side, for taps
MOST = 1 << 27                     # of rows by frequencies: a gigabyte for each table of them
MOST_PLACES = 1 << 32              # of the line's pattern, times elements: some seconds


class LineBeams:
    """Beamformer of a line, made once for a survey."""
    # position (E,) [m]; weight (E,) or (A, E) [-]; sampling_rate [Hz]; sound_speed [m/s]; sines (B,) [-]; start [s];
    # scale (A,), what beams of each aperture are multiplied by

    def __init__(self, like: DrJitArray | type, *, position: np.ndarray, weight: np.ndarray, pulse: Pulse,
                 sampling_rate: float, samples: int, lead: int, sound_speed: float, sines: np.ndarray,
                 start: float = 0.0, absorption_db: Callable[[np.ndarray], np.ndarray] | None = None,
                 window: Window | None = None, scale: np.ndarray | None = None):
        self.lib = arrays_of(like)
        position, weight, self.sines = np.asarray(position, float), np.asarray(weight), np.asarray(sines, float)
        _check(position, weight, self.sines, samples, lead)
        self.samples, self.lead, self._rate = samples, lead, sampling_rate
        self.pulse = PulseResponse(pulse, window, sampling_rate, samples, padding=2 * MARGIN)
        self.length = self.pulse.length
        wavenumber = (pulse.frequency + self.pulse.offset) / sound_speed
        weights = np.atleast_2d(weight)
        self._scale = np.ones(len(weights)) if scale is None else np.asarray(scale, float)
        self._stride = stride_of(position, weights)
        self._within = float(self.sines.min()), float(self.sines.max())
        steps, self.period = _rows(position, wavenumber, _farthest(*self._within), self._stride)
        _check_size(len(position), steps, self.period, len(wavenumber))
        step = 2 / steps
        # the middle of where beams are is the middle of how far they lie from echoes
        before = self.period // 2 - int(round(0.25 * sum(self._within) * steps))
        rows = ResponseRows(step=step, period=self.period, before=before)
        self.lines = [response_of(position, one, wavenumber, rows, self._stride) for one in weights]
        self.line = self.lines[0]
        terms = None if absorption_db is None else self.pulse.weaken(absorption_db, sound_speed, start, MARGIN)
        self.shape = GridShape(rows=steps + 1 + 2 * EDGE, samples=samples, length=self.length,
                               along=Bell(BandLimited().band), across=self.line.bell, first=-1 - EDGE * step, step=step,
                               absorption=terms)
        self._row_sines = self.shape.first + step * np.arange(self.shape.rows)
        self._set_tables()
        self._drawn: tuple[NoiseDensity, Float | None, list[Float | None]] = (NoiseDensity(), None,
                                                                              [None] * len(self.lines))

    def grid(self) -> BeamGrid:
        """Make empty sums on the device."""
        return BeamGrid(self.lib.Float, self.shape)

    def form(self, grid: BeamGrid, *, doppler: np.ndarray | None = None, noise: NoiseDensity | None = None,
             key: int = 0) -> np.ndarray:
        """Form the beams of a line of one aperture; see `form_each`."""
        if len(self.lines) > 1:
            raise ValueError(f"the line has {len(self.lines)} apertures; form the beams of each.")
        return self.form_each(grid, doppler=doppler, noise=noise, key=key)[0]

    def form_each(self, grid: BeamGrid, *, doppler: np.ndarray | None = None, noise: NoiseDensity | None = None,
                  key: int = 0, sines: np.ndarray | None = None) -> np.ndarray:
        """Form the beams of the echoes on a grid, which is empty afterwards."""
        # doppler (K,) [-]; sines (N,) [-]
        read = self._reading if sines is None else self._read_at(sines)
        if grid.shape is not self.shape:
            raise ValueError("the grid belongs to another line; make it by grid() of this line.")
        factors = np.ones(2) if doppler is None else np.asarray(doppler, float)
        row_factors = np.interp(self._row_sines, np.linspace(-1, 1, len(factors)), factors)
        rows, waves = (None, [None] * len(self.lines)) if noise is None else self._noise_tables(noise)
        kept = slice(MARGIN + self.lead, MARGIN + self.samples)
        on_rows = None
        if rows is not None:
            bell = tuple(self.line.bell.impulse([0, 1]).tolist())
            on_rows = Noise(key=salted(key, Salt.BEAM_AMBIENT), row=rows, frequency=self._replica, taps=bell)
        sizes, spectra = self._sizes, transformed(grid.taken(), self.length)
        spectra = by_frequency(spectra, sizes, self.pulse.transfers(row_factors), on_rows)
        spectra = transformed(spectra, sizes.period)
        records = dr.zeros(self.lib.Float, 2 * len(self.lines) * read.records * self.length)
        for number, (table, own) in enumerate(zip(self._tables, waves)):
            period = self.lines[number].rows.period
            through = through_the_line(spectra, sizes, period, table, own, salted(key, Salt.BEAM_NOISE) + number)
            by_record(transformed(through, period, inverse=True), sizes, period, read, records, number)
        records, begin, length = transformed(records, self.length, inverse=True), 0, self.length
        if not read.of_spectra:
            begin = kept.start & ~1
            length = kept.stop + 1 - begin & ~1
            records = by_beam(records, sizes, read, begin, length)
        beams = records.numpy().view(np.complex64).reshape(len(self.lines), read.beams, length)
        return beams[:, :, kept.start - begin:kept.stop - begin]

    # -- tables ----------------------------------------------------------------------------------------------------

    def _set_tables(self) -> None:
        lib, U = self.lib, self.lib.UInt32
        self._sizes = Sizes(rows=self.shape.rows, length=self.length, period=self.period,
                            used=upload(U, self.pulse.used.astype(np.uint32)))
        self._tables = [Waves(upload(U, line.taken[::2].astype(np.uint32) // 2),
                              upload(U, line.used[::2].astype(np.uint32) // 2),
                              upload(lib.Float, line.values.view(np.float32))) for line in self.lines]
        self._reading = self._read_at(self.sines)
        self._replica = upload(lib.Float, np.abs(self.pulse.replica).astype(np.float32))

    def _read_at(self, sines: np.ndarray) -> Reading:
        """Return the rows and taps from which beams at these sines are read."""
        lib, (low, high) = self.lib, self._within
        if not ((sines >= low - 1e-12) & (sines <= high + 1e-12)).all():
            raise ValueError(f"beams of a line made for sines from {low:.4g} to {high:.4g} are asked for from "
                             f"{np.min(sines):.4g} to {np.max(sines):.4g}; make it for those.")
        place = (np.asarray(sines, float) - self.shape.first) / self.shape.step
        turns = [np.exp(2j * np.pi * line.middle / self.period * place) * scale if line.middle or scale != 1 else None
                 for line, scale in zip(self.lines, self._scale)]
        place = place / self._stride
        rows = np.floor(place).astype(np.int64)[:, None] + np.arange(-1, 3)
        taps = self.line.bell.impulse(place[:, None] - rows)
        first = int(rows.min())
        return Reading(first=first, count=int(rows.max()) + 1 - first, rows=upload(lib.UInt32, rows - first),
                       taps=upload(lib.Float, taps),
                       turns=[None if one is None else upload(lib.Float, one.astype(np.complex64).view(np.float32))
                              for one in turns])

    def _noise_tables(self, noise: NoiseDensity) -> tuple[Float | None, list[Float | None]]:
        """Return amplitudes of noise on rows (R,) and on (f, ν) (F, U), for each aperture; see `noise`."""
        if self._drawn[0] != noise:
            band = self._rate * self.length
            rows: Float | None = None
            waves: list[Float | None] = [None] * len(self.lines)
            # rows at the very ends count half
            inside = np.clip((1 - np.abs(self._row_sines)) / self.shape.step + 0.5, 0, 1)
            ambient = noise.ambient_at(self._row_sines) * band * (0.5 * self.shape.step * inside)
            replica = np.abs(self.pulse.replica)
            if noise.ambient:
                rows = upload(self.lib.Float, np.sqrt(ambient))
            if noise.own:
                for number, line in enumerate(self.lines):
                    power = noise.own_of_lines * band * line.rows.period * line.own_noise(float(np.ptp(self.sines)))
                    size = replica[:, None] * np.sqrt(power)
                    waves[number] = upload(self.lib.Float, size.astype(np.float32))
            self._drawn = noise, rows, waves
        return self._drawn[1:]


def _check(position: np.ndarray, weight: np.ndarray, sines: np.ndarray, samples: int, lead: int) -> None:
    shaped = position.ndim == 1 and len(position) and weight.ndim in (1, 2) and weight.shape[-1:] == position.shape
    if not shaped or not np.isfinite(position).all():
        raise ValueError(f"beams of a line: positions have shape {position.shape}, weights {weight.shape}; give a "
                         "finite position [m] and a weight for every element.")
    if not np.isfinite(weight).all() or not np.atleast_2d(weight).any(1).all():
        raise ValueError("beams of a line: weights must be finite, and one of them other than 0.")
    if sines.ndim != 1 or not len(sines) or not (np.abs(sines) <= 1).all():
        raise ValueError(f"beams of a line: sines have shape {sines.shape} and reach "
                         f"{np.abs(sines).max(initial=0):.4g}; give one or more within ±1.")
    if not 0 <= lead < samples:
        raise ValueError(f"beams of a line: {lead} of {samples} samples are to be dropped; give fewer.")


def _check_size(elements: int, steps: int, period: int, frequencies: int) -> None:
    if period * frequencies > MOST or FINER * period * elements > MOST_PLACES:
        raise ValueError(f"a line of {elements} elements that tells {steps:.3g} sines apart, at {frequencies} "
                         "frequencies, is too large for pictures in the beam domain; take fewer or closer elements, a "
                         "shorter range or pulse, or picture elements")


def _rows(position: np.ndarray, wavenumber: np.ndarray, farthest: float, multiple: int) -> tuple[int, int]:
    """Choose how many steps make the sines -1 to 1, and the rows of a period of sines twice `farthest` long."""
    finest = 0.5 / (OVERSAMPLING * max(float(np.abs(position).max() * wavenumber.max()), 1e-9))
    steps = int(np.ceil(2 / min(finest, COARSEST)))
    if steps > MOST:                                         # no transform is as long
        return steps, steps
    period = _fast(int(np.ceil(farthest * steps)) + FADE, multiple)
    while period % CLASH == 0 or period // multiple % CLASH == 0:
        period = _fast(period + 1, multiple)
    return steps, period


def _farthest(low: float, high: float) -> float:
    """Return how far sines of echoes and of beams between two lie apart, half of it to either side."""
    return min(1 + max(-low, high), max(1 + 0.5 * (high - low), high - low + NOISE_ROOM))


def _fast(length: int, multiple: int) -> int:
    """Return the next length that transforms are fast of, a multiple; half of it, too, is of whole pairs."""
    multiple *= 4
    return multiple * fft.next_fast_len(-(-length // multiple))
