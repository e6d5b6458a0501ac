"""What a rotating head hears, ping by ping: every echo with the beam of its transmission and of its own reception.

    y_p(t) = Σ_j a_j b_t(n_j) b_r(n'_jp) e^{-i2πf τ_jp} δ(t - τ_jp)  ─→  pulse, receiver, matched filter, noise

a_j -> the echoes around the head (`echoes`), n_j the direction they were sent in, n'_jp and τ_jp direction and
time of their reception, as the head has moved and turned by then (`underway`). Pings are rows of a grid over time
(`signal.beam_grid.RowSignals`); their Doppler factors are those of the beam's axis, and what an echo's own differs
from it is a delay and a turn.

A platform that stands still has the same echoes at every ping: they are made once, and pings take those about their own
bearings (`pairs`).

The pings of a block as a rotating head receives echoes: when, how strongly, and how far shifted by Doppler.

    factor = (c + v·n') / (c - v·n)

n -> direction that an echo was sent in, n' -> that it is received from, v -> the head's velocity at the transmission, c
-> sound speed there. A row's factor is that of the beam's axis.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.device.chance import ping_key
from mitsonar.signal.beam_grid import NoiseDensity, RowGrid, RowSignals
from mitsonar.signal.beam_grid.residual_doppler import residual_doppler
from mitsonar.sonar.motion.rotating_head import HeadTrajectory
from mitsonar.sonar.motion.track import rotation_matrix
from mitsonar.units import amplitude_from_db

from ..motion.underway import Underway
from ..pressure.array_survey import ArraySurvey
from .beam import StepBeam
from .echoes import HeadEchoes, Pairs, SortedEchoes, StepEchoes

SLOWEST = 1e-9                     # [m/s]: a head that is slower has no Doppler


class StepReceiver:
    """Receive the echoes of a block of pings."""
    # ping (B,); doppler (B,) [-]

    def __init__(self, survey: ArraySurvey, beam: StepBeam, underway: Underway, ping: np.ndarray):
        self._beam, self._motion, self._lib = beam, underway.motion(ping), arrays_of(mi.Float)
        rotation, velocity = survey.track.rotation()[ping], survey.velocity[ping]
        speed = survey.profile.at(-survey.track.position[ping, 2])
        self.doppler: np.ndarray | None = None
        if np.abs(velocity).max() > SLOWEST:
            closing = np.einsum("pk,pk->p", velocity, rotation[:, :, 0])
            self.doppler = (speed + closing) / (speed - closing)
        table = np.zeros((len(ping), 4, 4))
        table[:, :3, :3], table[:, 3, :3], table[:, 3, 3] = np.swapaxes(rotation, 1, 2), velocity, speed
        table[:, 0, 3] = 0.0 if self.doppler is None else self.doppler - 1
        self._table = upload(mi.Float, table.astype(np.float32))
        dr.eval(self._table)
        self._residual = residual_doppler(survey.pulse)
        self._numbers = [dr.opaque(mi.Float64, v) for v in (survey.frequency, survey.start, survey.sampling_rate)]

    def add(self, grid: RowGrid, pairs: Pairs) -> None:
        """Add echoes to the pings that hear them."""
        echoes, index, ping = pairs.echoes, pairs.index, pairs.row
        sent = dr.gather(mi.Vector3f, echoes.sent, index, pairs.active)
        towards = sent if echoes.towards is echoes.sent else dr.gather(mi.Vector3f, echoes.towards, index, pairs.active)
        delay = dr.gather(mi.Float64, echoes.delay, index, pairs.active)
        real, imaginary = (dr.gather(mi.Float, part, index, pairs.active) for part in (echoes.real, echoes.imaginary))
        x, y, z, moving = (dr.gather(self._lib.Array4f, self._table, 4 * ping + row, pairs.active) for row in range(4))
        heard = towards
        if self._motion is not None:
            distance = dr.gather(mi.Float, echoes.distance, index, pairs.active)
            received = self._motion.receive(ping, towards, distance, delay, moving[3])
            heard, delay = received.towards, received.delay
        pressure = self._beam.pressure(_along(x, y, z, sent), _along(x, y, z, heard))
        frequency, start, rate = self._numbers
        later, turned = mi.Float(0), mi.Float(0)
        if self.doppler is not None:
            velocity = mi.Vector3f(moving[0], moving[1], moving[2])
            closing, sending = dr.dot(velocity, towards), dr.dot(velocity, sent)
            rest = ((closing + sending) / (moving[3] - sending) - x[3]) / (1 + x[3])
            later, turned = self._residual.delay(rest), self._residual.phase(rest)
        cycles = delay * frequency
        sine, cosine = dr.sincos((mi.Float(cycles - dr.round(cycles)) - turned) * float(2 * np.pi))
        real, imaginary = real * cosine + imaginary * sine, imaginary * cosine - real * sine
        pressure = dr.select(pairs.active, pressure, 0)
        grid.add(column=mi.Float((delay + mi.Float64(later) - start) * rate), row=ping, real=real * pressure,
                 imaginary=imaginary * pressure)


def _along(x, y, z, direction):
    """Scene directions in the head's frame, whose axes are rows."""
    return mi.Vector3f(*(row[0] * direction.x + row[1] * direction.y + row[2] * direction.z for row in (x, y, z)))


