"""Echoes of a sidescan that have a phase: smooth surfaces, point targets, and a flat surface, summed before they are
squared.

    z(t) = Σ_i a_i Π((t - τ_i) / T),    a_i = 10^(SL/20) b_t b_r e_i e^(-i2πf₀τ_i)

e_i and τ_i amplitude and delay of an echo (`echoes`, `smooth_targets`, `underway`), b_t and b_r the pressure patterns
of the transmitting face where it left and of the receiving one where it comes back from, as they are turned then, Π the
rectangular pulse of length T, centred on its echo as those of `imaging.sidescan` are. z is sampled some times to a
pulse; what a bin keeps of it is the mean of |z|², and the mean of z over every stretch of the bin in which the bed's
echo is one (a pulse, or the bin where that is shorter): with these the bed's random echo adds to z as pressures do.

Under a surface that mirrors, targets are seen by way of it too (`sights`). Its own echo from straight above comes half
from either side, or as Fresnel's integral has it where the platform rolls: each face hears its own side.
"""
from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.special import fresnel

from ..device.arrays import arrays_of, upload
from ..echoes.record import Echoes
from ..echoes.scatterers import TARGET_RADIUS
from ..echoes.smooth.targets import SmoothTargets
from ..echoes.sonar_equation import pressure_along_legs
from ..imaging.energy_record import CoherentRecord, CoherentSums
from ..imaging.sidescan import pulse_cells
from ..sonar.directivity import sinc

__all__ = ["CoherentEchoes"]

PER_PULSE, PER_BIN = 4, 4          # samples of z, at least,
CYCLES = 2.5                       # of the carrier to a sample at least, but for the shortest pulses
WORK = 1 << 21                     # samples of z at a time
FAINT = 1e-7                       # two-way intensity of the beams' envelope below which facets are not looked at
BEAM_EDGE = 0.25                   # two-way intensity at the edge of the main lobe (-6 dB)


