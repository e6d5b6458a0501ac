"""Course of a hull that rides on waves: it rises, pitches and rolls as the water under its waterline does.

    z     = Σ_j F_j a_j cos ψ_j
    pitch = arctan ∂z/∂u,    roll = -arctan ∂z/∂v,    F_j = sinc(k_j·u L / 2) sinc(k_j·v B / 2),  sinc x = sin x / x

u, v -> directions ahead and to starboard; L, B -> length and beam of the waterline; a, k, ψ -> as in
`water.sea_waves`. F is the mean of a wave over the waterline, which is what moves a hull that is light for its size
(Froude and Krylov's hypothesis); resonance in roll is left out.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsonar.water.sea_waves import SeaWaves

from .trajectory import Lead

AT_ONCE = 4096                     # times of a block


@dataclass(frozen=True, kw_only=True, eq=False)
class Riding(Lead):
    """Course with the motion of waves added to it."""

    course: Lead
    waves: SeaWaves
    length: float  # [m]: L
    beam: float  # [m]: B

    def at(self, times: np.ndarray, since: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        position, attitude = self.course.at(times, since)
        place, heading = position[..., :2].reshape(-1, 2), attitude[..., 2].ravel()
        moved = np.concatenate([self._moved(place[part], np.ravel(times)[part], heading[part]) for part in (
            slice(first, first + AT_ONCE) for first in range(0, max(1, len(place)), AT_ONCE))])
        rise, along, across = moved.T.reshape(3, *position.shape[:-1])
        level = np.zeros_like(rise)
        return (position + np.stack([level, level, rise], -1),
                attitude + np.stack([-np.arctan(across), np.arctan(along), level], -1))

    def _moved(self, place: np.ndarray, time: np.ndarray, heading: np.ndarray) -> np.ndarray:
        """Return z, and its slopes ahead and to starboard, (N, 3), at places (N, 2), times and headings (N,)."""
        waves, (sine, cosine) = self.waves, (np.sin(heading), np.cos(heading))
        ahead, starboard = (np.stack(way, 1) @ waves.vector.T for way in ((sine, cosine), (cosine, -sine)))
        felt = waves.amplitude * np.sinc(ahead * self.length / (2 * np.pi)) * np.sinc(
            starboard * self.beam / (2 * np.pi))
        psi = place @ waves.vector.T - np.multiply.outer(time, waves.rate) + waves.phase
        steep = -felt * np.sin(psi)
        return np.stack([(felt * np.cos(psi)).sum(1), (steep * ahead).sum(1), (steep * starboard).sum(1)], 1)
