"""Define the impulses that echoes leave in complex baseband records, and sum them exactly as a reference.

    z[e, n] = Σ_h a_h exp(-2πi f₀ τ_he) k(n - f_s (τ_he - t₀))                        [element e, sample n]

a -> ``amplitude``, τ -> ``delay`` [s], f₀ -> ``frequency`` [Hz], f_s -> ``sampling_rate`` [Hz], t₀ -> ``start`` [s]; k
is one of KERNELS, an impulse of unit area whose argument counts samples. An exact response has the spectrum

    Z(e, f) = Σ_h a_h exp(-2πi (f₀ + f) (τ_he - t₀)) exp(-2πi f₀ t₀)

``nearest`` puts the whole echo into the nearest sample: its carrier's phase is right, its place up to half a sample
off. ``peterson`` is a Hann-windowed sinc, sinc and window both centred on the exact delay (Peterson 1986, JASA 80,
1527). ``band_limited`` spreads the echo over four samples by a Kaiser-Bessel bell and divides the record's spectrum by
that of the bell, as non-uniform FFTs do (Beatty, Nishimura & Pauly 2005, IEEE TMI 24, 799). Its spectrum is flat to a
third of the sampling rate on either side and rolls off to 0 at the half: a lone echo's peak is about 5/6. Errors within
the flat band, rms over many echoes, are -9, -61 (16 taps) and -57 dB.

The energy Σ_n |z_n|² of a lone echo is |a|² times that of the kernel, averaged over its place between samples:

    E = ∫ k(x)² dx = ∫ |K(ν)|² dν                                                 [ν cycles per sample]

E is 1 for ``nearest``, always, and 0.949 for ``peterson`` of 16 taps (0.90 to 1). For ``band_limited`` it is the energy
of an impulse in a record of this band: 2/3 of the flat band, 1/8 of the roll-off and 0.0004 of aliases, 0.7921 in all
(-1.012 dB, 0.05 dB more or less). The bell over w places (``taps``) of a grid is

    k(x) = I₀(β √(1 - (2x/w)²)) / I₀(β),      K(ν) = (w / I₀(β)) sinh(√(β² - (πwν)²)) / √(β² - (πwν)²)

with the best β for signals of |ν| <= ``band`` (eq. 5 of Beatty et al., with the ratio 1/2 : band as its oversampling).
On the device its taps are polynomials in the echo's place between two samples, an even and an odd part for mirrored
taps.
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TypeAlias

import drjit as dr
import numpy as np
import scipy
from numpy.typing import ArrayLike

from mitsonar.device.turns import workers_ended
from mitsonar.device.types import ArrayTypes, Float


@dataclass(frozen=True)
class Bell:
    """Hold a Kaiser-Bessel bell over four places."""

    band: float  # [cycles a place]: highest frequency of the signals, below 1/2

    taps = 4

    @cached_property
    def shape(self) -> float:
        """Return Beatty's β."""
        ratio = 0.5 / self.band
        return np.pi * np.sqrt((self.taps / ratio) ** 2 * (ratio - 0.5) ** 2 - 0.8)

    def impulse(self, x: ArrayLike) -> np.ndarray:
        """Return k at x places from the echo."""
        inside = 1 - (2 * np.asarray(x, float) / self.taps) ** 2
        i0 = scipy.special.i0
        return np.where(inside > 0, i0(self.shape * np.sqrt(np.maximum(inside, 0))) / i0(self.shape), 0.0)

    def spectrum(self, frequency: ArrayLike) -> np.ndarray:
        """Return the Fourier transform of k at `frequency` [cycles a place]."""
        root = np.sqrt(self.shape ** 2 - (np.pi * self.taps * np.asarray(frequency, float)) ** 2 + 0j)
        near = np.abs(root) < 1e-6
        shape = np.real(np.where(near, 1.0, np.sinh(root) / np.where(near, 1, root)))
        return shape * self.taps / scipy.special.i0(self.shape)


FLAT = 1 / 3                       # [cycles per sample], edge of the flat band
GUARD = 64                         # [samples] of zeros on either side of a record while its spectrum is divided
MARGIN = 16                        # [samples] kept before and after a record, so that echoes at its edges stay whole
CHUNK = 1 << 21                    # numbers held at once by the reference sums


