"""Pings of an array over a scene: from the scatterers a ping lights to the response of every pair of elements.

The stages of one ping, in order (`ArraySurvey.responses`):

    light       scatterers connected to a source, with their echoes' amplitudes              `ensonification`
    transmit, return, sum     to all receive elements, from one transmit element after the other    `array_station`

A source is a point that rays are traced from; `Fans` says which there are and which share of each transmit element
they stand for. What is drawn by chance, paths of more bounces and the water, is always seen from the array's centre.
Elements' patterns are taken at the frequency of the carrier, towards where each element's own ray leaves and, coming
back, from where it returns to the moved and turned array.
"""
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import drjit as dr
import mitsuba as mi
import numpy as np

from ..device.arrays import arrays_of
from ..device.chance import ping_key
from ..device.lookups import held
from ..echoes.element_beams import ElementBeams
from ..echoes.ensonification import Ensonification
from ..echoes.scatterers import Scatterers
from ..signal.accumulation import ImpulseResponses
from ..signal.doppler import factor_tolerance
from ..signal.noise import ElementNoise
from ..sonar.array import Array
from ..sonar.pulses import Pulse
from .element_delays import GUARD, Station
from .fan_truth import FanTruth
from .sources import Fans
from .survey import Survey

__all__ = ["ArraySurvey"]

SUMS_BYTES = 1 << 30               # of the buffers of one ping
MOST_DOUBTFUL = 0.5                # share of such echoes at which an array is too large for it, beyond
SMALL_ARRAY = 1.0                  # [m] from its centre: smaller ones are traced echo by echo without a word
KEPT_ECHOES = 1 << 22              # kept from one transmit element to the next; more are lit anew
BAND = 0.75                        # c / 2B of two thirds of the sampling rate
DRAWN = -1                         # number that stands for a source of what is drawn by chance


