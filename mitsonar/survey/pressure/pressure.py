"""Pressure record: impulse responses between the elements of arrays, from the echoes of every ping.

The stages of one ping, in order:

    ensonify         echoes of scatterers that are connected to a source, with amplitudes    `ensonified_ping`
    transmit         delay and pattern of one transmit element after the other               `vectors`
    return, sum      every echo at all receive elements, at their places then                `vectors`

A source is a point where rays start; `RaySources` lists the sources and their shares in each transmit element. Patterns
of elements are those at the frequency of the carrier.
"""
from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.progress import Share, each_of, nobody, part_of
from mitsonar.echoes.ensonification import Ensonification
from mitsonar.signal.accumulation import ImpulseResponses
from mitsonar.signal.doppler import glide_of
from mitsonar.sonar.pulses.pulses import Pulse

from ..survey import PerSurroundings
from .array_survey import ArraySurvey
from .delays import ArrivalCounts, ElementDelays
from .echo_classes import DopplerClasses, EchoClasses, OneClass
from .eigenrays import EigenrayDelays
from .ensonified_ping import EnsonifiedPing, ensonification_of
from .ping_source import PingSource
from .vectors import GUARD, GuardedDelays, VectorDelays

SUMS_BYTES = 1 << 30               # largest memory of the sums of one ping


class PressureRecord:
    """Impulse responses of a survey's pings."""

    def __init__(self, survey: ArraySurvey, *, seed: int = 0, kernel: str = "band_limited",
                 return_path: str = "vector", paths: Collection[str] | None = None,
                 ensonification: Callable[[int], Ensonification] | None = None):
        self.survey, self.seed = survey, int(seed)
        self.kernel, self.return_path, self.paths = kernel, return_path, paths
        self.counts = ArrivalCounts(radius=survey.radius, guard=GUARD)
        self.found = ensonification or PerSurroundings(survey, ensonification_of).at

    def ensonification(self, ping: int) -> Ensonification:
        """Return the ensonification of the scatterers around a ping, as given or made at first use."""
        return self.found(ping).turning(self.survey.turn_rate * self.survey.time[-1])

    def at(self, ping: int, before: PingPressure | None = None) -> PingPressure:
        """Return one ping; a platform at rest reuses the echoes of the ping `before`."""
        ensonified = EnsonifiedPing(self.survey, self.ensonification(ping), ping, self.seed,
                                    before and before.ensonified)
        return PingPressure(record=self, ensonified=ensonified)

    def classes(self, doppler: np.ndarray, piece: tuple[float, Pulse] | None = None) -> EchoClasses:
        """Return the classes of echoes that Doppler factors represent; arguments as of `PingPressure.transmissions`."""
        begin, pulse = piece or (0.0, self.survey.pulse)
        still = pulse is self.survey.pulse and np.all(doppler == 1.0)
        glide = glide_of(pulse) if pulse is self.survey.pulse else None
        return OneClass() if still else DopplerClasses(doppler, begin, pulse, glide)

    def sums(self, sheets: int = 1) -> ImpulseResponses:
        """Return the sums of all receive elements, at zero, with one sheet for each class."""
        survey = self.survey
        return ImpulseResponses(mi.Float, elements=survey.receive.elements, samples=survey.samples, sheets=sheets,
                                sampling_rate=survey.sampling_rate, frequency=survey.frequency, kernel=self.kernel)

    def delays(self, source: PingSource, ping: int) -> ElementDelays:
        """Return the delays from a source to the elements at a ping, by the record's method."""
        survey = self.survey.within(ping)
        guarded = GuardedDelays(source=source, transmit=survey.transmit, receive=survey.receive,
                                wavelength=survey.wavelength, sampling=survey.sampling, counts=self.counts)
        if self.return_path == "vector":
            return guarded
        if self.return_path == "eigenray":
            return guarded.changed_to(EigenrayDelays)
        return replace(guarded.changed_to(VectorDelays), method=self.return_path)


@dataclass(frozen=True, kw_only=True, eq=False)
class PingPressure:
    """Impulse responses of one ping, whose sources and echoes are `ensonified`."""

    record: PressureRecord
    ensonified: EnsonifiedPing

    def responses(self, progress: Share = nobody) -> np.ndarray:
        """Return the responses of all pairs of elements: complex64 (tx, rx, sample)."""
        survey, elements = self.record.survey, self.record.survey.transmit.elements
        out = np.empty((elements, survey.receive.elements, survey.samples), np.complex64)
        sums = self.record.sums()
        for element in range(elements):
            within = each_of(progress, element, elements)
            sums.clear()
            self._add(sums, OneClass(), range(1), element, progress=within)
            out[element] = sums.read()
            within(1.0)
        return out

    def transmissions(self, doppler: np.ndarray, *, piece: tuple[float, Pulse] | None = None,
                      progress: Share = nobody) -> Iterator[tuple[float, np.ndarray]]:
        """Yield Doppler factors, and the responses (rx, sample) to all transmit elements with delays and weights.

        `doppler` (K,) [-]: factors of the classes. The magnitudes of the weights add to 1.
        """
        record, classes = self.record, self.record.classes(doppler, piece)
        count = len(classes.factors)
        # as many classes at once as fit into memory: scatterers are ensonified once for each group of classes
        sums = record.sums()
        together = min(max(1, SUMS_BYTES // (4 * dr.width(sums.sums))), count)
        for first in range(0, count, together):
            now = range(first, min(first + together, count))
            if first or together > 1:
                sums = record.sums(len(now))
            self.add_all(sums, classes, now, part_of(progress, first / count, (first + len(now)) / count))
            for sheet, number in enumerate(now):
                response = sums.read(sheet)
                if response.any():
                    yield float(classes.factors[number]), response

    def add_all(self, sums: ImpulseResponses, classes: EchoClasses, wanted: range,
                progress: Share = nobody) -> None:
        """Add the echoes of all transmit elements, with their delays and weights, to the sums of the wanted classes."""
        survey, ping = self.record.survey, self.ensonified.ping
        weight, delay = survey.transmit_weight(ping), survey.transmit_delay(ping)
        senders = np.flatnonzero(weight).tolist()
        for number, element in enumerate(senders):
            self._add(sums, classes, wanted, element, weight=float(weight[element]), delay=float(delay[element]),
                      progress=each_of(progress, number, len(senders)))

    def _add(self, sums: ImpulseResponses, classes: EchoClasses, wanted: range, element: int, *,
             weight: float = 1.0, delay: float = 0.0, progress: Share = nobody) -> None:
        """Add the echoes of one transmit element, with a weight and a delay [s], to the sums of the wanted classes."""
        record, ensonified = self.record, self.ensonified
        sender, receivers = record.survey.transmit.position[element], record.survey.receive.position
        shares = ensonified.shares(element)
        with_cells = len(shares) - 1       # the last source, that of random echoes, has no cells
        for done, (number, share) in enumerate(shares):
            source = ensonified.source(number)
            delays = record.delays(source, self.ensonified.ping)
            blocks = ensonified.echoes(number, each_of(progress, done, with_cells))
            for echoes in (block for block in blocks if record.paths is None or block.path in record.paths):
                for rows, centre in classes.receiver_groups(source, echoes, receivers):
                    reach = float(np.linalg.norm(receivers[rows] - source.position, axis=1).max())
                    chosen = classes.sort(source, echoes, wanted, sender=sender, receiver=centre, delay=delay,
                                          reach=reach)
                    if chosen is not None:
                        delays.add(sums, chosen, element, weight=float(weight * share), rows=rows)