@dataclass(frozen=True)
class Nearest:
    """Put all of an echo into the nearest sample."""

    taps = 1
    margin = MARGIN

    def impulse(self, x: ArrayLike) -> np.ndarray:
        """Return k at x samples from the echo."""
        x = np.asarray(x, float)
        return np.where((x > -0.5) & (x <= 0.5), 1.0, 0.0)

    @property
    def energy(self) -> float:
        """Return E of the module's equation [-]."""
        return 1.0

    def spectrum(self, frequency: ArrayLike) -> np.ndarray:
        """Return the Fourier transform of k at `frequency` [cycles per sample]."""
        return np.sinc(np.asarray(frequency, float))

    def finish(self, records: np.ndarray) -> np.ndarray:
        """Return records (..., samples) as they are."""
        return records


@dataclass(frozen=True)
class Peterson:
    """Spread an echo by a Hann-windowed sinc around the exact delay."""

    taps: int = 16  # length of the window [samples], a multiple of 4

    def __post_init__(self):
        if self.taps != int(self.taps) or self.taps % 4 or not 8 <= self.taps <= 80:
            raise ValueError(f"peterson kernel of {self.taps} taps; give a multiple of 4 from 8 to 80")

    @property
    def margin(self) -> int:
        """Return the number of samples kept before and after a record."""
        return max(MARGIN, self.taps)

    def impulse(self, x: ArrayLike) -> np.ndarray:
        """Return k at x samples from the echo."""
        x = np.asarray(x, float)
        window = 0.5 * (1 + np.cos(2 * np.pi * x / self.taps))
        return np.where(np.abs(x) < self.taps / 2, window * np.sinc(x), 0.0)

    @property
    def energy(self) -> float:
        """Return E of the module's equation [-]."""
        nodes, weights = np.polynomial.legendre.leggauss(8 * self.taps)
        return float(self.impulse(0.5 * self.taps * nodes) ** 2 @ weights) * 0.5 * self.taps

    def spectrum(self, frequency: ArrayLike) -> np.ndarray:
        """Return the Fourier transform of k at `frequency` [cycles per sample]."""
        return _transform(self, frequency)

    def finish(self, records: np.ndarray) -> np.ndarray:
        """Return records (..., samples) as they are."""
        return records


@dataclass(frozen=True)
class BandLimited(Bell):
    """Spread an echo by a Kaiser-Bessel bell over four samples, whose spectrum `finish` divides out."""

    band: float = FLAT

    margin = MARGIN

    @property
    def energy(self) -> float:
        """Return E of the module's equation [-], after `finish`, with the aliases that the bell lets into the roll-off.
        """
        nodes, weights = np.polynomial.legendre.leggauss(200)
        frequency = 0.25 * (nodes + 1)
        aliases = sum(self.spectrum(frequency + whole) ** 2 for whole in range(-3, 4)) / self.spectrum(frequency) ** 2
        return float(0.5 * weights @ (self.response(frequency) ** 2 * aliases))

    def response(self, frequency: ArrayLike) -> np.ndarray:
        """Return the spectrum after `finish`: 1 to a third of the sampling rate, then half a cosine to 0 at the half.
        """
        beyond = (np.abs(frequency) - FLAT) / (0.5 - FLAT)
        return 0.5 * (1 + np.cos(np.pi * np.clip(beyond, 0, 1)))

    def finish(self, records: np.ndarray) -> np.ndarray:
        """Divide the spectrum of records (..., samples) by the bell's, up to the roll-off, in their precision."""
        length = scipy.fft.next_fast_len(records.shape[-1] + 2 * GUARD)
        return _filtered(records, _division(length).astype(np.real(records).dtype))


@dataclass(frozen=True)
class Later(BandLimited):
    """Differentiate `BandLimited` responses by the delay of echoes: multiply their spectrum by -2πi (f₀ + f) [1/s]."""

    frequency: float = 0.0  # [Hz]
    sampling_rate: float = 1.0  # [Hz]

    def finish(self, records: np.ndarray) -> np.ndarray:
        """Divide the spectrum of records (..., samples) by the bell's and differentiate."""
        length = scipy.fft.next_fast_len(records.shape[-1] + 2 * GUARD)
        offset = scipy.fft.fftfreq(length, 1 / self.sampling_rate)
        filter = -2j * np.pi * (self.frequency + offset) * _division(length)
        return _filtered(records, filter.astype(np.result_type(records, np.complex64)))


Kernel: TypeAlias = Nearest | Peterson | BandLimited
KERNELS: dict[str, type[Kernel]] = {"nearest": Nearest, "peterson": Peterson, "band_limited": BandLimited}


