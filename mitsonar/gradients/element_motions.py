"""What moves of a ping's echoes at elements, and what of it each parameter moves: scene coordinates, one ping.

The platform at x with the attitude R carries element e at x + R r_e. With offsets of place and attitude p and θ

    d(x + R r_e) = dp + Σ_k dθ_k (∂R/∂θ_k) r_e + R dr_e

The first is the same for all elements and does not turn with the array on the way; the others do.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["Motion"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """A direction in which a ping's echoes may change, or the gradient of a number by each part of it.

    Attributes
    ----------
    place : (3,) [m]
        Of the platform.
    rx, tx : (E, 3), (T, 3) [m]
        Of elements, besides, as the platform stands at the transmission.
    tx_delay : (T,) [s]
    tx_strength : (T,) [-]
        Relative change of what an element sends.
    target : (K, 3) [m]
        Of point targets.
    target_strength : (K,) [-]
        Relative change of their pressures.
    """

    place: np.ndarray
    rx: np.ndarray
    tx: np.ndarray
    tx_delay: np.ndarray
    tx_strength: np.ndarray
    target: np.ndarray
    target_strength: np.ndarray

    @classmethod
    def none(cls, *, receivers: int, senders: int, targets: int) -> Motion:
        """Nothing moves; arrays that may be added to."""
        return cls(place=np.zeros(3), rx=np.zeros((receivers, 3)), tx=np.zeros((senders, 3)),
                   tx_delay=np.zeros(senders), tx_strength=np.zeros(senders), target=np.zeros((targets, 3)),
                   target_strength=np.zeros(targets))

    @property
    def delays(self) -> bool:
        """Whether echoes come later or earlier by it."""
        return any(np.any(part) for part in (self.place, self.rx, self.tx, self.tx_delay, self.target))

    @property
    def strengths(self) -> bool:
        """Whether echoes get stronger or weaker by it."""
        return bool(np.any(self.tx_strength) or np.any(self.target_strength))
