"""Delays along a straight line of elements as a polynomial through the differences at a few points of the line.

    δ(u) ≈ Σ_k c_k u^k,   c = V⁻¹ (δ(u_1), .., δ(u_N)),   u_i = cos(π (i - 1/2) / N),   V_ik = u_i^k

u -> the place on the line, -1 and 1 at its ends, c -> the echo's own. A straight vector of length R to points up to h
off has δ = (√(R² + 2 R s u h + u² h²) - R) / c, whose N-th Taylor coefficient is below h^N / (4 R^(N-1) c): what the
polynomial leaves is at most

    ε = (R / 2c) (h / 2R)^N

(interpolation at Chebyshev's points, e.g. Trefethen 2013, Approximation Theory and Approximation Practice, ch. 8).

Elements up to H off the level see other water than the source: a correction of about H e / (2 w c), e = c_m² <1/c²> - 1
and w the vertical cosine (`vector_approximation`). With the largest e of the whole profile, and m the largest deviation
of the elements' own e from a polynomial along the line, which kinks of the profile cause, polynomials leave about

    H (e (h / 2R)^N + m) / (2 w c)

of it, taken at w = FLATTEST. Rays that nearly turn at the array leave several times that, but less than a tenth of the
error that they have without polynomials.
"""
from __future__ import annotations

from collections.abc import Sequence

import drjit as dr
import numpy as np
from numpy.typing import ArrayLike

from mitsonar.device.types import Float
from mitsonar.water.profile import SoundSpeedProfile

from .vector_approximation import FLATTEST, vector_element_fields

NODES = 5, 6, 7                    # N, smallest sufficient first
STRAIGHT_WITHIN = 1e-9             # [m]
ALONG_WITHIN = 1e-4                # change of direction from element to element that is no line's


class LineChange:
    """Elements on a straight line."""
    # offsets (E, 3) [m]; place (E,) [-]; nodes (N, 3) [m]

    def __init__(self, offsets: np.ndarray, count: int = NODES[0]):
        first, last = offsets[0], offsets[-1]
        self.middle, self.half = 0.5 * (first + last), 0.5 * (last - first)
        self.place = (offsets - self.middle) @ self.half / (self.half @ self.half)
        self.count = count
        self.nodes = self.middle + _places(count)[:, None] * self.half

    @classmethod
    def through(cls, offsets: ArrayLike, count: int = NODES[0]) -> LineChange | None:
        """Return the line that elements (E, 3) [m] lie on, the outermost first and last; None if they do not."""
        offsets = np.asarray(offsets, float)
        if not np.any(offsets[-1] - offsets[0]):
            return None
        line = cls(offsets, count)
        off = np.abs(offsets - line.middle - line.place[:, None] * line.half).max()
        return line if off < STRAIGHT_WITHIN and np.abs(line.place).max() < 1 + 1e-9 else None

    def angle(self, nearest: float) -> float:
        """Return the largest parallax [rad] along the line, against its middle, of echoes beyond `nearest` [m].

        Infinite if echoes may be too near.
        """
        reach = float(np.linalg.norm(self.half))
        length = nearest - float(np.linalg.norm(self.middle)) - reach
        return reach / length if length > reach else np.inf

    def error(self, nearest: float, speed: float) -> float:
        """Return ε [s] for echoes from `nearest` [m] on, at a sound speed [m/s]; infinite if too near."""
        angle = self.angle(nearest)
        length = float(np.linalg.norm(self.half)) / angle
        return length / (2 * speed) * (0.5 * angle) ** self.count if angle < 1 else np.inf

    def water_error(self, nearest: float, speed: float, *, depth: float, profile: SoundSpeedProfile,
                    height: float) -> float:
        """Return what polynomials leave of the corrections for elements up to `height` [m] off the level, [s]."""
        elements, nodes = (vector_element_fields(place, depth, profile)[4:] for place in (
            self.middle + self.place[:, None] * self.half, self.nodes))
        there, at_nodes = (np.vander(u, self.count, increasing=True) for u in (self.place, _places(self.count)))
        along = there @ np.linalg.inv(at_nodes)
        mean, rate, bend, variance = (float(np.abs(along @ np.broadcast_to(node, self.count) - element).max())
                                      for element, node in zip(elements, nodes))
        most = (profile.sound_speed.max() / profile.sound_speed.min()) ** 2 - 1
        smooth = most * (0.5 * self.angle(nearest)) ** self.count
        kinks = mean + height * (rate + height * bend) + variance / (4 * FLATTEST**2)
        return height * (smooth + kinks) / (2 * FLATTEST * speed)

    @staticmethod
    def coefficients(values: Sequence[Float]) -> list[Float]:
        """Return c of echoes from their differences at the nodes, Float (H,) each."""
        rows = []
        for row in np.linalg.inv(np.vander(_places(len(values)), increasing=True)):
            total = float(row[0]) * values[0]
            for weight, value in zip(row[1:], values[1:]):
                total = dr.fma(type(value)(float(weight)), value, total)
            rows.append(total)
        return rows


def straight_runs(offsets: np.ndarray) -> list[slice]:
    """Return runs of consecutive elements (E, 3) [m] that lie on one straight line each, such as banks of an array."""
    step = np.diff(offsets, axis=0)
    step /= np.maximum(np.linalg.norm(step, axis=1, keepdims=True), STRAIGHT_WITHIN)
    bent = np.linalg.norm(np.diff(step, axis=0), axis=1) > ALONG_WITHIN
    runs, first = [], 0
    while first < len(offsets):
        # an element at which the direction changes is the last of its line
        ahead = np.flatnonzero(bent[first:])
        end = first + ahead[0] + 2 if len(ahead) else len(offsets)
        runs.append(slice(first, int(end)))
        first = int(end)
    return runs


def _places(count: int) -> np.ndarray:
    """Return Chebyshev's points, u of the nodes (N,)."""
    return np.cos(np.pi * (np.arange(count) + 0.5) / count)


def polynomial(coefficients: Sequence[Float], at: Float) -> Float:
    """Return Σ c_k u^k."""
    total = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        total = dr.fma(total, at, coefficient)
    return total
