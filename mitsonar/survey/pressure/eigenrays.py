"""Echoes at the elements, with an eigenray for every echo and element: exact, but slow."""
from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of
from mitsonar.device.rotations import rotated
from mitsonar.device.types import Float64, Triple, UInt32
from mitsonar.echoes.record import EchoLeg
from mitsonar.echoes.scatterers.element_beams import omni
from mitsonar.propagation.numpy_rays.exact_returns import exact_return
from mitsonar.propagation.returns.straight_vectors import dot
from mitsonar.propagation.returns.travel import REST, Travel
from mitsonar.signal.accumulation import ImpulseResponses

from .delays import ALL_ROWS, ElementDelays
from .echo_classes import SortedEchoes
from .ping_source import opaque64


@dataclass(frozen=True, kw_only=True, eq=False)
class EigenrayDelays(ElementDelays):
    """Delays by exact eigenrays."""

    def add(self, responses: ImpulseResponses, some: SortedEchoes, element: int, *, weight: float,
            rows: slice = ALL_ROWS) -> None:
        """Add the echoes of one transmit element at receive elements; see `ElementDelays.add`."""
        echoes = some.echoes
        transmit, receive, lib = self.transmit, self.receive, arrays_of(mi.Float)
        way_out, view = self.source.view(echoes.out), self.source.view(echoes.back)
        depth, travel = dr.opaque(lib.Float64, view.depth), view.travel
        # ---- from the transmit element to the first scatterer
        factor, first, towards = dr.opaque(lib.Float, weight), echoes.out.travel_time, echoes.out.launch_direction
        if self.stands_off(element):
            offset = opaque64(way_out.offsets(transmit)[element])
            first, towards = exact_return(way_out.layers, lib, dr.opaque(lib.Float64, way_out.depth), echoes.out.offset,
                                          lib.Float64(0), offset, REST, first)
            first = _through_field(first, echoes.out, REST, lib.Float64(0), offset)
            factor = factor * lib.Float(echoes.out.travel_time / first)
            if echoes.shift is not None:                                         # as in `echoes.body_motion`
                reached = echoes.out.travel_time
                first = reached + (first - reached) / (1 + lib.Float64(echoes.shift))
        if not omni(transmit):
            factor *= way_out.pattern(transmit, element, towards, self.wavelength)
        # ---- back to the source; that ray is the first guess for each receive element
        place, out = echoes.back.offset, first + echoes.between
        real, imaginary = (part * factor for part in echoes.amplitude)
        centre = opaque64(np.zeros(3))
        middle, _ = exact_return(view.layers, lib, depth, place, out, centre, travel, echoes.back.travel_time)
        middle = _through_field(middle, echoes.back, travel, out, centre)
        met, arrival, then = out, out + middle, middle
        if some.moment:
            met = out + dr.opaque(lib.Float64, some.moment)
            then, _ = exact_return(view.layers, lib, depth, place, met, centre, travel, middle)
            then = _through_field(then, echoes.back, travel, met, centre)
        dr.eval(met, arrival, real, imaginary, then)
        for row in range(receive.elements)[rows]:
            offset = opaque64(view.offsets(receive)[row])
            back, towards = exact_return(view.layers, lib, depth, place, met, offset, travel, then)
            back = _through_field(back, echoes.back, travel, met, offset)
            self.counts.count(echoes.count, lost=int(cast(UInt32, dr.count(dr.isnan(met + back)))[0]))
            phase, sample, fraction = self.placed(some, arrival + (back - then))
            spread = lib.Float(then / back)
            if not omni(receive):
                turned = rotated(towards, travel.turned(met + back), back=True)
                spread *= view.pattern(receive, row, turned, self.wavelength)
            responses.add(amplitude=(real * spread, imaginary * spread), phase=phase, sample=sample,
                          fraction=fraction, hit_fields=[], element_fields=[np.zeros(1)],
                          difference=lambda hit, at: at[0], rows=[row], sheet=some.sheet)


def _through_field(time: Float64, leg: EchoLeg, travel: Travel, met: Float64, offset: Triple) -> Float64:
    """Return times [s] of eigenrays from elements at `offset` [m] with what the field of the water adds to them."""
    if leg.slope is None or leg.later is None:
        return time
    passed = met + time
    place = [part + d for part, d in zip(rotated(offset, travel.turned(passed)), travel.moved(passed))]
    return time + leg.later + dot(leg.slope, place)