ROWS = 256                         # pings that are formed together
STILL = 1e-9                       # [m], [-]: nothing moves


class StepSignals:
    """Make the compressed signals of a survey's pings."""

    def __init__(self, survey: ArraySurvey, beam: StepBeam, underway: Underway, echoes: StepEchoes, seed: int, *,
                 by_chance: bool = True):
        trajectory = survey.voyage.trajectory
        if not isinstance(trajectory, HeadTrajectory):
            raise ValueError("signals of steps are those of a rotating head; its own plan makes its survey")
        self._survey, self._beam, self._underway, self._echoes, self._seed = survey, beam, underway, echoes, int(seed)
        attitude = trajectory.platform.pose(survey.track.time)[1]
        # bearing 0, aside, and the axis that the head turns about: columns
        self._frame = rotation_matrix(*np.moveaxis(attitude, -1, 0)) @ trajectory.head.mounted
        self._position, self._looks = survey.track.position, survey.track.rotation()
        self._fixed = all(float(np.ptp(part, axis=0).max()) < STILL for part in (self._position, self._frame))
        self._signals = RowSignals(
            mi.Float, pulse=survey.pulse, sampling_rate=survey.sampling_rate, samples=survey.samples,
            lead=survey.lead, start=survey.start, sound_speed=survey.sound_speed(0),
            absorption_db=survey.absorption_db)
        self._by_chance = by_chance
        self._around: SortedEchoes | None = None

    def blocks(self, progress: Callable[[float, float], None] | None = None) -> Iterator[np.ndarray]:
        """Yield the signals of all pings in blocks: complex64 (pings, samples) [µPa]."""
        total = self._survey.track.pings
        for first in range(0, total, ROWS):
            ping = np.arange(first, min(first + ROWS, total))
            yield self._block(ping, progress)
            if progress is not None:
                progress(int(ping[-1]) + 1, total)

    def _block(self, ping: np.ndarray, progress: Callable[[float, float], None] | None) -> np.ndarray:
        survey, grid = self._survey, self._signals.grid(len(ping))
        receiver = StepReceiver(survey, self._beam, self._underway, ping)
        for pairs in self._pairs(ping, progress):
            receiver.add(grid, pairs)
        keys = np.array([ping_key(self._seed, int(one)) for one in ping], np.uint32)
        noise = NoiseDensity.of(survey.noise, survey.source_level_db) if self._by_chance else None
        signals = self._signals.form(grid, doppler=receiver.doppler, keys=keys, noise=noise)
        return signals * np.float32(amplitude_from_db(survey.source_level_db))

    def _pairs(self, ping: np.ndarray, progress: Callable[[float, float], None] | None) -> Iterator[Pairs]:
        """Yield the echoes that pings of a block hear."""
        if self._fixed:
            if self._around is None:
                self._around = SortedEchoes(self._frame[0], list(self._heard_at(int(ping[0]), everywhere=True)),
                                            self._beam.reach)
            yield from self._around.heard(self._looks[ping, :, 0])
        for row, number in enumerate(ping.tolist()):
            if not self._fixed:
                if progress is not None:           # echoes of large smooth surfaces take minutes a ping
                    progress(number, self._survey.track.pings)
                for echoes in self._heard_at(number, everywhere=False):
                    yield Pairs.all_of(echoes, row)
            if not self._by_chance:
                continue
            below = float(self._survey.depth_below[number])
            for echoes in self._echoes.by_chance(self._position[number], self._looks[number], below,
                                                 ping_key(self._seed, number)):
                yield Pairs.all_of(echoes, row)

    def _heard_at(self, ping: int, *, everywhere: bool) -> Iterator[HeadEchoes]:
        """Yield the echoes around the place of a ping: of scatterers, in its beam or everywhere, and coherent ones."""
        forward = [dr.opaque(mi.Float, float(part)) for part in self._looks[ping, :, 1]]
        reach = dr.opaque(mi.Float, self._beam.reach)

        def useful(direction: mi.Vector3f, distance: mi.Float) -> mi.Bool:
            return mi.Bool(True) if everywhere else abs(dr.dot(direction, mi.Vector3f(*forward))) < reach

        if self._by_chance:
            there = self._position[ping], self._frame[ping, :, 2], useful
            scatterers = self._echoes.of_scatterers(*there)
            if scatterers is not None:
                yield scatterers
            yield from self._echoes.mirrored(*there)
        yield from self._echoes.coherent(self._position[ping])
