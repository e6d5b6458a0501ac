"""Delays of echoes between one source of rays and the elements of an array: what all ways to find them share."""
from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import TypeVar

import numpy as np

from ...device.types import Float64
from ...echoes.record import Echoes
from ...signal.accumulation import ImpulseResponses
from ...sonar.array import Array
from .arrivals import ArrivalCounts
from .ping_source import PingSource
from .sampling import Sampling

__all__ = ["ALL_ROWS", "ElementDelays"]

ALL_ROWS = slice(None)
Kind = TypeVar("Kind", bound="ElementDelays")


@dataclass(frozen=True, kw_only=True, eq=False)
class ElementDelays(ABC):
    """A way to find delays, and to sum echoes with them. Subclasses say which: `vectors`, `eigenrays`, `guarded`.

    Attributes
    ----------
    source : PingSource
    transmit, receive : Array
    wavelength : float [m]
        Of the carrier, for which elements' patterns are taken.
    sampling : Sampling
        Of the record.
    counts : ArrivalCounts
        Where arrivals are counted.
    """

    source: PingSource
    transmit: Array
    receive: Array
    wavelength: float
    sampling: Sampling
    counts: ArrivalCounts

    @abstractmethod
    def add(self, responses: ImpulseResponses, echoes: Echoes, element: int, *, weight: float, late: Float64,
            rows: slice = ALL_ROWS) -> None:
        """Sum the echoes of one transmit element at receive elements.

        Parameters
        ----------
        responses : ImpulseResponses
            They are added here.
        echoes : Echoes
        element : int
            The transmit element.
        weight : float [-]
            Of what it transmits.
        late : Float64 (R,) or (1,) [s]
            By how much echoes arrive later, in their phase as in their place.
        rows : slice
            Receive elements.
        """

    def stands_off(self, element: int) -> bool:
        """Whether a transmit element is not where the source is."""
        return bool(np.any(self.transmit.position[element] != self.source.position))

    def changed_to(self, kind: type[Kind]) -> Kind:
        """Give the same with another way to find delays."""
        return kind(**{field.name: getattr(self, field.name) for field in fields(ElementDelays)})
