"""Beams of a line of elements from echoes as points of sine and time.

    B_b(f) = P(f) Σ_j a_j e^{-2πi f τ_j} W((1 + f/f0)(s_b - s_j))                                              (1)
    G[u, t] = Σ_j a_j k_u((s_j - s_u)/ds) k_t((τ_j - t) f_s)                                                   (2)
    B = F_f⁻¹ Σ_u k_u((s_b - s_u)/ds) F_ν⁻¹ { Ŵ_f(ν) / k̂_u(ν)² · F_ν { P_u(f) F_t G } }                         (3)

s_j -> ``sine`` of the direction of arrival (at reception, body frame), τ_j -> ``column`` / f_s, a_j -> ``real``,
``imaginary``, s_b -> ``sines``; W as of `line_response`, P_u, with a Doppler factor for each row u, as of
`pulse_response`. (1) is delay-and-sum focused at every range but for the phase k x_n² (s_j² - s_b²)/2R, which vanishes
in the main lobe. In s it is a convolution: two FFTs each way, whatever the number of echoes and elements.

Rows are steps of sine fine enough for the line; beams at any sines are read from them by the bell that spread the
echoes. Rows are taken modulo a period. One of 2 suits lines of many elements about half a wavelength apart, whose own
pattern repeats so. Where it does not, the period is long enough that no echo lies in the wrong place.
"""
from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import fft

from ...device.arrays import arrays_of, upload
from ...device.chance import Salt, salted
from ...device.types import DrJitArray, Float
from ...sonar.pulse import Pulse, Window
from ..bells import Bell
from ..impulses import BandLimited
from ..reception import excess_loss_rate, padded_length
from .absorption import absorption_terms
from .grids import MARGIN, BeamGrid, GridShape
from .kernels import Noise, Sizes, by_beam, by_frequency, through_the_line, turned_in
from .line_response import LineResponse
from .noise import NoiseDensity
from .pulse_response import PulseResponse
from .spreading import PACKET
from .transforms import transformed

__all__ = ["LineBeams"]

OVERSAMPLING = 1.9                 # rows over those that the line resolves
COARSEST = 1 / 16                  # step of the sine
EDGE = 3                           # rows beyond ±1 on either side, for taps
FADE = 48                          # rows over which the pattern of a long period goes to 0
FEW_ROWS = 256                     # a long period costs little
FOLDED = 0.05                      # of the main lobe: what a period of 2 may put into the wrong place
STRETCH = 1.05                     # of a pulse by Doppler


