"""Classes of echoes with nearly one Doppler factor; each class is convolved with its own time scale of the pulse.

`OneClass` treats all echoes as if they had one factor. `DopplerClasses` puts each echo into the class of the nearest
factor, with the exact arrival time of the middle of the pulse and, for a sweep, the exact frequency there.
"""
from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import cast

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, compressed, held, picked
from mitsonar.device.types import Float64, UInt32
from mitsonar.echoes.record import Echoes
from mitsonar.propagation.returns.return_paths import ReturnPaths
from mitsonar.signal.doppler import Glide, factor_tolerance, longer_period
from mitsonar.sonar.pulses.pulses import Pulse

from .doppler import SAME_PLACE, factor_per_metre, receiver_groups, time_scale
from .ping_source import PingSource

DRIFT = 1e-3                       # [cycles] that elements may drift from the source until a pulse's middle


@dataclass(frozen=True, kw_only=True)
class SortedEchoes:
    """Echoes with the delays, phases and numbers of their classes."""

    echoes: Echoes
    late: Float64  # (R,) [s], additional delay, in phase as in place
    turn: Float64 | None = None  # (R,) [cycles], lead of the phases
    sheet: UInt32 | None = None  # (R,), numbers of the classes, counted from the first wanted class
    moment: float = 0.0  # [s], moment of the pulse for which the delays of elements against the source are taken
    back: ReturnPaths | None = None  # of echoes that leave at `Echoes.arrival`, and at the moment, if they are known

    def with_way_back(self, source: PingSource) -> tuple[SortedEchoes, ReturnPaths]:
        """Return the echoes with their paths back to a source, and these paths."""
        back = source.way_back(self.echoes, later=self.moment) if self.back is None else self.back
        return replace(self, back=back), back

    def chosen(self, index: UInt32) -> SortedEchoes:
        """Return the echoes with these numbers."""
        return SortedEchoes(echoes=self.echoes.chosen(index), late=picked(self.late, index),
                            turn=None if self.turn is None else picked(self.turn, index),
                            sheet=None if self.sheet is None else picked(self.sheet, index), moment=self.moment)


class EchoClasses(ABC):
    """Classes of echoes."""

    factors: np.ndarray  # (K,) [-], two-way Doppler factors of the classes

    @abstractmethod
    def receiver_groups(self, source: PingSource, echoes: Echoes,
                        position: np.ndarray) -> list[tuple[slice, np.ndarray]]:
        """Return groups of receive elements (E, 3) [m] with equal classes of echoes: rows and centre (3,) of each."""

    @abstractmethod
    def sort(self, source: PingSource, echoes: Echoes, wanted: range, *, sender: np.ndarray, receiver: np.ndarray,
             delay: float, reach: float = 0.0) -> SortedEchoes | None:
        """Return the echoes of the wanted classes; None if there are none."""
        # sender, receiver (3,) [m]; delay [s]; reach [m], of receive elements from the source


class OneClass(EchoClasses):
    """One class of all echoes, as if they had one factor."""

    def __init__(self, factor: float = 1.0):
        self.factors = np.array([factor])

    def receiver_groups(self, source: PingSource, echoes: Echoes,
                        position: np.ndarray) -> list[tuple[slice, np.ndarray]]:
        """Return one group of all receive elements; see `EchoClasses.receiver_groups`."""
        return [(slice(None), source.position)]

    def sort(self, source: PingSource, echoes: Echoes, wanted: range, *, sender: np.ndarray, receiver: np.ndarray,
             delay: float, reach: float = 0.0) -> SortedEchoes:
        """Return all echoes; see `EchoClasses.sort`."""
        if not delay:
            return SortedEchoes(echoes=echoes, late=dr.opaque(arrays_of(mi.Float).Float64, 0.0))
        back = source.way_back(echoes)
        late = time_scale(source, echoes, back, sender=sender, receiver=receiver, moment=delay)[1]
        return SortedEchoes(echoes=echoes, late=late, back=back)


class DopplerClasses(EchoClasses):
    """Classes of Doppler factors; each echo is in exactly one class."""
    # factors (K,) [-]; begin [s]

    def __init__(self, factors: np.ndarray, begin: float, pulse: Pulse, glide: Glide | None = None):
        self.factors, self.begin, self.pulse, self.glide = np.asarray(factors, float), begin, pulse, glide

    def receiver_groups(self, source: PingSource, echoes: Echoes,
                        position: np.ndarray) -> list[tuple[slice, np.ndarray]]:
        """Return groups of receive elements with nearly equal factors; see `EchoClasses.receiver_groups`."""
        return receiver_groups(source, echoes, position, factor_tolerance(self.pulse))

    def sort(self, source: PingSource, echoes: Echoes, wanted: range, *, sender: np.ndarray, receiver: np.ndarray,
             delay: float, reach: float = 0.0) -> SortedEchoes | None:
        """Return each echo in the class of the nearest factor; see `EchoClasses.sort`."""
        moment = self.begin + 0.5 * self.pulse.duration + delay
        later = self._later(source, echoes, moment, reach)
        back = source.way_back(echoes, later=later)
        doppler, when = time_scale(source, echoes, back, sender=sender, receiver=receiver, moment=moment)
        if not np.allclose(receiver, source.position, rtol=0, atol=SAME_PLACE):
            _, when = time_scale(source, echoes, back, sender=sender, receiver=source.position, moment=moment)
        number, factor = self._nearest(doppler)
        if len(wanted) < len(self.factors):
            dr.eval(doppler, when, number, factor)
            index = compressed((number >= wanted.start) & (number < wanted.stop))
            if not dr.width(index):
                return None
            echoes, number, back = echoes.chosen(index), dr.gather(type(number), number, index), None
            doppler, when, factor = (dr.gather(type(part), part, index) for part in (doppler, when, factor))
        wide, turn = arrays_of(mi.Float).Float64, None
        late = when - dr.opaque(wide, 0.5 * self.pulse.duration) / factor
        if self.glide is not None:
            # opaque, so that another pulse needs no other kernel
            glide = Glide(*cast(list[float], [dr.opaque(wide, part) for part in self.glide]))
            more, turn = glide.shift(longer_period(doppler - 1, factor - 1), factor)
            late += more
        return SortedEchoes(echoes=echoes, late=late, turn=turn,
                            sheet=number - wanted.start if len(wanted) > 1 else None, moment=later, back=back)

    def _later(self, source: PingSource, echoes: Echoes, moment: float, reach: float) -> float:
        """Return the moment [s] for which delays of receive elements up to `reach` [m] from the source are taken.

        While an array passes, its elements approach an echo at other speeds than the source, so that delays at the
        beginning of a long pulse do not hold for its middle. The moment is 0 if that matters less than `DRIFT`.
        """
        if not (moment and reach):
            return 0.0
        cycles = moment * factor_per_metre(source, echoes) * reach * self.pulse.frequency
        return moment if cycles > DRIFT else 0.0

    def _nearest(self, doppler: Float64) -> tuple[UInt32, Float64]:
        """Return the number and the factor of the class nearest to each factor."""
        width = float(self.factors[1] - self.factors[0]) if len(self.factors) > 1 else 1.0
        lib = arrays_of(mi.Float)
        first, width, last = (dr.opaque(lib.Float64, value)
                              for value in (float(self.factors[0]), width, len(self.factors) - 1))
        number = held(dr.round((doppler - first) / width), 0, last)
        return lib.UInt32(number), dr.fma(number, width, first)
