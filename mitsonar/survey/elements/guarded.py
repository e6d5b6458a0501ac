"""Echoes at the elements by the vector approximation, and by eigenrays where that is in doubt."""
from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import drjit as dr
import mitsuba as mi
import numpy as np

from ...device.arrays import arrays_of
from ...device.types import Float64, UInt32
from ...echoes.record import Echoes
from ...signal.accumulation import ImpulseResponses
from .delays import ALL_ROWS, ElementDelays
from .eigenrays import EigenrayDelays
from .vectors import VectorDelays

__all__ = ["GuardedDelays"]


@dataclass(frozen=True, kw_only=True, eq=False)
class GuardedDelays(ElementDelays):
    """Delays by the vector approximation, exact where it may be off by more than `vectors.GUARD`."""

    def add(self, responses: ImpulseResponses, echoes: Echoes, element: int, *, weight: float, late: Float64,
            rows: slice = ALL_ROWS) -> None:
        """Sum the echoes of one transmit element at receive elements; see `ElementDelays.add`.

        Raises
        ------
        ValueError
            If most echoes are in doubt and the array is large; see `ArrivalCounts.judge`.
        """
        vector, kind = self.changed_to(VectorDelays), arrays_of(mi.Float).Float64
        if self._extended:
            doubtful = vector.doubtful(echoes)
            if dr.any(doubtful):
                late = late + dr.zeros(kind, dr.width(doubtful))
                exact, rest = (cast(UInt32, dr.compress(some)) for some in (doubtful, ~doubtful))
                self.counts.judge(dr.width(doubtful), dr.width(exact))
                self.changed_to(EigenrayDelays).add(responses, echoes.chosen(exact), element, weight=weight,
                                                   late=dr.gather(kind, late, exact), rows=rows)
                if not dr.width(rest):
                    return
                echoes, late = echoes.chosen(rest), dr.gather(kind, late, rest)
        vector.add(responses, echoes, element, weight=weight, late=late, rows=rows)

    @property
    def _extended(self) -> bool:
        """Whether any element is not where the source is."""
        return any(np.any(array.position != self.source.position) for array in (self.transmit, self.receive))
