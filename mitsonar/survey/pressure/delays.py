"""Delays of echoes between one source of rays and the elements of an array: the common part of all methods."""
from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import TypeVar

import drjit as dr
import numpy as np

from mitsonar.device.types import Float, Float64, Int32
from mitsonar.signal.accumulation import ImpulseResponses
from mitsonar.sonar.arrays.array import Array

from .array_survey import Sampling
from .echo_classes import SortedEchoes
from .ping_source import PingSource

MOST_DOUBTFUL = 0.5                # share of doubtful echoes above which an array is too large for the approximation
SMALL_ARRAY = 1.0                  # [m] radius below which doubtful echoes are traced one by one without an error
FEWEST_JUDGED = 1000               # least number of echoes for a verdict
ALL_ROWS = slice(None)
Kind = TypeVar("Kind", bound="ElementDelays")


class ArrivalCounts:
    """Counts of arrivals at elements, and of echoes for which the vector approximation is in doubt."""
    # radius [m] of the array; guard [s]

    def __init__(self, *, radius: float, guard: float):
        self.radius, self.guard = radius, guard
        self.arrivals = self.lost = self.judged = self.doubtful = 0

    def count(self, arrivals: int, lost: int = 0) -> None:
        """Add arrivals, of which some are lost."""
        self.arrivals, self.lost = self.arrivals + arrivals, self.lost + lost

    def judge(self, echoes: int, doubtful: int) -> None:
        """Add echoes, of which some are doubtful; raise `ValueError` if too many are, for a large array."""
        self.judged, self.doubtful = self.judged + echoes, self.doubtful + doubtful
        if self.radius > SMALL_ARRAY and self.doubtful > MOST_DOUBTFUL * max(self.judged, FEWEST_JUDGED):
            raise ValueError(f"the array reaches {self.radius:.3g} m from its centre, too far for the vector "
                             f"approximation here: for {100 * self.doubtful / self.judged:.0f} % of the echoes it may "
                             f"be off by more than {1e9 * self.guard:g} ns, soonest where rays turn or run nearly "
                             "level; take return_path=\"eigenray\", a smaller array or a shorter range")


@dataclass(frozen=True, kw_only=True, eq=False)
class ElementDelays(ABC):
    """Delays of echoes, and sums of echoes with them: `VectorDelays`, `EigenrayDelays`, `GuardedDelays`."""

    source: PingSource
    transmit: Array
    receive: Array
    wavelength: float  # [m], of the carrier, for the elements' patterns
    sampling: Sampling
    counts: ArrivalCounts

    @abstractmethod
    def add(self, responses: ImpulseResponses, some: SortedEchoes, element: int, *, weight: float,
            rows: slice = ALL_ROWS) -> None:
        """Add the echoes of one transmit element to the responses of receive elements."""

    def stands_off(self, element: int) -> bool:
        """Return True if a transmit element is not where the source is."""
        return bool(np.any(self.transmit.position[element] != self.source.position))

    def placed(self, some: SortedEchoes, arrival: Float64) -> tuple[Float, Int32, Float]:
        """Return phase, sample and fraction of echoes with arrival times (R,) [s]; see `Sampling.place`."""
        phase, sample, fraction = self.sampling.place(arrival + some.late)
        if some.turn is not None:
            phase -= type(phase)(some.turn - dr.floor(some.turn))
        return phase, sample, fraction

    def changed_to(self, kind: type[Kind]) -> Kind:
        """Return the same delays by another method."""
        return kind(**{field.name: getattr(self, field.name) for field in fields(ElementDelays)})
