"""Sources that rays are traced from, and how they stand for transmit elements."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsonar.sonar.arrays.array import Array


@dataclass(frozen=True, kw_only=True)
class RaySources:
    """Hold sources that rays are traced from, and how they stand for the transmit elements."""

    position: np.ndarray  # (S, 3) [m]: body frame
    share: np.ndarray  # (S, T) [-]: share of a transmit element's echoes that the rays of each source bring

    @classmethod
    def from_centre(cls, transmit: Array) -> RaySources:
        """Put one source at the array's centre: all elements ensonify the same scatterers."""
        return cls(position=np.zeros((1, 3)), share=np.ones((1, transmit.elements)))

    @classmethod
    def from_elements(cls, transmit: Array) -> RaySources:
        """Put a source at every transmit element."""
        return cls(position=transmit.position, share=np.eye(transmit.elements))

    @classmethod
    def interpolated(cls, transmit: Array, count: int) -> RaySources:
        """Put a few sources along the array; an element between two takes the rays of both, more of the nearer one's.
        """
        centred = transmit.position - transmit.position.mean(0)
        along = centred @ np.linalg.svd(centred, full_matrices=False)[2][0]
        if np.ptp(along) == 0 or count >= transmit.elements:
            return cls.from_elements(transmit)
        place = (along - along.min()) / np.ptp(along) * (count - 1)
        share = np.maximum(1 - np.abs(place[None] - np.arange(count)[:, None]), 0)
        total = share.sum(1, keepdims=True)
        if not total.all():
            raise ValueError(f"fan_count is {count}, but some of these sources of rays would stand for no transmit "
                             "element; take fewer")
        # A source stands amid the elements it stands for: in a planar array, amid those equally far along.
        return cls(position=share @ transmit.position / total, share=share)
