"""The echoes of one ping for the beam domain: scatterers of the scene, and all that has echoes of its own.

    thin       scatterers that the resolution asks for                                  `echoes.thinned_scatterers`
    reach      their eigenrays, from a table of this depth                              `echoes.eigenray_table`
    receive    where the moving array is when they are back                             `reception`
    scatter    strength of the material, times the sonar equation and the patterns      `sonar_equation`, `patterns`
    hide       behind the bed's horizon, or behind objects          `tracing.bed_horizon`, `tracing.object_shadows`
    others     point targets, smooth surfaces, ghosts, the water                        `echoes.ensonification`

The first five are one kernel, for all scatterers of a ping.
"""
from __future__ import annotations

from collections.abc import Iterator

import drjit as dr
import mitsuba as mi
import numpy as np

from ...device.arrays import arrays_of, compressed, upload
from ...device.chance import ping_key
from ...device.lookups import held
from ...echoes.eigenray_table import EigenrayTable, TableLegs
from ...echoes.element_beams import ElementBeams
from ...echoes.record import Echoes
from ...echoes.scatterers import Cells, Scatterers
from ...echoes.sonar_equation import GRAZING, along_legs
from ...echoes.thinned_scatterers import Density, ThinnedScatterers, ThinnedSet
from ...scene.labels import SEABED
from ...scene.materials import scattering_strength
from ...signal.beam_grid.residual_doppler import residual_doppler
from ...tracing.bed_horizon import BedHorizon
from ...tracing.hits import Hits
from ...tracing.object_shadows import ObjectShadows
from ..array_survey import ArraySurvey
from ..ensonified_ping import ensonification_of
from .line import LineArray
from .patterns import Patterns
from .reception import Arrival, Reception
from .record import FREE, HIDDEN_BY_BED, HIDDEN_BY_OBJECT, GridEchoes, TargetEchoes

__all__ = ["PingEchoes"]

NEGLIGIBLE = 1e-8                  # two-way intensity of the beams below which a patch is not looked at
GHOSTS_TOGETHER = 1 << 19          # scatterers that are looked at by way of the surface at a time
DOPPLER_NODES = 33                 # of sines, between which the rows' factors are linear
SINK = 0.15                        # sine below the horizon that the rows' factors are made for


