"""Angles of echoes by the phases of rows of receivers, one above the other: phase-differencing bathymetry.

Rows k stand at x_k wavelengths along an axis. An echo of the sine s along it makes z_k = a e^(i2π x_k s) of them. Over
a window of samples the rows' products R_kl = <z_k z_l*> are averaged, and the angle is where

    f(s) = Σ_{k<l} Re R_kl e^(-i2π (x_k - x_l) s)                                                               (1)

is largest. This is the maximum of a beam formed of all rows, which of one echo in white noise is the maximum likelihood
(Böhme, 1984, Proc. ICASSP; Van Trees, 2002, Optimum Array Processing, ch. 8). Of two rows it is the phase difference.
Of more, close rows say which of the answers of far ones is right, far ones say it precisely, and pairs that have lost
their coherence count less by themselves. Several echoes at one time give an angle between theirs.

    γ = f(s) / Σ_{k<l} √(R_kk R_ll)        coherence of all rows; of two |R_12| / √(R_11 R_22)                  (2)
    σ_s² = (1 + 1/(K q)) / (2 N q 4π² Σ (x_k - x̄)²) + (b s)² / (12 N)                                           (3)
    q = γ' / (1 - γ'),      γ' = γ / mean_{k<l} sinc(b (x_k - x_l) s)

The first term is the bound of Cramér and Rao of one echo q times as strong as the noise of each row, in N independent
samples; of two rows that are 2πd apart in phase it is σ_φ² = (1 - γ²) / (2 γ² N) (Rodríguez and Martin, 1992, IEE Proc.
F 139). Far rows lose coherence even without noise, as a pulse of the bandwidth b f comes to them at other times: they
hear other parts of the bed. The sinc is what is left then. What it does to the angle is the second term: the middle
frequency of N samples' echoes strays by b f / √(12 N), and the sine is read with the carrier's.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["RowAngles", "ReceiverRows", "sector_of"]

PER_PERIOD = 8                     # sines tried in the shortest period of (1)
STEPS = 4                          # of Newton's method
ALIKE = 0.9                        # of f's largest, that another sine of the sector may reach
BLOCK = 1 << 22                    # numbers worked on at once
CERTAIN = 1 - 1e-6                 # coherence that (3) counts with at most
MARGIN = np.deg2rad(10.0)          # beyond nadir and horizon, that echoes are looked for: a platform rolls
STEEPEST = np.deg2rad(80.0)        # off the face's normal


@dataclass(frozen=True, kw_only=True, eq=False)
class RowAngles:
    """What windows of samples say, (B,) each.

    Attributes
    ----------
    sine : [-]
        s, along the rows' axis.
    inside : bool
        Whether it is a maximum within the sector, not its end.
    coherence : [-]
        γ of (2).
    phase : [rad]
        Of the two rows farthest apart, the last less the first, wrapped.
    deviation : [-]
        σ_s of (3).
    power : [of the signals, squared]
        Mean of the rows.
    """

    sine: np.ndarray
    inside: np.ndarray
    coherence: np.ndarray
    phase: np.ndarray
    deviation: np.ndarray
    power: np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class ReceiverRows:
    """Rows of receivers.

    Parameters
    ----------
    place : (K,) [wavelengths]
        x_k, along the axis; rising.
    sector : (float, float) [-]
        Sines between which echoes are looked for.

    Raises
    ------
    ValueError
        If there are fewer than two, they do not rise, or do not tell the sector's sines apart.
    """

    place: np.ndarray
    sector: tuple[float, float]

    def __post_init__(self):
        place = np.asarray(self.place, float)
        object.__setattr__(self, "place", place)
        if place.ndim != 1 or len(place) < 2 or not np.isfinite(place).all() or not (np.diff(place) > 0).all():
            raise ValueError(f"rows are at {np.array2string(place, precision=3)} wavelengths; give two or more places "
                             "that rise.")
        low, high = self.sector
        gap = np.linspace(0, high - low, self._tried(high - low))
        alike = np.abs(np.exp(2j * np.pi * np.multiply.outer(gap, place)).mean(1))
        # beyond the main lobe
        lobe = int(np.argmax(np.diff(alike) > 0)) if (np.diff(alike) > 0).any() else len(gap)
        if (alike[lobe:] > ALIKE).any():
            worst = lobe + int(alike[lobe:].argmax())
            raise ValueError(f"rows at {np.array2string(place, precision=3)} wavelengths take sines {gap[worst]:.3g} "
                             f"apart for the same, and echoes come from sines {high - low:.3g} apart; let two rows be "
                             f"less than {1 / (high - low):.2g} wavelengths from each other.")

    @property
    def baseline(self) -> float:
        """From the first row to the last [wavelengths]."""
        return float(np.ptp(self.place))

    def angles(self, signals: np.ndarray, *, per_bin: int, window: int, looks: float,
               relative_bandwidth: float = 0.0) -> RowAngles:
        """Return the angles of the echoes in bins.

        Parameters
        ----------
        signals : complex (K, S)
            Of the rows.
        per_bin : int
            Samples of a bin; S is a multiple of it.
        window : int
            Samples that are averaged, at least `per_bin`; about the bin's middle.
        looks : float
            N, independent samples in a window.
        relative_bandwidth : float
            b.
        """
        ends = _windows(signals.shape[1], per_bin, window)
        first, second = np.triu_indices(len(self.place), 1)
        power = np.stack([_means(np.abs(row.astype(complex)) ** 2, ends) for row in signals])
        products = np.stack([_means(signals[k].astype(complex) * np.conj(signals[m]), ends)
                             for k, m in zip(first, second)])
        turn = 2 * np.pi * (self.place[first] - self.place[second])
        sine, inside = self._searched(products, turn)
        whole = np.sqrt(power[first] * power[second]).sum(0)
        with np.errstate(invalid="ignore", divide="ignore"):
            coherence = np.real(products * np.exp(-1j * np.outer(turn, sine))).sum(0) / whole
        coherence = np.clip(np.nan_to_num(coherence), 0, 1)
        widest = int(np.argmin(turn))
        return RowAngles(sine=sine, inside=inside & (whole > 0), coherence=coherence,
                         phase=np.angle(np.conj(products[widest])), power=power.mean(0),
                         deviation=self.deviation(coherence, sine, looks, relative_bandwidth))

    def deviation(self, coherence: np.ndarray, sine: np.ndarray, looks: float,
                  relative_bandwidth: float = 0.0) -> np.ndarray:
        """Return σ_s of (3), (B,), inf where nothing is known; arguments as of `angles` and `RowAngles`."""
        first, second = np.triu_indices(len(self.place), 1)
        apart = relative_bandwidth * np.multiply.outer(self.place[first] - self.place[second], sine)
        white = np.clip(coherence / np.maximum(np.sinc(apart).mean(0), 1e-3), 0, CERTAIN)
        spread = float(np.sum((self.place - self.place.mean()) ** 2))
        with np.errstate(divide="ignore"):
            ratio = white / (1 - white)
            noise = (1 + 1 / (len(self.place) * ratio)) / (2 * looks * ratio * 4 * np.pi ** 2 * spread)
        return np.sqrt(noise + (relative_bandwidth * sine) ** 2 / (12 * looks))

    def _tried(self, width: float) -> int:
        """How many sines are looked at over a width."""
        return 2 + int(np.ceil(PER_PERIOD * width * self.baseline))

    def _searched(self, products: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Maxima of (1), (B,), and whether they lie within the sector."""
        low, high = self.sector
        tried = np.linspace(low, high, self._tried(high - low))
        waves = np.exp(-1j * np.outer(turn, tried))                                          # (pairs, sines)
        best = np.concatenate([np.argmax(np.real(some.T @ waves), 1) for some in np.array_split(
            products, 1 + products.shape[1] * len(tried) // BLOCK, axis=1)])
        sine, step = tried[best], tried[1] - tried[0]
        for _ in range(STEPS):
            turned = products * np.exp(-1j * np.outer(turn, sine))
            slope, bend = (turn[:, None] * np.imag(turned)).sum(0), (turn[:, None] ** 2 * np.real(turned)).sum(0)
            rising = np.where(bend > 0, slope / np.where(bend > 0, bend, 1), 0.5 * step * np.sign(slope))
            sine = np.clip(sine + np.clip(rising, -step, step), low, high)
        return sine, (sine > low) & (sine < high)


def sector_of(tilt: float) -> tuple[float, float]:
    """Return sines along the rows of a face tilted down [rad], from nadir to horizon and somewhat beyond."""
    low, high = -(0.5 * np.pi - tilt) - MARGIN, tilt + MARGIN
    return float(np.sin(max(low, -STEEPEST))), float(np.sin(min(high, STEEPEST)))


def _windows(samples: int, per_bin: int, window: int) -> np.ndarray:
    """First and last sample, left out, of each bin's window: int (2, B)."""
    begin = np.arange(samples // per_bin) * per_bin
    aside = max(0, -(-(window - per_bin) // 2))
    return np.stack([np.maximum(begin - aside, 0), np.minimum(begin + per_bin + aside, samples)])


def _means(values: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Means over windows."""
    sums = np.concatenate([np.zeros(1, values.dtype), np.cumsum(values)])
    return (sums[ends[1]] - sums[ends[0]]) / (ends[1] - ends[0])
