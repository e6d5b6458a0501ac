"""Echoes of a ping in the beam domain: places on the grid of time and sine, amplitudes and labels.

    ground     scatterers with their legs and energies, and what hides them             `ground`
    ensonify   point targets, smooth surfaces, ghosts, the water                        `echoes.ensonification`
    receive    times and directions at the moving array                                 `motion.reception`
    weigh      patterns of transmit array, elements and rows                            `patterns`

Ground, reception and patterns are one kernel for all scatterers of a ping. `PlacedEchoes` depend on the place alone: a
sonar that only turns can keep them from ping to ping.
"""
from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, compressed, held, upload
from mitsonar.device.chance import Salt, ping_key, salted
from mitsonar.echoes.scatterers.element_beams import ElementBeams
from mitsonar.echoes.scatterers.thinned_scatterers import Density, TransmitLobe, Useful
from mitsonar.signal.doppler import Glide, ResidualDoppler, doppler_classes, residual_doppler
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.faces.directivity import sinc

from ..energy.face_beams import BEAM_EDGE
from ..motion.reception import EndArrival, Reception
from ..pressure.array_survey import ArraySurvey, Steering
from ..pressure.ensonified_ping import WATER
from ..pressure.signals import lattice
from .ground import FREE, HIDDEN_BY_OBJECT, Ground
from .line import LineArray
from .lobe_rays import LobeRays
from .patterns import Patterns
from .placed_echoes import PlacedEchoes
from .water import WaterPoints


@dataclass(frozen=True, kw_only=True, eq=False)
class GridEchoes:
    """Echoes on the grid of time and sine, on the device."""

    column: mi.Float  # (R,) [samples] after the record's start, with the Doppler delay of a sweep
    sine: mi.Float  # (R,), along the line
    real: mi.Float  # (R,), complex amplitude for a source level of 0 dB, with the phase of the carrier
    imaginary: mi.Float  # (R,), complex amplitude for a source level of 0 dB, with the phase of the carrier
    energy: mi.Float  # (R,), expected square of the amplitude, without shadows
    state: mi.UInt32  # (R,), FREE, HIDDEN_BY_BED or HIDDEN_BY_OBJECT
    label: mi.UInt32  # (R,), number of the instance
    launch_sine: mi.Float  # (R,), of the way out, positive below the horizon
    x: mi.Float  # (R,) [m], east of the sonar
    y: mi.Float  # (R,) [m], north of the sonar
    depth: mi.Float  # (R,) [m], below the surface
    sheet: mi.UInt32 | None = None  # (R,), number of the Doppler class at a single element; None at a line
    parts: PartEchoes | None = None  # the same echoes at parts of the element


@dataclass(frozen=True, kw_only=True, eq=False)
class PartEchoes:
    """Echoes at the parts of an element, which have one pattern, as of their common centre."""

    real: mi.Float  # (R,), as of `GridEchoes`
    imaginary: mi.Float  # (R,), as of `GridEchoes`
    towards: mi.Vector3f  # (R,), where an echo comes from, as of `EndArrival`, times its slant


@dataclass(frozen=True, kw_only=True, eq=False)
class TargetEchoes:
    """Echoes with a phase of their own, of one or several instances."""

    echoes: GridEchoes
    label: np.ndarray  # (R,), numbers of the instances


NEGLIGIBLE = 1e-8                  # two-way intensity of the beams below which a patch is skipped
WIDE = 0.1                         # sines in a lobe that lights the whole picture: what lies outside is no side lobe's
DOPPLER_NODES = 33                 # of sines, between which the rows' factors are linear
SINK = 0.15                        # sine below the horizon that the rows' factors are made for
CLASS_ERROR = 0.005                # [cycles] at the ends of an echo of a Doppler class, at a single element
LOBES = 1e-3                       # two-way intensity of directions that Doppler classes are made for


