"""Echoes at the elements by the vector approximation, and by eigenrays where that is in doubt."""
from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from ...echoes.record import Echoes
from ...signal.accumulation import ImpulseResponses
from .delays import ALL_ROWS, ElementDelays
from .eigenrays import EigenrayDelays
from .vectors import VectorDelays

__all__ = ["GuardedDelays"]


@dataclass(frozen=True, kw_only=True, eq=False)
class GuardedDelays(ElementDelays):
    """Delays by the vector approximation, exact where it may be off by more than `vectors.GUARD`."""

    def add(self, responses: ImpulseResponses, echoes: Echoes, element: int, *, weight: float, late: mi.Float64,
            rows: slice = ALL_ROWS) -> None:
        """Sum the echoes of one transmit element at receive elements; see `ElementDelays.add`.

        Raises
        ------
        ValueError
            If most echoes are in doubt and the array is large; see `ArrivalCounts.judge`.
        """
        vector = self.changed_to(VectorDelays)
        if self._extended:
            doubtful = vector.doubtful(echoes)
            if dr.any(doubtful):
                late = late + dr.zeros(mi.Float64, dr.width(doubtful))
                exact, rest = dr.compress(doubtful), dr.compress(~doubtful)
                self.counts.judge(dr.width(doubtful), dr.width(exact))
                self.changed_to(EigenrayDelays).add(responses, echoes.chosen(exact), element, weight=weight,
                                                   late=dr.gather(mi.Float64, late, exact), rows=rows)
                if not dr.width(rest):
                    return
                echoes, late = echoes.chosen(rest), dr.gather(mi.Float64, late, rest)
        vector.add(responses, echoes, element, weight=weight, late=late, rows=rows)

    @property
    def _extended(self) -> bool:
        """Whether any element is not where the source is."""
        return any(np.any(array.position != self.source.position) for array in (self.transmit, self.receive))
