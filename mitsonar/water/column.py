"""Absorption along refracted paths, from integrals over depth that are computed once.

A ray has more arc length where it runs flatter. With s² = 1 - p² c², the mean absorption along the arc is expanded
about the mean of c² over depth, <·> the mean over depth between the two ends and e = c²/c_r² - 1:

    ᾱ = ∫ α dz/s / ∫ dz/s ≈ <α> + κ (<α e> - <α> <e>),   κ = p² c_r² / (2 (1 - p² c_r² (1 + <e>)))
    two-way loss = 2 ᾱ L

α -> ``absorption_db`` [dB/m], p ray parameter, L arc length. Exact where α is constant. Through a strong summer
thermocline at 400 kHz (94 to 110 dB/km), from 2 to 40 m deep, κ reduces the two-way error from 0.59 to 0.26 dB at
5 degrees of grazing (237 m), and from 0.16 to 0.04 dB at 10 degrees (170 m); at 100 kHz 0.03 and 0.005 dB remain.
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.units import Values

from .profile import SoundSpeedProfile, mirrored


@dataclass(frozen=True, eq=False, init=False)
class AbsorptionColumn:
    """Absorption against depth, linear between nodes and constant beyond the ends."""

    depth: np.ndarray  # (K,) [m]: increasing, positive down
    absorption_db: np.ndarray  # (K,) [dB/m]: at the frequency of the sonar, not negative

    def __init__(self, depth: ArrayLike, absorption_db: ArrayLike):
        nodes, alpha = (np.atleast_1d(np.asarray(v, float)) for v in (depth, absorption_db))
        if nodes.shape != alpha.shape or np.any(np.diff(nodes) <= 0):
            raise ValueError("an absorption column needs one value per depth, depths increasing")
        if not np.all(np.isfinite(alpha) & (alpha >= 0)):
            raise ValueError(f"absorption must be finite and not negative; somewhere it is {np.min(alpha):g} dB/m")
        object.__setattr__(self, "depth", nodes)
        object.__setattr__(self, "absorption_db", alpha)

    def mirrored(self) -> AbsorptionColumn:
        """Return the column with the water below the surface mirrored above it."""
        return type(self)(*mirrored(self.depth, self.absorption_db))

    def lifted(self, height: float) -> AbsorptionColumn:
        """Return the column of water whose surface lies `height` [m] above depth 0; itself if nothing changes."""
        return self if height == 0 or len(self.depth) == 1 else type(self)(self.depth - height, self.absorption_db)

    def added(self, depth: np.ndarray, offset: np.ndarray) -> AbsorptionColumn:
        """Return the column plus an offset [dB/m] at depths (K,) [m], linear between them and constant beyond."""
        nodes = np.union1d(self.depth, depth)
        return type(self)(nodes, self.at(nodes) + np.interp(nodes, depth, offset))

    def mixed(self, other: AbsorptionColumn, share: float) -> AbsorptionColumn:
        """Return the column between this one, share 0, and another, share 1, at the nodes of both."""
        nodes = np.union1d(self.depth, other.depth)
        return type(self)(nodes, (1 - share) * self.at(nodes) + share * other.at(nodes))

    def at(self, depth: Values) -> Values:
        """Return the absorption [dB/m] at depths [m]."""
        return cast(Values, np.interp(depth, self.depth, self.absorption_db))


def column_integrals(column: AbsorptionColumn, profile: SoundSpeedProfile, deepest: float, steps: int,
                     top: float = 0.0) -> tuple[np.ndarray, float]:
    """Return integrals (steps + 1, 4) over even depths from `top` to `deepest` [m], and the reference speed c_r [m/s].

    The columns are the integrals of α, α e and e from `top`, and α itself.
    """
    z = np.linspace(top, deepest, steps + 1)
    nodes = np.concatenate([column.depth, profile.depth])
    fine = np.unique(np.concatenate([z, nodes[(nodes > top) & (nodes < deepest)]]))
    alpha, speed = column.at(fine), profile.at(fine)
    c_r = float(speed.mean())
    e = (speed / c_r) ** 2 - 1
    integrals = [np.concatenate([[0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(fine))])
                 for v in (alpha, alpha * e, e)]
    return np.stack([*(np.interp(z, fine, v) for v in integrals), column.at(z)], -1), c_r
