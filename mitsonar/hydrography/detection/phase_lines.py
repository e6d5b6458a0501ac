"""Lines through the phase of split beams, on the device: a lane follows the samples of a beam.

    x_n = sin(± acos(t₀ cos ψ / t_n) + θ - ψ) - sin θ                                                     (1)
    c_n = s_n p_n* e^{-i(β₀ + β₁ x_n)},   |x_n| <= reach                                                  (2)
    β₀ = arg Σ c_n  of β₀ = 0                                                                             (3)
    (Σ w_n, Σ w_n x_n; Σ w_n x_n, Σ w_n x_n²) (Δβ₀, Δβ₁) = Σ (1, x_n) Im c_n,  w_n = max(Re c_n, 0.3 |c_n|)  (4)
    variance = Σ_n (Σ_{|k| < K/2} u_{n+k})² / K,   u_n = Im c_n (1, x_n) · g                              (5)

s, p -> samples of the starboard and the port half, t₀ -> ``found``, ψ -> ``incidence``, sin θ -> ``sines``,
β₁ -> ``turn``. (4) is one step from the line of the expected slope, and g is how the crossing -β₀ / β₁ follows from its
right side.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import numpy as np

from mitsonar.device.arrays import arrays_of, looped, upload
from mitsonar.device.types import ArrayTypes, Bool, Float, Int32, UInt32

from .windows import windows_about

LEAST_WEIGHT = 0.3                 # of a sample's magnitude
FLATTEST = 1e-5                    # least determinant of (4) over m₀ m₂, which float32 still tells


@dataclass(frozen=True, kw_only=True, eq=False)
class PhaseLines:
    """Expected lines of B beams."""

    found: np.ndarray  # (B,) [s], time at which the bed crosses the axis
    half: np.ndarray  # (B,) [s], half the window about it
    incidence: np.ndarray  # (B,) [rad]
    sines: np.ndarray  # (B,)
    reach: np.ndarray  # (B,), largest |x|
    turn: np.ndarray  # (B,) [rad], β₁


@dataclass(frozen=True, kw_only=True, eq=False)
class PhaseFit:
    """Fitted lines of B beams."""

    crossing: np.ndarray  # (B,), x where the phase is 0
    turn: np.ndarray  # (B,) [rad], β₁
    variance: np.ndarray  # (B,) [rad²], of the phase at the crossing, if samples were independent
    count: np.ndarray  # (B,), samples within reach


class PhaseSamples:
    """Samples of both halves in windows of the beams, on the device."""

    def __init__(self, lib: ArrayTypes, halves: tuple[np.ndarray, np.ndarray], time: np.ndarray, centre: np.ndarray,
                 half: np.ndarray):
        # halves (B, T); time (T,) [s]; centre, half (B,) [s]
        self._lib, self._time, self._windows = lib, time, windows_about(time, centre, half)
        port, starboard = (self._windows.taken(record) for record in halves)
        product = (starboard * np.conj(port)).view(np.float32)
        # by a power of two, so that no square is too small or large for float32, and nothing is rounded
        largest = float(np.abs(product).max(initial=0.0))
        self._product = upload(lib.Float, np.ldexp(product, -int(np.frexp(largest)[1])))

    def offsets(self, lines: PhaseLines) -> np.ndarray:
        """Return β₀ (B,) [rad]."""
        return self._followed(lines).offset().numpy()

    def fitted(self, lines: PhaseLines, block: int) -> PhaseFit:
        """Fit the lines' offsets and slopes; the scatter is summed over `block` samples."""
        followed = self._followed(lines)
        offset = followed.offset()
        dr.eval(offset)
        found = followed.line(offset, 2 * (block // 2) + 1)
        dr.eval(found)
        return PhaseFit(**{name: value.numpy() for name, value in found.items()})

    def _followed(self, lines: PhaseLines) -> _FollowedLines:
        lib, windows, time = self._lib, self._windows, self._time
        about = windows_about(time, lines.found, lines.half)
        begin = np.clip(about.begin, windows.begin, windows.end)
        leaning, cosine = np.arcsin(lines.sines) - lines.incidence, np.cos(lines.incidence)
        place = (lines.found - time[0]) / (time[1] - time[0])
        whole = np.floor(place)
        columns = {"found": lines.found, "part": place - whole, "sine": np.abs(np.sin(lines.incidence)),
                   "cosine": cosine, "most": 1 / cosine - 1, "ahead": cosine * np.sin(leaning),
                   "aside": np.sign(lines.incidence) * np.cos(leaning), "reach": lines.reach, "turn": lines.turn}
        return _FollowedLines(
            product=self._product, step=dr.opaque(lib.Float, float(time[1] - time[0])), one=dr.opaque(lib.UInt32, 1),
            begin=upload(lib.UInt32, begin), end=upload(lib.UInt32, np.clip(about.end, begin, windows.end)),
            shift=upload(lib.UInt32, (windows.start - windows.begin).astype(np.uint32)),
            whole=upload(lib.Int32, whole), **{name: upload(lib.Float, column) for name, column in columns.items()})


@dataclass(frozen=True, kw_only=True, eq=False)
class _FollowedLines:
    """Samples begin <= n < end of B beams, sample n at n + `shift` of the windows, and the lines through them."""

    product: Float  # s p* of all windows, real and imaginary part by turns
    step: Float  # [s], between samples
    one: UInt32  # a literal step makes iterations wait for one another on x86
    begin: UInt32
    end: UInt32
    shift: UInt32
    found: Float  # [s], t₀
    whole: Int32  # number of the sample before t₀,
    part: Float  # and how much later t₀ is, in samples
    sine: Float  # |sin ψ|
    cosine: Float  # cos ψ
    most: Float  # 1 / cos ψ - 1
    ahead: Float  # cos ψ sin(θ - ψ)
    aside: Float  # ± cos(θ - ψ)
    reach: Float
    turn: Float

    def offset(self) -> Float:
        """Return β₀ of (3)."""
        lib = arrays_of(self.turn)

        def add(number: UInt32, real: Float, imaginary: Float) -> tuple:
            _, along, across, _ = self._sample(number, lib.Float(0), self.turn)
            return number + self.one, real + along, imaginary + across

        _, real, imaginary = self._sums(add, 2)
        return dr.atan2(imaginary, real)

    def line(self, offset: Float, block: int) -> dict[str, Float]:
        """Return the fields of a `PhaseFit` by (4) and (5)."""
        lib = arrays_of(offset)

        def add(number: UInt32, m0: Float, m1: Float, m2: Float, e0: Float, e1: Float,
                count: Float) -> tuple:
            x, along, across, inside = self._sample(number, offset, self.turn)
            weight = dr.maximum(along, LEAST_WEIGHT * dr.sqrt(along * along + across * across))
            return (number + self.one, m0 + weight, m1 + weight * x, m2 + weight * x * x, e0 + across,
                    e1 + across * x, count + dr.select(inside, 1.0, 0.0))

        _, m0, m1, m2, e0, e1, count = self._sums(add, 6)
        determinant = m0 * m2 - m1 * m1
        # without a spread of x there is no slope
        determinant = dr.select(determinant > FLATTEST * m0 * m2, determinant, dr.nan)
        slope = (m0 * e1 - m1 * e0) / determinant
        moved = (e0 - slope * m1) / m0
        turn, offset = self.turn + slope, offset + moved
        crossing = -offset / turn
        g0, g1 = (m2 - m1 * crossing) / determinant, (m0 * crossing - m1) / determinant
        length = dr.opaque(lib.UInt32, block)

        pulls = dr.zeros(lib.Float, dr.width(self.product) // 2)

        def pull(number: UInt32) -> tuple:
            x, _, across, inside = self._sample(number, offset, turn)
            dr.scatter(pulls, across * dr.fma(g1, x, g0), number + self.shift, inside)
            return number + self.one,

        self._sums(pull, 0)
        dr.eval(pulls)

        def spread(number: UInt32, total: Float, squares: Float) -> tuple:
            # the middle of the K samples up to here
            before, middle = number - length, number - length // 2
            total += dr.gather(lib.Float, pulls, number + self.shift, number < self.end)
            total -= dr.gather(lib.Float, pulls, before + self.shift, number >= self.begin + length)
            inside = (middle >= self.begin) & (middle < self.end)
            return number + self.one, total, squares + dr.select(inside, total * total, 0.0)

        _, _, squares = self._sums(spread, 2, length // 2)
        return {"crossing": crossing, "turn": turn, "variance": squares / lib.Float(length), "count": count}

    def _sums(self, add: Callable[..., tuple], count: int, beyond: UInt32 | int = 0) -> tuple:
        """Return what `add` makes of each sample's number and so many sums, from 0, `beyond` the last sample."""
        last = self.end + beyond
        return looped((self.begin, *(dr.zeros(type(self.turn), dr.width(self.begin)) for _ in range(count))),
                      lambda number, *_: number < last, add, "samples")

    def _sample(self, number: UInt32, offset: Float, turn: Float) -> tuple[Float, Float, Float, Bool]:
        """Return x, the real and imaginary part of c, and True for samples within reach; c is 0 for others."""
        lib = arrays_of(turn)
        late = (lib.Float(lib.Int32(number) - self.whole) - self.part) * self.step
        # v = t₀/t - 1:  x = ± cos(θ - ψ) (√(sin²ψ - cos²ψ v (2 + v)) - |sin ψ|) + v cos ψ sin(θ - ψ),
        # whose difference of roots is not lost in rounding as -cos²ψ v (2 + v) over their sum
        v = dr.minimum(-late / dr.maximum(self.found + late, 1e-12), self.most)
        less = self.cosine * self.cosine * v * (2 + v)
        root = dr.sqrt(dr.maximum(self.sine * self.sine - less, 0))
        x = dr.fma(v, self.ahead, -self.aside * less / (root + self.sine))
        inside = (number >= self.begin) & (number < self.end) & (abs(x) <= self.reach)
        real, imaginary = dr.gather(lib.Array2f, self.product, number + self.shift, inside)
        sine, cosine = dr.sincos(dr.fma(turn, x, offset))
        return x, dr.fma(real, cosine, imaginary * sine), dr.fma(imaginary, cosine, -real * sine), inside
