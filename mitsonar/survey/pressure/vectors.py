"""Echoes at the elements by the vector approximation, and by eigenrays where the approximation is in doubt.

One ray is traced to each scatterer; every element adds a difference of delay.

    transmit    delay and pattern of a transmit element, by reciprocity                      `vector_approximation`
    return      time at which each echo meets the moving source                              `return_paths`
    sum         every echo at every element, with its own delay                     `pairs`, `signal.accumulation`

The pattern of an element is taken in the direction of its own ray: at the attitude of the transmission on the way out,
and at the attitude of the echo's reception on the way back.
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, cast

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, compressed
from mitsonar.device.rotations import rotated
from mitsonar.device.types import Bool, Float, Float64, UInt32
from mitsonar.echoes.record import Echoes
from mitsonar.echoes.scatterers.element_beams import omni
from mitsonar.propagation.returns.return_paths import ReturnPaths
from mitsonar.propagation.returns.vector_approximation import (
    expected_error,
    level_error,
    stays_level,
    vector_difference,
    vector_element_fields,
)
from mitsonar.signal.accumulation import NOWHERE, ImpulseResponses

from .delays import ALL_ROWS, ElementDelays
from .echo_classes import SortedEchoes
from .eigenrays import EigenrayDelays
from .pairs import CURVATURE, ReceivedEchoes, seen_from
from .ping_source import View, opaque

GUARD = 5e-10                      # [s] largest expected error with which the vector approximation is used


@dataclass(frozen=True, kw_only=True, eq=False)
class VectorDelays(ElementDelays):
    """Delays by the vector approximation of this package ("vector") or of the paper ("paper")."""

    method: Literal["vector", "paper"] = "vector"

    def add(self, responses: ImpulseResponses, some: SortedEchoes, element: int, *, weight: float,
            rows: slice = ALL_ROWS, without: Bool | None = None) -> None:
        """Add the echoes of one transmit element at receive elements; see `ElementDelays.add`.

        Echoes `without` (R,) are left out; the flags are evaluated in the same kernel.
        """
        source, receive, lib, echoes = self.source, self.receive, arrays_of(mi.Float), some.echoes
        # ---- transmit: the still array, by reciprocity
        view, off = source.view(echoes.back), self.stands_off(element)
        way_out = source.way_out(echoes) if off else None
        farther = self._transmit_delay(echoes, element, way_out) if way_out is not None else None
        if farther is not None and echoes.shift is not None:
            farther = farther / (1 + lib.Float64(echoes.shift))                  # as in `echoes.body_motion`
        # ---- return to the source at its place then; sound from an element farther off reaches the scatterer later
        met = None if farther is None else echoes.arrival + farther
        known = some.back if met is None and self.method == "vector" else None
        back = source.way_back(echoes, self.method, met, some.moment) if known is None else known
        total = (echoes.arrival if met is None else met) + back.return_time
        phase, sample, fraction = self.placed(some, total)
        if without is not None:
            sample = dr.select(without, NOWHERE, sample)
        factor = self._transmitted(echoes, element, weight, way_out)
        if farther is not None:
            factor *= lib.Float(echoes.out.travel_time / (echoes.out.travel_time + farther))
        # ---- each element by its own difference, at the moment that represents the pulse
        towards = None
        if not omni(receive):
            turned = view.travel.turned(total if back.later is None else total + back.later)
            towards = rotated([-part for part in back.direction], [lib.Float(part) for part in turned], back=True)
        received = ReceivedEchoes(back, view, receive, wavelength=self.wavelength, method=self.method, towards=towards)
        if received.ahead is not None:
            factor = dr.select(received.ahead, factor, 0)
        nearest = source.speed * echoes.back.soonest
        parts = received.pairs(rows, nearest, source.speed)
        real, imaginary = echoes.amplitude
        amplitude = real * factor, imaginary * factor
        # only now: any evaluation before would compute it in an extra kernel
        dr.schedule(without, [pairs.hits for _, pairs in parts])
        for number, pairs in parts:
            responses.add(amplitude=amplitude, phase=phase, sample=sample, fraction=fraction, hit_fields=pairs.hits,
                          element_fields=pairs.elements, difference=pairs.delay, gain=pairs.gain, rows=number,
                          sheet=some.sheet)
        left_out = 0 if without is None else int(cast(UInt32, dr.count(without))[0])
        self.counts.count((echoes.count - left_out) * len(range(receive.elements)[rows]))

    def doubtful(self, echoes: Echoes, back: ReturnPaths) -> Bool:
        """Return True for echoes whose error may exceed GUARD at an element: Bool (R,), not yet evaluated."""
        source = self.source
        error = self._expected_error(back, source.view(echoes.back))
        if not echoes.single:
            error = dr.maximum(error, self._expected_error(source.way_out(echoes), source.view(echoes.out)))
        # an error that is NaN is in doubt, too
        return ~(error <= dr.opaque(arrays_of(mi.Float).Float, GUARD))

    def _expected_error(self, paths: ReturnPaths, view: View) -> Float:
        """Return the largest error [s] to expect at the outermost transmit and receive elements."""
        offsets = np.concatenate([view.offsets(array) for array in (self.transmit, self.receive)])
        outermost = np.unique([pick(column) for column in offsets.T for pick in (np.argmin, np.argmax)])
        # at the source itself there is no error
        offsets = offsets[[number for number in outermost if offsets[number].any()]]
        of_pair = level_error if stays_level(offsets, view.profile, view.tilt, view.climb) else expected_error
        return paths.expected_error(vector_element_fields(offsets, view.depth, view.profile), of_pair)

    def _transmit_delay(self, echoes: Echoes, element: int, way_out: ReturnPaths) -> Float64:
        """Return the delay to scatterers from a transmit element, relative to the source [s]."""
        view = self.source.view(echoes.out)
        fields = vector_element_fields(view.offsets(self.transmit)[element][None], view.depth, view.profile)
        fields = [dr.opaque(mi.Float, float(field[0])) for field in np.broadcast_arrays(*fields)]
        return arrays_of(mi.Float).Float64(vector_difference(way_out.hit_fields, fields))

    def _transmitted(self, echoes: Echoes, element: int, weight: float, way_out: ReturnPaths | None) -> Float:
        """Return the factor of weight and pattern of a transmit element; `way_out` is None at the source."""
        transmit, factor = self.transmit, dr.opaque(arrays_of(mi.Float).Float, weight)
        if omni(transmit):
            return factor
        view, towards = self.source.view(echoes.out), echoes.out.launch_direction
        if way_out is not None:
            offset = opaque(mi.Float, view.offsets(transmit)[element])
            towards = seen_from(towards, offset, way_out.hit_fields[CURVATURE])
        return factor * view.pattern(transmit, element, towards, self.wavelength)


@dataclass(frozen=True, kw_only=True, eq=False)
class GuardedDelays(ElementDelays):
    """Delays by the vector approximation, or by eigenrays where its error may exceed `GUARD`."""

    def add(self, responses: ImpulseResponses, some: SortedEchoes, element: int, *, weight: float,
            rows: slice = ALL_ROWS) -> None:
        """Add the echoes of one transmit element at receive elements; see `ElementDelays.add`."""
        vector = self.changed_to(VectorDelays)
        doubtful = None
        if self._extended:
            some, back = some.with_way_back(self.source)
            doubtful = vector.doubtful(some.echoes, back)
        vector.add(responses, some, element, weight=weight, rows=rows, without=doubtful)
        if doubtful is not None:
            exact = compressed(doubtful)
            if dr.width(exact):
                self.counts.judge(some.echoes.count, dr.width(exact))
                self.changed_to(EigenrayDelays).add(responses, some.chosen(exact), element, weight=weight, rows=rows)

    @property
    def _extended(self) -> bool:
        """Return True if any element is not where the source is."""
        return any(np.any(array.position != self.source.position) for array in (self.transmit, self.receive))
