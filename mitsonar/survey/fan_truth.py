"""Ground truth of a fan of beams: rays from the array's centre into the bins of its picture.

A fan tells directions apart by the angle ψ = arcsin(d·a) about its axis a, and a line of elements by that alone: every
ray d belongs to the beam whose ψ is the nearest. What beam b shows is what all beams' rays bring,

    shown_b = Σ_b' M_bb' E_b',    M_bb' = mean over beam b' of |Σ_e w_e e^(ik r_e·(û(ψ) - û_b))|²

smeared over range by the compressed pulse, a sinc of the signal's bandwidth. Elements' patterns, the transmit array's,
and of a receive array that is no line its pattern off the fan's plane weigh the rays themselves. Rays leave at the
transmission; d, and the bin, are those of the echo's own reception, by where the array is and looks then (`underway`).
Absorption, the same for all in a bin, is left out.
"""
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from ..device.arrays import arrays_of, upload
from ..device.chance import Salt, ping_key
from ..device.lookups import held
from ..echoes.energy_sums import UNIT_BITS, EchoSums
from ..echoes.sonar_equation import GRAZING, echo_energy, speed_ratio
from ..imaging.energy_record import CoherentRecord, CoherentSums, EnergyRecord
from ..scene.materials import scattering_strength
from ..tracing.aimed_launch import DrawnRays
from .truth import TruthSums
from .underway import Motion, Reception

__all__ = ["FanTruth"]

RAYS_PER_BIN = 12
FEWEST_RAYS, MOST_RAYS, MOST_PASSES = 200_000, 3_000_000, 16        # rays of a pass
MOST_SUMS = 1 << 27                # of beams x shapes x bins: 1 GB
PARTS = 8                          # directions in a beam that its pattern is averaged over
FLAT = 0.1                         # wavelengths that elements of a line may stand off it
BEAM = 1e-4                        # [sr] that units are reckoned by, as `signal.echoes` does by a sonar's beam
SLACK = 0.8, 1.25                  # of the record's ends: bent rays do not come back when straight ones would
REACH = 3                          # samples to either side that the compressed pulse is followed


@dataclass(frozen=True, kw_only=True)
class _Rays:
    row: object
    ping: object
    direction: object