def make_kernel(name: str, *, taps: int | None = None) -> Kernel:
    """Make the kernel called `name`; only ``peterson`` takes `taps`."""
    if name not in KERNELS:
        raise ValueError(f"there is no kernel {name!r}; known are {', '.join(KERNELS)}")
    if taps is None:
        return KERNELS[name]()
    if name != "peterson":
        raise ValueError(f"taps={taps} does not apply to the kernel {name!r} of fixed length; only peterson takes it")
    return Peterson(taps)


def element_responses(*, delay: ArrayLike, amplitude: ArrayLike, frequency: float, sampling_rate: float, samples: int,
                      start: float = 0.0, kernel: str | Kernel = "band_limited") -> np.ndarray:
    """Sum echoes one by one in float64, as a reference for `accumulation`.

    Parameters
    ----------
    delay : (H, E) [s]
        Delay of every hit at every element.
    amplitude : complex (H,) or (H, E) [-]
    frequency, sampling_rate : float [Hz]
    samples : int
    start : float [s]
        Time of sample 0.
    kernel : str or kernel

    Returns
    -------
    complex128 (E, samples)
    """
    kernel = make_kernel(kernel) if isinstance(kernel, str) else kernel
    delay = np.asarray(delay, float)
    phasor = _columns(amplitude, delay) * np.exp(-2j * np.pi * np.mod(frequency * delay, 1.0))
    margin = kernel.margin
    records = np.zeros((delay.shape[1], samples + 2 * margin), complex)
    for record, tau, echo in zip(records, delay.T, phasor.T):
        place = (tau - start) * sampling_rate
        first = np.floor(place - 0.5 * kernel.taps).astype(np.int64) + 1
        for tap in range(kernel.taps):
            index = first + (tap + margin)
            inside = (first >= -margin) & (first + kernel.taps <= samples + margin)
            np.add.at(record, index[inside], (echo * kernel.impulse(first + tap - place))[inside])
    return kernel.finish(records)[:, margin:margin + samples]


