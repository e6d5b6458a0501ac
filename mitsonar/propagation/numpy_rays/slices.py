"""Mean and variance of the squared slowness 1/c² between two depths, of a profile linear between nodes (NumPy).

With e = r²/c² - 1, r the mean of the nodes' speeds, and c1, c2 the speeds at the ends of a piece of thickness h:

    ∫ e dz  = h (r²/(c1 c2) - 1)
    ∫ e² dz = h (r⁴ (c1² + c1 c2 + c2²) / (3 c1³ c2³) - 2 r²/(c1 c2) + 1)

exactly, so that sums from the first node down, subtracted, lose nothing that matters to a travel time.
"""
import numpy as np

from mitsonar.device.types import Real
from mitsonar.water.profile import SoundSpeedProfile

THINNEST = 1e-9            # [m]: below, the mean is the value at the depth itself


class Slices:
    """Table of the slowness integrals that give a ray's time through a thin horizontal slice of water."""

    def __init__(self, profile: SoundSpeedProfile):
        self.profile = profile
        self._reference = float(profile.sound_speed.mean())
        speed, thickness = profile.sound_speed, np.diff(profile.depth)
        pieces = np.array(self._piece(thickness, speed[:-1], speed[1:]))
        self._sums = np.concatenate([np.zeros((2, 1)), np.cumsum(pieces, axis=1)], axis=1)

    def between(self, depth: Real, other: Real) -> tuple[np.ndarray, np.ndarray]:
        """Return mean [s²/m²] and variance [s⁴/m⁴] of 1/c² between two depths [m], either above; they broadcast."""
        depth, other = np.broadcast_arrays(np.asarray(depth, float), np.asarray(other, float))
        thickness = other - depth
        thin = np.abs(thickness) < THINNEST
        divisor = np.where(thin, 1.0, thickness)
        first, second = (self._sum(other) - self._sum(depth)) / divisor
        local = (self._reference / self.profile.at(depth)) ** 2 - 1
        first = np.where(thin, local, first)
        variance = np.where(thin, 0.0, np.maximum(second - first**2, 0.0))
        return (1 + first) / self._reference**2, variance / self._reference**4

    def _sum(self, depth: np.ndarray) -> np.ndarray:
        """Both integrals, (2, ...), from the first node to ``depth``."""
        nodes = self.profile.depth
        above = np.clip(np.searchsorted(nodes, depth, side="right") - 1, 0, None)
        rest = self._piece(depth - nodes[above], self.profile.sound_speed[above], self.profile.at(depth))
        return self._sums[:, above] + np.array(rest)

    def _piece(self, thickness: np.ndarray, upper: np.ndarray, lower: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        ratio = self._reference**2 / (upper * lower)
        fourth = ratio**2 * (upper**2 + upper * lower + lower**2) / (3 * upper * lower)
        return thickness * (ratio - 1), thickness * (fourth - 2 * ratio + 1)