class FanTruth:
    """Say what stands behind the bins of a fan's picture.

    Parameters
    ----------
    survey : array_survey.ArraySurvey
    light : ensonification.Ensonification
    pattern : callable or None
        Two-way intensity of the elements, as of `Ensonification`.
    angle, direction : (B,) [rad], (B, 3)
        Of the beams, body frame, as `imaging.fan.fan_directions` gives them.
    seed : int
    """

    def __init__(self, survey, light, pattern, angle, direction, seed):
        self.survey, self.light, self.pattern, self.seed = survey, light, pattern, int(seed)
        self.lib = arrays_of(mi.Float)
        geometry = survey.geometry
        self.beams, self.bins, self.labels = len(angle), survey.samples - survey.lead, len(survey.labels)
        if self.beams * self.bins * self.labels > MOST_SUMS:
            raise ValueError(f"{self.beams} beams, {self.bins} samples and {self.labels} shapes make more than "
                             f"{MOST_SUMS:.0e} sums of ground truth; take fewer beams, a shorter range, or let shapes "
                             "share an id")
        self.wavelength = survey.sound_speed(0) / survey.frequency
        self.start = survey.time[survey.lead] - 0.5 / survey.sampling_rate
        self.angle = np.asarray(angle, float)
        self.axis, self.normal = _axes(self.angle, np.asarray(direction, float))
        self.mixing = self._mixing()
        share = survey.pulse.bandwidth / survey.sampling_rate
        self.spread = np.sinc(share * np.arange(-REACH, REACH + 1)) ** 2
        self.spread /= self.spread.sum()
        slant_range = 0.5 * survey.sound_speed(0) * (self.start + (np.arange(self.bins) + 0.5) / survey.sampling_rate)
        nearest = 0.25 * survey.sound_speed(0) / survey.sampling_rate
        self.unit = BEAM * 2.0 ** -UNIT_BITS / np.maximum(slant_range, nearest) ** 2
        self.per_bin = upload(mi.Float64, 1 / self.unit)
        self.truth = TruthSums(geometry, labels=self.labels, bins=self.bins, depth_below=survey.depth_below,
                              farthest=slant_range[-1], shown=self._shown)
        wanted = max(RAYS_PER_BIN * self.beams * self.bins, FEWEST_RAYS)
        self.passes = min(-(-wanted // MOST_RAYS), MOST_PASSES)
        window = tuple(end * slack for end, slack in zip(light.window, SLACK))
        self.rays = DrawnRays(survey.profile, window=window, rays=min(wanted, MOST_RAYS), pattern=pattern,
                              surface=geometry.surface_label > 0 and not geometry.surface_mirrors)
        self.surface = dr.opaque(mi.UInt32, geometry.surface_label)

    def __call__(self, ping):
        """Give the truth of a ping.

        Returns
        -------
        EnergyRecord
            Arrays (beam, ..., bin).
        """
        survey, lib, light = self.survey, self.lib, self.light
        origin, rotation = survey.track.position[ping], survey.track.rotation()[ping]
        sources = light.tracer.sources([-origin[2]])
        start = lib.Array3f64(*(dr.opaque(lib.Float64, float(v)) for v in origin))
        travel = survey.travel(ping, np.zeros(3))
        motion = Motion(travel.displacement, travel.turn, travel.duration) if travel.turn.shape[1] else None
        sums, origins = EchoSums(lib, self.beams, self.labels, self.bins), self.truth.sums([ping], self.beams)
        for number in range(self.passes):
            key = ping_key(self.seed, ping, number, Salt.FAN_TRUTH)
            self._pass(sources, start, motion, rotation, float(survey.depth_below[ping]), key, sums, origins)
        energy, coherent = sums.read(self.unit, survey.geometry.depth_range), None
        if light.scatterers.targets or light.smooth:
            power = self._coherent(sources, start, motion, origin, rotation)
            coherent = CoherentSums(label_power=power, record=CoherentRecord(
                intensity=self._shown(power.sum(1)), in_beam=power.any(1).astype(np.uint32)))
        return EnergyRecord(intensity=energy.intensity, depth=energy.depth, rays=energy.rays,
                            rays_in_beam=energy.rays_in_beam, coherent=coherent and coherent.record,
                            truth=self.truth.read(origins, self.unit, energy, coherent))

    def _pass(self, sources, start, motion, rotation, below, key, sums, origins):
        """Add the rays of a pass to the sums."""
        light, source = self.light, mi.UInt32(0)
        direction, solid_angle, _ = self.rays(start, rotation, below, key)
        if self.truth.hides:
            hits, hidden = light.tracer.with_hidden(sources, start, source, direction)
        else:
            hits, hidden = light.tracer(sources, start, source, direction), None
        heard = self._received(motion, direction, hits.point - start, 2 * hits.travel_time)
        row, weight = self._beam(direction, heard.towards, rotation)
        ray = _Rays(row=row, ping=mi.UInt32(0), direction=direction)
        solid_angle *= weight / dr.opaque(mi.Float, self.passes)
        units, bin, inside = self._echo(sources, hits, heard.delay, solid_angle)
        if self.survey.geometry.surface_mirrors:
            inside &= hits.label != self.surface
        sums.add(row=row, label=hits.label, bin=bin, units=units, height=mi.Float(0), in_beam=mi.Bool(True),
                 active=inside)
        self.truth.add(origins, ray, hits, bin=bin, units=units, in_beam=mi.Bool(True), active=inside)
        if hidden is not None:
            late = self._received(motion, direction, hidden.point - start, 2 * hidden.travel_time).delay
            units, bin, inside = self._echo(sources, hidden, late, solid_angle)
            origins.add_hidden(row=row, label=hits.label, bin=bin, units=units, active=inside)
        dr.eval(sums.energy, sums.count, sums.depth, origins.sums())

    def _received(self, motion, towards, offset, delay):
        """How echoes from points `offset` [m] off are heard whose two-way time is `delay` for an array at rest."""
        if motion is None:
            return Reception(delay=delay, towards=towards)
        speed = dr.opaque(mi.Float, self.survey.sound_speed(0))
        return motion.receive(mi.UInt32(0), towards, mi.Float(dr.norm(offset)), delay, speed)

    def _beam(self, direction, heard, rotation):
        """Number of the beam that hears directions, and what the arrays make of those they are sent in."""
        sent, body = (mi.Vector3f(*(dr.dot(_opaque(rotation[:, i]), towards) for i in range(3)))
                      for towards in (direction, heard))
        row, weight = dr.zeros(mi.UInt32, dr.width(direction)), mi.Float(1)
        axis, normal = _opaque(self.axis), _opaque(self.normal)
        u = dr.clip(dr.dot(body, axis), -1, 1)
        if self.beams > 1:
            step = dr.opaque(mi.Float, (self.angle[-1] - self.angle[0]) / (self.beams - 1))
            place = dr.round((dr.asin(u) - dr.opaque(mi.Float, self.angle[0])) / step)
            inside = (place >= 0) & (place <= self.beams - 1)
            row = mi.UInt32(held(place, 0, self.beams - 1))
            weight = dr.select(inside, weight, 0)
        receive = self.survey.receive
        off = receive.position - np.outer(receive.position @ self.axis, self.axis)
        if np.abs(off - off.mean(0)).max() > FLAT * self.wavelength:
            in_plane = dr.sqrt(1 - u * u) * normal + u * axis
            weight *= self._array_factor(receive, body - in_plane, steered=False)
        if np.count_nonzero(self.survey.transmit.weight) > 1:
            weight *= self._array_factor(self.survey.transmit, sent, steered=True)
        if self.pattern is not None:
            weight *= self.pattern(direction, rotation)
        return row, weight

    def _array_factor(self, array, direction, *, steered):
        """|Σ w e^(i(k r·d - 2π f τ))|² towards body directions, 1 at most; τ only where it steers."""
        working = np.flatnonzero(array.weight)
        weight = array.weight[working] / np.abs(array.weight).sum()
        late = self.survey.frequency * array.delay[working] * steered
        table = np.concatenate([array.position[working] / self.wavelength, late[:, None]], 1)
        return _pattern(upload(mi.Float, table.astype(np.float32)), upload(mi.Float, weight.astype(np.float32)),
                        dr.opaque(mi.UInt32, len(working)), direction)

    def _echo(self, sources, hits, delay, solid_angle):
        """Echo of each ray in units of its bin, the bin, and whether it lies in the record."""
        bin, inside = self._bin(delay, hits.valid & (solid_angle > 0))
        strength, sin_grazing = scattering_strength(hits, inside, self.survey.frequency)
        inside &= sin_grazing > GRAZING
        _, source_speed, _ = sources.state.gather(self.lib, mi.UInt32(0))
        energy = echo_energy(solid_angle=solid_angle, strength=strength, sin_grazing=sin_grazing,
                             spreading_area=hits.spreading_area,
                             speed_ratio=speed_ratio(hits.sound_speed, source_speed))
        units = mi.Float64(energy) * dr.gather(mi.Float64, self.per_bin, bin, inside)
        return units, bin, inside & dr.isfinite(energy)

    def _bin(self, delay, valid):
        place = (delay - dr.opaque(mi.Float64, self.start)) * dr.opaque(mi.Float64, self.survey.sampling_rate)
        inside = valid & (place >= 0) & (place < dr.opaque(mi.Float64, self.bins))
        return mi.UInt32(dr.select(inside, place, 0)), inside

    def _coherent(self, sources, start, motion, origin, rotation):
        """Squared sums of what has a phase, by beam, instance and bin."""
        shape = self.beams, self.labels, self.bins
        total = np.zeros(shape, complex)
        for label, echoes in self._with_phase(sources, start, origin):
            delay = echoes.out.travel_time + echoes.between + echoes.back.travel_time
            heard = self._received(motion, echoes.back.sent_towards, echoes.back.offset, delay)
            row, weight = self._beam(echoes.out.sent_towards, heard.towards, rotation)
            delay = heard.delay
            bin, inside = self._bin(delay, weight > 0)
            phase = mi.Float(delay * self.survey.frequency - dr.floor(delay * self.survey.frequency)) * (2 * np.pi)
            columns = row, label, bin, inside, dr.sqrt(weight), phase, *echoes.amplitude
            dr.eval(columns)
            row, label, bin, inside, root, phase, real, imaginary = (
                np.broadcast_to(column.numpy(), dr.width(inside)) for column in columns)
            place = ((row.astype(np.int64) * self.labels + label - 1) * self.bins + bin)[inside]
            z = ((real + 1j * imaginary) * root * np.exp(-1j * phase))[inside]
            # what comes in several blocks is one echo: it is squared when it is whole
            total.real += np.bincount(place, z.real, total.size).reshape(shape)
            total.imag += np.bincount(place, z.imag, total.size).reshape(shape)
        return total.real ** 2 + total.imag ** 2

    def _with_phase(self, sources, start, origin):
        for label, echoes in self.light.points(sources, start):
            yield upload(mi.UInt32, label), echoes
        for _, label, echoes in self.light.smooth(sources, np.array([origin], float), np.zeros(1, np.uint32)):
            yield label, echoes

    def _mixing(self):
        """M, (B, B)."""
        if self.beams == 1:
            return np.ones((1, 1))
        receive, half = self.survey.receive, 0.5 * (self.angle[-1] - self.angle[0]) / (self.beams - 1)
        fine = (self.angle[:, None] + half * ((np.arange(PARTS) + 0.5) / PARTS * 2 - 1)).ravel()
        towards = np.cos(fine)[:, None] * self.normal + np.sin(fine)[:, None] * self.axis
        k = 2 * np.pi / self.wavelength
        heard = np.exp(1j * k * towards @ receive.position.T)
        steered = np.cos(self.angle)[:, None] * self.normal + np.sin(self.angle)[:, None] * self.axis
        wanted = np.exp(1j * k * steered @ receive.position.T)
        weight = receive.weight / np.abs(receive.weight).sum()
        response = np.abs((wanted.conj() * weight) @ heard.T) ** 2
        return response.reshape(self.beams, self.beams, PARTS).mean(2)

    def _shown(self, intensity):
        """What the picture makes of intensities (B, ..., bins)."""
        mixed = np.tensordot(self.mixing, intensity, 1)
        padded = np.pad(mixed, [(0, 0)] * (mixed.ndim - 1) + [(REACH, REACH)])
        return sum(w * padded[..., k:k + self.bins] for k, w in enumerate(self.spread))


def _opaque(vector):
    return mi.Vector3f(*(dr.opaque(mi.Float, float(component)) for component in vector))


def _axes(angle, direction):
    """Axis and normal of a fan, unit vectors: û = n cos ψ + a sin ψ. A single beam needs no axis, which is 0."""
    if len(angle) == 1:
        return np.zeros(3), direction[0]
    normal, axis = np.linalg.lstsq(np.stack([np.cos(angle), np.sin(angle)], 1), direction, rcond=None)[0]
    return axis / np.linalg.norm(axis), normal / np.linalg.norm(normal)


@dr.syntax
def _pattern(table, weight, count, direction):
    """|Σ w e^(i2π(x·d - t))|² of `count` rows (x, t) of a table, in wavelengths and cycles."""
    real, imaginary = mi.Float(0), mi.Float(0)
    i = mi.UInt32(0)
    while i < count:
        x, y = dr.gather(mi.Float, table, 4 * i), dr.gather(mi.Float, table, 4 * i + 1)
        z, t = dr.gather(mi.Float, table, 4 * i + 2), dr.gather(mi.Float, table, 4 * i + 3)
        w = dr.gather(mi.Float, weight, i)
        turns = x * direction.x + y * direction.y + z * direction.z - t
        sine, cosine = dr.sincos((turns - dr.round(turns)) * float(2 * np.pi))
        real, imaginary = real + w * cosine, imaginary + w * sine
        i += 1
    return real * real + imaginary * imaginary
