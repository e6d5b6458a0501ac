"""Estimate angles of echoes from the phases of rows of receivers, one above the other: phase-differencing bathymetry.

Row k stands at x_k wavelengths along an axis and receives z_k = a e^(i2π x_k s) from an echo of sine s. The products
R_kl = <z_k z_l*> are averaged over a window of samples, and the angle is the maximum of

    f(s) = Σ_{k<l} Re R_kl e^(-i2π (x_k - x_l) s)                                                               (1)

This is the maximum of a beam of all rows: the maximum likelihood estimate for one echo in white noise (Böhme, 1984,
Proc. ICASSP; Van Trees, 2002, Optimum Array Processing, ch. 8), and for two rows the phase difference. Close rows
resolve the ambiguity of far rows, far rows are precise, and incoherent pairs have less weight. Several echoes at one
time give an angle between theirs.

    γ = f(s) / Σ_{k<l} √(R_kk R_ll)        coherence of all rows; of two |R_12| / √(R_11 R_22)                  (2)
    σ_s² = (1 + 1/(K q)) / (2 N q 4π² Σ (x_k - x̄)²) + (b s)² / (12 N)                                           (3)
    q = γ' / (1 - γ'),      γ' = γ / mean_{k<l} sinc(b (x_k - x_l) s)

The first term is the Cramér-Rao bound of one echo q times as strong as the noise of each row, in N independent samples;
for two rows 2πd apart in phase it is σ_φ² = (1 - γ²) / (2 γ² N) (Rodríguez and Martin, 1992, IEE Proc. F 139). A pulse
of bandwidth b f reaches far rows at other times, so they lose coherence even without noise; the sinc is what remains.
The second term is its effect on the angle: the middle frequency of N samples' echoes varies by b f / √(12 N), and the
sine is computed with the carrier's.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsonar.sonar.arrays.array_factor import array_factor

__all__ = ["RowAngles", "ReceiverRows", "sector_of"]

PER_PERIOD = 8                     # sines tried in the shortest period of (1)
STEPS = 4                          # of Newton's method
ALIKE = 0.9                        # share of the maximum of f that other sines of the sector may reach
BLOCK = 1 << 22                    # numbers in memory at once
CERTAIN = 1 - 1e-6                 # largest coherence in (3)
MARGIN = np.deg2rad(10.0)          # search beyond nadir and horizon, because the platform rolls
STEEPEST = np.deg2rad(80.0)        # off the face's normal


@dataclass(frozen=True, kw_only=True, eq=False)
class RowAngles:
    """Angles of the echoes in B windows of samples.

    Attributes
    ----------
    sine : (B,)
        s, along the rows' axis.
    inside : bool (B,)
        True if the maximum lies within the sector, False at its ends.
    coherence : (B,)
        γ of (2).
    phase : (B,) [rad]
        Wrapped phase of the last row less the first.
    deviation : (B,)
        σ_s of (3).
    power : (B,) [signals squared]
        Mean power of the rows.
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
        x_k, increasing positions along the axis.
    sector : (float, float)
        Least and largest sine that is searched.

    Raises
    ------
    ValueError
        If there are fewer than two rows, they do not increase, or they are ambiguous within the sector.
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
        alike = np.abs(array_factor(place, np.full(len(place), 1 / len(place)), first=0, step=gap[1], count=len(gap)))
        # beyond the main lobe
        lobe = int(np.argmax(np.diff(alike) > 0)) if (np.diff(alike) > 0).any() else len(gap)
        if (alike[lobe:] > ALIKE).any():
            worst = lobe + int(alike[lobe:].argmax())
            raise ValueError(f"rows at {np.array2string(place, precision=3)} wavelengths take sines {gap[worst]:.3g} "
                             f"apart for the same, and echoes come from sines {high - low:.3g} apart; let two rows be "
                             f"less than {1 / (high - low):.2g} wavelengths from each other.")

    @property
    def baseline(self) -> float:
        """Return the distance from the first row to the last [wavelengths]."""
        return float(np.ptp(self.place))

    def angles(self, signals: np.ndarray, *, per_bin: int, window: int, looks: float,
               relative_bandwidth: float = 0.0) -> RowAngles:
        """Return the angles of the echoes in bins.

        Parameters
        ----------
        signals : complex (K, S)
            Signals of the rows.
        per_bin : int
            Samples in a bin; S is a multiple of it.
        window : int
            Samples that are averaged about the bin's middle, at least `per_bin`.
        looks : float
            N, independent samples in a window.
        relative_bandwidth : float
            b, bandwidth over the carrier frequency.
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
        """Return σ_s of (3), (B,), inf where γ is 0; for the arguments see `angles` and `RowAngles`."""
        first, second = np.triu_indices(len(self.place), 1)
        apart = relative_bandwidth * np.multiply.outer(self.place[first] - self.place[second], sine)
        white = np.clip(coherence / np.maximum(np.sinc(apart).mean(0), 1e-3), 0, CERTAIN)
        spread = float(np.sum((self.place - self.place.mean()) ** 2))
        with np.errstate(divide="ignore"):
            ratio = white / (1 - white)
            noise = (1 + 1 / (len(self.place) * ratio)) / (2 * looks * ratio * 4 * np.pi ** 2 * spread)
        return np.sqrt(noise + (relative_bandwidth * sine) ** 2 / (12 * looks))

    def _tried(self, width: float) -> int:
        """Return the number of sines to try over a width."""
        return 2 + int(np.ceil(PER_PERIOD * width * self.baseline))

    def _searched(self, products: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the maxima of (1), (B,), and True where they lie within the sector."""
        low, high = self.sector
        tried = np.linspace(low, high, self._tried(high - low))
        waves = np.exp(-1j * np.outer(turn, tried))                                          # (pairs, sines)
        best = np.concatenate([np.argmax(np.real(block.T @ waves), 1) for block in np.array_split(
            products, 1 + products.shape[1] * len(tried) // BLOCK, axis=1)])
        sine, step = tried[best], tried[1] - tried[0]
        for _ in range(STEPS):
            turned = products * np.exp(-1j * np.outer(turn, sine))
            slope, bend = (turn[:, None] * np.imag(turned)).sum(0), (turn[:, None] ** 2 * np.real(turned)).sum(0)
            rising = np.where(bend > 0, slope / np.where(bend > 0, bend, 1), 0.5 * step * np.sign(slope))
            sine = np.clip(sine + np.clip(rising, -step, step), low, high)
        return sine, (sine > low) & (sine < high)


def sector_of(tilt: float) -> tuple[float, float]:
    """Return the range of sines along the rows of a face tilted down [rad], from below nadir to above the horizon."""
    low, high = -(0.5 * np.pi - tilt) - MARGIN, tilt + MARGIN
    return float(np.sin(max(low, -STEEPEST))), float(np.sin(min(high, STEEPEST)))


def _windows(samples: int, per_bin: int, window: int) -> np.ndarray:
    """Return the first and the end sample of each bin's window: int (2, B)."""
    begin = np.arange(samples // per_bin) * per_bin
    aside = max(0, -(-(window - per_bin) // 2))
    return np.stack([np.maximum(begin - aside, 0), np.minimum(begin + per_bin + aside, samples)])


def _means(values: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return the means over windows."""
    sums = np.concatenate([np.zeros(1, values.dtype), np.cumsum(values)])
    return (sums[ends[1]] - sums[ends[0]]) / (ends[1] - ends[0])
