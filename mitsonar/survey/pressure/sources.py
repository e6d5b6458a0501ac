"""Sources of rays, and the transmit elements that each of them represents."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsonar.sonar.arrays.array import Array


@dataclass(frozen=True, kw_only=True)
class RaySources:
    """Points where rays start, and their shares in the echoes of the transmit elements."""

    position: np.ndarray  # (S, 3) [m], body frame
    share: np.ndarray  # (S, T) [-], share of each source in the echoes of each transmit element

    @classmethod
    def from_centre(cls, transmit: Array) -> RaySources:
        """Return one source at the array's centre, so that all elements ensonify the same scatterers."""
        return cls(position=np.zeros((1, 3)), share=np.ones((1, transmit.elements)))

    @classmethod
    def from_elements(cls, transmit: Array) -> RaySources:
        """Return one source at every transmit element."""
        return cls(position=transmit.position, share=np.eye(transmit.elements))

    @classmethod
    def interpolated(cls, transmit: Array, count: int) -> RaySources:
        """Return `count` sources along the array; an element between two of them uses both, weighted linearly."""
        centred = transmit.position - transmit.position.mean(0)
        along = centred @ np.linalg.svd(centred, full_matrices=False)[2][0]
        if np.ptp(along) == 0 or count >= transmit.elements:
            return cls.from_elements(transmit)
        place = (along - along.min()) / np.ptp(along) * (count - 1)
        share = np.maximum(1 - np.abs(place[None] - np.arange(count)[:, None]), 0)
        total = share.sum(1, keepdims=True)
        if not total.all():
            raise ValueError(f"fan_count is {count}, but some of these sources of rays would represent no transmit "
                             "element. Use a smaller fan_count.")
        # A source is the centre of its elements; in a planar array, of those equally far along.
        return cls(position=share @ transmit.position / total, share=share)