@dataclass(frozen=True, kw_only=True)
class ArraySurvey(Survey):
    """A run of a sonar with arrays.

    Attributes
    ----------
    pulse : Pulse
    source_level_db : float [dB re 1 µPa @ 1 m]
        Of all transmit elements together, where their waves add up.
    transmit, receive : Array
    start : float [s]
        Time of sample 0, from the transmission on.
    sampling_rate : float [Hz]
    samples : int
    lead : int
        How many of the samples come before the record that was asked for.
    cell_size : float [m]
    lighting : str
        One of `ensonification.LIGHTING`.
    fans : Fans
    noise : ElementNoise or None
    absorption_db : callable or None
        Absorption [dB/m] at frequencies [Hz], mean over the water; None where it is the same for all.

    `rays` are per source and ping, where rays light the scatterers.
    """

    pulse: Pulse
    source_level_db: float
    transmit: Array
    receive: Array
    start: float
    sampling_rate: float
    samples: int
    lead: int
    cell_size: float
    lighting: str
    fans: Fans
    noise: ElementNoise | None = None
    absorption_db: Callable[[np.ndarray], np.ndarray] | None = None

    @cached_property
    def velocity(self):
        """At the transmissions, (P, 3) [m/s], scene frame."""
        return self.voyage.velocity

    def travel(self, ping, position):
        """How a point (3,) of the body moves and turns while the echoes of a ping come in: a `PingTravel` of one."""
        return self.voyage.trajectory.carried(position).during(self.track.time[[ping]], self.time[-1]).trimmed()

    @property
    def frequency(self):
        """Of the carrier [Hz]."""
        return self.pulse.frequency

    @property
    def time(self):
        """Of the samples [s], (S,)."""
        return self.start + np.arange(self.samples) / self.sampling_rate

    def sound_speed(self, ping):
        """At the array [m/s]."""
        return float(self.profile.at(-self.track.position[ping, 2]))

    @cached_property
    def _run(self):
        return _Run(self)

    @property
    def lost(self):
        """Arrivals at elements that no ray brings, of echoes that meet the centre, and all so far: two counts."""
        return self._run.lost, self._run.tallied

    def fan_truth(self, angle, direction, seed=0):
        """Ground truth of the fan of beams (B,) [rad] towards (B, 3): a `FanTruth`, to be called for pings."""
        return FanTruth(self, self._run.light, self._run.light.pattern, angle, direction, seed)

    def cells_within_reach(self, ping):
        """How many cells a ping looks at."""
        return sum(cells for *_, cells in self._run.light.stretches(self.track.position[ping]))

    def responses(self, ping, *, kernel="band_limited", return_path="vector", seed=0, paths=None, progress=None):
        """Responses of all pairs of elements to one ping, by all or some paths: complex64 (tx, rx, sample)."""
        run = self._run.seeded(seed)
        out = np.empty((self.transmit.elements, self.receive.elements, self.samples), np.complex64)
        buffer = run.buffer(kernel)
        for element in range(self.transmit.elements):
            buffer.clear()
            run.add([(_Everything(), buffer)], ping, element, return_path, paths=paths,
                    told=progress and (lambda share, before=element: progress(before + share, self.transmit.elements)))
            out[element] = buffer.read()
            if progress is not None:
                progress(element + 1, self.transmit.elements)
        return out

    def transmissions(self, ping, doppler, *, piece=None, kernel="band_limited", return_path="vector", seed=0,
                      paths=None, told=None):
        """Responses to all transmit elements together, with their weights (made to add to 1) and delays.

        Parameters
        ----------
        ping : int
        doppler : (K,) [-]
            Factors that stand for all echoes, as `signal.doppler.doppler_classes` gives them.
        piece : (float, Pulse) or None
            Of the pulse, as `Pulse.pieces` gives them; None: the whole.
        paths : collection of str or None
            Which paths count, by their names; None: all.
        told : callable(share) or None
            Told the share of the work that is done, below 1, block by block of cells.

        Yields
        ------
        factor : float
        response : complex64 (rx, sample)
            Of the echoes with about this factor; factors without echoes are left out.
        """
        run, transmit = self._run.seeded(seed), self.transmit
        weight = transmit.weight / np.abs(transmit.weight).sum()
        begin, pulse = piece or (0.0, self.pulse)
        sorter = _Sorter(doppler, begin, pulse)
        classes = [_Everything(factor=float(doppler[0]))] if len(doppler) == 1 and pulse is self.pulse else [
            _DopplerClass(sorter=sorter, number=number) for number in range(len(doppler))]
        senders, count, done = np.flatnonzero(weight), len(classes), 0.0
        while classes:
            # as many classes at once as fit into memory: the fewer times scatterers have to be lit
            first = run.buffer(kernel)
            some = classes[:max(1, SUMS_BYTES // (4 * dr.width(first.sums)))]
            classes = classes[len(some):]
            sums = list(zip(some, [first, *(run.buffer(kernel) for _ in some[1:])]))
            part, heard = len(some) / count / len(senders), []
            for element in senders:
                heard.append(run.add(sums, ping, element, return_path, weight=weight[element],
                                     delay=transmit.delay[element], paths=paths,
                                     told=told and (lambda share, before=done: told(before + part * share))))
                done += part
            for (only, buffer), any_heard in zip(sums, np.any(heard, axis=0)):
                if any_heard:
                    yield only.factor, buffer.read()


@dataclass(frozen=True, kw_only=True)
class _Everything:
    """All echoes, as if one factor were that of all."""

    factor: float = 1.0

    def neighbours(self, station, echoes):
        """Receive elements that hear echoes with one factor, as slices, and where they are."""
        return [(slice(None), None)]

    def __call__(self, station, echoes, element, place, delay):
        """All echoes, and how much later [s] is heard what is sent later by a delay [s]."""
        return echoes, station.time_scale(echoes, element, place, delay)[1] if delay else dr.opaque(mi.Float64, 0.0)


class _Sorter:
    """Puts echoes into Doppler classes: each is in one, rounding or not. The last answer is kept, for all classes ask.

    Parameters
    ----------
    factors : (K,) [-]
        Of the classes.
    begin : float [s]
    pulse : Pulse
        Of which echoes are to be heard, and when it begins.
    """

    def __init__(self, factors, begin, pulse):
        self.factors, self.begin, self.pulse = factors, begin, pulse
        self._asked, self._known = None, None

    def __call__(self, station, echoes, element, place, delay):
        """When the middles of echoes are heard Float64 (R,) [s], numbers of their classes, and which occur."""
        asked = station, echoes, element, place, delay
        if self._asked is None or any(one is not other for one, other in zip(asked, self._asked)):
            doppler, when = station.time_scale(echoes, element, place,
                                              self.begin + 0.5 * self.pulse.duration + delay)
            width = float(self.factors[1] - self.factors[0]) if len(self.factors) > 1 else 1.0
            first, width = (dr.opaque(mi.Float64, v) for v in (float(self.factors[0]), width))
            nearest = held(dr.round((doppler - first) / width), 0, dr.opaque(mi.Float64, len(self.factors) - 1))
            number = mi.UInt32(nearest)
            dr.eval(when, number)
            self._asked, self._known = asked, (when, number, set(np.unique(number.numpy()).tolist()))
        return self._known


@dataclass(frozen=True, kw_only=True)
class _DopplerClass:
    """Echoes to whose factor that of one class is the nearest."""

    sorter: _Sorter
    number: int

    @property
    def factor(self):
        """That of the class."""
        return float(self.sorter.factors[self.number])

    def neighbours(self, station, echoes):
        """Receive elements that hear echoes with nearly one factor, as slices, and where they are."""
        return station.neighbours(echoes, factor_tolerance(self.sorter.pulse))

    def __call__(self, station, echoes, element, place, delay):
        """The echoes that belong here, and how much they are to be delayed [s] where they are sent later by a delay."""
        when, number, present = self.sorter(station, echoes, element, place, delay)
        if self.number not in present:
            return None, None
        index = dr.compress(number == dr.opaque(mi.UInt32, self.number))
        half = dr.opaque(mi.Float64, 0.5 * self.sorter.pulse.duration / self.factor)
        return echoes.chosen(index), dr.gather(mi.Float64, when, index) - half


class _Run:
    """A survey's tables on the device, and the echoes of the ping at hand."""

    def __init__(self, survey):
        self.survey, self.seed = survey, 0
        self.lib = arrays_of(mi.Float)
        self.rotation = survey.track.rotation()
        self.wavelength = survey.sound_speed(0) / survey.frequency
        reach = max(survey.receive.radius, survey.transmit.radius) + survey.receive.radius
        end = survey.time[-1]
        moved, turned = (float(np.linalg.norm(rate, axis=1).max()) * end
                         for rate in (survey.velocity, survey.voyage.turn_rate))
        self.light = Ensonification(
            Scatterers(survey.geometry, survey.cell_size), survey.profile, survey.absorption,
            frequency=survey.frequency, window=(survey.start, end), margin=reach + moved, lighting=survey.lighting,
            rays=survey.rays,
            beams=ElementBeams(survey.transmit, survey.receive, self.wavelength, turned),
            max_depth=survey.max_depth, volume=survey.volume,
            resolution=BAND * survey.sound_speed(0) / survey.sampling_rate)
        self._lit = {}
        self._doubtful = self._looked_at = 0
        self.tallied = self.lost = 0

    def seeded(self, seed):
        """The same, with rays drawn from another seed."""
        if seed != self.seed:
            self.seed, self._lit = int(seed), {}
        return self

    def count(self, doubtful, echoes):
        """Refuse an array for which most echoes would have to be traced one by one after all."""
        self._doubtful, self._looked_at = self._doubtful + doubtful, self._looked_at + echoes
        radius = max(self.survey.transmit.radius, self.survey.receive.radius)
        if radius > SMALL_ARRAY and self._doubtful > MOST_DOUBTFUL * max(self._looked_at, 1000):
            raise ValueError(f"the array reaches {radius:.3g} m from its centre, too far for the vector approximation "
                             f"here: for {100 * self._doubtful / self._looked_at:.0f} % of the echoes it may be off by "
                             f"more than {1e9 * GUARD:g} ns, soonest where rays turn or run nearly level; take "
                             "return_path=\"eigenray\", a smaller array or a shorter range")

    def tally(self, arrivals, lost=0):
        """Count arrivals of echoes at elements, and those of them that no ray brings there."""
        self.tallied, self.lost = self.tallied + arrivals, self.lost + lost

    def buffer(self, kernel):
        survey = self.survey
        return ImpulseResponses(mi.Float, elements=survey.receive.elements, samples=survey.samples,
                                sampling_rate=survey.sampling_rate, frequency=survey.frequency, kernel=kernel)

    def add(self, sums, ping, element, return_path, *, weight=1.0, delay=0.0, paths=None, told=None):
        """Add what all receive elements hear of one transmit element, sent with a weight and a delay [s].

        `sums` are pairs of what chooses echoes and the buffer for them; gives for each whether there were any. `told`
        is called with the share that is done.
        """
        fans, heard, delay = self.survey.fans, np.zeros(len(sums), bool), float(delay)
        # what is drawn by chance is the same for all transmit elements only where it is drawn from one place
        places = [(source, fans.position[source], fans.share[source, element])
                  for source in np.flatnonzero(fans.share[:, element])]
        for number_done, (source, position, share) in enumerate([*places, (DRAWN, np.zeros(3), 1.0)]):
            told_here = told and (lambda part, before=number_done: told(min((before + part) / len(places), 1.0)))
            station, share = Station(self, ping, position), float(weight * share)
            for echoes in self._echoes(ping, source, station, told_here):
                if paths is not None and echoes.path not in paths:
                    continue
                for rows, place in sums[0][0].neighbours(station, echoes):
                    for number, (chosen, buffer) in enumerate(sums):
                        some, late = chosen(station, echoes, element, place, delay)
                        if some is not None:
                            heard[number] = True
                            station.add(buffer, some, element, return_path, weight=share, late=late, rows=rows)
        return heard

    def _echoes(self, ping, source, station, told):
        """Echoes of a ping from a source; kept, where they are not too many, for the next transmit element."""
        if (ping, source) in self._lit:
            yield from self._lit[ping, source]
            return
        self._lit = {place: blocks for place, blocks in self._lit.items() if place[0] == ping}
        room = KEPT_ECHOES - sum(block.count for blocks in self._lit.values() for block in blocks)
        kept = []
        key = ping_key(self.seed, ping, max(int(source), 0))
        light = self.light.drawn if source == DRAWN else partial(self.light.lit, told=told)
        for block in light(station.origin, station.rotation, float(self.survey.depth_below[ping]), key):
            room -= block.count
            kept = kept + [block] if kept is not None and room >= 0 else None
            yield block
        if kept is not None:
            self._lit[ping, source] = kept
