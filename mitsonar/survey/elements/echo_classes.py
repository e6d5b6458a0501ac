"""Echoes in classes of nearly one Doppler factor, each of which is convolved with its own time scale of the pulse.

Two kinds: `OneClass` takes all echoes as if they had one factor; `DopplerClasses` puts each echo into the class whose
factor is nearest, delayed so that the middle of the pulse arrives when it does.
"""
from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator
from typing import cast

import drjit as dr
import mitsuba as mi
import numpy as np

from ...device.arrays import arrays_of
from ...device.lookups import held
from ...device.types import Float64, UInt32
from ...echoes.record import Echoes
from ...signal.doppler import factor_tolerance
from ...sonar.pulses import Pulse
from .doppler import receiver_groups, time_scale
from .ping_source import PingSource

__all__ = ["DopplerClasses", "EchoClasses", "OneClass"]


class EchoClasses(ABC):
    """Classes of echoes.

    Attributes
    ----------
    factors : (K,) [-]
        Two-way Doppler factors that stand for them.
    """

    factors: np.ndarray

    @abstractmethod
    def receiver_groups(self, source: PingSource, echoes: Echoes,
                        position: np.ndarray) -> list[tuple[slice, np.ndarray]]:
        """Group receive elements at positions (E, 3) [m] that sort echoes alike: their rows, and their middle (3,)."""

    @abstractmethod
    def sort(self, source: PingSource, echoes: Echoes, wanted: Collection[int], *, sender: np.ndarray,
             receiver: np.ndarray, delay: float) -> Iterator[tuple[int, Echoes, Float64]]:
        """Put echoes into classes.

        Parameters
        ----------
        source : PingSource
        echoes : Echoes
        wanted : collection of int
            Numbers of the classes asked for.
        sender, receiver : (3,) [m]
            Where sound is sent and received, body frame.
        delay : float [s]
            By which it is sent later.

        Yields
        ------
        number : int
            Of a class that has echoes.
        echoes : Echoes
        late : Float64 (R,) or (1,) [s]
            By how much they arrive later.
        """


class OneClass(EchoClasses):
    """All echoes, as if one factor were that of all."""

    def __init__(self, factor: float = 1.0):
        self.factors = np.array([factor])

    def receiver_groups(self, source: PingSource, echoes: Echoes,
                        position: np.ndarray) -> list[tuple[slice, np.ndarray]]:
        """Put all receive elements into one group; see `EchoClasses.receiver_groups`."""
        return [(slice(None), source.position)]

    def sort(self, source: PingSource, echoes: Echoes, wanted: Collection[int], *, sender: np.ndarray,
             receiver: np.ndarray, delay: float) -> Iterator[tuple[int, Echoes, Float64]]:
        """Take all echoes; see `EchoClasses.sort`."""
        late = dr.opaque(arrays_of(mi.Float).Float64, 0.0)
        if delay:
            late = time_scale(source, echoes, sender=sender, receiver=receiver, moment=delay)[1]
        yield 0, echoes, late


class DopplerClasses(EchoClasses):
    """Echoes sorted by their Doppler factors: each is in one class, rounding or not.

    Parameters
    ----------
    factors : (K,) [-]
        Equally spaced and rising, as of `signal.doppler.doppler_classes`.
    begin : float [s]
        When the pulse begins, or its piece.
    pulse : Pulse
    """

    def __init__(self, factors: np.ndarray, begin: float, pulse: Pulse):
        self.factors, self.begin, self.pulse = np.asarray(factors, float), begin, pulse

    def receiver_groups(self, source: PingSource, echoes: Echoes,
                        position: np.ndarray) -> list[tuple[slice, np.ndarray]]:
        """Group receive elements whose factors differ too little to matter; see `EchoClasses.receiver_groups`."""
        return receiver_groups(source, echoes, position, factor_tolerance(self.pulse))

    def sort(self, source: PingSource, echoes: Echoes, wanted: Collection[int], *, sender: np.ndarray,
             receiver: np.ndarray, delay: float) -> Iterator[tuple[int, Echoes, Float64]]:
        """Put each echo into the class of the nearest factor; see `EchoClasses.sort`."""
        lib = arrays_of(mi.Float)
        doppler, when = time_scale(source, echoes, sender=sender, receiver=receiver,
                                   moment=self.begin + 0.5 * self.pulse.duration + delay)
        number = self._numbers(doppler)
        dr.eval(when, number)
        occurring = set(np.unique(number.numpy()).tolist())
        for one in wanted:
            if one in occurring:
                index = cast(UInt32, dr.compress(number == dr.opaque(lib.UInt32, one)))
                half = dr.opaque(lib.Float64, 0.5 * self.pulse.duration / float(self.factors[one]))
                yield one, echoes.chosen(index), dr.gather(lib.Float64, when, index) - half

    def _numbers(self, doppler: Float64) -> UInt32:
        """Give the number of the class nearest to each factor."""
        width = float(self.factors[1] - self.factors[0]) if len(self.factors) > 1 else 1.0
        lib = arrays_of(mi.Float)
        first, width, last = (dr.opaque(lib.Float64, value)
                              for value in (float(self.factors[0]), width, len(self.factors) - 1))
        return lib.UInt32(held(dr.round((doppler - first) / width), 0, last))