class PingEchoes:
    """Make the echoes of a survey's pings.

    Parameters
    ----------
    survey : ArraySurvey
    line : LineArray
        Of the receive array.
    per_cell : float [-]
        Scatterers a resolution cell.
    """

    def __init__(self, survey: ArraySurvey, line: LineArray, *, per_cell: float):
        self.survey, self.line, self.per_cell = survey, line, float(per_cell)
        self.lib, self.patterns = arrays_of(mi.Float), Patterns(survey, line)
        geometry, reach = survey.geometry, 0.5 * survey.time[-1] * survey.water.fastest
        facets = Scatterers(geometry, np.inf)
        self.ensonification = ensonification_of(survey, facets)
        self._connector, self._scatterers = self.ensonification.connector, ThinnedScatterers(
            facets, farthest=reach, places=survey.track.position)
        self.nearest, self.farthest = self.ensonification.nearest, self.ensonification.farthest
        self._horizon = BedHorizon(geometry, self.farthest)
        self._objects = ObjectShadows(geometry, survey.water, self.farthest)
        self._kinds = upload(mi.UInt32, geometry.named.label_kinds())
        turned = float(np.linalg.norm(survey.voyage.turn_rate, axis=1).max()) * survey.time[-1]
        self._beams = ElementBeams(survey.transmit, survey.receive, survey.wavelength, turned) or None
        self._residual = residual_doppler(survey.pulse)
        self._table: EigenrayTable | None = None
        self._reception: tuple[int, Reception] | None = None
        dr.eval(self._kinds)

    def reception(self, ping: int) -> Reception:
        """Give how the echoes of a ping are received; the last answer is kept."""
        if self._reception is None or self._reception[0] != ping:
            self._reception = ping, Reception(self.survey, ping, axis=self.line.axis, normal=self.line.normal,
                                              receive_centre=self.line.centre,
                                              transmit_centre=self.patterns.transmit_centre)
        return self._reception[1]

    def doppler(self, ping: int) -> np.ndarray | None:
        """Give the Doppler factors of the grid's rows, at sines evenly from -1 to 1; None where nothing moves."""
        reception = self.reception(ping)
        if reception.still:
            return None
        return reception.doppler_of_sines(np.linspace(-1, 1, DOPPLER_NODES), SINK)

    def of_scatterers(self, ping: int) -> GridEchoes | None:
        """Give the echoes of a ping's scatterers; None where there is none."""
        reception, rows = self.reception(ping), _RowDoppler(self.doppler(ping))
        origin, rotation, density = self.survey.track.position[ping], reception.rotation, self._density(ping, reception)
        patch, k = self._candidates(density, reception)
        if not dr.width(patch):
            return None
        table = self._table_of(-float(origin[2]))
        scatterers = self._scatterers.at(patch, k, density)
        legs = table.legs(scatterers.offset)
        arrival = reception.receive(sent=legs.launch_direction, out_distance=legs.distance, out_time=legs.travel_time,
                                    towards=legs.launch_direction, back_distance=legs.distance,
                                    back_time=legs.travel_time)
        lit = scatterers.exists & legs.exists
        energy = self._energy(scatterers, legs, table, lit)
        factor = self.patterns.factor(arrival.sent, arrival.towards, rotation)
        state = self._state(scatterers, legs, table, origin, lit & (energy > 0))
        return self._on_grid(arrival, rows, energy, scatterers.amplitude, factor, state=state, label=scatterers.label,
                            launch=legs.launch_direction, offset=scatterers.offset, origin=origin)

    def _density(self, ping: int, reception: Reception) -> Density:
        """How densely a ping needs scatterers."""
        survey = self.survey
        return Density(origin=survey.track.position[ping], axis=reception.rotation @ self.line.axis,
                       per_cell=self.per_cell, range_cell=survey.sound_speed(ping) / (2 * survey.pulse.bandwidth),
                       sine_cell=survey.wavelength / self.line.length, nearest=self.nearest, farthest=self.farthest)

    def _candidates(self, density: Density, reception: Reception) -> tuple[mi.UInt32, mi.UInt32]:
        """Scatterers that may exist, but for those that the beams make negligible."""
        def useful(direction: mi.Vector3f, distance: mi.Float) -> mi.Bool:
            if self._beams is None:
                return mi.Bool(True)
            return self._beams.bound(direction, distance, reception.rotation) > NEGLIGIBLE

        return self._scatterers.candidates(density, useful)

    def _energy(self, scatterers: ThinnedSet, legs: TableLegs, table: EigenrayTable, lit: mi.Bool) -> mi.Float:
        """What comes back to the body's origin, without patterns."""
        speed = dr.opaque(mi.Float64, table.sound_speed)
        hits = Hits.on_surface(valid=lit, point=scatterers.offset, normal=scatterers.normal,
                               arrival_direction=legs.arrival_direction, sound_speed=speed, shape=scatterers.shape,
                               primitive=scatterers.primitive, uv=scatterers.uv)
        strength, sin_grazing = scattering_strength(hits, lit, self.survey.frequency)
        energy = along_legs(strength * scatterers.area, legs.gain, legs.gain)
        return dr.select(lit & (sin_grazing > GRAZING) & dr.isfinite(energy), dr.maximum(energy, 0), 0)

    def _state(self, scatterers: ThinnedSet, legs: TableLegs, table: EigenrayTable, origin: np.ndarray,
               active: mi.Bool) -> mi.UInt32:
        """What hides scatterers."""
        launch, arrival = legs.launch_direction, legs.arrival_direction
        on_bed = dr.gather(mi.UInt32, self._kinds, scatterers.label) == SEABED
        state = dr.zeros(mi.UInt32, dr.width(scatterers.label))
        heading = mi.Vector2f(launch.x, launch.y)
        horizon = self._horizon.around(origin, table.launch_rise)
        if horizon is not None:
            upwards = scatterers.normal * dr.copysign(mi.Float(1), scatterers.normal.z)
            hidden = horizon.hidden(heading, legs.horizontal_range, launch.z, on_bed)
            hidden |= on_bed & (dr.dot(upwards, arrival) > 0)
            state = dr.select(active & hidden, HIDDEN_BY_BED, state)
        if self._objects.exist:
            behind = self._objects.sectors(origin).behind(heading, legs.horizontal_range)
            start = mi.Point3f(*(dr.opaque(mi.Float, float(v)) for v in origin))
            hidden = self._objects.hidden(
                self._objects.sources(-float(origin[2])), start, launch, arrival,
                start + mi.Vector3f(scatterers.offset), scatterers.normal, legs.horizontal_range,
                active & (state == FREE) & behind)
            state = dr.select(hidden, HIDDEN_BY_OBJECT, state)
        return state

    def hiding(self, ping: int, echoes: GridEchoes) -> tuple[mi.UInt32, mi.UInt32]:
        """Give which scatterers objects hide, by their numbers, and the numbers of the objects: UInt32 (H,)."""
        index = compressed(echoes.state == HIDDEN_BY_OBJECT)
        if not dr.width(index):
            return index, mi.UInt32()
        origin = self.survey.track.position[ping]
        x, y, depth, launch = (dr.gather(mi.Float, column, index) for column in
                               (echoes.x, echoes.y, echoes.depth, echoes.launch_sine))
        across = dr.sqrt(x * x + y * y)
        cosine = dr.sqrt(dr.maximum(1 - launch * launch, 0)) / dr.maximum(across, 1e-6)
        start = mi.Point3f(*(dr.opaque(mi.Float, float(v)) for v in origin))
        first = self._objects.first(self._objects.sources(-float(origin[2])), start,
                                    mi.Vector3f(x * cosine, y * cosine, -launch), across)
        return index, first

    def _table_of(self, depth: float) -> EigenrayTable:
        """The table of a depth; the last one is kept."""
        if self._table is None or self._table.depth != depth:
            self._table = EigenrayTable(self._connector, depth=depth, farthest=self.farthest)
        return self._table

    # ---- what the element chain makes: targets, smooth surfaces, ghosts, water

    def of_targets(self, ping: int) -> Iterator[TargetEchoes]:
        """Yield the echoes of a ping that owe no phase to chance."""
        reception, rows = self.reception(ping), _RowDoppler(self.doppler(ping))
        origin = self.survey.track.position[ping]
        for label, echoes in self.ensonification.coherent_echoes(origin):
            placed = self._of_echoes(echoes, reception, rows, origin)
            yield TargetEchoes(echoes=placed, label=np.broadcast_to(label.numpy(), dr.width(placed.sine)))

    def mirrored(self, ping: int) -> Iterator[GridEchoes]:
        """Yield the echoes of scatterers by way of a flat surface that mirrors."""
        sights = self.ensonification.sights
        if not sights.mirror or sights.max_depth == 1:
            return
        reception, rows = self.reception(ping), _RowDoppler(self.doppler(ping))
        origin, density = self.survey.track.position[ping], self._density(ping, reception)
        patch, k = self._candidates(density, reception)
        start = self.lib.Array3f64(*(dr.opaque(mi.Float64, float(v)) for v in origin))
        for first in range(0, dr.width(patch), GHOSTS_TOGETHER):
            index = dr.arange(mi.UInt32, min(GHOSTS_TOGETHER, dr.width(patch) - first)) + first
            some = self._scatterers.at(dr.gather(mi.UInt32, patch, index), dr.gather(mi.UInt32, k, index), density)
            some = some.where_existing()
            if not dr.width(some.area):
                continue
            cells = Cells(point=start + some.offset, normal=some.normal, area=some.area, amplitude=some.amplitude,
                          shape=some.shape, primitive=some.primitive, uv=some.uv)
            for echoes in self.ensonification.mirrored_echoes(origin, cells):
                yield self._of_echoes(echoes, reception, rows, origin)

    def by_chance(self, ping: int, seed: int) -> Iterator[GridEchoes]:
        """Yield the echoes of more bounces and of the water."""
        reception, rows = self.reception(ping), _RowDoppler(self.doppler(ping))
        origin, below = self.survey.track.position[ping], float(self.survey.depth_below[ping])
        for echoes in self.ensonification.random_echoes(origin, reception.rotation, below, ping_key(seed, ping)):
            yield self._of_echoes(echoes, reception, rows, origin)

    def _of_echoes(self, echoes: Echoes, reception: Reception, rows: _RowDoppler, origin: np.ndarray) -> GridEchoes:
        """Put echoes along exact legs on the grid."""
        out, back = echoes.out, echoes.back
        arrival = reception.receive(
            sent=out.sent_towards, out_distance=mi.Float(dr.norm(out.offset)), out_time=echoes.arrival,
            towards=back.sent_towards, back_distance=mi.Float(dr.norm(back.offset)), back_time=back.travel_time)
        factor = self.patterns.factor(arrival.sent, arrival.towards, reception.rotation)
        root = dr.rsqrt(dr.maximum(echoes.energy, 1e-38))
        nothing = dr.zeros(mi.UInt32, echoes.count)
        unit = tuple(part * root for part in echoes.amplitude)
        return self._on_grid(arrival, rows, echoes.energy, unit, factor, state=nothing, label=nothing,
                             launch=out.sent_towards, offset=out.offset, origin=origin)

    # ---- the grid

    def _on_grid(self, arrival: Arrival, rows: _RowDoppler, energy: mi.Float, amplitude, factor, *, state, label,
                 launch, offset, origin) -> GridEchoes:
        """Lay echoes on the grid: their carrier's phase, and what Doppler does to a sweep."""
        survey, pulse = self.survey, self.survey.pulse
        frequency, rate, start = (dr.opaque(mi.Float64, v) for v in (pulse.frequency, survey.sampling_rate,
                                                                    survey.start))
        delay = arrival.delay + dr.opaque(mi.Float64, self.patterns.drive_delay)
        rest = rows.rest(arrival)
        later, turned = mi.Float(0), mi.Float(0)
        if rest is not None:
            later, turned = self._residual.delay(rest), self._residual.phase(rest)
        cycles = delay * frequency
        sine, cosine = dr.sincos((mi.Float(cycles - dr.round(cycles)) - turned) * float(2 * np.pi))
        real, imaginary = factor
        gain = dr.square(real) if imaginary is None else dr.square(real) + dr.square(imaginary)
        root = dr.select(state == FREE, dr.sqrt(energy), 0)
        a, b = amplitude
        a, b = root * (a * cosine + b * sine), root * (b * cosine - a * sine)
        if imaginary is None:
            a, b = a * real, b * real
        else:
            a, b = a * real - b * imaginary, a * imaginary + b * real
        column = mi.Float((delay + mi.Float64(later) - start) * rate)
        echoes = GridEchoes(column=column, sine=arrival.sine, real=a, imaginary=b, energy=energy * gain, state=state,
                            label=label, launch_sine=-launch.z, x=mi.Float(offset.x), y=mi.Float(offset.y),
                            depth=dr.opaque(mi.Float, -float(origin[2])) - mi.Float(offset.z))
        dr.eval(*vars(echoes).values())
        return echoes


class _RowDoppler:
    """The Doppler factors of the grid's rows, and what is left of an echo's own."""

    def __init__(self, factors: np.ndarray | None):
        self._factors = None if factors is None else upload(mi.Float, (factors - 1).astype(np.float32))

    def rest(self, arrival: Arrival) -> mi.Float | None:
        """Give the factor of echoes over that of their row, minus 1; None where nothing moves."""
        if self._factors is None:
            return None
        last = DOPPLER_NODES - 1
        place = held((arrival.sine + 1) * (0.5 * last), 0.0, last - 1e-3)
        node = mi.UInt32(place)
        low, high = (dr.gather(mi.Float, self._factors, node + step) for step in (0, 1))
        row = low + (high - low) * (place - mi.Float(node))
        return (arrival.doppler - row) / (1 + row)


