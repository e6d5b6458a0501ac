"""A source of a ping, with the array about it: what becomes of the echoes that were lit from there.

    transmit    delay and pattern of a transmit element, by reciprocity                      `vector_approximation`
    return      when each echo meets the array's centre, where that is then                  `return_paths`
    sum         every echo at every element, with its own delay                              `signal.accumulation`

Echoes for which the approximation is in doubt by more than `GUARD` at some element, and all of them where that is asked
for, take an eigenray to every element instead (`exact_returns`).

The pattern of an element is that towards where its own ray leaves or comes from. With n towards the echo at the array's
centre, 1/R the curvature of its wavefront there and d the element's offset, that is (n - d/R) / |n - d/R|: at the
transmission on the way out, and as the turned array sees it at the echo's own reception on the way back.
"""
from dataclasses import dataclass
from functools import cached_property

import drjit as dr
import mitsuba as mi
import numpy as np

from ..echoes.element_beams import omni, pressure
from ..propagation.exact_returns import exact_return
from ..propagation.return_paths import return_paths
from ..propagation.travel import REST, Travel, rotated
from ..propagation.two_point import source_state
from ..propagation.vector_approximation import ELEMENT_FIELDS, difference_of, vector_difference, vector_element_fields
from ..signal.accumulation import centre
from ..signal.doppler import two_way_doppler
from ..sonar.element_patterns import element_pressure

__all__ = ["GUARD", "Station"]

GUARD = 5e-10                      # [s] error to be expected of the vector approximation from which on it is not used
CURVATURE = 6                      # where 1/R stands among `straight_vectors.hit_fields`
UPSIDE_DOWN = np.diag([1.0, 1.0, -1.0])


