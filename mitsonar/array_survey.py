"""Pings of an array over a scene: from the scatterers a ping lights to the response of every pair of elements.

The stages of one ping, in order (`ArraySurvey.responses`):

    light       scatterers connected to a source, with their echoes' amplitudes              `ensonification`
    transmit    delay and pattern of a transmit element, by reciprocity                      `vector_approximation`
    return      when each echo meets the array's centre, where that is then                  `return_paths`
    sum         every echo at every element, with its own delay                              `signal.accumulation`

A source is a point that rays are traced from; `Fans` says which there are and which share of each transmit element
they stand for. Elements' patterns are taken at the frequency of the carrier, towards where the ray was sent and, coming
back, from where it returns to the moved array.
"""
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from .ensonification import Ensonification
from .propagation.device import arrays_of
from .propagation.exact_returns import exact_return
from .propagation.return_paths import return_paths
from .propagation.vector_approximation import DIFFERENCES, ELEMENT_FIELDS, vector_difference, vector_element_fields
from .scatterers import Scatterers
from .signal.accumulation import ImpulseResponses, centre
from .signal.doppler import two_way_doppler
from .sonar.element_patterns import element_pressure

__all__ = ["ArraySurvey", "Fans"]

SUMS_BYTES = 1 << 30               # of the buffers of one ping
GUARD = 2e-9                       # [s] error to be expected of the vector approximation from which on it is not used
MOST_DOUBTFUL = 0.5                # share of such echoes at which the array is too large for it
KEPT_ECHOES = 1 << 22              # kept from one transmit element to the next; more are lit anew
FACES_AIMED_BY = 4                 # beams of arrays with more faces are not looked at when scatterers are chosen


@dataclass(frozen=True, kw_only=True)
class Fans:
    """Sources that rays are traced from, and how they stand for the transmit elements.

    Attributes
    ----------
    position : (S, 3) [m]
        Body frame.
    share : (S, T)
        Of every transmit element's echoes that each source's rays bring; columns add to one.
    """

    position: np.ndarray
    share: np.ndarray

    @classmethod
    def from_centre(cls, transmit):
        """One fan from the array's centre: all elements light the same scatterers."""
        return cls(position=np.zeros((1, 3)), share=np.ones((1, transmit.elements)))

    @classmethod
    def from_elements(cls, transmit):
        """A fan from every transmit element."""
        return cls(position=transmit.position, share=np.eye(transmit.elements))

    @classmethod
    def interpolated(cls, transmit, count):
        """A few fans along the array; elements between take both neighbours' rays, the nearer one's more.

        Parameters
        ----------
        transmit : Array
        count : int
            At least 2.
        """
        centred = transmit.position - transmit.position.mean(0)
        along = centred @ np.linalg.svd(centred, full_matrices=False)[2][0]
        if np.ptp(along) == 0 or count >= transmit.elements:
            return cls.from_elements(transmit)
        place = (along - along.min()) / np.ptp(along) * (count - 1)
        share = np.maximum(1 - np.abs(place[None] - np.arange(count)[:, None]), 0)
        # of elements equally far along (a planar array), the fan starts amid them
        position = (share @ transmit.position) / share.sum(1, keepdims=True) if share.sum(1).all() else None
        if position is None:
            raise ValueError(f"{count} fans were asked for, but some would stand for no element; take fewer")
        return cls(position=position, share=share)