def response_spectrum(*, delay: ArrayLike, amplitude: ArrayLike, frequency: float, offset: ArrayLike,
                      start: float = 0.0) -> np.ndarray:
    """Compute the exact spectrum Z of the responses, as defined in the module.

    Parameters
    ----------
    delay : (H, E) [s]
    amplitude : complex (H,) or (H, E) [-]
    frequency : float [Hz]
        Carrier.
    offset : (F,) [Hz]
        Frequencies relative to the carrier.
    start : float [s]

    Returns
    -------
    complex128 (E, F)
    """
    delay, offset = np.asarray(delay, float), np.asarray(offset, float)
    phasor = _columns(amplitude, delay) * np.exp(-2j * np.pi * np.mod(frequency * delay, 1.0))
    step = max(1, CHUNK // len(offset))
    total = np.zeros((delay.shape[1], len(offset)), complex)
    for begin in range(0, len(delay), step):
        part = slice(begin, begin + step)
        for row, tau, echo in zip(total, delay[part].T, phasor[part].T):
            row += echo @ np.exp(-2j * np.pi * np.outer(tau - start, offset))
    return total


def in_band_error_db(responses: np.ndarray, *, sampling_rate: float, offset: np.ndarray, exact: np.ndarray) -> float:
    """Return the rms error of the spectra of responses within a band, relative to the rms of `exact` [dB].

    Parameters
    ----------
    responses : complex (E, samples)
    sampling_rate : float [Hz]
    offset : (F,) [Hz]
        Frequencies that are compared, relative to the carrier.
    exact : complex (E, F)
        Spectrum from `response_spectrum`.
    """
    time = np.arange(responses.shape[-1]) / sampling_rate
    spectrum = np.asarray(responses, complex) @ np.exp(-2j * np.pi * np.outer(time, offset))
    return 20 * np.log10(np.linalg.norm(spectrum - exact) / np.linalg.norm(exact))


def _filtered(records: np.ndarray, filter: np.ndarray) -> np.ndarray:
    """Multiply the spectra of records (..., samples), padded to the filter's length (N,)."""
    samples = records.shape[-1]
    with workers_ended() as threads:
        spectrum = scipy.fft.fft(records, len(filter), axis=-1, workers=threads)
        spectrum *= filter
        return scipy.fft.ifft(spectrum, axis=-1, overwrite_x=True, workers=threads)[..., :samples]


def _columns(amplitude: ArrayLike, delay: np.ndarray) -> np.ndarray:
    amplitude = np.asarray(amplitude, complex)
    return np.broadcast_to(amplitude[:, None] if amplitude.ndim == 1 else amplitude, delay.shape)


def _transform(kernel: Kernel, frequency: ArrayLike) -> np.ndarray:
    nodes, weights = np.polynomial.legendre.leggauss(8 * kernel.taps)
    half = 0.5 * kernel.taps
    values = kernel.impulse(half * nodes) * weights * half
    return np.cos(2 * np.pi * np.multiply.outer(np.asarray(frequency, float), half * nodes)) @ values


@lru_cache(maxsize=8)
def _division(length: int) -> np.ndarray:
    kernel, frequency = BandLimited(), scipy.fft.fftfreq(length)
    return kernel.response(frequency) / kernel.spectrum(frequency)


POLYNOMIAL = 5                     # degree of the taps of the Kaiser-Bessel bell; higher degrees do not lower the error


def tap_weights(lib: ArrayTypes, kernel: Kernel | Bell, x: Float) -> list[Float]:
    """Return the kernel's taps for an echo x in [0, 1) after the middle one."""
    if isinstance(kernel, Nearest):
        return [lib.Float(1)]
    if isinstance(kernel, Peterson):
        return _hann_sinc(lib, x, kernel.taps)
    x = x - 0.5
    pairs = [_even_and_odd(lib, x, coefficients) for coefficients in _bell(kernel)]
    return [even + odd for even, odd in pairs] + [even - odd for even, odd in reversed(pairs)]


def turned(lib: ArrayTypes, cycles: Float) -> tuple[Float, Float]:
    """Return cosine and sine of 2π cycles to 1e-7, by the series of half the angle, doubled."""
    x = (cycles - dr.round(cycles)) * np.pi
    x2 = x * x
    x4 = x2 * x2
    sine = x * dr.fma(x4, dr.fma(x4, lib.Float(1 / 362880), dr.fma(x2, lib.Float(-1 / 5040), lib.Float(1 / 120))),
                      dr.fma(x2, lib.Float(-1 / 6), lib.Float(1)))
    cosine = dr.fma(x4, dr.fma(x4, dr.fma(x2, lib.Float(-1 / 3628800), lib.Float(1 / 40320)),
                               dr.fma(x2, lib.Float(-1 / 720), lib.Float(1 / 24))),
                    dr.fma(x2, lib.Float(-0.5), lib.Float(1)))
    twice = sine + sine
    return dr.fma(-twice, sine, 1), twice * cosine


@lru_cache
def _bell(kernel: Bell) -> list[tuple[np.ndarray, np.ndarray]]:
    """Fit polynomials, even and odd part, to the bell's first two taps for an echo x = -1/2..1/2 off their middle."""
    x = 0.5 * np.cos(np.pi * (np.arange(200) + 0.5) / 200)
    fits = (np.polynomial.Polynomial.fit(x, kernel.impulse(tap - (kernel.taps - 1) / 2 - x), POLYNOMIAL, domain=[-1, 1])
            for tap in range(kernel.taps // 2))
    return [(fit.coef[0::2], fit.coef[1::2]) for fit in fits]


def _even_and_odd(lib: ArrayTypes, x: Float, coefficients: tuple[np.ndarray, np.ndarray]) -> tuple[Float, Float]:
    x2, parts = x * x, []
    for series in coefficients:
        total = lib.Float(float(series[-1]))
        for coefficient in series[-2::-1]:
            total = dr.fma(total, x2, lib.Float(float(coefficient)))
        parts.append(total)
    return parts[0], parts[1] * x


def _hann_sinc(lib: ArrayTypes, x: Float, taps: int) -> list[Float]:
    """Return the taps of the Peterson kernel for an echo x after tap taps/2 - 1."""
    turn = x * (1 / taps)
    cosine, sine = turned(lib, turn)
    wave = turned(lib, x * 0.5)[1] * (1 / np.pi)            # sin(πx)/π
    weights = []
    for tap in range(taps):
        whole = tap - (taps // 2 - 1)
        angle = 2 * np.pi * whole / taps
        window = 0.5 + 0.5 * dr.fma(cosine, lib.Float(np.cos(angle)), sine * float(np.sin(angle)))
        away = whole - x
        near = abs(away) < 1e-4
        # sin(π (whole - x)) = -(-1)^whole sin(πx)
        sinc = dr.select(near, 1, (wave if whole % 2 else -wave) / dr.select(near, 1, away))
        weights.append(window * sinc)
    return weights
