"""Echoes of the water in the beam domain: random points around a sonar, connected by a table of eigenrays.

The points are those of `echoes.bounces.volume`. Their phases are random, so that the table's times need not be exact.
The bed and objects may hide only points below the highest of them, or points whose rays have turned: rays are traced
to these alone. All the rest becomes part of the caller's kernel.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import compressed, opaque_vector, picked
from mitsonar.device.chance import Salt, gaussian, hashed_pair, salted
from mitsonar.device.types import ArrayTypes
from mitsonar.echoes.bounces.volume import WaterEchoes
from mitsonar.echoes.sights.eigenray_table import EigenrayTable
from mitsonar.echoes.sonar_equation import along_legs
from mitsonar.scene.shadows.occlusion import along_fan
from mitsonar.scene.tracing.connection import CLEAR
from mitsonar.scene.tracing.tracer import angles

from .ground import FREE, HIDDEN_BY_BED, Ground
from .placed_echoes import PlacedEchoes


class WaterPoints:
    """Points of the water around a sonar that moves over a ground."""

    def __init__(self, ground: Ground, points: WaterEchoes):
        self._ground, self._points, self._lib = ground, points, points.lib
        self._table: EigenrayTable | None = None

    def around(self, origin: np.ndarray, direction: mi.Vector3f, solid_angle: mi.Float,
               place: mi.Float, key: int) -> PlacedEchoes | None:
        """Return the points along rays (R,) from a place (3,) [m], one for each; None if none lies in the water."""
        # origin (3,) [m]; direction (R,); solid_angle (R,) [sr]; place (R,) in [0, 1) of the window of distances
        start, row_key = (opaque_vector(self._lib.Array3f64, origin),
                          dr.opaque(mi.UInt32, salted(key, Salt.ARRAY_WATER)))
        # with the directions, which it has most of its sums in common with
        dr.schedule(solid_angle)
        index, distance = self._points.spread(start, direction, place, self._ground.under_bed(origin))
        if not dr.width(index):
            return None
        r = dr.gather(mi.Float, distance, index)
        offset, table = _placed(self._lib, direction, distance, index), self._table_of(-float(origin[2]))
        depth, straight = dr.opaque(mi.Float, table.depth) - mi.Float(offset.z), table.legs(offset)
        energy = along_legs(self._points.strength(depth, r, picked(solid_angle, index)), straight.gain, straight.gain)
        counts = straight.exists & (energy > 0) & dr.isfinite(energy)
        top = dr.opaque(mi.Float, self._ground.ensonification.tracer.geometry.depth_range[0] - CLEAR)
        launch, arrival = straight.launch_direction, straight.arrival_direction
        above = (dr.maximum(depth, dr.opaque(mi.Float, table.depth)) < top) & (launch.z * arrival.z > 0)
        legs = self._ground.through_field(straight, offset, origin, table)
        real, imaginary = gaussian(self._lib, *hashed_pair(self._lib, index, row_key))
        return PlacedEchoes(sent=legs.launch_direction, towards=legs.launch_direction, out_distance=legs.distance,
                            back_distance=legs.distance, out_time=legs.travel_time, back_time=legs.travel_time,
                            out_offset=offset, back_offset=offset, energy=dr.select(counts, energy, 0), real=real,
                            imaginary=imaginary, label=dr.zeros(mi.UInt32, dr.width(index)),
                            state=self._hidden(origin, counts & ~above, direction, distance, index, table))

    def _hidden(self, origin: np.ndarray, doubt: mi.Bool, direction: mi.Vector3f, distance: mi.Float,
                index: mi.UInt32, table: EigenrayTable) -> mi.UInt32:
        """Return the states of points (R,), of which rays may meet something on the way to those in `doubt`."""
        state, there = dr.full(mi.UInt32, FREE, dr.width(doubt)), compressed(doubt)
        if dr.width(there):
            offset = _placed(self._lib, direction, distance, dr.gather(mi.UInt32, index, there))
            legs, sonar = table.legs(offset), opaque_vector(mi.Point3f, origin)
            angle, heading = angles(legs.launch_direction)
            blocked = along_fan(self._ground.ensonification.tracer.geometry.scene, self._ground.fans(origin), sonar,
                                mi.UInt32(0), angle, heading, mi.Point3f(offset) + sonar, legs.horizontal_range,
                                mi.Bool(True))
            dr.scatter(state, mi.UInt32(HIDDEN_BY_BED), there, blocked)
        return state

    def _table_of(self, depth: float) -> EigenrayTable:
        """Return the table from a depth [m] to all depths that points may have; the last table is kept."""
        if self._table is None or self._table.depth != depth:
            farthest = self._points.farthest
            self._table = EigenrayTable(self._ground.ensonification.connector, depth=depth, farthest=farthest,
                                        depths=(0.0, depth + farthest))
        return self._table


def _placed(lib: ArrayTypes, direction: mi.Vector3f, distance: mi.Float, index: mi.UInt32) -> dr.ArrayBase:
    """Return the offsets (V,) [m] of the points with these numbers, Array3f64."""
    return lib.Array3f64(dr.gather(mi.Vector3f, direction, index) * dr.gather(mi.Float, distance, index))