@dataclass(frozen=True, kw_only=True)
class ArraySurvey:
    """What a run needs to know.

    Attributes
    ----------
    geometry : trace.Geometry
    profile : SoundSpeedProfile
    absorption : AbsorptionColumn
        At the frequency of the carrier.
    frequency : float [Hz]
    transmit, receive : Array
    track : Track
    velocity, turn_rate : (P, 3) [m/s], [rad/s]
        Scene frame.
    depth_below : (P,) [m]
        Seabed below the sonar.
    start : float [s]
        Time of sample 0, from the transmission on.
    sampling_rate : float [Hz]
    samples : int
    lead : int
        How many of the samples come before the record that was asked for.
    cell_size : float [m]
    lighting : str
        One of `ensonification.LIGHTING`.
    rays : int
        Per source and ping, where rays light the scatterers.
    fans : Fans
    """

    geometry: object
    profile: object
    absorption: object
    frequency: float
    transmit: object
    receive: object
    track: object
    velocity: np.ndarray
    turn_rate: np.ndarray
    depth_below: np.ndarray
    start: float
    sampling_rate: float
    samples: int
    lead: int
    cell_size: float
    lighting: str
    rays: int
    fans: Fans

    @property
    def time(self):
        """Of the samples [s], (S,)."""
        return self.start + np.arange(self.samples) / self.sampling_rate

    def sound_speed(self, ping):
        """At the array [m/s]."""
        return float(self.profile.at(-self.track.position[ping, 2]))

    def responses(self, ping, *, kernel="band_limited", return_path="vector", seed=0, progress=None):
        """Responses of all pairs of elements to one ping: complex64 (tx, rx, sample)."""
        run = _Run(self, seed)
        out = np.empty((self.transmit.elements, self.receive.elements, self.samples), np.complex64)
        buffer = run.buffer(kernel)
        for element in range(self.transmit.elements):
            buffer.clear()
            run.add([(_Everything(), buffer)], ping, element, return_path)
            out[element] = buffer.read()
            if progress is not None:
                progress(element + 1, self.transmit.elements)
        return out

    def transmissions(self, ping, doppler, pulse, *, kernel="band_limited", return_path="vector", seed=0):
        """Responses to all transmit elements together, with their weights (made to add to 1) and delays.

        Parameters
        ----------
        ping : int
        doppler : (K,) [-]
            Factors that stand for all echoes, as `signal.doppler.doppler_classes` gives them.
        pulse : Pulse

        Yields
        ------
        factor : float
        response : complex64 (rx, sample)
            Of the echoes with about this factor; factors without echoes are left out.
        """
        run, transmit = _Run(self, seed), self.transmit
        weight = transmit.weight / np.abs(transmit.weight).sum()
        classes = [_Everything(factor=float(doppler[0]))] if len(doppler) == 1 else [
            _DopplerClass(factor=float(factor), width=float(doppler[1] - doppler[0]), duration=pulse.duration)
            for factor in doppler]
        while classes:
            # as many classes at once as fit into memory: the fewer times scatterers have to be lit
            first = run.buffer(kernel)
            some = classes[:max(1, SUMS_BYTES // (4 * dr.width(first.sums)))]
            classes = classes[len(some):]
            sums = [(only, buffer) for only, buffer in zip(some, [first, *(run.buffer(kernel) for _ in some[1:])])]
            heard = [run.add(sums, ping, element, return_path, weight=weight[element], delay=transmit.delay[element])
                     for element in np.flatnonzero(weight)]
            for (only, buffer), any_heard in zip(sums, np.any(heard, axis=0)):
                if any_heard:
                    yield only.factor, buffer.read()


@dataclass(frozen=True, kw_only=True)
class _Everything:
    """All echoes, as if one factor were that of all."""

    factor: float = 1.0

    def __call__(self, station, echoes):
        return echoes, dr.opaque(mi.Float64, 0.0)


@dataclass(frozen=True, kw_only=True)
class _DopplerClass:
    """Echoes whose factor lies within half a width of one that stands for them; see `signal.doppler`."""

    factor: float
    width: float
    duration: float

    def __call__(self, station, echoes):
        """The echoes that belong here, and how much they are to be delayed [s]."""
        doppler = station.doppler(echoes)
        index = dr.compress(abs(doppler - dr.opaque(mi.Float64, self.factor)) <= dr.opaque(mi.Float64, 0.5 * self.width))
        if not dr.width(index):
            return None, None
        half = dr.opaque(mi.Float64, 0.5 * self.duration)
        late = half * (1 / dr.gather(mi.Float64, doppler, index) - dr.opaque(mi.Float64, 1 / self.factor))
        return echoes.chosen(index), late


class _Run:
    """A survey's tables on the device, and the echoes of the ping at hand."""

    def __init__(self, survey, seed):
        self.survey, self.seed = survey, int(seed)
        self.lib = arrays_of(mi.Float)
        self.rotation = survey.track.rotation()
        self.wavelength = survey.sound_speed(0) / survey.frequency
        reach = max(survey.receive.radius, survey.transmit.radius) + survey.receive.radius
        end = survey.time[-1]
        moved = float(np.linalg.norm(survey.velocity, axis=1).max()) * end
        self.light = Ensonification(
            Scatterers(survey.geometry, survey.cell_size), survey.profile, survey.absorption,
            frequency=survey.frequency, window=(survey.start, end), margin=reach + moved, lighting=survey.lighting,
            rays=survey.rays, pattern=self._pattern())
        self._lit = {}
        self._doubtful = self._looked_at = 0

    def count(self, doubtful, echoes):
        """Refuse an array for which most echoes would have to be traced one by one after all."""
        self._doubtful, self._looked_at = self._doubtful + doubtful, self._looked_at + echoes
        if self._doubtful > MOST_DOUBTFUL * max(self._looked_at, 1000):
            radius = max(self.survey.transmit.radius, self.survey.receive.radius)
            raise ValueError(f"the array reaches {radius:.3g} m from its centre, too far for the vector approximation "
                             f"here: for {100 * self._doubtful / self._looked_at:.0f} % of the echoes it may be off by "
                             f"more than {1e9 * GUARD:.0f} ns; take return_path=\"eigenray\", or a smaller array")

    def buffer(self, kernel):
        survey = self.survey
        return ImpulseResponses(mi.Float, elements=survey.receive.elements, samples=survey.samples,
                                sampling_rate=survey.sampling_rate, frequency=survey.frequency, kernel=kernel)

    def add(self, sums, ping, element, return_path, *, weight=1.0, delay=0.0):
        """Add what all receive elements hear of one transmit element, sent with a weight and a delay [s].

        `sums` are pairs of what chooses echoes and the buffer for them; gives for each whether there were any.
        """
        fans, heard = self.survey.fans, np.zeros(len(sums), bool)
        for source in np.flatnonzero(fans.share[:, element]):
            station = _Station(self, ping, fans.position[source])
            share = float(weight * fans.share[source, element])
            for echoes in self._echoes(ping, source, station):
                for number, (chosen, buffer) in enumerate(sums):
                    some, late = chosen(station, echoes)
                    if some is not None:
                        heard[number] = True
                        late = late + dr.opaque(self.lib.Float64, float(delay))
                        station.add(buffer, some, element, return_path, weight=share, late=late)
        return heard

    def _echoes(self, ping, source, station):
        """Echoes of a ping lit from a source; kept, where they are not too many, for the next transmit element."""
        if (ping, source) in self._lit:
            yield from self._lit[ping, source]
            return
        self._lit = {place: blocks for place, blocks in self._lit.items() if place[0] == ping}
        room = KEPT_ECHOES - sum(dr.width(b.travel_time) for blocks in self._lit.values() for b in blocks)
        kept = []
        key = self.seed * 0x9E3779B1 + int(ping) * 0x85EBCA6B + int(source) * 0xC2B2AE35
        for block in self.light(station.origin, station.rotation, float(self.survey.depth_below[ping]), key):
            room -= dr.width(block.travel_time)
            kept = kept + [block] if kept is not None and room >= 0 else None
            yield block
        if kept is not None:
            self._lit[ping, source] = kept

    def _pattern(self):
        """Two-way intensity of the elements towards scene directions, None where they look everywhere alike."""
        arrays = self.survey.transmit, self.survey.receive
        faces = [array.faces() for array in arrays]
        if all(_omni(array) for array in arrays) or max(map(len, faces)) > FACES_AIMED_BY:
            return None

        def intensity(direction, rotation):
            total = 1.0
            for array, group in zip(arrays, faces):
                best = 0.0
                for face in group:
                    normal, along = rotation @ face.normal, rotation @ face.along
                    if dr.is_array_v(direction):
                        best = dr.maximum(best, dr.square(_pressure(array, direction, self.wavelength, normal, along)))
                    else:
                        best = np.maximum(best, array.element_pressure(direction, self.wavelength, normal, along) ** 2)
                total = total * best
            return total

        return intensity


class _Station:
    """A source of a ping: where it stands, how it moves, and the array about it."""

    def __init__(self, run, ping, position):
        survey = run.survey
        self.run, self.survey = run, survey
        self.rotation = run.rotation[ping]
        self.position = position
        self.origin = survey.track.position[ping] + self.rotation @ position
        self.depth = -float(self.origin[2])
        self.sources = run.light.tracer.sources([self.depth])
        self.velocity, self.turn_rate = survey.velocity[ping], survey.turn_rate[ping]
        self.speed = float(survey.profile.at(self.depth))
        self.array_radius = max(np.linalg.norm(self._offsets(array), axis=1).max()
                                for array in (survey.transmit, survey.receive))

    def _offsets(self, array):
        return (array.position - self.position) @ self.rotation.T

    def doppler(self, echoes):
        """Two-way factor of echoes, Float64; the way back leads as the way out did, to first order."""
        closing = dr.dot(mi.Vector3f(*_opaque(mi.Float, self.velocity)), echoes.launch_direction)
        return two_way_doppler(mi.Float64(closing), dr.opaque(mi.Float64, self.speed))

    def add(self, buffer, echoes, element, return_path, *, weight, late):
        """Sum the echoes of one transmit element, delayed by `late` [s], at all receive elements."""
        if return_path == "vector" and self.array_radius > 0:
            doubtful = self._doubtful(echoes)
            if dr.any(doubtful):
                every = mi.UInt32(0), late + dr.zeros(mi.Float64, dr.width(doubtful))
                exact, rest = dr.compress(doubtful), dr.compress(~doubtful)
                self.run.count(dr.width(exact), dr.width(doubtful))
                self._add_exactly(buffer, echoes.chosen(exact), element, weight, dr.gather(mi.Float64, every[1], exact))
                if not dr.width(rest):
                    return
                echoes, late = echoes.chosen(rest), dr.gather(mi.Float64, every[1], rest)
        if return_path == "eigenray":
            self._add_exactly(buffer, echoes, element, weight, late)
        else:
            self._add_approximately(buffer, echoes, element, return_path, weight, late)

    def _add_approximately(self, buffer, echoes, element, return_path, weight, late):
        """By the one ray to each echo, and differences for the elements."""
        survey, lib = self.survey, self.run.lib
        transmit, receive = survey.transmit, survey.receive
        # ---- transmit: the still array, by reciprocity
        off = np.any(transmit.position[element] != self.position)
        farther = self._transmit_delay(echoes, element) if off else None
        # ---- return to the centre, where it is then
        back = self._back(echoes, return_path, self.velocity, self.turn_rate)
        total = echoes.travel_time + back.return_time
        if farther is not None:
            # the hit is met later, and the platform is further on by then: first order, for it moves millimetres
            velocity = _opaque(lib.Float64, self.velocity)
            closing = sum(lib.Float64(n) * v for n, v in zip(back.direction, velocity))
            total += farther * (1 + closing / (dr.opaque(lib.Float64, self.speed) - closing))
        phase, sample, fraction = centre(total + late, start=survey.start, frequency=survey.frequency,
                                         sampling_rate=survey.sampling_rate)
        for factor, rows in self._patterns(echoes, element, weight, total):
            elements = ELEMENT_FIELDS[return_path](self._offsets(receive)[rows], self.depth, survey.profile,
                                                   self.velocity, self.turn_rate)
            buffer.add(amplitude=tuple(part * factor for part in echoes.amplitude), phase=phase, sample=sample,
                       fraction=fraction, hit_fields=back.hit_fields, element_fields=elements,
                       difference=DIFFERENCES[return_path], rows=rows)

    def _add_exactly(self, buffer, echoes, element, weight, late):
        """By an eigenray for every echo and element."""
        survey, lib = self.survey, self.run.lib
        table, depth = self.run.light.tracer.table, dr.opaque(lib.Float64, self.depth)
        transmit, receive = survey.transmit, survey.receive
        velocity, turn_rate = _opaque(lib.Float64, self.velocity), _opaque(lib.Float64, self.turn_rate)
        out = echoes.travel_time
        if np.any(transmit.position[element] != self.position):
            still = _opaque(lib.Float64, np.zeros(3))
            offset = _opaque(lib.Float64, self._offsets(transmit)[element])
            out = exact_return(table, lib, depth, echoes.offset, mi.Float64(0), offset, still, still, out)
        dr.eval(out)
        for factor, rows in self._patterns(echoes, element, weight, 2 * out):
            amplitude = tuple(part * factor for part in echoes.amplitude)
            dr.eval(amplitude)
            for row in rows:
                offset = _opaque(lib.Float64, self._offsets(receive)[row])
                back = exact_return(table, lib, depth, echoes.offset, out, offset, velocity, turn_rate, out)
                phase, sample, fraction = centre(out + back + late, start=survey.start, frequency=survey.frequency,
                                                 sampling_rate=survey.sampling_rate)
                buffer.add(amplitude=amplitude, phase=phase, sample=sample, fraction=fraction, hit_fields=[],
                           element_fields=[np.zeros(1)], difference=lambda hit, element: element[0], rows=[row])

    def _doubtful(self, echoes):
        """Echoes for which the vector approximation may be off by more than GUARD at some element."""
        back = self._back(echoes, "vector", self.velocity, self.turn_rate)
        outermost = np.concatenate([self._offsets(array) for array in (self.survey.transmit, self.survey.receive)])
        some = np.unique([pick(column) for column in outermost.T for pick in (np.argmin, np.argmax)])
        fields = vector_element_fields(outermost[some], self.depth, self.survey.profile, self.velocity, self.turn_rate)
        doubtful = back.expected_error(fields) > dr.opaque(mi.Float, GUARD)
        dr.eval(doubtful)
        return doubtful

    def _patterns(self, echoes, element, weight, elapsed):
        """For each group of receive elements: what both elements' patterns make of the echoes, and its rows."""
        transmit, receive = self.survey.transmit, self.survey.receive
        gain = dr.opaque(mi.Float, weight) * self._one_way(transmit, element, echoes.launch_direction)
        if _omni(receive):
            yield gain, np.arange(receive.elements)
            return
        heard = self._heard_from(echoes, elapsed)
        for face in receive.faces():
            yield gain * _pressure(receive, heard, self.run.wavelength, self.rotation @ face.normal,
                                   self.rotation @ face.along), face.indices

    def _back(self, echoes, method, velocity, turn_rate):
        lib = self.run.lib
        velocity, turn_rate = _opaque(lib.Float64, velocity), _opaque(lib.Float64, turn_rate)
        return return_paths(self.run.light.tracer.table, self.sources.state, mi.UInt32(0), echoes.offset,
                            echoes.travel_time, echoes.ray_parameter, echoes.spreading_area,
                            -echoes.launch_direction.z, velocity=velocity, turn_rate=turn_rate, method=method)

    def _transmit_delay(self, echoes, element):
        """How much later than from the source the scatterers are reached from a transmit element [s], Float64."""
        lib = self.run.lib
        still = self._back(echoes, "vector", np.zeros(3), np.zeros(3))
        offset = self._offsets(self.survey.transmit)[element]
        fields = vector_element_fields(offset[None], self.depth, self.survey.profile)
        fields = [dr.opaque(lib.Float, float(field[0])) for field in np.broadcast_arrays(*fields)]
        return lib.Float64(vector_difference(still.hit_fields, fields))

    def _one_way(self, array, element, direction):
        if _omni(array):
            return mi.Float(1)
        return _pressure(array, direction, self.run.wavelength, self.rotation @ array.normal[element],
                         self.rotation @ array.along[element])

    def _heard_from(self, echoes, elapsed):
        """Direction the echo comes from, as the moved and turned array sees it, in the scene of the transmission."""
        elapsed = mi.Float(elapsed)
        moved = mi.Vector3f(*_opaque(mi.Float, self.velocity)) * elapsed
        towards = dr.normalize(echoes.launch_direction * dr.norm(mi.Vector3f(echoes.offset)) - moved)
        turned = mi.Vector3f(*_opaque(mi.Float, self.turn_rate)) * elapsed
        return towards - dr.cross(turned, towards)


def _opaque(kind, vector):
    """The components of a vector, opaque: they change without a new kernel."""
    return [dr.opaque(kind, float(component)) for component in vector]


def _omni(array):
    return array.pattern == "omni" and array.baffle == "none"


def _pressure(array, direction, wavelength, normal, along):
    """`element_pressure` of one face on the device, its numbers opaque so that one kernel serves all faces."""
    normal, along = _opaque(mi.Float, normal), _opaque(mi.Float, along)
    wavelength, length, height = _opaque(mi.Float, (wavelength, array.length, array.height))
    return element_pressure(direction, wavelength, normal, along, length=length, height=height,
                            pattern=array.pattern, baffle=array.baffle)