class PingEchoes:
    """Echoes of a survey's pings."""
    # lobe: axis (3,), cell [-] and finer of a lobe across the line
    # turning: axes (3,) by ping, and cell [-], of a turning head
    # parts: of the only receiving element, around its centre

    def __init__(self, survey: ArraySurvey, line: LineArray, *, per_cell: float, beams_from_origin: bool = True,
                 beside: PingEchoes | None = None, lobe: tuple[np.ndarray, float, float] | None = None,
                 parts: Array | None = None, turning: tuple[Steering, float] | None = None,
                 negligible: float = NEGLIGIBLE):
        self._long, self._turning, self._negligible = lobe, turning, negligible
        self.survey, self.line, self.per_cell = survey, line, float(per_cell)
        self._from_origin = beams_from_origin
        self.lib, self.patterns = arrays_of(mi.Float), Patterns(survey, line)
        self._parts = None if parts is None else Patterns(replace(survey, receive=parts), line)
        self.ground = Ground(survey, None if beside is None else beside.ground)
        points = self.ground.ensonification.ghosts.water
        self._water = None if points is None else WaterPoints(self.ground, points)
        self._beams = ElementBeams(survey.transmit, survey.receive, survey.wavelength) or None
        residual = residual_doppler(survey.pulse)
        self._residual, self._glide = _on_device(residual), residual.glide
        self._reception: tuple[int, Reception] | None = None
        self._doppler: tuple[int, _RowDoppler | _DopplerSheets] | None = None

    def reception(self, ping: int) -> Reception:
        """Return the reception of a ping; the last reception is kept."""
        if self._reception is None or self._reception[0] != ping:
            self._reception = ping, Reception(self.survey, ping, axis=self.line.axis, normal=self.line.normal,
                                              receive_centre=self.line.centre,
                                              transmit_centre=self.patterns.transmit_centre,
                                              beams_from_origin=self._from_origin)
        return self._reception[1]

    def doppler(self, ping: int) -> np.ndarray | None:
        """Return the Doppler factors of grid rows at even sines from -1 to 1; None if the platform stands still."""
        reception = self.reception(ping)
        if reception.still:
            return None
        return reception.doppler_of_sines(np.linspace(-1, 1, DOPPLER_NODES), SINK)

    def doppler_classes(self, ping: int) -> np.ndarray:
        """Return the Doppler factors (K,) that stand for all echoes of a ping at a single element."""
        reception, moving = self.reception(ping), self.survey.world.fastest(ping)
        if reception.still and not moving:
            return np.ones(1)
        factors = reception.doppler_towards(self._lobes_towards @ reception.rotation.T)
        spare = 2 * moving / reception.speed
        return doppler_classes(self.survey.pulse, factors.min() - spare, factors.max() + spare, CLASS_ERROR,
                               self._glide)

    @cached_property
    def _lobes_towards(self) -> np.ndarray:
        """Return directions (K, 3) all over the beam of a single element, body frame."""
        towards = lattice()
        if self._beams is None:
            return towards
        lit = self._beams.intensity(towards, np.eye(3))
        return towards[lit > LOBES * lit.max()]

    def of_scatterers(self, ping: int) -> GridEchoes | None:
        """Return the echoes of a ping's scatterers; None if there are none."""
        placed = self.scatterers(ping)
        return None if placed is None else self.received(ping, placed)

    def scatterers(self, ping: int, everywhere: bool = False) -> PlacedEchoes | None:
        """Return the scatterers around the place of a ping, in its beams or everywhere; None if there are none."""
        useful = _all_of_them if everywhere else self.useful(ping, self._negligible)
        lit = self.ground.lit(self._density(ping), useful)
        if lit is None:
            return None
        legs, (real, imaginary) = lit.legs, lit.scatterers.amplitude
        shift, out_time = None, legs.travel_time
        if (motion := self.ground.ensonification.motion) is not None:
            moved, arrival = lit.scatterers.motion, legs.arrival_direction
            shift = motion.shift(moved, lit.scatterers.point, arrival, arrival,
                                 dr.opaque(mi.Float, self.ground.table(ping).sound_speed))
            out_time = out_time + motion.later(moved, shift, legs.travel_time)
        return PlacedEchoes(sent=legs.launch_direction, towards=legs.launch_direction, out_distance=legs.distance,
                            back_distance=legs.distance, out_time=out_time, shift=shift, back_time=legs.travel_time,
                            out_offset=lit.offset, back_offset=lit.offset, energy=lit.energy,
                            real=real, imaginary=imaginary, state=lit.state, label=lit.scatterers.label)

    def hiding(self, ping: int, echoes: GridEchoes | None) -> tuple[mi.UInt32, mi.UInt32]:
        """Return the numbers of the scatterers that objects hide, and the numbers of these objects: UInt32 (H,)."""
        if echoes is None:
            return mi.UInt32(), mi.UInt32()
        index = compressed(echoes.state == HIDDEN_BY_OBJECT)
        if not dr.width(index):
            return index, mi.UInt32()
        origin = self.survey.track.position[ping]
        return index, self.ground.hiding(origin, index, (echoes.x, echoes.y), echoes.launch_sine)

    def _density(self, ping: int) -> Density:
        """Return the density of scatterers for a ping."""
        survey, reception, latest = self.survey, self.reception(ping), self.survey.passage.latest
        if self._turning is None:
            axis, cell = reception.rotation @ self.line.axis, survey.wavelength / self.line.length
        else:
            axis, cell = self._turning[0][ping], self._turning[1]
        return Density(origin=survey.track.position[ping], axis=axis, per_cell=self.per_cell,
                       range_cell=survey.sound_speed(ping) / (2 * survey.pulse.bandwidth), sine_cell=cell,
                       nearest=self.ground.nearest, farthest=self.ground.farthest, lobes=self._lobes(reception),
                       around=self._turning is not None, planned=latest is None or latest.row is not None)

    def _lobes(self, reception: Reception) -> tuple[TransmitLobe, ...]:
        """Return the narrow lobes of transmitting lines or long elements; empty if there are none."""
        steered = self._steered_lobe(reception)
        if steered is not None:
            return (steered,)
        if self._long is None:
            return ()
        axis, cell, finer = self._long
        centres = [self.patterns.transmit_centre, self.line.centre]
        # arrays at one place have the same lobe
        together = np.allclose(*centres, atol=1e-9)
        return tuple(TransmitLobe(axis=reception.rotation @ axis, sine=0.0, cell=cell, finer=finer,
                                  place=reception.rotation @ centre) for centre in centres[together:])

    def _steered_lobe(self, reception: Reception) -> TransmitLobe | None:
        """Return the lobe of a transmitting line that is steered ping by ping; None if there is none."""
        axis = self.patterns.transmit_axis
        if axis is None or reception.steering is None:
            return None
        return TransmitLobe(axis=reception.rotation @ axis, sine=float(reception.steering @ axis), finer=1.0,
                            cell=self.survey.wavelength / self.patterns.transmit_length,
                            place=reception.rotation @ self.patterns.transmit_centre)

    def in_main_lobe(self, ping: int, echoes: GridEchoes | None) -> mi.Bool | None:
        """Return True for echoes of the main lobes of long lines, down to -6 dB two-way; None without such lines."""
        lobes = [lobe for lobe in self._lobes(self.reception(ping)) if lobe.cell < WIDE]
        if echoes is None or not lobes:
            return None
        height, power = float(self.survey.track.position[ping, 2]), mi.Float(1)
        for lobe in lobes:
            along, square = mi.Float(0), mi.Float(0)
            for part, start, axis in zip((echoes.x, echoes.y, -echoes.depth - dr.opaque(mi.Float, height)),
                                         lobe.place, lobe.axis):
                offset = part - dr.opaque(mi.Float, float(start))
                along, square = along + offset * dr.opaque(mi.Float, float(axis)), square + dr.square(offset)
            cells = (along * dr.rsqrt(square) - dr.opaque(mi.Float, lobe.sine)) * dr.opaque(mi.Float, 1 / lobe.cell)
            power *= dr.select(dr.abs(cells) < 1, dr.square(sinc(cells)), 0)
        both_ways = self._long is not None and len(lobes) == 1         # arrays at one place have the same lobe
        return (dr.square(power) if both_ways else power) > BEAM_EDGE

    def useful(self, ping: int, least: float = NEGLIGIBLE) -> Useful:
        """Return a test of scene directions at distances: True if the two-way intensity exceeds `least`."""
        beams, rotation = self._beams, self.reception(ping).rotation
        if beams is not None:
            beams = beams.turning(self.survey.turn_rate * self.survey.time[-1])

        def useful(direction: mi.Vector3f, distance: mi.Float, wider: mi.Float | float = 0.0) -> mi.Bool:
            return mi.Bool(True) if beams is None else beams.bound(direction, distance, rotation, wider) > least

        return useful

    def _bent(self, ping: int, offset: dr.ArrayBase) -> tuple[mi.Float, mi.Float] | None:
        """Return the curvatures of waves from points; None unless beams look from an array off the body's origin."""
        if self._from_origin or not self.reception(ping).off_the_origin:
            return None
        level = mi.Float(dr.sqrt(dr.fma(offset.x, offset.x, offset.y * offset.y)))
        return self.ground.table(ping).curvatures(level, mi.Float(offset.z))

    # ---- targets, smooth surfaces, ghosts and water, from `echoes.ensonification`

    def of_targets(self, ping: int) -> Iterator[TargetEchoes]:
        """Yield the echoes of a ping whose phases are not random."""
        for label, some in self.targets(ping):
            placed = self.received(ping, some)
            yield TargetEchoes(echoes=placed, label=np.broadcast_to(label.numpy(), dr.width(placed.sine)))

    def targets(self, ping: int) -> Iterator[tuple[mi.UInt32, PlacedEchoes]]:
        """Yield the numbers of instances, and their echoes whose phases are not random, around the place of a ping."""
        for label, echoes in self.ground.ensonification.coherent_echoes(self.survey.track.position[ping]):
            yield label, PlacedEchoes.of(echoes)

    def mirrored(self, ping: int, everywhere: bool = False) -> Iterator[PlacedEchoes]:
        """Yield the echoes of scatterers by way of a flat mirroring surface; see `scatterers`."""
        density = self._density(ping)
        for cells in self.ground.mirrored(density, _all_of_them if everywhere else self.useful(ping)):
            for echoes in self.ground.ensonification.mirrored_echoes(density.origin, cells):
                yield PlacedEchoes.of(echoes)

    def by_chance(self, ping: int, seed: int) -> Iterator[PlacedEchoes]:
        """Yield the random echoes: those of the water and of more bounces."""
        reception, ensonification = self.reception(ping), self.ground.ensonification
        origin, below = self.survey.track.position[ping], float(self.survey.depth_below[ping])
        key, lobe = ping_key(seed, ping), self._steered_lobe(reception)
        for echoes in ensonification.bounced_echoes(origin, reception.rotation, below, key):
            yield PlacedEchoes.of(echoes)
        if self._water is None:
            return
        rays = (ensonification.water_rays(origin, reception.rotation, below, key) if lobe is None else
                self._lobe_rays.draw(reception.rotation, lobe.sine, salted(key, Salt.ARRAY_WATER)))
        placed = self._water.around(origin, *rays, key)
        if placed is not None:
            yield placed

    @cached_property
    def _lobe_rays(self) -> LobeRays:
        """Return random directions of points of the water, about one in every resolution cell."""
        survey, transmit, axis = self.survey, self.survey.transmit, self.patterns.transmit_axis
        if axis is None:
            raise ValueError("the lobe of a transmitting line was asked for, and it is no line")
        density = self._density(0)
        cells = (self.ground.farthest - self.ground.nearest) / (density.range_cell * density.sine_cell)
        place = (transmit.position - self.patterns.transmit_centre) @ axis / survey.wavelength
        pattern = self.ground.ensonification.pattern or (lambda towards, rotation: np.ones(towards.shape[:-1]))
        return LobeRays(axis, transmit.faces()[0].normal, place=place, weight=transmit.weight, pattern=pattern,
                        line=self.line.axis, per_sine=WATER * self.per_cell * cells)

    # ---- the grid

    def received(self, ping: int, placed: PlacedEchoes) -> GridEchoes:
        """Return echoes on the grid of a ping, with its reception, its beams, and the Doppler delay of a sweep."""
        reception, (out_folded, back_folded) = self.reception(ping), placed.folded
        out_bent = None if out_folded else self._bent(ping, placed.out_offset)
        back_bent = out_bent
        if placed.back_offset is not placed.out_offset or out_folded:
            back_bent = None if back_folded else self._bent(ping, placed.back_offset)
        arrival = reception.receive(sent=placed.sent, out_distance=placed.out_distance, out_time=placed.out_time,
                                    towards=placed.towards, back_distance=placed.back_distance,
                                    back_time=placed.back_time, out_bent=out_bent, back_bent=back_bent)
        direction = arrival.sent, arrival.towards, reception.rotation, reception.steering
        return self._on_grid(arrival, placed, self._doppler_of(ping), self.patterns.factor(*direction),
                             self._parts and self._parts.factor(*direction), self.survey.track.position[ping])

    def _doppler_of(self, ping: int) -> _RowDoppler | _DopplerSheets:
        """Return the Doppler factors that echoes of a ping may have; those of the last ping are kept."""
        if self._doppler is None or self._doppler[0] != ping:
            self._doppler = ping, (_RowDoppler(self.doppler(ping)) if self.line.resolves else
                                   _DopplerSheets(self.doppler_classes(ping)))
        return self._doppler[1]

    def _on_grid(self, arrival: EndArrival, placed: PlacedEchoes, doppler: _RowDoppler | _DopplerSheets,
                 factor: Factor, parts_factor: Factor | None, origin: np.ndarray) -> GridEchoes:
        """Return echoes with the carrier's phase, times the factors of the receive array and of its parts."""
        survey, pulse = self.survey, self.survey.pulse
        frequency, rate, start = (dr.opaque(mi.Float64, v) for v in (pulse.frequency, survey.sampling_rate,
                                                                    survey.start))
        delay = arrival.delay + dr.opaque(mi.Float64, self.patterns.drive_delay)
        later, turned, shift = mi.Float(0), mi.Float(0), arrival.doppler
        if placed.shift is not None:
            shift = shift + placed.shift * (1 + shift)
        sheet, row = doppler.at(arrival.sine, shift)
        if placed.shift is not None and row is None:
            row = mi.Float(0)
        if row is not None:
            later, turned = self._residual.shift(shift, row)
        cycles = delay * frequency
        sine, cosine = dr.sincos((mi.Float(cycles - dr.round(cycles)) - turned) * float(2 * np.pi))
        real, imaginary = factor
        energy = placed.energy if arrival.spread is None else placed.energy / arrival.spread
        gain = dr.square(real) if imaginary is None else dr.square(real) + dr.square(imaginary)
        root = dr.select(placed.state == FREE, dr.sqrt(energy), 0)
        a, b = placed.real, placed.imaginary
        carried = root * (a * cosine + b * sine), root * (b * cosine - a * sine)
        a, b = _times(carried, factor)
        column, offset, parts = mi.Float((delay + mi.Float64(later) - start) * rate), placed.out_offset, None
        if parts_factor is not None:
            of_parts = _times(carried, parts_factor)
            parts = PartEchoes(real=of_parts[0], imaginary=of_parts[1], towards=arrival.towards * arrival.slant)
        echoes = GridEchoes(column=column, sine=arrival.sine, real=a, imaginary=b, energy=energy * gain,
                            state=placed.state, label=placed.label, launch_sine=-placed.sent.z, x=mi.Float(offset.x),
                            y=mi.Float(offset.y), depth=dr.opaque(mi.Float, -float(origin[2])) - mi.Float(offset.z),
                            sheet=sheet, parts=parts)
        dr.eval(*vars(echoes).values())
        return echoes


