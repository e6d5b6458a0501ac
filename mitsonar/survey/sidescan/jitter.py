"""Jitter of a sidescan's faces from ping to ping: less of the speckle is common to pings than ideal faces share.

    <g(p) g*(q)> = e^{-2σ²} <ρ(δ_p - δ_q)> <g(p) g*(q)>_0                                                         (1)
    ρ(δ) = ∫ b(u) b*(u - δ) du / ∫ |b|² du,        e^{-δ²/4s²} of b = e^{-u²/2s²}:  <ρ> = 1/√(1 + ε²/s²)         (2)
    g(p) = e^{-σ²} g_0(p) + √(1 - e^{-2σ²}) n(p)                                                                  (3)

δ -> error of a ping's heading, Gaussian, of rms ε -> ``yaw``; b the two-way pressure of both faces. σ -> ``phase``, rms
error of phase of each face's segments, which changes from ping to ping and differs from sending to receiving: the main
lobe keeps e^{-σ²/2} of its pressure each way (Ruze 1966, Proc. IEEE 54, 633), and what it loses comes by diffuse side
lobes from other scatterers of the gate: n, independent from ping to ping and gate to gate. Mean levels stay.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsonar.device.chance import Salt, ping_key
from mitsonar.signal.gates import between


@dataclass(frozen=True, kw_only=True)
class Jitter:
    """Errors of faces that change from ping to ping, root mean squares."""

    yaw: float = 0.0  # [rad]: of the heading, which no record of the attitude has
    phase: float = 0.0  # [rad]: of each face's segments

    def turned(self, rotation: np.ndarray, ping: np.ndarray, seed: int) -> np.ndarray:
        """Return the attitudes (B, 3, 3) of pings (B,) with their errors of heading."""
        if not self.yaw:
            return rotation
        error = self.yaw * np.array([_random(seed, one, Salt.YAW_JITTER).standard_normal() for one in ping])
        turn = np.zeros_like(rotation)
        turn[:, 0, 0] = turn[:, 1, 1] = np.cos(error)
        turn[:, 1, 0], turn[:, 2, 2] = np.sin(error), 1.0
        turn[:, 0, 1] = -turn[:, 1, 0]
        return rotation @ turn

    def mixed(self, speckle: np.ndarray, ping: np.ndarray, seed: int) -> np.ndarray:
        """Return speckle (B, 2, gates, steps) of pings (B,) with what comes by diffuse side lobes, see (3)."""
        if not self.phase:
            return speckle
        own = np.stack([_random(seed, one, Salt.PHASE_JITTER).standard_normal((*speckle.shape[1:3], 2), np.float32)
                        for one in ping])
        kept = np.exp(-self.phase ** 2)
        drawn = own.view(np.complex64)[..., 0] * np.float32(np.sqrt(0.5 * (1 - kept ** 2)))
        return np.float32(kept) * speckle + between(drawn, speckle.shape[-1], np.sqrt)


STEADY = Jitter()


def _random(seed: int, ping: int, salt: int) -> np.random.Generator:
    """Return the generator of a ping."""
    return np.random.Generator(np.random.Philox(key=ping_key(seed, int(ping), salt=salt)))