class CoherentEchoes:
    """The coherent echoes of a survey.

    Parameters
    ----------
    survey : survey.Survey
    sights : Sights
    tracer : trace.Tracer
    """

    def __init__(self, survey, sights, tracer):
        self.survey, self.sights = survey, sights
        self.lib = arrays_of(mi.Float)
        sonar, window = survey.sonar, survey.window
        fastest, drift = float(np.max(survey.profile.sound_speed)), survey.underway.drift(sonar.sound_speed)
        self.smooth = SmoothTargets(sights, tracer, frequency=sonar.frequency,
                                    resolution=0.5 * sonar.sound_speed * sonar.pulse_length, reach=0.0, drift=drift,
                                    farthest=0.5 * (window[1] + sonar.pulse_length) * fastest * (1 + 0.5 * drift))
        self.shift = max(float(np.abs(shifts).max()) for shifts in survey.shifts[1])
        self.targets = survey.geometry.targets()
        # where a pulse began at once, each of its edges would find a zone of its own on a bent surface: the k of
        # Kirchhoff's integral is that of the carrier. Samples of some cycles round them off.
        per_pulse = min(PER_BIN * sonar.pulse_length / survey.bin_length, sonar.pulse_length * sonar.frequency / CYCLES)
        per_pulse = max(PER_PULSE, int(per_pulse))
        self.step, self.per_pulse = sonar.pulse_length / per_pulse, per_pulse
        self.start = window[0] - sonar.pulse_length
        self.samples = int(np.ceil((window[1] + sonar.pulse_length - self.start) / self.step)) + 2
        self.faces = [[dr.opaque(mi.Float, side / sonar.wavelength) for side in (face.length, face.height)]
                      for face in (sonar.transmit, sonar.receive)]
        self.depression = [dr.opaque(mi.Float, part(sonar.depression_angle)) for part in (np.cos, np.sin)]
        self.pressure = dr.opaque(mi.Float, 10 ** (sonar.source_level_db / 20))
        self.turns_per_second = dr.opaque(mi.Float64, sonar.frequency)

    def __bool__(self):
        return bool(self.smooth) or bool(self.targets) or self.sights.mirror

    def __call__(self, place, ping, source):
        """Sum the echoes of some pings.

        Parameters
        ----------
        place : place.Place
        ping : (B,) int
        source : (B,) int
            Index of each into the place's sources.

        Returns
        -------
        CoherentSums
            Arrays (2 B, ..., bins).
        """
        survey, rows = self.survey, 2 * len(ping)
        cells, paths = pulse_cells(survey.bin_length, survey.sonar.pulse_length), len(survey.paths)
        record = CoherentRecord(
            pressure=np.zeros((rows, survey.bins, cells), np.complex64), intensity=np.zeros((rows, survey.bins)),
            depth=np.zeros((rows, survey.bins), np.float32), in_beam=np.zeros((rows, survey.bins), np.uint32),
            path_intensity=np.zeros((rows, paths, survey.bins)) if paths > 1 else None)
        out = CoherentSums(record=record,
                           label_power=np.zeros((rows, len(survey.labels), survey.bins), np.float32))
        group = max(1, WORK // (2 * self.samples))
        for first in range(0, len(ping), group):
            some = slice(first, min(first + group, len(ping)))
            heard = [self._heard(place, first, *echoes)
                     for echoes in self._echoes(place, ping[some], source[some], first)]
            if sum(len(block["row"]) for block in heard):
                self._sum(heard, slice(2 * some.start, 2 * some.stop), out)
        return out

    def _echoes(self, place, ping, source, first):
        """Yield the numbers of pings (from `first` on 0), of shapes, the echoes, and the depth they come from."""
        position, rotation = self.survey.track.position[ping], self.survey.track.rotation()[ping]
        if self.sights.mirror:
            yield from self._overhead(place, position, rotation, first)
        if self.targets:
            yield from self._of_targets(place, len(ping), first)
        if self.smooth:
            yield from self.smooth(place.sources, position, source, self._worth_a_look(position, rotation))

    def _worth_a_look(self, position, rotation):
        """Which facets lie in the beams, for each ping: by the envelope of their side lobes along the platform."""
        sonar = self.survey.sonar
        lengths = np.array([sonar.transmit.length, sonar.receive.length]) / sonar.wavelength
        turned = np.array([0.0, self.shift])[:, None]

        def choose(number, centre, radius):
            towards = (centre - position[number]) @ rotation[number]
            distance = np.linalg.norm(towards, axis=1)
            u = np.maximum(np.abs(towards[:, 0]) - radius, 0) / np.maximum(distance, 1e-9) - turned
            envelope = np.minimum(1 / np.maximum(np.pi * lengths[:, None] * u, 1e-9), 1)
            return np.prod(envelope, axis=0) ** 2 > FAINT

        return choose

    def _of_targets(self, place, pings, first):
        lib = self.lib
        position, strength_db, label = (np.array(column) for column in zip(*self.targets))
        index = dr.arange(mi.UInt32, pings * len(position))
        number = index // dr.opaque(mi.UInt32, len(position))
        which = index - number * dr.opaque(mi.UInt32, len(position))
        ping = number + dr.opaque(mi.UInt32, first)
        point = lib.Array3f64(*(dr.gather(mi.Float64, upload(mi.Float64, axis), which) for axis in position.T))
        origin, source = place.origin(ping), place.source(ping)
        strength = dr.gather(mi.Float, upload(mi.Float, (10 ** (strength_db / 20)).astype(np.float32)), which)
        label = dr.gather(mi.UInt32, upload(mi.UInt32, label.astype(np.uint32)), which)
        # it may lie on a surface, which must not hide it
        ends = {folded: self.sights(place.sources, origin, source, point, mi.Vector3f(0, 0, 0), folded=folded,
                                    short=TARGET_RADIUS)
                for folded in {False} | {back for _, back, _ in self.sights.ways()}}
        nothing = dr.zeros(mi.Float, dr.width(strength))
        for there, back, sign in [(False, False, 1.0), *self.sights.ways()]:
            out, home = ends[there], ends[back]
            pressure = pressure_along_legs(strength, out.gain, home.gain) * sign
            pressure = dr.select(out.way.free & home.way.free & dr.isfinite(pressure), pressure, 0)
            yield number, label, Echoes(
                out=out.leg, back=home.leg, between=dr.zeros(mi.Float64, dr.width(pressure)),
                energy=dr.square(pressure), amplitude=(pressure, nothing), path=("b", "bs", "sbs")[there + back])

    def _overhead(self, place, position, rotation, first):
        """The echo of a flat surface, as the faces of either side hear it."""
        number = dr.arange(mi.UInt32, len(position))
        ping = number + dr.opaque(mi.UInt32, first)
        echoes, free = self.sights.overhead(place.sources, place.origin(ping), place.source(ping))
        # how far the platform's middle plane meets the surface from straight above, in Fresnel's units
        height, up = np.maximum(-position[:, 2], 1e-3), rotation[:, 2]
        aside = height * up[:, 1] / np.maximum(np.hypot(up[:, 0], up[:, 2]), 1e-9)
        sine, cosine = fresnel(aside * np.sqrt(4 / (self.survey.sonar.wavelength * height)))
        starboard = 0.5 + (cosine - 1j * sine) / (1 - 1j)
        label = dr.full(mi.UInt32, self.survey.geometry.surface_label, len(position))
        for side, share in ((-1.0, 1 - starboard), (1.0, starboard)):
            real, imaginary = (upload(mi.Float, part.astype(np.float32)) for part in (share.real, share.imag))
            pressure = dr.select(free, echoes.amplitude[0], 0)
            yield number, label, replace(echoes, amplitude=(pressure * real, pressure * imaginary)), side

    def _heard(self, place, first, number, label, echoes, side=None):
        """What the faces hear of echoes: NumPy arrays, of those within the record and on the face's side.

        `side` is -1 where it is port's face that hears them, 1 for starboard's; None: that which they come from.
        """
        ping = number + dr.opaque(mi.UInt32, first)
        still = echoes.out.travel_time + echoes.between + echoes.back.travel_time
        received = place.receive(ping, echoes.back.sent_towards, echoes.back.offset, still)
        delay, pressure, along, sides, cosines = received.delay, self.pressure, mi.Float(1), [], []
        for towards, (length, height) in zip((echoes.out.sent_towards, received.towards), self.faces):
            body = place.body(ping, towards)
            across = body.z * self.depression[0] - abs(body.y) * self.depression[1]
            along *= sinc(body.x * length)
            pressure = pressure * sinc(across * height)
            sides.append(body.y > 0 if side is None else dr.full(mi.Bool, side > 0, dr.width(body)))
            cosines.append(body.x)
        lobe = along
        if not place.still:
            # half-way between the lobes, see `survey`
            half = 0.5 * (cosines[1] - place.body(ping, echoes.back.sent_towards).x)
            lobe = sinc((cosines[0] + half) * self.faces[0][0]) * sinc((cosines[1] - half) * self.faces[1][0])
        cycles = delay * self.turns_per_second
        sine, cosine = dr.sincos(mi.Float(cycles - dr.floor(cycles)) * float(-2 * np.pi))
        real, imaginary = echoes.amplitude
        real, imaginary = real * cosine - imaginary * sine, real * sine + imaginary * cosine
        pressure = pressure * along
        start = place.origin(ping).z
        depth = -mi.Float((-start if echoes.back.folded else start) + echoes.back.offset.z)
        row = 2 * number + dr.select(sides[0], mi.UInt32(1), mi.UInt32(0))
        columns = {"row": row, "label": label, "delay": delay, "real": real * pressure, "depth": depth,
                   "imaginary": imaginary * pressure, "in_beam": lobe * lobe > BEAM_EDGE,
                   "same": sides[0] == sides[1]}
        dr.eval(columns)
        columns = {name: column.numpy() for name, column in columns.items()}
        half = 0.5 * self.survey.sonar.pulse_length
        window = self.survey.window
        good = columns.pop("same") & (columns["delay"] >= window[0] - half) & (columns["delay"] < window[1] + half)
        good &= (columns["real"] != 0) | (columns["imaginary"] != 0)
        return {name: column[good] for name, column in columns.items()} | {
            "path": np.full(np.count_nonzero(good), self.survey.paths.number(echoes.path) - 1)}

    def _sum(self, heard, rows, out):
        """Put a group's echoes into the record."""
        survey, samples, record = self.survey, self.samples, out.record
        heard = {name: np.concatenate([block[name] for block in heard]) for name in heard[0]}
        size = (rows.stop - rows.start) * samples
        begin = (heard["delay"] - 0.5 * survey.sonar.pulse_length - self.start) / self.step
        slot = np.floor(begin).astype(np.int64)
        place = heard["row"].astype(np.int64) * samples + slot
        # the samples at both ends are filled in part: echoes that follow each other add without steps, and each has the
        # energy of its pulse
        late = begin - slot
        whole = 1 / np.sqrt(1 - 2 * late * (1 - late) / self.per_pulse)
        shares = whole * (1 - late), whole * late
        total = 0
        for path in np.unique(heard["path"]):
            some = heard["path"] == path
            z = np.zeros((size // samples, samples), complex)
            for step, share in enumerate(shares):
                weights = (heard["real"] + 1j * heard["imaginary"].astype(float))[some] * share[some]
                z.real += np.bincount(place[some] + step, weights.real, size).reshape(z.shape)
                z.imag += np.bincount(place[some] + step, weights.imag, size).reshape(z.shape)
            z = np.cumsum(z, axis=1)
            z[:, self.per_pulse:] -= z[:, :-self.per_pulse].copy()
            if record.path_intensity is not None:
                record.path_intensity[rows, path] = self._means(np.abs(z) ** 2, 1)[..., 0]
            total = total + z
        record.pressure[rows] = self._means(total, record.pressure.shape[-1])
        record.intensity[rows] = self._means(np.abs(total) ** 2, 1)[..., 0]
        self._name(heard, slot, rows, out)

    def _means(self, samples, parts):
        """Means over `parts` parts of every bin, (rows, bins, parts), of what is constant over each sample."""
        survey = self.survey
        edge = survey.window[0] + survey.bin_length / parts * np.arange(survey.bins * parts + 1)
        edge = (edge - self.start) / self.step
        whole = np.floor(edge).astype(np.int64)
        share = (edge - whole) * samples[:, whole]
        sums = np.add.reduceat(samples, whole, axis=1)[:, :-1]
        # where two edges fall into one sample, reduceat gives that sample
        sums[:, np.diff(whole) == 0] = 0
        sums += np.diff(share, axis=1)
        return (sums * (parts * self.step / survey.bin_length)).reshape(len(samples), survey.bins, parts)

    def _name(self, heard, slot, rows, out):
        """Powers of the instances in every bin, and depth of the strongest, of those with their middles there."""
        survey, record = self.survey, out.record
        bins, labels = survey.bins, int(heard["label"].max()) + 1
        bin = np.floor((heard["delay"] - survey.window[0]) / survey.bin_length).astype(np.int64)
        bin = np.clip(bin, 0, bins - 1)                       # what the record hears of pulses from just outside
        row, label, seen = heard["row"].astype(np.int64), heard["label"], heard["in_beam"]
        record.in_beam[rows][row[seen], bin[seen]] = 1
        _, first, which = np.unique(((row * bins + bin) * labels + label) * self.samples + slot, return_index=True,
                                    return_inverse=True)
        power = np.abs(np.bincount(which, heard["real"]) + 1j * np.bincount(which, heard["imaginary"])) ** 2
        key, which = np.unique(((row * bins + bin) * labels + label)[first], return_inverse=True)
        power = np.bincount(which, power)
        energy = heard["real"].astype(float) ** 2 + heard["imaginary"].astype(float) ** 2
        which = np.searchsorted(key, (row * bins + bin) * labels + label)
        depth = np.bincount(which, energy * heard["depth"]) / np.bincount(which, energy)
        place, of = np.divmod(key, labels)
        out.label_power[rows][place // bins, of - 1, place % bins] = power
        order = np.lexsort((power, place))
        last = np.flatnonzero(np.diff(place[order], append=-1))
        best = order[last]
        record.depth[rows][np.divmod(place[best], bins)] = depth[best]
