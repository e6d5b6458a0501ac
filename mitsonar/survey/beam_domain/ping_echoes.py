"""The echoes of one ping for the beam domain: scatterers of the scene, and all that has echoes of its own.

    ground     scatterers with their legs and energies, and what hides them             `ground`
    receive    where the moving array is when they are back                             `reception`
    weigh      patterns of transmit array, elements and rows                            `patterns`
    others     point targets, smooth surfaces, ghosts, the water                        `echoes.ensonification`

The first three are one kernel, for all scatterers of a ping.

Echoes of a ping in the beam domain: where they lie on the grid of time and sine, how strong, and whose they are.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, compressed, held, upload
from mitsonar.device.chance import ping_key
from mitsonar.echoes.record import Echoes
from mitsonar.echoes.scatterers.element_beams import ElementBeams
from mitsonar.echoes.scatterers.thinned_scatterers import Density, TransmitLobe
from mitsonar.signal.beam_grid.residual_doppler import residual_doppler

from ..motion.reception import Arrival, Reception
from ..pressure.array_survey import ArraySurvey
from .ground import FREE, HIDDEN_BY_OBJECT, Ground
from .line import LineArray
from .lobe_rays import LobeRays
from .patterns import Patterns


@dataclass(frozen=True, kw_only=True, eq=False)
class GridEchoes:
    """Some echoes, on the device."""

    column: mi.Float  # (R,): samples after the record's start, the delay that Doppler makes of a sweep included
    sine: mi.Float  # (R,)
    real: mi.Float  # (R,): complex amplitude for a source level of 0 dB, the carrier's phase included
    imaginary: mi.Float  # (R,): complex amplitude for a source level of 0 dB, the carrier's phase included
    energy: mi.Float  # (R,): mean square of the amplitude over chance, as if the way were free
    state: mi.UInt32  # (R,): what hides it
    label: mi.UInt32  # (R,): number of the instance
    launch_sine: mi.Float  # (R,): of the way out, below the horizon
    x: mi.Float  # (R,) [m]: place, scene coordinates
    y: mi.Float  # (R,) [m]: place, scene coordinates
    depth: mi.Float  # (R,) [m]: place, scene coordinates


@dataclass(frozen=True, kw_only=True, eq=False)
class TargetEchoes:
    """Echoes with a phase of their own, of one instance or several."""

    echoes: GridEchoes
    label: np.ndarray  # (R,): numbers of the instances


WATER = 0.4                        # points of the water for every scatterer that a cell of the ground has
NEGLIGIBLE = 1e-8                  # two-way intensity of the beams below which a patch is not looked at
DOPPLER_NODES = 33                 # of sines, between which the rows' factors are linear
SINK = 0.15                        # sine below the horizon that the rows' factors are made for


class PingEchoes:
    """Make the echoes of a survey's pings."""
    # lobe (3,)

    def __init__(self, survey: ArraySurvey, line: LineArray, *, per_cell: float, beams_from_origin: bool = True,
                 beside: PingEchoes | None = None, lobe: tuple[np.ndarray, float] | None = None):
        self._long = lobe
        self.survey, self.line, self.per_cell = survey, line, float(per_cell)
        self._from_origin = beams_from_origin
        self.lib, self.patterns = arrays_of(mi.Float), Patterns(survey, line)
        self.ground = Ground(survey, None if beside is None else beside.ground)
        turned = float(np.linalg.norm(survey.voyage.turn_rate, axis=1).max()) * survey.time[-1]
        self._beams = ElementBeams(survey.transmit, survey.receive, survey.wavelength, turned) or None
        self._residual = residual_doppler(survey.pulse)
        self._reception: tuple[int, Reception] | None = None

    def reception(self, ping: int) -> Reception:
        """Return how the echoes of a ping are received; the last answer is kept."""
        if self._reception is None or self._reception[0] != ping:
            self._reception = ping, Reception(self.survey, ping, axis=self.line.axis, normal=self.line.normal,
                                              receive_centre=self.line.centre,
                                              transmit_centre=self.patterns.transmit_centre,
                                              beams_from_origin=self._from_origin)
        return self._reception[1]

    def doppler(self, ping: int) -> np.ndarray | None:
        """Return the Doppler factors of the grid's rows, at sines evenly from -1 to 1; None where nothing moves."""
        reception = self.reception(ping)
        if reception.still:
            return None
        return reception.doppler_of_sines(np.linspace(-1, 1, DOPPLER_NODES), SINK)

    def of_scatterers(self, ping: int) -> GridEchoes | None:
        """Return the echoes of a ping's scatterers; None where there is none."""
        reception, density = self.reception(ping), self._density(ping)
        lit = self.ground.lit(density, self._useful(ping))
        if lit is None:
            return None
        legs = lit.legs
        bent = self._bent(ping, lit.scatterers.offset)
        arrival = reception.receive(sent=legs.launch_direction, out_distance=legs.distance, out_time=legs.travel_time,
                                    towards=legs.launch_direction, back_distance=legs.distance,
                                    back_time=legs.travel_time, out_bent=bent, back_bent=bent)
        factor = self.patterns.factor(arrival.sent, arrival.towards, reception.rotation, reception.steering)
        return self._on_grid(arrival, _RowDoppler(self.doppler(ping)), lit.energy, lit.scatterers.amplitude, factor,
                             state=lit.state, label=lit.scatterers.label, launch=legs.launch_direction,
                             offset=lit.scatterers.offset, origin=density.origin)

    def hiding(self, ping: int, echoes: GridEchoes | None) -> tuple[mi.UInt32, mi.UInt32]:
        """Return which scatterers objects hide, by their numbers, and the numbers of the objects: UInt32 (H,)."""
        if echoes is None:
            return mi.UInt32(), mi.UInt32()
        index = compressed(echoes.state == HIDDEN_BY_OBJECT)
        if not dr.width(index):
            return index, mi.UInt32()
        origin = self.survey.track.position[ping]
        return index, self.ground.hiding(origin, index, (echoes.x, echoes.y), echoes.launch_sine)

    def _density(self, ping: int) -> Density:
        """How densely a ping needs scatterers."""
        survey, reception = self.survey, self.reception(ping)
        return Density(origin=survey.track.position[ping], axis=reception.rotation @ self.line.axis,
                       per_cell=self.per_cell, range_cell=survey.sound_speed(ping) / (2 * survey.pulse.bandwidth),
                       sine_cell=survey.wavelength / self.line.length, nearest=self.ground.nearest,
                       farthest=self.ground.farthest, lobes=self._lobes(reception))

    def _lobes(self, reception: Reception) -> tuple[TransmitLobe, ...]:
        """Return the lobes of lines or long elements across the line; none where they look widely."""
        steered = self._steered_lobe(reception)
        if steered is not None:
            return (steered,)
        if self._long is None:
            return ()
        axis, cell = self._long
        centres = [self.patterns.transmit_centre, self.line.centre]
        # side by side they look the same way
        together = np.allclose(*centres, atol=1e-9)
        return tuple(TransmitLobe(axis=reception.rotation @ axis, sine=0.0, cell=cell,
                                  place=reception.rotation @ centre) for centre in centres[together:])

    def _steered_lobe(self, reception: Reception) -> TransmitLobe | None:
        """Where a transmitting line that is steered ping by ping sends to."""
        axis = self.patterns.transmit_axis
        if axis is None or reception.steering is None:
            return None
        return TransmitLobe(axis=reception.rotation @ axis, sine=float(reception.steering @ axis),
                            cell=self.survey.wavelength / self.patterns.transmit_length,
                            place=reception.rotation @ self.patterns.transmit_centre)

    def _useful(self, ping: int) -> Callable[[mi.Vector3f, mi.Float], mi.Bool]:
        """Return whether directions are looked into: not those that the beams make negligible."""
        beams, rotation = self._beams, self.reception(ping).rotation

        def useful(direction: mi.Vector3f, distance: mi.Float) -> mi.Bool:
            return mi.Bool(True) if beams is None else beams.bound(direction, distance, rotation) > NEGLIGIBLE

        return useful

    def _bent(self, ping: int, offset: dr.ArrayBase) -> tuple[mi.Float, mi.Float] | None:
        """Curvatures of the waves from points, where beams look from an array off the body's origin."""
        if self._from_origin or not self.reception(ping).off_the_origin:
            return None
        level = mi.Float(dr.sqrt(dr.fma(offset.x, offset.x, offset.y * offset.y)))
        return self.ground.table(ping).curvatures(level, mi.Float(offset.z))

    # ---- what the element chain makes: targets, smooth surfaces, ghosts, water

    def of_targets(self, ping: int) -> Iterator[TargetEchoes]:
        """Yield the echoes of a ping that owe no phase to chance."""
        reception, rows = self.reception(ping), _RowDoppler(self.doppler(ping))
        origin = self.survey.track.position[ping]
        for label, echoes in self.ground.ensonification.coherent_echoes(origin):
            placed = self._of_echoes(echoes, reception, rows, origin)
            yield TargetEchoes(echoes=placed, label=np.broadcast_to(label.numpy(), dr.width(placed.sine)))

    def mirrored(self, ping: int) -> Iterator[GridEchoes]:
        """Yield the echoes of scatterers by way of a flat surface that mirrors."""
        reception, rows = self.reception(ping), _RowDoppler(self.doppler(ping))
        density = self._density(ping)
        for cells in self.ground.mirrored(density, self._useful(ping)):
            for echoes in self.ground.ensonification.mirrored_echoes(density.origin, cells):
                yield self._of_echoes(echoes, reception, rows, density.origin)

    def by_chance(self, ping: int, seed: int) -> Iterator[GridEchoes]:
        """Yield the echoes of more bounces and of the water."""
        reception, rows = self.reception(ping), _RowDoppler(self.doppler(ping))
        origin, below = self.survey.track.position[ping], float(self.survey.depth_below[ping])
        key, lobe, drawn = ping_key(seed, ping), self._steered_lobe(reception), None
        if lobe is not None:
            drawn = partial(self._lobe_rays.draw, reception.rotation, lobe.sine, key)
        for echoes in self.ground.ensonification.random_echoes(origin, reception.rotation, below, key, drawn):
            yield self._of_echoes(echoes, reception, rows, origin)

    @cached_property
    def _lobe_rays(self) -> LobeRays:
        """Directions of points of the water: some in every resolution cell."""
        survey, transmit, axis = self.survey, self.survey.transmit, self.patterns.transmit_axis
        if axis is None:
            raise ValueError("the lobe of a transmitting line was asked for, and it is no line")
        density = self._density(0)
        cells = (self.ground.farthest - self.ground.nearest) / (density.range_cell * density.sine_cell)
        place = (transmit.position - self.patterns.transmit_centre) @ axis / survey.wavelength
        pattern = self.ground.ensonification.pattern or (lambda towards, rotation: np.ones(towards.shape[:-1]))
        return LobeRays(axis, transmit.faces()[0].normal, place=place, weight=transmit.weight, pattern=pattern,
                        around=WATER * self.per_cell * cells)

    def _of_echoes(self, echoes: Echoes, reception: Reception, rows: _RowDoppler, origin: np.ndarray) -> GridEchoes:
        """Put echoes along exact legs on the grid."""
        out, back = echoes.out, echoes.back
        arrival = reception.receive(
            sent=mi.Vector3f(out.sent_towards), out_distance=mi.Float(dr.norm(out.offset)),
            out_time=echoes.arrival, towards=mi.Vector3f(back.sent_towards),
            back_distance=mi.Float(dr.norm(back.offset)), back_time=back.travel_time,
            out_bent=None if out.folded else self._bent(reception.ping, out.offset),
            back_bent=None if back.folded else self._bent(reception.ping, back.offset))
        factor = self.patterns.factor(arrival.sent, arrival.towards, reception.rotation, reception.steering)
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
        if arrival.spread is not None:
            energy = energy / arrival.spread
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
        """Return the factor of echoes over that of their row, minus 1; None where nothing moves."""
        if self._factors is None:
            return None
        last = DOPPLER_NODES - 1
        place = held((arrival.sine + 1) * (0.5 * last), 0.0, last - 1e-3)
        node = mi.UInt32(place)
        low, high = (dr.gather(mi.Float, self._factors, node + step) for step in (0, 1))
        row = low + (high - low) * (place - mi.Float(node))
        return (arrival.doppler - row) / (1 + row)
