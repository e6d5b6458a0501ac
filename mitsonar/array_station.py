"""A source of a ping, with the array about it: what becomes of the echoes that were lit from there.

    transmit    delay and pattern of a transmit element, by reciprocity                      `vector_approximation`
    return      when each echo meets the array's centre, where that is then                  `return_paths`
    sum         every echo at every element, with its own delay                              `signal.accumulation`

Echoes for which the approximation is in doubt by more than `GUARD` at some element, and all of them where that is asked
for, take an eigenray to every element instead (`exact_returns`).
"""
from dataclasses import dataclass
from functools import cached_property

import drjit as dr
import mitsuba as mi
import numpy as np

from .propagation.exact_returns import exact_return
from .propagation.return_paths import return_paths
from .propagation.two_point import source_state
from .propagation.vector_approximation import ELEMENT_FIELDS, difference_of, vector_difference, vector_element_fields
from .signal.accumulation import centre
from .signal.doppler import two_way_doppler
from .sonar.element_patterns import element_pressure

__all__ = ["GUARD", "Station", "omni", "pressure"]

GUARD = 5e-10                      # [s] error to be expected of the vector approximation from which on it is not used


UPSIDE_DOWN = np.diag([1.0, 1.0, -1.0])


@dataclass(frozen=True, kw_only=True, eq=False)
class _View:
    """The platform and the water as legs see them: as they are, or unfolded about the surface and seen as an image."""

    table: object
    profile: object
    state: object                  # `SourceState` of the depth
    depth: float
    rotation: np.ndarray           # body to scene
    velocity: np.ndarray
    turn_rate: np.ndarray

    def offsets(self, array, position):
        """Elements from the source, which stands at `position` in the body: (E, 3)."""
        return (array.position - position) @ self.rotation.T

    def opaque_motion(self, kind):
        """Velocity and turn rate as triples on the device."""
        return _opaque(kind, self.velocity), _opaque(kind, self.turn_rate)


