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

from ..echoes.ensonification import Ensonification
from ..echoes.record import Echoes
from ..signal.accumulation import ImpulseResponses
from ..sonar.pulses import Pulse
from .array_survey import ArraySurvey
from .elements.arrivals import ArrivalCounts
from .elements.delays import ElementDelays
from .elements.echo_classes import DopplerClasses, EchoClasses, OneClass
from .elements.eigenrays import EigenrayDelays
from .elements.guarded import GuardedDelays
from .elements.ping_source import PingSource
from .elements.vectors import GUARD, VectorDelays
from .ensonified_ping import EnsonifiedPing, ensonification_of

__all__ = ["PressureRecord"]

SUMS_BYTES = 1 << 30               # of the sums of one ping

Progress = Callable[[float], None]


class PressureRecord:
    """Make the impulse responses of a survey's pings.

    Parameters
    ----------
    survey : ArraySurvey
    seed : int
        Of what is drawn by chance: rays that find scatterers, paths of more bounces, points of the water.
    kernel : {"band_limited", "peterson", "nearest"}
        How an echo is put on samples.
    return_path : {"vector", "paper", "eigenray"}
        How delays to elements are found.
    paths : collection of str or None
        Which paths count, by their names; None: all.

    Attributes
    ----------
    counts : ArrivalCounts
        Of all pings so far.
    """

    def __init__(self, survey: ArraySurvey, *, seed: int = 0, kernel: str = "band_limited",
                 return_path: str = "vector", paths: Collection[str] | None = None):
        self.survey, self.seed = survey, int(seed)
        self.kernel, self.return_path, self.paths = kernel, return_path, paths
        self.counts = ArrivalCounts(radius=survey.radius, guard=GUARD)
        self._ensonified: EnsonifiedPing | None = None

    @cached_property
    def ensonification(self) -> Ensonification:
        """Makes the echoes of the survey's scatterers."""
        return ensonification_of(self.survey)

    def responses(self, ping: int, *, progress: Callable[[float, int], None] | None = None) -> np.ndarray:
        """Make the responses of all pairs of elements to one ping.

        Parameters
        ----------
        ping : int
        progress : callable(done, total) or None
            Called with how many transmit elements are done, parts of one included.

        Returns
        -------
        complex64 (tx, rx, sample)
        """
        survey, elements = self.survey, self.survey.transmit.elements
        out = np.empty((elements, survey.receive.elements, survey.samples), np.complex64)
        sums = self.sums()
        for element in range(elements):
            def within(share: float, before: int = element) -> None:
                if progress is not None:
                    progress(before + share, elements)

            sums.clear()
            self._add({0: sums}, OneClass(), ping, element, progress=within)
            out[element] = sums.read()
            within(1.0)
        return out

    def transmissions(self, ping: int, doppler: np.ndarray, *, piece: tuple[float, Pulse] | None = None,
                      progress: Progress | None = None) -> Iterator[tuple[float, np.ndarray]]:
        """Make the responses to all transmit elements together, with their delays and weights.

        The weights are scaled so that their magnitudes add to 1.

        Parameters
        ----------
        ping : int
        doppler : (K,) [-]
            Factors that stand for all echoes, as `signal.doppler.doppler_classes` gives them.
        piece : (float, Pulse) or None
            Of the pulse, as `Pulse.pieces` gives them; None: the whole.
        progress : callable(share) or None
            Called with the share of the work that is done, below 1, block by block of cells.

        Yields
        ------
        factor : float
        response : complex64 (rx, sample)
            Of the echoes with about this factor. Factors without echoes are left out.
        """
        transmit = self.survey.transmit
        weight = transmit.weight / np.abs(transmit.weight).sum()
        begin, pulse = piece or (0.0, self.survey.pulse)
        whole = len(doppler) == 1 and pulse is self.survey.pulse
        classes = OneClass(doppler[0]) if whole else DopplerClasses(doppler, begin, pulse)
        senders, left, done = np.flatnonzero(weight).tolist(), list(range(len(doppler))), 0.0
        while left:
            # As many classes at once as fit into memory: the fewer times scatterers have to be ensonified.
            first = self.sums()
            now = left[:max(1, SUMS_BYTES // (4 * dr.width(first.sums)))]
            left = left[len(now):]
            sums = {number: self.sums() if number != now[0] else first for number in now}
            part, occurring = len(now) / len(doppler) / len(senders), set()
            for element in senders:
                occurring |= self._add(sums, classes, ping, element, weight=weight[element],
                                       delay=float(transmit.delay[element]),
                                       progress=_of_a_part(progress, done, part))
                done += part
            for number in now:
                if number in occurring:
                    yield float(classes.factors[number]), sums[number].read()

    def sums(self) -> ImpulseResponses:
        """Make the sums of all receive elements, at zero."""
        survey = self.survey
        return ImpulseResponses(mi.Float, elements=survey.receive.elements, samples=survey.samples,
                                sampling_rate=survey.sampling_rate, frequency=survey.frequency, kernel=self.kernel)

    def _add(self, sums: dict[int, ImpulseResponses], classes: EchoClasses, ping: int, element: int, *,
             weight: float = 1.0, delay: float = 0.0, progress: Progress | None = None) -> set[int]:
        """Add the echoes of one transmit element, with a weight and a delay [s], to the sums of some classes.

        Gives the numbers of the classes that have echoes.
        """
        sender, occurring = self.survey.transmit.position[element], set()
        ensonified = self.ensonified(ping)
        shares = ensonified.shares(element)
        with_cells = len(shares) - 1       # the last source, of what is drawn by chance, knows no cells
        for done, (number, share) in enumerate(shares):
            source = ensonified.source(number)
            delays = self.delays(source)
            blocks = ensonified.echoes(number, _of_a_part(progress, done / with_cells, 1 / with_cells))
            for echoes in filter(self._counts, blocks):
                for rows, middle in classes.receiver_groups(source, echoes, self.survey.receive.position):
                    for one, some, late in classes.sort(source, echoes, sums, sender=sender, receiver=middle,
                                                        delay=delay):
                        occurring.add(one)
                        delays.add(sums[one], some, element, weight=float(weight * share), late=late, rows=rows)
        return occurring

    def _counts(self, echoes: Echoes) -> bool:
        """Whether echoes came by one of the paths asked for."""
        return self.paths is None or echoes.path in self.paths

    def ensonified(self, ping: int) -> EnsonifiedPing:
        """Give a ping's sources and echoes; those of the last one are kept."""
        if self._ensonified is None or self._ensonified.ping != ping:
            self._ensonified = EnsonifiedPing(self.survey, self.ensonification, ping, self.seed)
        return self._ensonified

    def delays(self, source: PingSource) -> ElementDelays:
        """Make what carries echoes from a source to the elements."""
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