Factor = tuple["mi.Float", "mi.Float | None"]


def _times(amplitude: tuple[mi.Float, mi.Float], factor: Factor) -> tuple[mi.Float, mi.Float]:
    """Return an amplitude times a factor whose imaginary part is None where it is 0."""
    (a, b), (real, imaginary) = amplitude, factor
    if imaginary is None:
        return a * real, b * real
    return a * real - b * imaginary, a * imaginary + b * real


def _all_of_them(direction: mi.Vector3f, distance: mi.Float, wider: mi.Float | float = 0.0) -> mi.Bool:
    return mi.Bool(True)


class _RowDoppler:
    """Doppler factors of the grid's rows."""

    def __init__(self, factors: np.ndarray | None):
        self._factors = None if factors is None else upload(mi.Float, (factors - 1).astype(np.float32))

    def at(self, sine: mi.Float, shift: mi.Float) -> tuple[None, mi.Float | None]:
        """Return no number, and the factors of rows at sines, minus 1; None if the platform stands still."""
        if self._factors is None:
            return None, None
        last = DOPPLER_NODES - 1
        place = held((sine + 1) * (0.5 * last), 0.0, last - 1e-3)
        node = mi.UInt32(place)
        low, high = (dr.gather(mi.Float, self._factors, node + step) for step in (0, 1))
        return None, low + (high - low) * (place - mi.Float(node))


class _DopplerSheets:
    """Doppler classes of a single element."""

    def __init__(self, factors: np.ndarray):
        width = float(np.ptp(factors)) / max(len(factors) - 1, 1) or 1.0
        self._first, self._width, self._last = (dr.opaque(mi.Float, value)
                                                for value in (factors[0] - 1, width, len(factors) - 1))

    def at(self, sine: mi.Float, shift: mi.Float) -> tuple[mi.UInt32, mi.Float]:
        """Return the numbers of the classes nearest to Doppler factors minus 1, and their factors minus 1."""
        number = held(dr.round((shift - self._first) / self._width), 0.0, self._last)
        return mi.UInt32(number), dr.fma(number, self._width, self._first)


def _on_device(residual: ResidualDoppler) -> ResidualDoppler:
    """Return the residual of opaque numbers, so that another pulse needs no other kernel."""
    def opaque(*parts: float) -> list[Any]:
        return [dr.opaque(mi.Float, float(part)) for part in parts]

    return ResidualDoppler(*opaque(residual.half, residual.carrier),
                           glide=None if residual.glide is None else Glide(*opaque(*residual.glide)))