class LineBeams:
    """Beams of a line; made once for a survey.

    Parameters
    ----------
    like : Dr.Jit array or type
        Of the backend to use.
    position : (E,) [m]
        Of the elements along the axis, from the phase centre.
    weight : real or complex (E,) [-]
        0 for one that is dead.
    pulse : Pulse
    sampling_rate : float [Hz]
    samples, lead : int
        Of the record, and how many of them are dropped from the result.
    sound_speed : float [m/s]
    sines : (B,) [-]
        Of the beams, within ±1, in any order.
    start : float [s]
        Time of sample 0; it matters for absorption alone.
    absorption_db : callable or None
        Frequency (N,) [Hz] to absorption (N,) [dB/m], as in `reception.absorbed`.
    window : Window or None
        Of the matched filter's replica.
    period : float or None
        Of the rows' sines; None for 2 where that does, else as long as it must be.

    Raises
    ------
    ValueError
        If positions, weights or sines are not as above, or the pulse does not fit the record.
    """

    def __init__(self, like: DrJitArray | type, *, position: np.ndarray, weight: np.ndarray, pulse: Pulse,
                 sampling_rate: float, samples: int, lead: int, sound_speed: float, sines: np.ndarray,
                 start: float = 0.0, absorption_db: Callable[[np.ndarray], np.ndarray] | None = None,
                 window: Window | None = None, period: float | None = None):
        self.lib = arrays_of(like)
        position, weight, self.sines = np.asarray(position, float), np.asarray(weight), np.asarray(sines, float)
        _check(position, weight, self.sines, samples, lead)
        self.samples, self.lead, self._rate = samples, lead, sampling_rate
        length = padded_length(samples + 2 * MARGIN, STRETCH * pulse.duration, sampling_rate)
        self.length = PACKET * fft.next_fast_len(-(-length // PACKET))
        self.pulse = PulseResponse(pulse, window, sampling_rate, samples, self.length)
        wavenumber = (pulse.frequency + self.pulse.offset) / sound_speed
        if period is None and _rows(position, wavenumber, 2.0)[0] < FEW_ROWS:
            period = 2 * (1 + float(np.abs(self.sines).max()))
        period = period or _period(position, weight, wavenumber, self.pulse.weight, self.sines)
        self.turns = period <= 2
        rows, self.period_rows = _rows(position, wavenumber, period)
        step = 2 / rows
        self.line = LineResponse(position, weight, wavenumber, step, self.period_rows, fade=0 if self.turns else FADE)
        terms = None
        if absorption_db is not None:
            middle = 0.5 * samples + MARGIN
            loss = excess_loss_rate(self.pulse.offset, sampling_rate, pulse.frequency, absorption_db, sound_speed)
            terms = absorption_terms(absorption_db, frequency=pulse.frequency, sampling_rate=sampling_rate,
                                     sound_speed=sound_speed, offset=self.pulse.offset, weight=self.pulse.weight,
                                     middle=middle)
            self.pulse.weaken(np.exp(-loss * (start + 0.5 * samples / sampling_rate)))
        self.shape = GridShape(rows=rows + 2 * EDGE, samples=samples, length=self.length,
                               along=Bell(BandLimited().band), across=self.line.bell, first=-1 - EDGE * step, step=step,
                               absorption=terms)
        # where rows are taken modulo a period, those beyond -1 and 1 are added to those that they stand for
        self._first_row, self.rows = (EDGE, rows) if self.turns else (0, rows + 2 * EDGE)
        sine = self.shape.first + step * (self._first_row + np.arange(self.rows))
        self._row_sines = np.clip(sine, -1, 1)
        self._row_power = 0.5 * step * np.interp(np.abs(sine), 1 + step * np.array([-0.1, 0, 0.1]), [1, 0.5, 0])
        self._set_tables()
        self._noise: tuple[NoiseDensity, Float, Float] | None = None

    def grid(self) -> BeamGrid:
        """Make empty sums on the device."""
        return BeamGrid(self.lib.Float, self.shape)

    def form(self, grid: BeamGrid, *, doppler: np.ndarray | None = None, noise: NoiseDensity | None = None,
             key: int = 0) -> np.ndarray:
        """Form the beams of the echoes on a grid, which is empty afterwards.

        Parameters
        ----------
        grid : BeamGrid
        doppler : (K,) or None [-]
            Two-way factors of echoes at the sines linspace(-1, 1, K); None for 1. `residual_doppler` tells what is left
            of an echo's own.
        noise : NoiseDensity or None
        key : int
            Of a ping, as of `device.chance.ping_key`: equal ones give equal noise.

        Returns
        -------
        complex64 (B, samples - lead)
            An echo at a beam's sine peaks at its time with its amplitude.
        """
        if grid.shape is not self.shape:
            raise ValueError("beams were asked of a grid of another line; make it by grid() of this one.")
        factors = np.ones(1) if doppler is None else np.asarray(doppler, float)
        row_factors = np.interp(self._row_sines, np.linspace(-1, 1, len(factors)), factors) if len(factors) > 1 else \
            np.full(self.rows, factors[0])
        rows, waves = (None, None) if noise is None else self._noise_tables(noise)
        on_rows = None
        if rows is not None:
            bell = tuple(self.line.bell.impulse([0, 1]).tolist())
            on_rows = Noise(key=salted(key, Salt.BEAM_AMBIENT), row=rows, frequency=self._replica, taps=bell)
        sizes, sums = self._sizes, grid.taken()
        spectra = transformed(turned_in(sums, sizes, EDGE) if self.turns else sums, self.length)
        spectra = by_frequency(spectra, sizes, self.pulse.transfers(row_factors), on_rows)
        spectra = through_the_line(transformed(spectra, sizes.period), sizes, self._waves, self._pattern, waves,
                                   salted(key, Salt.BEAM_NOISE))
        spectra = by_beam(transformed(spectra, sizes.period, inverse=True), sizes, self._rows, self._taps)
        beams = transformed(spectra, self.length, inverse=True)
        whole = beams.numpy().view(np.complex64).reshape(len(self.sines), self.length)
        return whole[:, MARGIN + self.lead:MARGIN + self.samples]

    # -- tables ----------------------------------------------------------------------------------------------------

    def _set_tables(self) -> None:
        lib, U = self.lib, self.lib.UInt32
        self._sizes = Sizes(rows=self.rows, length=self.length, first=self._first_row, period=self.period_rows,
                            used=upload(U, self.pulse.used.astype(np.uint32)))
        self._waves = upload(U, self.line.used.astype(np.uint32))
        self._pattern = upload(lib.Float, self.line.values.view(np.float32))
        place = (self.sines - self.shape.first) / self.shape.step
        rows = np.floor(place).astype(np.int64)[:, None] + np.arange(-1, 3)
        taps = self.line.bell.impulse(place[:, None] - rows)
        rows = (rows - self._first_row) % self.period_rows
        self._rows, self._taps = upload(U, rows.astype(np.uint32)), upload(lib.Float, taps.astype(np.float32))
        self._replica = upload(lib.Float, np.abs(self.pulse.replica).astype(np.float32))

    def _noise_tables(self, noise: NoiseDensity) -> tuple[Float | None, Float | None]:
        """Amplitudes of noise drawn on rows, (R,), and of that drawn on (f, ν), (F, U); see the module `noise`."""
        if self._noise is None or self._noise[0] != noise:
            band, line = self._rate * self.length, self.line
            power, rows = np.zeros(line.values.shape, np.float32), None
            if noise.ambient and self.turns:
                power += noise.ambient * np.abs(line.values * line.spectrum.astype(np.float32)) ** 2
            elif noise.ambient:
                rows = upload(self.lib.Float, np.sqrt(noise.ambient * band * self._row_power).astype(np.float32))
            if noise.own:
                power += noise.own * self.period_rows * line.own_noise()
            waves = None
            if power.any():
                size = np.abs(self.pulse.replica)[:, None] * np.sqrt(band * power)
                waves = upload(self.lib.Float, size.astype(np.float32))
            self._noise = noise, rows, waves
        return self._noise[1:]


def _check(position: np.ndarray, weight: np.ndarray, sines: np.ndarray, samples: int, lead: int) -> None:
    if position.ndim != 1 or not len(position) or weight.shape != position.shape or not np.isfinite(position).all():
        raise ValueError(f"beams of a line: positions have shape {position.shape}, weights {weight.shape}; give a "
                         "finite position [m] and a weight for every element.")
    if not np.isfinite(weight).all() or not weight.any():
        raise ValueError("beams of a line: weights must be finite, and one of them other than 0.")
    if sines.ndim != 1 or not len(sines) or not (np.abs(sines) <= 1).all():
        raise ValueError(f"beams of a line: sines have shape {sines.shape} and reach "
                         f"{np.abs(sines).max(initial=0):.4g}; give one or more within ±1.")
    if not 0 <= lead < samples:
        raise ValueError(f"beams of a line: {lead} of {samples} samples are to be dropped; give fewer.")


def _rows(position: np.ndarray, wavenumber: np.ndarray, period: float) -> tuple[int, int]:
    """Choose the rows of sines -1 to 1, and those of a period."""
    finest = 0.5 / (OVERSAMPLING * max(float(np.abs(position).max() * wavenumber.max()), 1e-9))
    rows = fft.next_fast_len(int(np.ceil(2 / min(finest, COARSEST))))
    return rows, rows if period <= 2 else fft.next_fast_len(int(np.ceil(0.5 * period * rows)) + FADE)


def _period(position: np.ndarray, weight: np.ndarray, wavenumber: np.ndarray, power: np.ndarray,
            sines: np.ndarray) -> float:
    """Give 2 where the pattern repeats with it, or is low where it does not; else twice what echo and beam are apart.

    Judged by the compressed pulse's peak: mean over frequencies of W(y) - W(y - 2), for y beyond 1.
    """
    farthest = 1 + float(np.abs(sines).max())
    some = np.linspace(0, len(wavenumber) - 1, min(len(wavenumber), 65)).astype(int)
    y = np.linspace(1, farthest, 256)
    error = np.zeros(len(y), complex)
    for one in some:
        here, there = (np.exp(-2j * np.pi * wavenumber[one] * np.multiply.outer(at, position)) @ weight
                       for at in (y, y - 2))
        error += power[one] * (here - there)
    error = np.abs(error).max() / (power[some].sum() * np.abs(weight).sum())
    return 2.0 if error < FOLDED else 2 * farthest