class Station:
    """A source of a ping: where it stands, how it moves, and the array about it."""

    def __init__(self, run, ping, position):
        survey = run.survey
        self.run, self.survey = run, survey
        self.rotation = run.rotation[ping]
        self.position = position
        self.origin = survey.track.position[ping] + self.rotation @ position
        self.depth = -float(self.origin[2])
        self.sources = run.light.tracer.sources([self.depth])
        self.turn_rate = survey.turn_rate[ping]
        # what stands off the track's point is carried round it as the platform turns
        self.velocity = survey.velocity[ping] + np.cross(self.turn_rate, self.rotation @ position)
        self.speed = float(survey.profile.at(self.depth))
        self.array_radius = max(np.linalg.norm(array.position - position, axis=1).max()
                                for array in (survey.transmit, survey.receive))

    @cached_property
    def _direct(self):
        return _View(table=self.run.light.tracer.table, profile=self.survey.profile, state=self.sources.state,
                     depth=self.depth, rotation=self.rotation, velocity=self.velocity, turn_rate=self.turn_rate)

    @cached_property
    def _image(self):
        table = self.run.light.free_rays.table(folded=True)
        # a rate of turn is an axial vector: its image turns the other way
        return _View(table=table, profile=self.survey.profile.mirrored(), depth=-self.depth,
                     state=source_state(table, np.array([-self.depth])), rotation=UPSIDE_DOWN @ self.rotation,
                     velocity=UPSIDE_DOWN @ self.velocity, turn_rate=-UPSIDE_DOWN @ self.turn_rate)

    def _view(self, leg):
        return self._image if leg.folded else self._direct

    def doppler(self, echoes):
        """Two-way factor of echoes, Float64, to first order in the mean of the ways out and back."""
        closing = sum(dr.dot(mi.Vector3f(*_opaque(mi.Float, self._view(leg).velocity)), leg.launch_direction)
                      for leg in (echoes.out, echoes.back))
        return two_way_doppler(mi.Float64(0.5 * closing), dr.opaque(mi.Float64, self.speed))

    def add(self, buffer, echoes, element, return_path, *, weight, late):
        """Sum the echoes of one transmit element, delayed by `late` [s], at all receive elements."""
        if return_path == "vector" and self.array_radius > 0:
            doubtful = self._doubtful(echoes)
            if dr.any(doubtful):
                late = late + dr.zeros(mi.Float64, dr.width(doubtful))
                exact, rest = dr.compress(doubtful), dr.compress(~doubtful)
                self.run.count(dr.width(exact), dr.width(doubtful))
                self._add_exactly(buffer, echoes.chosen(exact), element, weight, dr.gather(mi.Float64, late, exact))
                if not dr.width(rest):
                    return
                echoes, late = echoes.chosen(rest), dr.gather(mi.Float64, late, rest)
        if return_path == "eigenray":
            self._add_exactly(buffer, echoes, element, weight, late)
        else:
            self._add_approximately(buffer, echoes, element, return_path, weight, late)

    def _add_approximately(self, buffer, echoes, element, return_path, weight, late):
        """By the one ray to each echo, and differences for the elements."""
        run, survey, lib = self.run, self.survey, self.run.lib
        transmit, receive = survey.transmit, survey.receive
        # ---- transmit: the still array, by reciprocity
        view = self._view(echoes.back)
        off = np.any(transmit.position[element] != self.position)
        farther = self._transmit_delay(echoes, element) if off else None
        # ---- return to the centre, where it is then
        back = self._back(echoes, return_path)
        total = echoes.arrival + back.return_time
        if farther is not None:
            # the hit is met later, and the platform is further on by then: first order, for it moves millimetres
            velocity = _opaque(lib.Float64, view.velocity)
            closing = sum(lib.Float64(n) * v for n, v in zip(back.direction, velocity))
            total += farther * (1 + closing / (dr.opaque(lib.Float64, self.speed) - closing))
        phase, sample, fraction = centre(total + late, start=survey.start, frequency=survey.frequency,
                                         sampling_rate=survey.sampling_rate)
        factor = self._transmitted(echoes, element, weight)
        if farther is not None:
            factor *= lib.Float(echoes.out.travel_time / (echoes.out.travel_time + farther))
        heard, faces = self._heard_from(echoes, total), [] if omni(receive) else receive.faces()
        if len(faces) == 1:
            factor *= self._pressure(view, receive, heard, *faces[0][1:])
        offsets, motion = view.offsets(receive, self.position), (view.profile, view.velocity, view.turn_rate)
        elements = ELEMENT_FIELDS[return_path](offsets, view.depth, *motion)
        difference = difference_of(return_path, offsets, *motion)
        hit_fields = [*back.hit_fields, lib.Float(dr.rcp(back.return_time))]
        hits, fields = len(back.hit_fields), len(elements)
        each_face = len(faces) > 1
        if each_face:
            hit_fields += [*heard, *_opaque(lib.Float, (run.wavelength, receive.length, receive.height))]
            elements = [*elements, *(receive.normal @ view.rotation.T).T, *(receive.along @ view.rotation.T).T]

        def delay(hit, element):
            return difference(hit[:hits], element[:fields])

        def gain(hit, element):
            # spherical spreading to where the element is: 1 / (1 + x) for an element that is later by x of the way
            later = delay(hit, element) * hit[hits]
            spread = 1 - later * (1 - later)
            if not each_face:
                return spread
            wavelength, length, height = hit[hits + 4:]
            return spread * element_pressure(hit[hits + 1:hits + 4], wavelength, element[fields:fields + 3],
                                             element[fields + 3:], length=length, height=height,
                                             pattern=receive.pattern, baffle=receive.baffle)

        buffer.add(amplitude=tuple(part * factor for part in echoes.amplitude), phase=phase, sample=sample,
                   fraction=fraction, hit_fields=hit_fields, element_fields=elements, difference=delay, gain=gain)

    def _add_exactly(self, buffer, echoes, element, weight, late):
        """By an eigenray for every echo and element."""
        survey, lib = self.survey, self.run.lib
        transmit, receive = survey.transmit, survey.receive
        away, view = self._view(echoes.out), self._view(echoes.back)
        depth = dr.opaque(lib.Float64, view.depth)
        velocity, turn_rate = view.opaque_motion(lib.Float64)
        factor, still = self._transmitted(echoes, element, weight), _opaque(lib.Float64, np.zeros(3))
        first, place = echoes.out.travel_time, echoes.back.offset
        if np.any(transmit.position[element] != self.position):
            offset = _opaque(lib.Float64, away.offsets(transmit, self.position)[element])
            first = exact_return(away.table, lib, dr.opaque(lib.Float64, away.depth), echoes.out.offset, mi.Float64(0),
                                 offset, still, still, first)
            factor *= lib.Float(echoes.out.travel_time / first)
        out = first + echoes.between
        amplitude = tuple(part * factor for part in echoes.amplitude)
        middle = exact_return(view.table, lib, depth, place, out, still, velocity, turn_rate, echoes.back.travel_time)
        heard = self._heard_from(echoes, out + middle)
        dr.eval(out, amplitude, middle, heard)
        for row in range(receive.elements):
            offset = _opaque(lib.Float64, view.offsets(receive, self.position)[row])
            back = exact_return(view.table, lib, depth, place, out, offset, velocity, turn_rate, middle)
            phase, sample, fraction = centre(out + back + late, start=survey.start, frequency=survey.frequency,
                                             sampling_rate=survey.sampling_rate)
            spread = lib.Float(middle / back)
            if not omni(receive):
                spread *= self._pressure(view, receive, heard, receive.normal[row], receive.along[row])
            buffer.add(amplitude=tuple(part * spread for part in amplitude), phase=phase, sample=sample,
                       fraction=fraction, hit_fields=[], element_fields=[np.zeros(1)],
                       difference=lambda hit, element: element[0], rows=[row])

    def _doubtful(self, echoes):
        """Echoes for which the vector approximation may be off by more than GUARD at some element."""
        error = self._back(echoes, "vector").expected_error(self._outermost(self._view(echoes.back)))
        if not echoes.single:
            error = dr.maximum(error, self._out(echoes).expected_error(self._outermost(self._view(echoes.out))))
        doubtful = error > dr.opaque(mi.Float, GUARD)
        dr.eval(doubtful)
        return doubtful

    def _outermost(self, view):
        """Fields of the elements farthest out, transmitting and receiving."""
        outermost = np.concatenate([view.offsets(array, self.position)
                                    for array in (self.survey.transmit, self.survey.receive)])
        some = np.unique([pick(column) for column in outermost.T for pick in (np.argmin, np.argmax)])
        return vector_element_fields(outermost[some], view.depth, view.profile, view.velocity, view.turn_rate)

    def _back(self, echoes, method):
        """The way back to the array's centre, where that is then."""
        view = self._view(echoes.back)
        return self._paths(view, echoes.back, method, view.velocity, view.turn_rate, echoes.arrival)

    def _out(self, echoes):
        """The way out, turned round, to the still array."""
        return self._paths(self._view(echoes.out), echoes.out, "vector", np.zeros(3), np.zeros(3),
                           echoes.out.travel_time)

    def _paths(self, view, leg, method, velocity, turn_rate, elapsed):
        lib = self.run.lib
        velocity, turn_rate = _opaque(lib.Float64, velocity), _opaque(lib.Float64, turn_rate)
        return return_paths(view.table, view.state, mi.UInt32(0), leg.offset, leg.travel_time, leg.ray_parameter,
                            leg.spreading_area, -leg.launch_direction.z, velocity=velocity, turn_rate=turn_rate,
                            method=method, elapsed=elapsed)

    def _transmit_delay(self, echoes, element):
        """How much later than from the source the scatterers are reached from a transmit element [s], Float64."""
        lib = self.run.lib
        still = self._out(echoes)
        view = self._view(echoes.out)
        offset = view.offsets(self.survey.transmit, self.position)[element]
        fields = vector_element_fields(offset[None], view.depth, view.profile)
        fields = [dr.opaque(lib.Float, float(field[0])) for field in np.broadcast_arrays(*fields)]
        return lib.Float64(vector_difference(still.hit_fields, fields))

    def _transmitted(self, echoes, element, weight):
        """What a transmit element's weight and pattern make of the echoes."""
        transmit, factor = self.survey.transmit, dr.opaque(mi.Float, weight)
        if omni(transmit):
            return factor
        return factor * self._pressure(self._view(echoes.out), transmit, echoes.out.launch_direction,
                                       transmit.normal[element], transmit.along[element])

    def _pressure(self, view, array, direction, normal, along):
        return pressure(array, direction, self.run.wavelength, view.rotation @ normal, view.rotation @ along)

    def _heard_from(self, echoes, elapsed):
        """Direction the echo comes from, as the moved and turned array sees it, in the scene of the transmission."""
        view, elapsed = self._view(echoes.back), mi.Float(elapsed)
        velocity, turn_rate = view.opaque_motion(mi.Float)
        moved = mi.Vector3f(*velocity) * elapsed
        towards = dr.normalize(echoes.back.launch_direction * dr.norm(mi.Vector3f(echoes.back.offset)) - moved)
        turned = mi.Vector3f(*turn_rate) * elapsed
        return towards - dr.cross(turned, towards)


def _opaque(kind, vector):
    """The components of a vector, opaque: they change without a new kernel."""
    return [dr.opaque(kind, float(component)) for component in vector]


def omni(array):
    """Tell whether the elements of an array look everywhere alike."""
    return array.pattern == "omni" and array.baffle == "none"


def pressure(array, direction, wavelength, normal, along):
    """`element_pressure` of one face on the device, its numbers opaque so that one kernel serves all faces."""
    normal, along = _opaque(mi.Float, normal), _opaque(mi.Float, along)
    wavelength, length, height = _opaque(mi.Float, (wavelength, array.length, array.height))
    return element_pressure(direction, wavelength, normal, along, length=length, height=height,
                            pattern=array.pattern, baffle=array.baffle)
