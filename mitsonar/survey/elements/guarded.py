"""Echoes at the elements by the vector approximation, and by eigenrays where that is in doubt."""
from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import numpy as np

from ...device.arrays import compressed
from ...signal.accumulation import ImpulseResponses
from .delays import ALL_ROWS, ElementDelays
from .echo_classes import SortedEchoes
from .eigenrays import EigenrayDelays
from .vectors import VectorDelays

__all__ = ["GuardedDelays"]


@dataclass(frozen=True, kw_only=True, eq=False)
class GuardedDelays(ElementDelays):
    """Delays by the vector approximation, exact where it may be off by more than `vectors.GUARD`."""

    def add(self, responses: ImpulseResponses, some: SortedEchoes, element: int, *, weight: float,
            rows: slice = ALL_ROWS) -> None:
        """Sum the echoes of one transmit element at receive elements; see `ElementDelays.add`.

        Raises
        ------
        ValueError
            If most echoes are in doubt and the array is large; see `ArrivalCounts.judge`.
        """
        vector = self.changed_to(VectorDelays)
        doubtful = vector.doubtful(some.echoes) if self._extended else None
        vector.add(responses, some, element, weight=weight, rows=rows, without=doubtful)
        if doubtful is not None:
            exact = compressed(doubtful)
            if dr.width(exact):
                self.counts.judge(some.echoes.count, dr.width(exact))
                self.changed_to(EigenrayDelays).add(responses, some.chosen(exact), element, weight=weight, rows=rows)

    @property
    def _extended(self) -> bool:
        """Whether any element is not where the source is."""
        return any(np.any(array.position != self.source.position) for array in (self.transmit, self.receive))
