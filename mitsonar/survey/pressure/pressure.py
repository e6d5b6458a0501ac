"""The pressure record: impulse responses between the elements of arrays, from the echoes of every ping.

The stages of one ping, in order:

    ensonify         echoes of scatterers that are connected to a source, with amplitudes    `ensonified_ping`
    transmit         delay and pattern of one transmit element after the other               `elements.vectors`
    return, sum      every echo at all receive elements, where they are then                 `elements.vectors`

A source is a point that rays are traced from; `RaySources` says which there are, and which share of each transmit
element they stand for. Elements' patterns are taken at the frequency of the carrier.
"""
from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from functools import cached_property

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.echoes.ensonification import Ensonification
from mitsonar.echoes.record import Echoes
from mitsonar.signal.accumulation import ImpulseResponses
from mitsonar.signal.doppler import glide_of
from mitsonar.sonar.pulses.pulses import Pulse

from .array_survey import ArraySurvey
from .delays import ArrivalCounts, ElementDelays
from .echo_classes import DopplerClasses, EchoClasses, OneClass
from .eigenrays import EigenrayDelays
from .ensonified_ping import EnsonifiedPing, ensonification_of
from .ping_source import PingSource
from .vectors import GUARD, GuardedDelays, VectorDelays

SUMS_BYTES = 1 << 30               # of the sums of one ping

Progress = Callable[[float], None]


class PressureRecord:
    """Make the impulse responses of a survey's pings."""

    def __init__(self, survey: ArraySurvey, *, seed: int = 0, kernel: str = "band_limited",
                 return_path: str = "vector", paths: Collection[str] | None = None):
        self.survey, self.seed = survey, int(seed)
        self.kernel, self.return_path, self.paths = kernel, return_path, paths
        self.counts = ArrivalCounts(radius=survey.radius, guard=GUARD)
        self._ensonified: EnsonifiedPing | None = None

    @cached_property
    def ensonification(self) -> Ensonification:
        """Return the ensonification of the survey's scatterers."""
        return ensonification_of(self.survey)

    def responses(self, ping: int, *, progress: Callable[[float, int], None] | None = None) -> np.ndarray:
        """Make the responses of all pairs of elements to one ping."""
        survey, elements = self.survey, self.survey.transmit.elements
        out = np.empty((elements, survey.receive.elements, survey.samples), np.complex64)
        sums = self.sums()
        for element in range(elements):
            def within(share: float, before: int = element) -> None:
                if progress is not None:
                    progress(before + share, elements)

            sums.clear()
            self._add(sums, OneClass(), range(1), ping, element, progress=within)
            out[element] = sums.read()
            within(1.0)
        return out

    def transmissions(self, ping: int, doppler: np.ndarray, *, piece: tuple[float, Pulse] | None = None,
                      progress: Progress | None = None) -> Iterator[tuple[float, np.ndarray]]:
        """Make the responses to all transmit elements together, with their delays and weights.

        The weights are scaled so that their magnitudes add to 1.
        """
        # doppler (K,) [-]
        classes = self.classes(doppler, piece)
        count = len(classes.factors)
        # As many classes at once as fit into memory: the fewer times scatterers have to be ensonified.
        sums = self.sums()
        together = min(max(1, SUMS_BYTES // (4 * dr.width(sums.sums))), count)
        for first in range(0, count, together):
            now = range(first, min(first + together, count))
            if first or together > 1:
                sums = self.sums(len(now))
            self.add_all(sums, classes, now, ping, _of_a_part(progress, first / count, len(now) / count))
            for sheet, one in enumerate(now):
                response = sums.read(sheet)
                if response.any():
                    yield float(classes.factors[one]), response

    def classes(self, doppler: np.ndarray, piece: tuple[float, Pulse] | None = None) -> EchoClasses:
        """Make the classes of echoes that some Doppler factors stand for; arguments as of `transmissions`."""
        begin, pulse = piece or (0.0, self.survey.pulse)
        still = pulse is self.survey.pulse and np.all(doppler == 1.0)
        glide = glide_of(pulse) if pulse is self.survey.pulse else None
        return OneClass() if still else DopplerClasses(doppler, begin, pulse, glide)

    def add_all(self, sums: ImpulseResponses, classes: EchoClasses, wanted: range, ping: int,
                progress: Progress | None = None) -> None:
        """Add the echoes of all transmit elements, with their delays and weights, to the sums of the wanted classes."""
        weight, delay = self.survey.transmit_weight(ping), self.survey.transmit_delay(ping)
        senders = np.flatnonzero(weight).tolist()
        for number, element in enumerate(senders):
            self._add(sums, classes, wanted, ping, element, weight=float(weight[element]), delay=float(delay[element]),
                      progress=_of_a_part(progress, number / len(senders), 1 / len(senders)))

    def sums(self, sheets: int = 1) -> ImpulseResponses:
        """Make the sums of all receive elements, at zero: a sheet for each of some classes."""
        survey = self.survey
        return ImpulseResponses(mi.Float, elements=survey.receive.elements, samples=survey.samples, sheets=sheets,
                                sampling_rate=survey.sampling_rate, frequency=survey.frequency, kernel=self.kernel)

    def _add(self, sums: ImpulseResponses, classes: EchoClasses, wanted: range, ping: int, element: int, *,
             weight: float = 1.0, delay: float = 0.0, progress: Progress | None = None) -> None:
        """Add the echoes of one transmit element, with a weight and a delay [s], to the sums of the wanted classes."""
        sender, receivers = self.survey.transmit.position[element], self.survey.receive.position
        ensonified = self.ensonified(ping)
        shares = ensonified.shares(element)
        with_cells = len(shares) - 1       # the last source, of what is drawn by chance, knows no cells
        for done, (number, share) in enumerate(shares):
            source = ensonified.source(number)
            delays = self.delays(source)
            blocks = ensonified.echoes(number, _of_a_part(progress, done / with_cells, 1 / with_cells))
            for echoes in filter(self._counts, blocks):
                for rows, middle in classes.receiver_groups(source, echoes, receivers):
                    some = classes.sort(source, echoes, wanted, sender=sender, receiver=middle, delay=delay)
                    if some is not None:
                        delays.add(sums, some, element, weight=float(weight * share), rows=rows)

    def _counts(self, echoes: Echoes) -> bool:
        """Return True if echoes came by one of the paths asked for."""
        return self.paths is None or echoes.path in self.paths

    def ensonified(self, ping: int) -> EnsonifiedPing:
        """Return a ping's sources and echoes; those of the last one are kept."""
        if self._ensonified is None or self._ensonified.ping != ping:
            self._ensonified = EnsonifiedPing(self.survey, self.ensonification, ping, self.seed, self._ensonified)
        return self._ensonified

    def delays(self, source: PingSource) -> ElementDelays:
        """Return the delays from a source to the elements, by the record's method."""
        survey = self.survey
        guarded = GuardedDelays(source=source, transmit=survey.transmit, receive=survey.receive,
                                wavelength=survey.wavelength, sampling=survey.sampling, counts=self.counts)
        if self.return_path == "vector":
            return guarded
        if self.return_path == "eigenray":
            return guarded.changed_to(EigenrayDelays)
        return replace(guarded.changed_to(VectorDelays), method=self.return_path)


def _of_a_part(progress: Progress | None, before: float, part: float) -> Progress | None:
    """Make the progress of a part out of that of the whole, of which a share `before` is done already."""
    return None if progress is None else lambda share: progress(before + part * share)
