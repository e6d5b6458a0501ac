"""Echoes at the elements by the one ray to each scatterer, and a difference of delay for each element.

    transmit    delay and pattern of a transmit element, by reciprocity                      `vector_approximation`
    return      when each echo meets the source, where that is then                          `return_paths`
    sum         every echo at every element, with its own delay                              `signal.accumulation`
                along a level line by a polynomial, an echo's own                            `line_difference`

The pattern of an element is that towards where its own ray leaves or comes from. With n towards the echo at the source,
1/R the curvature of its wavefront there and d the element's offset, that is (n - d/R) / |n - d/R|: at the transmission
on the way out, and as the turned array sees it at the echo's own reception on the way back.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias, cast

import drjit as dr
import mitsuba as mi
import numpy as np

from ...device.arrays import arrays_of
from ...device.types import Bool, Float, Float64, Triple, UInt32
from ...echoes.element_beams import omni
from ...echoes.record import Echoes
from ...propagation.line_difference import Line, polynomial
from ...propagation.return_paths import ReturnPaths
from ...propagation.straight_vectors import dot
from ...propagation.travel import rotated
from ...propagation.vector_approximation import (ELEMENT_FIELDS, difference_of, level_difference, vector_difference,
                                                 vector_element_fields)
from ...signal.accumulation import NOWHERE, ImpulseResponses
from ...sonar.array import Array
from ...sonar.element_patterns import element_pressure
from .delays import ALL_ROWS, ElementDelays
from .echo_classes import SortedEchoes
from .ping_source import View, opaque

__all__ = ["GUARD", "VectorDelays"]

Difference: TypeAlias = Callable[[Sequence[Float], Sequence[Float]], Float]

GUARD = 5e-10                      # [s] expected error of the vector approximation above which it is not used
SAME_PLANE = 1e-9                  # [m]
FEWEST_ON_A_LINE = 16              # elements for which a polynomial pays,
LINE_ERROR = 1e-11                 # [s] and the most by which it may be off
CURVATURE = 6                      # where 1/R stands among `straight_vectors.hit_fields`


@dataclass(frozen=True, kw_only=True, eq=False)
class VectorDelays(ElementDelays):
    """Delays by the vector approximation, or by the published one.

    Attributes
    ----------
    method : {"vector", "paper"}
    """

    method: Literal["vector", "paper"] = "vector"

    def add(self, responses: ImpulseResponses, some: SortedEchoes, element: int, *, weight: float,
            rows: slice = ALL_ROWS, without: Bool | None = None) -> None:
        """Sum the echoes of one transmit element at receive elements; see `ElementDelays.add`.

        Those `without` (R,) are left out; they are evaluated in one kernel with the others.
        """
        source, receive, lib, echoes = self.source, self.receive, arrays_of(mi.Float), some.echoes
        # ---- transmit: the still array, by reciprocity
        view, off = source.view(echoes.back), self.stands_off(element)
        way_out = source.way_out(echoes) if off else None
        farther = self._transmit_delay(echoes, element, way_out) if way_out is not None else None
        # ---- return to the source, where it is then; from an element farther off the scatterer is met later
        met = None if farther is None else echoes.arrival + farther
        back = source.way_back(echoes, self.method, met)
        total = (echoes.arrival if met is None else met) + back.return_time
        phase, sample, fraction = self.placed(some, total)
        if without is not None:
            sample = dr.select(without, NOWHERE, sample)
        factor = self._transmitted(echoes, element, weight, way_out)
        if farther is not None:
            factor *= lib.Float(echoes.out.travel_time / (echoes.out.travel_time + farther))
        # ---- each element by its own difference
        directional = not omni(receive)
        if directional:
            towards = rotated([-lib.Float64(part) for part in back.direction], view.travel.turned(total), back=True)
            if one_face(receive):
                # in front of one baffle or behind it for all elements
                normal = opaque(lib.Float, view.rotation @ receive.normal[0])
                offset = opaque(lib.Float, view.offsets(receive)[0])
                seen = [lib.Float(part) - d * back.hit_fields[CURVATURE] for part, d in zip(towards, offset)]
                factor = dr.select(dot(seen, normal) >= 0, factor, 0)
                directional = False
        hit_fields, element_fields, difference = self._differences(echoes, back, rows, directional)
        hits, fields = len(hit_fields), len(element_fields)
        hit_fields = [*hit_fields, lib.Float(dr.rcp(back.return_time))]
        if directional:
            face = opaque(lib.Float, (self.wavelength, receive.length, receive.height))
            hit_fields += [*map(lib.Float, towards), *face]
            element_fields = [*element_fields, *(receive.normal[rows] @ view.rotation.T).T,
                              *(receive.along[rows] @ view.rotation.T).T]

        def delay(hit: Sequence[Float], at: Sequence[Float]) -> Float:
            return difference(hit[:hits], at[:fields])

        def gain(hit: Sequence[Float], at: Sequence[Float]) -> Float:
            # Spherical spreading to where the element is: 1 / (1 + x) for an element that is later by x of the way.
            later = delay(hit, at) * hit[hits]
            spread = 1 - later * (1 - later)
            if not directional:
                return spread
            wavelength, length, height = hit[hits + 4:]
            direction = _seen_from(hit[hits + 1:hits + 4], at[:3], hit[CURVATURE])
            return spread * element_pressure(direction, wavelength, at[fields:fields + 3], at[fields + 3:],
                                             length=length, height=height, pattern=receive.pattern,
                                             baffle=receive.baffle)

        real, imaginary = echoes.amplitude
        dr.schedule(without)                   # only now: what is asked of the host on the way would compute it alone
        responses.add(amplitude=(real * factor, imaginary * factor), phase=phase, sample=sample,
                      fraction=fraction, hit_fields=hit_fields, element_fields=element_fields, difference=delay,
                      gain=gain, rows=np.arange(receive.elements)[rows], sheet=some.sheet)
        left_out = 0 if without is None else int(cast(UInt32, dr.count(without))[0])
        self.counts.count((echoes.count - left_out) * len(range(receive.elements)[rows]))

    def _differences(self, echoes: Echoes, back: ReturnPaths, rows: slice,
                     directional: bool) -> tuple[list[Float], list[np.ndarray], Difference]:
        """Fields of echoes and of elements, and the function of both that gives differences of delay.

        Along a level line, where elements have no patterns that ask for more, that is a polynomial.
        """
        view, lib = self.source.view(echoes.back), arrays_of(mi.Float)
        offsets = view.offsets(self.receive)[rows]
        difference = difference_of(self.method, offsets, view.profile, view.tilt, view.climb)
        if difference is level_difference and not directional and len(offsets) >= FEWEST_ON_A_LINE:
            line, nearest = Line.through(offsets), self.source.speed * float(dr.min(echoes.back.travel_time)[0])
            if line is not None and line.error(nearest, self.source.speed) < LINE_ERROR:
                nodes = np.broadcast_arrays(*vector_element_fields(line.nodes, view.depth, view.profile))
                values = [difference(back.hit_fields, opaque(lib.Float, node)) for node in np.transpose(nodes)]
                return Line.coefficients(values), [line.place], lambda hit, at: polynomial(hit, at[0])
        return back.hit_fields, ELEMENT_FIELDS[self.method](offsets, view.depth, view.profile), difference

    def doubtful(self, echoes: Echoes) -> Bool:
        """Say for which echoes the approximation may be off by more than GUARD at some element: Bool (R,), yet to be
        evaluated.
        """
        source = self.source
        error = source.way_back(echoes).expected_error(self._outermost(source.view(echoes.back)))
        if not echoes.single:
            error = dr.maximum(error, source.way_out(echoes).expected_error(self._outermost(source.view(echoes.out))))
        # An error that is not a number is in doubt, too.
        return ~(error <= dr.opaque(arrays_of(mi.Float).Float, GUARD))

    def _outermost(self, view: View) -> list:
        """Fields of the elements farthest out, transmitting and receiving."""
        offsets = np.concatenate([view.offsets(array) for array in (self.transmit, self.receive)])
        outermost = np.unique([pick(column) for column in offsets.T for pick in (np.argmin, np.argmax)])
        return vector_element_fields(offsets[outermost], view.depth, view.profile)

    def _transmit_delay(self, echoes: Echoes, element: int, way_out: ReturnPaths) -> Float64:
        """How much later than from the source scatterers are reached from a transmit element [s]."""
        view = self.source.view(echoes.out)
        fields = vector_element_fields(view.offsets(self.transmit)[element][None], view.depth, view.profile)
        fields = [dr.opaque(mi.Float, float(field[0])) for field in np.broadcast_arrays(*fields)]
        return arrays_of(mi.Float).Float64(vector_difference(way_out.hit_fields, fields))

    def _transmitted(self, echoes: Echoes, element: int, weight: float, way_out: ReturnPaths | None) -> Float:
        """What a transmit element's weight and pattern make of echoes; `way_out` is None for one at the source."""
        transmit, factor = self.transmit, dr.opaque(arrays_of(mi.Float).Float, weight)
        if omni(transmit):
            return factor
        view, towards = self.source.view(echoes.out), echoes.out.launch_direction
        if way_out is not None:
            offset = opaque(mi.Float, view.offsets(transmit)[element])
            towards = _seen_from(towards, offset, way_out.hit_fields[CURVATURE])
        return factor * view.pattern(transmit, element, towards, self.wavelength)


def one_face(array: Array) -> bool:
    """Whether the elements lie in one rigid plane and look everywhere before it alike."""
    plane = np.sum(array.position * array.normal, axis=-1)
    return (array.pattern == "omni" and array.baffle == "hard" and bool(np.all(array.normal == array.normal[0]))
            and bool(np.ptp(plane) < SAME_PLANE))


def _seen_from(towards: Triple, offset: Triple, curvature: Float) -> list:
    """Turn unit vectors from the source towards echoes into those from an element: triples.

    `offset` of the element [m], `curvature` of the echo's wavefront at the source [1/m].
    """
    seen = [part - d * curvature for part, d in zip(towards, offset)]
    per_length = dr.rsqrt(seen[0] * seen[0] + seen[1] * seen[1] + seen[2] * seen[2])
    return [part * per_length for part in seen]