@dataclass(frozen=True, kw_only=True, eq=False)
class _View:
    """The platform and the water as legs see them: as they are, or unfolded about the surface and seen as an image."""

    table: object
    profile: object
    state: object                  # `SourceState` of the depth
    depth: float
    rotation: np.ndarray           # body to scene
    travel: Travel
    tilt: float                    # [rad], the most it leans over
    climb: float                   # [m/s], its largest vertical speed

    def offsets(self, array, position):
        """Elements from the source, which stands at `position` in the body: (E, 3)."""
        return (array.position - position) @ self.rotation.T

    @classmethod
    def of(cls, travel, mirror=np.ones(3), **water):
        """See a `PingTravel` of one ping, or its image under the diagonal of a mirror (3,)."""
        # a rotation vector is axial: its image turns the other way, but for the part about the mirror's normal
        axial = mirror * np.prod(mirror)
        d, r = travel.displacement[0] * mirror, travel.turn[0] * axial
        powers = np.arange(1, len(d) + 1)
        device = Travel(displacement=tuple(map(_opaque64, d)), turn=tuple(map(_opaque64, r)),
                        duration=dr.opaque(mi.Float64, travel.duration))
        return cls(travel=device, tilt=float(np.linalg.norm(travel.reach(travel.turn)[:2])),
                   climb=float((powers * travel.duration ** (powers - 1)) @ np.abs(d[:, 2])), **water)


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
        # what stands off the track's point is carried round it as the platform turns
        self.travel = survey.travel(ping, position)
        self.speed = float(survey.profile.at(self.depth))
        self.array_radius = max(np.linalg.norm(array.position - position, axis=1).max()
                                for array in (survey.transmit, survey.receive))

    @cached_property
    def _direct(self):
        return _View.of(self.travel, table=self.run.light.tracer.table, profile=self.survey.profile,
                        state=self.sources.state, depth=self.depth, rotation=self.rotation)

    @cached_property
    def _image(self):
        table = self.run.light.free_rays.table(folded=True)
        return _View.of(self.travel, mirror=np.diag(UPSIDE_DOWN), table=table, profile=self.survey.profile.mirrored(),
                        depth=-self.depth, state=source_state(table, np.array([-self.depth])),
                        rotation=UPSIDE_DOWN @ self.rotation)

    def _view(self, leg):
        return self._image if leg.folded else self._direct

    def time_scale(self, echoes, element, place=None, moment=0.0):
        """Two-way factor of echoes of what is sent at a moment, and when that is heard.

        Parameters
        ----------
        echoes : Echoes
        element : int
            That sends.
        place : (3,) [m] or None
            Where they are heard, body frame; None: at the source.
        moment : float [s]
            After the beginning of the pulse.

        Returns
        -------
        doppler : Float64 (R,)
        when : Float64 (R,) [s]
            After the beginning of the echo. As the platform passes, the factor changes: second order in the moment.
        """
        back, speed = self._back(echoes, "vector"), dr.opaque(mi.Float64, self.speed)
        sender, slower, bend = self.survey.transmit.position[element], [], 0
        place, wide = self.position if place is None else place, self.run.lib.Array3f64
        moment = dr.opaque(mi.Float64, moment)
        ways = ((echoes.out, wide(echoes.out.launch_direction), echoes.out.travel_time, sender, mi.Float64(0)),
                (echoes.back, -wide(*map(mi.Float64, back.direction)), back.return_time, place,
                 echoes.arrival + back.return_time))
        # the mean velocity until the moment, and that at the moment
        for share in (0.5, 1.0):
            closing = []
            for leg, towards, time, at, begin in ways:
                view, when = self._view(leg), begin + share * moment
                arm = rotated(_opaque64(view.rotation @ (at - self.position)), view.travel.turned(when))
                velocity = wide(*view.travel.velocity(when)) + dr.cross(wide(*view.travel.turn_rate(when)), wide(*arm))
                distance = time * speed
                towards = dr.normalize(towards * distance - wide(*arm))
                closing.append(dr.dot(velocity, towards))
                if share < 1:
                    across = dr.maximum(dr.squared_norm(velocity) - dr.square(closing[-1]), 0)
                    bend += across / dr.maximum(distance, 1e-3) / speed
            slower.append(1 / two_way_doppler(closing[0], speed, closing[1]))
        return 1 / (slower[1] + bend * moment), (slower[0] + 0.5 * bend * moment) * moment

    def neighbours(self, echoes, tolerance):
        """Put receive elements together that hear all these echoes with factors within a tolerance.

        Returns
        -------
        list of (slice, (3,) [m])
            Rows of the receive array, and their middle in the body frame.
        """
        position, legs = self.survey.receive.position, (echoes.out, echoes.back)
        nearest = self.speed * min(float(dr.min(leg.travel_time)[0]) for leg in legs)
        travel = self.travel
        per_metre = (travel.peak(travel.displacement, 1)[0] / max(nearest, 1e-3)
                     + travel.peak(travel.turn, 1)[0]) / self.speed
        widest, groups, first = tolerance / max(per_metre, 1e-30), [], 0
        for last in range(1, len(position) + 1):
            some = position[first:last + 1]
            if last == len(position) or np.linalg.norm(some - some.mean(0), axis=1).max() > widest:
                groups.append((slice(first, last), position[first:last].mean(0)))
                first = last
        return groups

    def add(self, buffer, echoes, element, return_path, *, weight, late, rows=slice(None)):
        """Sum the echoes of one transmit element, delayed by `late` [s], at all receive elements or some rows."""
        if return_path == "vector" and self.array_radius > 0:
            doubtful = self._doubtful(echoes)
            if dr.any(doubtful):
                late = late + dr.zeros(mi.Float64, dr.width(doubtful))
                exact, rest = dr.compress(doubtful), dr.compress(~doubtful)
                self.run.count(dr.width(exact), dr.width(doubtful))
                self._add_exactly(buffer, echoes.chosen(exact), element, weight, dr.gather(mi.Float64, late, exact),
                                  rows)
                if not dr.width(rest):
                    return
                echoes, late = echoes.chosen(rest), dr.gather(mi.Float64, late, rest)
        if return_path == "eigenray":
            self._add_exactly(buffer, echoes, element, weight, late, rows)
        else:
            self._add_approximately(buffer, echoes, element, return_path, weight, late, rows)

    def _add_approximately(self, buffer, echoes, element, return_path, weight, late, rows):
        """By the one ray to each echo, and differences for the elements."""
        run, survey, lib = self.run, self.survey, self.run.lib
        transmit, receive = survey.transmit, survey.receive
        run.tally(echoes.count * receive.elements)
        # ---- transmit: the still array, by reciprocity
        view = self._view(echoes.back)
        off = np.any(transmit.position[element] != self.position)
        away = self._out(echoes) if off else None
        farther = self._transmit_delay(echoes, element, away) if off else None
        # ---- return to the centre, where it is then; from an element farther off the hit is met later
        met = echoes.arrival + farther if off else echoes.arrival
        back = self._paths(view, echoes.back, return_path, view.travel, met)
        total = met + back.return_time
        phase, sample, fraction = centre(total + late, start=survey.start, frequency=survey.frequency,
                                         sampling_rate=survey.sampling_rate)
        factor = self._transmitted(echoes, element, weight, away)
        if off:
            factor *= lib.Float(echoes.out.travel_time / (echoes.out.travel_time + farther))
        offsets = view.offsets(receive, self.position)[rows]
        elements = ELEMENT_FIELDS[return_path](offsets, view.depth, view.profile)
        difference = difference_of(return_path, offsets, view.profile, view.tilt, view.climb)
        hit_fields = [*back.hit_fields, lib.Float(dr.rcp(back.return_time))]
        hits, fields = len(back.hit_fields), len(elements)
        looks = not omni(receive)
        if looks:
            heard = rotated([-lib.Float64(part) for part in back.direction], view.travel.turned(total), back=True)
            face = _opaque(lib.Float, (run.wavelength, receive.length, receive.height))
            hit_fields += [*map(lib.Float, heard), *face]
            elements = [*elements, *(receive.normal[rows] @ view.rotation.T).T,
                        *(receive.along[rows] @ view.rotation.T).T]

        def delay(hit, element):
            return difference(hit[:hits], element[:fields])

        def gain(hit, element):
            # spherical spreading to where the element is: 1 / (1 + x) for an element that is later by x of the way
            later = delay(hit, element) * hit[hits]
            spread = 1 - later * (1 - later)
            if not looks:
                return spread
            wavelength, length, height = hit[hits + 4:]
            towards = seen_from(hit[hits + 1:hits + 4], element[:3], hit[CURVATURE])
            return spread * element_pressure(towards, wavelength, element[fields:fields + 3], element[fields + 3:],
                                             length=length, height=height, pattern=receive.pattern,
                                             baffle=receive.baffle)

        buffer.add(amplitude=tuple(part * factor for part in echoes.amplitude), phase=phase, sample=sample,
                   fraction=fraction, hit_fields=hit_fields, element_fields=elements, difference=delay, gain=gain,
                   rows=np.arange(receive.elements)[rows])

    def _add_exactly(self, buffer, echoes, element, weight, late, rows):
        """By an eigenray for every echo and element."""
        survey, lib = self.survey, self.run.lib
        transmit, receive = survey.transmit, survey.receive
        away, view = self._view(echoes.out), self._view(echoes.back)
        depth, travel = dr.opaque(lib.Float64, view.depth), view.travel
        factor, first, towards = dr.opaque(mi.Float, weight), echoes.out.travel_time, echoes.out.launch_direction
        if np.any(transmit.position[element] != self.position):
            offset = _opaque64(away.offsets(transmit, self.position)[element])
            first, towards = exact_return(away.table, lib, dr.opaque(lib.Float64, away.depth), echoes.out.offset,
                                          mi.Float64(0), offset, REST, first)
            factor = factor * lib.Float(echoes.out.travel_time / first)
        if not omni(transmit):
            factor *= self._pressure(away, transmit, towards, element)
        place, out = echoes.back.offset, first + echoes.between
        amplitude = tuple(part * factor for part in echoes.amplitude)
        middle, _ = exact_return(view.table, lib, depth, place, out, _opaque64(np.zeros(3)), travel,
                                 echoes.back.travel_time)
        dr.eval(out, amplitude, middle)
        for row in range(receive.elements)[rows]:
            offset = _opaque64(view.offsets(receive, self.position)[row])
            back, towards = exact_return(view.table, lib, depth, place, out, offset, travel, middle)
            self.run.tally(echoes.count, lost=int(dr.count(dr.isnan(out + back))[0]))
            phase, sample, fraction = centre(out + back + late, start=survey.start, frequency=survey.frequency,
                                             sampling_rate=survey.sampling_rate)
            spread = lib.Float(middle / back)
            if not omni(receive):
                heard = rotated(towards, travel.turned(out + back), back=True)
                spread *= self._pressure(view, receive, heard, row)
            buffer.add(amplitude=tuple(part * spread for part in amplitude), phase=phase, sample=sample,
                       fraction=fraction, hit_fields=[], element_fields=[np.zeros(1)],
                       difference=lambda hit, element: element[0], rows=[row])

    def _doubtful(self, echoes):
        """Echoes for which the vector approximation may be off by more than GUARD at some element."""
        error = self._back(echoes, "vector").expected_error(self._outermost(self._view(echoes.back)))
        if not echoes.single:
            error = dr.maximum(error, self._out(echoes).expected_error(self._outermost(self._view(echoes.out))))
        # what is not a number is in doubt, too
        doubtful = ~(error <= dr.opaque(mi.Float, GUARD))
        dr.eval(doubtful)
        return doubtful

    def _outermost(self, view):
        """Fields of the elements farthest out, transmitting and receiving."""
        outermost = np.concatenate([view.offsets(array, self.position)
                                    for array in (self.survey.transmit, self.survey.receive)])
        some = np.unique([pick(column) for column in outermost.T for pick in (np.argmin, np.argmax)])
        return vector_element_fields(outermost[some], view.depth, view.profile)

    def _back(self, echoes, method):
        """The way back to the array's centre, where that is then."""
        view = self._view(echoes.back)
        return self._paths(view, echoes.back, method, view.travel, echoes.arrival)

    def _out(self, echoes):
        """The way out, turned round, to the still array."""
        return self._paths(self._view(echoes.out), echoes.out, "vector", REST, echoes.out.travel_time)

    def _paths(self, view, leg, method, travel, elapsed):
        return return_paths(view.table, view.state, mi.UInt32(0), leg.offset, leg.travel_time, leg.ray_parameter,
                            leg.spreading_area, -leg.launch_direction.z, travel=travel, method=method, elapsed=elapsed)

    def _transmit_delay(self, echoes, element, away):
        """How much later than from the source the scatterers are reached from a transmit element [s], Float64."""
        lib = self.run.lib
        view = self._view(echoes.out)
        offset = view.offsets(self.survey.transmit, self.position)[element]
        fields = vector_element_fields(offset[None], view.depth, view.profile)
        fields = [dr.opaque(lib.Float, float(field[0])) for field in np.broadcast_arrays(*fields)]
        return lib.Float64(vector_difference(away.hit_fields, fields))

    def _transmitted(self, echoes, element, weight, away):
        """What a transmit element's weight and pattern make of the echoes; `away` is None for one at the source."""
        transmit, factor = self.survey.transmit, dr.opaque(mi.Float, weight)
        if omni(transmit):
            return factor
        view, towards = self._view(echoes.out), echoes.out.launch_direction
        if away is not None:
            offset = _opaque(mi.Float, view.offsets(transmit, self.position)[element])
            towards = seen_from(towards, offset, away.hit_fields[CURVATURE])
        return factor * self._pressure(view, transmit, towards, element)

    def _pressure(self, view, array, direction, element):
        """Pattern of one element towards directions in the scene, at the attitude of the transmission."""
        return pressure(array, [mi.Float(part) for part in direction], self.run.wavelength,
                        view.rotation @ array.normal[element], view.rotation @ array.along[element])


def seen_from(towards, offset, curvature):
    """Turn unit vectors from the centre of an array towards echoes into those from an element: triples.

    `offset` of the element [m], `curvature` of the echo's wavefront at the centre [1/m].
    """
    seen = [part - d * curvature for part, d in zip(towards, offset)]
    per_length = dr.rsqrt(seen[0] * seen[0] + seen[1] * seen[1] + seen[2] * seen[2])
    return [part * per_length for part in seen]


def _opaque(kind, vector):
    """The components of a vector, opaque: they change without a new kernel."""
    return [dr.opaque(kind, float(component)) for component in vector]


def _opaque64(vector):
    return tuple(_opaque(mi.Float64, vector))
